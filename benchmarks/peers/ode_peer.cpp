// The Open Dynamics Engine in the comparison. SPDX-License-Identifier: BSD-3-Clause
#include <ode/ode.h>

#include "peer.hpp"

namespace {

class Ode {
 public:
  Ode(const peers::Scene& scene, const std::string& setting, double value)
      : scene_(scene), quick_(setting.find("quick") == 0), value_(value) {
    dInitODE2(0);
    world_ = dWorldCreate(), space_ = dSimpleSpaceCreate(nullptr), contacts_ = dJointGroupCreate(0);
    dWorldSetGravity(world_, scene.gravity.x(), scene.gravity.y(), scene.gravity.z());
    dWorldSetAutoDisableFlag(world_, 0);
    dWorldSetERP(world_, setting.find("ERP 0.8") == std::string::npos ? 0.2 : 0.8);
    dWorldSetQuickStepNumIterations(world_, 200);
    dWorldSetContactSurfaceLayer(world_, 0);
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) add(scene.bodies[i], i);
    for (const peers::Joint& j : scene.joints) add(j);
  }
  ~Ode() {
    dJointGroupDestroy(contacts_);
    dSpaceDestroy(space_);
    dWorldDestroy(world_);
    dCloseODE();
  }
  void advance(double) {
    peers::advance_in_steps(scene_, value_, [this](double h) {
      dSpaceCollide(space_, this, &Ode::meet);
      (quick_ ? dWorldQuickStep : dWorldStep)(world_, h);
      dJointGroupEmpty(contacts_);
    });
  }
  peers::Pose pose(int i) const {
    const dReal *x = dBodyGetPosition(bodies_[i]), *q = dBodyGetQuaternion(bodies_[i]);
    return {{x[0], x[1], x[2]}, {q[0], q[1], q[2], q[3]}};
  }

 private:
  void add(const peers::Body& b, std::size_t index) {
    dBodyID id = nullptr;
    if (!b.fixed) {
      id = dBodyCreate(world_);
      dMass mass;
      dMassSetParameters(&mass, b.mass, 0, 0, 0, b.inertia.x(), b.inertia.y(), b.inertia.z(), 0, 0,
                         0);
      dBodySetMass(id, &mass);
      const dQuaternion q = {b.q.w(), b.q.x(), b.q.y(), b.q.z()};
      dBodySetPosition(id, b.x.x(), b.x.y(), b.x.z()), dBodySetQuaternion(id, q);
      dBodySetLinearVel(id, b.v.x(), b.v.y(), b.v.z()),
          dBodySetAngularVel(id, b.w.x(), b.w.y(), b.w.z());
    }
    bodies_.push_back(id);
    for (const peers::Shape& s : b.shapes) {
      const Eigen::Vector3d n = s.normal.normalized();
      const dGeomID g = s.kind == "plane" ? dCreatePlane(space_, n.x(), n.y(), n.z(), n.dot(b.x))
                        : s.kind == "box" ? dCreateBox(space_, s.size.x(), s.size.y(), s.size.z())
                                          : dCreateSphere(space_, s.radius);
      dGeomSetData(g, reinterpret_cast<void*>(index));
      if (id) dGeomSetBody(g, id), dGeomSetOffsetPosition(g, s.at.x(), s.at.y(), s.at.z());
    }
  }
  void add(const peers::Joint& j) {
    const Eigen::Vector3d &p = j.at, &a = j.axis;
    const dJointID id = j.kind == "hinge"  ? dJointCreateHinge(world_, nullptr)
                        : j.kind == "ball" ? dJointCreateBall(world_, nullptr)
                                           : dJointCreateSlider(world_, nullptr);
    dJointAttach(id, bodies_[j.first], j.second < 0 ? nullptr : bodies_[j.second]);
    if (j.kind == "hinge")
      dJointSetHingeAnchor(id, p.x(), p.y(), p.z()), dJointSetHingeAxis(id, a.x(), a.y(), a.z());
    if (j.kind == "ball") dJointSetBallAnchor(id, p.x(), p.y(), p.z());
    if (j.kind == "slider") dJointSetSliderAxis(id, a.x(), a.y(), a.z());
  }
  /// Contacts of two shapes. Friction is a pyramid; its first direction is that of the slip.
  static void meet(void* data, dGeomID a, dGeomID b) {
    const Ode& self = *static_cast<Ode*>(data);
    const dBodyID first = dGeomGetBody(a), second = dGeomGetBody(b);
    const peers::Law* law =
        self.scene_.law(static_cast<int>(reinterpret_cast<std::size_t>(dGeomGetData(a))),
                        static_cast<int>(reinterpret_cast<std::size_t>(dGeomGetData(b))));
    if (first == second || !law) return;
    dContactGeom found[8];
    const int n = dCollide(a, b, 8, found, sizeof(dContactGeom));
    for (int i = 0; i < n; ++i) {
      dContact c = {};
      c.geom = found[i];
      c.surface.mode = dContactApprox1 | dContactBounce;
      c.surface.mu = law->friction, c.surface.bounce = law->restitution;
      Eigen::Vector3d slip = velocity(first, found[i].pos) - velocity(second, found[i].pos);
      const Eigen::Vector3d normal(found[i].normal[0], found[i].normal[1], found[i].normal[2]);
      slip -= normal * normal.dot(slip);
      if (slip.norm() > 1e-9) {
        c.surface.mode |= dContactFDir1;
        slip.normalize();
        for (int k = 0; k < 3; ++k) c.fdir1[k] = slip[k];
      }
      dJointAttach(dJointCreateContact(self.world_, self.contacts_, &c), first, second);
    }
  }
  static Eigen::Vector3d velocity(dBodyID body, const dReal* p) {
    dVector3 v = {};
    if (body) dBodyGetPointVel(body, p[0], p[1], p[2], v);
    return {v[0], v[1], v[2]};
  }

  const peers::Scene& scene_;
  bool quick_;
  double value_;
  dWorldID world_;
  dSpaceID space_;
  dJointGroupID contacts_;
  std::vector<dBodyID> bodies_;
};

}  // namespace

int main(int argc, char** argv) { return peers::main<Ode>(argc, argv); }

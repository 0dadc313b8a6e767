// Bullet in the comparison. SPDX-License-Identifier: BSD-3-Clause
#include <BulletDynamics/MLCPSolvers/btDantzigSolver.h>
#include <BulletDynamics/MLCPSolvers/btMLCPSolver.h>
#include <btBulletDynamicsCommon.h>

#include <memory>

#include "peer.hpp"

namespace {

const peers::Scene* scene_of_callback = nullptr;

/// Laws belong to pairs of bodies; Bullet's own are products of theirs.
bool set_law(btManifoldPoint& point, const btCollisionObjectWrapper* a, int, int,
             const btCollisionObjectWrapper* b, int, int) {
  const peers::Law* law = scene_of_callback->law(a->getCollisionObject()->getUserIndex(),
                                                 b->getCollisionObject()->getUserIndex());
  point.m_combinedFriction = law ? law->friction : 0;
  point.m_combinedRestitution = law ? law->restitution : 0;
  return true;
}

btVector3 bt(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

class Bullet {
 public:
  Bullet(const peers::Scene& scene, const std::string& setting, double value)
      : scene_(scene),
        value_(value),
        dispatcher_(&configuration_),
        mlcp_(&dantzig_),
        world_(&dispatcher_, &broadphase_,
               setting.find("Dantzig") == 0 ? static_cast<btConstraintSolver*>(&mlcp_) : &impulses_,
               &configuration_) {
    scene_of_callback = &scene;
    gContactAddedCallback = set_law;
    configuration_.setPlaneConvexMultipointIterations(4, 4);  // all corners of a box at once
    world_.setGravity(bt(scene.gravity));
    btContactSolverInfo& info = world_.getSolverInfo();
    info.m_restitutionVelocityThreshold = 0;
    if (setting.find("1000 iterations") == 0) {
      info.m_numIterations = 1000;
      info.m_leastSquaresResidualThreshold = 1e-28;  // ends earlier where it has converged
    }
    gContactBreakingThreshold = setting.find("no contact ahead") != std::string::npos
                                    ? 1e-9
                                    : 0.02;  // gaps that count as contacts, m
    if (setting != "defaults")
      info.m_splitImpulsePenetrationThreshold = 0;  // corrections never become velocities
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) add(scene.bodies[i], static_cast<int>(i));
    for (const peers::Joint& j : scene.joints) add(j);
  }
  ~Bullet() {
    for (auto& j : joints_) world_.removeConstraint(j.get());
    for (auto& b : bodies_) world_.removeRigidBody(b.get());
  }
  void advance(double) {
    peers::advance_in_steps(scene_, value_, [this](double h) { world_.stepSimulation(h, 0); });
  }
  peers::Pose pose(int i) const {
    const btTransform& t = bodies_[i]->getWorldTransform();
    const btVector3& x = t.getOrigin();
    const btQuaternion q = t.getRotation();
    return {{x.x(), x.y(), x.z()}, {q.w(), q.x(), q.y(), q.z()}};
  }

 private:
  btCollisionShape* shape(const peers::Shape& s) {
    btCollisionShape* made = nullptr;
    if (s.kind == "plane") made = new btStaticPlaneShape(bt(s.normal.normalized()), 0);
    if (s.kind == "box") made = new btBoxShape(bt(s.size / 2));
    if (s.kind == "sphere") made = new btSphereShape(s.radius);
    if (s.kind == "box") made->setMargin(1e-3);
    shapes_.emplace_back(made);
    return made;
  }
  void add(const peers::Body& b, int index) {
    auto compound = std::make_unique<btCompoundShape>();
    for (const peers::Shape& s : b.shapes)
      if (b.shapes.size() > 1)
        compound->addChildShape(btTransform(btQuaternion::getIdentity(), bt(s.at)), shape(s));
    btCollisionShape* whole = b.shapes.size() == 1 ? shape(b.shapes[0]) : compound.get();
    shapes_.push_back(std::move(compound));
    btRigidBody::btRigidBodyConstructionInfo info(b.mass, nullptr, whole, bt(b.inertia));
    info.m_startWorldTransform =
        btTransform(btQuaternion(b.q.x(), b.q.y(), b.q.z(), b.q.w()), bt(b.x));
    auto body = std::make_unique<btRigidBody>(info);
    body->setLinearVelocity(bt(b.v)), body->setAngularVelocity(bt(b.w));
    body->setActivationState(DISABLE_DEACTIVATION);
    body->setUserIndex(index);
    body->setCollisionFlags(body->getCollisionFlags() |
                            btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK);
    if (b.material.empty())
      body->setCollisionFlags(body->getCollisionFlags() |
                              btCollisionObject::CF_NO_CONTACT_RESPONSE);
    world_.addRigidBody(body.get());
    bodies_.push_back(std::move(body));
  }
  void add(const peers::Joint& j) {
    btRigidBody& a = *bodies_[j.first];
    btRigidBody& b = j.second < 0 ? btTypedConstraint::getFixedBody() : *bodies_[j.second];
    // The frame at the joint with `along` as the axis, in the axes of a body.
    const auto frame = [&j](const btRigidBody& body, const Eigen::Vector3d& along) {
      const Eigen::Quaterniond q = Eigen::Quaterniond::FromTwoVectors(along, j.axis);
      return body.getWorldTransform().inverse() *
             btTransform(btQuaternion(q.x(), q.y(), q.z(), q.w()), bt(j.at));
    };
    if (j.kind == "hinge") {
      const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
      joints_.push_back(std::make_unique<btHingeConstraint>(a, b, frame(a, z), frame(b, z)));
    } else if (j.kind == "ball") {
      const Eigen::Vector3d axis = j.axis;
      joints_.push_back(std::make_unique<btPoint2PointConstraint>(a, b, frame(a, axis).getOrigin(),
                                                                  frame(b, axis).getOrigin()));
    } else {
      const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
      auto slider = std::make_unique<btSliderConstraint>(a, b, frame(a, x), frame(b, x), false);
      slider->setLowerLinLimit(1), slider->setUpperLinLimit(-1);  // free
      slider->setLowerAngLimit(0), slider->setUpperAngLimit(0);
      joints_.push_back(std::move(slider));
    }
    world_.addConstraint(joints_.back().get(), true);
  }

  const peers::Scene& scene_;
  double value_;
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_;
  btDbvtBroadphase broadphase_;
  btSequentialImpulseConstraintSolver impulses_;
  btDantzigSolver dantzig_;
  btMLCPSolver mlcp_;
  std::vector<std::unique_ptr<btCollisionShape>> shapes_;
  std::vector<std::unique_ptr<btRigidBody>> bodies_;
  std::vector<std::unique_ptr<btTypedConstraint>> joints_;
  btDiscreteDynamicsWorld world_;
};

}  // namespace

int main(int argc, char** argv) { return peers::main<Bullet>(argc, argv); }

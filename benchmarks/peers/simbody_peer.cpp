// Simbody in the comparison. SPDX-License-Identifier: BSD-3-Clause
#include <Simbody.h>

#include <memory>

#include "peer.hpp"

namespace {

namespace st = SimTK;

st::Vec3 vec(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
st::Rotation rotation(const Eigen::Quaterniond& q) {
  return st::Rotation(st::Quaternion(q.w(), q.x(), q.y(), q.z()));
}

class Simbody {
 public:
  Simbody(const peers::Scene& scene, const std::string& setting, double value)
      : scene_(scene),
        value_(value),
        matter_(system_),
        forces_(system_),
        gravity_(forces_, matter_, vec(scene.gravity)) {
    bodies_.resize(scene.bodies.size());
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) add(i);
    for (std::size_t j = 0; j < scene.joints.size(); ++j) close(j);
    for (std::size_t a = 0; a < scene.bodies.size(); ++a)
      for (std::size_t b = a + 1; b < scene.bodies.size(); ++b) touch(a, b);
    st::State state = system_.realizeTopology();
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) start(i, state);
    if (setting.find("SemiExplicitEuler") == 0) {
      // Speeds below which nothing bounces, and below which friction is that of rest: as good as
      // none.
      euler_ = std::make_unique<st::SemiExplicitEulerTimeStepper>(system_);
      euler_->setDefaultImpactCaptureVelocity(1e-6);
      euler_->setDefaultImpactMinCORVelocity(1e-6);
      euler_->setDefaultFrictionTransitionVelocity(1e-6);
      euler_->setConstraintTolerance(1e-9);
      if (setting.find("PGS") != std::string::npos)
        euler_->setImpulseSolverType(st::SemiExplicitEulerTimeStepper::PGS);
      if (setting.find("no projection") != std::string::npos)
        euler_->setPositionProjectionMethod(st::SemiExplicitEulerTimeStepper::NoPositionProjection);
      euler_->initialize(state);
      return;
    }
    if (scene.has_contacts())
      throw std::invalid_argument("its integrators have compliant contact alone");
    if (setting == "RungeKuttaMerson")
      integrator_ = std::make_unique<st::RungeKuttaMersonIntegrator>(system_);
    else
      integrator_ = std::make_unique<st::CPodesIntegrator>(system_);
    integrator_->setAccuracy(value);
    stepper_ = std::make_unique<st::TimeStepper>(system_, *integrator_);
    stepper_->initialize(state);
  }
  void advance(double t) {
    if (stepper_)
      stepper_->stepTo(t);
    else
      peers::advance_in_steps(scene_, value_,
                              [this](double h) { euler_->stepTo(euler_->getTime() + h); });
  }
  peers::Pose pose(int i) const {
    const st::State& state = stepper_ ? stepper_->getState() : euler_->getState();
    system_.realize(state, st::Stage::Position);
    const st::Transform& x = bodies_[i].getBodyTransform(state);
    const st::Quaternion q = x.R().convertRotationToQuaternion();
    return {{x.p()[0], x.p()[1], x.p()[2]}, {q[0], q[1], q[2], q[3]}};
  }

 private:
  st::MobilizedBody& body(int i) { return i < 0 ? matter_.updGround() : bodies_[i]; }
  void add(std::size_t i) {
    const peers::Body& b = scene_.bodies[i];
    if (b.fixed) {
      bodies_[i] = st::MobilizedBody::Weld(matter_.Ground(), st::Transform(rotation(b.q), vec(b.x)),
                                           st::Body::Massless(), st::Transform());
      return;
    }
    const st::Body::Rigid rigid(
        st::MassProperties(b.mass, st::Vec3(0), st::Inertia(vec(b.inertia))));
    if (b.joint < 0) {
      bodies_[i] =
          st::MobilizedBody::Free(matter_.Ground(), st::Transform(), rigid, st::Transform());
      return;
    }
    const peers::Joint& j = scene_.joints[b.joint];
    const st::Rotation axes = this->axes(j);
    const auto frame = [&](const peers::Body& of) {
      const st::Transform x(rotation(of.q), vec(of.x));
      return ~x * st::Transform(axes, vec(j.at));
    };
    const st::Transform inner = j.second < 0 ? st::Transform(axes, vec(j.at))
                                             : frame(scene_.bodies[j.second]),
                        outer = frame(b);
    if (j.kind == "hinge") bodies_[i] = st::MobilizedBody::Pin(body(j.second), inner, rigid, outer);
    if (j.kind == "ball") bodies_[i] = st::MobilizedBody::Ball(body(j.second), inner, rigid, outer);
    if (j.kind == "slider")
      bodies_[i] = st::MobilizedBody::Slider(body(j.second), inner, rigid, outer);
  }
  /// World axes with the joint's as Simbody has it: z of a pin, x of a slider.
  static st::Rotation axes(const peers::Joint& j) {
    return j.kind == "ball" ? st::Rotation()
                            : st::Rotation(st::UnitVec3(vec(j.axis)),
                                           st::CoordinateAxis(j.kind == "hinge" ? 2 : 0));
  }
  void close(std::size_t index) {
    const peers::Joint& j = scene_.joints[index];
    if (scene_.bodies[j.first].joint == static_cast<int>(index)) return;
    if (j.kind != "ball") throw std::invalid_argument("loops are closed by balls");
    const auto local = [&](int i) {
      return i < 0 ? j.at
                   : Eigen::Vector3d(scene_.bodies[i].q.conjugate() * (j.at - scene_.bodies[i].x));
    };
    st::Constraint::Ball(body(j.first), vec(local(j.first)), body(j.second), vec(local(j.second)));
  }
  void touch(std::size_t a, std::size_t b) {
    const peers::Law* law = scene_.law(static_cast<int>(a), static_cast<int>(b));
    if (!law) return;
    const double e = law->restitution, mu = law->friction;
    const peers::Body& first = scene_.bodies[a];
    for (const peers::Shape& s : scene_.bodies[b].shapes) {
      if (first.shapes[0].kind == "sphere") {
        matter_.adoptUnilateralContact(
            new st::SphereSphereContact(bodies_[a], vec(first.shapes[0].at), first.shapes[0].radius,
                                        bodies_[b], vec(s.at), s.radius, e, mu, mu, 0));
        continue;
      }
      // The plane through the origin of its body: SpherePlaneContact of 3.7 takes any other height
      // for zero.
      const st::UnitVec3 n(vec(first.shapes[0].normal));
      const auto point = [&](const Eigen::Vector3d& at) {
        return new st::PointPlaneContact(bodies_[a], n, 0, bodies_[b], vec(at), e, mu, mu, 0);
      };
      if (s.kind == "sphere")
        matter_.adoptUnilateralContact(new st::SpherePlaneContact(
            bodies_[a], n, 0, bodies_[b], vec(s.at), s.radius, e, mu, mu, 0));
      else
        for (int corner = 0; corner < 8; ++corner)
          matter_.adoptUnilateralContact(point(s.size.cwiseProduct(Eigen::Vector3d(
              corner & 1 ? .5 : -.5, corner & 2 ? .5 : -.5, corner & 4 ? .5 : -.5))));
    }
  }
  void start(std::size_t i, st::State& state) {
    const peers::Body& b = scene_.bodies[i];
    if (b.fixed) return;
    st::MobilizedBody& mobile = bodies_[i];
    if (b.joint < 0) {
      mobile.setQToFitTransform(state, st::Transform(rotation(b.q), vec(b.x)));
      mobile.setUToFitVelocity(state, st::SpatialVec(vec(b.w), vec(b.v)));
      return;
    }
    const peers::Joint& j = scene_.joints[b.joint];
    const Eigen::Vector3d none = Eigen::Vector3d::Zero();
    const Eigen::Vector3d w = b.w - (j.second < 0 ? none : scene_.bodies[j.second].w);
    const Eigen::Vector3d v = b.v - (j.second < 0 ? none : scene_.bodies[j.second].v);
    if (j.kind == "hinge") mobile.setOneU(state, 0, j.axis.dot(w));
    if (j.kind == "slider") mobile.setOneU(state, 0, j.axis.dot(v));
    if (j.kind == "ball")
      for (int k = 0; k < 3; ++k) mobile.setOneU(state, k, w[k]);
  }

  const peers::Scene& scene_;
  double value_;
  st::MultibodySystem system_;
  st::SimbodyMatterSubsystem matter_;
  st::GeneralForceSubsystem forces_;
  st::Force::Gravity gravity_;
  std::vector<st::MobilizedBody> bodies_;
  std::unique_ptr<st::SemiExplicitEulerTimeStepper> euler_;
  std::unique_ptr<st::Integrator> integrator_;
  std::unique_ptr<st::TimeStepper> stepper_;
};

}  // namespace

int main(int argc, char** argv) { return peers::main<Simbody>(argc, argv); }

// Siconos in the comparison. SPDX-License-Identifier: BSD-3-Clause
#include <RigidBodyDS.hpp>
#include <SiconosJoints.hpp>
#include <SiconosKernel.hpp>
#include <SolverOptions.h>

#include <memory>

#include "peer.hpp"

namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

SP::SiconosVector vec(const Vector3d& v) {
  auto out = std::make_shared<SiconosVector>(3);
  for (unsigned k = 0; k < 3; ++k) (*out)(k) = v[k];
  return out;
}

/// A sphere of the first body, or a corner as one of radius 0, on a plane of the world or on a
/// sphere of the second body. Its own relation at the exact points: those of its Bullet manager
/// stay in a manifold and leave gaps of their own.
class Touch : public NewtonEuler3DR {
 public:
  Touch(const Vector3d& at, double radius, const Vector3d& place, const Vector3d& normal)
      : at_(at), place_(place), normal_(normal), radius_(radius) {}
  Touch(const Vector3d& at, double radius, const Vector3d& other, double other_radius)
      : at_(at), place_(other), radius_(radius), other_radius_(other_radius) {}

  void computeh(double, const BlockVector& q, SiconosVector& y) override {
    const Vector3d p = point(q, 0, at_);
    const bool plane = q.size() == 7;
    const Vector3d between = p - (plane ? place_ : point(q, 7, place_));
    const Vector3d n = plane ? normal_ : Vector3d(between.normalized());
    y.setValue(0, between.dot(n) - radius_ - other_radius_);
    setpc1(vec(p - radius_ * n));
    setpc2(vec(p - n * (plane ? between.dot(n) : between.norm() - other_radius_)));
    setnc(vec(n));
  }

 private:
  static Vector3d point(const BlockVector& q, unsigned k, const Vector3d& at) {
    const Quaterniond turn(q.getValue(k + 3), q.getValue(k + 4), q.getValue(k + 5),
                           q.getValue(k + 6));
    return Vector3d(q.getValue(k), q.getValue(k + 1), q.getValue(k + 2)) + turn * at;
  }

  Vector3d at_, place_, normal_ = Vector3d::Zero();
  double radius_, other_radius_ = 0;
};

/// Moreau and Jean's scheme, theta = 1/2.
class SiconosEngine {
 public:
  SiconosEngine(const peers::Scene& scene, const std::string& setting, double value)
      : scene_(scene),
        value_(value),
        system_(std::make_shared<NonSmoothDynamicalSystem>(0, 2 * scene.end)) {
    bodies_.resize(scene.bodies.size());
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) add(i);
    for (const peers::Joint& joint : scene.joints) hold(joint);
    for (std::size_t a = 0; a < scene.bodies.size(); ++a)
      for (std::size_t b = 0; b < scene.bodies.size(); ++b) touch(a, b);
    const double h = scene.end / (peers::kSamples * std::max(1, static_cast<int>(value)));
    const auto times = std::make_shared<TimeDiscretisation>(0, h);
    if (setting.find("projection") == std::string::npos) {
      simulation_ = std::make_shared<TimeStepping>(
          system_, times, std::make_shared<MoreauJeanOSI>(0.5), impulses());
    } else {
      simulation_ = std::make_shared<TimeSteppingDirectProjection>(
          system_, times, std::make_shared<MoreauJeanDirectProjectionOSI>(0.5), impulses(),
          std::make_shared<MLCPProjectOnConstraints>(SICONOS_MLCP_ENUM, 1.0));
    }
    simulation_->setNewtonTolerance(1e-12);
    simulation_->setNewtonMaxIteration(50);
  }
  void advance(double) {
    peers::advance_in_steps(scene_, value_, [this](double) {
      simulation_->computeOneStep();
      simulation_->nextStep();
    });
  }
  peers::Pose pose(int i) const {
    if (!bodies_[i]) return {scene_.bodies[i].x, scene_.bodies[i].q};
    const SiconosVector& q = *bodies_[i]->q();
    return {{q(0), q(1), q(2)}, {q(3), q(4), q(5), q(6)}};
  }

 private:
  void add(std::size_t i) {
    const peers::Body& b = scene_.bodies[i];
    if (b.fixed) return;
    const auto place = std::make_shared<SiconosVector>(7);
    const auto velocity = std::make_shared<SiconosVector>(6);
    const auto inertia = std::make_shared<SimpleMatrix>(3, 3);
    const Vector3d w = b.q.conjugate() * b.w;  // in the body's axes
    const double pose[] = {b.x.x(), b.x.y(), b.x.z(), b.q.w(), b.q.x(), b.q.y(), b.q.z()};
    for (unsigned k = 0; k < 7; ++k) (*place)(k) = pose[k];
    for (unsigned k = 0; k < 3; ++k) {
      (*velocity)(k) = b.v[k];
      (*velocity)(3 + k) = w[k];
      (*inertia)(k, k) = b.inertia[k];
    }
    bodies_[i] = std::make_shared<RigidBodyDS>(place, velocity, b.mass, inertia);
    bodies_[i]->setFExtPtr(vec(b.mass * scene_.gravity));
    system_->insertDynamicalSystem(bodies_[i]);
  }
  void hold(const peers::Joint& j) {
    const SP::RigidBodyDS first = bodies_[j.first];
    const SP::RigidBodyDS second = j.second < 0 ? SP::RigidBodyDS() : bodies_[j.second];
    SP::NewtonEulerJointR joint;
    if (j.kind == "hinge")
      joint = std::make_shared<PivotJointR>(vec(j.at), vec(j.axis), true, first, second);
    if (j.kind == "ball") joint = std::make_shared<KneeJointR>(vec(j.at), true, first, second);
    if (j.kind == "slider")
      joint = std::make_shared<PrismaticJointR>(vec(j.axis), true, first, second);
    const auto law = std::make_shared<EqualityConditionNSL>(joint->numberOfConstraints());
    system_->link(std::make_shared<Interaction>(law, joint), first, second);
  }
  /// Shapes of `a` on planes of `b`, or on its spheres, which are taken once.
  void touch(std::size_t a, std::size_t b) {
    const peers::Law* found = scene_.law(static_cast<int>(a), static_cast<int>(b));
    if (found == nullptr || a == b || scene_.bodies[a].fixed) return;
    const auto law =
        std::make_shared<NewtonImpactFrictionNSL>(found->restitution, 0, found->friction, 3);
    const auto link = [&](const SP::NewtonEuler3DR& relation, const SP::RigidBodyDS& second) {
      system_->link(std::make_shared<Interaction>(law, relation), bodies_[a], second);
    };
    for (const peers::Shape& of_a : scene_.bodies[a].shapes)
      for (const peers::Shape& of_b : scene_.bodies[b].shapes) {
        if (of_a.kind == "sphere" && of_b.kind == "sphere" && a < b)
          link(std::make_shared<Touch>(of_a.at, of_a.radius, of_b.at, of_b.radius), bodies_[b]);
        if (of_b.kind != "plane") continue;
        const Vector3d place = scene_.bodies[b].x + of_b.at;
        if (of_a.kind == "sphere")
          link(std::make_shared<Touch>(of_a.at, of_a.radius, place, of_b.normal), {});
        else
          for (int corner = 0; corner < 8; ++corner)
            link(std::make_shared<Touch>(of_a.at + of_a.size.cwiseProduct(Vector3d(
                                                       corner & 1 ? .5 : -.5, corner & 2 ? .5 : -.5,
                                                       corner & 4 ? .5 : -.5)),
                                         0, place, of_b.normal),
                 {});
      }
  }
  /// Contacts by Gauss-Seidel; with joints as a mixed problem.
  SP::OneStepNSProblem impulses() const {
    SP::LinearOSNS out;
    if (scene_.has_contacts() && scene_.joints.empty())
      out = std::make_shared<FrictionContact>(3, SICONOS_FRICTION_3D_NSGS);
    else
      out = std::make_shared<GenericMechanical>(SICONOS_FRICTION_3D_ONECONTACT_NSN);
    out->numericsSolverOptions()->iparam[SICONOS_IPARAM_MAX_ITER] = 10000;
    out->numericsSolverOptions()->dparam[SICONOS_DPARAM_TOL] = 1e-12;
    return out;
  }

  const peers::Scene& scene_;
  double value_;
  SP::NonSmoothDynamicalSystem system_;
  std::vector<SP::RigidBodyDS> bodies_;
  SP::TimeStepping simulation_;
};

}  // namespace

int main(int argc, char** argv) { return peers::main<SiconosEngine>(argc, argv); }

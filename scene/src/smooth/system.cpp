// Tether: unknowns and state of a smooth scene. SPDX-License-Identifier: BSD-3-Clause
#include "system.hpp"

#include <algorithm>

#include "effects/list.hpp"
#include "mechanics/quaternions.hpp"

namespace tether::scene::smooth {

System::System(const Scene& scene, const Units& units)
    : form_(scene.smooth.value_or(SmoothOptions{}).formulation),
      units_(units),
      bodies_(scene),
      rows_(scene, bodies_.all()),
      in_use_(rows_, bodies_),
      forces_(effects::make_forces(scene, bodies_.all())),
      invariants_(scene, bodies_, forces_, first_work()),
      dynamics_(rows_, bodies_, form_ == Formulation::index0),
      terms_{bodies_, rows_, forces_} {
  kinks_ = effects::kinks_of(scene);
  size_ = first_multiplier();
  if (form_ == Formulation::index1) size_ += rows();
  if (form_ == Formulation::stabilised_index2) size_ += 2 * rows();
  loads_.resize(at(moving()));
  pulls_.resize(at(moving()));
  joint_values_.setZero(2 * rows());
  if (form_ == Formulation::index0)
    acceleration_jacobian_ = std::make_unique<AccelerationJacobian>(terms_, dynamics_);
}

double System::absolute_tolerance(int i, double tolerance) const {
  // Multipliers follow the state; where rows depend on each other they are known to round-off / eps
  // only, and at a singular position they have a pole. Newton's test is left to the state.
  return i < first_multiplier() ? tolerance : 1e10 * tolerance;
}

Eigen::VectorXd System::start_state() const {
  Eigen::VectorXd y = Eigen::VectorXd::Zero(size_);
  std::copy(bodies_.start().begin(), bodies_.start().end(), y.data());
  return y;
}

void System::update(double t, const double* y) {
  rows_.set_time(t);
  bodies_.set_time(t);
  bodies_.set_state(y);
}

void System::choose_rows(double t, const double* y, double tolerance) {
  update(t, y);
  in_use_.choose(tolerance);
}

std::vector<std::string> System::dependent_joints(double t, const double* y) {
  constexpr double kNear = 1e-3;  // of rows of unit length
  std::vector<std::string> names;
  if (rows() == 0) return names;
  update(t, y);
  in_use_.look_now();
  if (in_use_.weakest_pivot() > kNear) return names;
  SparseJointGradient gradient(rows_, bodies_);
  gradient.factor(std::vector<char>(at(rows()), 1), kNear);
  for (const int row : gradient.dependent()) {
    const std::string name = rows_.joint_of(row);
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  return names;
}

void System::keep_invariants_of(double t, const Eigen::VectorXd& y) {
  update(t, y.data());
  invariants_.keep(t, y.data());
}

void System::complete(double t, Eigen::VectorXd& y, Eigen::VectorXd& yp) {
  update(t, y.data());
  sum_forces(nullptr);
  torques_to_body_axes(loads_);
  dynamics_.solve(loads_);
  yp.setZero(size_);
  for (int k = 0; k < moving(); ++k) {
    const double* s = y.data() + kBody * k;
    double* p = yp.data() + kBody * k;
    Eigen::Map<Vector3d>(p + kPosition) = Eigen::Map<const Vector3d>(s + kVelocity);
    Eigen::Map<Eigen::Vector4d>(p + kQuaternion) =
        quaternion_rate(s + kQuaternion, Eigen::Map<const Vector3d>(s + kSpin));
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(p + kVelocity) =
        dynamics_.accelerations().segment<6>(6 * k);
  }
  const Eigen::VectorXd& lambda = dynamics_.multipliers();
  if (invariants_.has_work()) yp[first_work()] = power(lambda.data());
  if (form_ != Formulation::index0) y.segment(first_multiplier(), rows()) = lambda;
  if (form_ == Formulation::stabilised_index2) y.segment(first_eta(), rows()).setZero();
}

std::vector<std::string> System::effect_names() const {
  std::vector<std::string> names;
  for (const auto& force : forces_) names.emplace_back(force->name());
  names.emplace_back("joints");
  names.emplace_back("equations of motion");
  return names;
}

Diagnostics System::diagnostics(double t, const double* y) {
  Diagnostics d;
  d.drift = drift(t, y);
  for (const auto& force : forces_) d.potential_energy += force->potential(bodies_.all());
  d.kinetic_energy = invariants_.energy() - d.potential_energy;
  d.momentum = bodies_.momentum();
  d.angular_momentum = bodies_.angular_momentum();
  return d;
}

// Forces follow from the state: those among the unknowns are held to no tolerance.
scene::Forces System::forces(double t, const double* y, const joints::Reactions& reactions) {
  update(t, y);
  sum_forces(nullptr);
  torques_to_body_axes(loads_);
  dynamics_.solve(loads_);
  scene::Forces out;
  out.joints = reactions.find(rows_, bodies_.all(), dynamics_.multipliers().data());
  for (const auto& force : forces_) force->report(bodies_.all(), out);
  return out;
}

}  // namespace tether::scene::smooth

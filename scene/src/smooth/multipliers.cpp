// Tether: accelerations and multipliers of a state. SPDX-License-Identifier: BSD-3-Clause
#include "quaternions.hpp"
#include "system.hpp"

namespace tether::scene::smooth {

namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

}  // namespace

void System::form_gradient() {
  G_.setZero(m_, 6 * moving());
  GM_.resize(m_, 6 * moving());
  each_row([&](const auto& row) {
    each_unit_load(row, [&](int i, int body, const Vector3d& force, const Vector3d& torque) {
      const int slot = bodies_.inertia[at(body)].slot;
      G_.block<1, 3>(row.row + i, 6 * slot) += force.transpose();
      G_.block<1, 3>(row.row + i, 6 * slot + 3) += torque.transpose();
    });
  });
  for (int k = 0; k < moving(); ++k) {
    const Inertia& inertia = bodies_.inertia[at(body_of_slot_[at(k)])];
    GM_.middleCols<3>(6 * k) = G_.middleCols<3>(6 * k) / inertia.mass;
    GM_.middleCols<3>(6 * k + 3).noalias() = G_.middleCols<3>(6 * k + 3) * inertia.inverse;
  }
  S_.noalias() = GM_ * G_.transpose();
}

void System::solve_multipliers() {
  for (int k = 0; k < moving(); ++k) {
    const int b = body_of_slot_[at(k)];
    const Inertia& inertia = bodies_.inertia[at(b)];
    free_.segment<3>(6 * k) = loads_[at(k)].force / inertia.mass;
    free_.segment<3>(6 * k + 3) = inertia.inverse * loads_[at(k)].torque_body;
    bodies_.frames[at(b)].a.setZero();
    bodies_.frames[at(b)].alpha.setZero();
  }
  a_ = free_;
  if (m_ == 0) return;
  form_gradient();
  each_row([&](const auto& row) {
    row.template rows<2>(bodies_.frames[at(row.first)], bodies_.frames[at(row.second)],
                         gamma_.data() + row.row);
  });
  right_ = -gamma_;
  right_.noalias() -= G_ * free_;
  regular_ = S_;
  regular_.diagonal() += epsilon_;
  factor_.compute(regular_);
  // Refined, so that eps decides only where the rows do not.
  lambda_.setZero();
  for (int pass = 0; pass < 3; ++pass) {
    scratch_ = right_;
    scratch_.noalias() -= S_ * lambda_;
    factor_.solveInPlace(scratch_);
    lambda_ += scratch_;
  }
  a_.noalias() += GM_.transpose() * lambda_;
}

void System::complete(double t, Eigen::VectorXd& y, Eigen::VectorXd& yp) {
  update(t, y.data());
  sum_forces(nullptr);
  torques_to_body_axes(loads_);
  solve_multipliers();
  yp.setZero(size_);
  for (int k = 0; k < moving(); ++k) {
    const double* s = y.data() + kBody * k;
    double* p = yp.data() + kBody * k;
    Eigen::Map<Vector3d>(p + kPosition) = Eigen::Map<const Vector3d>(s + kVelocity);
    Eigen::Map<Eigen::Vector4d>(p + kQuaternion) =
        quaternion_rate(s + kQuaternion, Eigen::Map<const Vector3d>(s + kSpin));
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(p + kVelocity) = a_.segment<6>(6 * k);
  }
  if (has_work_) yp[first_work()] = power(lambda_.data());
  if (form_ != Formulation::index0) y.segment(first_multiplier(), m_) = lambda_;
  if (form_ == Formulation::stabilised_index2) y.segment(first_eta(), m_).setZero();
}

}  // namespace tether::scene::smooth

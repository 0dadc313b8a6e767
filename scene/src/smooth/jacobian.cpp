// Tether: the Jacobian of the equations of motion. SPDX-License-Identifier: BSD-3-Clause
#include "mechanics/quaternions.hpp"
#include "system.hpp"

namespace tether::scene::smooth {

namespace {

// x' - v and q' - q (0, w) / 2 of the body whose unknowns are from `first` on.
void add_kinematic_jacobian(JacobianBlocks& J, int first, double cj, const double* q,
                            const Vector3d& w) {
  for (int i = 0; i < 3; ++i) {
    J.add(first + i, first + i, cj);
    J.add(first + i, first + kVelocity + i, -1.0);
  }
  const Eigen::Matrix4d Q = cj * Eigen::Matrix4d::Identity() - rate_by_quaternion(w);
  const Eigen::Matrix<double, 4, 3> W = -rate_by_spin(q);
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) J.add(first + kQuaternion + i, first + kQuaternion + j, Q(i, j));
    for (int j = 0; j < 3; ++j) J.add(first + kQuaternion + i, first + kSpin + j, W(i, j));
  }
}

}  // namespace

// eta moves x and q; its own size is that of the drift, so that d(G^T)/dq eta is left out.
void System::add_eta_jacobian(JacobianBlocks& J, const double* y) const {
  const Bodies& bodies = bodies_.all();
  rows_.each([&](const auto& row) {
    JointRows::each_unit_load(
        row, bodies, [&](int i, int body, const Vector3d& force, const Vector3d& torque) {
          const Inertia& inertia = bodies.inertia[at(body)];
          const int first = kBody * inertia.slot;
          const Vector3d spin = inertia.inverse * torque;
          const Eigen::Vector4d turn = quaternion_rate(y + first + kQuaternion, spin);
          for (int k = 0; k < 3; ++k)
            J.add(first + k, first_eta() + row.row + i, -force[k] / inertia.mass);
          for (int k = 0; k < 4; ++k)
            J.add(first + kQuaternion + k, first_eta() + row.row + i, -turn[k]);
        });
  });
}

void System::pin_jacobian(JacobianBlocks& J, int first) const {
  for (int i = 0; i < rows(); ++i)
    J.add(first + i, first + i, in_use_.carries_multiplier(i) ? 0.0 : dynamics_.size_of_row()[i]);
}

void System::jacobian(double t, double cj, const double* y, const double* yp, Entries& entries) {
  update(t, y);
  bodies_.set_turns(y);
  if (form_ == Formulation::index0) {
    index0_jacobian(cj, y, entries);
    return;
  }
  bodies_.set_accelerations(yp);
  const bool index2 = form_ == Formulation::stabilised_index2;
  JacobianBlocks J(entries, bodies_.all().turns, kBody, kVelocity, first_work());
  for (int k = 0; k < moving(); ++k) {
    const Inertia& inertia = bodies_.inertia(k);
    const int first = kBody * k;
    Vector3d w = bodies_.spin(k);
    if (index2) w += inertia.inverse * pulls_[at(k)].torque_body;
    add_kinematic_jacobian(J, first, cj, y + first + kQuaternion, w);
    for (int i = 0; i < 3; ++i)
      J.add(first + kVelocity + i, first + kVelocity + i, cj * inertia.mass);
    J.add_block(first + kSpin, first + kSpin, cj * inertia.inertia);
  }
  terms_.add_motion(J, y + first_multiplier(), first_multiplier());
  if (invariants_.has_work()) {
    J.add(first_work(), first_work(), cj);
    terms_.add_power(J);
    if (rows_.has_motion())
      rows_.each([&](const auto& row) {
        double g_t[3];
        row.rate_by_time(g_t);
        for (int i = 0; i < row.count; ++i)
          J.add(first_work(), first_multiplier() + row.row + i, g_t[i]);
      });
  }
  pin_jacobian(J, first_multiplier());
  if (!index2) {
    terms_.add_rows<2>(J, first_multiplier(), &in_use_, true, cj);
    return;
  }
  terms_.add_rows<1>(J, first_multiplier(), &in_use_, false, 0.0);
  terms_.add_rows<0>(J, first_eta(), &in_use_, false, 0.0);
  pin_jacobian(J, first_eta());
  add_eta_jacobian(J, y);
}

void System::index0_jacobian(double cj, const double* y, Entries& entries) {
  sum_forces(nullptr);
  torques_to_body_axes(loads_);
  dynamics_.solve(loads_);
  dynamics_.set_accelerations();
  acceleration_jacobian_->form();
  const Eigen::MatrixXd& da = acceleration_jacobian_->accelerations();
  const int columns = kBody * moving();
  JacobianBlocks J(entries, bodies_.all().turns, kBody, kVelocity, first_work());
  for (int k = 0; k < moving(); ++k) {
    const int first = kBody * k;
    add_kinematic_jacobian(J, first, cj, y + first + kQuaternion, bodies_.spin(k));
    for (int i = 0; i < 6; ++i) {
      for (int column = 0; column < columns; ++column)
        J.add(first + kVelocity + i, column,
              (column == first + kVelocity + i ? cj : 0.0) - da(6 * k + i, column));
    }
  }
  if (!invariants_.has_work()) return;
  J.add(first_work(), first_work(), cj);
  terms_.add_power(J);
  if (!rows_.has_motion()) return;
  const Eigen::MatrixXd& dlambda = acceleration_jacobian_->multipliers();
  Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(columns);
  rows_.each([&](const auto& row) {
    double g_t[3];
    row.rate_by_time(g_t);
    for (int i = 0; i < row.count; ++i) sum += g_t[i] * dlambda.row(row.row + i);
  });
  for (int column = 0; column < columns; ++column) J.add(first_work(), column, sum[column]);
}

}  // namespace tether::scene::smooth

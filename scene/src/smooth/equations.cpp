// Tether: the residual of the equations of motion. SPDX-License-Identifier: BSD-3-Clause
#include "mechanics/pair_forces.hpp"
#include "system.hpp"

namespace tether::scene::smooth {

void System::add_multipliers(const double* lambda) {
  const Bodies& bodies = bodies_.all();
  rows_.each([&](const auto& row) {
    const Frame<double>&A = bodies.frames[at(row.first)], &B = bodies.frames[at(row.second)];
    Wrench<double> a = no_wrench<double>(), b = no_wrench<double>();
    row.pull(A, B, lambda + row.row, a, b);
    put_wrench(bodies, row.first, a, loads_);
    put_wrench(bodies, row.second, b, loads_);
  });
}

double System::power(const double* lambda) const {
  double sum = 0;
  for (const auto& force : forces_)
    if (force->has_power()) sum += force->power(bodies_.all());
  if (rows_.has_motion())
    rows_.each([&](const auto& row) {
      double g_t[3];
      row.rate_by_time(g_t);
      for (int i = 0; i < row.count; ++i) sum -= lambda[row.row + i] * g_t[i];
    });
  return sum;
}

// x' - v, q' - q (0, w) / 2 and M (v', w') - f of every body.
void System::add_motion_residual(const double* y, const double* yp, double* r) const {
  using Map3 = Eigen::Map<const Vector3d>;
  using Map6 = Eigen::Map<const Eigen::Matrix<double, 6, 1>>;
  for (int k = 0; k < moving(); ++k) {
    const Inertia& inertia = bodies_.inertia(k);
    const double *s = y + kBody * k, *p = yp + kBody * k;
    double* out = r + kBody * k;
    Eigen::Map<Vector3d>(out + kPosition) = Map3(p + kPosition) - Map3(s + kVelocity);
    Eigen::Map<Eigen::Vector4d>(out + kQuaternion) =
        Eigen::Map<const Eigen::Vector4d>(p + kQuaternion) -
        quaternion_rate(s + kQuaternion, Map3(s + kSpin));
    if (form_ == Formulation::index0) {
      Eigen::Map<Eigen::Matrix<double, 6, 1>>(out + kVelocity) =
          Map6(p + kVelocity) - dynamics_.accelerations().segment<6>(6 * k);
    } else {
      Eigen::Map<Vector3d>(out + kVelocity) =
          inertia.mass * Map3(p + kVelocity) - loads_[at(k)].force;
      Eigen::Map<Vector3d>(out + kSpin) =
          inertia.inertia * Map3(p + kSpin) - loads_[at(k)].torque_body;
    }
  }
}

void System::residual(double t, const double* y, const double* yp, double* r, Stopwatch* watch) {
  const std::size_t joints = forces_.size(), bodies = joints + 1;
  const double* lambda = y + first_multiplier();
  if (watch) watch->start();
  update(t, y);
  if (watch) watch->lap(bodies);
  sum_forces(watch);

  const bool index0 = form_ == Formulation::index0;
  if (index0) {
    torques_to_body_axes();
    if (watch) watch->lap(bodies);
    dynamics_.solve(loads_);
    lambda = dynamics_.multipliers().data();
    if (watch) watch->lap(joints);
  } else {
    if (rows() > 0) add_multipliers(lambda);
    torques_to_body_axes();
    if (watch) watch->lap(joints);
  }
  add_motion_residual(y, yp, r);
  if (invariants_.has_work()) r[first_work()] = yp[first_work()] - power(lambda);
  if (watch) watch->lap(bodies);
  if (index0 || rows() == 0) return;
  add_row_residual(y, yp, r);
  if (watch) watch->lap(joints);
}

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

void System::jacobian(double t, double cj, const double* y, const double* yp, Entries& entries) {
  update(t, y);
  bodies_.set_turns(y);
  if (form_ == Formulation::index0) {
    index0_jacobian(cj, y, entries);
    return;
  }
  bodies_.set_accelerations(yp);
  JacobianBlocks J(entries, bodies_.all().turns, kBody, kVelocity, first_work());
  for (int k = 0; k < moving(); ++k) {
    const Inertia& inertia = bodies_.inertia(k);
    const int first = kBody * k;
    add_kinematic_jacobian(J, first, cj, y + first + kQuaternion, bodies_.spin(k));
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
  for (int i = 0; i < rows(); ++i)
    J.add(first_multiplier() + i, first_multiplier() + i,
          in_use_.carries_multiplier(i) ? 0.0 : dynamics_.size_of_row()[i]);
  terms_.add_rows(J, first_multiplier(), &in_use_, cj);
}

void System::index0_jacobian(double cj, const double* y, Entries& entries) {
  sum_forces(nullptr);
  torques_to_body_axes();
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

// Tether: the Jacobian of the equations of motion. SPDX-License-Identifier: BSD-3-Clause
#include "quaternions.hpp"
#include "system.hpp"

namespace tether::scene::smooth {

namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

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

// Derivatives of the equations of motion (and of the work) to y and lambda, y' fixed.
void System::add_motion_jacobian(JacobianBlocks& J, const double* lambda, int first_lambda) {
  for (const auto& effect : effects_) effect->add_jacobian(bodies_, J);
  each_row([&](const auto& row) {
    const Inertia &ia = bodies_.inertia[at(row.first)], &ib = bodies_.inertia[at(row.second)];
    const Frame<Dual> A = seed(bodies_.frames[at(row.first)], ia.slot >= 0, 0);
    const Frame<Dual> B = seed(bodies_.frames[at(row.second)], ib.slot >= 0, kBodyDirections);
    Wrench<Dual> a = no_wrench<Dual>(), b = no_wrench<Dual>();
    row.pull(A, B, lambda + row.row, a, b);
    const auto put = [&](const Inertia& inertia, const Frame<Dual>& f, const Wrench<Dual>& wrench) {
      if (inertia.slot < 0) return;
      const Vector3<Dual> torque = transposed_times(f.R, wrench.torque);
      for (int i = 0; i < 6; ++i) {
        const Derivatives& d = (i < 3 ? wrench.force[i] : torque[i - 3]).derivatives();
        const int r = J.motion_row(inertia.slot, i);
        if (ia.slot >= 0) J.add_directions(r, ia.slot, d, 0, -1.0);
        if (ib.slot >= 0) J.add_directions(r, ib.slot, d, kBodyDirections, -1.0);
      }
    };
    put(ia, A, a);
    put(ib, B, b);
    if (first_lambda < 0) return;
    // -G^T
    each_unit_load(row, [&](int i, int body, const Vector3d& force, const Vector3d& torque) {
      const int slot = bodies_.inertia[at(body)].slot;
      for (int k = 0; k < 3; ++k) {
        J.add(J.motion_row(slot, k), first_lambda + row.row + i, -force[k]);
        J.add(J.motion_row(slot, 3 + k), first_lambda + row.row + i, -torque[k]);
      }
    });
  });
}

// Derivatives of the order-th rate of g to y, and with cj to the accelerations.
template <int order>
void System::add_row_jacobian(JacobianBlocks& J, int first_row, bool carried_only,
                              bool accelerations, double cj) {
  each_row([&](const auto& row) {
    const Inertia &ia = bodies_.inertia[at(row.first)], &ib = bodies_.inertia[at(row.second)];
    const Frame<Dual> A = seed(bodies_.frames[at(row.first)], ia.slot >= 0, 0);
    const Frame<Dual> B = seed(bodies_.frames[at(row.second)], ib.slot >= 0, kBodyDirections);
    Dual g[3], rate[3];
    row.template rows<order>(A, B, g);
    if (accelerations) row.template rows<1>(A, B, rate);
    for (int i = 0; i < row.count; ++i) {
      Derivatives d = g[i].derivatives();
      // g'' depends on accelerations as g' does on velocities.
      if (accelerations) {
        d.segment<6>(6) += cj * rate[i].derivatives().template segment<6>(6);
        d.segment<6>(18) += cj * rate[i].derivatives().template segment<6>(18);
      }
      const double factor = carried_only && !carries_[at(row.row + i)] ? 0.0 : 1.0;
      if (ia.slot >= 0) J.add_directions(first_row + row.row + i, ia.slot, d, 0, factor);
      if (ib.slot >= 0)
        J.add_directions(first_row + row.row + i, ib.slot, d, kBodyDirections, factor);
    }
  });
}

// eta moves x and q; its own size is that of the drift, so that d(G^T)/dq eta is left out.
void System::add_eta_jacobian(JacobianBlocks& J, const double* y) const {
  each_row([&](const auto& row) {
    each_unit_load(row, [&](int i, int body, const Vector3d& force, const Vector3d& torque) {
      const Inertia& inertia = bodies_.inertia[at(body)];
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

void System::jacobian(double t, double cj, const double* y, const double* yp, Entries& entries) {
  update(t, y);
  for (int k = 0; k < moving(); ++k)
    bodies_.turns[at(k)] = turn_of_quaternion(y + kBody * k + kQuaternion);
  if (form_ == Formulation::index0) {
    index0_jacobian(cj, y, entries);
    return;
  }
  update_accelerations(yp);
  const bool index2 = form_ == Formulation::stabilised_index2;
  const double* lambda = y + first_multiplier();
  JacobianBlocks J(entries, bodies_.turns, kBody, kVelocity, first_work());
  for (int k = 0; k < moving(); ++k) {
    const Inertia& inertia = bodies_.inertia[at(body_of_slot_[at(k)])];
    const int first = kBody * k;
    Vector3d w = bodies_.w[at(body_of_slot_[at(k)])];
    if (index2) w += inertia.inverse * pulls_[at(k)].torque_body;
    add_kinematic_jacobian(J, first, cj, y + first + kQuaternion, w);
    for (int i = 0; i < 3; ++i)
      J.add(first + kVelocity + i, first + kVelocity + i, cj * inertia.mass);
    J.add_block(first + kSpin, first + kSpin, cj * inertia.inertia);
  }
  add_motion_jacobian(J, lambda, first_multiplier());
  if (has_work_) {
    J.add(first_work(), first_work(), cj);
    for (const auto& effect : effects_)
      if (effect->has_power()) effect->add_power_jacobian(bodies_, J);
    if (has_motion_)
      each_row([&](const auto& row) {
        double g_t[3];
        row.rate_by_time(g_t);
        for (int i = 0; i < row.count; ++i)
          J.add(first_work(), first_multiplier() + row.row + i, g_t[i]);
      });
  }
  const auto pin = [&](int first) {
    for (int i = 0; i < m_; ++i)
      J.add(first + i, first + i, carries_[at(i)] ? 0.0 : size_of_row_[i]);
  };
  pin(first_multiplier());
  if (!index2) {
    add_row_jacobian<2>(J, first_multiplier(), true, true, cj);
    return;
  }
  add_row_jacobian<1>(J, first_multiplier(), true, false, 0.0);
  add_row_jacobian<0>(J, first_eta(), true, false, 0.0);
  pin(first_eta());
  add_eta_jacobian(J, y);
}

// The multipliers of the present state, and the accelerations that they leave in the frames.
void System::accelerations_from_multipliers() {
  sum_forces(nullptr);
  torques_to_body_axes(loads_);
  solve_multipliers();
  for (int k = 0; k < moving(); ++k) {
    Frame<double>& f = bodies_.frames[at(body_of_slot_[at(k)])];
    f.a = a_.segment<3>(6 * k);
    f.alpha = f.R * a_.segment<3>(6 * k + 3);
  }
}

void System::form_left() {
  const int n = 6 * moving(), pitch = n + m_;
  const auto partials = [&] {
    JacobianBlocks D(dense_entries_, bodies_.turns, 6, 0, 0);
    add_motion_jacobian(D, lambda_.data(), -1);
    add_row_jacobian<2>(D, n, false, false, 0.0);
  };
  if (!dense_recorded_) {
    dense_entries_.record();
    partials();
    std::vector<int> slots;
    for (const auto& [row, column] : dense_entries_.places) slots.push_back(row + pitch * column);
    dense_entries_.finish(std::move(slots));
    dense_recorded_ = true;
  }
  left_.setZero();
  dense_entries_.begin(left_.data());
  partials();
}

// With D = -d(f + G^T lambda)/dy and A = dg''/dy at fixed a and lambda:
// M da = G^T dlambda - D dy, G da = -A dy.
Eigen::MatrixXd System::acceleration_jacobian() {
  form_left();
  Eigen::MatrixXd da = -left_.topRows(6 * moving());  // M^-1 (-D)
  for (int k = 0; k < moving(); ++k) {
    const Inertia& inertia = bodies_.inertia[at(body_of_slot_[at(k)])];
    da.middleRows<3>(6 * k) /= inertia.mass;
    da.middleRows<3>(6 * k + 3) = (inertia.inverse * da.middleRows<3>(6 * k + 3)).eval();
  }
  if (m_ > 0) {
    const Eigen::MatrixXd dlambda = factor_.solve(-left_.bottomRows(m_) - G_ * da);
    da += GM_.transpose() * dlambda;
    dense_ = dlambda;
  }
  return da;
}

void System::index0_work_jacobian(double cj, JacobianBlocks& J) {
  const int columns = kBody * moving();
  J.add(first_work(), first_work(), cj);
  for (const auto& effect : effects_)
    if (effect->has_power()) effect->add_power_jacobian(bodies_, J);
  if (!has_motion_) return;
  Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(columns);
  each_row([&](const auto& row) {
    double g_t[3];
    row.rate_by_time(g_t);
    for (int i = 0; i < row.count; ++i) sum += g_t[i] * dense_.row(row.row + i);
  });
  for (int column = 0; column < columns; ++column) J.add(first_work(), column, sum[column]);
}

void System::index0_jacobian(double cj, const double* y, Entries& entries) {
  accelerations_from_multipliers();
  const Eigen::MatrixXd da = acceleration_jacobian();
  JacobianBlocks J(entries, bodies_.turns, kBody, kVelocity, first_work());
  for (int k = 0; k < moving(); ++k) {
    const int first = kBody * k, columns = kBody * moving();
    add_kinematic_jacobian(J, first, cj, y + first + kQuaternion,
                           bodies_.w[at(body_of_slot_[at(k)])]);
    for (int i = 0; i < 6; ++i) {
      for (int column = 0; column < columns; ++column)
        J.add(first + kVelocity + i, column,
              (column == first + kVelocity + i ? cj : 0.0) - da(6 * k + i, column));
    }
  }
  if (has_work_) index0_work_jacobian(cj, J);
}

}  // namespace tether::scene::smooth

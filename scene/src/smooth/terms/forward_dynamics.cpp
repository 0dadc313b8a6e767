// Tether: accelerations and multipliers of a state. SPDX-License-Identifier: BSD-3-Clause
#include "forward_dynamics.hpp"

#include "smooth/rows/moving_bodies.hpp"

namespace tether::scene::smooth {

namespace {

constexpr double kEpsilon = 1e-11;  // of the diagonal of G M^-1 G^T

}  // namespace

void JointGradient::form(const JointRows& rows, const MovingBodies& bodies) {
  G.setZero(rows.count(), 6 * bodies.count());
  GM.resize(rows.count(), 6 * bodies.count());
  rows.each([&](const auto& row) {
    JointRows::each_unit_load(row, bodies.all(),
                              [&](int i, int body, const Vector3d& force, const Vector3d& torque) {
                                const int slot = bodies.all().inertia[at(body)].slot;
                                G.block<1, 3>(row.row + i, 6 * slot) += force.transpose();
                                G.block<1, 3>(row.row + i, 6 * slot + 3) += torque.transpose();
                              });
  });
  for (int k = 0; k < bodies.count(); ++k) {
    GM.middleCols<3>(6 * k) = G.middleCols<3>(6 * k) / bodies.inertia(k).mass;
    GM.middleCols<3>(6 * k + 3).noalias() = G.middleCols<3>(6 * k + 3) * bodies.inertia(k).inverse;
  }
  S.noalias() = GM * G.transpose();
}

ForwardDynamics::ForwardDynamics(JointRows& rows, MovingBodies& bodies, bool gradient)
    : rows_(rows), bodies_(bodies) {
  rows.set_time(0.0);
  bodies_.set_state(bodies_.start().data());
  const int m = rows.count(), n = 6 * bodies.count();
  lambda_.setZero(m);
  gamma_.setZero(m);
  right_.setZero(m);
  scratch_.setZero(m);
  a_.setZero(n);
  free_.setZero(n);
  if (m > 0 && by_entries(m, bodies.count()) && !gradient) {
    sparse_.emplace(rows_, bodies_);
    change_.setZero(n);
    sparse_->factor();
    size_of_row_ = sparse_->size_of_rows();
    return;
  }
  gradient_.form(rows_, bodies_);
  size_of_row_ = gradient_.S.diagonal();
  epsilon_ = kEpsilon * size_of_row_;
}

void ForwardDynamics::solve(const std::vector<Load6>& loads) {
  for (int k = 0; k < bodies_.count(); ++k) {
    const Inertia& inertia = bodies_.inertia(k);
    free_.segment<3>(6 * k) = loads[at(k)].force / inertia.mass;
    free_.segment<3>(6 * k + 3) = inertia.inverse * loads[at(k)].torque_body;
    bodies_.frame(k).a.setZero();
    bodies_.frame(k).alpha.setZero();
  }
  a_ = free_;
  if (rows_.count() == 0) return;
  rows_.values<2>(bodies_.all(), gamma_.data());
  if (sparse_)
    solve_sparse();
  else
    solve_dense();
}

void ForwardDynamics::solve_sparse() {
  sparse_->factor();
  sparse_->multiply(free_, right_);
  right_ = -gamma_ - right_;
  sparse_->solve(right_, change_, lambda_);
  a_ += change_;
}

void ForwardDynamics::solve_dense() {
  gradient_.form(rows_, bodies_);
  right_ = -gamma_;
  right_.noalias() -= gradient_.G * free_;
  regular_ = gradient_.S;
  regular_.diagonal() += epsilon_;
  factor_.compute(regular_);
  lambda_.setZero();
  for (int pass = 0; pass < 3; ++pass) {
    scratch_ = right_;
    scratch_.noalias() -= gradient_.S * lambda_;
    factor_.solveInPlace(scratch_);
    lambda_ += scratch_;
  }
  a_.noalias() += gradient_.GM.transpose() * lambda_;
}

void ForwardDynamics::set_accelerations() {
  for (int k = 0; k < bodies_.count(); ++k) {
    Frame<double>& f = bodies_.frame(k);
    f.a = a_.segment<3>(6 * k);
    f.alpha = f.R * a_.segment<3>(6 * k + 3);
  }
}

}  // namespace tether::scene::smooth

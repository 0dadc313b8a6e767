// Tether: derivatives of forces and rows of joints. SPDX-License-Identifier: BSD-3-Clause
#include "smooth/terms.hpp"

#include "effects/list.hpp"
#include "mechanics/pair_forces.hpp"
#include "smooth/rows/moving_bodies.hpp"

namespace tether::scene::smooth {

void JacobianTerms::add_motion(JacobianBlocks& J, const double* lambda, int first_lambda) const {
  const Bodies& all = bodies.all();
  for (const auto& force : forces) force->add_jacobian(all, J);
  rows.each([&](const auto& row) {
    const auto [A, B] = seed_pair(all, row.first, row.second);
    Wrench<Dual> a = no_wrench<Dual>(), b = no_wrench<Dual>();
    row.pull(A, B, lambda + row.row, a, b);
    put_wrench(all, row.first, row.second, row.first, A, a, J);
    put_wrench(all, row.first, row.second, row.second, B, b, J);
    if (first_lambda < 0) return;
    // -G^T
    JointRows::each_unit_load(
        row, all, [&](int i, int body, const Vector3d& force, const Vector3d& torque) {
          const int slot = all.inertia[at(body)].slot;
          for (int k = 0; k < 3; ++k) {
            J.add(J.motion_row(slot, k), first_lambda + row.row + i, -force[k]);
            J.add(J.motion_row(slot, 3 + k), first_lambda + row.row + i, -torque[k]);
          }
        });
  });
}

void JacobianTerms::add_rows(JacobianBlocks& J, int first_row, const RowsInUse* in_use,
                             double cj) const {
  const Bodies& all = bodies.all();
  rows.each([&](const auto& row) {
    const auto [A, B] = seed_pair(all, row.first, row.second);
    Dual g[3], rate[3];
    row.template rows<2>(A, B, g);
    if (in_use) row.template rows<1>(A, B, rate);
    for (int i = 0; i < row.count; ++i) {
      Derivatives d = g[i].derivatives();
      // g'' depends on accelerations as g' does on velocities.
      if (in_use) {
        d.segment<6>(6) += cj * rate[i].derivatives().template segment<6>(6);
        d.segment<6>(18) += cj * rate[i].derivatives().template segment<6>(18);
      }
      const double factor = in_use && !in_use->carries_multiplier(row.row + i) ? 0.0 : 1.0;
      J.add_body(first_row + row.row + i, all, row.first, d, 0, factor);
      J.add_body(first_row + row.row + i, all, row.second, d, kBodyDirections, factor);
    }
  });
}

// D over A.
void AccelerationJacobian::form_left() {
  const int n = 6 * terms_.bodies.count(), pitch = n + terms_.rows.count();
  const auto partials = [&] {
    JacobianBlocks D(entries_, terms_.bodies.all().turns, 6, 0, 0);
    terms_.add_motion(D, dynamics_.multipliers().data(), -1);
    terms_.add_rows(D, n, nullptr, 0.0);
  };
  if (entries_.places.empty()) {
    entries_.record();
    partials();
    std::vector<int> slots;
    for (const auto& [row, column] : entries_.places) slots.push_back(row + pitch * column);
    entries_.finish(std::move(slots));
  }
  left_.setZero();
  entries_.begin(left_.data());
  partials();
}

void AccelerationJacobian::form() {
  form_left();
  const MovingBodies& bodies = terms_.bodies;
  const int m = terms_.rows.count();
  da_ = -left_.topRows(6 * bodies.count());  // M^-1 (-D)
  bodies.divide_by_mass(da_);
  if (m == 0) return;
  const JointGradient& gradient = dynamics_.gradient();
  dlambda_ = dynamics_.solve_rows(-left_.bottomRows(m) - gradient.G * da_);
  da_ += gradient.GM.transpose() * dlambda_;
}

void JointGradient::form(const JointRows& rows, const MovingBodies& bodies) {
  rows.gradient(bodies.all(), G);
  GM.resize(rows.count(), 6 * bodies.count());
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
  epsilon_ = 1e-11 * size_of_row_;
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

KeptInvariants::KeptInvariants(const Scene& scene, const MovingBodies& bodies, const Forces& forces,
                               int work)
    : bodies_(bodies), forces_(forces) {
  const auto has = [&](InvariantKind kind) {
    return any_of(scene.invariants,
                  [&](const Invariant& each) { return each.project && each.kind == kind; });
  };
  const Momenta momenta = effects::momenta_of(scene);
  steady_force_ = momenta.steady_force;
  if (has(InvariantKind::energy)) {
    rows_.push_back({InvariantKind::energy, Vector3d::Zero()});
    if (any_of(effects::all(), [&](const auto* each) { return each->does_work(scene); }))
      work_ = work;
  }
  if (has(InvariantKind::momentum)) {
    if (!momenta.pushed_by.empty())
      throw std::invalid_argument("momentum is not invariant here: " + momenta.pushed_by +
                                  " pushes from outside; give it project = false");
    for (int k = 0; k < 3; ++k) rows_.push_back({InvariantKind::momentum, Vector3d::Unit(k)});
  }
  if (has(InvariantKind::angular_momentum)) {
    const auto& axes = momenta.axes.basis();
    if (axes.cols() == 0)
      throw std::invalid_argument(
          "angular momentum about the origin is not invariant here in any direction: " +
          momenta.axes.reason() + "; give it project = false");
    for (int k = 0; k < axes.cols(); ++k)
      rows_.push_back({InvariantKind::angular_momentum, axes.col(k)});
  }
  kept_.assign(rows_.size(), 0.0);
}

void KeptInvariants::values(double t, const double* y, double* g) const {
  const Vector3d P = bodies_.momentum() - t * steady_force_, L = bodies_.angular_momentum();
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    const Row& row = rows_[k];
    if (row.kind == InvariantKind::energy)
      g[k] = energy() - kept_[k] - (has_work() ? y[work_] : 0);
    else
      g[k] = row.along.dot(row.kind == InvariantKind::momentum ? P : L) - kept_[k];
  }
}

// A component of angular momentum is u . (x x m v + R I w).
void KeptInvariants::put_gradient(const Row& of, Eigen::Ref<Eigen::RowVectorXd> row) const {
  const bool energy = of.kind == InvariantKind::energy;
  for (int k = 0; k < bodies_.count(); ++k) {
    const Inertia& inertia = bodies_.inertia(k);
    const Frame<double>& f = bodies_.frame(k);
    const int first = kBody * k;
    if (energy) {
      row.segment<3>(first + kVelocity) += inertia.mass * f.v;
      row.segment<3>(first + kSpin) += inertia.inertia * bodies_.spin(k);
    } else if (of.kind == InvariantKind::momentum) {
      row.segment<3>(first + kVelocity) += inertia.mass * of.along;
    } else {
      const Vector3d u_body = f.R.transpose() * of.along, spin = inertia.inertia * bodies_.spin(k);
      row.segment<3>(first + kPosition) += inertia.mass * f.v.cross(of.along);
      row.segment<3>(first + kVelocity) += inertia.mass * of.along.cross(f.x);
      row.segment<4>(first + kQuaternion) +=
          spin.cross(u_body).transpose() * bodies_.all().turns[at(k)];
      row.segment<3>(first + kSpin) += inertia.inertia * u_body;
    }
  }
  if (!energy) return;
  for (const auto& force : forces_) force->add_potential_gradient(bodies_.all(), row.data());
  if (has_work()) row[work_] -= 1.0;
}

}  // namespace tether::scene::smooth

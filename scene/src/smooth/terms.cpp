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

void JacobianTerms::add_power(JacobianBlocks& J) const {
  for (const auto& force : forces)
    if (force->has_power()) force->add_power_jacobian(bodies.all(), J);
}

AccelerationJacobian::AccelerationJacobian(const JacobianTerms& terms,
                                           const ForwardDynamics& dynamics)
    : terms_(terms), dynamics_(dynamics) {
  const int n = 6 * terms.bodies.count();
  left_.setZero(n + terms.rows.count(), kBody * terms.bodies.count());
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

KeptInvariants::KeptInvariants(const Scene& scene, const MovingBodies& bodies, const Forces& forces,
                               int work)
    : bodies_(bodies), forces_(forces), work_(work) {
  bool angular = false;
  for (const Invariant& each : scene.invariants) {
    if (!each.project) continue;
    energy_ = energy_ || each.kind == InvariantKind::energy;
    momentum_ = momentum_ || each.kind == InvariantKind::momentum;
    angular = angular || each.kind == InvariantKind::angular_momentum;
  }
  if (energy_)
    for (const effects::Effect* each : effects::all())
      has_work_ = has_work_ || each->does_work(scene);
  const Momenta momenta = effects::momenta_of(scene);
  if (momentum_ && !momenta.pushed_by.empty())
    throw std::invalid_argument("momentum is not invariant here: " + momenta.pushed_by +
                                " pushes from outside; give it project = false");
  steady_force_ = momenta.steady_force;
  axes_.resize(0, 3);
  if (angular) {
    if (momenta.axes.basis().cols() == 0)
      throw std::invalid_argument(
          "angular momentum about the origin is not invariant here in any direction: " +
          momenta.axes.reason() + "; give it project = false");
    axes_ = momenta.axes.basis().transpose();
  }
  kept_.assign(at((energy_ ? 1 : 0) + (momentum_ ? 3 : 0) + static_cast<int>(axes_.rows())), 0.0);
}

void KeptInvariants::keep(double t, const double* y) {
  std::fill(kept_.begin(), kept_.end(), 0.0);
  if (kept_.empty()) return;
  std::vector<double> now(kept_.size());
  values(t, y, now.data());
  kept_ = now;
}

double KeptInvariants::energy() const {
  double sum = bodies_.kinetic_energy();
  for (const auto& force : forces_) sum += force->potential(bodies_.all());
  return sum;
}

void KeptInvariants::values(double t, const double* y, double* g) const {
  int row = 0;
  if (energy_) {
    g[row] = energy() - kept_[at(row)];
    if (has_work_) g[row] -= y[work_];
    ++row;
  }
  if (momentum_) {
    const Vector3d P = bodies_.momentum() - t * steady_force_;
    for (int k = 0; k < 3; ++k, ++row) g[row] = P[k] - kept_[at(row)];
  }
  if (axes_.rows() > 0) {
    const Vector3d L = bodies_.angular_momentum();
    for (int k = 0; k < axes_.rows(); ++k, ++row) g[row] = axes_.row(k).dot(L) - kept_[at(row)];
  }
}

void KeptInvariants::jacobian(ConstraintRows C, int row) const {
  if (energy_) {
    for (int k = 0; k < bodies_.count(); ++k) {
      const Inertia& inertia = bodies_.inertia(k);
      C.row(row).segment<3>(kBody * k + kVelocity) += inertia.mass * bodies_.frame(k).v;
      C.row(row).segment<3>(kBody * k + kSpin) += inertia.inertia * bodies_.spin(k);
    }
    for (const auto& force : forces_)
      force->add_potential_gradient(bodies_.all(), C.row(row).data());
    if (has_work_) C(row, work_) -= 1.0;
    ++row;
  }
  if (momentum_) {
    for (int k = 0; k < bodies_.count(); ++k)
      for (int i = 0; i < 3; ++i) C(row + i, kBody * k + kVelocity + i) += bodies_.inertia(k).mass;
    row += 3;
  }
  // u . (x x m v + R I w)
  for (int i = 0; i < axes_.rows(); ++i, ++row) {
    const Vector3d u = axes_.row(i).transpose();
    for (int k = 0; k < bodies_.count(); ++k) {
      const Inertia& inertia = bodies_.inertia(k);
      const Frame<double>& f = bodies_.frame(k);
      const int first = kBody * k;
      const Vector3d u_body = f.R.transpose() * u, spin = inertia.inertia * bodies_.spin(k);
      C.row(row).segment<3>(first + kPosition) += inertia.mass * f.v.cross(u);
      C.row(row).segment<3>(first + kVelocity) += inertia.mass * u.cross(f.x);
      C.row(row).segment<4>(first + kQuaternion) +=
          spin.cross(u_body).transpose() * bodies_.all().turns[at(k)];
      C.row(row).segment<3>(first + kSpin) += inertia.inertia * u_body;
    }
  }
}

void KeptInvariants::add_names(std::vector<std::string>& names) const {
  if (energy_) names.emplace_back("energy");
  if (momentum_) names.insert(names.end(), 3, "momentum");
  names.insert(names.end(), at(static_cast<int>(axes_.rows())), "angular momentum");
}

std::vector<double> KeptInvariants::units(const Units& units) const {
  std::vector<double> all;
  if (energy_) all.push_back(units.energy());
  if (momentum_) all.insert(all.end(), 3, units.momentum());
  all.insert(all.end(), at(static_cast<int>(axes_.rows())), units.angular_momentum());
  return all;
}

}  // namespace tether::scene::smooth

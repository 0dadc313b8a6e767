// Tether: energy and momenta that the projection keeps. SPDX-License-Identifier: BSD-3-Clause
#include "kept_invariants.hpp"

#include "effects/list.hpp"

namespace tether::scene::smooth {

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

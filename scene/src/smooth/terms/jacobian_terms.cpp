// Tether: derivatives of forces and rows of joints. SPDX-License-Identifier: BSD-3-Clause
#include "jacobian_terms.hpp"

namespace tether::scene::smooth {

void JacobianTerms::add_motion(JacobianBlocks& J, const double* lambda, int first_lambda) const {
  const Bodies& all = bodies.all();
  for (const auto& force : forces) force->add_jacobian(all, J);
  rows.each([&](const auto& row) {
    const Inertia &ia = all.inertia[at(row.first)], &ib = all.inertia[at(row.second)];
    const Frame<Dual> A = seed(all.frames[at(row.first)], ia.slot >= 0, 0);
    const Frame<Dual> B = seed(all.frames[at(row.second)], ib.slot >= 0, kBodyDirections);
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

template <int order>
void JacobianTerms::add_rows(JacobianBlocks& J, int first_row, const RowsInUse* in_use,
                             bool accelerations, double cj) const {
  const Bodies& all = bodies.all();
  rows.each([&](const auto& row) {
    const Inertia &ia = all.inertia[at(row.first)], &ib = all.inertia[at(row.second)];
    const Frame<Dual> A = seed(all.frames[at(row.first)], ia.slot >= 0, 0);
    const Frame<Dual> B = seed(all.frames[at(row.second)], ib.slot >= 0, kBodyDirections);
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
      const double factor = in_use && !in_use->carries_multiplier(row.row + i) ? 0.0 : 1.0;
      if (ia.slot >= 0) J.add_directions(first_row + row.row + i, ia.slot, d, 0, factor);
      if (ib.slot >= 0)
        J.add_directions(first_row + row.row + i, ib.slot, d, kBodyDirections, factor);
    }
  });
}

template void JacobianTerms::add_rows<0>(JacobianBlocks&, int, const RowsInUse*, bool,
                                         double) const;
template void JacobianTerms::add_rows<1>(JacobianBlocks&, int, const RowsInUse*, bool,
                                         double) const;
template void JacobianTerms::add_rows<2>(JacobianBlocks&, int, const RowsInUse*, bool,
                                         double) const;

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
    terms_.add_rows<2>(D, n, nullptr, false, 0.0);
  };
  if (!recorded_) {
    entries_.record();
    partials();
    std::vector<int> slots;
    for (const auto& [row, column] : entries_.places) slots.push_back(row + pitch * column);
    entries_.finish(std::move(slots));
    recorded_ = true;
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
  for (int k = 0; k < bodies.count(); ++k) {
    const Inertia& inertia = bodies.inertia(k);
    da_.middleRows<3>(6 * k) /= inertia.mass;
    da_.middleRows<3>(6 * k + 3) = (inertia.inverse * da_.middleRows<3>(6 * k + 3)).eval();
  }
  if (m == 0) return;
  const JointGradient& gradient = dynamics_.gradient();
  dlambda_ = dynamics_.solve_rows(-left_.bottomRows(m) - gradient.G * da_);
  da_ += gradient.GM.transpose() * dlambda_;
}

}  // namespace tether::scene::smooth

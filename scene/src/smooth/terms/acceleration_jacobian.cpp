// Tether: derivatives of the accelerations by the state, for index 0. SPDX-License-Identifier:
// BSD-3-Clause
#include "acceleration_jacobian.hpp"

namespace tether::scene::smooth {

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

// Tether: proximal point iteration with semismooth Newton inside. SPDX-License-Identifier:
// BSD-3-Clause
#include "assembled/stages/proximal_newton.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::contact::detail {

void ProximalNewton::reset(int contacts) {
  n_ = contacts;
  for (Packed* p : {&x_, &z_, &dx_, &trial_, &trial_z_, &swept_, &swept_z_, &anchor_})
    p->resize(at(n_));
  regimes_.resize(at(n_));
  derivatives_.resize(at(n_));
}

double ProximalNewton::residual(Search& search, const Packed& x, Packed& z,
                                const Proximal& proximal, bool derive) {
  search.counts.work += search.sweep_cost;
  return search.system.blocks(x.data(), z.data(), proximal, derive ? regimes_.data() : nullptr,
                              derive ? derivatives_.data() : nullptr);
}

// dx + Phi'/(1+tau) (A - D) dx = -F with F = x - z and the diagonal blocks D: dx = -F where a
// contact is separated, since Phi' = 0 there.
bool ProximalNewton::direction(Search& search, double tau) {
  for (int i = 0; i < n_; ++i) {
    ContactBlocks& blocks = matrix_[i];
    blocks = {};
    for (int c = 0; c < 3; ++c) {
      for (int r = 0; r < 3; ++r)
        blocks.L.column[4 * c + r] = derivatives_[at(i)].d[3 * r + c] / (1 + tau);
      blocks.R.column[5 * c] = 1;
    }
    blocks.a = own_block(search.system.problem().local(i), -1);
  }
  entries(dx_) = entries(z_) - entries(x_);
  if (!matrix_.factor(search)) return false;
  matrix_.solve(dx_.data());
  return std::isfinite(entries(dx_).squaredNorm());
}

int ProximalNewton::inner(Search& search, double tau) {
  const Proximal proximal{tau, anchor_.data()};
  double res = residual(search, x_, z_, proximal, true);
  const double target = 0.1 * res;
  if (res == 0) return 1;
  for (int iteration = 1; iteration <= 12; ++iteration) {
    if (!direction(search, tau)) return -1;
    bool accepted = false;
    for (double t : {1.0, 0.4, 0.16, 0.064}) {
      entries(trial_) = entries(x_) + t * entries(dx_);
      double found = residual(search, trial_, trial_z_, proximal, false);
      if (!(found <= target)) {
        std::copy(trial_.begin(), trial_.end(), swept_.begin());
        search.system.sweep(swept_.data(), proximal);
        search.count_sweep();
        const double other = residual(search, swept_, swept_z_, proximal, false);
        if (!(found <= other)) {
          std::swap(trial_, swept_);
          found = other;
        }
      }
      if (found < (1 - 0.1 * t) * res) {
        std::swap(x_, trial_);
        accepted = true;
        break;
      }
    }
    if (!accepted) return -1;
    res = residual(search, x_, z_, proximal, true);
    // x may be outside of the cone by round-off; the block solutions z never are.
    search.test(z_.data(), By::factors);
    if (search.solved() || search.exhausted()) return iteration;
    if (res <= target) return iteration;
  }
  return 13;
}

int ProximalNewton::correct(Search& search, double tau, const PackedVector* anchor, Packed& x,
                            int most) {
  constexpr double kExact = 0.1;  // residual / proximal term
  const auto& locals = search.system.problem().locals();
  std::copy(anchor, anchor + n_, anchor_.begin());
  std::copy(x.begin(), x.end(), x_.begin());
  for (int i = 0; i < n_; ++i) clip_cone(locals[at(i)].mu, x_[at(i)].v);
  const Proximal proximal{tau, anchor_.data()};
  double res = residual(search, x_, z_, proximal, true);
  for (int step = 1; step <= most; ++step) {
    if (!affordable(search) || !direction(search, tau)) return 0;
    double move = 0;
    entries(x_) += entries(dx_);
    const double next = residual(search, x_, z_, proximal, true);
    for (int i = 0; i < n_; ++i)
      for (int c = 0; c < 3; ++c) {
        const double d = search.system.weight(i) * (z_[at(i)].v[c] - anchor_[at(i)].v[c]);
        move += d * d;
      }
    if (next <= kExact * tau * std::sqrt(move)) {
      std::copy(z_.begin(), z_.end(), x.begin());
      return step;
    }
    // The first step may cross kinks; after it the iteration converges or has failed.
    if (!(next < (step == 1 ? 10 : 0.5) * res)) return 0;
    res = next;
  }
  return 0;
}

void ProximalNewton::run(Search& search, const PackedVector* x, int most) {
  std::copy(x, x + n_, x_.begin());
  double tau = 1e-4, tau_failed = 0;
  int failures = 0;
  for (int outer = 0; outer < most; ++outer) {
    std::copy(x_.begin(), x_.end(), anchor_.begin());
    const int steps = inner(search, tau);
    if (search.solved() || search.exhausted()) return;
    if (steps < 0) {
      tau_failed = tau;
      tau = std::min(5 * tau, 10.0);
      std::copy(anchor_.begin(), anchor_.end(), x_.begin());
      if (++failures >= 4) return;
      continue;
    }
    failures = 0;
    if (steps <= 2) {
      tau *= 0.05;
    } else if (steps <= 4) {
      tau *= 0.2;
    }
    tau_failed *= 0.8;
    tau = std::max({tau, 2.5 * tau_failed, 1e-12});
  }
}

}  // namespace tether::contact::detail

// Tether: proximal point iteration with semismooth Newton inside. SPDX-License-Identifier:
// BSD-3-Clause
#include "assembled/stages/proximal_newton.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::contact::detail {
namespace {

// out = P B for row-major P and packed B.
TETHER_INLINE void multiply(const double* P, const double* B, double scale, double* out) {
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r)
      out[4 * c + r] =
          scale * (P[3 * r] * B[4 * c] + P[3 * r + 1] * B[4 * c + 1] + P[3 * r + 2] * B[4 * c + 2]);
    out[4 * c + 3] = 0;
  }
}

}  // namespace

void ProximalNewton::reset(int contacts) {
  n_ = contacts;
  for (Packed* p : {&x_, &z_, &dx_, &trial_, &trial_z_, &swept_, &swept_z_, &anchor_})
    p->resize(at(n_));
  regimes_.resize(at(n_));
  derivatives_.resize(at(n_));
  active_.resize(at(n_));
  matrix_.reset();
}

double ProximalNewton::residual(Search& search, const Packed& x, Packed& z,
                                const Proximal& proximal, bool derive) {
  search.counts.work += search.sweep_cost;
  return search.system.blocks(x.data(), z.data(), proximal, derive ? regimes_.data() : nullptr,
                              derive ? derivatives_.data() : nullptr);
}

// F + dx + Phi'/(1+tau) sum_{j != i} A_ij dx_j = 0 with F = x - z.
bool ProximalNewton::direction(Search& search, double tau) {
  matrix_.order_for_parts(search);
  for (int i = 0; i < n_; ++i)
    for (int c = 0; c < 4; ++c) dx_[at(i)].v[c] = z_[at(i)].v[c] - x_[at(i)].v[c];
  const double scale = 1 / (1 + tau);
  const bool regular = matrix_.by_bodies() ? direction_by_bodies(search.system.problem(), scale)
                                           : direction_by_contacts(search.system.problem(), scale);
  ++search.counts.factorisations;
  search.counts.work += cost(search);
  if (!regular) return false;
  double sum = 0;
  for (int i = 0; i < n_; ++i)
    for (int c = 0; c < 3; ++c) sum += dx_[at(i)].v[c] * dx_[at(i)].v[c];
  return std::isfinite(sum);
}

// Separated contacts are known: dx = -F there.
bool ProximalNewton::direction_by_contacts(const Problem& p, double scale) {
  BlockLu& lu = matrix_.contacts();
  for (int i = 0; i < n_; ++i) active_[at(i)] = regimes_[at(i)] != Regime::separating;
  lu.analyse(pattern(p), active_.data());
  bool regular = true;
  for (int r = 0; r < lu.size(); ++r) {
    const int i = lu.block_row(r);
    const double* P = derivatives_[at(i)].d;
    double rhs[3] = {0, 0, 0};
    lu.begin_row(r);
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const int j = p.columns()[at(k)];
      const double* A = p.blocks()[at(k)].column;
      if (active_[at(j)]) {
        alignas(32) double block[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
        if (j != i) multiply(P, A, scale, block);
        lu.add(j, block);
      } else {
        const double* d = dx_[at(j)].v;
        for (int c = 0; c < 3; ++c) rhs[c] += A[c] * d[0] + A[4 + c] * d[1] + A[8 + c] * d[2];
      }
    }
    regular = lu.end_row() && regular;
    for (int c = 0; c < 3; ++c)
      dx_[at(i)].v[c] -=
          scale * (P[3 * c] * rhs[0] + P[3 * c + 1] * rhs[1] + P[3 * c + 2] * rhs[2]);
  }
  if (regular) lu.solve(dx_.data());
  return regular;
}

// (D + L A) dx = -F, L = Phi'/(1+tau) and D = 1 - L A_ii
bool ProximalNewton::direction_by_bodies(const Problem& p, double scale) {
  PackedBlock unit, left, D;
  for (int c = 0; c < 3; ++c) unit.column[5 * c] = 1;
  matrix_.bodies().begin();
  for (int i = 0; i < n_; ++i) {
    const double* P = derivatives_[at(i)].d;
    const LocalBlock& L = p.local(i);
    const double block[12] = {L.a,    L.c[0], L.c[1], 0,      L.c[0], L.T[0],
                              L.T[1], 0,      L.c[1], L.T[1], L.T[2], 0};
    multiply(P, block, -scale, D.column);
    for (int c = 0; c < 3; ++c) {
      D.column[5 * c] += 1;
      for (int r = 0; r < 3; ++r) left.column[4 * c + r] = scale * P[3 * r + c];
    }
    matrix_.bodies().add(i, D, left, unit);
  }
  if (!matrix_.bodies().factor()) return false;
  matrix_.bodies().solve(dx_.data());
  return true;
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
      for (int i = 0; i < n_; ++i) {
        for (int c = 0; c < 3; ++c) trial_[at(i)].v[c] = x_[at(i)].v[c] + t * dx_[at(i)].v[c];
      }
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
    for (int i = 0; i < n_; ++i)
      for (int c = 0; c < 3; ++c) x_[at(i)].v[c] += dx_[at(i)].v[c];
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
  double reference = search.best_error;
  int since_gain = 0, failures = 0;
  for (int outer = 0; outer < most; ++outer) {
    std::copy(x_.begin(), x_.end(), anchor_.begin());
    const int steps = inner(search, tau);
    if (search.solved() || search.exhausted()) return;
    if (search.best_error < 0.97 * reference) {
      reference = search.best_error;
      since_gain = 0;
    } else if (++since_gain >= 15) {
      return;
    }
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

// Tether: Gauss-Seidel sweeps with safeguarded Anderson acceleration. SPDX-License-Identifier: BSD-3-Clause
#include "accelerated_sweeps.hpp"

#include <algorithm>
#include <cmath>

namespace tether::contact::detail {

void AcceleratedSweeps::reset(int contacts, int depth) {
  n_ = contacts;
  depth_ = depth;
  x_.resize(at(n_));
  g_.resize(at(n_));
  f_.resize(at(n_));
  anderson_.reset(n_, depth);
}

void AcceleratedSweeps::start(const PackedVector* x) {
  std::copy(x, x + n_, x_.begin());
  anderson_.clear();
}

void AcceleratedSweeps::run(Search& search, const Leave& leave) {
  System& system = search.system;
  const double accelerated_cost = 0.8 * 4 * n_ * depth_;
  const double begin = search.counts.work;
  bool accelerate = true;
  double least_f = std::numeric_limits<double>::infinity();  // since the last restart
  double window_f = 0, last_error = 0, last_f = 0;
  int window = 60, window_end = 60, next_test = 1;
  constexpr int kRecent = 10;
  double recent[kRecent];  // |f| of the last sweeps, for the rate
  for (int sweep = 1;; ++sweep) {
    std::copy(x_.begin(), x_.end(), g_.begin());
    system.sweep(g_.data());
    search.count_sweep();
    double f2 = 0;
    for (int i = 0; i < n_; ++i) {
      const double weight = system.weight(i);
      for (int c = 0; c < 3; ++c) {
        const double f = weight * (g_[at(i)].v[c] - x_[at(i)].v[c]);
        f_[at(i)].v[c] = f;
        f2 += f * f;
      }
    }
    const double f = std::sqrt(f2);
    if (sweep == 1) window_f = f;
    if (sweep >= next_test || last_error * f < 1.5 * search.options.tolerance * last_f) {
      last_error = search.test(g_.data(), Method::anderson);
      last_f = f;
      if (search.solved()) return;
      next_test = std::max(next_test, sweep + 1 + sweep / 8);
    }
    if (search.exhausted()) return;
    if (leave.most_sweeps > 0 && sweep >= leave.most_sweeps) return;
    // Near the tolerance sweeps get more time: their rate is irregular, a Newton phase has a fixed cost.
    const double patience = last_error < 30 * search.options.tolerance ? 10 : 1;
    if (leave.other_cost > 0 && search.counts.work - begin >= patience * leave.least_work) {
      // Predicted sweeps to the tolerance from the rate of |f| over the last ten.
      double left = std::numeric_limits<double>::infinity();
      if (sweep > kRecent) {
        const double rate = std::pow(f / recent[sweep % kRecent], 1.0 / kRecent);
        if (rate < 0.995) left = std::log(search.options.tolerance / last_error) / std::log(rate);
      } else {
        left = 0;
      }
      if (left * (search.sweep_cost + accelerated_cost) > leave.worth * leave.other_cost) return;
    }
    recent[sweep % kRecent] = f;
    if (sweep >= window_end) {
      if (f > 0.7 * window_f) {
        accelerate = !accelerate;
        anderson_.clear();
        least_f = f;
      }
      window_f = f;
      window *= 2;
      window_end = sweep + window;
    }
    if (!accelerate) {
      std::copy(g_.begin(), g_.end(), x_.begin());
      continue;
    }
    search.counts.work += accelerated_cost;
    if (f > 2 * least_f) {
      anderson_.clear();
      least_f = f;
      std::copy(g_.begin(), g_.end(), x_.begin());
      continue;
    }
    least_f = std::min(least_f, f);
    anderson_.step(g_.data(), f_.data(), x_.data());
    for (int i = 0; i < n_; ++i) clip_cone(system.problem().locals()[at(i)].mu, x_[at(i)].v);
  }
}

}  // namespace tether::contact::detail

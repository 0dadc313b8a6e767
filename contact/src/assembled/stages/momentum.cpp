// Tether: sweeps with momentum. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/stages/momentum.hpp"

#include <algorithm>
#include <cmath>

namespace tether::contact::detail {

void Momentum::step(const Problem& problem, double f, Packed& g, Packed& x) {
  double beta = 0;
  if (grown_ > 1 && f > last_f_) {
    grown_ = 1;
  } else {
    const double next = 0.5 * (1 + std::sqrt(1 + 4 * grown_ * grown_));
    beta = (grown_ - 1) / next;
    grown_ = next;
  }
  last_f_ = f;
  if (beta > 0) {
    for (std::size_t i = 0; i < g.size(); ++i) {
      for (int c = 0; c < 3; ++c) x[i].v[c] = g[i].v[c] + beta * (g[i].v[c] - before_[i].v[c]);
      clip_cone(problem.locals()[i].mu, x[i].v);
    }
  } else {
    std::copy(g.begin(), g.end(), x.begin());
  }
  before_.swap(g);
}

}  // namespace tether::contact::detail

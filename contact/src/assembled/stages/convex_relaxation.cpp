// Tether: the convex relaxation of a contact problem. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/stages/convex_relaxation.hpp"

#include <algorithm>
#include <cmath>

namespace tether::contact::detail {

bool solve_convex_relaxation(Search& search, Packed& x) {
  System& system = search.system;
  const Problem& p = system.problem();
  const int n = system.size();
  const bool frictionless = !search.system.law().friction;
  Packed y = x, w(at(n)), next(at(n));
  // Largest eigenvalue bound: row sums of block norms.
  double L = 0;
  for (int i = 0; i < n; ++i) {
    double sum = 0;
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      double norm = 0;
      for (double v : p.blocks()[at(k)].column) norm += v * v;
      sum += std::sqrt(norm);
    }
    L = std::max(L, sum);
  }
  const double step = 1 / L, scale = system.norm_b() > 0 ? system.norm_b() : 1;
  double theta = 1;
  for (int iteration = 0; iteration < search.options.max_sweeps; ++iteration) {
    system.velocities(y.data(), w.data());
    search.count_sweep(0.5);
    double change = 0, restart = 0;
    for (int i = 0; i < n; ++i) {
      double* z = next[at(i)].v;
      for (int c = 0; c < 3; ++c) z[c] = y[at(i)].v[c] - step * w[at(i)].v[c];
      if (frictionless) {
        z[0] = std::max(z[0], 0.0);
        z[1] = z[2] = 0;
      } else {
        project_cone(p.local(i).mu, z);
      }
      for (int c = 0; c < 3; ++c) {
        change += (z[c] - y[at(i)].v[c]) * (z[c] - y[at(i)].v[c]);
        restart += (y[at(i)].v[c] - z[c]) * (z[c] - x[at(i)].v[c]);
      }
    }
    if (std::sqrt(change) <= search.options.tolerance * step * scale) {
      x = next;
      return true;
    }
    const double old = restart > 0 ? 1 : theta;
    theta = 0.5 * (1 + std::sqrt(1 + 4 * old * old));
    const double momentum = restart > 0 ? 0 : (old - 1) / theta;
    for (int i = 0; i < n; ++i) {
      for (int c = 0; c < 3; ++c)
        y[at(i)].v[c] = next[at(i)].v[c] + momentum * (next[at(i)].v[c] - x[at(i)].v[c]);
    }
    std::swap(x, next);
    if (search.exhausted()) return false;
  }
  return false;
}

}  // namespace tether::contact::detail

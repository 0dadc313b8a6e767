// Tether: pairs on the smoothed complementarity of cones. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/stages/interior/smoothed_pairs.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/cone_scaling.hpp>

#include "assembled/stages/interior/sticking_point.hpp"

namespace tether::contact::detail {
namespace {

// (l + sqrt(l^2 + 4 q)) / 2 without cancellation
double positive_part(double l, double q) {
  const double root = std::sqrt(l * l + 4 * q);
  return l > 0 ? 0.5 * (l + root) : 2 * q / (root - l);
}

// z in the frame of its eigenvalues; any direction where z_t = 0.
struct Spectrum {
  explicit Spectrum(const double* z) : length(tangent(z)) {
    if (length > 0) {
      t[0] = z[1] / length;
      t[1] = z[2] / length;
    }
    above = z[0] + length;
    below = z[0] - length;
  }
  double length, above, below;
  double t[2] = {1, 0};
};

void set_cone(double* x, double gap, double length, const double* direction) {
  x[1] = length * direction[0];
  x[2] = length * direction[1];
  x[3] = gap;
  x[0] = tangent(x) + gap;
}

void set_flat(double* x, double value) {
  x[0] = x[3] = value;
  x[1] = x[2] = 0;
}

}  // namespace

SmoothedPairs::SmoothedPairs(const System& system, const InteriorEquations& equations)
    : equations_(equations), rho_(at(system.size())) {
  at_.z.resize(rho_.size());
  for (int i = 0; i < system.size(); ++i)
    rho_[at(i)] = 1 / mean_diagonal(system.problem().local(i));
}

void SmoothedPairs::take(const ConePair& pair, double nu) {
  change_of(pair, at_.z);
  at_.log_nu = std::log(nu);
}

void SmoothedPairs::set(ConePair& pair) const {
  for (std::size_t i = 0; i < rho_.size(); ++i) {
    const double rho = rho_[i], q = rho * nu();
    double *x = pair.x[i].v, *u = pair.u[i].v;
    if (equations_.flat(static_cast<int>(i))) {
      const double z = at_.z[i].v[0];
      set_flat(x, positive_part(z, q));
      set_flat(u, positive_part(-z, q) / rho);
      continue;
    }
    const Spectrum z(at_.z[i].v);
    // |x_t| and rho |u_t| are half of z's length and of what its roots differ by.
    const double roots =
        std::sqrt(z.above * z.above + 4 * q) + std::sqrt(z.below * z.below + 4 * q);
    const double share = roots > 0 ? 2 * z.length * (z.above + z.below) / (2 * roots) : 0;
    const double back[2] = {-z.t[0], -z.t[1]};
    set_cone(x, positive_part(z.below, q), 0.5 * (z.length + share), z.t);
    set_cone(u, positive_part(-z.above, q) / rho, 0.5 * (z.length - share) / rho, back);
  }
}

void SmoothedPairs::move(const Packed& change, double length, double log_nu) {
  for (std::size_t i = 0; i < rho_.size(); ++i)
    for (int c = 0; c < 3; ++c) at_.z[i].v[c] += length * change[i].v[c];
  at_.log_nu += log_nu;
}

void SmoothedPairs::change_of(const ConePair& pair, Packed& out) const {
  for (std::size_t i = 0; i < rho_.size(); ++i)
    for (int c = 0; c < 3; ++c) out[i].v[c] = pair.x[i].v[c] - rho_[i] * pair.u[i].v[c];
}

SmoothedPairs::Parts SmoothedPairs::parts(int i, const double* d) const {
  const double q = 4 * rho_[at(i)] * nu();
  const double* v = at_.z[at(i)].v;
  if (equations_.flat(i)) return {{d[0] / std::sqrt(v[0] * v[0] + q), 0, 0}};
  const Spectrum z(v);
  const double along = z.t[0] * d[1] + z.t[1] * d[2], across = z.t[0] * d[2] - z.t[1] * d[1];
  // Inside of a cone directions do not matter, and the distance from it takes the place of |z_t|.
  const double inside = std::max({z.below, -z.above, 0.0});
  return {{(d[0] + along) / std::sqrt(z.above * z.above + q),
           (d[0] - along) / std::sqrt(z.below * z.below + q),
           across / std::sqrt(z.length * z.length + inside * inside + q)}};
}

double SmoothedPairs::inner(const Packed& a, const Packed& b) const {
  double sum = 0;
  for (std::size_t i = 0; i < rho_.size(); ++i) {
    const Parts p = parts(static_cast<int>(i), a[i].v), r = parts(static_cast<int>(i), b[i].v);
    for (int c = 0; c < 3; ++c) sum += p.v[c] * r.v[c];
  }
  return sum;
}

double SmoothedPairs::largest(const Packed& change) const {
  double most = 0;
  for (std::size_t i = 0; i < rho_.size(); ++i) {
    const Parts p = parts(static_cast<int>(i), change[i].v);
    for (double v : p.v) most = std::max(most, std::abs(v));
  }
  return most;
}

}  // namespace tether::contact::detail

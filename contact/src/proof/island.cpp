// Tether: an island of a contact problem in units near 1. SPDX-License-Identifier: BSD-3-Clause
#include "proof/island.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

#include "problem/refuse.hpp"

namespace tether::contact::detail {
namespace {

double shifted(double value, int exponent) {
  const double out = std::ldexp(value, exponent);
  if (!std::isfinite(out) || std::ldexp(out, -exponent) != value)
    throw std::range_error(shown(value) + " leaves the range of doubles in units near 1");
  return out;
}

// k so that value 2^-k is near 1; 0 for 0.
int exponent_of(double value) { return value > 0 ? std::ilogb(value) : 0; }

}  // namespace

ProofIsland proof_island(const Problem& problem, const linalg::VectorView& impulses) {
  const int d = problem.dimension(), n = problem.contacts();
  ProofIsland out;
  out.dimension = d;
  out.A = problem.dense_matrix();
  out.b = problem.b();
  out.x = impulses;
  out.mu.resize(n);
  std::vector<int> half(at(n));  // 2^half is near sqrt(A_nn)
  double largest_x = 0, largest_b = 0;
  for (int i = 0; i < n; ++i) {
    out.mu[i] = problem.mu(i);
    half[at(i)] = exponent_of(problem.local(i).a) / 2;
    largest_x = std::max(largest_x, std::ldexp(out.x.segment(d * i, d).stableNorm(), half[at(i)]));
    largest_b = std::max(largest_b, std::ldexp(out.b.segment(d * i, d).stableNorm(), -half[at(i)]));
  }
  const int unit = exponent_of(largest_x > 0 ? largest_x : largest_b);
  for (int i = 0; i < n; ++i) {
    out.impulse.push_back(unit - half[at(i)]);
    out.velocity.push_back(unit + half[at(i)]);
  }
  for (int r = 0; r < d * n; ++r) {
    const int i = r / d;
    out.b[r] = shifted(out.b[r], -out.velocity[at(i)]);
    out.x[r] = shifted(out.x[r], -out.impulse[at(i)]);
    for (int k = 0; k < d * n; ++k)
      out.A(r, k) = shifted(out.A(r, k), -half[at(i)] - half[at(k / d)]);
  }
  return out;
}

Velocities::Velocities(const ProofIsland& island, const Box& box) {
  const Eigen::Index rows = box.x.size();
  const bool is_point = box.radius.isZero(0);
  w.reserve(static_cast<std::size_t>(rows));
  for (Eigen::Index r = 0; r < rows; ++r) {
    LongSum sum;
    sum.add(-1, island.b[r]);
    for (Eigen::Index k = 0; k < rows; ++k)
      if (island.A(r, k) != 0 && box.x[k] != 0) sum.add(island.A(r, k), box.x[k]);
    const double spread =
        is_point ? 0 : above(island.A.row(r).cwiseAbs().dot(box.radius), static_cast<double>(rows));
    const Interval middle = sum.terms() > 1 ? sum.value() : Interval(-island.b[r]);
    w.push_back(spread > 0 ? middle + Interval(-spread, spread) : middle);
    size = std::max(size, sum.size() + spread);
  }
}

Interval tangent_length(const Interval* x, int dimension) {
  return root(dimension == 2 ? square(x[1]) : square(x[1]) + square(x[2]));
}

}  // namespace tether::contact::detail

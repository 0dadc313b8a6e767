// Tether: an island of a contact problem in units near 1. SPDX-License-Identifier: BSD-3-Clause
#include "proof/island.hpp"

#include <cmath>

#include "problem/refuse.hpp"

namespace tether::contact::detail {
namespace {

[[noreturn]] void refuse_range(int contact, const char* what, double value) {
  throw OutOfRange(contact, std::string(what) + " = " + shown(value) +
                                ": leaves the range of doubles in units near 1");
}

double shifted(int contact, const char* what, double value, int exponent) {
  const double out = std::ldexp(value, exponent);
  if (!std::isfinite(out) || std::ldexp(out, -exponent) != value)
    refuse_range(contact, what, value);
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
  const auto grow = [&](double& largest, const char* what, int i, const auto& v, int shift) {
    largest = std::max(largest, std::ldexp(v.segment(d * i, d).stableNorm(), shift));
    if (!std::isfinite(largest)) refuse_range(i, what, largest);
  };
  for (int i = 0; i < n; ++i) {
    out.mu[i] = problem.mu(i);
    half[at(i)] = exponent_of(problem.local(i).a) / 2;
    grow(largest_x, "|x| times about sqrt(A_nn)", i, out.x, half[at(i)]);
    grow(largest_b, "|b| over about sqrt(A_nn)", i, out.b, -half[at(i)]);
  }
  const int unit = exponent_of(largest_x > 0 ? largest_x : largest_b);
  for (int i = 0; i < n; ++i) {
    out.impulse.push_back(unit - half[at(i)]);
    out.velocity.push_back(unit + half[at(i)]);
  }
  for (int r = 0; r < d * n; ++r) {
    const int i = r / d;
    out.b[r] = shifted(i, "b", out.b[r], -out.velocity[at(i)]);
    out.x[r] = shifted(i, "an impulse", out.x[r], -out.impulse[at(i)]);
    for (int k = 0; k < d * n; ++k)
      out.A(r, k) = shifted(i, "A", out.A(r, k), -half[at(i)] - half[at(k / d)]);
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
    w.push_back(is_point ? middle : middle + Interval(-spread, spread));
    size = std::max(size, sum.size() + spread);
  }
}

Interval tangent_length(const Interval* x, int dimension) {
  return root(dimension == 2 ? square(x[1]) : square(x[1]) + square(x[2]));
}

}  // namespace tether::contact::detail

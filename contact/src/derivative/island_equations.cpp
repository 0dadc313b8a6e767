// Tether: the equations of an island's derivative and their transpose. SPDX-License-Identifier:
// BSD-3-Clause
#include "derivative/island_equations.hpp"

#include <algorithm>
#include <cmath>

namespace tether::contact::detail {

using linalg::at;
using linalg::PackedVector;
using linalg::PackedVectors;

void IslandEquations::multiply(const PackedVector* y, PackedVector* out) const {
  for (int i = 0; i < size(); ++i) {
    PackedVector sum;
    for (int k = starts[at(i)]; k < starts[at(i + 1)]; ++k) {
      const double *M = blocks[at(k)].column, *v = y[columns[at(k)]].v;
      for (int r = 0; r < 3; ++r) sum.v[r] += M[r] * v[0] + M[4 + r] * v[1] + M[8 + r] * v[2];
    }
    out[i] = sum;
  }
}

void IslandEquations::multiply_transposed(const PackedVector* y, PackedVector* out) const {
  std::fill(out, out + size(), PackedVector());
  for (int i = 0; i < size(); ++i) {
    const double* v = y[i].v;
    for (int k = starts[at(i)]; k < starts[at(i + 1)]; ++k) {
      const double* M = blocks[at(k)].column;
      double* sum = out[columns[at(k)]].v;
      for (int c = 0; c < 3; ++c)
        sum[c] += M[4 * c] * v[0] + M[4 * c + 1] * v[1] + M[4 * c + 2] * v[2];
    }
  }
}

namespace {

// The part of a direction without symmetry that M^+ M removes: its component in the null space.
double find_free_direction(IslandEquations& e) {
  constexpr double kGolden = 0.6180339887498949;
  PackedVectors z(e.contacts.size());
  e.free.resize(z.size());
  double phase = 0, whole = 0, left = 0;
  for (PackedVector& v : z)
    for (int c = 0; c < 3; ++c) {
      phase += kGolden;
      phase -= std::floor(phase);
      v.v[c] = phase - 0.5;
      whole += v.v[c] * v.v[c];
    }
  e.multiply(z.data(), e.free.data());
  e.factors->solve(e.free.data());
  for (std::size_t i = 0; i < z.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      e.free[i].v[c] = z[i].v[c] - e.free[i].v[c];
      left += e.free[i].v[c] * e.free[i].v[c];
    }
  return std::sqrt(left / whole);
}

// The least singular value of M, by inverse iteration from the direction that M hardly sees.
double least_singular_value(IslandEquations& e) {
  constexpr int kSteps = 3;
  PackedVectors y = e.free;
  double length = 0;
  const auto normalise = [&] {
    length = 0;
    for (const PackedVector& v : y)
      for (double c : v.v) length += c * c;
    length = std::sqrt(length);
    for (PackedVector& v : y)
      for (double& c : v.v) c /= length;
  };
  normalise();
  for (int k = 0; k < kSteps && length > 0; ++k) {
    e.factors->solve_transposed(y.data());
    e.factors->solve(y.data());
    normalise();
  }
  return length > 0 ? 1 / std::sqrt(length) : 0;
}

}  // namespace

void IslandEquations::factor(double rank_tolerance) {
  constexpr int kDense = 100, kDenseDeficient = 400;  // contacts
  constexpr double kLost = 1e-5;  // of a known solution: M is singular to working precision
  deficiency = 0;
  if (size() > kDense) {
    factors = sparse_factors(*this);
    if (factors && find_free_direction(*this) <= kLost &&
        least_singular_value(*this) > rank_tolerance) {
      free.clear();
      return;
    }
  }
  if (size() <= kDenseDeficient) {
    factors = dense_factors(*this, rank_tolerance);
    deficiency = factors->deficiency();
    if (deficiency > 0) find_free_direction(*this);
  } else {
    factors = deficient_factors(*this, rank_tolerance);
    deficiency = factors->deficiency();
    if (find_free_direction(*this) > kLost) deficiency = std::max(deficiency, 1);
  }
  if (deficiency == 0) free.clear();
}

}  // namespace tether::contact::detail

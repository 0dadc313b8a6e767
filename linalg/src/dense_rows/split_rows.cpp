// Tether: minimum-norm solution for many rows: those that A A^T shows to be independent, and what
// they leave of the others. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "large_rows.hpp"

namespace tether::linalg {

// Factors A^T = [A_f^T Q^T] T with a triangular T up to order. A_f are the rows with a sine of at
// least kLeastSine to the span of those before them; Q has orthonormal rows for the remainders of
// the other rows, orthogonal to A_f. Returns false if that is not cheaper.
bool MinimumNorm::factor_split(double rank_tolerance) {
  Large& large = *large_;
  KeptRows& kept = large.kept;
  if (!kept.factor_firm(large.natural.data(), m_, kLeastSine)) return false;
  int firm = 0;
  large.rest.begin();
  double least = 1.0;
  for (int i = 0; i < m_; ++i) {
    const double part = kept.independent_part(i);
    if (part > 0.0) {
      large.order[static_cast<std::size_t>(firm++)] = i;
      least = std::min(least, part);
    } else {
      kept.remainder(i, m_, large.rhs.data(), large.rest.add(i));
    }
  }
  large.rest.factor(rank_tolerance);
  for (int k = 0; k < large.rest.count(); ++k)
    large.order[static_cast<std::size_t>(firm + k)] = large.rest.row(k);
  large.firm = firm;
  const int thin = large.rest.rank();
  if (thin > 0) least = large.rest.independent_part(thin - 1);
  rank_ = factored_rank_ = firm + thin;
  least_square_ = least * least;
  decided_least_ = least;
  large.split = firm < m_;
  kept_ = !large.split;
  if (kept_) large.learn_units(row_norm_);
  return true;
}

// Refactorises if other rows take part than in the current factors.
void MinimumNorm::limit_rank() {
  Large& large = *large_;
  if (large.split && rank_ >= large.firm) {
    if (kept_) large.kept.factor_firm(large.natural.data(), m_, kLeastSine);
    kept_ = false;
  } else if (large.split || kept_) {
    large.kept.factor(large.order.data(), rank_);
    large.learn_units(row_norm_);
    kept_ = true;
  }
}

void MinimumNorm::solve_split(const double* g, double* dy) {
  Large& large = *large_;
  const KeptRows& kept = large.kept;
  const auto left = [&](int i) { return scaled(g, i) - kept.times(i, dy); };
  double* const z = large.rhs.data();
  for (int i = 0; i < m_; ++i) z[i] = scaled(g, i);
  kept.solve(m_, z, dy);
  const int thin = rank_ - large.firm;
  if (thin > 0) {  // rounding that little of a row would magnify
    for (int i = 0; i < m_; ++i) z[i] = left(i);
    kept.solve(m_, z, large.work.data());
    for (int j = 0; j < n_; ++j) dy[j] += large.work[j];
    for (int k = 0; k < thin; ++k) large.left[k] = left(large.rest.row(k));
    large.rest.add_solution(thin, large.left.data(), dy);
  }
  for (int k = rank_; k < m_; ++k)
    inconsistency_[static_cast<std::size_t>(k)] = std::abs(left(pivot(k)));
  for (int j = 0; j < n_; ++j) dy[j] *= metric_[static_cast<std::size_t>(j)];
}

// Row k is a combination of the firm rows and its remainder, and this remainder is a combination of
// the remainders of other rows.
std::vector<double> MinimumNorm::dependence_split(int k) const {
  const Large& large = *large_;
  const int thin = rank_ - large.firm;
  std::vector<double> x(static_cast<std::size_t>(rank_)), of_firm(static_cast<std::size_t>(m_));
  double* const of_thin = x.data() + large.firm;
  large.rest.dependence(k - large.firm, thin, of_thin);
  for (int l = -1; l < thin; ++l) {
    large.kept.dependence(pivot(l < 0 ? k : large.firm + l), m_, of_firm.data());
    const double share = l < 0 ? 1.0 : -of_thin[l];
    for (int i = 0; i < large.firm; ++i)
      x[static_cast<std::size_t>(i)] += share * of_firm[static_cast<std::size_t>(pivot(i))];
  }
  return x;
}

double MinimumNorm::independent_part_split(int k) const {
  const Large& large = *large_;
  return k < large.firm ? large.kept.independent_part(pivot(k))
                        : large.rest.independent_part(k - large.firm);
}

}  // namespace tether::linalg

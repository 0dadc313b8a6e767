// Tether: minimum-norm solution of C dy = g in a diagonal metric (method, eq. 7).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::linalg {

namespace small {  // inside the library
struct KeptRows;
}  // namespace small

/// Factors of an m x n matrix C in the metric D, kept until the next factor():
///
///     min sum_j (dy_j / D_j)^2   subject to   C dy = g.
///
/// The rows of A = S C D, S = diag(1 / |row_i(C D)|), are unit vectors. They are made orthogonal
/// with pivoting, P A = [L11; L21] Q (modified Gram-Schmidt: Golub and Van Loan, sections 5.2.8 and
/// 5.6.2); then dy = D Q^T L11^-1 (P S g)_1..r. Because the rows are unit vectors, the rank
/// decision L_kk > rank_tolerance does not depend on the units of g. A A^T is not formed for it.
///
/// Many rows of few entries are for SparseMinimumNorm. resize() allocates, factor() and solve() do
/// not.
class MinimumNorm {
 public:
  MinimumNorm();                       ///< 0 x 0
  MinimumNorm(int rows, int columns);  ///< resize(rows, columns)
  ~MinimumNorm();
  MinimumNorm(MinimumNorm&&) noexcept;
  MinimumNorm& operator=(MinimumNorm&&) noexcept;

  /// Sets m and n. The only member that allocates.
  void resize(int rows, int columns);

  int rows() const { return m_; }     ///< m
  int columns() const { return n_; }  ///< n

  /// Writable storage for C, row i at row(i)[0 .. n-1]; factor() overwrites it.
  double* row(int i);

  /// Factors S C D. D_j >= 0, D_j = 0 keeps dy_j = 0. Returns false if C D has an entry that is
  /// not finite; the factors are then unusable. Rows that vanish are dropped (rank 0 for them).
  bool factor(const double* D, double rank_tolerance = 1e-12);

  /// Writable storage for D, n entries, that the next factor() reads.
  double* metric() { return metric_.data(); }

  /// The same for C(i, j) = wide[rows[i] * width + columns[j]], with D from metric(): nothing is
  /// copied twice. rows has m entries, columns n, ascending.
  bool factor(const double* wide, int width, const int* rows, const int* columns,
              double rank_tolerance);

  /// The same with the rows that the last factor() and use_rank() let take part, in their order.
  /// A A^T = L L^T of these alone takes less work. Returns false if an entry is not finite, or a
  /// small system has dropped rows; factor() is due then. So it is if a row depends on those before
  /// it: the sine of its angle is below 1e-3, or below a third of the least that factor() found.
  bool factor_kept(const double* wide, int width, const int* rows, const int* columns);

  /// dy from the kept factors; g has m entries in the units of the rows, dy has n entries.
  /// Dropped rows take no part; see inconsistency().
  void solve(const double* g, double* dy) {
    if (factors_ == Factors::few)
      solve_few_(*few_, order_.data(), n_, g, metric_.data(), dy);
    else
      factors_ == Factors::gram ? solve_gram(g, dy) : solve_orthogonal(g, dy);
  }

  /// Until the next factor() only the first `rank` rows of the pivot order take part, at most as
  /// many as factor() has kept.
  void use_rank(int rank) { rank_ = rank < factored_rank_ ? rank : factored_rank_; }

  int rank() const { return rank_; }          ///< rows that take part in solve()
  int dropped() const { return m_ - rank_; }  ///< rows that do not
  /// Original index of the k-th row in pivot order: k < rank() kept, k >= rank() dropped.
  int pivot(int k) const { return order_[static_cast<std::size_t>(k)]; }
  /// L_kk, k < rank(): how much of a unit row is independent of those before it. From factor() no
  /// larger than the one before.
  double independent_part(int k) const;
  /// The square of the smallest one that factor() has kept; 1 for rank 0.
  double least_square() const { return least_square_; }
  /// |row_i(C D)|; 0 for a row that vanishes.
  double row_norm(int i) const;
  /// After solve(): the part of dropped row k (k in rank()..m-1, pivot order) that the solution
  /// leaves unsolved, as a distance in the metric: |S g - L21 L11^-1 (P S g)_1..r|. A vanished
  /// row has no distance; its |g| itself is returned.
  double inconsistency(int k) const { return inconsistency_[static_cast<std::size_t>(k)]; }
  /// Coefficients over the kept rows (pivot order, rank() entries) that give dropped row k.
  std::vector<double> dependence(int k) const;
  /// Ratio of the largest to the smallest kept L_kk: a cheap estimate of the condition of S C D.
  double condition() const;

 private:
  enum class Factors { orthogonal, gram, few };
  bool factor_few(const double* wide, int width, const int* rows, const int* columns);
  bool factor_gram(const double* wide, int width, const int* rows, const int* columns);
  void gather(const double* c, const int* columns, int k);
  bool scale(int k, int i);
  void factor_orthogonal(double rank_tolerance);
  void solve_gram(const double* g, double* dy);
  void solve_orthogonal(const double* g, double* dy);
  double scaled(const double* g, int i) const;

  int m_ = 0, n_ = 0, rank_ = 0, factored_rank_ = 0;
  struct TETHER_HIDDEN Large;  // Eigen's types stay inside the library: see eigen.hpp
  std::unique_ptr<Large> large_;
  std::unique_ptr<small::KeptRows> few_;  // of factor_kept(); null: beyond its sizes
  void (*solve_few_)(const small::KeptRows&, const int*, int, const double*, const double*,
                     double*) = nullptr;
  std::vector<int> order_;  // of pivots
  Factors factors_ = Factors::orthogonal;
  double least_square_ = 1.0;
  double least_sine_ = 0.0;  // of kept rows, by the last factor(); 0: they are too dependent
  std::vector<double> metric_, row_norm_, inconsistency_;  // metric_: D
};

}  // namespace tether::linalg
TETHER_EXPORT_END

// Tether: minimum-norm solution of C dy = g for many sparse rows and a few full ones.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::linalg {

/// The same as MinimumNorm, min sum_j (dy_j / D_j)^2 subject to C dy = g. C is an m x n matrix
/// whose first rows are sparse with a fixed pattern and whose last `full` rows are dense.
///
/// Let A = S C D, S = diag(1 / |row_i(C D)|) and b = S g. With M = A A^T + eps I = L diag(d) L^T (L
/// sparse, approximate minimum degree, analysed once; full rows as a border) the steps
///
///     du <- du + A^T M^-1 (b - A du)
///
/// reduce the part of the residual along a singular value s of A to eps / (s^2 + eps) of itself
/// each (proximal point method: Rockafellar, SIAM J. Control Optim. 14 (1976), 877). They stop at
/// the residual that solve() is asked for, or where du no longer changes; where the residual stops
/// halving, conjugate gradients on |M^-1/2 (b - A du)| with the same factors go on. In every
/// direction du grows from 0 towards the solution of least norm: however nearly dependent the rows
/// are, |du| stays below |b| / (2 sqrt(eps)) for each step, and below the least norm altogether.
///
/// Rank: with unit rows d_k is the squared sine of the angle between row k and those before it, in
/// the elimination's order, plus a small multiple of eps. A row with d_k <= 16 eps is called
/// dropped. It takes part in the solution all the same; rows that contradict each other share what
/// cannot be solved (least squares), and inconsistency() says how much that is.
///
/// resize() analyses the pattern: its cost grows as the entries of A A^T; a column that all rows
/// share makes that m^2. factor() and solve() do not allocate.
class SparseMinimumNorm {
 public:
  static constexpr double kTolerance = 1e-14;  ///< of solve(), relative to |b|
  static constexpr double kSolved = 1e-6;      ///< the same where Newton's next move takes the rest

  SparseMinimumNorm();
  ~SparseMinimumNorm();
  SparseMinimumNorm(SparseMinimumNorm&&) noexcept;
  SparseMinimumNorm& operator=(SparseMinimumNorm&&) noexcept;

  /// Sets the pattern. Sparse rows in compressed form: columns[starts[i] .. starts[i + 1]),
  /// ascending, of row i.
  void resize(int columns, std::vector<int> starts, std::vector<int> column_of, int full_rows);

  int rows() const;         ///< m, with the full ones
  int columns() const;      ///< n
  int sparse_rows() const;  ///< m less the full ones

  /// Writable storage for the sparse rows of C, in the order of the pattern; factor() overwrites
  /// it.
  double* entries();
  /// The same for full row k, n entries.
  double* full_row(int k);
  /// Writable storage for D, n entries >= 0, that the next factor() reads; D_j = 0 keeps dy_j = 0.
  double* metric();

  /// eps = rank_tolerance^2, at least 1e-13, which rounding of A A^T needs. Coefficients c of a row
  /// over those before it make eps |c|^2 of a dependent one's d_k. They are examined where d_k is
  /// below `thin` (0 to 1), first over the nearest rows alone, then of all by eight random vectors.
  /// False if C D has an entry that is not finite; the factors are then unusable.
  bool factor(double rank_tolerance = 1e-6, double thin = 1e-6);
  /// dy (n entries) from the kept factors; g has m entries in the units of the rows. Stops at
  /// |b - A du| <= tolerance |b| + 4e-16 |du|; residual() is the value reached.
  void solve(const double* g, double* dy, double tolerance = kTolerance);

  /// The first of solve()'s steps alone, dy = D A^T M^-1 b. D^-1 dy is symmetric in u for b = A u,
  /// whatever rounding decides, and short of the least norm by eps / (s^2 + eps). Leaves residual()
  /// and iterations() as they are.
  void one_step(const double* g, double* dy);

  /// The multipliers of the rows (m entries): the least x with D^2 C^T x = dy, for dy from solve(),
  /// or a sum of such. Entries are measured in the inverse unit of |row_i(C D)|. Of a row that is
  /// given k times each copy gets a k-th. Does not allocate, leaves residual() as it is.
  void multipliers(const double* dy, double* x);

  int rank() const { return rows() - dropped(); }  ///< rows with d_k > 16 eps
  int dropped() const;                             ///< the others
  /// k < rank(): kept rows; k >= rank(): dropped ones.
  int pivot(int k) const;
  /// Sine of the angle between row i and the rows before it in the order of elimination,
  /// sqrt(d_k - eps). Rounding hides values below sqrt(eps).
  double independent_part(int i) const;
  /// |row_i(C D)|; 0 for a row that vanishes.
  double row_norm(int i) const;

  /// After solve(): |b - A du| / |b|, 0 for b = 0. Rows that vanish do not count.
  double residual() const;
  /// After solve(): (b - A du)_i, a distance in the metric.
  double residual(int i) const;
  /// M^-1 solves of the last solve().
  int iterations() const;
  /// After solve(): by how much dropped row pivot(k) contradicts the rows that it depends on, a
  /// distance in the metric: |b_i - c . b_kept|, c = dependence(k); |g_i| if the row vanishes.
  double inconsistency(int k) const;
  /// Coefficients over the kept rows pivot(0 .. rank()-1) that give dropped row k. Allocates.
  std::vector<double> dependence(int k) const;

 private:
  struct TETHER_HIDDEN Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace tether::linalg
TETHER_EXPORT_END

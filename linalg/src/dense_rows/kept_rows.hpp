// Tether: unit rows that are known to be independent, and A A^T = L L^T of them.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <tether/linalg/filled.hpp>
#include <vector>

#include "envelope.hpp"
#include "row_order.hpp"

namespace tether::linalg {

/// Unit rows A = S C D, S = diag(1 / |row_i(C D)|), by the places that have ever been filled: rows
/// of mechanisms have few. `order` lists the independent ones first; of these A A^T is factored,
/// by its envelope, in an order of its own, where places are few. resize() allocates, nothing else
/// does.
class KeptRows {
 public:
  void resize(int rows, int columns);

  /// A from C(i, j) = wide[rows[i] * width + columns[j]] and D; row_norm receives |row_i(C D)|.
  /// False: an entry is not finite. `places` as of MinimumNorm::factor_kept().
  bool load(const double* wide, int width, const int* rows, const int* columns, const double* D,
            double* row_norm, const FilledPlaces* places);
  /// A itself, row i at unit_rows + i columns.
  void load(const double* unit_rows);
  /// A A^T = L L^T of the first `rank` rows of the order. False: not positive definite.
  bool factor(const int* order, int rank);
  /// The same of rows that need not be independent: those with an independent part below `sine` are
  /// left out, theirs is 0 then. False: places are many, and there are such rows.
  bool factor_firm(const int* order, int rank, double sine);
  /// L_kk: how much of row k of the order is independent of those that the factors have before it.
  double independent_part(int k) const {
    return dense_ ? L_(k, k) : envelope_.diagonal(place_[static_cast<std::size_t>(k)]);
  }
  double least_part(int rank) const;

  /// du = A^T (A A^T)^-1 z over the first `rank` of these rows; z is overwritten.
  void solve(int rank, double* z, double* du) const;
  /// A_i . du.
  double times(int i, const double* du) const;
  /// x with A_i = sum_k x_k A_order(k), k < rank, in the sense of least squares.
  void dependence(int i, int rank, double* x) const;
  /// A_i without its part in the span of these rows, n entries; z: work space, rank entries.
  void remainder(int i, int rank, double* z, double* left) const;

 private:
  void learn(const FilledPlaces& wide, int width, const int* rows, const int* columns);
  // Above this share of entries dense products are cheaper.
  static constexpr double kDense = 0.25;

  template <class Visit>
  void visit(int i, Visit f) const {
    const double* a = A_.data() + static_cast<std::ptrdiff_t>(i) * n_;
    for (const int *j = places_.begin(i), *last = places_.end(i); j != last; ++j) f(*j, *a++);
  }
  void spread(int i) const;
  void clear(int i) const;
  void solve_factored(int rank, double* z) const;
  bool planned(const int* order, int rank) const;
  void plan(const int* order, int rank);
  void multiply_by_columns(int rank);
  void multiply_dense(int rank);
  bool factor_dense(int rank);

  int n_ = 0;
  FilledPlaces places_;        // columns of each row
  long last_check_ = -1;       // how many of the caller's are among them
  std::vector<double> marks_;  // of a row of the caller's
  std::vector<double> A_;      // the entries there, of row i from i n_ on
  std::vector<double> gathered_;
  struct Link {
    int next, at;  // in rows of the envelope
    double entry;
  };
  std::vector<int> heads_;  // of each column: its last entry so far in links_
  std::vector<Link> links_;
  mutable std::vector<double> work_;  // one row, spread out

  // for the places and the order that plan() has seen
  long planned_places_ = -1;
  bool dense_ = true;
  std::vector<int> order_;   // as given
  std::vector<int> place_;   // of row k of the order in the envelope
  std::vector<int> sorted_;  // rows as the envelope has them
  RowOrder row_order_;
  std::vector<int> firsts_;
  Envelope envelope_;
  mutable std::vector<double> permuted_;
  Eigen::MatrixXd L_, spread_;  // the lower triangle; the rows as columns
};

}  // namespace tether::linalg

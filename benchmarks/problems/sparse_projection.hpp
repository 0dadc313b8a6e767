// Tether: projection onto many sparse rows, by the caller's own hand. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>
#include <functional>
#include <tether/ida_projection/constraints.hpp>
#include <vector>

namespace tether::problems {

/// Rows g(y) = 0 of which all but the last are sparse; the last is full.
struct SparseRows {
  int count = 0;    ///< m, with the full row
  int columns = 0;  ///< the first so many unknowns appear in them
  std::function<void(const double* y, double* g)> value;
  /// add(row, column, entry) for the sparse rows, in an order that does not depend on y.
  using Add = std::function<void(int, int, double)>;
  std::function<void(const double* y, const Add& add)> gradient;
  std::function<void(const double* y, double* row)> full;  ///< gradient of the last row
};

/// Least move onto the rows in the metric of findings.md (size of the corrector's own change):
/// normal equations A A^T of the sparse rows A = C D, by SuiteSparse-like LDL^T (Eigen) with a
/// pattern analysed once; the full row by a Schur complement.
class SparseProjection {
 public:
  explicit SparseProjection(SparseRows rows, const double* y0);

  /// CVProjFn's contract: 0, or > 0 when a factor is singular or a number is not finite.
  int project(const double* y, double* change, const double* corrector, double epsilon);

  /// To be attached with tether::ida_projection; `projection` must outlive the run.
  static ida_projection::Constraints attach(SparseProjection* projection);

 private:
  struct Product {
    int target, a, b;
  };
  void scale_from(const double* corrector);
  bool factor(const double* y);
  void solve(Eigen::VectorXd& right);

  SparseRows rows_;
  std::vector<int> slot_;  // of each call of add
  std::vector<int> row_, column_;
  std::vector<Product> products_;  // entries of A A^T, lower triangle
  Eigen::VectorXd entries_, D_, y_, g_, full_, coupling_, spread_, multipliers_;
  double full_square_ = 0.0, size_ = 0.0;
  Eigen::SparseMatrix<double> normal_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;
};

}  // namespace tether::problems

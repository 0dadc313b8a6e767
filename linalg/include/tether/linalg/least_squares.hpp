// Tether: dense least squares of least norm, rank revealed. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/export.hpp>
#include <tether/linalg/eigen.hpp>

TETHER_EXPORT_BEGIN
namespace tether::linalg {

/// The shortest x of min |A x - b|, A of any shape and rank. By the complete orthogonal
/// decomposition A P = Q (T 0; 0 0) Z (Golub and Van Loan, Matrix Computations, 5.5.2) of Eigen,
/// compiled once.
class LeastSquares {
 public:
  /// Pivots up to `threshold` times the largest count as zero; 0: rounding alone does.
  explicit LeastSquares(double threshold = 0);
  LeastSquares(const LeastSquares& other);
  LeastSquares(LeastSquares&&) noexcept;
  LeastSquares& operator=(LeastSquares&&) noexcept;
  ~LeastSquares();

  /// A: rows x columns. May be called again, with another shape.
  void factor(MatrixView A);
  int rank() const;  ///< after factor()
  // After factor(). Lengths are those of A, which is not checked.
  VectorX solve(VectorView b) const;             ///< b: rows; x: columns
  MatrixX solve_columns(MatrixView B) const;     ///< B: rows x any number
  VectorX solve_transposed(VectorView c) const;  ///< of A' y = c; c: columns, y: rows

 private:
  struct Factors;
  std::unique_ptr<Factors> factors_;
};

}  // namespace tether::linalg
TETHER_EXPORT_END

// Tether: dense orthogonal factors with chosen columns. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/export.hpp>
#include <tether/linalg/eigen.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::linalg {

/// A P = Q R with the longest remaining column first (Businger and Golub 1965), by Eigen, compiled
/// once.
class PivotedQr {
 public:
  /// Pivots up to `threshold` times the largest count as zero; 0: rounding alone does.
  explicit PivotedQr(double threshold = 0);
  PivotedQr(PivotedQr&&) noexcept;
  PivotedQr& operator=(PivotedQr&&) noexcept;
  ~PivotedQr();

  /// A: rows x columns. May be called again, with another shape.
  void factor(MatrixView A);
  int rank() const;  ///< pivots that count; this and all below: after factor()
  /// Upper triangle: R, columns in the order of the pivots; below it lie the reflections of Q.
  MatrixView R() const;
  std::vector<int> order() const;  ///< columns of A, the first pivot's first
  MatrixX Q() const;               ///< rows x rows
  /// Columns that span what A' takes to zero: the last rows - rank of Q.
  MatrixX left_null_space() const;

 private:
  struct Factors;
  std::unique_ptr<Factors> factors_;
};

}  // namespace tether::linalg
TETHER_EXPORT_END

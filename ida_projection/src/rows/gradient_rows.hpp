// Tether: few rows given by their gradients, on any N_Vector. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "host/owned_vector.hpp"

namespace tether::ida_projection {

/// S C D = L Q^T with D the metric, S rows of unit length, L lower triangular in pivot order. Only
/// N_Vector operations: the same code serves serial, OpenMP, MPI, device and custom vectors. The
/// rows are orthogonalised by modified Gram-Schmidt with pivoting, twice those that lose nine
/// tenths of their length ("twice is enough"); their Gram matrix is never formed.
class GradientRows {
 public:
  GradientRows(int rows, N_Vector like);

  int rows() const { return m_; }
  int rank() const { return rank_; }
  /// The m gradients, to be filled before factor(), which changes them.
  std::vector<N_Vector>& gradients() { return gradients_; }

  /// `WT`: tolerances. Returns the first row that is not finite; -1: none.
  int factor(N_Vector D, N_Vector WT);
  /// Until the next factor() only rows whose independent part is at least `least` take part.
  void keep_firm(double least);
  /// dy <- the shortest D^-1 dy with C dy = g over the kept rows.
  void solve(const std::vector<double>& g, N_Vector D, N_Vector dy);
  /// After solve(): a dropped row that asks for more than half a tolerance beyond the kept rows,
  /// and those rows, ascending. Empty: there is none.
  std::vector<int> contradicting() const;

 private:
  double& L(int row, int column) { return L_[static_cast<std::size_t>(row * m_ + column)]; }
  double L(int row, int column) const { return L_[static_cast<std::size_t>(row * m_ + column)]; }
  void orthogonalise();

  int m_, rank_ = 0;
  double length_;  // number of unknowns
  std::vector<OwnedVector> owned_;
  std::vector<N_Vector> gradients_;  // raw handles of owned_, as the callback wants them
  OwnedVector work_;
  std::vector<double> norm_, tolerance_norm_, left_, z_, L_;
  std::vector<int> pivot_;
};

}  // namespace tether::ida_projection

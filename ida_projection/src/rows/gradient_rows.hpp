// Tether: few rows given by their gradients, on any N_Vector. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "constraints/evaluator.hpp"
#include "host/owned_vector.hpp"
#include "host/rounding.hpp"

namespace tether::ida_projection {

/// S C D = L Q^T with D the metric, S rows of unit length, L lower triangular in pivot order. Only
/// N_Vector operations: the same code serves serial, OpenMP, MPI, device and custom vectors. The
/// rows are orthogonalised by modified Gram-Schmidt with pivoting, twice those that lose nine
/// tenths of their length ("twice is enough"); their Gram matrix is never formed.
class GradientRows {
 public:
  GradientRows(int rows, N_Vector like)
      : m_(rows),
        length_(static_cast<double>(N_VGetLength(like))),
        work_(like),
        norm_(at(rows), 0.0),
        tolerance_norm_(norm_),
        left_(norm_),
        z_(norm_),
        L_(at(rows) * at(rows), 0.0),
        pivot_(at(rows), 0) {
    for (int i = 0; i < m_; ++i) owned_.emplace_back(like);
    for (const OwnedVector& q : owned_) gradients_.push_back(q);
  }

  int rows() const { return m_; }
  int rank() const { return rank_; }
  /// The m gradients, to be filled before factor(), which changes them.
  std::vector<N_Vector>& gradients() { return gradients_; }

  /// `WT`: tolerances. Returns the first row that is not finite; -1: none.
  int factor(N_Vector D, N_Vector WT) {
    for (int i = 0; i < m_; ++i) {
      N_Vector row = gradients_[at(i)];
      N_VProd(row, WT, work_);
      tolerance_norm_[at(i)] = norm(work_);
      N_VProd(row, D, row);
      const double size = norm_[at(i)] = norm(row);
      if (!std::isfinite(size)) return i;
      if (!vanishes(size)) N_VScale(1.0 / size, row, row);
      left_[at(i)] = vanishes(size) ? 0.0 : 1.0;
      pivot_[at(i)] = i;
    }
    orthogonalise();
    return -1;
  }
  /// Until the next factor() only rows whose independent part is at least `least` take part.
  void keep_firm(double least) {
    while (rank_ > 0 && L(pivot_[at(rank_ - 1)], rank_ - 1) < least) --rank_;
  }
  /// dy <- the shortest D^-1 dy with C dy = g over the kept rows.
  void solve(const std::vector<double>& g, N_Vector D, N_Vector dy) {
    if (rank_ == 0) N_VConst(0.0, dy);
    for (int k = 0; k < m_; ++k) {
      const int row = pivot_[at(k)];
      double left = vanishes(norm_[at(row)]) ? g[at(row)] : g[at(row)] / norm_[at(row)];
      for (int i = 0; i < std::min(k, rank_); ++i) left -= L(row, i) * z_[at(i)];
      if (k >= rank_) {
        z_[at(k)] = std::abs(left);  // residual of this dropped row
        continue;
      }
      z_[at(k)] = left / L(row, k);
      if (k == 0)
        N_VScale(z_[0], gradients_[at(row)], dy);
      else
        N_VLinearSum(1.0, dy, z_[at(k)], gradients_[at(row)], dy);
    }
    N_VProd(dy, D, dy);
  }
  /// After solve(): a dropped row that asks for more than half a tolerance beyond the kept rows,
  /// and those rows, ascending. Empty: there is none.
  std::vector<int> contradicting() const {
    for (int k = rank_; k < m_; ++k) {
      const int row = pivot_[at(k)];
      const double size = norm_[at(row)];
      const double left = z_[at(k)] * (vanishes(size) ? 1.0 : size);
      if (left <=
          kContradicts * std::sqrt(length_) * tolerance_norm_[at(row)] + 1e2 * kEpsilon * size)
        continue;
      std::vector<int> found = {row};
      for (int i = 0; i < rank_; ++i)
        if (std::abs(L(row, i)) > kInvolved) found.push_back(pivot_[at(i)]);
      std::sort(found.begin(), found.end());
      return found;
    }
    return {};
  }

 private:
  static constexpr double kDependent = 1e-12;      // of a unit row, for each row
  static constexpr double kReorthogonalise = 0.1;  // of it: where less is left, digits are lost

  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  static double norm(N_Vector v) { return std::sqrt(N_VDotProd(v, v)); }
  double& L(int row, int column) { return L_[static_cast<std::size_t>(row * m_ + column)]; }
  double L(int row, int column) const { return L_[static_cast<std::size_t>(row * m_ + column)]; }
  void orthogonalise() {
    std::fill(L_.begin(), L_.end(), 0.0);
    rank_ = 0;
    for (int k = 0; k < m_; ++k) {
      int best = k;
      for (int i = k + 1; i < m_; ++i)
        if (left_[at(pivot_[at(i)])] > left_[at(pivot_[at(best)])]) best = i;
      std::swap(pivot_[at(best)], pivot_[at(k)]);
      const int p = pivot_[at(k)];
      if (left_[at(p)] == 0.0) break;
      // A second time, if the rows before it have taken most of the pivot.
      for (int i = 0; left_[at(p)] < kReorthogonalise && i < k; ++i) {
        N_Vector q = gradients_[at(pivot_[at(i)])];
        const double r = N_VDotProd(q, gradients_[at(p)]);
        L(p, i) += r;
        N_VLinearSum(1.0, gradients_[at(p)], -r, q, gradients_[at(p)]);
      }
      const double r = norm(gradients_[at(p)]);
      if (!(r > m_ * kDependent)) break;
      L(p, k) = r;
      N_VScale(1.0 / r, gradients_[at(p)], gradients_[at(p)]);
      rank_ = k + 1;
      for (int i = k + 1; i < m_; ++i) {
        const int row = pivot_[at(i)];
        const double share = N_VDotProd(gradients_[at(p)], gradients_[at(row)]);
        L(row, k) = share;
        N_VLinearSum(1.0, gradients_[at(row)], -share, gradients_[at(p)], gradients_[at(row)]);
        left_[at(row)] = norm(gradients_[at(row)]);
      }
    }
  }

  int m_, rank_ = 0;
  double length_;  // number of unknowns
  std::vector<OwnedVector> owned_;
  std::vector<N_Vector> gradients_;  // raw handles of owned_, as the callback wants them
  OwnedVector work_;
  std::vector<double> norm_, tolerance_norm_, left_, z_, L_;
  std::vector<int> pivot_;
};

}  // namespace tether::ida_projection

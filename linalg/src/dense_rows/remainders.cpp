// Tether: what independent rows leave of the others. SPDX-License-Identifier: BSD-3-Clause
#include "remainders.hpp"

#include <utility>

namespace tether::linalg {

void Remainders::resize(int rows, int columns) {
  rows_.resize(static_cast<std::size_t>(rows));
  Q_.resize(rows, columns);
  L_.resize(rows, rows);
  begin();
}

double* Remainders::add(int row) {
  rows_[static_cast<std::size_t>(count_)] = row;
  return Q_.row(count_++).data();
}

// Gram-Schmidt, repeated for the pivot row.
void Remainders::factor(double tolerance) {
  for (int k = 0; k < count_; ++k) {
    int pivot = k;
    double longest = -1.0;
    for (int i = k; i < count_; ++i) {
      const double square = Q_.row(i).squaredNorm();
      if (!(square > longest)) continue;
      longest = square;
      pivot = i;
    }
    if (pivot != k) {
      Q_.row(pivot).swap(Q_.row(k));
      L_.row(pivot).head(k).swap(L_.row(k).head(k));
      std::swap(rows_[static_cast<std::size_t>(pivot)], rows_[static_cast<std::size_t>(k)]);
    }
    for (int l = 0; l < k; ++l) take_out(l, k, k + 1);
    L_(k, k) = Q_.row(k).norm();
    if (!(L_(k, k) > tolerance)) return;
    rank_ = k + 1;
    Q_.row(k) /= L_(k, k);
    for (int i = k + 1; i < count_; ++i) L_(i, k) = 0.0;
    take_out(k, k + 1, count_);
  }
}

// Subtracts from rows from .. to - 1 their components along q_k.
void Remainders::take_out(int k, int from, int to) {
  for (int i = from; i < to; ++i) {
    const double share = Q_.row(i).dot(Q_.row(k));
    Q_.row(i) -= share * Q_.row(k);
    L_(i, k) += share;
  }
}

void Remainders::add_solution(int rank, double* rest, double* du) const {
  for (int k = 0; k < rank; ++k) {
    double w = rest[k];
    for (int l = 0; l < k; ++l) w -= L_(k, l) * rest[l];
    rest[k] = w / L_(k, k);
  }
  Eigen::Map<Eigen::RowVectorXd> to(du, Q_.cols());
  for (int k = 0; k < rank; ++k) to += rest[k] * Q_.row(k);
}

void Remainders::dependence(int k, int rank, double* x) const {
  for (int l = rank - 1; l >= 0; --l) {
    double sum = L_(k, l);
    for (int i = l + 1; i < rank; ++i) sum -= L_(i, l) * x[i];
    x[l] = sum / L_(l, l);
  }
}

}  // namespace tether::linalg

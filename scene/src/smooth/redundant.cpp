// Tether: rows that the others imply all along the motion. SPDX-License-Identifier: BSD-3-Clause
//
// A combination n of rows with n^T G = 0 at the start is one of three things:
//  - implied for good: with the other rows at zero, its g stays zero. To second order that means
//    n^T gamma(v) = 0 for every velocity v that the joints allow (G v = 0). One row of n is left
//    out. The set g = 0 remains the same, and off the set, where n^T G is small but not zero, a
//    row that must not be used for a move is no longer there;
//  - a dead point: some v has n^T gamma(v) != 0. Its rows are needed later and stay;
//  - a contradiction, which shows in g.
//
// What was left out at the start need not be the best choice later (Bricard's linkage: the rest
// loses rank after a quarter of the period), and near a dead point the direction in which g says
// almost nothing magnifies its rounding. So the rows that the projection uses are chosen anew
// along the motion, those with the longest pivots; below kWeak a row is not used, another one
// stands twice in its place.
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "system.hpp"

namespace tether::scene::smooth {

namespace {

constexpr double kDependent = 1e-9;    // of rows of unit length
constexpr double kSecondOrder = 1e-7;  // of n^T gamma, relative to |gamma|
constexpr int kMostTrials = 8;         // velocities
constexpr double kWeak = 1e-2;         // pivot of a row of unit length
constexpr double kGood = 0.3;
constexpr int kWait = 4;  // steps between looks while all pivots are good

}  // namespace

void System::leave_out_redundant_rows() {
  m_ = all_;
  place_.resize(static_cast<std::size_t>(all_));
  for (int i = 0; i < all_; ++i) place_[static_cast<std::size_t>(i)] = i;
  values_.setZero(2 * all_);
  spread_.setZero(all_);
  place_of_used_ = used_ = place_;
  if (all_ == 0) return;

  update(0.0, start_.data());
  form_gradient();
  const Eigen::VectorXd length = G_.rowwise().norm().cwiseMax(1e-300);
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  qr.setThreshold(kDependent);
  qr.compute((length.cwiseInverse().asDiagonal() * G_).transpose());
  const Eigen::Index r = qr.rank(), dependent = all_ - r, n = G_.cols();
  if (dependent == 0) return;

  // N: the combinations, of scaled rows. G^T P = Q (R11 R12; 0 0), N = P (-R11^-1 R12; 1).
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(all_, dependent);
  N.topRows(r) = -qr.matrixR().topLeftCorner(r, r).triangularView<Eigen::Upper>().solve(
      qr.matrixR().topRightCorner(r, dependent));
  N.bottomRows(dependent).setIdentity();
  N = qr.colsPermutation() * N;

  const Eigen::Index freedoms = n - r;
  const int trials = static_cast<int>(std::min<Eigen::Index>(kMostTrials, 2 * freedoms));
  if (trials > 0) {
    const Eigen::MatrixXd Q = qr.householderQ() * Eigen::MatrixXd::Identity(n, n);
    Eigen::MatrixXd second(dependent, trials);
    for (Now& each : now_) each.s1 = each.s2 = 0.0;
    for (int trial = 0; trial < trials; ++trial) {
      Eigen::VectorXd mix(freedoms);  // fixed numbers without a pattern
      for (Eigen::Index i = 0; i < freedoms; ++i)
        mix[i] = std::sin(1.0 + 12.9898 * static_cast<double>(i) + 78.233 * trial);
      const Eigen::VectorXd v = Q.rightCols(freedoms) * mix.normalized();
      for (int k = 0; k < moving(); ++k) {
        Frame<double>& f =
            bodies_.frames[static_cast<std::size_t>(body_of_slot_[static_cast<std::size_t>(k)])];
        f.v = v.segment<3>(6 * k);
        f.W = f.R * v.segment<3>(6 * k + 3);
        f.a = f.alpha = Vector3d::Zero();
      }
      each_row([&](const auto& row) {
        row.template rows<2>(bodies_.frames[static_cast<std::size_t>(row.first)],
                             bodies_.frames[static_cast<std::size_t>(row.second)],
                             values_.data() + row.row);
      });
      const Eigen::VectorXd gamma = values_.head(all_).cwiseQuotient(length);
      second.col(trial) = N.transpose() * gamma / std::max(gamma.norm(), 1e-12);
    }
    // Combinations of N that every trial leaves at zero.
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(second, Eigen::ComputeFullU);
    Eigen::Index needed = 0;
    for (Eigen::Index i = 0; i < svd.singularValues().size(); ++i)
      needed += svd.singularValues()[i] > kSecondOrder;
    N = (N * svd.matrixU().rightCols(dependent - needed)).eval();
  }
  if (N.cols() == 0) return;

  // Of each combination a row with a large part in it.
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> choice(N.transpose());
  for (Eigen::Index k = 0; k < N.cols(); ++k)
    place_[static_cast<std::size_t>(choice.colsPermutation().indices()[k])] = -1;
  m_ = 0;
  for (int& place : place_)
    if (place >= 0) place = m_++;
  used_.resize(static_cast<std::size_t>(m_));
}

void System::choose_rows(double t, const double* y) {
  update(t, y);
  choose_rows();
}

void System::choose_rows() {
  if (m_ == 0) return;
  all_gradients();
  for (int i = 0; i < all_; ++i) all_G_.row(i) /= std::max(all_G_.row(i).norm(), 1e-300);
  row_choice_.compute(all_G_.transpose());
  const auto& order = row_choice_.colsPermutation().indices();
  const Eigen::Index most = std::min<Eigen::Index>(m_, row_choice_.matrixR().rows());
  Eigen::Index count = 0;
  double pivot = 1.0;
  while (count < most) {
    pivot = std::abs(row_choice_.matrixR()(count, count));
    if (pivot < kWeak) break;
    ++count;
  }
  for (Eigen::Index k = 0; k < m_; ++k)
    used_[static_cast<std::size_t>(k)] = static_cast<int>(order[k < count ? k : 0]);
  std::sort(used_.begin(), used_.end());
  std::fill(place_of_used_.begin(), place_of_used_.end(), -1);
  for (int k = m_ - 1; k >= 0; --k)
    place_of_used_[static_cast<std::size_t>(used_[static_cast<std::size_t>(k)])] = k;
  wait_ = pivot > kGood ? kWait : 1;
}

void System::look_at_rows() {
  if (--wait_ <= 0) choose_rows();
}

}  // namespace tether::scene::smooth

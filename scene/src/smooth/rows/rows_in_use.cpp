// Tether: which rows of the joints are used. SPDX-License-Identifier: BSD-3-Clause
//
// A combination n of rows with n^T G = 0 at the start is one of three things:
//  - implied for good: with the other rows at zero, its g stays zero. To second order that means
//    n^T gamma(v) = 0 for every velocity v that the joints allow (G v = 0);
//  - a singular position: some v has n^T gamma(v) != 0. Its rows are needed later;
//  - a contradiction, which shows in g.
//
// The projection gets as many rows as there are without the first kind. Off the constraints n^T G
// is small, but not zero: on all rows it would chase the rounding of g in a direction in which
// nothing has to move (Bricard's linkage, tolerance 1e-7: 60820 steps; this way 514). Which rows
// these are is chosen along the motion, those with the longest pivots.
//
// Near a singular position g says almost nothing about one direction, and its rounding, magnified
// by 1 / pivot, exceeds what a tight tolerance allows. For these few steps rows with such pivots
// are not used; another one stands twice in the place of each. No more steps than that: a
// slider-crank whose lengths differ by 1e-6 turns back at a pivot of 1.4e-3, and the rows must see
// it.
#include "rows_in_use.hpp"

#include <tether/linalg/disjoint_sets.hpp>
#include <tether/linalg/singular_values.hpp>

#include "moving_bodies.hpp"

namespace tether::scene::smooth {

namespace {

constexpr double kDependent = 1e-9;  // pivot of rows of unit length
constexpr double kRounding = 1e-11;  // of g, with room for the next steps
constexpr int kWait = 4;             // steps between choices while all pivots are good
// Looking at dense rows costs the cube of their number. Of many, those of a tree are independent at
// every state; those of closed loops are chosen by their entries.
constexpr double kLeastWeakByEntries = 1.2e-4;

}  // namespace

RowsInUse::RowsInUse(JointRows& rows, MovingBodies& bodies)
    : rows_(rows), bodies_(bodies), count_(rows.count()) {
  if (in_place()) {
    used_.resize(at(count_));
    std::iota(used_.begin(), used_.end(), 0);
    place_of_used_ = used_;
    carries_.assign(at(count_), 1);
    if (!independent_by_structure()) sparse_ = std::make_unique<SparseRowChoice>(rows_, bodies_);
    return;
  }
  if (rows.count() > 0) {
    rows_.set_time(0.0);
    bodies_.set_state(bodies_.start().data());
    gradient_.form(rows_, bodies_);
    const Eigen::VectorXd length = gradient_.G.rowwise().norm().cwiseMax(1e-300);
    linalg::PivotedQr qr(kDependent);
    qr.factor((length.cwiseInverse().asDiagonal() * gradient_.G).transpose());
    count_ = qr.rank() + count_needed_beyond(length, qr);
  }
  used_.assign(at(count_), 0);
  place_of_used_.assign(at(rows.count()), -1);
  carries_.assign(at(rows.count()), 0);
  choose();
}

// Bodies as nodes, all that do not move as one, joints as edges: a forest. From its leaves inwards
// each joint has rows of full rank on a body that no other joint left acts on.
bool RowsInUse::independent_by_structure() const {
  linalg::DisjointSets trees(bodies_.count() + 1);  // the last: all that do not move
  const auto node = [&](int body) {
    const int slot = bodies_.all().inertia[at(body)].slot;
    return slot < 0 ? bodies_.count() : slot;
  };
  std::vector<char> seen;
  bool forest = !rows_.has_couplings();
  rows_.each([&](const auto& row) {
    if (row.joint >= static_cast<int>(seen.size())) seen.resize(at(row.joint) + 1, 0);
    if (seen[at(row.joint)]) return;
    seen[at(row.joint)] = 1;
    const bool apart = trees.join(node(row.first), node(row.second));
    forest = forest && apart;
  });
  return forest;
}

// Counts the combinations n that are singular positions: n^T gamma(v) != 0 for some of a few
// velocities.
int RowsInUse::count_needed_beyond(const Eigen::VectorXd& length, const linalg::PivotedQr& qr) {
  const int m = rows_.count(), r = qr.rank();
  const Eigen::Index dependent = m - r, n = gradient_.G.cols(), freedoms = n - r;
  const int trials = static_cast<int>(std::min<Eigen::Index>(8, 2 * freedoms));
  if (dependent <= 0 || trials <= 0) return 0;
  // The combinations N, of scaled rows: G^T P = Q (R11 R12; 0 0), N = P (-R11^-1 R12; 1).
  const Eigen::MatrixXd R = qr.R(), Q = qr.Q();
  Eigen::MatrixXd pivoted(m, dependent), N(m, dependent);
  pivoted.topRows(r) =
      -R.topLeftCorner(r, r).triangularView<Eigen::Upper>().solve(R.topRightCorner(r, dependent));
  pivoted.bottomRows(dependent).setIdentity();
  const std::vector<int> order = qr.order();
  for (int k = 0; k < m; ++k) N.row(order[at(k)]) = pivoted.row(k);
  Eigen::MatrixXd second(dependent, trials);
  Eigen::VectorXd values = Eigen::VectorXd::Zero(m);
  rows_.hold_motions();
  for (int trial = 0; trial < trials; ++trial) {
    Eigen::VectorXd mix(freedoms);  // fixed numbers without a pattern
    for (Eigen::Index i = 0; i < freedoms; ++i)
      mix[i] = std::sin(1.0 + 12.9898 * static_cast<double>(i) + 78.233 * trial);
    const Eigen::VectorXd v = Q.rightCols(freedoms) * mix.normalized();
    for (int k = 0; k < bodies_.count(); ++k) {
      Frame<double>& f = bodies_.frame(k);
      f.v = v.segment<3>(6 * k);
      f.W = f.R * v.segment<3>(6 * k + 3);
      f.a = f.alpha = Vector3d::Zero();
    }
    rows_.values<2>(bodies_.all(), values.data());
    const Eigen::VectorXd gamma = values.cwiseQuotient(length);
    second.col(trial) = N.transpose() * gamma / std::max(gamma.norm(), 1e-12);
  }
  int needed = 0;
  for (const double each : linalg::singular_values(second)) needed += each > 1e-7;
  return needed;
}

void RowsInUse::choose(double tolerance) {
  weak_ = std::min(1e-3, kRounding / tolerance);
  choose();
}

void RowsInUse::choose_sparse() {
  multiplier_choices_ += sparse_->choose(std::max(weak_, kLeastWeakByEntries));
  weakest_ = sparse_->carriers().weakest;
  wait_ = weakest_ > sparse_->good() ? kWait : 1;
}

bool RowsInUse::choose() {
  if (sparse_) choose_sparse();
  if (count_ == 0 || in_place()) return false;
  before_ = used_;
  gradient_.form(rows_, bodies_);
  Eigen::MatrixXd& G = gradient_.G;
  for (int i = 0; i < rows_.count(); ++i) G.row(i) /= std::max(G.row(i).norm(), 1e-300);
  row_choice_.factor(G.transpose());
  const std::vector<int> order = row_choice_.order();
  const linalg::MatrixView R = row_choice_.R();
  const Eigen::Index most = std::min<Eigen::Index>(count_, R.rows());
  Eigen::Index count = 0;
  double pivot = 1.0;
  while (count < most) {
    pivot = std::abs(R(count, count));
    if (pivot < weak_) break;
    ++count;
  }
  for (Eigen::Index k = 0; k < count_; ++k)
    used_[static_cast<std::size_t>(k)] = order[static_cast<std::size_t>(k < count ? k : 0)];
  std::sort(used_.begin(), used_.end());
  std::fill(place_of_used_.begin(), place_of_used_.end(), -1);
  for (int k = count_ - 1; k >= 0; --k) place_of_used_[at(used_[at(k)])] = k;
  wait_ = pivot > 0.3 ? kWait : 1;
  weakest_ = count_ <= R.rows() ? std::abs(R(count_ - 1, count_ - 1)) : 0;
  choose_multipliers();
  return used_ != before_;
}

// A change costs IDA a new matrix, so the rows stay while others are not much better.
void RowsInUse::choose_multipliers() {
  const std::vector<int> order = row_choice_.order();
  const auto last = [this](const linalg::PivotedQr& qr) {
    const linalg::MatrixView R = qr.R();
    return count_ <= R.rows() ? std::abs(R(count_ - 1, count_ - 1)) : 0.0;
  };
  if (count_ == rows_.count()) {
    std::fill(carries_.begin(), carries_.end(), char(1));
    return;
  }
  Eigen::Index k = 0;
  carried_gradient_.resize(gradient_.G.cols(), count_);
  for (int i = 0; i < rows_.count(); ++i)
    if (carries_[at(i)]) carried_gradient_.col(k++) = gradient_.G.row(i).transpose();
  if (k == count_) {
    carried_rows_.factor(carried_gradient_);
    if (last(carried_rows_) > kMuchWorse * last(row_choice_)) return;
  }
  ++multiplier_choices_;
  std::fill(carries_.begin(), carries_.end(), char(0));
  for (int i = 0; i < count_; ++i) carries_[at(order[at(i)])] = 1;
}

}  // namespace tether::scene::smooth

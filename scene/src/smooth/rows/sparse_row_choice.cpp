// Tether: independent rows of many joints. SPDX-License-Identifier: BSD-3-Clause
//
// The factor of G M^-1 G^T + eps tells of each row what those before it leave of it, shrunk by eps:
// a row that hardly stands out of the others counts for little in the rows behind it, so that one
// of these can be chosen in its place. Where rows are independent but for a singular position at
// the start is seen a little way off: behind a free move of length s they have pivots of order s,
// and rows that are implied for good, once the loops are closed again, have none.
//
// Closed nets have rows that are independent for good and yet thin: n x n balls, both diagonals,
// are one rigid body down to singular values of n^-4. Who leaves them out of the equations has
// another mechanism, whose joints drift. The factors tell them from dependent ones to about
// sqrt(eps) times the coefficients; the rest show in velocities that the others allow. What is thin
// all along is no singular position: that is where pivots are much smaller than elsewhere.
#include "rows_in_use.hpp"

#include <Eigen/Cholesky>
#include <tether/linalg/pivoted_qr.hpp>

#include "mechanics/frames.hpp"

namespace tether::scene::smooth {

namespace {

using Row6 = Eigen::Matrix<double, 1, 6>;

// Rows whose independent part is smaller are dependent. In nets of balls coefficients of dependent
// rows reach 1e4. A dependent row that is kept carries a multiplier that nothing determines, and
// steps collapse.
constexpr double kThin = 1e-4;

constexpr double kDependentByEntries = 1.3e-6;  // the least that A A^T + eps allows
constexpr int kCloseMoves = 3;
// Velocities that look for thin rows at once, and what they must show of a row of unit length.
constexpr int kProbes = 16;
constexpr double kShown = 1e-10;
// Part of what a velocity may show by error. A row too few changes the motion, and IDA stops (net
// of 30 x 30 balls: one); one too many leaves a multiplier undetermined, which costs steps.
constexpr double kErrorShare = 0.02;

}  // namespace

SparseJointGradient::SparseJointGradient(const JointRows& rows, const MovingBodies& bodies)
    : rows_(rows), bodies_(bodies) {
  for (int k = 0; k < bodies.count(); ++k)
    roots_.emplace_back(bodies.inertia(k).inverse.llt().matrixL());
  std::vector<std::vector<int>> slots(at(rows.count()));
  each_entry([&](int row, int, int slot, const Vector3d&, const Vector3d&) {
    slots[at(row)].push_back(slot);
  });
  std::vector<int> columns;
  starts_.push_back(0);
  for (std::vector<int>& of_row : slots) {
    sort_unique(of_row);
    for (const int slot : of_row)
      for (int j = 0; j < 6; ++j) columns.push_back(6 * slot + j);
    starts_.push_back(static_cast<int>(columns.size()));
  }
  factors_.resize(6 * bodies.count(), starts_, std::move(columns), 0);
  std::fill_n(factors_.metric(), 6 * bodies.count(), 1.0);
  least_.setZero(6 * bodies.count());
  rates_.setZero(rows.count());
}

void SparseJointGradient::factor(const char* wanted, double rank_tolerance) {
  std::fill_n(factors_.entries(), starts_.back(), 0.0);
  each_entry([&](int row, int offset, int slot, const Vector3d& force, const Vector3d& torque) {
    if (wanted && !wanted[row]) return;
    Eigen::Map<Row6> to(factors_.entries() + starts_[at(row)] + offset);
    to.head<3>() += force.transpose() / std::sqrt(bodies_.inertia(slot).mass);
    to.tail<3>() += torque.transpose() * roots_[at(slot)];
  });
  factors_.factor(rank_tolerance, kThin);
}

SparseRowChoice::SparseRowChoice(JointRows& rows, MovingBodies& bodies)
    : rows_(rows), bodies_(bodies), gradient_(rows, bodies), all_(at(rows.count()), 1) {
  rows_.set_time(0.0);
  std::vector<double> y = bodies_.start();
  bodies_.set_state(y.data());
  gradient_.factor(all_, kDependentByEntries);
  if (gradient_.independent(kept_.has) < rows_.count()) {
    move_freely(y);
    close(y);
  }
  const int count = independent_among(all_, kDependentByEntries).count;
  carriers_ = best(count, kDependentByEntries);
  add_thin(carriers_);
  const RowSet seen = independent_among(carriers_.has, kDependentByEntries);
  seen_ = seen.count;
  usual_ = seen.weakest;
  bodies_.set_state(bodies_.start().data());
  kept_ = carriers_;
}

// Rows that are too thin for the factors of A A^T. A velocity that all rows of the set allow, to
// `left`, is known to left / (their least singular value) only.
void SparseRowChoice::add_thin(RowSet& set) {
  const int n = 6 * bodies_.count(), m = rows_.count();
  if (set.count == m) return;
  gradient_.factor(all_, kDependentByEntries);
  const Eigen::VectorXd length = gradient_.size_of_rows().cwiseSqrt().cwiseMax(1e-300);
  Eigen::VectorXd v(n), rates(m);
  Eigen::MatrixXd shown(kProbes, m);
  std::uint32_t random = 1;
  for (int round = 0, added = 1; round < 20 && added > 0; ++round) {
    gradient_.factor(set.has, kDependentByEntries);
    double left = 0;
    for (int probe = 0; probe < kProbes; ++probe) {
      for (double& component : v) {
        random = 1664525u * random + 1013904223u;  // Numerical Recipes, section 7.1
        component = random / 4294967296.0 - 0.5;
      }
      double before = 1, now = 1;
      for (int k = 0; k < 12 && now > 1e-15; ++k) {
        gradient_.release(v);
        v.normalize();
        gradient_.multiply(v, rates);
        rates = rates.cwiseQuotient(length);
        shown.row(probe) = rates.transpose();
        for (int i = 0; i < m; ++i) (set.has[at(i)] ? shown(probe, i) : rates[i]) = 0;
        now = rates.cwiseAbs().maxCoeff();
        if (k > 0 && now > 0.5 * before) break;
        before = now;
      }
      left = std::max(left, now);
    }
    linalg::PivotedQr qr;
    qr.factor(shown);
    const linalg::MatrixView R = qr.R();
    const std::vector<int> order = qr.order();
    const double least = std::max(kShown, kErrorShare * left / (0.25 * kDependentByEntries));
    for (added = 0; added < kProbes && std::abs(R(added, added)) > least; ++added)
      set.has[at(order[at(added)])] = 1;
    set.count += added;
  }
}

// Mean distance of bodies that a joint connects.
double SparseRowChoice::reach() const {
  double sum = 0;
  int count = 0;
  rows_.each([&](const auto& row) {
    const Bodies& all = bodies_.all();
    if (!all.moves(row.first) || !all.moves(row.second)) return;
    sum += (all.frames[at(row.first)].x - all.frames[at(row.second)].x).norm();
    ++count;
  });
  return count > 0 && sum > 0 ? sum / count : 1.0;
}

// Along velocities without a pattern, less what the joints forbid; by the current factors.
void SparseRowChoice::move_freely(std::vector<double>& y) {
  const int n = 6 * bodies_.count();
  const double length = reach();
  Eigen::VectorXd v(n);
  for (int i = 0; i < n; ++i) v[i] = std::sin(1.0 + 12.9898 * i) * (i % 6 < 3 ? length : 1.0);
  gradient_.release(v);
  double largest = 0;
  for (int i = 0; i < n; ++i)
    largest = std::max(largest, std::abs(v[i]) / (i % 6 < 3 ? length : 1.0));
  if (largest > 1e-6) move(y, 1e-3 / largest * v);
}

void SparseRowChoice::close(std::vector<double>& y) {
  const double closed = 1e-12 * reach();
  Eigen::VectorXd g(rows_.count()), v(6 * bodies_.count()), multipliers(rows_.count());
  v.setZero();
  for (int k = 0; k <= kCloseMoves; ++k) {
    bodies_.set_state(y.data());
    rows_.values<0>(bodies_.all(), g.data());
    if (k == kCloseMoves || g.cwiseAbs().maxCoeff() <= closed) return;
    gradient_.factor(all_, kDependentByEntries);
    gradient_.solve(g, v, multipliers);
    move(y, -v);
  }
}

// There are never more independent rows than a little way off the start: at loose tolerances bodies
// are off the joints by more than rounding, and rows that are implied seem independent.
bool SparseRowChoice::choose(double weak) {
  const RowSet seen = independent_among(carriers_.has, kDependentByEntries);
  if (seen.count >= seen_) usual_ = std::max(usual_, seen.weakest);
  weak = std::min(weak, 0.1 * usual_);
  RowSet carried = carriers_;
  carried.weakest = carriers_.weakest = seen.count < seen_ ? 0 : seen.weakest;
  const bool as_it_was = carried.weakest > kMuchWorse * weakest_found_ && --steps_to_search_ > 0;
  if (carried.weakest > good() || (as_it_was && carried.weakest > weak)) {
    kept_ = std::move(carried);
    return false;
  }
  steps_to_search_ = 16;
  kept_ = best(carriers_.count, weak);
  weakest_found_ = kept_.weakest;
  if (kept_.count != carriers_.count || carried.weakest > kMuchWorse * kept_.weakest) {
    weakest_found_ = carried.weakest;
    if (carried.weakest > weak) kept_ = std::move(carried);
    return false;
  }
  carriers_ = kept_;
  seen_ = kept_.count;
  return true;
}

}  // namespace tether::scene::smooth

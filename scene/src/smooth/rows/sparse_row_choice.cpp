// Tether: independent rows of many joints. SPDX-License-Identifier: BSD-3-Clause
//
// The factor of G M^-1 G^T + eps tells of each row what those before it leave of it, shrunk by eps:
// a row that hardly stands out of the others counts for little in the rows behind it, so that one
// of these can be chosen in its place. Where rows are independent but for a dead point at the start
// is seen a little way off: behind a free move of length s they have pivots of order s, and rows
// that are implied for good, once the loops are closed again, have none.
#include "sparse_row_choice.hpp"

#include <algorithm>
#include <cmath>

#include "mechanics/quaternions.hpp"

namespace tether::scene::smooth {

namespace {

// GramFactor weighs the coefficients of rows up to d = 1e6 eps: then of all that are this short.
constexpr double kDependentByEntries = 1.2e-4;
constexpr double kWay = 1e-3;  // of the free move, of a link's length and in rad
constexpr int kCloseMoves = 3;
constexpr double kClosed = 1e-12;  // of a link's length
constexpr double kStandsOut = 0.1, kGoodChoice = 0.03;
constexpr double kMuchWorseChoice = 0.1;
constexpr int kLooks = 16;  // from one search to the next

}  // namespace

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
  bodies_.set_state(bodies_.start().data());
  kept_ = independent_among(all_, kDependentByEntries);
}

RowSet SparseRowChoice::independent_among(const std::vector<char>& wanted, double dependent) {
  gradient_.factor(wanted, dependent);
  RowSet found;
  found.count = gradient_.independent(found.has);
  for (int i = 0; i < rows_.count(); ++i)
    if (found.has[at(i)]) found.weakest = std::min(found.weakest, gradient_.independent_part(i));
  return found;
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

// v: velocities of each body as in JointGradient.
void SparseRowChoice::move(std::vector<double>& y, const Eigen::VectorXd& v) const {
  for (int k = 0; k < bodies_.count(); ++k) {
    double* s = y.data() + kBody * k;
    Eigen::Map<Vector3d>(s + kPosition) += v.segment<3>(6 * k);
    Eigen::Map<Eigen::Vector4d> q(s + kQuaternion);
    q += quaternion_rate(s + kQuaternion, v.segment<3>(6 * k + 3));
    q.normalize();
  }
}

// Along velocities without a pattern, less what the joints forbid; by the factors at hand.
void SparseRowChoice::move_freely(std::vector<double>& y) {
  const int n = 6 * bodies_.count();
  const double length = reach();
  Eigen::VectorXd v(n), rates(rows_.count()), forbidden(n), multipliers(rows_.count());
  for (int i = 0; i < n; ++i) v[i] = std::sin(1.0 + 12.9898 * i) * (i % 6 < 3 ? length : 1.0);
  forbidden.setZero();
  gradient_.multiply(v, rates);
  gradient_.solve(rates, forbidden, multipliers);
  v -= forbidden;
  double largest = 0;
  for (int i = 0; i < n; ++i)
    largest = std::max(largest, std::abs(v[i]) / (i % 6 < 3 ? length : 1.0));
  if (largest > 1e-6) move(y, kWay / largest * v);
}

void SparseRowChoice::close(std::vector<double>& y) {
  const double closed = kClosed * reach();
  Eigen::VectorXd g(rows_.count()), v(6 * bodies_.count()), multipliers(rows_.count());
  v.setZero();
  for (int k = 0; k <= kCloseMoves; ++k) {
    bodies_.set_state(y.data());
    const Bodies& bodies = bodies_.all();
    rows_.each([&](const auto& row) {
      row.template rows<0>(bodies.frames[at(row.first)], bodies.frames[at(row.second)],
                           g.data() + row.row);
    });
    if (k == kCloseMoves || g.cwiseAbs().maxCoeff() <= closed) return;
    gradient_.factor(all_, kDependentByEntries);
    gradient_.solve(g, v, multipliers);
    move(y, -v);
  }
}

// The set of `count` rows that is furthest from depending on each other, to a factor of 10; at
// least to within `weak`. Fewer rows where there are not so many.
RowSet SparseRowChoice::best(int count, double weak) {
  for (double stands_out = kStandsOut; stands_out > weak; stands_out *= 0.1) {
    RowSet found = independent_among(all_, stands_out);
    if (found.count >= count) return found;
  }
  return independent_among(all_, weak);
}

// There are never more independent rows than a little way off the start: at loose tolerances bodies
// are off the joints by more than rounding, and rows that are implied seem independent.
bool SparseRowChoice::choose(double weak) {
  RowSet carried = independent_among(carriers_.has, kDependentByEntries);
  if (carried.count < carriers_.count) carried.weakest = 0;
  carriers_.weakest = carried.weakest;
  const bool as_it_was = carried.weakest > kMuchWorseChoice * weakest_found_ && --looks_left_ > 0;
  if (carried.weakest > kGoodChoice || (as_it_was && carried.weakest > weak)) {
    kept_ = std::move(carried);
    return false;
  }
  looks_left_ = kLooks;
  kept_ = best(carriers_.count, weak);
  weakest_found_ = kept_.weakest;
  if (kept_.count != carriers_.count || carried.weakest > kMuchWorseChoice * kept_.weakest) {
    weakest_found_ = carried.weakest;
    if (carried.weakest > weak) kept_ = std::move(carried);
    return false;
  }
  carriers_ = kept_;
  return true;
}

}  // namespace tether::scene::smooth

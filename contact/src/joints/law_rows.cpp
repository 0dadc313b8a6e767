// Tether: the laws of joints in a step, as rows of its contact problems.
// SPDX-License-Identifier: BSD-3-Clause
#include "joints/law_rows.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {

namespace {

// Part of a way beyond a limit that a step takes back. What rows of the start of a step leave of it
// is of second order in the step.
constexpr double kTakenBack = 0.2;
constexpr double kHeldByBound = 1 - 1e-9;

using linalg::at;

}  // namespace

double LawRows::speed(int law, const std::vector<Vector6d>& v) const {
  double s = 0;
  for (const JointRows::Term* t = laws.rows().begin(law); t != laws.rows().end(law); ++t)
    s += t->G.dot(v[at(t->body)]);
  return s;
}

int LawRows::moving_along(int law) const {
  const JointRows::Term* t = laws.rows().begin(law);
  return t->G.head<3>().isZero(0) ? -1 : t->body;
}

int LawRows::moving(int law, const Mechanisms& mechanisms) const {
  const JointRows::Term* t = laws.rows().begin(law);
  return mechanisms.moves(t->body) ? t->body : t[1].body;
}

// Strikes: what closes within the step, and faster than forces bring it there in one. The whole
// impact is now, as that of a contact; a slower approach closes the gap first.
void LawRows::prepare(const std::vector<Vector6d>& v, double dt, const Mechanisms& mechanisms) {
  dt_ = dt;
  strikes.clear();
  impulses.assign(at(laws.count()), 0);
  plastic.assign(at(laws.count()), 0);
  bias_.assign(at(laws.count()), 0);
  plastic_bias_.assign(at(laws.count()), 0);
  for (int k = 0; k < laws.count(); ++k) {
    const JointLaws::Law& law = laws[k];
    if (!law.limit) {
      bias_[at(k)] = plastic_bias_[at(k)] = -law.rate;
      continue;
    }
    const double came = -speed(k, coming_), comes = -speed(k, v);
    const bool hits = comes * dt > law.gap && came > std::max(0.0, comes - came);
    if (hits)
      strikes.push_back(
          {law.gap, came, comes, moving_along(k), moving(k, mechanisms), law.restitution});
    // A body that turns throws what is at its limit beyond it, and against it, in every step.
    const double beyond = kTakenBack * std::min(law.gap, 0.0) / dt;
    plastic_bias_[at(k)] = hits || law.gap < 0 ? beyond : law.gap / dt;
    bias_[at(k)] = hits ? std::min(-law.restitution * came, beyond) : plastic_bias_[at(k)];
  }
}

ContactRows LawRows::contact(int law, LawUse use, const std::vector<Vector6d>& v,
                             const Mechanisms& mechanisms, Eigen::Vector3d& own) const {
  const JointLaws::Law& each = laws[law];
  const int row = each.limit ? 0 : 1;
  ContactRows out;
  double mobility = 0;
  for (const JointRows::Term* t = laws.rows().begin(law); t != laws.rows().end(law); ++t) {
    (t == laws.rows().begin(law) ? out.first : out.second) = t->body;
    (t == laws.rows().begin(law) ? out.J1 : out.J2).row(row) = t->G.transpose();
    mobility += (mechanisms.root(t->body).transpose() * t->G).squaredNorm();
  }
  own.setConstant(mobility);
  own[row] = 0;
  out.bias[row] = use == LawUse::limits    ? std::max(each.gap, 0.0) / dt_
                  : use == LawUse::plastic ? plastic_bias_[at(law)]
                                           : bias_[at(law)];
  if (each.limit) return out;
  // N presses as fast as the row itself moves, so that a large bound does not make the other
  // velocities of the problem small beside it.
  const double N = each.bound * dt_, fast = std::abs(speed(law, v) - each.rate);
  if (N > 0 && fast > 0) own[0] = std::min(mobility, fast / N);
  out.bias[0] = -own[0] * N;
  out.mu = 1;
  return out;
}

Eigen::Vector3d LawRows::start(int law, const Eigen::Vector3d* last) const {
  Eigen::Vector3d x = last != nullptr ? *last : Eigen::Vector3d::Zero();
  if (laws[law].limit) return {x[0], 0, 0};
  const double N = laws[law].bound * dt_;
  return {N, std::clamp(x[1], -N, N), 0};
}

LawState LawRows::state(int law, const std::vector<Vector6d>& v) const {
  const JointLaws::Law& each = laws[law];
  LawState out;
  out.side = at_bound(law);
  out.limit = each.limit;
  out.impulse = impulses[at(law)];
  out.body = moving_along(law);
  if (each.limit) return out;
  out.came = speed(law, coming_) - each.rate;
  out.left = speed(law, v) - each.rate;
  out.bound = each.bound * dt_;
  return out;
}

// Sign of the impulse; 0: the bound does not hold it.
int LawRows::at_bound(int law) const {
  if (laws[law].limit) return 0;
  const double x = impulses[at(law)], N = laws[law].bound * dt_;
  return std::abs(x) < kHeldByBound * N ? 0 : x > 0 ? 1 : -1;
}

}  // namespace tether::contact::detail

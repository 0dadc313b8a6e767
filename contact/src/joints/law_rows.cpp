// Tether: the laws of joints in a step, as rows of its contact problems.
// SPDX-License-Identifier: BSD-3-Clause
#include "joints/law_rows.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {

using linalg::at;

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
  while (!mechanisms.moves(t->body)) ++t;
  return t->body;
}

// A limit is struck if its gap closes within the step, and faster than the forces of one step could
// close it. It then takes its whole impact now, as a contact does; slower ones close the gap first.
void LawRows::prepare(const std::vector<Vector6d>& v, double dt, const Mechanisms& mechanisms) {
  dt_ = dt;
  strikes.clear();
  impulses.assign(at(laws.count()), 0);
  plastic.assign(at(laws.count()), 0);
  rows_.assign(at(laws.count()), {});
  for (int k = 0; k < laws.count(); ++k) {
    const JointLaws::Law& law = laws[k];
    Row& row = rows_[at(k)];
    if (!law.is_limit()) {
      // s' - rate + compliance x + stretch stiffness / (stiffness dt + damping)
      row.bias = -law.rate;
      if (law.is_sprung()) {
        row.compliance = 1 / (dt * (law.stiffness * dt + law.damping));
        row.bias += law.stretch * law.stiffness / (law.stiffness * dt + law.damping);
      }
      row.plastic_bias = row.bias;
      continue;
    }
    const double came = -speed(k, coming_), comes = -speed(k, v);
    const bool hits = comes * dt > law.gap && came > std::max(0.0, comes - came);
    if (hits)
      strikes.push_back(
          {law.gap, came, comes, moving_along(k), moving(k, mechanisms), law.restitution});
    // On a turning body every step drives a joint at its limit a little beyond it: rows of its
    // start are exact to second order only. A fifth of that is taken back.
    const double beyond = 0.2 * std::min(law.gap, 0.0) / dt;
    row.plastic_bias = hits || law.gap < 0 ? beyond : law.gap / dt;
    row.bias = hits ? std::min(-law.restitution * came, beyond) : row.plastic_bias;
  }
}

BodyCone LawRows::cone(int law, LawUse use) const {
  const JointLaws::Law& each = laws[law];
  BodyCone out(each.is_limit()             ? Cone::nonnegative()
               : std::isfinite(each.bound) ? Cone::bounded(each.bound * dt_)
                                           : Cone::free());
  out.compliance = rows_[at(law)].compliance;
  for (const JointRows::Term* t = laws.rows().begin(law); t != laws.rows().end(law); ++t)
    out.terms.push_back({t->body, t->G.transpose()});
  out.bias[0] = use == LawUse::limits    ? std::max(each.gap, 0.0) / dt_
                : use == LawUse::plastic ? rows_[at(law)].plastic_bias
                                         : rows_[at(law)].bias;
  return out;
}

double LawRows::start(int law, const Eigen::Vector3d* last) const {
  const double x = last != nullptr ? (*last)[0] : 0, N = laws[law].bound * dt_;
  return laws[law].is_limit() ? x : std::clamp(x, -N, N);
}

void LawRows::add_bounded(bool without_restitution, const BodySet& bodies,
                          std::vector<Vector6d>& change) const {
  for (int k = 0; k < laws.count(); ++k) {
    if (laws[k].is_limit()) continue;
    const double x = (without_restitution ? plastic : impulses)[at(k)];
    for (const JointRows::Term* t = laws.rows().begin(k); t != laws.rows().end(k); ++t) {
      const RigidBody& body = bodies.motion[at(t->body)];
      change[at(t->body)].head<3>() += x * body.inverse_mass * t->G.head<3>();
      change[at(t->body)].tail<3>() += x * (body.inverse_inertia * t->G.tail<3>());
    }
  }
}

void LawRows::scale_restitution(const Mechanisms& mechanisms,
                                const std::function<double(int)>& scale) {
  for (int k = 0; k < laws.count(); ++k) {
    const double s = scale(moving(k, mechanisms));
    if (s < 1) impulses[at(k)] = plastic[at(k)] + s * (impulses[at(k)] - plastic[at(k)]);
  }
}

LawState LawRows::state(int law, const std::vector<Vector6d>& v) const {
  const JointLaws::Law& each = laws[law];
  LawState out;
  out.side = at_bound(law);
  out.impulse = impulses[at(law)];
  out.body = moving_along(law);
  if (each.is_limit()) return out;
  out.came = speed(law, coming_) - each.rate;
  out.left = speed(law, v) - each.rate;
  out.bound = each.bound * dt_;
  return out;
}

// Sign of the impulse; 0: the bound does not hold it.
int LawRows::at_bound(int law) const {
  if (laws[law].is_limit()) return 0;
  const double x = impulses[at(law)], N = laws[law].bound * dt_;
  return std::abs(x) < (1 - 1e-9) * N ? 0 : x > 0 ? 1 : -1;
}

}  // namespace tether::contact::detail

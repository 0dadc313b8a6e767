// Tether: rolling friction in the contact problems of steps. SPDX-License-Identifier: BSD-3-Clause
#include "rolling/rolling_part.hpp"

#include <algorithm>
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

Options solver_options(const BodyOptions& options) {
  Options out;
  out.law = options.law;
  out.measure = Measure::fixed_point;
  out.tolerance = options.tolerance;
  out.strict = options.strict;
  out.max_work = options.max_work;
  out.enough = options.enough;
  return out;
}

RollingIslands::RollingIslands(const NearContacts& near, const BodyOptions& options,
                               std::vector<Vector3d>* moments)
    : near_(near),
      options_(solver_options(options)),
      warm_(options.warm_start),
      moments_(moments != nullptr ? *moments : own_) {}

void RollingIslands::set_options(const BodyOptions& options) { options_ = solver_options(options); }

void RollingIslands::find_islands(const std::vector<RigidBody>& bodies,
                                  const std::vector<PointContact>& contacts) {
  sets_.reset(static_cast<int>(bodies.size()));
  for (const PointContact& c : contacts)
    if (c.second >= 0 && bodies[at(c.first)].moves() && bodies[at(c.second)].moves())
      sets_.join(c.first, c.second);
  rolls_.assign(bodies.size(), 0);
  for (const PointContact& c : contacts) {
    const Meeting& m = near_.meeting(c);
    if (m.rolling > 0 || m.torsional > 0) rolls_[at(island(bodies, c))] = 1;
  }
  rolling_.clear();
  rest_.clear();
  for (std::size_t k = 0; k < contacts.size(); ++k)
    (rolls_[at(island(bodies, contacts[k]))] != 0 ? rolling_ : rest_)
        .push_back(static_cast<int>(k));
  std::stable_sort(rolling_.begin(), rolling_.end(), [&](int i, int j) {
    return island(bodies, contacts[at(i)]) < island(bodies, contacts[at(j)]);
  });
}

void RollingIslands::solve(BodySolver& others, const std::vector<RigidBody>& bodies,
                           const std::vector<PointContact>& contacts, BodySolution& out) {
  moments_.assign(contacts.size(), Vector3d::Zero());
  find_islands(bodies, contacts);
  points_.clear();
  for (const int k : rest_) points_.push_back(contacts[at(k)]);
  others.solve(bodies, points_, solution_);
  out = solution_;
  if (rest_.empty()) out.status = Status::solved, out.error = 0;
  out.impulses.assign(contacts.size(), Vector3d::Zero());
  out.regimes.assign(contacts.size(), Regime::separating);
  for (std::size_t k = 0; k < rest_.size(); ++k) {
    out.impulses[at(rest_[k])] = solution_.impulses[k];
    out.regimes[at(rest_[k])] = solution_.regimes[k];
  }
  memory_.rewind();
  const int *begin = rolling_.data(), *last = begin + rolling_.size();
  while (begin < last) {
    const int which = island(bodies, contacts[at(*begin)]);
    const int* end = begin;
    while (end < last && island(bodies, contacts[at(*end)]) == which) ++end;
    solve_island(bodies, contacts, begin, end, out);
    begin = end;
  }
  remember(others, contacts, out);
}

void RollingIslands::solve_island(const std::vector<RigidBody>& bodies,
                                  const std::vector<PointContact>& contacts, const int* begin,
                                  const int* end, BodySolution& out) {
  contacts_.clear();
  for (const int* k = begin; k < end; ++k) {
    const PointContact& p = contacts[at(*k)];
    const Meeting& m = near_.meeting(p);
    contacts_.push_back({p, m.rolling, m.torsional});
    if (const Vector3d* last = warm_ ? memory_.find(p.id) : nullptr)
      contacts_.back().impulse = *last;
    if (const Vector3d* last = warm_ ? memory_.find(moment_id(p.id)) : nullptr)
      contacts_.back().moment = *last;
  }
  const ConeSolution found = solve_rolling(bodies, options_, contacts_);
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const RollingContact& c = contacts_[k];
    const PointContact& p = c.point;
    const std::size_t contact = at(begin[k]);
    out.impulses[contact] = c.impulse;
    moments_[contact] = c.moment;
    const double normal = p.normal.dot(c.impulse);
    if (normal > 0)
      out.regimes[contact] = (c.impulse - normal * p.normal).norm() < (1 - 1e-12) * p.mu * normal
                                 ? Regime::sticking
                                 : Regime::sliding;
    const auto push = [&](int body, const Vector3d& r, double sign) {
      if (body < 0) return;
      const RigidBody& b = bodies[at(body)];
      out.velocities[at(body)] += sign * b.inverse_mass * c.impulse;
      out.angular_velocities[at(body)] +=
          sign * b.inverse_inertia * (r.cross(c.impulse) + c.moment);
    };
    push(p.first, p.r1, 1);
    push(p.second, p.r2, -1);
  }
  ++out.islands;
  out.sweeps = std::max(out.sweeps, found.counts.sweeps);
  if (!(found.error <= out.error)) out.error = found.error;
  if (found.status == Status::solved) return;
  ++out.failed_islands;
  out.status = found.status;
}

// All contacts, here and in the other solver, whose impulses a saved state has.
void RollingIslands::remember(BodySolver& others, const std::vector<PointContact>& contacts,
                              const BodySolution& out) {
  memory_.keep(contacts, out.impulses);
  for (const int k : rolling_) memory_.add(moment_id(contacts[at(k)].id), moments_[at(k)]);
  memory_.get(start_);
  others.set_warm_start(start_);
}

// Moves that take penetrations back have no friction of any kind. The first islands of a run of
// steps are those of its velocities; others are of impacts and of what they close.
std::unique_ptr<RollingIslands> RollingPart::make(const BodyOptions& options, LawUse laws) {
  if (laws == LawUse::limits) return nullptr;
  return std::make_unique<RollingIslands>(near_, options,
                                          std::exchange(first_, false) ? &moments_ : nullptr);
}

}  // namespace tether::contact::detail

// Tether: solves without contacts that are far open, and then with those that close after all.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <stdexcept>
#include <tether/contact/ranks.hpp>

#include "body_sweeps/implementation.hpp"

namespace tether::contact {

using Eigen::Vector3d;

namespace {

// Nothing has been solved, and nothing presses.
void clear(const std::vector<RigidBody>& bodies, std::size_t contacts, BodySolution& out) {
  out.status = Status::solved;
  out.error = 0;
  out.islands = out.assembled_islands = out.failed_islands = out.sweeps = out.colours = 0;
  out.replaced.clear();
  out.spheres = true;
  out.impulses.resize(contacts);
  std::fill(out.impulses.begin(), out.impulses.end(), Vector3d::Zero());
  out.regimes.resize(contacts);
  std::fill(out.regimes.begin(), out.regimes.end(), Regime::separating);
  out.velocities.resize(bodies.size());
  out.angular_velocities.resize(bodies.size());
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    out.velocities[k] = bodies[k].velocity;
    out.angular_velocities[k] = bodies[k].angular_velocity;
  }
}

// Also where a solve throws.
struct MaxSweeps {
  explicit MaxSweeps(int& of) : now(of), before(of) {}
  MaxSweeps(const MaxSweeps&) = delete;
  MaxSweeps& operator=(const MaxSweeps&) = delete;
  ~MaxSweeps() { now = before; }
  int& now;
  const int before;
};

}  // namespace

// False where a contact was refused, which is numbered among those that were solved: all are to be.
bool BodySolver::Implementation::solve_near(const std::vector<RigidBody>& b,
                                            const std::vector<PointContact>& c) {
  BodySolution* const all = out;
  clear(b, c.size(), *out);
  all_starts.swap(starts);
  try {
    for (int group = 0; group < far.groups(); ++group) {
      far.begin(group);
      if (!far.next().empty()) solve_group(b, c, group > 0);
    }
  } catch (const std::invalid_argument&) {
    if (options.team) throw;  // the other processes do not go on
    out = all;
    read(b, c);
    return false;
  }
  out->far = far.count();
  std::sort(out->replaced.begin(), out->replaced.end());
  return true;
}

// Until none closes that is left out. Which do shows long before their island is solved: a look at
// them comes after kLook sweeps or a quarter of all, and after as many with those that have been
// taken in.
void BodySolver::Implementation::solve_group(const std::vector<RigidBody>& b,
                                             const std::vector<PointContact>& c, bool some_far) {
  const MaxSweeps most(options.max_sweeps);
  constexpr int kLook = 250;
  const int look = std::max(1, std::min(kLook, most.before / 4));
  int swept = 0;
  bool looks = some_far, again = false, closed = true;
  while (closed || (looks && found.status != Status::solved)) {
    looks = some_far && closed;
    most.now = looks ? look : std::max(look, most.before - swept);
    solve_next(b, c, again);
    take_motion(b);
    swept += found.sweeps;
    closed = far.take_in(c, *out);
    again = true;
  }
  take_judgement(swept);
}

// again: from what has been found; what has been taken in starts from zero.
void BodySolver::Implementation::solve_next(const std::vector<RigidBody>& b,
                                            const std::vector<PointContact>& c, bool again) {
  near.clear();
  starts.clear();
  for (const int i : far.next()) {
    near.push_back(c[at(i)]);
    if (again) starts.push_back(&out->impulses[at(i)]);
    if (!again && !all_starts.empty()) starts.push_back(all_starts[at(i)]);
  }
  given.read(b, near, options.law);
  BodySolution* const all = out;
  out = &found;
  solve_all(b, near);
  out = all;
}

void BodySolver::Implementation::take_motion(const std::vector<RigidBody>& b) {
  const std::vector<int>& which = far.next();
  for (std::size_t k = 0; k < which.size(); ++k) {
    out->impulses[at(which[k])] = found.impulses[k];
    out->regimes[at(which[k])] = found.regimes[k];
    for (const int body : {near[k].first, near[k].second}) {
      if (body < 0 || !b[at(body)].moves()) continue;
      out->velocities[at(body)] = found.velocities[at(body)];
      out->angular_velocities[at(body)] = found.angular_velocities[at(body)];
    }
  }
}

// Takes the judgement of the last solve of a group, which replaces those before; swept: sweeps of
// all of them.
void BodySolver::Implementation::take_judgement(int swept) {
  BodySolution& o = *out;
  o.status = worse(o.status, found.status);
  o.error = worse(o.error, found.error);
  o.sweeps = std::max(o.sweeps, swept);
  o.colours = std::max(o.colours, found.colours);
  o.islands += found.islands;
  o.assembled_islands += found.assembled_islands;
  o.failed_islands += found.failed_islands;
  o.spheres = o.spheres && found.spheres;
  for (const int k : found.replaced) o.replaced.push_back(far.next()[at(k)]);
}

}  // namespace tether::contact

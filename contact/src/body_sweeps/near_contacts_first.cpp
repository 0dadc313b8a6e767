// Tether: solves without contacts that are far open, and then with those that close after all.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <tether/contact/ranks.hpp>

#include "body_sweeps/implementation.hpp"

namespace tether::contact {

using Eigen::Vector3d;

void BodySolver::Implementation::solve_near(const std::vector<RigidBody>& b,
                                            const std::vector<PointContact>& c) {
  BodySolution& o = *out;
  o.status = Status::solved;
  o.error = 0;
  o.islands = o.assembled_islands = o.failed_islands = o.sweeps = o.colours = 0;
  o.replaced.clear();
  o.spheres = true;
  o.impulses.resize(c.size());
  std::fill(o.impulses.begin(), o.impulses.end(), Vector3d::Zero());
  o.regimes.resize(c.size());
  std::fill(o.regimes.begin(), o.regimes.end(), Regime::separating);
  o.velocities.resize(b.size());
  o.angular_velocities.resize(b.size());
  for (std::size_t k = 0; k < b.size(); ++k) {
    o.velocities[k] = b[k].velocity;
    o.angular_velocities[k] = b[k].angular_velocity;
  }
  const std::size_t swept = far.next().size();
  // Places in `starts` of what comes later are read already.
  for (std::size_t k = 0; k < swept && !starts.empty(); ++k) starts[k] = starts[at(far.next()[k])];
  do {
    near.clear();
    for (const int i : far.next()) near.push_back(c[at(i)]);
    if (!starts.empty()) starts.resize(near.size());
    given.read(b, near, options.law);
    out = &found;
    solve_all(b, near);
    out = &o;
    merge(b);
    // Again, from what has been found; what has been taken in starts from zero.
    if (!far.take_in(c, o)) break;
    starts.resize(far.next().size());
    for (std::size_t k = 0; k < starts.size(); ++k) starts[k] = &o.impulses[at(far.next()[k])];
  } while (true);
  o.far = far.count();
}

// What has been found, to the caller's solution. Islands that are solved again count again.
void BodySolver::Implementation::merge(const std::vector<RigidBody>& b) {
  BodySolution& o = *out;
  const std::vector<int>& which = far.next();
  o.status = worse(o.status, found.status);
  o.error = found.error != found.error ? found.error : std::max(o.error, found.error);
  o.sweeps = std::max(o.sweeps, found.sweeps);
  o.colours = std::max(o.colours, found.colours);
  o.islands = std::max(o.islands, found.islands);
  o.assembled_islands += found.assembled_islands;
  o.failed_islands += found.failed_islands;
  o.spheres = o.spheres && found.spheres;
  o.bytes = found.bytes + far.bytes() + near.capacity() * sizeof(near[0]);
  o.body_bytes = found.body_bytes;
  for (std::size_t k = 0; k < which.size(); ++k) {
    o.impulses[at(which[k])] = found.impulses[k];
    o.regimes[at(which[k])] = found.regimes[k];
    const PointContact& c = near[k];
    for (const int body : {c.first, c.second}) {
      if (body < 0 || !b[at(body)].moves()) continue;
      o.velocities[at(body)] = found.velocities[at(body)];
      o.angular_velocities[at(body)] = found.angular_velocities[at(body)];
    }
  }
  for (const int k : found.replaced) o.replaced.push_back(which[at(k)]);
  std::sort(o.replaced.begin(), o.replaced.end());
  o.replaced.erase(std::unique(o.replaced.begin(), o.replaced.end()), o.replaced.end());
}

}  // namespace tether::contact

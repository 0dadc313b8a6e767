// Tether: contacts wedged against each other. SPDX-License-Identifier: BSD-3-Clause
#include "random_contacts.hpp"
#include <cmath>
#include <tether/contact.hpp>

#include "support/catch.hpp"

using namespace tether::contact;
using Eigen::Vector3d;

namespace {

// Four bodies with fifteen contacts between them and with the floor, normals within 60 degrees or
// so of the vertical: A has a null space within the cones.
Problem four_bodies(std::uint64_t seed) {
  random::Generator any(seed);
  std::vector<RigidBody> bodies(4);
  for (RigidBody& b : bodies) {
    b.inverse_mass = std::pow(10, any.uniform(-2, 2));
    b.inverse_inertia.diagonal() = 3 * b.inverse_mass * Vector3d(1, 0.5, 2);
    b.velocity = any.vector();
    b.angular_velocity = any.vector();
  }
  const double mu = std::pow(10, any.uniform(0, 1));
  std::vector<PointContact> contacts(15);
  for (PointContact& c : contacts) {
    c.first = static_cast<int>(any.uniform(0, 4));
    c.second = static_cast<int>(any.uniform(-1, 4));
    if (any.uniform(-1, 4) < 0 || c.second == c.first) c.second = -1;
    for (Vector3d* r : {&c.r1, &c.r2}) {
      const double x = any.uniform(-1, 1), y = any.uniform(-1, 1);
      *r = {x, y, r == &c.r1 ? -1.0 : 1.0};
    }
    const double x = any.uniform(-1, 1), y = any.uniform(-1, 1);
    c.normal = Vector3d(x, y, any.uniform(0.3, 1.3)).normalized();
    c.mu = mu;
  }
  return delassus(bodies, to_contacts(contacts));
}

}  // namespace

TEST_CASE("wedged: impulses that grow until they are round-off are no end") {
  Options o;
  o.law = Law::coulomb;
  o.tolerance = 1e-8;
  o.measure = Measure::fixed_point;
  Solver solver(o);
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    const Problem p = four_bodies(seed);
    const Solution s = solver.solve(p);
    INFO("seed " << seed << ": " << name(s.status) << " " << s.error << ", impulses up to "
                 << s.impulses.cwiseAbs().maxCoeff() << ", work " << s.counts.work);
    CHECK(s.status == Status::solved);
    CHECK(s.error <= 1e-8);
    CHECK(evaluate(p, o.law, s.impulses).fixed_point <= 1e-8);
    CHECK(s.counts.work < 2e8);
  }
}

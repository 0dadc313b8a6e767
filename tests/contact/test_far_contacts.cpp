// Tether: contacts that are far open are not swept, unless they close after all.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstring>
#include <string>
#include <tether/contact.hpp>
#include <vector>

#include "packing.hpp"
#include "support/catch.hpp"

namespace tether::contact {
namespace {

// A lattice of spheres, all as fast downwards, meets the ground. It has contacts between its
// layers, gaps of .1 and 25 mm, and across, far open.
random::Packing falling(double speed, double gap) {
  const int side = 14;
  random::Packing p = random::packing(side, true, 5);
  for (RigidBody& b : p.bodies) {
    b.velocity -= speed * Eigen::Vector3d::UnitZ();
    b.angular_velocity.setZero();
  }
  const double dt = 5e-3;
  for (PointContact& c : p.contacts)
    if (c.second >= 0) c.bias = 1e-4 / dt;
  const int layer = side * side;
  for (int i = 0; i + layer + side < static_cast<int>(p.bodies.size()); ++i) {
    for (const int j : {i + layer + 1, i + layer + side, i + side + 1}) {
      PointContact c;
      c.first = j;
      c.second = i;
      c.normal = j == i + side + 1 ? Eigen::Vector3d(1, 1, 0)
                                   : Eigen::Vector3d(j == i + layer + 1, j == i + layer + side, 1);
      c.normal.normalize();
      c.r1 = -0.5 * c.normal;
      c.r2 = 0.5 * c.normal;
      c.mu = 0.4;
      c.bias = gap / dt;
      p.contacts.push_back(c);
    }
  }
  for (std::size_t k = 0; k < p.contacts.size(); ++k) p.contacts[k].id = k;
  return p;
}

BodyOptions options(int threads) {
  BodyOptions o;
  o.tolerance = 3e-3;
  o.max_assembled = 0;
  o.leave_out_far = true;
  o.threads = threads;
  return o;
}

bool same(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
          std::size_t n) {
  for (std::size_t k = 0; k < n; ++k)
    if (std::memcmp(a[k].data(), b[k].data(), 24) != 0) return false;
  return true;
}

}  // namespace

TEST_CASE("far contacts: what never closes is not swept, and the answer is one of all contacts") {
  const random::Packing p = falling(10, 0.2);
  const BodySolution s = BodySolver(options(1)).solve(p.bodies, p.contacts);
  CHECK(s.status == Status::solved);
  CHECK(s.far > 7000);  // of 7400
  const Residuals r = evaluate(p.bodies, p.contacts, options(1).law, s.impulses);
  CHECK(r.fixed_point < 3e-3);
  CHECK(r.signorini < 0.06);  // of 10 m/s
}

// The lowest layers are stopped, those above go on: contacts across close at up to 7 m/s.
TEST_CASE("far contacts: those that close are taken in") {
  const random::Packing p = falling(10, 0.025);
  const BodySolution s = BodySolver(options(1)).solve(p.bodies, p.contacts);
  CHECK(s.status == Status::solved);
  CHECK(s.far > 3000);
  int closed = 0;
  for (std::size_t k = 0; k < p.contacts.size(); ++k)
    closed += p.contacts[k].bias > 1 && !s.impulses[k].isZero(0);
  CHECK(closed > 0);
  const Residuals r = evaluate(p.bodies, p.contacts, options(1).law, s.impulses);
  CHECK(r.fixed_point < 3e-3);
  CHECK(r.signorini < 0.06);
}

TEST_CASE("far contacts: bits depend neither on threads nor on other islands") {
  random::Packing p = falling(10, 0.025);
  const std::size_t bodies = p.bodies.size(), contacts = p.contacts.size();
  const BodySolution one = BodySolver(options(1)).solve(p.bodies, p.contacts);
  for (const int threads : {2, 3}) {
    const BodySolution more = BodySolver(options(threads)).solve(p.bodies, p.contacts);
    CHECK(more.far == one.far);
    CHECK(same(one.velocities, more.velocities, bodies));
    CHECK(same(one.impulses, more.impulses, contacts));
  }
  // Another one, at rest, and a third in which nothing is taken in.
  for (const random::Packing& other : {random::packing(6, true, 3), falling(1, 0.2)}) {
    const int first = static_cast<int>(p.bodies.size());
    p.bodies.insert(p.bodies.end(), other.bodies.begin(), other.bodies.end());
    for (PointContact c : other.contacts) {
      c.first += first;
      if (c.second >= 0) c.second += first;
      c.id = p.contacts.size();
      p.contacts.push_back(c);
    }
  }
  const BodySolution all = BodySolver(options(1)).solve(p.bodies, p.contacts);
  CHECK(all.far > one.far + 7000);
  CHECK(same(one.velocities, all.velocities, bodies));
  CHECK(same(one.impulses, all.impulses, contacts));
}

// Looks at which contacts close end unsolved, after a quarter of the sweeps.
TEST_CASE(
    "far contacts: an island is judged by its last solve, and max_sweeps is for all of them") {
  const random::Packing p = falling(10, 0.025);
  int late = 0;
  for (const int sweeps : {50, 150, 300, 350}) {
    BodyOptions o = options(1);
    o.tolerance = 1e-2;
    o.max_sweeps = sweeps;
    const BodySolution s = BodySolver(o).solve(p.bodies, p.contacts);
    CHECK((s.status == Status::solved) == (s.error <= o.tolerance));
    CHECK((s.failed_islands == 0) == (s.status == Status::solved));
    CHECK(s.sweeps <= 1.5 * sweeps);
    late += s.status == Status::solved && s.sweeps > sweeps / 4;
  }
  CHECK(late > 0);
}

// Before, an error that is no number was taken for 0.
TEST_CASE(
    "bodies: what leaves the range of doubles is unsolved, with an error that meets no bound") {
  random::Packing p = falling(10, 0.2);
  p.bodies[500].velocity[1] = 1e300;
  for (const bool leaves_out : {false, true}) {
    BodyOptions o = options(1);
    o.leave_out_far = leaves_out;
    o.max_sweeps = 50;
    const BodySolution s = BodySolver(o).solve(p.bodies, p.contacts);
    CHECK(s.status != Status::solved);
    CHECK_FALSE(s.error <= 1e300);
  }
}

TEST_CASE("far contacts: a contact that is refused is named as in the caller's list") {
  random::Packing p = falling(10, 0.2);
  PointContact c;  // behind the far ones, of a body that cannot move along the normal
  c.first = 500;
  c.r1 = {0, 0, -0.5};
  p.bodies[500].inverse_mass = 0;
  p.contacts.push_back(c);
  const std::string name = "contact " + std::to_string(p.contacts.size() - 1) + ":";
  BodySolver solver(options(1));
  CHECK_THROWS_WITH(solver.solve(p.bodies, p.contacts), Catch::Contains(name));
  p.bodies[500].inverse_mass = p.bodies[499].inverse_mass;
  CHECK(solver.solve(p.bodies, p.contacts).status == Status::solved);
}

TEST_CASE("far contacts: a solve that is taken back leaves the start of the one before") {
  const random::Packing p = falling(10, 0.025);
  BodySolver solver(options(1));
  solver.solve(p.bodies, p.contacts);
  const WarmStart before = solver.warm_start();
  random::Packing slower = p;
  for (RigidBody& b : slower.bodies) b.velocity *= 0.9;
  solver.solve(slower.bodies, slower.contacts);
  solver.take_back();
  const WarmStart after = solver.warm_start();
  REQUIRE(after.ids == before.ids);
  CHECK(same(after.impulses, before.impulses, before.impulses.size()));
}

}  // namespace tether::contact

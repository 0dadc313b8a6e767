// Tether: packings with much friction: the order of the stages. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <tether/contact.hpp>

#include "packing.hpp"
#include "support/catch.hpp"

using namespace tether::contact;

namespace {

// The solution, which meets the law.
Solution solved(const Problem& p, const Options& o) {
  const Solution s = Solver(o).solve(p);
  INFO(name(s.status) << " " << s.error << ", work " << s.counts.work);
  CHECK(s.status == Status::solved);
  CHECK(evaluate(p, o.law, s.impulses).fixed_point <= 1e-6);
  return s;
}

// For lattices of which rounding decides whether single ones are solved: whether this one is. What
// is called solved meets the law.
bool is_solved(const Problem& p, const Options& o) {
  const Solution s = Solver(o).solve(p);
  UNSCOPED_INFO(p.contacts() << " contacts: " << name(s.status) << " " << s.error << ", work "
                             << s.counts.work);
  if (s.status != Status::solved) return false;
  CHECK(evaluate(p, o.law, s.impulses).fixed_point <= 1e-6);
  return true;
}

}  // namespace

TEST_CASE("packings: lattices of 1200 contacts are solved for the work of a few hundred sweeps") {
  double work = 0;
  for (bool spheres : {true, false}) {
    for (double mu : {0.4, 0.7}) {
      for (std::uint64_t seed : {1, 2}) {
        const random::Packing packing = random::close_packing(5, spheres, mu, seed);
        const Problem p = delassus(packing.bodies, to_contacts(packing.contacts));
        Options o;
        o.law = Law::coulomb;
        o.tolerance = 1e-6;
        const Solution s = solved(p, o);
        UNSCOPED_INFO((spheres ? "spheres" : "bodies")
                      << ", mu " << mu << ", seed " << seed << ", " << p.contacts()
                      << " contacts: " << s.counts.work);
        work += s.counts.work;
      }
    }
  }
  INFO(work);
  CHECK(work < 2.2e8);  // 1.81e8
}

TEST_CASE("packings: 5300 contacts are solved by sweeps") {
  double work = 0;
  for (bool spheres : {true, false}) {
    for (double mu : {0.4, 0.7}) {
      const random::Packing packing = random::close_packing(8, spheres, mu, spheres ? 42 : 43);
      const Problem p = delassus(packing.bodies, to_contacts(packing.contacts));
      REQUIRE(p.contacts() > 5000);
      Options o;
      o.law = Law::coulomb;
      o.tolerance = 1e-6;
      const Solution s = solved(p, o);
      UNSCOPED_INFO((spheres ? "spheres" : "bodies") << ", mu " << mu << ": " << s.counts.work);
      work += s.counts.work;
    }
  }
  INFO(work);
  CHECK(work < 4e8);  // 3.25e8
}

// Sweeps do not come near: they leave 5e-4 and 9e-4 after 2.2e9. What is unstable under them is 10
// to 50 contacts each, at a few places. When these are found depends on rounding: 6e8 to 1.4e9 for
// the same lattice with mu changed by 1e-13, so some of three may take longer: the first that is
// solved is enough.
TEST_CASE("packings: parts that are unstable under sweeps follow them, 10600 contacts") {
  bool found = false;
  for (std::uint64_t seed : {3, 1, 2}) {
    if (found) break;
    const random::Packing packing = random::close_packing(10, false, 1, seed);
    const Problem p = delassus(packing.bodies, to_contacts(packing.contacts));
    REQUIRE(p.contacts() > 10000);
    Options o;
    o.law = Law::coulomb;
    o.tolerance = 1e-6;
    o.max_work = 2e9;
    found = is_solved(p, o);
  }
  CHECK(found);
}

// 16 of 20; 9 where sweeps were left for interior points from sticking or near the result and for
// the path from the convex problem, which lead nowhere for most of these.
TEST_CASE("packings: solutions that repel sweeps are found by proximal problems on their way") {
  constexpr double kMost = 3e5;  // work a contact
  int found = 0, count = 0;
  double most = 0;
  for (bool spheres : {true, false}) {
    for (double mu : {0.4, 0.55, 0.7, 0.85, 1.0}) {
      for (std::uint64_t seed : {1, 2}) {
        const random::Packing packing = random::close_packing(4, spheres, mu, seed, 0.05, 1, true);
        const Problem p = delassus(packing.bodies, to_contacts(packing.contacts));
        Options o;
        o.law = Law::coulomb;
        o.tolerance = 1e-6;
        o.max_work = kMost * p.contacts();
        const Solution s = Solver(o).solve(p);
        UNSCOPED_INFO((spheres ? "spheres" : "bodies")
                      << ", mu " << mu << ", seed " << seed << ": " << name(s.status) << " "
                      << s.error << ", work " << s.counts.work);
        found += s.status == Status::solved;
        most = std::max(most, s.counts.work / o.max_work);
        ++count;
      }
    }
  }
  CHECK(most < 1.1);  // 1.24 where the path from the convex problem began beyond the limit
  INFO(found << " of " << count);
  CHECK(found >= 14);
}

TEST_CASE("packings: the few contacts that toggle are solved as problems of their own") {
  double work = 0;
  for (bool spheres : {true, false}) {
    for (std::uint64_t seed : {3, 4}) {
      const random::Packing packing = random::close_packing(5, spheres, 1, seed);
      const Problem p = delassus(packing.bodies, to_contacts(packing.contacts));
      Options o;
      o.law = Law::coulomb;
      o.tolerance = 1e-6;
      work += solved(p, o).counts.work;
    }
  }
  INFO(work);
  CHECK(work < 4.2e8);  // 3.49e8
}

// Structures of 5 to 70 contacts that are unstable under sweeps keep these lattices from settling.
TEST_CASE(
    "packings: parts that are unstable under sweeps are solved, although others have errors") {
  constexpr double kMost = 2.5e8;
  double work = 0;
  int found = 0;
  for (double mu : {0.6, 0.7}) {
    for (std::uint64_t seed : {1, 2, 3, 4}) {
      random::Packing packing = random::packing(7, false, seed);
      for (PointContact& c : packing.contacts) c.mu = mu;
      const Problem p = delassus(packing.bodies, to_contacts(packing.contacts));
      Options o;
      o.law = Law::coulomb;
      o.tolerance = 1e-6;
      o.max_work = kMost;
      const Solution s = Solver(o).solve(p);
      UNSCOPED_INFO("mu " << mu << ", seed " << seed << ": " << name(s.status) << " " << s.error
                          << ", work " << s.counts.work);
      if (s.status == Status::solved) CHECK(evaluate(p, o.law, s.impulses).fixed_point <= 1e-6);
      found += s.status == Status::solved;
      work += s.counts.work;
    }
  }
  CHECK(found >= 7);  // eight; with the rounding of -O1 one is at 5e-5 when the work ends
  INFO(work);
  CHECK(work < 6.5e8);  // 5.39e8
}

// 1.77 and 1.15 times max_work where the iteration of the frictionless problem had a share of its
// own.
TEST_CASE("packings: that no proof of infeasibility is found keeps max_work") {
  random::Packing packing = random::packing(6, false, 1);
  for (PointContact& c : packing.contacts) c.mu = 1;
  const Problem p = delassus(packing.bodies, to_contacts(packing.contacts));
  for (const double most : {2e7, 1e8}) {
    Options o;
    o.law = Law::coulomb;
    o.max_work = most;
    const Solution s = Solver(o).solve(p);
    CHECK(s.status == Status::work_limit);
    CHECK(s.counts.work < 1.13 * most);
  }
}

TEST_CASE("packings: an error that is enough ends the solve after three quarters of the work") {
  random::Packing packing = random::packing(6, false, 1);
  for (PointContact& c : packing.contacts) c.mu = 1;
  const Problem p = delassus(packing.bodies, to_contacts(packing.contacts));
  Options options;
  options.law = Law::coulomb;
  options.max_work = 1e8;
  options.enough = 1;
  const Solution s = Solver(options).solve(p);
  CHECK(s.status == Status::work_limit);
  CHECK(s.error <= 1);
  CHECK(s.counts.work > 0.7 * options.max_work);
  CHECK(s.counts.work < 0.85 * options.max_work);
  options.enough = -1;
  CHECK_THROWS_AS(Solver(options), std::invalid_argument);
}

// Sweeps wander on this lattice (5e-5 after work 6e8); from the convex problem the law is reached
// in 52 factorisations.
TEST_CASE("packings: a lattice on which sweeps wander is solved on the path from the convex one") {
  random::Packing packing = random::packing(6, true, 606);
  for (PointContact& c : packing.contacts) c.mu = 0.45;
  const Problem p = delassus(packing.bodies, to_contacts(packing.contacts));
  Options o;
  o.law = Law::coulomb;
  o.tolerance = 1e-6;
  o.max_work = 6e8;
  const Solution s = solved(p, o);
  CHECK(s.counts.factorisations < 150);
}

// Sweeps wander here, and what starts from where they are leads nowhere in three of the five, which
// end at 1e-4 to 2e-3. The curve has one end, wherever the sweeps are; rounding (mu changed by
// 1e-13) loses one path in thirty.
TEST_CASE("packings: sweeps that wander are followed by the path of interior points") {
  int found = 0;
  const auto look = [&](const random::Packing& packing) {
    const Problem p = delassus(packing.bodies, to_contacts(packing.contacts));
    Options o;
    o.law = Law::coulomb;
    o.tolerance = 1e-6;
    o.max_work = 3e8;
    found += is_solved(p, o);
  };
  look(random::close_packing(3, false, 0.85, 2, 0.03, 1, true));  // mixed radii
  for (std::uint64_t seed : {1, 2, 3, 4})                         // four contacts a body
    look(random::close_packing(3, true, 1, seed, 0.05, 1.08));
  CHECK(found >= 4);
}

TEST_CASE("packings: bodies that sweeps leave unsolved are assembled, 1200 contacts by default") {
  for (bool spheres : {true, false}) {
    const random::Packing p = random::close_packing(5, spheres, 1, spheres ? 33 : 2);
    REQUIRE(p.contacts.size() > 1000);
    BodyOptions o;
    o.law = Law::coulomb;
    const BodySolution s = BodySolver(o).solve(p.bodies, p.contacts);
    INFO((spheres ? "spheres" : "bodies") << ": " << name(s.status) << " " << s.error);
    CHECK(s.status == Status::solved);
    // Sweeps solve the spheres for half the price of the assembled problem.
    CHECK(s.assembled_islands == (spheres ? 0 : 1));
    CHECK(evaluate(p.bodies, p.contacts, o.law, s.impulses).fixed_point <= 1e-6);
    o.max_work = 1e8;  // enough to assemble and solve
    CHECK(BodySolver(o).solve(p.bodies, p.contacts).assembled_islands == (spheres ? 0 : 1));
    o.max_assembled = 1000;
    CHECK(BodySolver(o).solve(p.bodies, p.contacts).assembled_islands == 0);
    o.max_assembled = 100000;
    o.max_work = 1e6;  // not enough for anything on the problem
    CHECK(BodySolver(o).solve(p.bodies, p.contacts).assembled_islands == 0);
  }
}

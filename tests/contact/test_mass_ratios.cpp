// Tether: tall stacks of light and heavy boxes. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <functional>
#include <tether/contact.hpp>

#include "support/catch.hpp"

using namespace tether::contact;
using Eigen::Vector3d;

namespace {

struct Stack {
  std::vector<RigidBody> bodies;
  std::vector<PointContact> contacts;
  Problem problem() const { return delassus(to_bodies(bodies), to_contacts(contacts)); }
};

// Unit cubes on each other, touching with their corners; one millisecond of gravity. `lean`: the
// speed of the top box along x, lower ones in proportion.
Stack stack(int n, const std::function<double(int)>& mass, double mu, double lean) {
  Stack s;
  for (int k = 0; k < n; ++k) {
    RigidBody body;
    body.inverse_mass = 1 / mass(k);
    body.inverse_inertia = 6 / mass(k) * Eigen::Matrix3d::Identity();
    body.velocity = Vector3d(lean * (k + 1) / n, 0, -9.81e-3);
    s.bodies.push_back(body);
    for (double x : {-0.5, 0.5})
      for (double y : {-0.5, 0.5}) {
        PointContact c;
        c.first = k;
        c.second = k - 1;
        c.r1 = {x, y, -0.5};
        c.r2 = {x, y, k > 0 ? 0.5 : 0};
        c.mu = mu;
        s.contacts.push_back(c);
      }
  }
  return s;
}

struct Masses {
  const char* name;
  std::function<double(int, int)> of;
};
const std::vector<Masses>& masses() {
  static const std::vector<Masses> all = {
      {"alternating 1 : 1e6", [](int k, int) { return k % 2 ? 1e6 : 1; }},
      {"alternating 1e6 : 1", [](int k, int) { return k % 2 ? 1 : 1e6; }},
      {"growing to 1e6", [](int k, int n) { return std::pow(1e6, k / (n - 1.0)); }},
      {"falling from 1e6", [](int k, int n) { return std::pow(1e6, 1 - k / (n - 1.0)); }}};
  return all;
}

}  // namespace

TEST_CASE("mass ratios: stacks of 100 and 200 boxes, at rest and leaning") {
  for (const Masses& m : masses()) {
    for (int n : {100, 200}) {
      for (double lean : {0.0, 0.02, 0.1}) {
        const Problem p = stack(
                              n, [&](int k) { return m.of(k, n); }, lean > 0.05 ? 0.3 : 0.5, lean)
                              .problem();
        Options o;
        o.law = Law::coulomb;
        o.measure = Measure::fixed_point;  // of velocities: the natural map drowns in the impulses
        o.tolerance = 1e-6;
        const Solution s = Solver(o).solve(p);
        INFO(n << " boxes, " << m.name << ", lean " << lean << ": " << name(s.status) << " "
               << s.error);
        CHECK(s.status == Status::solved);
        CHECK(evaluate(p, o.law, s.impulses).fixed_point <= 1e-6);
        CHECK(s.counts.factorisations < 60);
        CHECK(s.counts.work < 2e8);  // 0.2 s
      }
    }
  }
}

TEST_CASE("mass ratios: a stack at rest carries its weight") {
  const int n = 200;
  const Stack s = stack(
      n, [](int k) { return k % 2 ? 1e6 : 1; }, 0.5, 0);
  BodyOptions o;
  o.law = Law::coulomb;
  o.tolerance = 1e-6;
  const BodySolution out = BodySolver(o).solve(s.bodies, s.contacts);
  REQUIRE(out.status == Status::solved);
  double above = 0;
  for (int k = n; k-- > 0;) {
    above += 9.81e-3 / s.bodies[static_cast<std::size_t>(k)].inverse_mass;
    double carried = 0;
    for (int c = 0; c < 4; ++c) carried += out.impulses[static_cast<std::size_t>(4 * k + c)].z();
    CHECK(std::abs(carried - above) < 1e-5 * above);
    CHECK(out.velocities[static_cast<std::size_t>(k)].norm() < 1e-6 * 9.81e-3 * 10);
  }
}

TEST_CASE("mass ratios: other units of mass and time change nothing") {
  const int n = 100;
  const Problem p = stack(
                        n, [](int k) { return k % 2 ? 1e6 : 1; }, 0.3, 0.1)
                        .problem();
  Eigen::VectorXd mu(p.contacts());
  for (int i = 0; i < p.contacts(); ++i) mu[i] = p.mu(i);
  for (double of_A : {1e-8, 1.0, 1e8}) {
    for (double of_b : {1e-8, 1.0, 1e8}) {
      const Problem q = Problem::dense(of_A * p.dense_matrix(), of_b * p.b(), mu);
      Options o;
      o.law = Law::coulomb;
      o.measure = Measure::fixed_point;
      o.tolerance = 1e-6;
      const Solution s = Solver(o).solve(q);
      INFO(of_A << " A, " << of_b << " b: " << name(s.status) << " " << s.error);
      CHECK(s.status == Status::solved);
    }
  }
}

TEST_CASE("mass ratios: what round-off keeps from being solved ends soon and says so") {
  for (double ratio : {1e8, 1e12}) {
    for (int n : {100, 400}) {
      const Problem p = stack(
                            n, [&](int k) { return k % 2 ? ratio : 1; }, 0.3, 0.1)
                            .problem();
      Options o;
      o.law = Law::coulomb;
      o.tolerance = 1e-6;
      const Solution s = Solver(o).solve(p);
      INFO(n << " boxes, 1 : " << ratio << ": " << name(s.status) << " " << s.error);
      CHECK(s.status == Status::round_off);
      CHECK(s.counts.work < 0.06 * o.max_work);  // limit of work: 1e10
      CHECK(s.error < 1e-13 * n * ratio);        // the size of the impulses
      CHECK_FALSE(s.advice.empty());
    }
  }
}

// Tether: when a contact problem counts as solved. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>
#include <tether/contact.hpp>

#include "assemblies.hpp"
#include "support/catch.hpp"

using namespace tether::contact;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

const Law kLaws[] = {Law::coulomb, Law::maximum_dissipation, Law::frictionless};

Options options_of(Law law, double tolerance) {
  Options o;
  o.law = law;
  o.tolerance = tolerance;
  return o;
}

VectorXd friction(const Problem& p) {
  VectorXd mu(p.contacts());
  for (int i = 0; i < p.contacts(); ++i) mu[i] = p.mu(i);
  return mu;
}

Problem in_units(const Problem& p, double of_A, double of_b) {
  return Problem::dense(of_A * p.dense_matrix(), of_b * p.b(), friction(p));
}

// Two problems that have nothing to do with each other.
Problem joined(const Problem& p, const Problem& q) {
  const Eigen::Index n = p.b().size(), m = q.b().size();
  MatrixXd A = MatrixXd::Zero(n + m, n + m);
  A.topLeftCorner(n, n) = p.dense_matrix();
  A.bottomRightCorner(m, m) = q.dense_matrix();
  VectorXd b(n + m), mu(p.contacts() + q.contacts());
  b << p.b(), q.b();
  mu << friction(p), friction(q);
  return Problem::dense(A, b, mu);
}

// Every contact `times` times.
Problem repeated(const Problem& p, int times) {
  const Eigen::Index n = p.b().size();
  MatrixXd A(times * n, times * n);
  VectorXd b(times * n), mu(times * p.contacts());
  for (int r = 0; r < times; ++r) {
    for (int c = 0; c < times; ++c) A.block(r * n, c * n, n, n) = p.dense_matrix();
    b.segment(r * n, n) = p.b();
    mu.segment(r * p.contacts(), p.contacts()) = friction(p);
  }
  return Problem::dense(A, b, mu);
}

// Five boxes of `mass` on each other after one step of gravity.
Problem boxes(double mass, double mu) {
  random::Assembly a = random::stack(5, 1, mu);
  for (RigidBody& body : a.bodies) {
    body.inverse_mass /= mass;
    body.inverse_inertia /= mass;
  }
  return a.problem();
}

// An independent judge: the largest violation of a condition on impulses and velocities, in long
// double, over the largest |b_i| (frictionless: b_n) of the island. Impulses become velocities by
// the sum of the block norms of their row.
long double violation(const Problem& p, Law law, const VectorXd& x,
                      const std::vector<int>& replaced) {
  using Wide = long double;
  const int n = p.contacts(), d = p.dimension();
  std::vector<std::array<Wide, 3>> w(static_cast<std::size_t>(n)), X = w;
  std::vector<Wide> reach(w.size(), 0), scale(w.size(), 0);
  std::vector<int> island(w.size());
  std::iota(island.begin(), island.end(), 0);
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  for (int i = 0; i < n; ++i) {
    w[at(i)] = X[at(i)] = {0, 0, 0};
    for (int c = 0; c < d; ++c) X[at(i)][at(c)] = x[d * i + c];
  }
  for (int i = 0; i < n; ++i) {
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const int j = p.columns()[at(k)];
      Wide norm = 0;
      for (int c = 0; c < d; ++c)
        for (int r = 0; r < d; ++r) {
          const Wide a = p.blocks()[at(k)].column[4 * c + r];
          w[at(i)][at(r)] += a * X[at(j)][at(c)];
          norm += a * a;
        }
      reach[at(i)] += std::sqrt(norm);
      if (norm > 0)
        std::replace(island.begin(), island.end(), int(island[at(j)]), int(island[at(i)]));
    }
    for (int c = 0; c < d; ++c) w[at(i)][at(c)] -= p.b()[d * i + c];
  }
  for (int i = 0; i < n; ++i) {
    Wide b = 0;
    for (int c = 0; c < (law == Law::frictionless ? 1 : d); ++c)
      b += Wide(p.b()[d * i + c]) * Wide(p.b()[d * i + c]);
    scale[at(island[at(i)])] = std::max(scale[at(island[at(i)])], std::sqrt(b));
  }
  Wide worst = 0;
  for (int i = 0; i < n; ++i) {
    const auto &xi = X[at(i)], &wi = w[at(i)];
    const Wide mu = law == Law::frictionless ? 0 : p.mu(i), D = reach[at(i)];
    const bool other = std::find(replaced.begin(), replaced.end(), i) != replaced.end();
    Wide g[2] = {0, 0};
    if (law == Law::maximum_dissipation && !other)
      for (int c = 0; c < 2; ++c) g[c] = mu * Wide(p.local(i).c[c]) / Wide(p.local(i).a);
    const Wide t = std::hypot(xi[1], xi[2]);
    Wide bad =
        std::max({-wi[0], D * (t - mu * xi[0]), -D * xi[0], std::min(D * xi[0], std::abs(wi[0]))});
    if (mu > 0 && xi[0] > 0) {
      Wide misfit = std::hypot(wi[1], wi[2]);
      if (t > 0) {  // on the cone: w_t = -s (u + gamma), s >= 0
        const Wide u0 = xi[1] / t + g[0], u1 = xi[2] / t + g[1], uu = u0 * u0 + u1 * u1;
        const Wide s = uu > 0 ? std::max(Wide(0), -(wi[1] * u0 + wi[2] * u1) / uu) : 0;
        misfit = std::min(
            misfit, std::max(std::hypot(wi[1] + s * u0, wi[2] + s * u1), D * (mu * xi[0] - t)));
      }
      bad = std::max(bad, std::min(misfit, D * (1 + mu) * xi[0]));
    }
    const Wide over = scale[at(island[at(i)])];
    worst = std::max(worst, over > 0 ? bad / over : (bad > 0 ? Wide(INFINITY) : Wide(0)));
    if (!(bad == bad)) return INFINITY;
  }
  return worst;
}

}  // namespace

TEST_CASE("criterion: what is left of the approach hangs on no units of mass") {
  for (Law law : kLaws) {
    for (double tolerance : {1e-3, 1e-6}) {
      for (double mass : {1e-9, 1e-3, 1.0, 1e3, 1e9}) {
        const Problem p = boxes(mass, 0.5);
        const Solution s = Solver(options_of(law, tolerance)).solve(p);
        INFO(name(law) << ", " << mass << " kg: " << name(s.status) << " " << s.error);
        REQUIRE(s.status == Status::solved);
        CHECK(violation(p, law, s.impulses, s.replaced) <= tolerance);
        for (int i = 0; i < p.contacts(); ++i)
          CHECK(s.velocities[3 * i] >= -1.01 * tolerance * 0.0981);
      }
    }
  }
}

TEST_CASE("criterion: other units change nothing, at any scale") {
  random::Generator g(31);
  for (int k = 0; k < 8; ++k) {
    const Problem p = random::cluster(g, k % 3 ? 0.4 : 1.5, 3, 6).problem();
    for (Law law : kLaws) {
      const Solution s = Solver(options_of(law, 1e-8)).solve(p);
      for (int A : {-490, -60, -8, 10, 50, 490}) {  // even: roots of A are exact
        for (int b : {-490, -3, 490}) {
          if (std::abs(b - A) > 900) continue;  // impulses leave the range
          const Solution t =
              Solver(options_of(law, 1e-8)).solve(in_units(p, std::ldexp(1, A), std::ldexp(1, b)));
          INFO(name(law) << ", 2^" << A << " A, 2^" << b << " b: " << name(t.status));
          CHECK(t.status == s.status);
          CHECK(violation(p, law, std::ldexp(1, A) * (std::ldexp(1, -b) * t.impulses),
                          t.replaced) <= 10 * 1e-8);
        }
      }
    }
  }
}

// b / A of 1e300 overflows where impulses add up, 1e-320 has a few digits: both in range on their
// own.
TEST_CASE("criterion: impulses outside of the range of doubles are no solution") {
  for (Law law : {Law::coulomb, Law::maximum_dissipation, Law::frictionless}) {
    for (bool large : {true, false}) {
      const double of_A = large ? 0x1p-520 : 0x1p530, of_b = large ? 0x1p520 : 0x1p-530;
      const Problem p = in_units(random::stack(3, 1, 0.5).problem(), of_A, of_b);
      const Solution s = Solver(options_of(law, 1e-8)).solve(p);
      INFO(name(law) << ", " << (large ? "large" : "small") << ": " << name(s.status) << " "
                     << s.error);
      CHECK(s.status == Status::unsolved);
      CHECK(s.impulses.allFinite());
      CHECK(s.velocities.allFinite());
      CHECK_FALSE(s.error <= 1e-8);
      CHECK_FALSE(s.advice.empty());
    }
  }
}

// Between walls impulses grow until they overflow.
TEST_CASE("criterion: a body between closing walls at any scale has finite impulses") {
  RigidBody body;
  body.inverse_mass = 1;
  body.inverse_inertia.setIdentity();
  std::vector<ContactRows> walls;
  for (double side : {1.0, -1.0}) {
    walls.push_back(ContactRows::at_point(0, -1, {0, 0, 0}, {0, 0, 0}, {side, 0, 0}, 5));
    walls.back().bias[0] = -1;
  }
  for (int of_A : {-480, 0, 480})
    for (int of_b : {-480, 0, 480}) {
      const Problem p = in_units(delassus({body}, walls), std::ldexp(1, of_A), std::ldexp(1, of_b));
      const Solution s = Solver(options_of(Law::coulomb, 1e-6)).solve(p);
      INFO("2^" << of_A << " A, 2^" << of_b << " b: " << name(s.status));
      CHECK(s.status == Status::infeasible);
      CHECK(s.impulses.allFinite());
      CHECK(s.velocities.allFinite());
    }
}

TEST_CASE("criterion: no friction makes zero impulses a solution of an approach") {
  for (double mu : {1.0, 1e3, 1e6, 1e9, 1e12}) {
    const Problem p = boxes(1, mu);
    for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
      CHECK(evaluate(p, law, VectorXd::Zero(p.b().size())).fixed_point > 0.5);
      const Solution s = Solver(options_of(law, 1e-3)).solve(p);
      if (s.status == Status::solved) CHECK(violation(p, law, s.impulses, s.replaced) <= 5e-3);
    }
  }
}

TEST_CASE("criterion: a slip that friction cannot stop says nothing about the approach") {
  // A box at 1000 m/s, one step of gravity.
  random::Assembly a = random::stack(1, 1, 0.3);
  a.bodies[0].velocity << 1000, 0, -0.0098;
  const Problem p = a.problem();
  CHECK(evaluate(p, Law::coulomb, VectorXd::Zero(12)).fixed_point > 0.5);
  const Solution s = Solver(options_of(Law::coulomb, 1e-6)).solve(p);
  REQUIRE(s.status == Status::solved);
  for (int i = 0; i < 4; ++i) CHECK(s.velocities[3 * i] >= -1e-6 * 0.0105);
}

TEST_CASE("criterion: a fast slip makes no error of its direction") {
  // The direction of a small friction force may be off by an angle that the force hardly feels and
  // that is, times the slip, many tolerances. Velocities are those of the exact solution.
  random::Generator g(23);
  int far = 0;
  for (int k = 0; k < 300; ++k) {
    const Problem p = random::cluster(g, k % 2 ? 0.01 : 0.1, 3, 6).problem();
    for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
      const Solution s = Solver(options_of(law, 1e-6)).solve(p),
                     exact = Solver(options_of(law, 1e-11)).solve(p);
      REQUIRE(s.status == Status::solved);
      REQUIRE(exact.status == Status::solved);
      CHECK((s.velocities - exact.velocities).norm() <= 5e-6 * p.b().norm());
      far += violation(p, law, s.impulses, s.replaced) > 3e-6;
    }
  }
  CHECK(far > 0);  // what the conditions one by one would say
}

TEST_CASE("criterion: a small problem beside a large one is solved as well as alone") {
  random::Generator g(5);
  for (int k = 0; k < 10; ++k) {
    const Problem p = random::cluster(g, 0.5, 3, 6).problem();
    const Problem q = random::cluster(g, 0.3, 2, 4).problem();
    for (double of_b : {1e-200, 1e-12, 1e-6, 1e9, 1e150}) {
      const Problem both = joined(p, in_units(q, 1e-3, of_b));
      for (Law law : kLaws) {
        const Solution s = Solver(options_of(law, 1e-7)).solve(both);
        INFO(name(law) << ", " << of_b << ": " << name(s.status) << " " << s.error);
        if (s.status != Status::solved) continue;
        const Eigen::Index n = p.b().size();
        CHECK(evaluate(p, law, s.impulses.head(n)).fixed_point <= 1.01e-7);
        CHECK(evaluate(in_units(q, 1e-3, of_b), law, s.impulses.tail(q.b().size())).fixed_point <=
              1.01e-7);
      }
    }
  }
}

TEST_CASE("criterion: contacts given several times have the same error") {
  random::Generator g(9);
  for (int k = 0; k < 20; ++k) {
    const Problem p = random::cluster(g, 0.6, 3, 6).problem();
    for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
      VectorXd x = VectorXd::Zero(p.b().size());  // inside the cones, no solution
      for (int i = 0; i < p.contacts(); ++i)
        x.segment<3>(3 * i) << g.uniform(0, 1), g.uniform(-0.3, 0.3), g.uniform(-0.3, 0.3);
      const double error = evaluate(p, law, x).fixed_point;
      for (int times : {2, 7}) {
        VectorXd shared(times * x.size());
        for (int r = 0; r < times; ++r) shared.segment(r * x.size(), x.size()) = x / times;
        CHECK(evaluate(repeated(p, times), law, shared).fixed_point == Approx(error).epsilon(1e-9));
      }
    }
  }
}

TEST_CASE("criterion: a body between closing walls is infeasible, with the proof") {
  for (double mu : {0.0, 0.4, 1e6}) {
    for (double mass : {1e-6, 1.0, 1e6}) {
      random::Assembly a;
      a.bodies.push_back(random::sphere(mass, 0.5));
      const Vector3d n = Vector3d(1, 2, -0.5).normalized();
      for (double side : {1.0, -1.0}) {
        a.contacts.push_back(
            ContactRows::at_point(0, -1, -0.5 * side * n, Vector3d::Zero(), side * n, mu));
        a.contacts.back().bias[0] = -0.1;  // the wall comes
      }
      a.bodies.push_back(random::box(2, {0.5, 0.5, 0.5}));  // and something that can be solved
      a.bodies[1].velocity << 0, 0, -1;
      a.contacts.push_back(ContactRows::at_point(1, -1, {0, 0, -0.5}, {0, 0, 0}, {0, 0, 1}, mu));
      const Problem p = a.problem();
      for (Law law : kLaws) {
        for (double tolerance : {1e-3, 1e-9}) {
          const Solution s = Solver(options_of(law, tolerance)).solve(p);
          INFO(name(law) << ", mu " << mu << ", " << mass << " kg: " << name(s.status) << " "
                         << s.error);
          REQUIRE(s.status == Status::infeasible);
          REQUIRE(s.infeasible_direction.size() == 9);
          const Eigen::Map<const VectorXd> d(s.infeasible_direction.data(), 9);
          CHECK(d.minCoeff() >= 0);
          CHECK((p.dense_matrix() * d).norm() <= 1e-13 / mass);
          CHECK(p.b().dot(d) >= 0.19);
          CHECK_FALSE(s.advice.empty());
          CHECK(s.counts.work < 1e8);
          // The other island is as well off as alone.
          CHECK(std::abs(s.velocities[6]) <= tolerance);
        }
      }
      // Impulses that swallow b are no solution, whatever is measured.
      VectorXd x = VectorXd::Zero(9);
      x[0] = x[3] = 1e18 * mass;
      CHECK(evaluate(p, Law::frictionless, x).fixed_point > 1);
    }
  }
}

TEST_CASE("criterion: b = 0 is solved by x = 0 from any start") {
  const Problem p = in_units(boxes(1, 0.5), 1, 0);
  for (Law law : kLaws) {
    const Solution s = Solver(options_of(law, 1e-9)).solve(p, VectorXd::Ones(p.b().size()));
    CHECK(s.status == Status::solved);
    CHECK(s.impulses.isZero(0));
  }
}

TEST_CASE(
    "criterion: random small problems, never a wrong solved, never a value that is not finite") {
  int solved = 0;
  for (int k = 0; k < 3000; ++k) {
    random::Generator g(1000 + static_cast<std::uint64_t>(k));
    const double mus[] = {0, 0.01, 0.1, 0.3, 0.6, 1, 2, 5, 30, 1e3, 1e6, 1e9};
    const double mu = mus[static_cast<int>(g.uniform(0, 12))];
    random::Assembly a = random::cluster(g, mu, 1 + static_cast<int>(g.uniform(0, 4)),
                                         1 + static_cast<int>(g.uniform(0, 8)));
    const int kind = k % 4;
    if (kind == 1) {  // grazing: normal velocities from 1e-1 to 1e-300
      for (ContactRows& c : a.contacts) {
        Eigen::Vector3d u = c.J1 * a.bodies[static_cast<std::size_t>(c.first)].velocities();
        if (c.second >= 0) u += c.J2 * a.bodies[static_cast<std::size_t>(c.second)].velocities();
        c.bias[0] = -u[0];
      }
    }
    if (kind == 2)
      for (RigidBody& body : a.bodies) {
        const double factor = std::pow(10, g.uniform(-4, 4));
        body.inverse_mass *= factor;
        body.inverse_inertia *= factor;
      }
    Problem p = a.problem();
    VectorXd b = p.b();
    if (kind == 1)
      for (int i = 0; i < p.contacts(); ++i)
        b[3 * i] = std::copysign(std::pow(10, -g.uniform(1, 300)), g.uniform(-0.3, 0.7));
    const double of_A = kind == 3 ? std::pow(10, g.uniform(-145, 145)) : 1;
    const double of_b = kind == 3 ? std::pow(10, g.uniform(-150, 150)) : 1;
    p = random::shuffled(Problem::dense(of_A * p.dense_matrix(), of_b * b, friction(p)), g);
    Options o = options_of(kLaws[static_cast<int>(g.uniform(0, 3))],
                           std::pow(10, -3 * std::floor(g.uniform(1, 4))));
    o.max_work = 1e6;
    const Solution s = Solver(o).solve(p);
    INFO(k << " " << name(o.law) << ", mu " << mu << ", " << o.tolerance << ": " << name(s.status)
           << " " << s.error);
    REQUIRE(s.impulses.allFinite());
    if (s.status != Status::solved) continue;
    ++solved;
    CHECK(violation(p, o.law, s.impulses, s.replaced) <= 10 * o.tolerance);
  }
  CHECK(solved > 2500);
}

TEST_CASE("criterion: one grazing contact, b_n down to 1e-300") {
  random::Generator g(77);
  for (const std::string kind : {"condition_1e1", "condition_1e4", "boxes", "rods", "hyperbolic"}) {
    for (int k = 0; k < 400; ++k) {
      random::Contact c = g(kind);
      c.b[0] = std::pow(10, -g.uniform(1, 300));
      for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
        const Vector3d x = solve_one(law, c.A, c.b, c.mu).impulse;
        INFO(kind << " " << k << ", " << name(law) << ", b_n " << c.b[0] << ", mu " << c.mu);
        REQUIRE(x.allFinite());
        CHECK(x[0] >= 0);
        const double normal = c.A.row(0).dot(x) - c.b[0];
        // Denormal products round to one unit of the least number.
        const double least = 1e-320, accuracy = kind == "hyperbolic" ? 1e-6 : 1e-12;
        CHECK(std::abs(normal) <=
              accuracy * (c.A.cwiseAbs().row(0).dot(x.cwiseAbs()) + c.b[0]) + least);
        CHECK(std::hypot(x[1], x[2]) <= c.mu * x[0] * (1 + 1e-12) + least);
      }
    }
  }
}

TEST_CASE("criterion: one contact in any units, the same bits") {
  random::Generator g(78);
  for (const std::string& kind : random::classes()) {
    for (int k = 0; k < 100; ++k) {
      const random::Contact c = g(kind);
      for (Law law : kLaws) {
        const Vector3d x = solve_one(law, c.A, c.b, c.mu).impulse;
        for (int A : {-480, 480}) {
          for (int b : {-480, 480}) {
            if (A != b && kind != "boxes") continue;  // impulses near the ends of the range
            const Vector3d y =
                solve_one(law, std::ldexp(1, A) * c.A, std::ldexp(1, b) * c.b, c.mu).impulse;
            INFO(kind << " " << k << ", " << name(law) << ", " << A << " " << b);
            for (int i = 0; i < 3; ++i)
              CHECK(std::abs(std::ldexp(y[i], A - b) - x[i]) <= 1e-11 * x.norm());
          }
        }
      }
    }
  }
}

TEST_CASE("criterion: bodies at one speed, and bodies that slide past at a high one") {
  // Two boxes side by side at 10 m/s in a direction that rounds: what is left of b is round-off.
  random::RigidAssembly a = random::rigid_stack(2, 3);
  for (RigidBody& body : a.bodies) body.velocity << 10.0 / 3, 7.1, 0.3;
  for (PointContact& c : a.contacts) c.mu = 0.3;
  a.contacts.erase(a.contacts.begin(), a.contacts.begin() + 4);
  BodyOptions o;
  o.law = Law::coulomb;
  o.tolerance = 1e-9;
  CHECK(BodySolver(o).solve(a.bodies, a.contacts).status == Status::solved);
  // One of them over the floor at 300 m/s.
  random::RigidAssembly s = random::rigid_stack(1, 1, 0.3);
  s.bodies[0].velocity << 300, 1, -0.0098;
  const BodySolution t = BodySolver(o).solve(s.bodies, s.contacts);
  CHECK(t.status == Status::solved);
  CHECK(t.velocities[0].z() >= -1e-9 * 0.0105);
  CHECK(evaluate(s.bodies, s.contacts, o.law, t.impulses).fixed_point <= 1.01e-9);
  const std::vector<Vector3d> none(4, Vector3d::Zero());
  CHECK(evaluate(s.bodies, s.contacts, o.law, none).fixed_point > 0.5);
}

// A rod hinged above a belt that runs against it: sticking or sliding, friction presses it on.
TEST_CASE(
    "criterion: a jam by friction is no progress in all interfaces, a rod below it is solved") {
  RigidBody rod;
  rod.inverse_inertia(1, 1) = 1;
  PointContact tip;
  tip.first = 0;
  tip.r1 = {1, 0, -1};
  tip.bias = -0.1;
  for (const double mu : {0.5, 0.99, 1.01, 1.5, 3.0})
    for (const double belt : {-1.0, 1.0})
      for (const Law law : {Law::coulomb, Law::maximum_dissipation}) {
        tip.mu = mu;
        tip.slip = {belt, 0, 0};
        const Status expected = belt > 0 && mu > 1 ? Status::cycling : Status::solved;
        INFO("mu " << mu << ", belt " << belt << ", " << name(law));
        const Options o = options_of(law, 1e-6);
        const Problem p = delassus({rod}, to_contacts({tip}));
        CHECK(Solver(o).solve(p).status == expected);
        const ConeProblem cones = ConeProblem::dense(p.dense_matrix(), p.b(), {Cone::friction(mu)});
        CHECK(ConeSolver(o).solve(cones).status == expected);
        for (const int assembled : {0, BodyOptions().max_assembled}) {
          BodyOptions bodies;
          bodies.law = law;
          bodies.max_assembled = assembled;
          CHECK(BodySolver(bodies).solve({rod}, {tip}).status == expected);
        }
      }
}

TEST_CASE(
    "criterion: an open contact without friction has the natural map 0, also where it does not "
    "slide") {
  const Problem p =
      Problem::dense(Eigen::Matrix3d::Identity(), Vector3d(-1, 0, 0), VectorXd::Zero(1));
  for (Law law : kLaws) CHECK(evaluate(p, law, Vector3d::Zero()).natural_map == 0);
}

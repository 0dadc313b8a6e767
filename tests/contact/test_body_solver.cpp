// Tether: sweeps on body velocities. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <tether/contact.hpp>

#include "assemblies.hpp"
#include "body_runs.hpp"
#include "packing.hpp"
#include "support/catch.hpp"

using namespace tether::contact;

namespace {

// In the surfaces.
void add_slips(random::Packing& p) {
  random::Generator g(2);
  for (PointContact& c : p.contacts) {
    const Eigen::Vector3d s(g.uniform(-0.1, 0.1), g.uniform(-0.1, 0.1), g.uniform(-0.1, 0.1));
    c.slip = s - c.normal.dot(s) * c.normal;
  }
}

}  // namespace

TEST_CASE("body form and Delassus form judge alike") {
  for (bool spheres : {true, false}) {
    random::Packing p = random::packing(3, spheres);
    add_slips(p);
    const Problem problem = delassus(p.bodies, to_contacts(p.contacts));
    for (Law law : {Law::coulomb, Law::maximum_dissipation, Law::frictionless}) {
      const BodySolution s = run(p, law, 1);
      REQUIRE(s.status == Status::solved);
      CHECK(s.spheres == (spheres || law == Law::frictionless));
      Eigen::VectorXd x(problem.b().size());
      for (std::size_t k = 0; k < p.contacts.size(); ++k) {
        x.segment<3>(3 * static_cast<Eigen::Index>(k)) =
            tangent_frame(p.contacts[k].normal) * s.impulses[k];
      }
      const Residuals r = evaluate(problem, law, x);
      CHECK(r.fixed_point <= 2e-10);
      CHECK(r.dissipation <= 1e-8);
      const auto v = velocities_after(p.bodies, to_contacts(p.contacts), x);
      for (std::size_t k = 0; k < v.size(); ++k) {
        CHECK((v[k].head<3>() - s.velocities[k]).norm() < 1e-9);
        CHECK((v[k].tail<3>() - s.angular_velocities[k]).norm() < 1e-9);
      }
    }
  }
}

TEST_CASE("evaluate of bodies is evaluate of the Delassus problem") {
  random::Generator g(5);
  for (bool spheres : {true, false}) {
    random::Packing p = random::packing(3, spheres);
    add_slips(p);
    for (PointContact& c : p.contacts) {
      c.bias = g.uniform(-0.1, 0.1);
      c.mu = g.uniform(0, 1) < 0.3 ? 0 : g.uniform(0, 1);
    }
    const Problem problem = delassus(p.bodies, to_contacts(p.contacts));
    for (Law law : {Law::coulomb, Law::maximum_dissipation, Law::frictionless}) {
      const BodySolution s = run(p, law, 1, 1e-3);
      Eigen::VectorXd x(problem.b().size());
      for (std::size_t k = 0; k < p.contacts.size(); ++k) {
        x.segment<3>(3 * static_cast<Eigen::Index>(k)) =
            tangent_frame(p.contacts[k].normal) * s.impulses[k];
      }
      const Residuals a = evaluate(problem, law, x);
      const Residuals b = evaluate(p.bodies, p.contacts, law, s.impulses);
      const auto near = [](double u, double v) {
        return std::abs(u - v) <= 1e-11 * (1 + std::abs(u));
      };
      CHECK(near(a.signorini, b.signorini));
      CHECK(near(a.cone, b.cone));
      CHECK(near(a.alignment, b.alignment));
      CHECK(near(a.dissipation, b.dissipation));
      CHECK(near(a.energy_change, b.energy_change));
      CHECK(near(a.fixed_point, b.fixed_point));
      CHECK(near(a.natural_map, b.natural_map));
      CHECK(near(s.error, b.fixed_point));
    }
  }
}

TEST_CASE("stiff stacks are assembled and solved to a tight tolerance") {
  for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
    for (int n : {2, 5, 10, 20}) {
      for (double ratio : {1.0, 100.0, 1000.0}) {
        const random::RigidAssembly a = random::rigid_stack(n, ratio);
        BodyOptions o;
        o.law = law;
        o.tolerance = 1e-9;
        const BodySolution s = BodySolver(o).solve(a.bodies, a.contacts);
        INFO(name(law) << ", " << n << " boxes, ratio " << ratio);
        CHECK(s.status == Status::solved);
        CHECK(s.failed_islands == 0);
        CHECK(evaluate(a.bodies, a.contacts, law, s.impulses).fixed_point <= 1.1e-9);
        if (ratio > 1) CHECK(s.assembled_islands == 1);
      }
    }
  }
}

TEST_CASE("replaced laws are reported, strict never replaces") {
  random::Generator g(3);
  int replaced = 0, failed = 0;
  for (int k = 0; k < 40; ++k) {
    random::RigidAssembly a;
    const random::Assembly from = random::cluster(g, 2);
    a.bodies = from.bodies;
    for (const ContactRows& c : from.contacts) {
      PointContact p;
      p.first = c.first;
      p.second = c.second;
      p.mu = c.mu;
      p.normal = c.J1.block<1, 3>(0, 0).transpose();
      // The arms from the moments of the rows: sum of e x (r x e) = 2 r over an orthonormal frame.
      for (int r = 0; r < 3; ++r) {
        const Eigen::Vector3d e = c.J1.block<1, 3>(r, 0).transpose();
        p.r1 += 0.5 * e.cross(Eigen::Vector3d(c.J1.block<1, 3>(r, 3).transpose()));
        const Eigen::Vector3d f = c.J2.block<1, 3>(r, 0).transpose();
        p.r2 += 0.5 * f.cross(Eigen::Vector3d(c.J2.block<1, 3>(r, 3).transpose()));
      }
      a.contacts.push_back(p);
    }
    BodyOptions o;
    o.tolerance = 1e-8;
    o.max_work = 2e7;
    const BodySolution s = BodySolver(o).solve(a.bodies, a.contacts);
    replaced += !s.replaced.empty();
    CHECK((s.status == Status::solved) == (s.failed_islands == 0));
    const double e = evaluate(a.bodies, a.contacts, o.law, s.impulses).fixed_point;
    if (s.status == Status::solved && s.replaced.empty()) CHECK(e <= 2e-8);
    o.strict = true;
    const BodySolution t = BodySolver(o).solve(a.bodies, a.contacts);
    CHECK(t.replaced.empty());
    failed += t.status != Status::solved;
    if (t.status == Status::solved) {
      CHECK(evaluate(a.bodies, a.contacts, o.law, t.impulses).fixed_point <= 2e-8);
    }
  }
  CHECK(replaced > 0);
  CHECK(failed > 0);
}

TEST_CASE("momentum is kept to round-off and energy does not grow") {
  for (bool spheres : {true, false}) {
    // No ground: linear momentum is an invariant.
    random::Packing p = random::packing(6, spheres, 11);
    std::vector<PointContact> between;
    for (const PointContact& c : p.contacts) {
      if (c.second >= 0) between.push_back(c);
    }
    for (Law law : {Law::coulomb, Law::maximum_dissipation, Law::frictionless}) {
      BodyOptions o;
      o.law = law;
      o.tolerance = 1e-8;
      o.max_sweeps = 3000;
      const BodySolution s = BodySolver(o).solve(p.bodies, between);
      Eigen::Vector3d before = Eigen::Vector3d::Zero(), after = before;
      double kinetic[2] = {0, 0}, size = 0;
      for (std::size_t k = 0; k < p.bodies.size(); ++k) {
        const RigidBody& b = p.bodies[k];
        const double m = 1 / b.inverse_mass;
        const Eigen::Matrix3d I = b.inverse_inertia.inverse();
        before += m * b.velocity;
        after += m * s.velocities[k];
        size += m * b.velocity.norm();
        kinetic[0] += 0.5 * m * b.velocity.squaredNorm() +
                      0.5 * b.angular_velocity.dot(I * b.angular_velocity);
        kinetic[1] += 0.5 * m * s.velocities[k].squaredNorm() +
                      0.5 * s.angular_velocities[k].dot(I * s.angular_velocities[k]);
      }
      CHECK((after - before).norm() <= 1e-13 * size);
      CHECK(kinetic[1] < kinetic[0]);
      const Residuals r = evaluate(p.bodies, between, law, s.impulses);
      CHECK(std::abs(r.energy_change - (kinetic[1] - kinetic[0])) <= 1e-11 * kinetic[0]);
      CHECK(r.dissipation <= 1e-7 * kinetic[0]);
      // Spins follow from the moments of the impulses.
      std::vector<Eigen::Vector3d> spin(p.bodies.size(), Eigen::Vector3d::Zero());
      for (std::size_t i = 0; i < between.size(); ++i) {
        spin[static_cast<std::size_t>(between[i].first)] += between[i].r1.cross(s.impulses[i]);
        spin[static_cast<std::size_t>(between[i].second)] -= between[i].r2.cross(s.impulses[i]);
      }
      for (std::size_t k = 0; k < p.bodies.size(); ++k) {
        const Eigen::Vector3d expected =
            p.bodies[k].angular_velocity + p.bodies[k].inverse_inertia * spin[k];
        CHECK((expected - s.angular_velocities[k]).norm() <= 1e-11);
      }
    }
  }
}

TEST_CASE("spheres: the closed form and the general block agree") {
  // A trace of anisotropy makes every contact general.
  random::Packing p = random::packing(5, true, 4);
  random::Packing q = p;
  for (RigidBody& b : q.bodies) b.inverse_inertia(0, 0) *= 1 + 1e-15;
  BodyOptions o;
  o.tolerance = 1e-11;
  o.max_sweeps = 20000;
  o.max_assembled = 0;
  for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
    o.law = law;
    const BodySolution s = BodySolver(o).solve(p.bodies, p.contacts);
    const BodySolution t = BodySolver(o).solve(q.bodies, q.contacts);
    REQUIRE(s.status == Status::solved);
    REQUIRE(t.status == Status::solved);
    CHECK(s.spheres);
    CHECK_FALSE(t.spheres);
    // Impulses need not be unique; each answer solves the other problem.
    CHECK(evaluate(q.bodies, q.contacts, law, s.impulses).fixed_point <= 1e-10);
    CHECK(evaluate(p.bodies, p.contacts, law, t.impulses).fixed_point <= 1e-10);
  }
}

TEST_CASE("frictionless contacts among others are one equation") {
  random::Packing p = random::packing(5, false, 6);
  random::Generator g(2);
  for (PointContact& c : p.contacts) c.mu = g.uniform(0, 1) < 0.5 ? 0 : 0.4;
  BodyOptions o;
  o.tolerance = 1e-9;
  for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
    o.law = law;
    const BodySolution s = BodySolver(o).solve(p.bodies, p.contacts);
    REQUIRE(s.status == Status::solved);
    for (std::size_t k = 0; k < p.contacts.size(); ++k) {
      const PointContact& c = p.contacts[k];
      if (c.mu > 0) continue;
      const double xn = s.impulses[k].dot(c.normal);
      CHECK((s.impulses[k] - xn * c.normal).norm() <= 1e-15 * std::abs(xn));
      CHECK(s.regimes[k] != Regime::sticking);
    }
    CHECK(evaluate(p.bodies, p.contacts, law, s.impulses).fixed_point <= 1.1e-9);
  }
  // mu = 0 everywhere is the frictionless law.
  for (PointContact& c : p.contacts) c.mu = 0;
  const BodySolution s = BodySolver(o).solve(p.bodies, p.contacts);
  o.law = Law::frictionless;
  const BodySolution t = BodySolver(o).solve(p.bodies, p.contacts);
  for (std::size_t k = 0; k < p.contacts.size(); ++k) CHECK(s.impulses[k] == t.impulses[k]);
}

TEST_CASE("fixed bodies: prescribed velocities, either side, not changed") {
  // A ball on a conveyor, which is named first or second or is the world with a bias.
  RigidBody belt, ball;
  belt.velocity << 0.3, 0, 0;
  belt.angular_velocity << 0, 0, 0.7;
  ball.inverse_mass = 2;
  ball.inverse_inertia = Eigen::Vector3d(5, 6, 7).asDiagonal();
  ball.velocity << 0.1, 0.2, -0.5;
  ball.angular_velocity << 1, -2, 0.5;
  PointContact c;
  c.r1 << 0.02, 0.01, -0.5;
  c.r2 << 1, 0, 0;
  c.mu = 0.3;
  const std::vector<RigidBody> bodies = {belt, ball};
  for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
    BodyOptions o;
    o.law = law;
    BodySolver solver(o);
    c.first = 1, c.second = 0;
    const BodySolution s = solver.solve(bodies, {c});
    PointContact d = c;
    d.first = 0, d.second = 1;
    d.r1.swap(d.r2);
    d.normal = -c.normal;
    const BodySolution t = solver.solve(bodies, {d});
    CHECK(s.status == Status::solved);
    CHECK((s.impulses[0] + t.impulses[0]).norm() < 1e-14);
    CHECK((s.velocities[1] - t.velocities[1]).norm() < 1e-14);
    CHECK(s.velocities[0] == belt.velocity);
    CHECK(t.angular_velocities[0] == belt.angular_velocity);
    CHECK(s.impulses[0][2] > 0);
    CHECK(evaluate(bodies, {c}, law, s.impulses).fixed_point < 1e-12);
    CHECK(evaluate(bodies, {d}, law, t.impulses).fixed_point < 1e-12);
  }
  // bias = gap / time step: the ball stops just at the ground.
  RigidBody world_ball = ball;
  world_ball.velocity << 0, 0, -0.5;
  world_ball.angular_velocity.setZero();
  PointContact e;
  e.first = 0;
  e.r1 << 0, 0, -0.5;
  for (double bias : {0.2, 0.5, 0.7}) {
    e.bias = bias;
    const BodySolution s = BodySolver().solve({world_ball}, {e});
    CHECK(s.velocities[0][2] == Approx(std::max(-0.5, -bias)).margin(1e-14));
    CHECK(s.regimes[0] == (bias < 0.5 ? Regime::sliding : Regime::separating));
  }
}

TEST_CASE("no contacts, no bodies") {
  const BodySolution none = BodySolver().solve({}, {});
  CHECK(none.status == Status::solved);
  CHECK(none.islands == 0);
  RigidBody b;
  b.inverse_mass = 1;
  b.velocity << 1, 2, 3;
  const BodySolution s = BodySolver().solve({b}, {});
  CHECK(s.velocities[0] == b.velocity);
}

TEST_CASE("body form refuses bad input") {
  random::Packing p = random::packing(2, true);
  const auto refused = [](const random::Packing& q) {
    CHECK_THROWS_AS(BodySolver().solve(q.bodies, q.contacts), std::invalid_argument);
  };
  random::Packing q = p;
  q.contacts[0].first = 99;
  refused(q);
  q = p;
  q.contacts[0].normal *= 2;
  refused(q);
  q = p;
  q.contacts[0].mu = -1;
  refused(q);
  q = p;
  q.bodies[0].velocity[0] = std::numeric_limits<double>::quiet_NaN();
  refused(q);
  q = p;
  for (RigidBody& b : q.bodies) b.inverse_mass = 0, b.inverse_inertia.setZero();
  refused(q);
  BodyOptions o;
  o.threads = 0;
  CHECK_THROWS_AS(BodySolver(o), std::invalid_argument);
}

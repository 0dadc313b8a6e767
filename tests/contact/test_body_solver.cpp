// Tether: sweeps on body velocities. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <cstring>
#include <limits>
#include <tether/contact.hpp>

#include "packing.hpp"
#include "support/catch.hpp"

using namespace tether::contact;

namespace {

BodySolution run(const random::Packing& p, Law law, int threads, double tolerance = 1e-10) {
  BodyOptions o;
  o.law = law;
  o.tolerance = tolerance;
  o.max_sweeps = 20000;
  o.threads = threads;
  return BodySolver(o).solve(p.bodies, p.contacts);
}

}  // namespace

TEST_CASE("body form and Delassus form judge alike") {
  for (bool spheres : {true, false}) {
    const random::Packing p = random::packing(3, spheres);
    const Problem problem = delassus(to_bodies(p.bodies), to_contacts(p.contacts));
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
      const auto v = velocities_after(to_bodies(p.bodies), to_contacts(p.contacts), x);
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
    for (PointContact& c : p.contacts) {
      c.bias = g.uniform(-0.1, 0.1);
      c.mu = g.uniform(0, 1) < 0.3 ? 0 : g.uniform(0, 1);
    }
    const Problem problem = delassus(to_bodies(p.bodies), to_contacts(p.contacts));
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
      CHECK(near(a.natural_map_data, b.natural_map_data));
      CHECK(near(s.error, b.fixed_point));
    }
  }
}

TEST_CASE("warm start: contacts are found by id, in any order and frame") {
  for (bool spheres : {true, false}) {
    random::Packing p = random::packing(4, spheres);
    for (std::size_t k = 0; k < p.contacts.size(); ++k) p.contacts[k].id = 7 * k + 3;
    BodyOptions o;
    o.tolerance = 1e-9;
    o.max_sweeps = 20000;
    BodySolver solver(o);
    BodySolution s;
    solver.solve(p.bodies, p.contacts, s);
    REQUIRE(s.status == Status::solved);
    CHECK(s.warm_started == 0);
    const int cold = s.sweeps;
    std::reverse(p.contacts.begin(), p.contacts.end());
    o.tolerance = 1e-8;
    solver.set_options(o);
    solver.solve(p.bodies, p.contacts, s);
    CHECK(s.warm_started == static_cast<int>(p.contacts.size()));
    CHECK(s.sweeps == 1);
    // Bodies and normals turned a little; every other contact is new.
    const Eigen::Matrix3d R =
        Eigen::AngleAxisd(1e-3, Eigen::Vector3d(1, 2, 3).normalized()).matrix();
    for (std::size_t k = 0; k < p.contacts.size(); ++k) {
      p.contacts[k].normal = R * p.contacts[k].normal;
      if (k % 2 == 0) p.contacts[k].id += 1000000;
    }
    solver.solve(p.bodies, p.contacts, s);
    REQUIRE(s.status == Status::solved);
    CHECK(s.warm_started == static_cast<int>(p.contacts.size() / 2));
    CHECK(evaluate(p.bodies, p.contacts, o.law, s.impulses).fixed_point <= 1.1e-8);
    solver.forget();
    solver.solve(p.bodies, p.contacts, s);
    CHECK(s.warm_started == 0);
    CHECK(s.sweeps >= cold / 2);
  }
}

TEST_CASE("warm start: scaled for another time step") {
  random::Packing p = random::packing(3, false);
  for (std::size_t k = 0; k < p.contacts.size(); ++k) p.contacts[k].id = k;
  BodyOptions o;
  o.tolerance = 1e-9;
  o.max_sweeps = 20000;
  BodySolver solver(o);
  BodySolution s;
  solver.solve(p.bodies, p.contacts, s);
  // Half the velocities: half the impulses, found at once.
  for (RigidBody& b : p.bodies) {
    b.velocity *= 0.5;
    b.angular_velocity *= 0.5;
  }
  solver.scale_warm_start(0.5);
  o.tolerance = 1e-8;
  solver.set_options(o);
  solver.solve(p.bodies, p.contacts, s);
  CHECK(s.status == Status::solved);
  CHECK(s.sweeps == 1);
  CHECK_THROWS_AS(solver.scale_warm_start(-1), std::invalid_argument);
}

TEST_CASE("threads do not change a bit") {
  for (bool spheres : {true, false}) {
    const random::Packing p = random::packing(9, spheres);
    BodyOptions o;
    o.max_sweeps = 30;
    const BodySolution one = BodySolver(o).solve(p.bodies, p.contacts);
    for (int threads : {2, 3}) {
      o.threads = threads;
      const BodySolution more = BodySolver(o).solve(p.bodies, p.contacts);
      REQUIRE(more.sweeps == one.sweeps);
      CHECK(more.error == one.error);
      for (std::size_t k = 0; k < one.velocities.size(); ++k) {
        REQUIRE(std::memcmp(one.velocities[k].data(), more.velocities[k].data(), 24) == 0);
        REQUIRE(std::memcmp(one.angular_velocities[k].data(), more.angular_velocities[k].data(),
                            24) == 0);
      }
    }
  }
}

TEST_CASE("a body with more contacts than colours") {
  random::Packing p;
  RigidBody floor;
  floor.inverse_mass = 0.01;
  floor.inverse_inertia = 0.01 * Eigen::Matrix3d::Identity();
  p.bodies.push_back(floor);
  for (int k = 0; k < 100; ++k) {
    RigidBody ball;
    ball.inverse_mass = 1;
    ball.inverse_inertia = 10 * Eigen::Matrix3d::Identity();
    ball.velocity << 0, 0, -0.1;
    p.bodies.push_back(ball);
    PointContact c;
    c.first = k + 1;
    c.second = 0;
    c.mu = 0.5;
    c.r1 << 0, 0, -0.5;
    c.r2 << 0.01 * k, 0.02 * (k % 7), 0.5;
    p.contacts.push_back(c);
  }
  const BodySolution s = run(p, Law::maximum_dissipation, 2);
  CHECK(s.status == Status::solved);
  CHECK(s.failed_islands == 0);
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

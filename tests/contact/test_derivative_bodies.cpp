// Tether: derivatives of impacts of bodies with masses, velocities and friction.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <tether/contact.hpp>

#include "assemblies.hpp"
#include "contact_differences.hpp"
#include "support/catch.hpp"

using namespace tether::contact;
using differences::kLaws;
using differences::tight;
using Eigen::VectorXd;

TEST_CASE("derivative: masses, velocities and friction of bodies, against differences") {
  random::Generator g(5);
  int seen = 0;
  for (Law law : kLaws)
    for (int k = 0; k < 6; ++k) {
      const random::Assembly whole = random::cluster(g, 0.3, 5, 4);
      const std::size_t n = whole.contacts.size(), count = whole.bodies.size();
      BodyDirection v;
      for (const RigidBody& body : whole.bodies) {
        RigidBody& to = v.bodies.emplace_back();
        to.inverse_mass = 0.3 * body.inverse_mass;
        to.inverse_inertia = 0.2 * body.inverse_inertia;
        to.inverse_inertia(0, 1) = to.inverse_inertia(1, 0) += 0.05 * body.inverse_inertia.norm();
        to.velocity = 0.3 * g.vector();
        to.angular_velocity = 0.3 * g.vector();
        if (!body.moves()) to.inverse_inertia.setZero();
      }
      for (std::size_t i = 0; i < n; ++i) v.bias.push_back(0.1 * g.vector());
      v.mu = VectorXd::LinSpaced(static_cast<Eigen::Index>(n), 0.1, 0.3);
      const auto moved = [&](double h) {
        random::Assembly out = whole;
        for (std::size_t b = 0; b < count; ++b) {
          out.bodies[b].inverse_mass += h * v.bodies[b].inverse_mass;
          out.bodies[b].inverse_inertia += h * v.bodies[b].inverse_inertia;
          out.bodies[b].velocity += h * v.bodies[b].velocity;
          out.bodies[b].angular_velocity += h * v.bodies[b].angular_velocity;
        }
        for (std::size_t i = 0; i < n; ++i) {
          out.contacts[i].bias += h * v.bias[i];
          out.contacts[i].mu += h * v.mu[static_cast<Eigen::Index>(i)];
        }
        return out;
      };
      const auto at = [&](const random::Assembly& a) { return tight(a.problem(), law).impulses; };
      const VectorXd x = at(whole);
      const BodyDerivative d = derivative(whole.bodies, whole.contacts, law, x);
      if (!d.report().strictly_regular || d.report().status != DerivativeStatus::unique) continue;
      const ImpactDirection f = d.forward(v);
      const double h = 1e-5;
      const random::Assembly up = moved(h), down = moved(-h);
      const VectorXd x1 = at(up), x0 = at(down);
      if (derivative(up.bodies, up.contacts, law, x1).report().regimes != d.report().regimes ||
          derivative(down.bodies, down.contacts, law, x0).report().regimes != d.report().regimes)
        continue;
      ++seen;
      INFO(name(law) << ", cluster " << k);
      CHECK(((x1 - x0) / (2 * h) - f.impulses).norm() < 1e-6 * (1 + f.impulses.norm()));
      const auto v1 = velocities_after(up.bodies, up.contacts, x1);
      const auto v0 = velocities_after(down.bodies, down.contacts, x0);
      std::vector<Vector6d> rows;
      const VectorXd row = VectorXd::LinSpaced(x.size(), -1, 2);
      double left = row.dot(f.impulses), right = 0,
             size = row.cwiseAbs().dot(f.impulses.cwiseAbs());
      for (std::size_t b = 0; b < count; ++b) {
        CHECK(((v1[b] - v0[b]) / (2 * h) - f.velocities[b]).norm() <
              1e-6 * (1 + f.velocities[b].norm()));
        rows.emplace_back(Vector6d::LinSpaced(6, -1, 1));
        left += rows[b].dot(f.velocities[b]);
        size += rows[b].cwiseAbs().dot(f.velocities[b].cwiseAbs());
      }
      const BodyDirection gradient = d.adjoint(row, rows);
      for (std::size_t b = 0; b < count; ++b) {
        const RigidBody &p = gradient.bodies[b], &q = v.bodies[b];
        right += p.velocities().dot(q.velocities());
        if (!whole.bodies[b].moves()) continue;
        right += p.inverse_mass * q.inverse_mass +
                 p.inverse_inertia.cwiseProduct(q.inverse_inertia).sum();
      }
      for (std::size_t i = 0; i < n; ++i) right += gradient.bias[i].dot(v.bias[i]);
      right += gradient.mu.dot(v.mu);
      CHECK(std::abs(left - right) < 1e-12 * (1 + size));
    }
  CHECK(seen >= 9);
}

TEST_CASE("derivative: at the answer of BodySolver, spheres on the ground in closed form") {
  // A ball that falls on the ground and begins to roll: 5/7 of its speed, whatever mu.
  std::vector<RigidBody> bodies(1);
  bodies[0].inverse_mass = 0.5;
  bodies[0].inverse_inertia = Eigen::Matrix3d::Identity() / (0.4 * 2 * 0.04);
  bodies[0].velocity = {3, 0, -4};
  std::vector<PointContact> contacts(1);
  contacts[0].first = 0;
  contacts[0].r1 = {0, 0, -0.2};
  contacts[0].mu = 0.9;
  BodyOptions o;
  o.law = Law::coulomb;
  o.tolerance = 1e-12;
  const BodySolution s = BodySolver(o).solve(bodies, contacts);
  BodyDerivative d = derivative(bodies, contacts, Law::coulomb, s);
  CHECK(d.report().regimes[0] == Regime::sticking);
  BodyDirection v;
  v.bodies.resize(1);
  v.bodies[0].velocity = {1, 0, 0};
  CHECK(d.forward(v).velocities[0][0] == Approx(5.0 / 7));
  v.bodies[0].velocity = {0, 0, -1};
  CHECK(std::abs(d.forward(v).velocities[0][0]) < 1e-14);
  // Heavier by dm = 1: d(1/m) = -1/4, inertia alike. Velocities do not change, impulses by x/m.
  v.bodies[0].velocity.setZero();
  v.bodies[0].inverse_mass = -0.25;
  v.bodies[0].inverse_inertia = -0.5 * bodies[0].inverse_inertia;
  CHECK(d.forward(v).velocities[0].norm() < 1e-13);
  CHECK((d.forward(v).impulses - d.impulses() / 2).norm() < 1e-12);
  // Sliding: v_x = 3 - 4 mu, so dv_x/dmu = -4.
  contacts[0].mu = 0.1;
  d = derivative(bodies, contacts, Law::coulomb, BodySolver(o).solve(bodies, contacts));
  CHECK(d.report().regimes[0] == Regime::sliding);
  v = {};
  v.mu = VectorXd::Ones(1);
  CHECK(d.forward(v).velocities[0][0] == Approx(-4));
  CHECK(d.adjoint(VectorXd(), {Vector6d::Unit(0)}).mu[0] == Approx(-4));
  CHECK(d.adjoint(VectorXd(), {Vector6d::Unit(0)}).bodies[0].velocity[2] == Approx(0.1));
}

// Tether: derivatives of many contacts, by sparse factors and of deficient rank.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <tether/contact.hpp>

#include "assemblies.hpp"
#include "contact_differences.hpp"
#include "packing.hpp"
#include "support/catch.hpp"

using namespace tether::contact;
using differences::tight;
using Eigen::Vector3d;
using Eigen::VectorXd;

TEST_CASE("derivative: sparse factors: the transpose, and a solution that moves as it says") {
  for (double mu : {0.1, 0.8}) {
    const random::Packing packing = random::packing(5, false, 3);
    auto contacts = to_contacts(packing.contacts);
    for (ContactRows& c : contacts) c.mu = mu;
    const Problem p = delassus(packing.bodies, contacts);
    REQUIRE(p.contacts() > 300);
    const Solution s = tight(p, Law::coulomb);
    REQUIRE(s.error < 1e-11);
    const Derivative d = derivative(p, Law::coulomb, s);
    INFO("mu " << mu << ": " << d.report().advice);
    ProblemDirection v;
    v.b = 1e-6 * p.b();
    v.b.head(30) *= -1;
    v.mu = VectorXd::Constant(p.contacts(), 1e-6);
    const SolutionDirection f = d.forward(v);
    const VectorXd row = VectorXd::LinSpaced(p.b().size(), -1, 2);
    const ProblemDirection gradient = d.adjoint(row, row);
    CHECK(std::abs(row.dot(f.impulses) + row.dot(f.velocities) -
                   differences::product(gradient, v)) < 1e-12 * differences::sizes(gradient, v));
    CHECK(f.residual < 1e-12);
    VectorXd changed(p.contacts());
    for (int i = 0; i < p.contacts(); ++i) changed[i] = mu + 1e-6;
    const Problem q = Problem::dense(p.dense_matrix(), p.b() + v.b, changed);
    const VectorXd dx = tight(q, Law::coulomb).impulses - s.impulses;
    CHECK((dx - f.impulses).norm() < 1e-4 * dx.norm());  // second order: 1e-6 of the condition
  }
}

TEST_CASE("derivative: stacks of deficient rank: velocities, and the least change") {
  for (int boxes : {20, 40}) {
    const random::RigidAssembly stack = random::rigid_stack(boxes, 1, 0.9);
    const Problem p = delassus(stack.bodies, to_contacts(stack.contacts));
    REQUIRE(p.contacts() == 4 * boxes);
    const Solution s = tight(p, Law::coulomb);
    REQUIRE(s.error < 1e-10);
    const Derivative d = derivative(p, Law::coulomb, s);
    INFO(d.report().advice << " rank " << d.report().rank);
    CHECK(d.report().status == DerivativeStatus::minimum_norm);
    CHECK(d.report().unknowns == 12 * boxes);
    CHECK(d.report().rank == 6 * boxes);
    CHECK(d.report().velocities_unique);
    ProblemDirection v;
    v.b = p.b();  // twice the approach: twice the impulses, of which only sums are determined
    const SolutionDirection f = d.forward(v);
    CHECK(f.residual < 1e-9);
    CHECK(f.velocities.norm() < 1e-8 * p.b().norm());
    CHECK(f.impulses.norm() <= s.impulses.norm() * (1 + 1e-6));
    double of_x = 0, of_f = 0;
    for (int leg = 0; leg < 4; ++leg) {
      of_x += s.impulses[3 * leg];
      of_f += f.impulses[3 * leg];
    }
    CHECK(of_f == Approx(of_x).epsilon(1e-6));
    const VectorXd row = VectorXd::LinSpaced(p.b().size(), -1, 2);
    const ProblemDirection gradient = d.adjoint(row);
    CHECK(std::abs(row.dot(f.impulses) - differences::product(gradient, v)) <
          1e-9 * differences::sizes(gradient, v));
  }
}

TEST_CASE("derivative: a row of boxes pressed together, of deficient rank, by sparse factors") {
  constexpr int kBoxes = 120;
  random::RigidAssembly row_of;
  for (int k = 0; k < kBoxes; ++k) {
    row_of.bodies.push_back(random::box(1, {0.5, 0.5, 0.5}));
    row_of.bodies.back().velocity = {0.1 * (1 - 2.0 * k / kBoxes), 0.02, -1};
    PointContact c;
    c.first = k;
    c.mu = 0.7;
    for (double x : {-0.5, 0.5})
      for (double y : {-0.5, 0.5}) {
        c.r1 = {x, y, -0.5};
        row_of.contacts.push_back(c);
      }
    if (k == 0) continue;
    c.second = k - 1;
    c.normal = Vector3d::UnitX();
    c.r1 = {-0.5, 0, 0.1};
    c.r2 = {0.5, 0, 0.1};
    row_of.contacts.push_back(c);
  }
  const Problem p = delassus(row_of.bodies, to_contacts(row_of.contacts));
  REQUIRE(p.contacts() > 500);
  const Solution s = tight(p, Law::coulomb);
  REQUIRE(s.error < 1e-10);
  const Derivative d = derivative(p, Law::coulomb, s);
  INFO(d.report().advice << " rank " << d.report().rank << " of " << d.report().unknowns);
  REQUIRE(d.report().status == DerivativeStatus::minimum_norm);
  CHECK(d.report().velocities_unique);
  ProblemDirection v;
  v.b = p.b();
  const SolutionDirection f = d.forward(v);
  CHECK(f.residual < 1e-9);
  CHECK(f.velocities.norm() < 1e-8 * p.b().norm());
  CHECK(f.impulses.norm() <= s.impulses.norm() * (1 + 1e-6));
  const VectorXd row = VectorXd::LinSpaced(p.b().size(), -1, 2);
  const ProblemDirection gradient = d.adjoint(row);
  CHECK(std::abs(row.dot(f.impulses) - differences::product(gradient, v)) <
        1e-9 * differences::sizes(gradient, v));
}

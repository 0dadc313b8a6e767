// Tether: bodies behind problems that are given by their matrix. SPDX-License-Identifier:
// BSD-3-Clause
#include "problem/body_form.hpp"

#include <cmath>
#include <functional>
#include <tether/contact.hpp>
#include <vector>

#include "assemblies.hpp"
#include "brick_wall.hpp"
#include "support/catch.hpp"

namespace {

using namespace tether::contact;
using Eigen::Vector3d;
using random::Generator;

using Assembly = random::RigidAssembly;

RigidBody moving(Generator& g, double mass, const Vector3d& half) {
  RigidBody b = random::box(mass, half);
  b.velocity = 0.1 * g.vector() - 0.05 * Vector3d::UnitZ();
  b.angular_velocity = 0.1 * g.vector();
  return b;
}

Assembly wall(Generator& g, int rows) {
  const random::Packing packing = random::BrickWall(rows, rows, 0.6).packing();
  Assembly out{packing.bodies, packing.contacts};
  for (RigidBody& b : out.bodies) {
    b.velocity = 0.1 * g.vector() - 0.02 * Vector3d::UnitZ();
    b.angular_velocity = g.vector();
  }
  return out;
}

// Three planks a layer across the three below, four contacts a crossing.
Assembly planks(Generator& g, int layers) {
  const double width = 0.2, height = 0.08, between = 0.4;
  Assembly out;
  const auto centre = [&](int layer, int k) {
    return layer % 2 ? Vector3d(between * k, 0, height * (layer + 0.5))
                     : Vector3d(0, between * k, height * (layer + 0.5));
  };
  for (int layer = 0; layer < layers; ++layer)
    for (int k = -1; k <= 1; ++k) {
      const int i = static_cast<int>(out.bodies.size());
      const Vector3d half = layer % 2 ? Vector3d(0.1, 0.6, 0.04) : Vector3d(0.6, 0.1, 0.04);
      out.bodies.push_back(moving(g, 1, half));
      for (int m = -1; m <= 1; ++m) {
        Vector3d p = (layer % 2 ? Vector3d(k, m, 0) : Vector3d(m, k, 0)) * between;
        p.z() = height * layer;
        for (double x : {-0.5, 0.5})
          for (double y : {-0.5, 0.5}) {
            const Vector3d q = p + Vector3d(x, y, 0) * width;
            const int below = layer == 0 ? -1 : 3 * (layer - 1) + m + 1;
            out.touch(i, below, q - centre(layer, k),
                      below < 0 ? q : Vector3d(q - centre(layer - 1, m)), {0, 0, 1}, 0.5);
          }
      }
    }
  return out;
}

// Bodies in a circle, each in contact with the next one at four points, none with the ground.
Assembly ring(Generator& g, int bodies) {
  Assembly out;
  for (int k = 0; k < bodies; ++k) {
    out.bodies.push_back(moving(g, std::exp(g.uniform(-1, 1)), {0.3, 0.4, 0.5}));
    for (int point = 0; point < 4; ++point)
      out.touch(k, (k + 1) % bodies, g.vector(), g.vector(), g.vector() + Vector3d(0, 0, 2), 0.5);
  }
  return out;
}

// Few bodies, each contact ten times at points that differ by `apart`.
Assembly duplicates(Generator& g, double apart) {
  Assembly out;
  for (int k = 0; k < 4; ++k) out.bodies.push_back(moving(g, 1, {0.3, 0.4, 0.5}));
  for (int k = 0; k < 12; ++k) {
    const int first = k % 4, second = k % 3 == 0 ? -1 : (k + 1) % 4;
    const Vector3d r1 = g.vector(), r2 = g.vector();
    Vector3d normal = g.vector();
    normal.z() = std::abs(normal.z()) + 0.5;
    for (int copy = 0; copy < 10; ++copy) {
      const Vector3d off = apart * g.vector();
      out.touch(first, second, r1 + off, r2 + off, normal, 0.4);
    }
  }
  return out;
}

Problem by_matrix(Problem problem) {
  problem.set_body_form(nullptr);
  return problem;
}

// The largest entry of A - H H' over that of A.
double missing(const Problem& problem, const detail::BodyForm& form) {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3 * problem.contacts(), 3 * form.nodes);
  for (int i = 0; i < problem.contacts(); ++i)
    for (int k = form.start[static_cast<std::size_t>(i)];
         k < form.start[static_cast<std::size_t>(i) + 1]; ++k) {
      const auto& block = form.H[static_cast<std::size_t>(k)];
      for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r)
          H(3 * i + r, 3 * form.node[static_cast<std::size_t>(k)] + c) = block.column[4 * c + r];
    }
  const Eigen::MatrixXd A = problem.dense_matrix();
  return (A - H * H.transpose()).cwiseAbs().maxCoeff() / A.cwiseAbs().maxCoeff();
}

}  // namespace

TEST_CASE("bodies of a matrix: as many columns as the bodies of a tower have velocities") {
  Generator g(1);
  const Problem problem = by_matrix(random::stack(12, 1e3).problem());
  REQUIRE(detail::may_have_bodies(problem));
  const auto form = detail::bodies_of_matrix(problem);
  REQUIRE(form);
  CHECK(form->nodes == 24);
  CHECK(missing(problem, *form) < 1e-13);
}

TEST_CASE("bodies of a matrix: walls and planks, without fill") {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Generator g(seed);
    for (const Assembly& assembly : {wall(g, 6), planks(g, 12)}) {
      const Problem problem = by_matrix(assembly.problem());
      const auto form = detail::bodies_of_matrix(problem);
      REQUIRE(form);
      CHECK(form->nodes <= 2.1 * static_cast<double>(assembly.bodies.size()));
      CHECK(missing(problem, *form) < 1e-10);
      // A contact reads the columns of its two bodies, and seldom of others.
      CHECK(static_cast<int>(form->node.size()) <= 4.4 * problem.contacts());
    }
  }
}

TEST_CASE("bodies of a matrix: a ring without ground fills in and is found") {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Generator g(seed);
    const Problem problem = by_matrix(ring(g, 7).problem());
    const auto form = detail::bodies_of_matrix(problem);
    REQUIRE(form);
    CHECK(form->nodes <= 14);
    CHECK(missing(problem, *form) < 1e-12);
  }
}

TEST_CASE("bodies of a matrix: contacts at nearly one point") {
  Generator g(1);
  for (double apart : {1e-2, 1e-3, 1e-5, 1e-7, 0.0}) {
    const Problem problem = by_matrix(duplicates(g, apart).problem());
    const auto form = detail::bodies_of_matrix(problem);
    INFO(apart);
    REQUIRE(form);
    CHECK(form->nodes <= 11);
    CHECK(missing(problem, *form) < 1e-3);
  }
}

TEST_CASE("bodies of a matrix: none where pairs touch once, and none in the plane") {
  const random::Packing packing = random::packing(3, true, 1);
  CHECK_FALSE(detail::may_have_bodies(delassus(packing.bodies, to_contacts(packing.contacts))));
  Generator g(1);
  const Eigen::MatrixXd A = random::stack(5, 1).problem().dense_matrix();
  Eigen::MatrixXd plane(40, 40);
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 20; ++j) plane.block<2, 2>(2 * i, 2 * j) = A.block<2, 2>(3 * i, 3 * j);
  CHECK_FALSE(detail::may_have_bodies(
      Problem::dense(plane, Eigen::VectorXd::Ones(40), Eigen::VectorXd::Ones(20))));
}

// Blocks off the diagonal that no bodies have: A is indefinite.
TEST_CASE("bodies of a matrix: an indefinite matrix has none") {
  Generator g(1);
  const Problem given = random::stack(6, 1).problem();
  Eigen::MatrixXd A = given.dense_matrix();
  A.block<3, 3>(0, 15) *= 3;
  A.block<3, 3>(15, 0) *= 3;
  Eigen::VectorXd mu(given.contacts());
  for (int i = 0; i < given.contacts(); ++i) mu[i] = given.mu(i);
  CHECK(detail::bodies_of_matrix(Problem::dense(A, given.b(), mu)) == nullptr);
}

// The elimination by contacts took 3 to 60 times as much.
TEST_CASE("bodies of a matrix: (A, b, mu) costs little more than bodies") {
  const std::function<Assembly(Generator&)> families[] = {
      [](Generator& g) { return planks(g, 25); },
      [](Generator& g) { return wall(g, 7); },
      [](Generator& g) { return duplicates(g, 1e-5); },
  };
  for (const auto& family : families) {
    double by_bodies = 0, by_A = 0;
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      Generator g(seed);
      const Problem given = family(g).problem(), matrix = by_matrix(given);
      for (double tolerance : {1e-3, 1e-6, 1e-9}) {
        Options options;
        options.law = Law::coulomb;
        options.tolerance = tolerance;
        const Solution s = Solver(options).solve(given), t = Solver(options).solve(matrix);
        INFO(seed << " at " << tolerance << ": " << name(t.status) << " " << t.error);
        CHECK(t.status == Status::solved);
        CHECK(evaluate(matrix, options.law, t.impulses).fixed_point <= 1.0001 * tolerance);
        by_bodies += s.counts.work;
        by_A += t.counts.work;
      }
    }
    INFO("work " << by_bodies << " by bodies, " << by_A << " by A");
    CHECK(by_A < 1.5 * by_bodies);
  }
}

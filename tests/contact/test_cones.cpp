// Problems over products of cones: closed forms, elimination, other units and orders.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <tether/contact.hpp>

#include "cone_problems.hpp"
#include "support/catch.hpp"

using namespace tether::contact;
using namespace tether::contact::cone_problems;
using Catch::Contains;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// One of each, and free rows between them.
std::vector<Cone> one_of_each() {
  return {Cone::friction(0.6),
          Cone::free(2),
          Cone::bounded(0.3),
          Cone::nonnegative(),
          Cone::planar(0.4),
          Cone::with_rolling(0.5, 0.2),
          Cone::free(1),
          Cone::with_torsional(0.7, 0.3),
          Cone::with_rolling(0.4, 0.1, 0.2)};
}

// A ball of 2 kg, r = 0.1, on a floor: rows n, t, t and the moments about n and across it.
struct Ball {
  double mass = 2, r = 0.1, inertia = 0.4 * 2 * 0.1 * 0.1;
  MatrixXd A() const {
    MatrixXd J = MatrixXd::Identity(6, 6);
    J(1, 5) = r;  // turning about the second tangent moves the point along the first
    J(2, 4) = -r;
    VectorXd inverse(6);
    inverse << 1 / mass, 1 / mass, 1 / mass, 1 / inertia, 1 / inertia, 1 / inertia;
    return J * inverse.asDiagonal() * J.transpose();
  }
};

}  // namespace

TEST_CASE("cones: blocks alone have the impulses of their closed forms") {
  const auto one = [](double a, double b, const Cone& cone) {
    return solve(ConeProblem::dense(MatrixXd::Constant(1, 1, a), VectorXd::Constant(1, b), {cone}));
  };
  CHECK(one(2, 3, Cone::free()).impulses[0] == Approx(1.5).epsilon(1e-14));
  CHECK(one(2, -3, Cone::free()).impulses[0] == Approx(-1.5).epsilon(1e-14));
  CHECK(one(2, 3, Cone::nonnegative()).impulses[0] == Approx(1.5).epsilon(1e-14));
  CHECK(one(2, -3, Cone::nonnegative()).impulses[0] == 0);
  CHECK(one(2, 3, Cone::bounded(1)).impulses[0] == Approx(1).epsilon(1e-14));
  CHECK(one(2, -3, Cone::bounded(1)).impulses[0] == Approx(-1).epsilon(1e-14));
  CHECK(one(2, 1, Cone::bounded(1)).impulses[0] == Approx(0.5).epsilon(1e-14));
  CHECK(one(2, 1, Cone::bounded(1e9)).impulses[0] == Approx(0.5).epsilon(1e-14));
  CHECK(one(2, 1, Cone::bounded(0)).impulses[0] == 0);

  const Ball ball;
  // It comes with 1 m/s and slides with 0.5 m/s: friction of 0.1 leaves slip, of 0.9 makes it roll.
  VectorXd b = VectorXd::Zero(6);
  b[0] = 1;
  b[1] = -0.5;
  for (double mu : {0.1, 0.9}) {
    const ConeSolution s =
        solve(ConeProblem::dense(ball.A().topLeftCorner(3, 3), b.head(3), {Cone::friction(mu)}));
    CHECK(s.status == Status::solved);
    CHECK(s.impulses[0] == Approx(ball.mass).epsilon(1e-12));
    CHECK(s.impulses[1] ==
          Approx(-std::min(mu * ball.mass, 0.5 * ball.mass * 2 / 7)).epsilon(1e-12));
  }
  // Rolling with v, turning about the normal with omega: moments of c x_n and d x_n. With full
  // grip the moment c x_n changes v by -c x_n r / (7/5 m r^2).
  const double c = 0.003, d = 0.002, omega = 7;
  b << 1, 0, 0, -omega, 0, -5;  // b = -(velocity): rolls towards the first tangent
  const ConeSolution s = solve(ConeProblem::dense(ball.A(), b, {Cone::with_rolling(1, c, d)}));
  CHECK(s.status == Status::solved);
  CHECK(s.impulses[0] == Approx(ball.mass).epsilon(1e-12));
  CHECK(s.impulses[3] == Approx(-d * ball.mass).epsilon(1e-12));
  CHECK(s.impulses.tail(2).norm() == Approx(c * ball.mass).epsilon(1e-12));
  const double spin = 5 - c * ball.mass / (1.4 * ball.mass * ball.r * ball.r);
  CHECK(s.velocities[5] == Approx(spin).epsilon(1e-12));
  CHECK(s.velocities.segment(1, 2).norm() < 1e-10);
}

TEST_CASE("cones: a problem with one block of each obeys the law that is written there") {
  for (unsigned seed = 0; seed < 60; ++seed) {
    CAPTURE(seed);
    const double share = seed % 3 == 0 ? 0.5 : 1.2;  // singular A, too
    const ConeProblem p = any_data(one_of_each(), seed, 0, share).problem();
    const ConeSolution s = solve(p, 1e-11);
    REQUIRE(s.status == Status::solved);
    CHECK(s.error <= 1e-11);
    CHECK(s.error == evaluate(p, Law::coulomb, s.impulses).error);
    CHECK((s.velocities - (p.dense_matrix() * s.impulses - p.b())).norm() <
          1e-11 * (1 + s.impulses.norm()) * p.dense_matrix().norm());
    CHECK(broken_law(p, s.impulses, s.velocities) < 2e-7);
  }
}

TEST_CASE("cones: another order of the blocks has the same impulses") {
  for (unsigned seed = 0; seed < 10; ++seed) {
    CAPTURE(seed);
    const Data d = any_data(one_of_each(), seed, 3);
    const ConeProblem p = d.problem();
    const ConeSolution s = solve(p, 1e-12);
    std::vector<int> order(d.cones.size());
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), std::mt19937(seed));
    std::vector<Cone> cones;
    std::vector<int> row;
    for (int k : order) {
      cones.push_back(d.cones[static_cast<std::size_t>(k)]);
      for (int r = 0; r < cones.back().rows; ++r) row.push_back(p.first_row(k) + r);
    }
    std::vector<MatrixEntry> entries;  // backwards, and in two halves
    VectorXd b(d.b.size());
    for (int i = static_cast<int>(row.size()) - 1; i >= 0; --i) {
      b[i] = d.b[row[static_cast<std::size_t>(i)]];
      for (int j = 0; j < static_cast<int>(row.size()); ++j)
        for (int half = 0; half < 2; ++half)
          entries.push_back(
              {i, j,
               0.5 * d.A(row[static_cast<std::size_t>(i)], row[static_cast<std::size_t>(j)])});
    }
    const ConeSolution t = solve(ConeProblem::sparse(entries, b, cones), 1e-12);
    REQUIRE(s.status == Status::solved);
    REQUIRE(t.status == Status::solved);
    for (int i = 0; i < static_cast<int>(row.size()); ++i)
      CHECK(t.impulses[i] ==
            Approx(s.impulses[row[static_cast<std::size_t>(i)]]).margin(1e-9 * s.impulses.norm()));
  }
}

TEST_CASE("cones: units change nothing, those of single rows neither") {
  for (unsigned seed = 0; seed < 10; ++seed) {
    CAPTURE(seed);
    const Data d = any_data(one_of_each(), seed, 1);
    // Velocities of row r in units of u[r]: one for normals and tangents of a block, one for
    // moments, one for any other row. Then all masses, and all velocities.
    std::mt19937 g(seed);
    std::uniform_real_distribution<double> power(-6, 6);
    VectorXd u(d.b.size());
    Data e = d;
    int row = 0;
    for (Cone& c : e.cones) {
      const double normal = std::pow(10, power(g)), spin = std::pow(10, power(g)),
                   roll = std::pow(10, power(g));
      for (int r = 0; r < c.rows; ++r) {
        double& own = u[row++];
        own = normal;
        if (c.kind == Cone::Kind::free) own = std::pow(10, power(g));
        if (r >= 3) own = c.rows != 5 && r == 3 ? spin : roll;
      }
      c.rolling *= normal / roll;
      c.torsional *= normal / spin;
      c.bound /= normal;
    }
    const double mass = std::pow(10, power(g)), speed = std::pow(10, power(g));
    e.A = mass * u.asDiagonal() * d.A * u.asDiagonal();
    e.b = speed * u.cwiseProduct(d.b);
    for (Cone& c : e.cones) c.bound *= speed / mass;
    const ConeSolution s = solve(d.problem()), t = solve(e.problem());
    REQUIRE(s.status == Status::solved);
    CHECK(t.status == Status::solved);
    const VectorXd same = mass / speed * u.cwiseProduct(t.impulses);
    CHECK((same - s.impulses).norm() < 1e-8 * s.impulses.norm());
    // The same error of the same impulses.
    const VectorXd wrong = s.impulses * 1.01,
                   there = (speed / mass * wrong.array() / u.array()).matrix();
    const ConeResiduals a = evaluate(d.problem(), Law::coulomb, wrong),
                        b = evaluate(e.problem(), Law::coulomb, there);
    CHECK(b.error == Approx(a.error).epsilon(1e-9));
    for (std::size_t k = 0; k < a.blocks.size(); ++k)
      CHECK(b.blocks[k] == Approx(a.blocks[k]).epsilon(1e-8).margin(1e-12));
  }
}

TEST_CASE("cones: an impulse outside of its cone is seen in its block") {
  const ConeProblem p = any_data(one_of_each(), 5, 3).problem();
  const ConeSolution s = solve(p, 1e-12);
  REQUIRE(s.status == Status::solved);
  for (int k = 0; k < static_cast<int>(p.cones().size()); ++k) {
    const Cone& c = p.cones()[static_cast<std::size_t>(k)];
    CAPTURE(name(c.kind));
    for (int r = 0; r < c.rows; ++r) {
      VectorXd x = s.impulses;
      const int row = p.first_row(k) + r;
      const double scale = p.row_scale()[static_cast<std::size_t>(row)];
      x[row] -= 100 * scale;  // far out of any bound; of normals, below 0
      const ConeResiduals residuals = evaluate(p, Law::coulomb, x);
      CHECK(residuals.blocks[static_cast<std::size_t>(k)] > 1);
    }
  }
  VectorXd x = s.impulses;
  x[2] = std::nan("");
  CHECK(std::isnan(evaluate(p, Law::coulomb, x).error));
}

TEST_CASE("cones: spheres with rolling friction have the impulses that sweeps of six rows found") {
  // A column of three balls on a floor, pushed and turned; by contact: sweeps to 1e-13, whose
  // solver is no longer here.
  const double wanted[3][6] = {{3.9, -0.2998225829856, 0.254410203982, 0.0003890865086204,
                                -0.001849227526442, -0.03895613376036},
                               {2.9, -0.06287836448853, 0.0665028463858, 0.003970931396409,
                                0.02876463326298, -0.003687258228827},
                               {1.6, 0.004670137329252, -0.2133386913311, 1.841705401362e-05,
                                0.01598180787481, 0.0007627693312702}};
  std::mt19937 g(2);
  std::uniform_real_distribution<double> u(-1, 1);
  const double r = 0.1;
  const Eigen::Matrix3d frame = tangent_frame(Vector3d::UnitZ());
  std::vector<MatrixEntry> M, J;
  VectorXd f(18), bias = VectorXd::Zero(18);
  std::vector<Cone> cones;
  for (int k = 0; k < 3; ++k) {
    RigidBody ball;
    ball.inverse_mass = 1 / (1 + 0.3 * k);
    ball.inverse_inertia = Eigen::Matrix3d::Identity() * 2.5 * ball.inverse_mass / (r * r);
    ball.velocity = 0.3 * Vector3d(u(g), u(g), 0) - Vector3d(0, 0, 1);
    ball.angular_velocity = Vector3d(u(g), u(g), u(g));
    const Matrix6d inverse = ball.inverse_mass_matrix();
    for (int i = 0; i < 6; ++i) M.push_back({6 * k + i, 6 * k + i, 1 / inverse(i, i)});
    f.segment(6 * k, 6) = inverse.inverse() * ball.velocities();
    cones.push_back(Cone::with_rolling(0.4, 0.01, 0.02));
    const ContactRows rows = ContactRows::at_point(k, k - 1, -r * Vector3d::UnitZ(),
                                                   k == 0 ? Vector3d::Zero() : Vector3d(0, 0, r),
                                                   Vector3d::UnitZ(), 0.4);
    for (int side = 0; side < (k == 0 ? 1 : 2); ++side)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 6; ++j) {
          J.push_back({6 * k + i, 6 * (k - side) + j, (side == 0 ? rows.J1 : rows.J2)(i, j)});
          if (j >= 3)
            J.push_back(
                {6 * k + 3 + i, 6 * (k - side) + j, (side == 0 ? 1 : -1) * frame(i, j - 3)});
        }
  }
  const ConeProblem p = ConeProblem::saddle(M, J, f, bias, cones);
  const ConeSolution s = solve(p, 1e-12);
  REQUIRE(s.status == Status::solved);
  CHECK(broken_law(p, s.impulses, s.velocities) < 1e-9);
  for (int k = 0; k < 3; ++k)
    CHECK((s.impulses.segment<6>(6 * k) - Eigen::Map<const Vector6d>(wanted[k])).norm() < 1e-9);
  // Started where it ends, it has nothing to do.
  Options o;
  o.law = Law::coulomb;
  o.tolerance = 1e-9;
  const ConeSolution again = ConeSolver(o).solve(p, s.impulses);
  CHECK(again.status == Status::solved);
  CHECK(again.counts.sweeps <= 2);
  CHECK(again.counts.factorisations == 0);
}

TEST_CASE("cones: other laws solve contacts, and refuse what they say nothing of by name") {
  const std::vector<Cone> contacts = {Cone::friction(0.5), Cone::planar(0.3), Cone::nonnegative()};
  for (Law law : {Law::maximum_dissipation, Law::frictionless}) {
    const ConeProblem p = any_data(contacts, 8, 1).problem();
    const ConeSolution s = solve(p, kTolerance, law);
    CHECK(s.status == Status::solved);
    CHECK(evaluate(p, law, s.impulses).error <= kTolerance);
    const ConeProblem rolls = any_data({Cone::with_rolling(0.5, 0.1)}, 8, 1).problem();
    CHECK_THROWS_WITH(solve(rolls, kTolerance, law), Contains("rolling needs coulomb"));
    const ConeProblem bounded = any_data({Cone::bounded(1)}, 8, 1).problem();
    CHECK_THROWS_WITH(evaluate(bounded, law, VectorXd::Zero(1)), Contains("bounded needs coulomb"));
  }
  const ConeProblem held = any_data({Cone::friction(0.5), Cone::free(2)}, 8, 1).problem();
  CHECK(solve(held, kTolerance, Law::frictionless).status == Status::solved);
  CHECK_THROWS_WITH(solve(held, kTolerance, Law::maximum_dissipation),
                    Contains("free needs coulomb"));
}

TEST_CASE("cones: a floor that closes on a ceiling has a direction that proves it") {
  // One mass between two planes that come closer; a free row holds another mass.
  Data d{MatrixXd(3, 3),
         Vector3d(1, 1, 0.5),
         {Cone::nonnegative(), Cone::nonnegative(), Cone::free()}};
  d.A << 1, -1, 0, -1, 1, 0, 0, 0, 2;
  const ConeSolution s = solve(d.problem());
  CHECK(s.status == Status::infeasible);
  REQUIRE(s.infeasible_direction.size() == 3);
  const Vector3d v(s.infeasible_direction[0], s.infeasible_direction[1], s.infeasible_direction[2]);
  CHECK((d.A * v).norm() < 1e-12);
  CHECK(d.b.dot(v) > 0.5);
}

TEST_CASE("cones: bad blocks are refused by name") {
  const MatrixXd A = MatrixXd::Identity(3, 3);
  const VectorXd b = VectorXd::Ones(3);
  CHECK_THROWS_WITH(ConeProblem::dense(A, b, {Cone::planar(0.5)}), Contains("b has 3 entries"));
  CHECK_THROWS_WITH(ConeProblem::dense(A, b, {Cone::friction(-1)}), Contains("block 0: mu = -1"));
  CHECK_THROWS_WITH(ConeProblem::dense(A, b, {Cone::free(2), Cone::bounded(std::nan(""))}),
                    Contains("block 1: bound"));
  CHECK_THROWS_WITH(ConeProblem::dense(A, b, {Cone::free(0), Cone::friction(1)}),
                    Contains("block 0: 0 rows"));
  CHECK_THROWS_WITH(ConeProblem::dense(-A, b, {Cone::free(2), Cone::nonnegative()}),
                    Contains("block 0: least eigenvalue of A"));
  CHECK_THROWS_WITH(ConeProblem::dense(0 * A, b, {Cone::friction(1)}),
                    Contains("block 0: A_nn = 0"));
  CHECK_THROWS_WITH(ConeProblem::sparse({{0, 3, 1.0}}, b, {Cone::free(3)}),
                    Contains("A(0, 3) is outside"));
  CHECK_THROWS_WITH(ConeProblem::saddle({{0, 0, -1.0}}, {{0, 0, 1.0}}, VectorXd::Zero(1),
                                        VectorXd::Zero(1), {Cone::free()}),
                    Contains("M is not symmetric and positive definite in the part of row 0"));
  CHECK_THROWS_WITH(
      ConeSolver().solve(ConeProblem::dense(A, b, {Cone::friction(1)}), VectorXd::Ones(2)),
      Contains("start has 2 entries"));
}

TEST_CASE("cones: where nothing approaches there are no impulses, however small those of a start") {
  for (const double last : {1e-175, -1e-30, 5.0}) {
    const MatrixXd A = 0.5 * MatrixXd::Identity(4, 4);
    const Eigen::Vector4d b(0, 0, 0, 2), start(last, 0, 0, last);
    const ConeProblem problem =
        ConeProblem::dense(A, b, {Cone::bounded(10), Cone::free(2), Cone::nonnegative()});
    Options options;
    options.law = Law::coulomb;
    const ConeSolution s = ConeSolver(options).solve(problem, start);
    CAPTURE(last);
    CHECK(s.status == Status::solved);
    CHECK(s.impulses[0] == Approx(0).margin(1e-300));
    CHECK(s.impulses[3] == Approx(4).epsilon(1e-12));
  }
}

// Derivatives over products of cones against closed forms and differences of tight solutions.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <random>
#include <tether/contact.hpp>

#include "cone_problems.hpp"
#include "support/catch.hpp"

using namespace tether::contact;
using namespace tether::contact::cone_problems;
using Catch::Contains;
using Eigen::Vector3d;

namespace {

ConeSolution tight(const ConeProblem& p) { return solve(p, 1e-13); }

// One of each, with free rows between them that depend on each other where `copies`.
Data random_problem(unsigned seed, bool copies) {
  std::mt19937 g(seed);
  std::normal_distribution<double> normal;
  Data out;
  out.cones = {Cone::free(2),
               Cone::with_rolling(0.5, 0.3),
               Cone::bounded(0.2),
               Cone::friction(0.6),
               Cone::nonnegative(),
               Cone::planar(0.5),
               Cone::free(1),
               Cone::with_torsional(0.7, 0.4),
               Cone::with_rolling(0.4, 0.2, 0.3)};
  const int rows = 25;
  const MatrixXd J = MatrixXd::NullaryExpr(rows, 32, [&] { return normal(g); });
  out.A = J * J.transpose() + 16 * MatrixXd::Identity(rows, rows);
  out.b = 6 * VectorXd::NullaryExpr(rows, [&] { return normal(g); });
  if (copies) {  // row 14, free, is row 0 again
    out.A.row(14) = out.A.row(0);
    out.A.col(14) = out.A.col(0);
    out.A(14, 14) = out.A(0, 0);
    out.b[14] = out.b[0];
  }
  return out;
}

}  // namespace

TEST_CASE("cone derivative: blocks alone have the slopes of their closed forms") {
  const auto slope = [](const Cone& cone, double b, const ProblemDirection& v) {
    const ConeProblem p =
        ConeProblem::dense(MatrixXd::Constant(1, 1, 2), VectorXd::Constant(1, b), {cone});
    return derivative(p, tight(p).impulses).forward(v).impulses[0];
  };
  ProblemDirection db, da, dN;
  db.b = VectorXd::Ones(1);
  da.A = {{0, 0, 1.0}};
  dN.bound = VectorXd::Ones(1);
  CHECK(slope(Cone::free(), 3, db) == Approx(0.5).epsilon(1e-14));
  CHECK(slope(Cone::free(), 3, da) == Approx(-0.75).epsilon(1e-14));
  CHECK(slope(Cone::nonnegative(), 3, db) == Approx(0.5).epsilon(1e-14));
  CHECK(slope(Cone::nonnegative(), 3, da) == Approx(-0.75).epsilon(1e-14));
  CHECK(slope(Cone::nonnegative(), -3, db) == 0);
  CHECK(slope(Cone::bounded(1), 3, db) == Approx(0).margin(1e-14));
  CHECK(slope(Cone::bounded(1), 3, dN) == Approx(1).epsilon(1e-14));
  CHECK(slope(Cone::bounded(1), -3, dN) == Approx(-1).epsilon(1e-14));
  CHECK(slope(Cone::bounded(2), 3, db) == Approx(0.5).epsilon(1e-14));
  CHECK(slope(Cone::bounded(2), 3, dN) == Approx(0).margin(1e-14));

  // A ball that rolls and turns: moments c x_n and d x_n against them.
  MatrixXd A = MatrixXd::Identity(6, 6);
  A(1, 1) = A(2, 2) = 1.25;
  A(1, 5) = A(5, 1) = 0.25;
  A(2, 4) = A(4, 2) = -0.25;
  A(4, 4) = A(5, 5) = A(3, 3) = 0.25;
  VectorXd b = VectorXd::Zero(6);
  b << 2, 0, 0, -3, 0, -5;
  const ConeProblem p = ConeProblem::dense(A, b, {Cone::with_rolling(1, 0.1, 0.2)});
  const ConeSolution s = tight(p);
  REQUIRE(s.status == Status::solved);
  const Derivative D = derivative(p, s.impulses);
  CHECK(D.report().strictly_regular());
  ProblemDirection v;
  v.rolling = v.torsional = VectorXd::Ones(1);
  const SolutionDirection dx = D.forward(v);
  CHECK(dx.impulses[3] == Approx(-2).epsilon(1e-10));  // -x_n
  CHECK(dx.impulses.tail(2).norm() == Approx(2).epsilon(1e-10));
  ProblemDirection press;
  press.b = VectorXd::Unit(6, 0);
  CHECK(D.forward(press).impulses[3] == Approx(-0.2).epsilon(1e-10));
}

TEST_CASE("cone derivative: one block of each against differences, and its transpose") {
  int regular = 0, regimes[3] = {0, 0, 0};
  for (unsigned seed = 0; seed < 40; ++seed) {
    CAPTURE(seed);
    const Data d = random_problem(seed, seed % 2 == 1);
    const ConeProblem p = d.problem();
    const ConeSolution s = tight(p);
    REQUIRE(s.error < 1e-12);
    const Derivative D = derivative(p, s.impulses);
    if (!D.report().strictly_regular()) continue;
    for (std::size_t k = 0; k < d.cones.size(); ++k)
      ++regimes[static_cast<int>(D.report().regimes[k])];
    std::mt19937 g(seed + 1000);
    std::normal_distribution<double> normal;
    const auto any = [&](int n) {
      return VectorXd(VectorXd::NullaryExpr(n, [&] { return normal(g); }));
    };
    const int n = p.rows(), blocks = static_cast<int>(d.cones.size());
    ProblemDirection v;
    v.b = any(n);
    v.mu = 0.1 * any(blocks);
    v.rolling = 0.1 * any(blocks);
    v.torsional = 0.1 * any(blocks);
    v.bound = 0.1 * any(blocks);
    const VectorXd stretch = 0.1 * any(n);  // A(h) = R A R: copies stay copies
    MatrixXd dA = stretch.asDiagonal() * d.A;
    dA += d.A * stretch.asDiagonal();
    VectorXd db = v.b, at = stretch;
    if (seed % 2 == 1) {
      at[14] = at[0];
      dA = at.asDiagonal() * d.A;
      dA += d.A * at.asDiagonal();
      v.b[14] = v.b[0];
    }
    for (int r = 0; r < n; ++r)
      for (int c = 0; c < n; ++c) v.A.push_back({r, c, dA(r, c)});
    const auto moved = [&](double h) {
      Data e = d;
      const VectorXd R = (1 + h * at.array()).matrix();
      e.A = R.asDiagonal() * d.A * R.asDiagonal();
      e.b += h * v.b;
      for (int k = 0; k < blocks; ++k) {
        Cone& c = e.cones[static_cast<std::size_t>(k)];
        if (c.mu > 0) c.mu += h * v.mu[k];
        if (c.rolling > 0) c.rolling += h * v.rolling[k];
        if (c.torsional > 0) c.torsional += h * v.torsional[k];
        if (c.bound > 0) c.bound += h * v.bound[k];
      }
      return tight(e.problem());
    };
    const SolutionDirection dx = D.forward(v);
    CHECK(dx.residual < 1e-8);
    // Central differences with one extrapolation.
    const double h = 1e-4;
    VectorXd x[2], w[2];
    for (int k = 0; k < 2; ++k) {
      const double step = k == 0 ? h : h / 2;
      const ConeSolution up = moved(step), down = moved(-step);
      x[k] = (up.impulses - down.impulses) / (2 * step);
      w[k] = (up.velocities - down.velocities) / (2 * step);
    }
    VectorXd fx = x[1] + (x[1] - x[0]) / 3, found = dx.impulses;
    const VectorXd fw = w[1] + (w[1] - w[0]) / 3;
    if (seed % 2 == 1) {  // copies share by rounding, which differences enlarge
      CHECK(found[0] == Approx(found[14]).margin(1e-6 * found.norm()));
      fx[0] += fx[14];
      found[0] += found[14];
      fx[14] = found[14] = 0;
    }
    const double error = std::max((fx - found).norm() / fx.norm(),
                                  (fw - dx.velocities).norm() / (fw.norm() + v.b.norm()));
    CHECK(error < 1e-8);
    ++regular;

    const VectorXd row = any(n), row_w = any(n);
    const ProblemDirection gradient = D.adjoint(row, row_w);
    double product = gradient.b.dot(v.b) + gradient.bound.dot(v.bound);
    for (const MatrixEntry& e : gradient.A) product += e.value * dA(e.row, e.column);
    for (int k = 0; k < blocks; ++k) {  // only what a block has
      const Cone::Kind kind = d.cones[static_cast<std::size_t>(k)].kind;
      if (kind >= Cone::Kind::planar) product += gradient.mu[k] * v.mu[k];
      product += gradient.rolling[k] * v.rolling[k] + gradient.torsional[k] * v.torsional[k];
    }
    const double wanted = row.dot(dx.impulses) + row_w.dot(dx.velocities);
    CHECK(product == Approx(wanted).margin(1e-9 * (dx.impulses.norm() + dx.velocities.norm()) *
                                           (row.norm() + row_w.norm())));
  }
  CHECK(regular >= 30);
  for (int count : regimes) CHECK(count >= 20);
}

TEST_CASE("cone derivative: free rows alone are a linear solve, and bad arguments are refused") {
  const Eigen::Matrix2d A = (Eigen::Matrix2d() << 3, 1, 1, 2).finished();
  const Eigen::Vector2d b(1, -2);
  const ConeProblem p = ConeProblem::dense(A, b, {Cone::free(2)});
  const Derivative D = derivative(p, tight(p).impulses);
  CHECK(D.report().strictly_regular());
  ProblemDirection v;
  v.b = Eigen::Vector2d(0.5, 1);
  CHECK((D.forward(v).impulses - A.inverse() * v.b).norm() < 1e-13);
  CHECK((D.adjoint(v.b).b - A.inverse() * v.b).norm() < 1e-13);
  v.mu = VectorXd::Ones(2);
  CHECK_THROWS_WITH(D.forward(v), Contains("mu has 2 entries"));
  v.mu.resize(0);
  v.A = {{2, 0, 1.0}};
  CHECK_THROWS_WITH(D.forward(v), Contains("A(2, 0) is outside"));
  CHECK_THROWS_WITH(derivative(p, Eigen::Vector2d(1, 1)), Contains("they are no solution"));
  const ConeProblem kinked =
      ConeProblem::dense(MatrixXd::Ones(1, 1), VectorXd::Zero(1), {Cone::nonnegative()});
  CHECK_FALSE(derivative(kinked, VectorXd::Zero(1)).report().strictly_regular());
}

// Rows beside contacts in problems over cones: free ones of any rank, compliant ones, those of
// trees. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <random>
#include <tether/contact.hpp>
#include <tether/linalg/least_squares.hpp>

#include "cone_problems.hpp"
#include "support/catch.hpp"

using namespace tether::contact;
using namespace tether::contact::cone_problems;
using Catch::Contains;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

TEST_CASE("cones: free rows against their elimination by least squares") {
  int pressed = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    CAPTURE(seed);
    // Free rows depend on each other in every other problem.
    const std::vector<Cone> cones = {Cone::friction(0.5), Cone::free(6), Cone::friction(0.8),
                                     Cone::free(3)};
    Data d = any_data(cones, seed, 0, 1.5);
    if (seed % 2 == 0) {
      const auto copy = [&](int to, int from) {
        d.A.row(to) = -2 * d.A.row(from);
        d.A.col(to) = -2 * d.A.col(from);
        d.A(to, to) = 4 * d.A(from, from);
        d.b[to] = -2 * d.b[from];
      };
      copy(12, 4);
      copy(14, 13);
    }
    std::vector<int> f = {3, 4, 5, 6, 7, 8, 12, 13, 14}, c = {0, 1, 2, 9, 10, 11};
    const auto pick = [&](const std::vector<int>& r, const std::vector<int>& k) {
      return MatrixXd(MatrixXd::NullaryExpr(
          static_cast<Eigen::Index>(r.size()), static_cast<Eigen::Index>(k.size()),
          [&](Eigen::Index i, Eigen::Index j) {
            return d.A(r[static_cast<std::size_t>(i)], k[static_cast<std::size_t>(j)]);
          }));
    };
    const auto rows = [&](const VectorXd& x, const std::vector<int>& r) {
      return VectorXd(
          VectorXd::NullaryExpr(static_cast<Eigen::Index>(r.size()),
                                [&](Eigen::Index i) { return x[r[static_cast<std::size_t>(i)]]; }));
    };
    tether::linalg::LeastSquares free(1e-11);
    free.factor(pick(f, f));
    const MatrixXd Y = free.solve_columns(pick(f, c));
    const Problem contacts = Problem::dense(
        pick(c, c) - pick(c, f) * Y, rows(d.b, c) - pick(c, f) * VectorXd(free.solve(rows(d.b, f))),
        Vector2d(0.5, 0.8));
    Options o;
    o.law = Law::coulomb;
    o.tolerance = 1e-12;
    const Solution wanted = Solver(o).solve(contacts);
    REQUIRE(wanted.status == Status::solved);
    const ConeSolution s = solve(d.problem(), 1e-12);
    REQUIRE(s.status == Status::solved);
    CHECK(s.contradicting.empty());
    pressed += wanted.impulses[0] > 0 && wanted.impulses[3] > 0;
    CHECK((rows(s.impulses, c) - wanted.impulses).norm() <= 1e-8 * wanted.impulses.norm());
    CHECK(rows(s.velocities, f).norm() < 1e-10 * d.b.norm());
  }
  CHECK(pressed >= 5);
}

TEST_CASE("cones: free rows of any size of velocities are met") {
  Data d = any_data({Cone::free(2), Cone::free(1)}, 5, 1);
  for (const double size : {1.0, 1e-100, 1e-200, 1e-290}) {
    Data small = d;
    small.b *= size;
    const ConeSolution s = solve(small.problem());
    INFO(size);
    CHECK(s.status == Status::solved);
    CHECK((s.velocities / size).norm() < 1e-9 * d.b.norm());
  }
}

TEST_CASE("cones: ten copies of free rows share their impulse, and change no other") {
  const auto cones = [](int copies) {
    return std::vector<Cone>{Cone::friction(0.5), Cone::free(2 * copies)};
  };
  const Data once = any_data(cones(1), 3, 0.5);
  Data ten{MatrixXd(23, 23), VectorXd(23), cones(10)};
  const auto source = [](int i) { return i < 3 ? i : 3 + (i - 3) % 2; };
  for (int i = 0; i < 23; ++i) {
    ten.b[i] = once.b[source(i)];
    for (int j = 0; j < 23; ++j) ten.A(i, j) = once.A(source(i), source(j));
  }
  const ConeSolution a = solve(once.problem()), b = solve(ten.problem());
  REQUIRE(a.status == Status::solved);
  REQUIRE(b.status == Status::solved);
  CHECK((a.impulses.head(3) - b.impulses.head(3)).norm() < 1e-9 * a.impulses.norm());
  for (int i = 3; i < 23; ++i)
    CHECK(b.impulses[i] == Approx(0.1 * a.impulses[source(i)]).epsilon(1e-7));
}

TEST_CASE("cones: free rows that contradict each other, and contacts that they lock, are named") {
  Data d = any_data({Cone::free(1), Cone::friction(0.5), Cone::free(1)}, 4, 1);
  d.A.row(4) = d.A.row(0);
  d.A.col(4) = d.A.col(0);
  d.A(4, 4) = d.A(0, 0);
  d.b[4] = d.b[0] + 1;
  const ConeSolution s = solve(d.problem());
  CHECK(s.status == Status::infeasible);
  CHECK(s.contradicting == std::vector<int>{0, 4});
  CHECK_THAT(s.advice, Contains("free row 0 contradicts"));
  d.b[4] = d.b[0];
  CHECK(solve(d.problem()).status == Status::solved);

  // A free row that is the contact's normal: w_n = A_nf x_f - b_n is what that row asks for.
  for (double rate : {-1.0, 1.0}) {
    Data held = any_data({Cone::friction(0.5), Cone::free(1)}, 4, 1);
    held.A.row(3) = held.A.row(0);
    held.A.col(3) = held.A.col(0);
    held.A(3, 3) = held.A(0, 0);
    held.b[3] = held.b[0] + rate;  // w_n = rate
    const ConeSolution t = solve(held.problem());
    CHECK(t.status == (rate < 0 ? Status::infeasible : Status::solved));
    CHECK(t.blocked == (rate < 0 ? std::vector<int>{0} : std::vector<int>{}));
    CHECK(t.velocities[0] == Approx(rate).epsilon(1e-9));
    CHECK(t.impulses.head(3).norm() == 0);
  }
  // Nothing moves the row at all.
  const ConeProblem dead =
      ConeProblem::dense(MatrixXd::Zero(1, 1), VectorXd::Ones(1), {Cone::free()});
  CHECK(solve(dead).status == Status::infeasible);
  CHECK(solve(dead).contradicting == std::vector<int>{0});
}

TEST_CASE("cones: M and J of a tree of masses give what their dense inverse gives") {
  std::mt19937 g(7);
  std::normal_distribution<double> normal;
  const int n = 12, m = 7;
  MatrixXd mass = MatrixXd::Zero(n, n), rows = MatrixXd::Zero(m, n);
  for (int part = 0; part < 3; ++part) {  // three parts that M does not connect
    const MatrixXd L = MatrixXd::NullaryExpr(4, 4, [&] { return normal(g); });
    mass.block(4 * part, 4 * part, 4, 4) = L * L.transpose() + MatrixXd::Identity(4, 4);
  }
  rows = MatrixXd::NullaryExpr(m, n, [&] { return normal(g); });
  rows.topRightCorner(3, 8).setZero();
  const VectorXd f = VectorXd::NullaryExpr(n, [&] { return normal(g); }),
                 bias = VectorXd::NullaryExpr(m, [&] { return normal(g); });
  const auto entries = [](const MatrixXd& A) {
    std::vector<MatrixEntry> out;
    for (int r = 0; r < A.rows(); ++r)
      for (int c = 0; c < A.cols(); ++c)
        if (A(r, c) != 0) out.push_back({r, c, A(r, c)});
    return out;
  };
  const std::vector<Cone> cones = {Cone::friction(0.5), Cone::free(1), Cone::friction(0.2)};
  const VectorXd soft = VectorXd::LinSpaced(m, 0, 0.6);
  const ConeProblem p = ConeProblem::saddle(entries(mass), entries(rows), f, bias, cones, soft);
  const MatrixXd inverse = mass.inverse();
  const MatrixXd A = rows * inverse * rows.transpose() + MatrixXd(soft.asDiagonal());
  CHECK((p.dense_matrix() - A).norm() < 1e-12 * A.norm());
  CHECK((p.b() + rows * inverse * f + bias).norm() < 1e-12 * p.b().norm());
  const ConeSolution s = solve(p);
  REQUIRE(s.status == Status::solved);
  CHECK(broken_law(p, s.impulses, s.velocities) < 1e-7);
}

TEST_CASE("cones: a compliant row yields by its impulse") {
  // x = b / (a + c); a free row, one that presses, one within its bound; and a redundant pair of
  // springs, which share as their compliances say.
  const Cone cones[] = {Cone::free(), Cone::nonnegative(), Cone::bounded(10)};
  for (const Cone& cone : cones) {
    const ConeSolution s = solve(ConeProblem::dense(
        MatrixXd::Constant(1, 1, 2), VectorXd::Constant(1, 3), {cone}, VectorXd::Constant(1, 4)));
    CHECK(s.impulses[0] == Approx(0.5).epsilon(1e-13));
    CHECK(std::abs(s.velocities[0]) < 1e-12);
  }
  const ConeSolution two = solve(ConeProblem::dense(MatrixXd::Constant(2, 2, 1), Vector2d(1, 1),
                                                    {Cone::free(2)}, Vector2d(0.5, 1)));
  CHECK(two.impulses[0] == Approx(2 * two.impulses[1]).epsilon(1e-12));
  CHECK(two.impulses.sum() + 0.5 * two.impulses[0] == Approx(1).epsilon(1e-12));
  CHECK_THROWS_WITH(ConeProblem::dense(MatrixXd::Identity(1, 1), VectorXd::Ones(1), {Cone::free()},
                                       VectorXd::Constant(1, -1)),
                    Contains("compliance = -1"));
}

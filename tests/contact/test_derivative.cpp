// Tether: derivatives of solutions against closed forms and differences of tight solutions.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <random>
#include <tether/contact.hpp>
#include <tether/linalg/least_squares.hpp>

#include "assemblies.hpp"
#include "contact_differences.hpp"
#include "packing.hpp"
#include "support/catch.hpp"

using namespace tether::contact;
using Catch::Contains;
using differences::Data;
using differences::kLaws;
using differences::tight;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// One contact: A, b, mu and the derivative at its solution.
struct One {
  Eigen::Matrix3d A = Eigen::Vector3d(2, 4, 5).asDiagonal();
  Vector3d b = {1, 0.1, -0.05};
  double mu = 0.5;
  Problem problem() const { return Problem::dense(A, b, VectorXd::Constant(1, mu)); }
  Derivative at(Law law) const {
    const Problem p = problem();
    return derivative(p, law, tight(p, law));
  }
};

ProblemDirection of_b(const Vector3d& db) {
  ProblemDirection d;
  d.b = db;
  return d;
}
ProblemDirection of_mu(double dmu) {
  ProblemDirection d;
  d.mu = VectorXd::Constant(1, dmu);
  return d;
}

// A random problem of n contacts whose matrix has the given rank.
Data random_problem(int n, int rank, double mu, unsigned seed) {
  std::mt19937 g(seed);
  std::normal_distribution<double> normal;
  const MatrixXd J = MatrixXd::NullaryExpr(3 * n, rank, [&] { return normal(g); });
  Data out{J * J.transpose(), VectorXd(3 * n), VectorXd::Constant(n, mu)};
  for (int k = 0; k < 3 * n; ++k) out.b[k] = normal(g) + (k % 3 == 0 ? 0.5 : 0);
  return out;
}

// A table on four legs under its weight: normal and tangential motion of a body at four corners.
Data table(double mu, double push) {
  MatrixXd J = MatrixXd::Zero(12, 6);
  const double h = 0.4;
  for (int leg = 0; leg < 4; ++leg) {
    const Vector3d r(leg & 1 ? 1 : -1, leg & 2 ? 0.7 : -0.7, -h);
    const Vector3d axes[] = {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}};
    for (int k = 0; k < 3; ++k) {
      J.row(3 * leg + k).head<3>() = axes[k];
      J.row(3 * leg + k).tail<3>() = r.cross(axes[k]);
    }
  }
  VectorXd v = VectorXd::Zero(6);
  v[2] = -1;
  v[0] = push;
  VectorXd inverse_mass(6);
  inverse_mass << 1, 1, 1, 2, 1.5, 1;
  return {J * inverse_mass.asDiagonal() * J.transpose(), -J * v, VectorXd::Constant(4, mu)};
}

}  // namespace
TEST_CASE("derivative: a contact that sticks follows A dx = db - dA x, mu does not count") {
  One one;
  one.A(0, 1) = one.A(1, 0) = 0.7;
  for (Law law : {Law::maximum_dissipation, Law::coulomb}) {
    const Derivative d = one.at(law);
    CHECK(d.report().regimes[0] == Regime::sticking);
    CHECK(d.report().strictly_regular());
    CHECK(d.report().rank == 3);
    const Vector3d db(0.3, -0.2, 0.5);
    const SolutionDirection f = d.forward(of_b(db));
    CHECK((f.impulses - one.A.inverse() * db).norm() < 1e-14);
    CHECK(f.velocities.norm() < 1e-15);
    CHECK(d.forward(of_mu(1)).impulses.norm() == 0);
    ProblemDirection change;
    change.A = {{0, 0, 1}, {1, 1, 1}, {2, 2, 1}};
    const Vector3d x = d.impulses();
    CHECK((d.forward(change).impulses + one.A.inverse() * x).norm() < 1e-14);
  }
}

TEST_CASE("derivative: a contact that parts has none, its velocity follows b") {
  One one;
  one.b = {-1, 2, 3};
  for (Law law : kLaws) {
    const Derivative d = one.at(law);
    CHECK(d.report().regimes[0] == Regime::separating);
    CHECK(d.report().strictly_regular());
    const SolutionDirection f = d.forward(of_b({1, 2, 3}));
    CHECK(f.impulses.norm() == 0);
    CHECK(f.velocities == VectorXd(-Vector3d(1, 2, 3)));
    CHECK(d.adjoint(Vector3d(1, 1, 1)).b.norm() == 0);
  }
}

TEST_CASE("derivative: a sphere that slides, both laws: x_t = mu b_n/a along b_t") {
  One one;
  one.A = Vector3d(2, 4, 4).asDiagonal();
  one.b = {1, 3, -4};
  one.mu = 0.2;
  for (Law law : {Law::maximum_dissipation, Law::coulomb}) {
    const Derivative d = one.at(law);
    CHECK(d.report().regimes[0] == Regime::sliding);
    // Across: the direction turns by db / |b_t|, all impulses of the friction mu b_n/a.
    const Vector3d across = d.forward(of_b({0, 4, 3})).impulses;
    CHECK((across - 0.2 * 0.5 / 5 * Vector3d(0, 4, 3)).norm() < 1e-13);
    CHECK(d.forward(of_b({0, 3, -4})).impulses.norm() < 1e-13);  // along: nothing
    CHECK(
        (d.forward(of_b({1, 0, 0})).impulses - Eigen::VectorXd(Vector3d(0.5, 0.06, -0.08))).norm() <
        1e-13);
    CHECK((d.forward(of_mu(1)).impulses - Eigen::VectorXd(Vector3d(0, 0.3, -0.4))).norm() < 1e-13);
  }
}

TEST_CASE("derivative: friction that begins at mu = 0 acts against the slip") {
  One one;
  one.b = {1, 3, -4};
  one.mu = 0;
  for (Law law : {Law::maximum_dissipation, Law::coulomb}) {
    const Derivative d = one.at(law);
    CHECK((d.forward(of_mu(1)).impulses - Eigen::VectorXd(Vector3d(0, 0.3, -0.4))).norm() < 1e-14);
    CHECK((d.forward(of_b({1, 1, 1})).impulses - Eigen::VectorXd(Vector3d(0.5, 0, 0))).norm() <
          1e-14);
  }
  one.mu = 0.4;
  const Derivative d = one.at(Law::frictionless);
  CHECK((d.forward(of_b({1, 1, 1})).impulses - Eigen::VectorXd(Vector3d(0.5, 0, 0))).norm() <
        1e-14);
  CHECK(d.forward(of_mu(1)).impulses.norm() == 0);
}

TEST_CASE("derivative: coupled contacts against differences, every law, one to thirty contacts") {
  int seen = 0;
  for (Law law : kLaws)
    for (int n : {1, 2, 5, 12, 30})
      for (unsigned seed = 0; seed < 3; ++seed) {
        const Data data = random_problem(n, 3 * n + 4, 0.3, 100 * static_cast<unsigned>(n) + seed);
        const auto found = differences::compare(data, law, seed);
        INFO(name(law) << ", " << n << " contacts, seed " << seed << ": " << found.words);
        if (!found.regular) continue;
        ++seen;
        CHECK(found.error < 1e-6);
        CHECK(found.transposed < 1e-12);
      }
  CHECK(seen > 30);
}

TEST_CASE("derivative: contacts in the plane against differences") {
  int seen = 0;
  for (Law law : kLaws)
    for (unsigned seed = 0; seed < 4; ++seed) {
      std::mt19937 g(seed);
      std::normal_distribution<double> normal;
      const int n = 5;
      const MatrixXd J = MatrixXd::NullaryExpr(2 * n, 3 * n, [&] { return normal(g); });
      Data data{J * J.transpose(), VectorXd(2 * n), VectorXd::Constant(n, 0.4)};
      for (int k = 0; k < 2 * n; ++k) data.b[k] = normal(g) + (k % 2 == 0 ? 0.5 : 0);
      const auto found = differences::compare(data, law, seed);
      INFO(name(law) << ", seed " << seed << ": " << found.words);
      if (!found.regular) continue;
      ++seen;
      CHECK(found.error < 1e-6);
      CHECK(found.transposed < 1e-12);
    }
  CHECK(seen > 8);
}

TEST_CASE("derivative: other units are other units, 1e-100 to 1e100") {
  const Data data = random_problem(6, 20, 0.3, 3);
  for (Law law : {Law::maximum_dissipation, Law::coulomb}) {
    const Problem p = data.problem();
    const Solution s = tight(p, law);
    ProblemDirection v;
    v.b = VectorXd::LinSpaced(18, -1, 1);
    v.mu = VectorXd::LinSpaced(6, 0.1, 0.2);
    differences::add_block(v, 0, 0, Eigen::Matrix3d::Ones());
    differences::add_block(v, 6, 9, Eigen::Matrix3d::Identity());
    const SolutionDirection plain = derivative(p, law, s).forward(v);
    for (double mass : {1e-100, 1e-8, 1e8, 1e100})
      for (double speed : {1e-100, 1e-8, 1e8, 1e100}) {
        const Data scaled{mass * data.A, speed * data.b, data.mu};
        const Problem q = scaled.problem();
        const Solution t = tight(q, law);
        ProblemDirection w = v;
        w.b *= speed;
        for (MatrixEntry& e : w.A) e.value *= mass;
        const Derivative d = derivative(q, law, t);
        const SolutionDirection found = d.forward(w);
        INFO("mass " << mass << ", speed " << speed);
        CHECK((found.impulses * (mass / speed) - plain.impulses).norm() <
              1e-8 * plain.impulses.norm());
        CHECK((found.velocities / speed - plain.velocities).norm() <
              1e-8 * plain.velocities.norm());
        // x is mu and A, b: the gradient of a number in its own units.
        const VectorXd row = VectorXd::LinSpaced(18, 1, 2) * (mass / speed);
        const ProblemDirection gradient = d.adjoint(row);
        const double left = row.dot(found.impulses);
        CHECK(std::abs(left - differences::product(gradient, w)) <
              1e-11 * differences::sizes(gradient, w));
      }
  }
}

TEST_CASE("derivative: four legs that stick: velocities are unique, impulses of least change") {
  const Data data = table(0.8, 0.1);
  const Problem p = data.problem();
  for (Law law : {Law::maximum_dissipation, Law::coulomb}) {
    const Derivative d = derivative(p, law, tight(p, law));
    CHECK(d.report().status == DerivativeStatus::minimum_norm);
    CHECK(d.report().unknowns == 12);
    CHECK(d.report().rank == 6);
    CHECK(d.report().velocities_unique);
    CHECK(d.report().not_unique == std::vector<int>{0, 1, 2, 3});
    CHECK_THAT(d.report().advice, Contains("6 free directions"));
    // More weight: db in the range of A, and the weights of equal legs change alike.
    ProblemDirection v;
    v.b = VectorXd::Zero(12);
    for (int leg = 0; leg < 4; ++leg) v.b[3 * leg] = 1;
    const SolutionDirection f = d.forward(v);
    CHECK(f.residual < 1e-13);
    CHECK(f.velocities.norm() < 1e-13);
    for (int leg = 0; leg < 4; ++leg) CHECK(f.impulses[3 * leg] == Approx(0.25));
    tether::linalg::LeastSquares A;
    A.factor(data.A);
    CHECK((f.impulses - VectorXd(A.solve(v.b))).norm() < 1e-12);  // equal traces: Euclid's norm
    // One leg alone lifted: no impulses follow.
    v.b.setZero();
    v.b[0] = 1;
    CHECK(d.forward(v).residual > 0.1);
  }
}

TEST_CASE("derivative: a table that slides: not even velocities are unique at low friction") {
  const Data data = table(0.1, 5);
  const Problem p = data.problem();
  const Derivative d = derivative(p, Law::coulomb, tight(p, Law::coulomb));
  INFO(d.report().advice);
  for (Regime r : d.report().regimes) CHECK(r == Regime::sliding);
  CHECK(d.report().rank < 12);
  CHECK_FALSE(d.report().not_unique.empty());
}

TEST_CASE("derivative: kinks are named with the branch and the other regime") {
  One one;
  one.A = Vector3d(2, 4, 4).asDiagonal();
  const struct {
    Vector3d b;
    double mu;
    Regime one, other;
  } kinks[] = {{{0, 1, 0}, 0.5, Regime::separating, Regime::sliding},
               {{1, 0.8, 0}, 0.4, Regime::sticking, Regime::sliding}};
  for (const auto& k : kinks)
    for (Law law : {Law::maximum_dissipation, Law::coulomb}) {
      one.b = k.b;
      one.mu = k.mu;
      const Derivative d = one.at(law);
      CHECK_FALSE(d.report().strictly_regular());
      REQUIRE(d.report().kinks.size() == 1);
      const Kink& found = d.report().kinks[0];
      CHECK(found.contact == 0);
      CHECK(found.margin < 1e-12);
      CHECK((found.branch == k.one || found.branch == k.other));
      CHECK((found.other == k.one || found.other == k.other));
      CHECK(found.branch != found.other);
      CHECK(d.report().regimes[0] == found.branch);
      CHECK_THAT(d.report().advice, Contains("1 contacts lie at kinks"));
    }
}

TEST_CASE(
    "derivative: contacts with the Coulomb rule under maximum dissipation have its derivative") {
  const Data data = random_problem(4, 16, 0.5, 11);
  const Problem p = data.problem();
  DerivativeOptions all;
  all.replaced = {0, 1, 2, 3};
  const Solution s = tight(p, Law::coulomb);
  REQUIRE(s.error < 1e-11);
  REQUIRE(std::count(s.regimes.begin(), s.regimes.end(), Regime::sliding) > 0);
  ProblemDirection v;
  v.b = VectorXd::LinSpaced(12, -1, 1);
  v.mu = VectorXd::Ones(4);
  for (int row : {0, 3}) differences::add_block(v, row, row, Eigen::Matrix3d::Ones());
  const SolutionDirection own = derivative(p, Law::coulomb, s).forward(v);
  const SolutionDirection other =
      derivative(p, Law::maximum_dissipation, s.impulses, all).forward(v);
  CHECK(own.impulses == other.impulses);
  // The law itself has another solution.
  CHECK_THROWS_AS(derivative(p, Law::maximum_dissipation, s), std::invalid_argument);
}

TEST_CASE("derivative: blocks that are not symmetric count as given") {
  Data data = random_problem(3, 16, 0.3, 4);
  data.A(0, 1) += 0.05 * data.A(0, 0);
  data.A(4, 7) -= 0.05 * data.A(4, 4);
  for (Law law : {Law::maximum_dissipation, Law::coulomb}) {
    const auto found = differences::compare(data, law, 2);
    INFO(name(law) << ": " << found.words);
    REQUIRE(found.regular);
    CHECK(found.error < 1e-6);
    CHECK(found.transposed < 1e-12);
  }
}

TEST_CASE("derivative: what is refused is named") {
  const One one;
  const Problem p = one.problem();
  const Solution s = tight(p, Law::coulomb);
  const auto refusal = [](const auto& call) -> std::string {
    try {
      call();
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return {};
  };
  const double nan = std::nan("");
  CHECK_THAT(refusal([&] { derivative(p, Law::coulomb, VectorXd::Zero(3)); }),
             Contains("error of the impulses") && Contains("coulomb") && Contains("1e-05"));
  CHECK_THAT(refusal([&] { derivative(p, Law::coulomb, VectorXd::Zero(4)); }),
             Contains("impulses has 4 entries") && Contains("3 are needed"));
  CHECK_THAT(refusal([&] { derivative(p, Law::coulomb, Vector3d(1, nan, 0)); }),
             Contains("impulses(1)") && Contains("nan"));
  DerivativeOptions o;
  o.tolerance = 0;
  CHECK_THAT(refusal([&] { derivative(p, Law::coulomb, s, o); }), Contains("tolerance = 0"));
  o = {};
  o.kink = -1;
  CHECK_THAT(refusal([&] { derivative(p, Law::coulomb, s, o); }), Contains("kink = -1"));
  o = {};
  o.replaced = {0};
  CHECK_THAT(refusal([&] { derivative(p, Law::coulomb, s.impulses, o); }),
             Contains("coulomb has no replacement"));
  o.replaced = {3};
  CHECK_THAT(refusal([&] { derivative(p, Law::maximum_dissipation, s.impulses, o); }),
             Contains("replaced contact = 3"));
  const Derivative d = derivative(p, Law::coulomb, s);
  ProblemDirection v;
  v.b = VectorXd::Zero(60);
  CHECK_THAT(refusal([&] { d.forward(v); }), Contains("b has 60 entries"));
  v = {};
  v.mu = VectorXd::Constant(1, nan);
  CHECK_THAT(refusal([&] { d.forward(v); }), Contains("mu = nan"));
  v = {};
  v.A = {{0, 3, 0}};
  CHECK_THAT(refusal([&] { d.forward(v); }), Contains("A(0, 3) is outside"));
  CHECK_THAT(refusal([&] { d.adjoint(VectorXd::Zero(60)); }), Contains("impulses has 60 entries"));
  CHECK(d.forward({}).impulses.norm() == 0);
  CHECK(refusal([&] { derivative(Problem(), Law::coulomb, VectorXd()); }).empty());
}

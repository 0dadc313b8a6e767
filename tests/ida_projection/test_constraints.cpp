// Tether: sets of constraints, their names, builders and the check of a Jacobian.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <limits>
#include <problems/andrews.hpp>
#include <problems/car_axis.hpp>
#include <problems/rigid_body.hpp>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

tp::Constraints rows(int count, std::vector<std::string> names = {}) {
  tp::Constraints set;
  set.count = count;
  set.names = std::move(names);
  set.value = [](double, tp::ConstVector y, tp::Vector g) {
    for (Eigen::Index i = 0; i < g.size(); ++i) g[i] = std::sin(y[0] * static_cast<double>(i + 1));
  };
  set.jacobian = tp::DenseJacobian([](double, tp::ConstVector y, tp::Matrix C) {
    for (Eigen::Index i = 0; i < C.rows(); ++i)
      C(i, 0) = static_cast<double>(i + 1) * std::cos(y[0] * static_cast<double>(i + 1));
  });
  return set;
}

const std::vector<double> kState = {0.6, -0.2, 0.7, 0.33, 1.5, -2.0};

}  // namespace

TEST_CASE("joining: counts and names, nested both ways") {
  const tp::Constraints a = rows(2, {"a0", "a1"}), b = rows(1), c = rows(2, {"c0", "c1"});
  for (const tp::Constraints& set : {(a + b) + c, a + (b + c)}) {
    CHECK(set.total_count() == 5);
    const std::vector<std::string> expected = {"a0", "a1", "row 2", "c0", "c1"};
    for (int i = 0; i < 5; ++i) CHECK(set.name(i) == expected[static_cast<std::size_t>(i)]);
    CHECK(set.name(5) == "row 5");
  }
  CHECK((a + tp::Constraints{}).total_count() == 2);
  CHECK((tp::Constraints{} + a).name(1) == "a1");
  CHECK(tp::Constraints{}.total_count() == 0);
}

TEST_CASE("joining kinds that do not mix is refused") {
  tp::Constraints gradients;
  gradients.count = 1;
  gradients.jacobian =
      tp::Gradients{[](double, N_Vector, double*) {}, [](double, N_Vector, N_Vector*) {}};
  tp::Constraints user;
  user.count = 1;
  user.jacobian = tp::UserProjection{
      [](sunrealtype, N_Vector, N_Vector, sunrealtype, N_Vector, void*) { return 0; }, nullptr};
  CHECK(contains(thrown([&] { (void)(rows(1) + gradients); }), "Gradients"));
  CHECK(contains(thrown([&] { (void)(gradients + rows(1)); }), "Gradients"));
  CHECK(contains(thrown([&] { (void)(rows(1) + user); }), "UserProjection"));
  CHECK((gradients + gradients).total_count() == 2);
  tp::Constraints differences = rows(1);
  differences.jacobian = tp::FiniteDifferences{};
  CHECK((rows(2) + differences).total_count() == 3);
}

TEST_CASE("joined in any order: the same motion") {
  const Problem body = rigid_body("regular", 5.0);
  const tp::Constraints ab = body.select({"quaternion norm", "energy"});
  const tp::Constraints ba = body.select({"energy", "quaternion norm"});
  const Run first = integrate(body, 1e-7, ab), second = integrate(body, 1e-7, ba);
  REQUIRE(first.flag >= 0);
  REQUIRE(second.flag >= 0);
  for (std::size_t i = 0; i < 7; ++i) CHECK(std::abs(first.y[i] - second.y[i]) < 1e-9);
}

TEST_CASE("check_jacobian: right ones pass") {
  for (const Problem& p : {andrews("index 1"), car_axis("index 1 w"), rigid_body("euler", 1.0)}) {
    INFO(p.name);
    for (const Rows& group : p.rows) {
      INFO(group.name);
      const tp::JacobianReport report = tp::check_jacobian(group.constraints, 0.01, p.y0);
      INFO(report.message);
      CHECK(report.correct);
      CHECK(report.worst < 1e-6);
      CHECK(report.row == -1);
      CHECK(report.message.empty());
    }
  }
  tp::Constraints differences = rows(2);
  differences.jacobian = tp::FiniteDifferences{};
  CHECK(tp::check_jacobian(differences, 0.0, kState).correct);
}

TEST_CASE("check_jacobian: names the wrong row and column of a joined set") {
  const Problem p = car_axis("index 1");
  tp::Constraints wrong = p.select({"velocity"});
  const auto right = std::get<tp::DenseJacobian>(wrong.jacobian).fill;
  wrong.jacobian = tp::DenseJacobian([right](double t, tp::ConstVector y, tp::Matrix C) {
    const int flag = right(t, y, C);
    C(1, 6) += 1e-3;
    return flag;
  });
  const tp::Constraints set = p.select({"position"}) + wrong;
  std::vector<double> y = p.y0;
  for (std::size_t i = 0; i < y.size(); ++i) y[i] += 0.1 * std::sin(1.0 + static_cast<double>(i));
  const tp::JacobianReport report = tp::check_jacobian(set, 0.3, y);
  INFO(report.message);
  CHECK_FALSE(report.correct);
  CHECK(report.row == 3);
  CHECK(report.column == 6);
  CHECK(report.given - report.expected == Approx(1e-3).epsilon(1e-4));
  CHECK(contains(report.message, "row 3 (" + set.name(3) + "), column 6"));
  // Tolerated when asked to.
  CHECK(tp::check_jacobian(set, 0.3, y, 0.1).correct);
}

TEST_CASE("check_jacobian: a missing entry, a sign, NaN and misuse") {
  tp::Constraints set = rows(3);
  set.jacobian = tp::DenseJacobian([](double, tp::ConstVector y, tp::Matrix C) {
    for (Eigen::Index i = 0; i < 3; ++i)
      C(i, 0) = (i == 1 ? -1.0 : 1.0) * static_cast<double>(i + 1) *
                std::cos(y[0] * static_cast<double>(i + 1));
  });
  CHECK(tp::check_jacobian(set, 0.0, kState).row == 1);
  set.jacobian = tp::DenseJacobian([](double, tp::ConstVector, tp::Matrix) {});
  CHECK_FALSE(tp::check_jacobian(set, 0.0, kState).correct);
  set.jacobian = tp::DenseJacobian([](double, tp::ConstVector y, tp::Matrix C) {
    for (Eigen::Index i = 0; i < 3; ++i)
      C(i, 0) = static_cast<double>(i + 1) * std::cos(y[0] * static_cast<double>(i + 1));
    C(2, 4) = std::nan("");
  });
  const tp::JacobianReport nan = tp::check_jacobian(set, 0.0, kState);
  CHECK_FALSE(nan.correct);
  CHECK(nan.row == 2);
  CHECK(nan.column == 4);
  CHECK(contains(thrown([&] { tp::check_jacobian(rows(1), 0.0, kState, -1.0); }), "tolerance"));
}

TEST_CASE("check_jacobian: rows without a Jacobian pass, close to a pole as well") {
  tp::Constraints pole = rows(1);
  pole.value = [](double, tp::ConstVector y, tp::Vector g) { g[0] = 1.0 / (y[0] - 4e-4); };
  pole.jacobian = tp::FiniteDifferences{};
  const std::vector<double> beside = {0.0, 0.0, 0.0, 0.0, 0.0};
  CHECK(tp::check_jacobian(pole, 0.0, beside).correct);
  CHECK(tp::check_jacobian(rows(3) + pole, 0.0, beside).correct);
  pole.jacobian = tp::DenseJacobian([](double, tp::ConstVector, tp::Matrix C) { C(0, 0) = 1.0; });
  CHECK(tp::check_jacobian(rows(3) + pole, 0.0, beside).row == 3);
}

TEST_CASE("builders: values and gradients") {
  const auto agrees = [](const tp::Constraints& set) {
    const tp::JacobianReport report = tp::check_jacobian(set, 0.0, kState);
    INFO(report.message);
    CHECK(report.correct);
    return value(set, 0.0, kState.data(), 6)[0];
  };
  const double* y = kState.data();
  CHECK(agrees(tp::quaternion_norm(1)) ==
        Approx((y[1] * y[1] + y[2] * y[2] + y[3] * y[3] + y[4] * y[4] - 1.0) / 2.0));
  CHECK(agrees(tp::linear_invariant({1, 2, 0, 0, -1, 0}, 0.5)) == Approx(0.6 - 0.4 - 1.5 - 0.5));
  const tp::ScalarFunction H = [](tp::ConstVector x) { return x[0] * x[1] + std::exp(x[2]); };
  const tp::GradientFunction dH = [](tp::ConstVector x, tp::Vector gradient) {
    gradient[0] = x[1];
    gradient[1] = x[0];
    gradient[2] = std::exp(x[2]);
  };
  CHECK(agrees(tp::invariant(H, dH, 2.0)) == Approx(-0.12 + std::exp(0.7) - 2.0));
  CHECK(agrees(tp::energy(H, dH, 2.0)) == Approx(-0.12 + std::exp(0.7) - 2.0));
  CHECK(agrees(tp::energy(H, dH, 2.0, 5)) == Approx(-0.12 + std::exp(0.7) - 2.0 + 2.0));
  CHECK(tp::quaternion_norm(0, "attitude").name(0) == "attitude");
  CHECK(tp::energy(H, dH, 0.0).name(0) == "energy");
}

TEST_CASE("builders: misuse") {
  CHECK(contains(thrown([] { tp::quaternion_norm(-1); }), "first = -1"));
  CHECK(contains(thrown([] { tp::energy(nullptr, nullptr, 0.0); }), "H is empty"));
  const tp::ScalarFunction H = [](tp::ConstVector) { return 0.0; };
  CHECK(contains(thrown([&] { tp::energy(H, nullptr, 0.0); }), "gradient is empty"));
  CHECK(contains(thrown([&] {
                   tp::energy(
                       H, [](tp::ConstVector, tp::Vector) {}, 0.0, -2);
                 }),
                 "work = -2"));
}

TEST_CASE("builders: an index beyond the unknowns is refused before anything is evaluated") {
  const tp::ScalarFunction H = [](tp::ConstVector y) { return y[0]; };
  const tp::GradientFunction dH = [](tp::ConstVector, tp::Vector gradient) { gradient[0] = 1.0; };
  const auto refused = [](const tp::Constraints& set) {
    Host host(tether::test::circle(1.0), 1e-6);
    const std::string at_attach = thrown([&] { host.attach(set); });
    const double y[] = {1.0, 0.0};
    const std::string by_check =
        thrown([&] { tp::check_jacobian(set, 0.0, tp::ConstVector(y, 2)); });
    CHECK(contains(by_check, at_attach.substr(at_attach.find("constraint \""))));
    return at_attach;
  };
  CHECK(contains(refused(tp::quaternion_norm(1)), "\"quaternion norm\" needs at least 5 unknowns"));
  CHECK(contains(refused(tp::quaternion_norm(100000000)), "at least 100000004"));
  CHECK(contains(refused(tp::quaternion_norm(std::numeric_limits<int>::max())),
                 "at least 2147483651"));
  CHECK(contains(refused(tp::energy(H, dH, 0.0, 9)), "\"energy\" needs at least 10 unknowns"));
  CHECK(contains(refused(tp::energy(H, dH, 0.0, 2)), "at least 3 unknowns; y has 2"));
  CHECK(contains(refused(tp::linear_invariant({1.0, 1.0, 1.0}, 1.0)),
                 "\"linear invariant\" needs exactly 3 unknowns; y has 2"));
  CHECK(contains(refused(tp::linear_invariant({1.0}, 1.0)), "exactly 1 unknowns"));
  // In a joined set, too.
  CHECK(contains(refused(tp::energy(H, dH, 0.0) + tp::quaternion_norm(0)), "\"quaternion norm\""));
}

TEST_CASE("energy with a work state: a driven, damped oscillator keeps its balance") {
  const Problem problem = ode({1.0, 0.0, 0.0}, 30.0, [](double t, const double* y, double* f) {
    const double force = 0.3 * std::cos(0.8 * t) - 0.1 * y[1];
    f[0] = y[1];
    f[1] = -y[0] + force;
    f[2] = force * y[1];
  });
  const tp::Constraints balance =
      tp::energy([](tp::ConstVector y) { return (y[0] * y[0] + y[1] * y[1]) / 2.0; },
                 [](tp::ConstVector y, tp::Vector gradient) {
                   gradient[0] = y[0];
                   gradient[1] = y[1];
                 },
                 0.5, 2);
  const Run run = integrate(problem, 1e-6, balance);
  REQUIRE(run.flag >= 0);
  CHECK(run.distance <= tp::Options().advanced.tolerance);
  CHECK(run.statistics.failures() == 0);
}

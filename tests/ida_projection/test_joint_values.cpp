// Tether: rows whose value and Jacobian come from one function. SPDX-License-Identifier:
// BSD-3-Clause
#include <cmath>
#include <problems/andrews.hpp>
#include <problems/car_axis.hpp>
#include <problems/pendulum.hpp>
#include <stdexcept>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

struct Calls {
  long value = 0, fill = 0, both = 0;
};

/// The set with its calls counted; `together`: with a function for both, else without.
tp::Constraints counted(tp::Constraints set, bool together, Calls& calls) {
  const auto value = set.value;
  set.value = [value, &calls](double t, tp::ConstVector y, tp::Vector g) {
    ++calls.value;
    return value(t, y, g);
  };
  auto& dense = std::get<tp::DenseJacobian>(set.jacobian);
  const auto fill = dense.fill;
  dense.fill = [fill, &calls](double t, tp::ConstVector y, tp::Matrix C) {
    ++calls.fill;
    return fill(t, y, C);
  };
  dense.fill_with_value = nullptr;
  if (together)
    dense.fill_with_value = [value, fill, &calls](double t, tp::ConstVector y, tp::Vector g,
                                                  tp::Matrix C) {
      ++calls.both;
      const int flag = value(t, y, g);
      return flag != 0 ? flag : fill(t, y, C);
    };
  for (tp::Constraints& part : set.joined) part = counted(part, together, calls);
  return set;
}

bool without(tp::Constraints& set) {
  bool had = false;
  if (auto* dense = std::get_if<tp::DenseJacobian>(&set.jacobian)) {
    had = static_cast<bool>(dense->fill_with_value);
    dense->fill_with_value = nullptr;
  }
  for (tp::Constraints& part : set.joined) had |= without(part);
  return had;
}

/// The circle with a function for both that does `misbehave(call)` at its n-th call.
template <class Misbehave>
tp::Constraints spoilt(Misbehave misbehave) {
  tp::Constraints set = on_circle();
  auto& dense = std::get<tp::DenseJacobian>(set.jacobian);
  dense.fill_with_value = [misbehave, n = 0](double, tp::ConstVector y, tp::Vector g,
                                             tp::Matrix C) mutable {
    g[0] = (y[0] * y[0] + y[1] * y[1] - 1.0) / 2.0;
    C(0, 0) = y[0];
    C(0, 1) = y[1];
    return static_cast<int>(misbehave(++n));
  };
  return set;
}

}  // namespace

TEST_CASE("g and C by one function: the same bits, one call for two in every projection") {
  for (const Problem& problem :
       {pendulum(1.0, 1.0, 10.0, "index 1"), pendulum(1e8, 10.0, 1e4, "index 0"),
        car_axis("index 2"), andrews("index 1")}) {
    INFO(problem.name << ", " << problem.form);
    Calls apart, together;
    const tp::Constraints set = problem.recommended_constraints();
    const Run one = integrate(problem, 1e-6, counted(set, false, apart));
    const Run both = integrate(problem, 1e-6, counted(set, true, together));
    REQUIRE(one.flag >= 0);
    CHECK(both.y == one.y);
    CHECK(both.steps == one.steps);
    CHECK(apart.both == 0);
    CHECK(one.statistics.joint_evaluations == 0);
    const auto parts = static_cast<long>(1 + set.joined.size());
    const tp::Statistics& s = both.statistics;
    CHECK(together.both == parts * s.joint_evaluations);
    CHECK(s.joint_evaluations >= s.projections);
    CHECK(together.value + together.both == apart.value);
    CHECK(together.fill + together.both == apart.fill);
    CHECK(together.value <= apart.value - s.projections * parts);
    CHECK(s.value_evaluations == one.statistics.value_evaluations);
    CHECK(s.jacobian_evaluations == one.statistics.jacobian_evaluations);
  }
}

TEST_CASE("g and C by one function: those of the problems have the bits of the others") {
  for (const Problem& problem : {pendulum(1.0, 1.0, 10.0, "index 2"), car_axis("index 1"),
                                 car_axis("GGL"), andrews("index 1")}) {
    INFO(problem.name << ", " << problem.form);
    tp::Constraints alone = problem.recommended_constraints();
    REQUIRE(without(alone));
    CHECK(tp::check_jacobian(problem.recommended_constraints(), problem.t0, problem.y0).correct);
    const Run one = integrate(problem, 1e-5, alone);
    const Run both = integrate(problem, 1e-5, problem.recommended_constraints());
    REQUIRE(one.flag >= 0);
    CHECK(both.y == one.y);
    CHECK(both.statistics.joint_evaluations > 0);
  }
}

TEST_CASE("g and C by one function: beside rows without, and rows by their entries") {
  const Problem problem = tether::test::circle(10.0);
  const tp::Constraints given = spoilt([](int) { return 0; });
  const tp::Constraints line = row(
      "half", [](double, const double* y) { return y[0] * y[0] / 2.0 + y[1] * y[1] / 2.0 - 0.5; },
      [](double, const double* y, double* c) {
        c[0] = y[0];
        c[1] = y[1];
      });
  const Run mixed = integrate(problem, 1e-6, given + line, {}, false);
  const Run plain = integrate(problem, 1e-6, on_circle() + line, {}, false);
  REQUIRE(mixed.flag >= 0);
  CHECK(mixed.y == plain.y);
  CHECK(mixed.statistics.joint_evaluations > 0);

  tp::Constraints sparse = on_circle();
  tp::SparseJacobian entries;
  entries.starts = {0, 2};
  entries.columns = {0, 1};
  entries.fill = [](double, tp::ConstVector y, tp::Vector C) { C = y; };
  sparse.jacobian = entries;
  const Run alone = integrate(problem, 1e-6, sparse, {}, false);
  long calls = 0;
  entries.fill_with_value = [&calls](double, tp::ConstVector y, tp::Vector g, tp::Vector C) {
    ++calls;
    g[0] = (y[0] * y[0] + y[1] * y[1] - 1.0) / 2.0;
    C = y;
  };
  sparse.jacobian = entries;
  const Run together = integrate(problem, 1e-6, sparse, {}, false);
  REQUIRE(together.flag >= 0);
  CHECK(together.y == alone.y);
  CHECK(calls == together.statistics.joint_evaluations);
  CHECK(calls >= together.statistics.projections);

  // Behind another row: g begins at their own.
  const tp::Constraints thrice = row(
      "thrice", [](double, const double* y) { return 1.5 * (y[0] * y[0] + y[1] * y[1] - 1.0); },
      [](double, const double* y, double* c) {
        c[0] = 3.0 * y[0];
        c[1] = 3.0 * y[1];
      });
  const Run behind = integrate(problem, 1e-6, thrice + sparse, {}, false);
  entries.fill_with_value = nullptr;
  sparse.jacobian = entries;
  const Run behind_alone = integrate(problem, 1e-6, thrice + sparse, {}, false);
  REQUIRE(behind.flag >= 0);
  CHECK(behind.y == behind_alone.y);
  CHECK(behind.statistics.joint_evaluations > 0);
}

TEST_CASE("g and C by one function: a failure shortens the step or ends the run, by name") {
  const auto end = [](const tp::Constraints& set) {
    Host host(tether::test::circle(20.0), 1e-6);
    host.attach(set);
    const int flag = host.finish();
    return std::make_tuple(flag, host.projection().status(), host.projection().message(),
                           host.projection().statistics());
  };
  const auto [flag, status, message, s] = end(spoilt([](int n) { return n % 60 == 59 ? 1 : 0; }));
  CHECK(flag >= 0);
  CHECK(s.callback_recoverable >= 1);
  const auto [fatal, why, text, t] = end(spoilt([](int n) { return n >= 30 ? -3 : 0; }));
  CHECK(fatal == IDA_NLS_FAIL);
  CHECK(why == tp::Status::callback_fatal);
  CHECK(contains(text, "value with jacobian of circle returned -3"));
  CHECK(t.joint_evaluations == 30);
  const auto [thrown, reason, words, u] = end(spoilt([](int n) {
    if (n >= 30) throw std::runtime_error("the table ends here");
    return 0;
  }));
  CHECK(thrown == IDA_NLS_FAIL);
  CHECK(reason == tp::Status::callback_fatal);
  CHECK(contains(words, "the table ends here"));
  // g that is no number: once, or from the 30th call on.
  const auto without_number = [](int last) {
    tp::Constraints set = on_circle();
    auto& dense = std::get<tp::DenseJacobian>(set.jacobian);
    dense.fill_with_value = [n = 0, last](double, tp::ConstVector y, tp::Vector g,
                                          tp::Matrix C) mutable {
      const bool wrong = ++n >= 30 && n <= last;
      g[0] = wrong ? std::nan("") : (y.squaredNorm() - 1.0) / 2.0;
      C(0, 0) = y[0];
      C(0, 1) = y[1];
      return 0;
    };
    return set;
  };
  const auto [once, fine, none, v] = end(without_number(30));
  CHECK(once >= 0);
  CHECK(v.not_finite == 1);
  const auto [always, cause, told, w] = end(without_number(1 << 30));
  CHECK(always < 0);
  CHECK(cause == tp::Status::not_finite);
  CHECK(contains(told, "g of circle is not finite"));
}

TEST_CASE("check_jacobian: a function for both that differs from value or fill is named") {
  const std::vector<double> y = {0.6, 0.9};
  tp::Constraints set = on_circle();
  auto& dense = std::get<tp::DenseJacobian>(set.jacobian);
  double shift = 0.0, slope = 0.0;
  dense.fill_with_value = [&](double, tp::ConstVector at, tp::Vector g, tp::Matrix C) {
    g[0] = (at.squaredNorm() - 1.0) / 2.0 + shift;
    C(0, 0) = at[0];
    C(0, 1) = at[1] + slope;
  };
  CHECK(tp::check_jacobian(set, 0.0, y).correct);
  shift = 1e-3;
  const tp::JacobianReport value = tp::check_jacobian(set, 0.0, y);
  CHECK_FALSE(value.correct);
  CHECK(value.row == 0);
  CHECK(value.column == -1);
  CHECK(value.given - value.expected == Approx(1e-3));
  CHECK(contains(value.message, "row 0 (circle), g: fill_with_value gives"));
  shift = 0.0;
  slope = -1e-3;
  const tp::JacobianReport entry = tp::check_jacobian(set, 0.0, y);
  CHECK_FALSE(entry.correct);
  CHECK(entry.column == 1);
  CHECK(contains(entry.message, "column 1: fill_with_value gives"));
}

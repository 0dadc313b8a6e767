// Tether: every knob does what it says, and bad values are refused by name.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <nvector/nvector_serial.h>
#include <problems/pendulum.hpp>
#include <utility>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"
#include "support/comma_locale.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

/// The text with which the option is refused; it must leave IDA usable.
std::string refusal(const tp::Options& options, tp::Constraints set = on_circle()) {
  Host host(tether::test::circle(1.0), 1e-6);
  const std::string text = thrown([&] { host.attach(std::move(set), options); });
  CHECK(host.finish() >= 0);
  return text;
}

template <class Change>
std::string refusal_of(Change change) {
  tp::Options options;
  change(options);
  return refusal(options);
}

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

}  // namespace

TEST_CASE("bad values: the message names the option and the value") {
  const auto check = [](const std::string& text, const std::string& name,
                        const std::string& value) {
    INFO(text);
    CHECK(contains(text, name));
    CHECK(contains(text, value));
  };
  using O = tp::Options;
  check(refusal_of([](O& o) { o.advanced.tolerance = -1e-3; }), "tolerance", "= -0.001;");
  check(refusal_of([](O& o) { o.advanced.tolerance = -1e-12; }), "tolerance", "= -1e-12;");
  check(refusal_of([](O& o) { o.advanced.tolerance = 0.0; }), "tolerance", "= 0;");
  check(refusal_of([](O& o) { o.advanced.tolerance = kNaN; }), "tolerance", "nan");
  check(refusal_of([](O& o) { o.advanced.maximum_iterations = 0; }), "maximum_iterations", "0");
  check(refusal_of([](O& o) { o.advanced.largest_move = 0.0; }), "largest_move", "= 0;");
  check(refusal_of([](O& o) { o.advanced.largest_move = 0.001; }), "largest_move", "0.001");
  check(refusal_of([](O& o) { o.advanced.largest_move = kNaN; }), "largest_move", "nan");
  check(refusal_of([](O& o) { o.advanced.polish = static_cast<tp::Polished>(3); }), "polish", "3");
  check(refusal_of([](O& o) { o.advanced.maximum_step = -0.5; }), "maximum_step", "-0.5");
  check(refusal_of([](O& o) { o.advanced.maximum_order = 6; }), "maximum_order", "6");
  check(refusal_of([](O& o) { o.hold = {true, false, false}; }), "hold", "3 entries for 2");
  check(refusal_of([](O& o) { o.advanced.metric = static_cast<tp::Metric>(99); }), "metric", "99");
  check(refusal_of([](O& o) { o.advanced.long_move = static_cast<tp::LongMove>(-1); }), "long_move",
        "-1");
  check(refusal_of([](O& o) { o.group = {0}; }), "group", "1 entries for 2");
}

TEST_CASE("bad groups are refused") {
  const std::string text = refusal_of([](tp::Options& o) { o.group = {0, -2}; });
  INFO(text);
  CHECK(contains(text, "group"));
  CHECK(contains(text, "-2"));
}

TEST_CASE("bad vectors: id and hold_vector") {
  Host host(tether::test::circle(1.0), 1e-6);
  tp::Options options;
  options.id = host.vector({1.0, 1.0, 0.0});
  CHECK(contains(refusal(options), "options.id"));
  options.id = host.vector({1.0, 0.5});
  CHECK(contains(refusal(options), "options.id[1] = 0.5"));
  options.id = nullptr;
  options.advanced.hold_vector = host.vector({1.0});
  CHECK(contains(refusal(options), "hold_vector"));
}

TEST_CASE("bad constraints are refused by name") {
  tp::Constraints set = on_circle();
  set.count = -1;
  set.names.clear();
  CHECK(contains(refusal({}, set), "constraints.count = -1"));
  set.count = 100000000;
  CHECK(contains(refusal({}, set), "constraints.count = 100000000; it must be at most 1000"));
  set = on_circle();
  set.names = {"a", "b"};
  CHECK(contains(refusal({}, set), "names has 2 entries for 1"));
  set = on_circle();
  set.value = nullptr;
  CHECK(contains(refusal({}, set), "constraints.value"));
  set = on_circle();
  set.jacobian = tp::DenseJacobian{};
  CHECK(contains(refusal({}, set), "DenseJacobian"));
  set.jacobian = tp::Gradients{};
  CHECK(contains(refusal({}, set), "Gradients"));
  set.jacobian = tp::UserProjection{};
  CHECK(contains(refusal({}, set), "UserProjection"));
}

TEST_CASE("hold: a held component is never moved") {
  // z follows x^2 in the equations; x is held, so only z may move.
  const Problem problem = ode({0.5, 0.25, 0.0}, 10.0, [](double t, const double* y, double* f) {
    f[0] = std::cos(t);
    f[1] = 2.0 * y[0] * f[0];
    f[2] = y[1];
  });
  for (const bool by_vector : {false, true}) {
    double t_last = -1.0, x_last = 0.0, z_last = 0.0;
    bool x_moved = false, z_moved = false;
    const tp::Constraints parabola = row(
        "parabola",
        [&](double t, const double* y) {
          // Calls at the same time belong to one attempt: before and after a move.
          if (t == t_last) {
            x_moved = x_moved || y[0] != x_last;
            z_moved = z_moved || y[1] != z_last;
          }
          t_last = t;
          x_last = y[0];
          z_last = y[1];
          return y[1] - y[0] * y[0];
        },
        [](double, const double* y, double* c) {
          c[0] = -2.0 * y[0];
          c[1] = 1.0;
        });
    tp::Options options;
    options.advanced.polish = tp::Polished::none;
    options.advanced.tolerance = 1e-12;  // makes it look twice
    Host host(problem, 1e-5);
    if (by_vector)
      options.advanced.hold_vector = host.vector({0.0, 1.0, 1.0});
    else
      options.hold = {true, false, false};
    host.attach(parabola, options);
    REQUIRE(host.finish() >= 0);
    CHECK_FALSE(x_moved);
    CHECK(z_moved);
    CHECK(host.projection().statistics().projections > 20);

    x_moved = false;
    Host free(problem, 1e-5);
    options.hold.clear();
    options.advanced.hold_vector = nullptr;
    free.attach(parabola, options);
    REQUIRE(free.finish() >= 0);
    CHECK(x_moved);  // without the mask it would have been
  }
}

TEST_CASE("largest_move: a start too far away is rejected, or approached in capped moves") {
  Problem far = tether::test::circle(20.0);
  far.y0 = {1.0 + 1e-4, 0.0};  // about 35 tolerances at 1e-6
  far.yp0 = {0.0, 1.0 + 1e-4};
  {
    Host host(far, 1e-6);
    host.attach(on_circle());
    CHECK(host.finish() < 0);
    CHECK(host.projection().status() == tp::Status::move_too_long);
    CHECK(contains(host.projection().message(), "largest_move"));
    CHECK(host.projection().statistics().move_too_long > 0);
    CHECK(host.projection().statistics().solver_calls <= 40);
    CHECK(host.steps() == 0);
  }
  {
    tp::Options options;
    options.advanced.long_move = tp::LongMove::cap;
    options.advanced.largest_move = 0.5;
    Problem near = far;
    near.y0 = {1.0 + 1e-5, 0.0};
    near.yp0 = {0.0, 1.0 + 1e-5};
    Host host(near, 1e-6);
    host.attach(on_circle(), options);
    REQUIRE(host.step() >= 0);
    const std::vector<double> y = host.state();
    CHECK(std::hypot(y[0], y[1]) - 1.0 > 1e-6);  // a part of the way, no more
    for (int i = 0; i < 2; ++i) CHECK(host.step() >= 0);
    const tp::Statistics s = host.projection().statistics();
    CHECK(s.moves_capped >= 1);
    CHECK(s.move_too_long == 0);
    CHECK(s.largest_move >= 0.5);  // the limit grows with the corrector's own change
  }
  {
    tp::Options options;
    options.advanced.largest_move = 1e6;  // one jump is allowed, but IDA's error test must like it
    Host host(far, 1e-3);
    host.attach(on_circle(), options);
    REQUIRE(host.finish() >= 0);
    CHECK(host.projection().statistics().failures() == 0);
  }
}

TEST_CASE("messages and counts are the same in a host whose numbers have a comma") {
  Problem far = tether::test::circle(20.0);
  far.y0 = {1.0 + 1e-4, 0.0};
  far.yp0 = {0.0, 1.0 + 1e-4};
  const auto said = [&] {
    std::string all;
    Host host(far, 1e-6);
    host.attach(on_circle());
    host.finish();
    all += host.projection().message() + "\n";
    tp::Statistics long_run;
    long_run.projections = 1234567;
    long_run.largest_move = 0.25;
    all += long_run.table() + "\n";
    tp::Constraints wrong = on_circle();
    wrong.jacobian = tp::DenseJacobian(
        [](double, tp::ConstVector y, tp::Matrix C) { C.row(0) = 1.25 * y.transpose(); });
    const std::vector<double> y = {0.6, 0.8};
    all += tp::check_jacobian(wrong, 0.5, y).message + "\n";
    wrong.value = [](double, tp::ConstVector, tp::Vector g) { g[0] = kNaN; };
    Host none(far, 1e-6);
    none.attach(wrong);
    none.finish();
    all += none.projection().message() + "\n";
    all += thrown([&] { tp::check_jacobian(on_circle(), 0.5, y, -0.5); }) + "\n";
    tp::Options options;
    options.id = host.vector({1.0, 0.5});
    all += thrown([&] { host.attach(on_circle(), options); });
    return all;
  };
  const std::string plain = said();
  INFO(plain);
  for (const char* part : {"35.3518 tolerances long, the limit is 10 ", "= 1234567\n",
                           "2.500000e-01", "given 1, differences give 0.8",
                           "is not finite at t = 2.", "tolerance = -0.5;", "[1] = 0.5;"})
    CHECK_THAT(plain, Catch::Contains(part));
  const CommaLocale here;
  CHECK(said() == plain);
  if (!here.of_c()) WARN("in part: C has no locale with a decimal comma here");
}

TEST_CASE("polish = none: no residual is evaluated beside IDA's") {
  tp::Options options;
  options.advanced.polish = tp::Polished::none;
  options.advanced.smooth_where_needed = false;  // it evaluates F once
  Host host(tether::test::circle(5.0), 1e-6);
  options.id = host.vector({1.0, 1.0});
  host.attach(on_circle(), options);
  REQUIRE(host.finish() >= 0);
  const tp::Statistics s = host.projection().statistics();
  CHECK(s.projections > 10);
  CHECK(s.extra_iterations == 0);
  CHECK(s.refreshes == 0);
  CHECK(s.residual_evaluations == 0);
}

TEST_CASE("capped moves that fall behind are failures of the step, not silent drift") {
  const Problem problem = pendulum(1.0, 1.0, 30.0, "index 1");
  tp::Options options;
  options.advanced.long_move = tp::LongMove::cap;
  options.advanced.largest_move = 0.1;
  long behind = 0;
  for (const double tolerance : {1e-4, 1e-6}) {
    const Run run = integrate(problem, tolerance, problem.recommended_constraints(), options);
    INFO("tolerance " << tolerance);
    REQUIRE(run.flag >= 0);
    CHECK(run.statistics.moves_capped > 0);
    behind += run.statistics.move_too_long;
    CHECK(run.distance <= 1.5);
    CHECK(run.error <= 30.0 * tolerance);
  }
  CHECK(behind > 0);
}

TEST_CASE("tolerance: what is asked for is what is left") {
  const Problem problem = pendulum(1.0, 1.0, 20.0, "index 1");
  const tp::Constraints rows = problem.recommended_constraints();
  for (const double tolerance : {1e-1, 1e-2, 1e-4, 1e-7}) {
    tp::Options options;
    options.advanced.tolerance = tolerance;
    const Run run = integrate(problem, 1e-5, rows, options);
    INFO("tolerance " << tolerance);
    REQUIRE(run.flag >= 0);
    CHECK(run.distance <= std::max(tolerance, 1e-6));  // checked now and then, not at every step
  }
}

TEST_CASE("maximum_iterations = 1 with a tight tolerance fails by name, not silently") {
  const Problem problem = pendulum(1.0, 1.0, 20.0, "index 1");
  tp::Options options;
  options.advanced.maximum_iterations = 1;
  options.advanced.tolerance = 1e-13;
  Host host(problem, 1e-3);
  IDASetMaxNumSteps(host.ida, 1000);
  host.attach(problem.recommended_constraints(), options);
  for (int i = 0; i < 50 && host.step() >= 0;) ++i;
  CHECK(host.projection().statistics().not_converged > 0);
}

TEST_CASE("a wrong Jacobian is noticed while projecting") {
  tp::Constraints wrong = on_circle();
  wrong.jacobian = tp::DenseJacobian([](double, tp::ConstVector y, tp::Matrix C) {
    C(0, 0) = y[1];  // turned by a right angle: moves along the circle
    C(0, 1) = -y[0];
  });
  Host host(tether::test::circle(20.0), 1e-6);
  host.attach(wrong);
  CHECK(host.finish() < 0);
  CHECK(host.projection().statistics().failures() > 0);
  CHECK_FALSE(host.projection().message().empty());
}

TEST_CASE("groups: a point's components share one scale") {
  // Two points on spheres; with a group for each, the motion keeps its rotational symmetry.
  const Problem problem = pendulum(1.0, 1.0, 20.0, "index 1");
  tp::Options options;
  options.group = {0, 0, 1, 1, -1};
  const Run run = integrate(problem, 1e-6, problem.recommended_constraints(), options);
  const Run without = integrate(problem, 1e-6, problem.recommended_constraints());
  REQUIRE(run.flag >= 0);
  CHECK(run.distance <= tp::Options().advanced.tolerance);
  CHECK(run.error < 2e-5);
  CHECK_FALSE(same_bits(run.y, without.y));
}

TEST_CASE("treatment of algebraic variables") {
  const Problem problem = pendulum(1.0, 1.0, 30.0, "index 1");
  const tp::Constraints rows = problem.recommended_constraints();
  const auto run = [&](auto change) {
    tp::Options options;
    change(options);
    return integrate(problem, 1e-7, rows, options, false);
  };
  const Run derived = run([](tp::Options&) {});
  double ratios = 0.0;  // of steps, to those with every variable in the error test
  for (int k = 0; k < 8; ++k) {
    const double tolerance = 1e-5 * std::pow(10.0, -k / 3.0);
    tp::Options tested;
    tested.suppress_algebraic = false;
    ratios += std::log(static_cast<double>(integrate(problem, tolerance, rows).steps) /
                       static_cast<double>(integrate(problem, tolerance, rows, tested).steps));
  }
  CHECK(ratios <= 0.0);
  const Run stale = run([](tp::Options& o) { o.advanced.polish = tp::Polished::differential; });
  for (const Run* r : {&derived, &stale}) REQUIRE(r->flag >= 0);
  CHECK(derived.statistics.refreshes > 0);
  CHECK(stale.statistics.refreshes == 0);
  // The multiplier belongs to the moved point only when it is refreshed.
  Host given(problem, 1e-7);
  tp::Options options;
  options.id = given.vector(problem.id);
  given.attach(rows, options);
  REQUIRE(given.finish() >= 0);
  CHECK(same_bits(given.state(), derived.y));  // the derived id is the right one
}

TEST_CASE("an algebraic variable answers the move: its equation holds where the step ends") {
  const Problem problem = pendulum(1.0, 1.0, 30.0, "index 1");
  struct Left {
    double square = 0.0, largest = 0.0;  // of lam - (v^2 - g y) at the ends of steps
  };
  const auto left = [&](bool refresh) {
    tp::Options options;
    options.advanced.polish = refresh ? tp::Polished::all : tp::Polished::differential;
    Host host(problem, 1e-7);
    host.attach(problem.select({"position", "velocity"}), options);
    Left out;
    long steps = 0;
    for (; host.t < problem.t_end; ++steps) {
      const long answers = host.projection().statistics().refreshes;
      REQUIRE(host.step() >= 0);
      const double* y = host.data();
      const double each = std::abs(y[4] - (y[2] * y[2] + y[3] * y[3] - y[1]));
      out.square += each * each;
      if (host.projection().statistics().refreshes > answers)
        out.largest = std::max(out.largest, each);
    }
    out.square = std::sqrt(out.square / static_cast<double>(steps));
    return out;
  };
  // IDA's own scaling of linear solutions, 2 / (1 + cj / cj_at_setup), would leave a part of it.
  const Left with = left(true), without = left(false);
  CHECK(with.square < 0.2 * without.square);
  CHECK(with.largest < 0.75 * without.square);
}

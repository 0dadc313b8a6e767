// Tether: constraint functions that fail, and projections written by the caller.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <limits>
#include <nvector/nvector_serial.h>
#include <stdexcept>
#include <string>
#include <vector>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// on_circle() whose value does `misbehave(call, g)` at its n-th call; a non-zero int is returned.
template <class Misbehave>
tp::Constraints spoilt(Misbehave misbehave) {
  tp::Constraints set = on_circle();
  set.value = [misbehave, n = 0](double, tp::ConstVector y, tp::Vector g) mutable {
    g[0] = (y.squaredNorm() - 1.0) / 2.0;
    return static_cast<int>(misbehave(++n, g));
  };
  return set;
}

struct Ended {
  int flag;
  tp::Status status;
  std::string message;
  tp::Statistics statistics;
  long steps;
  double error;
};

Ended run(const tp::Constraints& set) {
  Host host(tether::test::circle(20.0), 1e-6);
  host.attach(set);
  const int flag = host.finish();
  return {flag,
          host.projection().status(),
          host.projection().message(),
          host.projection().statistics(),
          host.steps(),
          host.error()};
}

}  // namespace

TEST_CASE("a recoverable failure now and then costs a step, not the run") {
  const Ended clean = run(on_circle());
  const Ended end = run(spoilt([](int n, tp::Vector) { return n % 60 == 59 ? 1 : 0; }));
  REQUIRE(end.flag >= 0);
  CHECK(end.status == tp::Status::success);
  CHECK(end.message.empty());
  CHECK(end.statistics.callback_recoverable >= 2);
  CHECK(end.statistics.failures() == end.statistics.callback_recoverable);
  CHECK(end.error < 2e-5);
  CHECK(end.steps < clean.steps + 30 * end.statistics.callback_recoverable);
}

TEST_CASE("a recoverable failure at every call ends in IDA's convergence failure") {
  const Ended end = run(spoilt([](int, tp::Vector) { return 1; }));
  CHECK(end.flag < 0);
  CHECK(end.steps == 0);
  CHECK(end.status == tp::Status::callback_recoverable);
  CHECK(contains(end.message, "circle"));
  CHECK(contains(end.message, "returned 1"));
  CHECK(end.statistics.callback_recoverable <= 20);
}

TEST_CASE("a fatal failure ends the run at once") {
  const Ended end = run(spoilt([](int n, tp::Vector) { return n >= 30 ? -3 : 0; }));
  CHECK(end.flag == IDA_NLS_FAIL);
  CHECK(end.status == tp::Status::callback_fatal);
  CHECK(contains(end.message, "circle"));
  CHECK(contains(end.message, "returned -3"));
  CHECK(end.statistics.callback_fatal == 1);
  CHECK(end.statistics.value_evaluations == 30);
}

TEST_CASE("an exception does not pass through IDA") {
  const Ended end = run(spoilt([](int n, tp::Vector) -> int {
    if (n >= 30) throw std::runtime_error("the table ends here");
    return 0;
  }));
  CHECK(end.flag == IDA_NLS_FAIL);
  CHECK(end.status == tp::Status::callback_fatal);
  CHECK(contains(end.message, "the table ends here"));
  CHECK(end.statistics.value_evaluations == 30);

  const Ended odd = run(spoilt([](int n, tp::Vector) -> int {
    if (n >= 30) throw 42;
    return 0;
  }));
  CHECK(odd.flag == IDA_NLS_FAIL);
  CHECK(odd.status == tp::Status::callback_fatal);
}

TEST_CASE("an exception without text is an exception") {
  struct Mute : std::exception {
    const char* what() const noexcept override { return nullptr; }
  };
  const Ended end = run(spoilt([](int n, tp::Vector) -> int {
    if (n >= 30) throw Mute();
    return 0;
  }));
  CHECK(end.flag == IDA_NLS_FAIL);
  CHECK(end.status == tp::Status::callback_fatal);
  CHECK(contains(end.message, "what() is null"));
  const Ended empty = run(spoilt([](int n, tp::Vector) {
    if (n == 20) throw std::runtime_error("");
    return 0;
  }));
  CHECK(contains(empty.message, "threw: an exception without text"));
  const Ended number = run(spoilt([](int n, tp::Vector) {
    if (n == 20) throw 5;
    return 0;
  }));
  CHECK(number.flag < 0);
  CHECK(contains(number.message, "threw: what is no std::exception"));
}

TEST_CASE("rows that write past their count end the run by name") {
  tp::Constraints too_many = on_circle();
  too_many.names = {"too many"};
  too_many.value = [](double, tp::ConstVector y, tp::Vector g) {
    for (int i = 0; i < 3; ++i) g.data()[i] = (y.squaredNorm() - 1.0) / 2.0;
  };
  tp::Constraints by_differences = too_many;
  by_differences.jacobian = tp::FiniteDifferences();
  tp::Constraints in_C = on_circle();
  in_C.names = {"too many"};
  in_C.jacobian = tp::DenseJacobian([](double, tp::ConstVector y, tp::Matrix C) {
    for (int k = 0; k < 4; ++k) C.data()[k] = y[k % 2];
  });
  tp::Constraints entries = on_circle();
  entries.names = {"too many"};
  tp::SparseJacobian sparse{{0, 2}, {0, 1}, {}, {}};
  sparse.fill = [](double, tp::ConstVector y, tp::Vector values) {
    for (int k = 0; k < 4; ++k) values.data()[k] = y[k % 2];
  };
  entries.jacobian = sparse;
  for (const tp::Constraints& set : {too_many, by_differences, in_C, entries})
    for (const tp::Constraints& rows : {set, set + on_circle(), on_circle() + set}) {
      const Ended end = run(rows);
      CHECK(end.flag == IDA_NLS_FAIL);
      CHECK(end.status == tp::Status::callback_fatal);
      CHECK(contains(end.message, "too many writes past its end: Constraints::count is 1"));
      CHECK(contains(thrown([&] {
                       tp::check_jacobian(rows, 0.0, std::vector<double>{1.0, 0.0});
                     }),
                     "writes past its end"));
    }
}

TEST_CASE("rows that write past their count later in the run end it by name, too") {
  tp::Constraints set;
  set.count = 1;
  int calls = 0;
  set.value = [&calls](double, tp::ConstVector y, tp::Vector g) {
    const double too_many = (y.squaredNorm() - 1.0) / 2.0;
    g.data()[0] = too_many;
    if (++calls > 20) g.data()[1] = too_many;
  };
  const Ended end = run(set);
  CHECK(end.status == tp::Status::callback_fatal);
  CHECK(contains(end.message, "writes past its end: Constraints::count is 1"));
}

TEST_CASE("gradients that write past their count end the run by name") {
  tp::Constraints set;
  set.count = 1;
  tp::Gradients gradients;
  gradients.value = [](double, N_Vector y, double* g) {
    for (int i = 0; i < 3; ++i) g[i] = (N_VDotProd(y, y) - 1.0) / 2.0;
  };
  gradients.fill = [](double, N_Vector y, N_Vector* rows) { N_VScale(1.0, y, rows[0]); };
  set.jacobian = gradients;
  const Ended end = run(set);
  CHECK(end.flag == IDA_NLS_FAIL);
  CHECK(end.status == tp::Status::callback_fatal);
  CHECK(contains(end.message, "writes past its end: Constraints::count is 1"));
}

namespace {

// (cos t, sin t, 1)
Problem circle_beside_z() {
  return ode({1.0, 0.0, 1.0}, 12.0, [](double, const double* y, double* f) {
    f[0] = -y[1];
    f[1] = y[0];
    f[2] = 0.0;
  });
}

}  // namespace

TEST_CASE("rows that leave g and C alone while they are off: the steps without them") {
  tp::Constraints dense;
  dense.count = 1;
  dense.value = [](double t, tp::ConstVector y, tp::Vector g) {
    if (t > 100.0) g[0] = y[2] - 1.0;
  };
  dense.jacobian = tp::DenseJacobian([](double t, tp::ConstVector, tp::Matrix C) {
    if (t > 100.0) C(0, 2) = 1.0;
  });
  tp::Constraints differences = dense;
  differences.jacobian = tp::FiniteDifferences();
  const Run without = integrate(circle_beside_z(), 1e-6, on_circle());
  for (const tp::Constraints& off : {dense, differences})
    for (const tp::Constraints& rows : {on_circle() + off, off + on_circle()}) {
      const Run run = integrate(circle_beside_z(), 1e-6, rows, {}, false);
      INFO(run.message);
      REQUIRE(run.flag >= 0);
      CHECK(run.steps == without.steps);
      CHECK(run.y[2] == 1.0);
    }
}

TEST_CASE("gradients that leave g alone while they are off") {
  const auto along = [](bool z) {
    tp::Gradients gradients;
    gradients.value = [z](double, N_Vector y, double* g) {
      const double* x = N_VGetArrayPointer(y);
      if (!z) g[0] = (x[0] * x[0] + x[1] * x[1] - 1.0) / 2.0;
    };
    gradients.fill = [z](double, N_Vector y, N_Vector* rows) {
      const double* x = N_VGetArrayPointer(y);
      double* C = N_VGetArrayPointer(rows[0]);
      for (int j = 0; j < 3; ++j) C[j] = j == 2 ? z : z ? 0.0 : x[j];
    };
    tp::Constraints set;
    set.count = 1;
    set.jacobian = gradients;
    return set;
  };
  const Run run = integrate(circle_beside_z(), 1e-6, along(false) + along(true), {}, false);
  INFO(run.message);
  REQUIRE(run.flag >= 0);
  CHECK(run.y[2] == 1.0);
}

TEST_CASE("calls of the plugin from its own callbacks are refused by name") {
  Host host(tether::test::circle(20.0), 1e-6);
  int calls = 0;
  std::vector<tp::ConsistencyReport> reports;
  std::vector<int> flags;
  tp::Constraints set = on_circle();
  set.value = [&](double t, tp::ConstVector y, tp::Vector g) {
    if (++calls == 20) {
      tp::Projection& projection = host.projection();
      reports.push_back(projection.make_consistent(t, host.y, host.yp));
      reports.push_back(projection.project(t, host.y, host.yp));
      flags.push_back(projection.solve(30.0, &host.t, host.y, host.yp, IDA_NORMAL));
    }
    g[0] = (y.squaredNorm() - 1.0) / 2.0;
  };
  host.attach(set);
  CHECK(host.finish() >= 0);
  REQUIRE(reports.size() == 2);
  for (const tp::ConsistencyReport& report : reports) {
    CHECK(report.status == tp::Status::misused);
    CHECK(contains(report.message, "between the steps"));
  }
  CHECK(flags == std::vector<int>{IDA_ILL_INPUT});
  CHECK(host.projection().status() == tp::Status::success);
  CHECK(host.error() < 2e-5);

  calls = 17;  // in make_consistent itself
  reports.clear();
  CHECK(host.projection().make_consistent(0.0, host.y, host.yp));
  REQUIRE(reports.size() == 2);
  CHECK(reports.front().status == tp::Status::misused);
}

TEST_CASE("IDASolve from a callback of IDASolve ends the run by name") {
  Host host(tether::test::circle(20.0), 1e-6);
  int calls = 0, inner = 0;
  tp::Constraints set = on_circle();
  set.value = [&](double, tp::ConstVector y, tp::Vector g) {
    if (++calls == 20) inner = IDASolve(host.ida, 30.0, &host.t, host.y, host.yp, IDA_NORMAL);
    g[0] = (y.squaredNorm() - 1.0) / 2.0;
  };
  tp::Options silent;
  silent.print = false;
  host.attach(set, silent);
  host.finish();
  CHECK(inner < 0);
}

TEST_CASE("a Jacobian that fails or throws") {
  tp::Constraints set = on_circle();
  set.jacobian = tp::DenseJacobian([n = 0](double, tp::ConstVector y, tp::Matrix C) mutable {
    C.row(0) = y.transpose();
    return ++n == 25 ? 1 : 0;
  });
  const Ended once = run(set);
  REQUIRE(once.flag >= 0);
  CHECK(once.statistics.callback_recoverable == 1);

  set.jacobian = tp::DenseJacobian(
      [](double, tp::ConstVector, tp::Matrix) -> int { throw std::logic_error("no derivative"); });
  const Ended thrown_out = run(set);
  CHECK(thrown_out.flag == IDA_NLS_FAIL);
  CHECK(thrown_out.status == tp::Status::callback_fatal);
  CHECK(contains(thrown_out.message, "no derivative"));
}

TEST_CASE("NaN once: the step is tried again; NaN always: refused by name") {
  const Ended once = run(spoilt([](int n, tp::Vector g) {
    if (n == 40) g[0] = kNaN;
    return 0;
  }));
  REQUIRE(once.flag >= 0);
  CHECK(once.statistics.not_finite == 1);
  CHECK(once.statistics.failures() == 1);
  CHECK(once.error < 2e-5);

  const Ended always = run(spoilt([](int, tp::Vector g) {
    g[0] = kNaN;
    return 0;
  }));
  CHECK(always.flag < 0);
  CHECK(always.status == tp::Status::not_finite);
  CHECK(contains(always.message, "circle"));
  CHECK(always.steps == 0);

  const Ended infinite = run(spoilt([](int n, tp::Vector g) {
    if (n > 40) g[0] = std::numeric_limits<double>::infinity();
    return 0;
  }));
  CHECK(infinite.flag < 0);
  CHECK(infinite.status == tp::Status::not_finite);
}

TEST_CASE("NaN in the Jacobian") {
  tp::Constraints set = on_circle();
  set.jacobian = tp::DenseJacobian([n = 0](double, tp::ConstVector y, tp::Matrix C) mutable {
    C.row(0) = y.transpose();
    if (++n == 25) C(0, 1) = kNaN;
  });
  const Ended once = run(set);
  REQUIRE(once.flag >= 0);
  CHECK(once.statistics.not_finite == 1);

  set.jacobian =
      tp::DenseJacobian([](double, tp::ConstVector, tp::Matrix C) { C.setConstant(kNaN); });
  const Ended always = run(set);
  CHECK(always.flag < 0);
  CHECK(always.status == tp::Status::not_finite);
  CHECK_FALSE(always.message.empty());
}

TEST_CASE("differences: the same motion as with the Jacobian written out") {
  tp::Constraints set = on_circle();
  set.jacobian = tp::FiniteDifferences{};
  const Ended differences = run(set), given = run(on_circle());
  REQUIRE(differences.flag >= 0);
  CHECK(std::abs(differences.error - given.error) < 1e-8);
  CHECK(std::abs(differences.steps - given.steps) <= 3);
  CHECK(differences.statistics.failures() == 0);
  // N + 1 evaluations for each C and one for g.
  CHECK(differences.statistics.value_evaluations <= 6 * differences.statistics.projections);
}

namespace {

/// Radial projection in CVProjFn's shape, with a record of how it was called.
struct Record {
  long calls = 0;
  int fail_at = 0, answer = 0;
  double eps = 0.0, largest_error = 0.0, largest_change_on_entry = 0.0;
};

int radial(sunrealtype, N_Vector y, N_Vector corr, sunrealtype eps, N_Vector err, void* data) {
  auto& record = *static_cast<Record*>(data);
  if (++record.calls == record.fail_at || (record.fail_at < 0 && record.calls >= -record.fail_at)) {
    if (record.answer == 99) throw std::runtime_error("projection gave up");
    return record.answer;
  }
  record.eps = eps;
  const double* p = N_VGetArrayPointer(y);
  const double r = std::hypot(p[0], p[1]);
  for (int i = 0; i < 2; ++i) {
    record.largest_change_on_entry =
        std::max(record.largest_change_on_entry, std::abs(N_VGetArrayPointer(corr)[i]));
    record.largest_error = std::max(record.largest_error, std::abs(N_VGetArrayPointer(err)[i]));
    N_VGetArrayPointer(corr)[i] = p[i] * (1.0 / r - 1.0);
  }
  N_VConst(1e30, err);  // ignored
  return 0;
}

tp::Constraints by_user(Record& record) {
  tp::Constraints set;
  set.count = 1;
  set.jacobian = tp::UserProjection{radial, &record};
  return set;
}

}  // namespace

TEST_CASE("a projection written by the caller") {
  Record record;
  const tether::problems::Problem problem = tether::test::circle(20.0);
  const Run run = integrate(problem, 1e-6, by_user(record), {}, false);
  tp::Options options;
  options.advanced.metric =
      tp::Metric::error_weights;  // the nearest point, as the radial projection
  const Run ours = integrate(problem, 1e-6, on_circle(), options, false);
  REQUIRE(run.flag >= 0);
  CHECK(record.calls >= run.steps);
  CHECK(record.calls == run.statistics.value_evaluations);
  CHECK(record.eps == tp::Options().advanced.tolerance);
  CHECK(record.largest_change_on_entry == 0.0);
  CHECK(record.largest_error > 0.0);  // a copy of the corrector's change
  CHECK(record.largest_error < 1e-2);
  CHECK(run.error < 1e-5);
  CHECK(std::abs(run.steps - ours.steps) < 0.3 * static_cast<double>(ours.steps));
  CHECK(std::abs(std::hypot(run.y[0], run.y[1]) - 1.0) < 1e-7);  // interpolated to t_end
}

TEST_CASE("a caller's projection that fails") {
  const tether::problems::Problem problem = tether::test::circle(20.0);
  Record now_and_then;
  now_and_then.fail_at = 40;
  now_and_then.answer = 1;
  const Run once = integrate(problem, 1e-6, by_user(now_and_then), {}, false);
  REQUIRE(once.flag >= 0);
  CHECK(once.statistics.callback_recoverable == 1);

  Record fatal;
  fatal.fail_at = -40;
  fatal.answer = -1;
  const Run ended = integrate(problem, 1e-6, by_user(fatal), {}, false);
  CHECK(ended.flag == IDA_NLS_FAIL);
  CHECK(ended.status == tp::Status::callback_fatal);
  CHECK(fatal.calls == 40);

  Record thrower;
  thrower.fail_at = -40;
  thrower.answer = 99;
  const Run thrown_out = integrate(problem, 1e-6, by_user(thrower), {}, false);
  CHECK(thrown_out.flag == IDA_NLS_FAIL);
  CHECK(contains(thrown_out.message, "projection gave up"));
}

TEST_CASE("progress: every accepted step, in order, and harmless when it throws") {
  {
    std::vector<tp::Progress> reports;
    tp::Options options;
    options.progress = [&](const tp::Progress& p) { reports.push_back(p); };
    const Run run = integrate(tether::test::circle(20.0), 1e-6, on_circle(), options, false);
    REQUIRE(run.flag >= 0);
    const long projected = run.statistics.projections;
    CHECK(static_cast<long>(reports.size()) >= projected - 20);
    CHECK(static_cast<long>(reports.size()) <= projected);
    for (std::size_t k = 0; k < reports.size(); ++k) {
      const tp::Progress& p = reports[k];
      if (k > 0) {
        CHECK(p.t > reports[k - 1].t);
        CHECK(p.steps >= reports[k - 1].steps + 1);
      }
      CHECK(p.order >= 1);
      CHECK(p.order <= 5);
      CHECK(p.step > 0.0);
      CHECK(p.move <= run.statistics.largest_move);
      CHECK(p.drift <= run.statistics.largest_drift_before);
    }
  }
  tp::Options options;
  options.progress = [](const tp::Progress&) { throw std::runtime_error("display gone"); };
  const Run run = integrate(tether::test::circle(20.0), 1e-6, on_circle(), options, false);
  CHECK(run.flag >= 0);
}

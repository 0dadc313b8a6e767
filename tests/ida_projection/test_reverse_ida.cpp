// Tether: IDA by reverse communication gives the bits of IDA with callbacks.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <problems/pendulum.hpp>
#include <stdexcept>
#include <string>
#include <tether/linalg/small_lu.hpp>
#include <tether/reverse_ida.h>
#include <tether/reverse_ida.hpp>
#include <utility>
#include <vector>

#include "host.hpp"
#include "linalg/allocations.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;
namespace tr = tether::reverse_ida;
using tether::problems::pendulum;
using tr::Linear;
using tr::Request;

namespace {

tr::Equations equations_of(const Problem& problem, double tolerance, Linear linear,
                           bool projected) {
  tr::Equations e;
  e.t0 = problem.t0;
  e.y = problem.y0;
  e.yp = problem.yp0;
  e.rtol = tolerance;
  e.atol = {tolerance};
  e.linear = linear;
  e.options.print = false;
  if (projected) e.constraints = problem.recommended_constraints().total_count();
  return e;
}

/// A program that answers all requests from a problem.
class Program {
 public:
  explicit Program(const Problem& problem)
      : problem_(problem), rows_(problem.recommended_constraints()) {}

  int answer(tr::ReverseIda& ida) {
    ++requests;
    const int n = problem_.size;
    switch (ida.request()) {
      case Request::residual:
        problem_.residual(ida.t(), ida.y(), ida.yp(), ida.result());
        return 0;
      case Request::jacobian:
        problem_.jacobian(ida.t(), ida.cj(), ida.y(), ida.yp(), ida.result());
        return 0;
      case Request::setup:
        factors_.assign(static_cast<std::size_t>(n * n), 0.0);
        problem_.jacobian(ida.t(), ida.cj(), ida.y(), ida.yp(), factors_.data());
        return lu_.factor(factors_.data(), n);
      case Request::solve:
        lu_.solve(factors_.data(), ida.rhs(), ida.result());
        return 0;
      case Request::constraints: {
        const Eigen::VectorXd g = value(rows_, ida.t(), ida.y(), n);
        std::copy(g.data(), g.data() + g.size(), ida.result());
        return 0;
      }
      case Request::constraint_jacobian: {
        const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> C =
            jacobian(rows_, ida.t(), ida.y(), n);
        std::copy(C.data(), C.data() + C.size(), ida.result());
        return 0;
      }
      default:
        throw std::logic_error("nothing was asked");
    }
  }

  /// Answers until the call is done.
  Request finish(tr::ReverseIda& ida, Request request) {
    while (request != Request::reached && request != Request::failed)
      request = ida.go_on(answer(ida));
    return request;
  }

  long requests = 0;

 private:
  Problem problem_;
  tp::Constraints rows_;
  std::vector<double> factors_;
  tether::linalg::SmallLU lu_;
};

constexpr double kTolerance = 1e-6;
Problem swing() { return pendulum(1, 9.81, 3, "index 1"); }

/// The host that has the same functions as callbacks, its plain or projected y at t_end.
std::vector<double> by_callbacks(Problem problem, Linear linear, bool projected) {
  if (linear == Linear::differences) problem.jacobian = nullptr;
  Host host(problem, kTolerance);
  if (projected) {
    host.attach(problem.recommended_constraints());
    REQUIRE(host.projection().solve(problem.t_end, &host.t, host.y, host.yp, IDA_NORMAL) >= 0);
  } else {
    REQUIRE(host.to(problem.t_end) >= 0);
  }
  return host.state();
}

}  // namespace

TEST_CASE(
    "reverse communication: the bits of callbacks, with every linear solver, plain and projected") {
  const Problem problem = swing();
  for (const Linear linear : {Linear::differences, Linear::jacobian, Linear::own})
    for (const bool projected : {false, true}) {
      INFO(static_cast<int>(linear) << ", projected " << projected);
      tr::ReverseIda ida(equations_of(problem, kTolerance, linear, projected));
      IDASetMaxNumSteps(ida.ida_mem(), 100000);
      Program program(problem);
      REQUIRE(program.finish(ida, ida.solve(problem.t_end)) == Request::reached);
      CHECK(ida.t() == problem.t_end);
      CHECK(ida.flag() >= 0);
      CHECK(ida.message().empty());
      CHECK(same_bits({ida.y(), ida.y() + problem.size}, by_callbacks(problem, linear, projected)));
      CHECK((ida.projection() != nullptr) == projected);
      if (projected) CHECK(ida.projection()->statistics().projections > 10);
    }
}

TEST_CASE("reverse communication: one step at a time, and two runs in turns") {
  const Problem problem = swing();
  tr::ReverseIda one(equations_of(problem, kTolerance, Linear::jacobian, true));
  tr::ReverseIda two(equations_of(problem, kTolerance, Linear::jacobian, true));
  Program first(problem), second(problem);
  long steps = 0;
  while (one.t() < 0.5) {
    Request a = one.solve(problem.t_end, true), b = two.solve(problem.t_end, true);
    // One request of each by turns.
    while (a != Request::reached || b != Request::reached) {
      REQUIRE(a != Request::failed);
      REQUIRE(b != Request::failed);
      if (a != Request::reached) a = one.go_on(first.answer(one));
      if (b != Request::reached) b = two.go_on(second.answer(two));
    }
    ++steps;
    REQUIRE(same_bits({one.y(), one.y() + problem.size}, {two.y(), two.y() + problem.size}));
  }
  long of_ida = 0;
  IDAGetNumSteps(one.ida_mem(), &of_ida);
  CHECK(steps == of_ida);
  Host host(problem, kTolerance);
  host.attach(problem.recommended_constraints());
  while (host.t < 0.5)
    REQUIRE(host.projection().solve(problem.t_end, &host.t, host.y, host.yp, IDA_ONE_STEP) >= 0);
  CHECK(host.t == one.t());
  CHECK(same_bits(host.state(), {one.y(), one.y() + problem.size}));
}

TEST_CASE("reverse communication: a start is made consistent by requests, too") {
  Problem problem = swing();
  problem.y0[1] += 0.01;
  tr::Equations e = equations_of(problem, kTolerance, Linear::jacobian, true);
  e.id = problem.id;
  tr::ReverseIda ida(e);
  Program program(problem);
  REQUIRE(program.finish(ida, ida.make_consistent()) == Request::reached);
  const double* y = ida.y();
  CHECK(std::abs(std::hypot(y[0], y[1]) - 1) < 1e-10);
  CHECK(program.requests > 2);
  tr::ReverseIda plain(equations_of(problem, kTolerance, Linear::jacobian, false));
  CHECK_THROWS_AS(plain.make_consistent(), std::logic_error);
}

TEST_CASE("reverse communication: one that was moved from throws, the other goes on") {
  const Problem problem = swing();
  tr::ReverseIda ida(equations_of(problem, kTolerance, Linear::jacobian, true));
  tr::ReverseIda other(std::move(ida));
  CHECK_THROWS_AS(ida.solve(0.2), std::logic_error);  // NOLINT(bugprone-use-after-move)
  CHECK_THROWS_AS(ida.go_on(), std::logic_error);
  CHECK_THROWS_AS(ida.message(), std::logic_error);
  CHECK_THROWS_AS(ida.y(), std::logic_error);
  CHECK_THROWS_AS(ida.projection(), std::logic_error);
  Program program(problem);
  CHECK(program.finish(other, other.solve(0.2)) == Request::reached);
}

TEST_CASE("reverse communication: answers > 0 shorten a step, answers < 0 end the run") {
  const Problem problem = swing();
  for (const Request which :
       {Request::residual, Request::jacobian, Request::constraints, Request::constraint_jacobian})
    for (const int said : {1, -1}) {
      INFO(tr::to_string(which) << " answered " << said);
      tr::ReverseIda ida(equations_of(problem, kTolerance, Linear::jacobian, true));
      Program program(problem);
      Request request = ida.solve(0.2);
      int seen = 0;
      while (request != Request::reached && request != Request::failed) {
        const bool now = request == which && ++seen == 4;
        const int answer = program.answer(ida);
        request = ida.go_on(now ? said : answer);
      }
      REQUIRE(seen >= 4);
      CHECK((request == Request::reached) == (said > 0));
      if (said < 0) {
        CHECK(ida.flag() < 0);
        CHECK_FALSE(ida.message().empty());
        CHECK(ida.result() == nullptr);
      }
      if (said > 0 || which != Request::residual) continue;
      CHECK(program.finish(ida, ida.solve(0.2)) == Request::reached);
      CHECK(ida.message().empty());  // that was of the run before
    }
}

TEST_CASE("reverse communication: a request has the time at which it is asked") {
  tr::Equations e;
  e.y = {0.0};
  e.yp = {1.0};
  e.rtol = 1e-7;
  e.atol = {1e-7};
  tr::ReverseIda ida(e);
  double latest = 0;
  Request request = ida.solve(2);
  while (request != Request::reached && request != Request::failed) {
    latest = std::max(latest, ida.t());
    if (request == Request::residual) ida.result()[0] = ida.yp()[0] - std::cos(ida.t());
    request = ida.go_on(0);
  }
  REQUIRE(request == Request::reached);
  CHECK(latest >= 2);
  CHECK(std::abs(ida.y()[0] - std::sin(2.0)) < 1e-5);
}

TEST_CASE("reverse communication: calls out of turn and wrong arguments are refused") {
  const Problem problem = swing();
  tr::ReverseIda ida(equations_of(problem, kTolerance, Linear::own, true));
  CHECK_THROWS_AS(ida.go_on(), std::logic_error);
  REQUIRE(ida.solve(1.0) != Request::reached);
  CHECK_THROWS_AS(ida.solve(1.0), std::logic_error);
  CHECK_THROWS_AS(ida.make_consistent(), std::logic_error);
  Program program(problem);
  CHECK(program.finish(ida, ida.request()) == Request::reached);  // none of it did harm

  const auto refused = [&](const std::function<void(tr::Equations&)>& change) {
    tr::Equations e = equations_of(problem, kTolerance, Linear::own, true);
    change(e);
    return thrown([&] { tr::ReverseIda refuse(e); });
  };
  CHECK(contains(refused([](tr::Equations& e) { e.yp.pop_back(); }), "yp.size() = 4"));
  CHECK(contains(refused([](tr::Equations& e) { e.y.clear(); }), "y.size() = 0"));
  CHECK(contains(refused([](tr::Equations& e) { e.atol = {1, 2}; }), "atol.size() = 2"));
  CHECK(contains(refused([](tr::Equations& e) { e.rtol = -1; }), "rtol = -1"));
  CHECK(contains(refused([](tr::Equations& e) { e.y[2] = std::nan(""); }), "y[2]"));
  CHECK(contains(refused([](tr::Equations& e) { e.constraints = -1; }), "constraints = -1"));
  CHECK(contains(refused([](tr::Equations& e) { e.names = {"one"}; }), "names.size() = 1"));
  CHECK(
      contains(refused([](tr::Equations& e) { e.options.advanced.tolerance = -1; }), "tolerance"));
}

TEST_CASE("reverse communication: a run that is given up in any request leaves nothing behind") {
  const Problem problem = swing();
  const auto give_up = [&](long after) {
    tr::ReverseIda ida(equations_of(problem, kTolerance, Linear::own, true));
    Program program(problem);
    Request request = ida.solve(0.05);
    for (long k = 0; k < after; ++k) {
      if (request == Request::reached) return false;
      request = ida.go_on(program.answer(ida));
    }
    return true;
  };
  give_up(0);
  for (long k = 0; k < 2000; k += k < 100 ? 1 : 17) {
    const long before = blocks_alive();
    const bool open = give_up(k);
    const long behind = blocks_alive();
    INFO("after " << k << " requests");
    REQUIRE(behind == before);
    if (!open) return;
  }
  FAIL("the run did not end");
}

TEST_CASE("reverse communication from C: the same bits, errors by name") {
  const Problem problem = swing();
  const int n = problem.size;
  const tp::Constraints rows = problem.recommended_constraints();
  int flag = 0;
  std::unique_ptr<tether_reverse, void (*)(tether_reverse*)> reverse(
      tether_reverse_new(n, problem.t0, problem.y0.data(), problem.yp0.data(), nullptr, kTolerance,
                         kTolerance, TETHER_LINEAR_JACOBIAN, rows.total_count(), nullptr, &flag),
      tether_reverse_free);
  REQUIRE(reverse != nullptr);
  CHECK(flag == 0);
  tether_reverse* const r = reverse.get();
  CHECK(tether_reverse_go_on(r, 0) == TETHER_ILL_INPUT);
  CHECK(contains(tether_reverse_last_error(), "without a request"));
  int ask = tether_reverse_solve(r, problem.t_end, 0);
  while (ask > TETHER_STOPPED) {
    const double t = tether_reverse_t(r), *y = tether_reverse_y(r), *yp = tether_reverse_yp(r);
    double* const result = tether_reverse_result(r);
    if (ask == TETHER_ASK_RESIDUAL) {
      problem.residual(t, y, yp, result);
    } else if (ask == TETHER_ASK_JACOBIAN) {
      problem.jacobian(t, tether_reverse_cj(r), y, yp, result);
    } else if (ask == TETHER_ASK_CONSTRAINTS) {
      const Eigen::VectorXd g = value(rows, t, y, n);
      std::copy(g.data(), g.data() + g.size(), result);
    } else {
      REQUIRE(ask == TETHER_ASK_CONSTRAINT_JACOBIAN);
      const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> C =
          jacobian(rows, t, y, n);
      std::copy(C.data(), C.data() + C.size(), result);
    }
    ask = tether_reverse_go_on(r, 0);
  }
  REQUIRE(ask == TETHER_REACHED);
  const double* y = tether_reverse_y(r);
  CHECK(same_bits({y, y + n}, by_callbacks(problem, Linear::jacobian, true)));
  CHECK(std::string(tether_reverse_message(r)).empty());
  CHECK(tether_reverse_ida_mem(r) != nullptr);

  const auto make = [&](int size, int linear, int constraints, const double* start) {
    return tether_reverse_new(size, 0, start, problem.yp0.data(), nullptr, 1e-6, 1e-6, linear,
                              constraints, nullptr, &flag);
  };
  CHECK(make(0, 0, 0, problem.y0.data()) == nullptr);
  CHECK(contains(tether_reverse_last_error(), "n = 0"));
  CHECK(make(n, 3, 0, problem.y0.data()) == nullptr);
  CHECK(contains(tether_reverse_last_error(), "linear = 3"));
  CHECK(make(n, 0, -2, problem.y0.data()) == nullptr);
  CHECK(contains(tether_reverse_last_error(), "constraints = -2"));
  CHECK(flag == TETHER_ILL_INPUT);
  CHECK(make(n, 0, 0, nullptr) == nullptr);
  CHECK(flag == TETHER_MEM_NULL);
  CHECK(tether_reverse_solve(nullptr, 1, 0) == TETHER_MEM_NULL);
  CHECK(tether_reverse_y(nullptr) == nullptr);
}

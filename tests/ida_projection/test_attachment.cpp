// Tether: when and to what the projection is attached. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>
#include <nvector/nvector_serial.h>
#include <problems/pendulum.hpp>
#include <stdexcept>
#include <string>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>
#include <type_traits>
#include <utility>
#include <vector>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

Problem swing() { return pendulum(1.0, 1.0, 20.0, "index 1"); }

}  // namespace

TEST_CASE("attached late: refused with the cure, and the cure works") {
  Host host(swing(), 1e-6);
  REQUIRE(host.to(5.0) >= 0);
  host.attach(host.problem.recommended_constraints());
  CHECK(host.to(6.0) < 0);
  CHECK(host.projection().status() == tp::Status::late_attach);
  CHECK(contains(host.projection().message(), "IDAReInit"));
  CHECK(host.projection().statistics().projections == 0);

  REQUIRE(host.restart() == 0);
  REQUIRE(host.finish() >= 0);
  CHECK(host.projection().status() == tp::Status::success);
  CHECK(host.projection().statistics().projections > 0);
  CHECK(host.error() < 2e-5);
}

TEST_CASE("IDAReInit: the second run is the first one, bit for bit") {
  const Problem problem = pendulum(1.0, 1.0, 20.0, "index 0");
  Host host(problem, 1e-6);
  host.attach(problem.recommended_constraints());
  std::vector<double> first;
  long first_steps = 0;
  for (int repeat = 0; repeat < 3; ++repeat) {
    INFO("repeat " << repeat);
    if (repeat > 0) REQUIRE(host.restart() == 0);
    host.projection().reset_statistics();
    REQUIRE(host.finish() >= 0);
    if (repeat == 0) {
      first = host.state();
      first_steps = host.steps();
    }
    CHECK(same_bits(host.state(), first));
    CHECK(host.steps() == first_steps);
    CHECK(host.projection().statistics().solver_calls >= first_steps);
  }
}

TEST_CASE("IDAReInit with algebraic variables") {
  Host host(swing(), 1e-6);
  host.attach(host.problem.recommended_constraints());
  REQUIRE(host.finish() >= 0);
  const long steps = host.steps();
  for (int repeat = 0; repeat < 2; ++repeat) {
    REQUIRE(host.restart() == 0);
    REQUIRE(host.finish() >= 0);
    CHECK(host.error() < 2e-5);
    CHECK(host.steps() < 1.1 * static_cast<double>(steps));
  }
}

TEST_CASE("several ida_mem at once do not know of each other") {
  const Problem a = swing(), b = pendulum(1.1, 9.80665, 20.0, "index 0");
  const auto alone = [](const Problem& problem, double tolerance) {
    Host host(problem, tolerance);
    host.attach(problem.recommended_constraints());
    REQUIRE(host.finish() >= 0);
    return host.state();
  };
  Host first(a, 1e-6), second(b, 1e-7), third(a, 1e-6);
  first.attach(a.recommended_constraints());
  second.attach(b.recommended_constraints());
  third.attach(a.recommended_constraints());
  while (first.t < 20.0 || second.t < 20.0 || third.t < 20.0)
    for (Host* host : {&first, &second, &third})
      if (host->t < 20.0) REQUIRE(host->step() >= 0);
  for (Host* host : {&first, &second, &third}) IDAGetDky(host->ida, 20.0, 0, host->y);
  CHECK(same_bits(first.state(), alone(a, 1e-6)));
  CHECK(same_bits(third.state(), first.state()));
  CHECK(same_bits(second.state(), alone(b, 1e-7)));
}

TEST_CASE("a nonlinear solver handed over is decorated, and stays the caller's") {
  const Problem problem = swing();
  Host own(problem, 1e-6), given(problem, 1e-6);
  own.attach(problem.recommended_constraints());
  SUNNonlinearSolver newton = SUNNonlinSol_Newton(given.y, given.context);
  tp::Options options;
  options.nonlinear_solver = newton;
  given.attach(problem.recommended_constraints(), options);
  REQUIRE(own.finish() >= 0);
  REQUIRE(given.finish() >= 0);
  CHECK(same_bits(own.state(), given.state()));
  long iterations = 0;
  SUNNonlinSolGetNumIters(newton, &iterations);  // of its last solve
  CHECK(iterations >= 1);
  given.restart();
  REQUIRE(given.finish() >= 0);
  SUNNonlinSolFree(newton);  // ours to free: nobody else did
}

TEST_CASE("IDAReInit: Newton's convergence test is IDA's own again, until moves begin") {
  static SUNNonlinSolConvTestFn in_use = nullptr;
  const Problem problem = pendulum(1.0, 1.0, 5.0, "index 2");
  Host host(problem, 1e-6);
  SUNNonlinearSolver newton = SUNNonlinSol_Newton(host.y, host.context);
  static const auto set = newton->ops->setctestfn;
  newton->ops->setctestfn = [](SUNNonlinearSolver solver, SUNNonlinSolConvTestFn f, void* data) {
    in_use = f;
    return set(solver, f, data);
  };
  tp::Options options;
  options.nonlinear_solver = newton;
  host.attach(problem.recommended_constraints(), options);
  const SUNNonlinSolConvTestFn of_ida = in_use;
  REQUIRE(of_ida != nullptr);
  REQUIRE(host.finish() >= 0);
  CHECK(in_use != of_ida);  // it judges multipliers apart
  REQUIRE(host.restart() == 0);
  IDASetStopTime(host.ida, 1e-12);
  REQUIRE(host.step() >= 0);
  CHECK(in_use == of_ida);
  SUNNonlinSolFree(newton);
}

TEST_CASE("a fixed-point solver is refused") {
  Host host(swing(), 1e-6);
  SUNNonlinearSolver fixed = SUNNonlinSol_FixedPoint(host.y, 0, host.context);
  tp::Options options;
  options.nonlinear_solver = fixed;
  const std::string text =
      thrown([&] { host.attach(host.problem.recommended_constraints(), options); });
  CHECK(contains(text, "nonlinear_solver"));
  CHECK(contains(text, "root-finding"));
  // IDA is as it was.
  CHECK(host.to(1.0) >= 0);
  SUNNonlinSolFree(fixed);
}

TEST_CASE("never called: another solver was attached afterwards") {
  Host host(swing(), 1e-6);
  host.attach(host.problem.recommended_constraints());
  SUNNonlinearSolver newton = SUNNonlinSol_Newton(host.y, host.context);
  REQUIRE(IDASetNonlinearSolver(host.ida, newton) == 0);
  CHECK(host.projection().solve(5.0, &host.t, host.y, host.yp, IDA_NORMAL) >= 0);
  CHECK(host.projection().status() == tp::Status::never_called);
  CHECK(contains(host.projection().message(), "another nonlinear solver"));
  CHECK(host.projection().statistics().solver_calls == 0);
  CHECK(contains(host.projection().statistics().table(), "not called the plugin"));
  SUNNonlinSolFree(newton);
}

TEST_CASE("replaced before or during the run: status and statistics say it at once") {
  for (const double until : {0.0, 3.0}) {
    Host host(swing(), 1e-6);
    host.attach(host.problem.recommended_constraints());
    if (until > 0.0) REQUIRE(host.to(until) >= 0);
    CHECK(host.projection().status() == (until > 0.0 ? tp::Status::success : tp::Status::unused));
    const long seen = host.steps();
    SUNNonlinearSolver newton = SUNNonlinSol_Newton(host.y, host.context);
    REQUIRE(IDASetNonlinearSolver(host.ida, newton) == 0);
    // SUNDIALS hands the linear solver to a nonlinear one when a run begins.
    if (until > 0.0) REQUIRE(host.restart() == 0);
    CHECK(host.projection().status() != tp::Status::never_called);
    REQUIRE(host.to(5.0) >= 0);
    INFO("replaced at " << until << ", steps " << seen << " and " << host.steps());
    CHECK(host.projection().status() == tp::Status::never_called);
    CHECK(contains(host.projection().message(), "another nonlinear solver"));
    const tp::Statistics statistics = host.projection().statistics();
    CHECK(statistics.steps_without_plugin >= 1);
    CHECK(contains(statistics.table(), "another nonlinear solver"));
    IDAFree(&host.ida);
    CHECK(host.projection().status() == tp::Status::never_called);  // still known
    SUNNonlinSolFree(newton);
  }
}

TEST_CASE("status and statistics change no text that message() returned") {
  Host host(swing(), 1e-6);
  host.attach(host.problem.recommended_constraints());
  SUNNonlinearSolver newton = SUNNonlinSol_Newton(host.y, host.context);
  REQUIRE(IDASetNonlinearSolver(host.ida, newton) == 0);
  REQUIRE(host.to(1.0) >= 0);
  const char* text = host.projection().message().c_str();
  const std::string before = text;
  for (const double until : {2.0, 5.0}) {
    REQUIRE(host.to(until) >= 0);
    CHECK(host.projection().status() == tp::Status::never_called);
    host.projection().statistics();
    CHECK(host.projection().message().c_str() == text);
  }
  CHECK(text == before);
  CHECK(contains(before, "another nonlinear solver"));
  SUNNonlinSolFree(newton);
}

TEST_CASE("a Projection that ends before its ida_mem: IDASolve fails, and a new solver cures it") {
  for (const double until : {0.0, 3.0}) {
    Host host(swing(), 1e-6);
    {
      tp::Options silent;
      silent.print = false;
      tp::Projection local(host.ida, host.problem.recommended_constraints(), silent);
      if (until > 0.0) REQUIRE(host.to(until) >= 0);
    }
    const int flag = host.to(5.0);
    CHECK(flag == (until > 0.0 ? IDA_NLS_FAIL : IDA_NLS_INIT_FAIL));
    long iterations = 0;
    CHECK(IDAGetNumNonlinSolvIters(host.ida, &iterations) == 0);
    CHECK(IDASetMaxNonlinIters(host.ida, 5) == 0);

    SUNNonlinearSolver newton = SUNNonlinSol_Newton(host.y, host.context);
    REQUIRE(IDASetNonlinearSolver(host.ida, newton) == 0);
    REQUIRE(host.restart() == 0);
    CHECK(host.to(5.0) >= 0);
    host.attach(host.problem.recommended_constraints());
    REQUIRE(host.restart() == 0);
    CHECK(host.finish() >= 0);
    CHECK(host.projection().status() == tp::Status::success);
    IDAFree(&host.ida);
    SUNNonlinSolFree(newton);
  }
}

TEST_CASE("a Projection in the place of another one: the first one may end at any time") {
  Host host(swing(), 1e-6);
  auto first = std::make_unique<tp::Projection>(host.ida, host.problem.recommended_constraints());
  host.attach(host.problem.recommended_constraints());
  first.reset();
  CHECK(host.finish() >= 0);
  CHECK(host.projection().status() == tp::Status::success);
}

TEST_CASE("calls after IDAFree are refused by name") {
  Host host(swing(), 1e-6);
  tp::Projection& projection = host.attach(host.problem.recommended_constraints());
  REQUIRE(host.to(1.0) >= 0);
  IDAFree(&host.ida);
  const std::vector<double> before = host.state();
  const auto refused = [&](const tp::ConsistencyReport& report) {
    return report.status == tp::Status::misused && contains(report.message, "IDAFree");
  };
  CHECK(refused(projection.project(1.0, host.y, host.yp)));
  CHECK(refused(projection.make_consistent(1.0, host.y, host.yp)));
  CHECK(refused(projection.project_gradient(1.0, host.y, host.yp)));
  CHECK(projection.solve(2.0, &host.t, host.y, host.yp, IDA_NORMAL) == IDA_MEM_NULL);
  CHECK(projection.status() == tp::Status::misused);
  CHECK(same_bits(host.state(), before));
}

TEST_CASE("vectors of another length are refused by name, and g does not see them") {
  Host host(circle(5.0), 1e-6);
  int least = 2;
  tp::Constraints rows = on_circle();
  rows.value = [&least](double, tp::ConstVector y, tp::Vector g) {
    least = std::min(least, static_cast<int>(y.size()));
    g[0] = (y.squaredNorm() - 1.0) / 2.0;
  };
  tp::Projection& projection = host.attach(rows);
  for (const sunindextype length : {0, 1, 3}) {
    N_Vector other = N_VNew_Serial(length, host.context);
    N_VConst(1.0, other);
    for (const tp::ConsistencyReport& report :
         {projection.project(0.0, other), projection.project(0.0, host.y, other),
          projection.make_consistent(0.0, other, host.yp),
          projection.make_consistent(0.0, host.y, other),
          projection.project_gradient(0.0, host.y, other)}) {
      CHECK(report.status == tp::Status::misused);
      CHECK(contains(report.message, std::to_string(length) + " entries; y has 2"));
    }
    CHECK(projection.solve(1.0, &host.t, other, host.yp, IDA_NORMAL) == IDA_ILL_INPUT);
    N_VDestroy(other);
  }
  CHECK(least == 2);
  CHECK(host.finish() >= 0);
}

TEST_CASE("status and statistics after IDAFree: what was last known") {
  Host host(swing(), 1e-6);
  host.attach(host.problem.recommended_constraints());
  REQUIRE(host.finish() >= 0);
  const long projections = host.projection().statistics().projections;
  IDAFree(&host.ida);
  CHECK(host.projection().status() == tp::Status::success);
  CHECK(host.projection().message().empty());
  CHECK(host.projection().statistics().projections == projections);
  CHECK(host.projection().statistics().steps_without_plugin == 0);
}

TEST_CASE("IDA's own settings reach the decorated solver") {
  Host host(swing(), 1e-6);
  host.attach(host.problem.recommended_constraints());
  REQUIRE(IDASetMaxNonlinIters(host.ida, 1) == 0);
  host.finish();
  long impatient = 0, failures = 0;
  IDAGetNumNonlinSolvConvFails(host.ida, &impatient);

  Host normal(swing(), 1e-6);
  normal.attach(normal.problem.recommended_constraints());
  REQUIRE(normal.finish() >= 0);
  IDAGetNumNonlinSolvConvFails(normal.ida, &failures);
  CHECK(failures <= 4);
  CHECK(impatient > 10 * (failures + 1));
}

TEST_CASE("IDA counts the plugin's extra iterations") {
  Host host(swing(), 1e-6);
  host.attach(host.problem.recommended_constraints());
  REQUIRE(host.finish() >= 0);
  const tp::Statistics s = host.projection().statistics();
  long iterations = 0;
  IDAGetNumNonlinSolvIters(host.ida, &iterations);
  CHECK(s.extra_iterations + s.refreshes > 0);
  CHECK(iterations >= host.steps() + s.extra_iterations);
}

TEST_CASE("IDACalcIC works with the plugin attached") {
  Host host(swing(), 1e-6);
  host.attach(host.problem.recommended_constraints());
  N_Vector id = host.vector(host.problem.id);
  REQUIRE(IDASetId(host.ida, id) == 0);
  host.data()[4] = 0.3;  // a wrong multiplier
  N_VGetArrayPointer(host.yp)[3] = 0.0;
  REQUIRE(IDAReInit(host.ida, 0.0, host.y, host.yp) == 0);
  REQUIRE(IDACalcIC(host.ida, IDA_YA_YDP_INIT, 0.01) == 0);
  REQUIRE(IDAGetConsistentIC(host.ida, host.y, host.yp) == 0);
  CHECK(std::abs(host.data()[4]) < 1e-8);
  CHECK(N_VGetArrayPointer(host.yp)[3] == Approx(-1.0));
  REQUIRE(host.finish() >= 0);
  CHECK(host.error() < 2e-5);
}

TEST_CASE("a Projection can be moved while IDA holds it") {
  Host host(swing(), 1e-6);
  auto first = std::make_unique<tp::Projection>(host.ida, host.problem.recommended_constraints());
  REQUIRE(host.to(1.0) >= 0);
  tp::Projection second(std::move(*first));
  first.reset();
  REQUIRE(host.to(20.0) >= 0);
  CHECK(second.status() == tp::Status::success);
  CHECK(second.statistics().projections >= host.steps() - 10);
  CHECK(host.error() < 2e-5);
  IDAFree(&host.ida);  // before `second` ends
}

TEST_CASE("calls of a Projection that was moved from are errors") {
  Host host(swing(), 1e-6);
  tp::Projection first(host.ida, host.problem.recommended_constraints());
  const tp::Projection second(std::move(first));
  const auto refused = [&](auto call) {
    try {
      call();
    } catch (const std::logic_error& error) {
      return contains(error.what(), "moved from");
    }
    return false;
  };
  CHECK(refused([&] { (void)first.status(); }));
  CHECK(refused([&] { (void)first.message(); }));
  CHECK(refused([&] { (void)first.statistics(); }));
  CHECK(refused([&] { first.reset_statistics(); }));
  CHECK(refused([&] { first.project(0.0, host.y); }));
  CHECK(refused([&] { first.make_consistent(0.0, host.y, host.yp); }));
  CHECK(refused([&] { first.project_gradient(0.0, host.y, host.yp); }));
  CHECK(second.status() == tp::Status::unused);
}

TEST_CASE("ida_mem that cannot be attached to is refused, and says why") {
  CHECK(
      contains(thrown([] { const tp::Projection none(nullptr, on_circle()); }), "ida_mem is null"));
  Context context;
  void* fresh = IDACreate(context);
  CHECK(contains(thrown([&] { const tp::Projection none(fresh, on_circle()); }), "IDAInit"));
  IDAFree(&fresh);
}

TEST_CASE("a SUNDIALS with indices of another size is refused by name") {
  Host host(swing(), 1e-6);
  void* ignored = nullptr;
  sunrealtype t = 0.0, cj = 0.0;
  N_Vector y = nullptr, others[4];
  IDAGetNonlinearSystemData(host.ida, &t, &y, &others[0], &others[1], &others[2], &others[3], &cj,
                            &ignored);
  using Other = std::conditional_t<sizeof(sunindextype) == 8, std::int32_t, std::int64_t>;
  const auto space = y->ops->nvspace;
  y->ops->nvspace = [](N_Vector, sunindextype* reals, sunindextype* integers) {
    const Other five = 5, one = 1;
    std::memcpy(reals, &five, sizeof five);
    std::memcpy(integers, &one, sizeof one);
  };
  const auto attached = [&] {
    try {
      tp::Projection projection(host.ida, host.problem.recommended_constraints());
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const std::string said = attached();
  CHECK(contains(said, "-bit indices, but the plugin was compiled for"));
  CHECK(contains(said, sizeof(sunindextype) == 8 ? "has 32-bit" : "has 64-bit"));

  // One that says nothing of itself passes.
  y->ops->nvspace = [](N_Vector, sunindextype*, sunindextype*) {};
  CHECK(attached().empty());
  y->ops->nvspace = nullptr;
  CHECK(attached().empty());
  y->ops->nvspace = space;
}

TEST_CASE("status and message before the first step") {
  Host host(swing(), 1e-6);
  const tp::Projection& projection = host.attach(host.problem.recommended_constraints());
  CHECK(projection.status() == tp::Status::unused);
  CHECK(projection.message().empty());
  CHECK(projection.statistics().solver_calls == 0);
  CHECK(std::string(tp::to_string(tp::Status::late_attach)) == "attached too late");
}

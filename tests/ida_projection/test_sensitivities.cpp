// Tether: forward sensitivities with IDAS. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <idas/idas.h>
#include <nvector/nvector_serial.h>
#include <problems/pendulum.hpp>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

// Linked with IDAS instead of IDA: the same functions for another memory layout.

using namespace tether::test;
using namespace tether::problems;

namespace {

/// x' = p v, v' = -p x from (1, 0): (cos pt, -sin pt), energy kept.
struct Oscillator {
  double p = 1.3;
};

int residual(sunrealtype, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  const double p = static_cast<const Oscillator*>(data)->p;
  const double *u = N_VGetArrayPointer(y), *up = N_VGetArrayPointer(yp);
  N_VGetArrayPointer(r)[0] = up[0] - p * u[1];
  N_VGetArrayPointer(r)[1] = up[1] + p * u[0];
  return 0;
}

struct Result {
  int flag = 0;
  long steps = 0;
  std::vector<double> y, sensitivity;
  tp::Status status = tp::Status::unused;
  std::string message;
  tp::Statistics statistics;
};

enum class Attach { no, nothing, circle };

Result run(int method, Attach attach, bool attach_last = false) {
  Oscillator data;
  Problem problem = tether::test::circle(10.0);
  problem.y0 = {1.0, 0.0};
  problem.yp0 = {0.0, -data.p};
  Host host(problem, 1e-8);  // brings vectors, context and linear solver
  IDAFree(&host.ida);
  host.ida = IDACreate(host.context);
#if SUNDIALS_VERSION_MAJOR < 7
  IDASetErrHandlerFn(
      host.ida, [](int, const char*, const char*, char*, void*) {}, nullptr);
#endif
  REQUIRE(IDAInit(host.ida, residual, 0.0, host.y, host.yp) == 0);
  IDASetUserData(host.ida, &data);
  IDASStolerances(host.ida, 1e-8, 1e-8);
  host.use_linear_solver();
  N_Vector s = host.vector({0.0, 0.0}), sp = host.vector({0.0, -1.0});
  if (attach != Attach::no && !attach_last)
    host.attach(attach == Attach::circle ? on_circle() : tp::Constraints{});
  double parameters[1] = {data.p};
  REQUIRE(IDASensInit(host.ida, 1, method, nullptr, &s, &sp) == 0);
  REQUIRE(IDASetSensParams(host.ida, &data.p, parameters, nullptr) == 0);
  REQUIRE(IDASensEEtolerances(host.ida) == 0);
  if (attach != Attach::no && attach_last)
    host.attach(attach == Attach::circle ? on_circle() : tp::Constraints{});

  Result result;
  result.flag = host.finish();
  if (result.flag >= 0) {
    IDAGetSensDky1(host.ida, 10.0, 0, 0, s);
  }
  result.steps = host.steps();
  result.y = host.state();
  result.sensitivity = {N_VGetArrayPointer(s)[0], N_VGetArrayPointer(s)[1]};
  if (attach != Attach::no) {
    result.status = host.projection().status();
    result.message = host.projection().message();
    result.statistics = host.projection().statistics();
  }
  return result;
}

}  // namespace

TEST_CASE("staggered sensitivities: the state is projected, sensitivities are right") {
  for (const int method : {IDA_STAGGERED}) {
    const Result plain = run(method, Attach::no), projected = run(method, Attach::circle);
    REQUIRE(plain.flag >= 0);
    REQUIRE(projected.flag >= 0);
    CHECK(projected.status == tp::Status::success);
    CHECK(projected.statistics.projections > 50);
    CHECK(projected.statistics.failures() == 0);
    const double p = 1.3, t = 10.0;
    CHECK(std::abs(projected.y[0] - std::cos(p * t)) < 1e-6);
    CHECK(std::abs(std::hypot(projected.y[0], projected.y[1]) - 1.0) < 1e-9);
    CHECK(std::abs(projected.sensitivity[0] + t * std::sin(p * t)) < 1e-4);
    CHECK(std::abs(projected.sensitivity[1] + t * std::cos(p * t)) < 1e-4);
    CHECK(projected.steps < 2 * plain.steps);
  }
}

TEST_CASE("staggered sensitivities without constraints: the same bits") {
  const Result plain = run(IDA_STAGGERED, Attach::no),
               attached = run(IDA_STAGGERED, Attach::nothing);
  REQUIRE(attached.flag >= 0);
  CHECK(attached.statistics.solver_calls >= attached.steps);
  CHECK(attached.steps == plain.steps);
  CHECK(same_bits(attached.y, plain.y));
  CHECK(same_bits(attached.sensitivity, plain.sensitivity));
}

TEST_CASE("attached after IDASensInit: the same") {
  const Result before = run(IDA_STAGGERED, Attach::circle),
               after = run(IDA_STAGGERED, Attach::circle, true);
  REQUIRE(after.flag >= 0);
  CHECK(same_bits(before.y, after.y));
  CHECK(same_bits(before.sensitivity, after.sensitivity));
}

TEST_CASE("simultaneous sensitivities are refused with the way out") {
  for (const bool last : {false, true}) {
    const Result result = run(IDA_SIMULTANEOUS, Attach::circle, last);
    CHECK(result.flag < 0);
    CHECK(result.steps == 0);
    CHECK(result.status == tp::Status::simultaneous_sensitivities);
    CHECK(contains(result.message, "IDA_STAGGERED"));
    CHECK(result.statistics.projections == 0);
  }
  CHECK(run(IDA_SIMULTANEOUS, Attach::no).flag >= 0);  // IDAS itself can
}

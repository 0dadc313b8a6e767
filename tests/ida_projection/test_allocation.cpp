// Tether: in steady state a projected step does not allocate. SPDX-License-Identifier: BSD-3-Clause
#include <nvector/nvector_serial.h>
#include <problems/andrews.hpp>
#include <problems/car_axis.hpp>
#include <problems/pendulum.hpp>

#include "host.hpp"
#include "linalg/allocations.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

/// Allocations of the whole process, IDA included, over 200 steps after a warm-up.
long in_steady_state(const Problem& problem, const tp::Constraints& rows,
                     const tp::Options& options = {}) {
  Host host(problem, 1e-8);
  host.attach(rows, options);
  for (int i = 0; i < 150; ++i) REQUIRE(host.step() >= 0);
  const tp::Statistics before = host.projection().statistics();
  const long start = allocations();
  int flag = 0;
  for (int i = 0; i < 200 && flag >= 0; ++i) flag = host.step();
  const long made = allocations() - start;
  REQUIRE(flag >= 0);
  CHECK(host.projection().statistics().projections >= before.projections + 200);
  return made;
}

tp::Constraints gradients() {
  tp::Constraints set;
  set.count = 1;
  set.jacobian = tp::Gradients{[](double, N_Vector y, double* g) {
                                 const double* p = N_VGetArrayPointer(y);
                                 g[0] = (p[0] * p[0] + p[1] * p[1] - 1.0) / 2.0;
                               },
                               [](double, N_Vector y, N_Vector* rows) {
                                 N_VGetArrayPointer(rows[0])[0] = N_VGetArrayPointer(y)[0];
                                 N_VGetArrayPointer(rows[0])[1] = N_VGetArrayPointer(y)[1];
                               }};
  return set;
}

}  // namespace

TEST_CASE("the counter counts") {
  const long before = allocations();
  std::vector<double> v(100);
  CHECK(allocations() > before);
  CHECK(v.size() == 100);
}

TEST_CASE("no allocation in a projected step") {
  const Problem index1 = pendulum(1.0, 1.0, 1000.0, "index 1");
  const Problem index0 = pendulum(1.0, 1.0, 1000.0, "index 0");
  CHECK(in_steady_state(index1, index1.recommended_constraints()) == 0);
  CHECK(in_steady_state(index0, index0.recommended_constraints()) == 0);
  const Problem mechanism = andrews("index 1");
  CHECK(in_steady_state(mechanism, mechanism.select({"position", "velocity", "energy"})) == 0);
  const Problem car = car_axis("index 1 w");
  CHECK(in_steady_state(car, car.recommended_constraints()) == 0);
}

TEST_CASE("looks at whether F keeps rows that move with time do not allocate") {
  const Problem car = car_axis("index 1");
  Host host(car, 1e-8);
  host.attach(car.recommended_constraints());
  for (int i = 0; i < 30; ++i) REQUIRE(host.step() >= 0);
  const long start = allocations();
  int flag = 0;
  for (int i = 0; i < 40 && flag >= 0; ++i) flag = host.step();
  const long made = allocations() - start;
  REQUIRE(flag >= 0);
  CHECK(made <= 3);  // work space, once
}

TEST_CASE("no allocation with options, differences or gradients") {
  const Problem index1 = pendulum(1.0, 1.0, 1000.0, "index 1");
  const tp::Constraints rows = index1.recommended_constraints();
  tp::Options options;
  options.group = {0, 0, 1, 1, -1};
  CHECK(in_steady_state(index1, rows, options) == 0);
  options = {};
  options.advanced.metric = tp::Metric::error_weights;
  long reports = 0;
  options.progress = [&](const tp::Progress&) { ++reports; };
  CHECK(in_steady_state(index1, rows, options) == 0);
  CHECK(reports > 200);
  options = {};
  options.hold = {false, true, false, false, false};
  CHECK(in_steady_state(index1, rows, options) == 0);

  const Problem round = tether::test::circle(1000.0);
  tp::Constraints differences = on_circle();
  differences.jacobian = tp::FiniteDifferences{};
  CHECK(in_steady_state(round, differences) == 0);
  CHECK(in_steady_state(round, gradients()) == 0);
  // Redundant rows as well.
  CHECK(in_steady_state(index1, rows + index1.select({"position"})) == 0);
}

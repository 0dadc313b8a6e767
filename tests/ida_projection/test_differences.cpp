// Tether: difference quotients of g, entry by entry. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <functional>

#include "constraints/evaluator.hpp"
#include "support/catch.hpp"

namespace tp = tether::ida_projection;

namespace {

double entry(double y, double scale, double others,
             const std::function<double(const tp::ConstVector&)>& g) {
  tp::Constraints rows;
  rows.count = 1;
  rows.value = [g](double, tp::ConstVector at, tp::Vector out) {
    out[0] = g(at);
    return 0;
  };
  rows.jacobian = tp::FiniteDifferences{};
  tp::Statistics statistics;
  tp::Evaluator evaluator(rows, statistics);
  const double at[2] = {y, others}, WT[2] = {scale, scale};
  double C[2] = {0, 0};
  REQUIRE(evaluator.jacobian(0, at, 2, WT, {0, 1}, C) == tp::Status::success);
  return C[0];
}

}  // namespace

TEST_CASE("differences: a row that is y itself has the entry 1 to the last bit") {
  // y + h is rounded; what was really added is divided by.
  for (const double y : {0.1, 1.0 / 3.0, 1e3 / 7.0, -2e5 / 3.0, 1e-7, 0.0})
    for (const double scale : {1e-12, 1e-9, 1e-6, 1e-3})
      CHECK(entry(y, scale, 1.0, [](const tp::ConstVector& at) { return at[0]; }) == 1.0);
}

TEST_CASE("differences: where y passes zero the increment is a tolerance, not rounding") {
  // g = sin(y) + 1 has no digits of a change of 1e-20.
  const double slope =
      entry(1e-13, 1e-8, 1.0, [](const tp::ConstVector& at) { return std::sin(at[0]) + 1.0; });
  CHECK(slope == Approx(1.0).margin(1e-6));
}

TEST_CASE("differences: at tolerances below the root of rounding the increment stays above it") {
  for (const double tolerance : {1e-10, 1e-12, 1e-14}) {
    const double slope =
        entry(0.0, tolerance, 3.0, [](const tp::ConstVector& at) { return std::sin(at[0]) + 1.0; });
    CHECK(slope == Approx(1.0).margin(1e-7));
  }
}

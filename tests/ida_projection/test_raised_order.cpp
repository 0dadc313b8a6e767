// Tether: the formula's own error taken out, Options::raise_order.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <problems/car_axis.hpp>
#include <problems/kepler.hpp>
#include <problems/lotka_volterra.hpp>
#include <problems/pendulum.hpp>
#include <problems/rigid_body.hpp>
#include <problems/robertson.hpp>
#include <problems/slider_crank.hpp>
#include <vector>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

const tp::Options raised = enabled(&tp::Options::raise_order);

/// Geometric means over tolerances of errors and steps, with it over without.
struct Gain {
  double error = 0.0, steps = 0.0;
};

Gain gain(const Problem& p, double loosest, int tolerances) {
  Gain sum;
  for (int i = 0; i < tolerances; ++i) {
    const double tolerance = loosest * std::pow(10.0, -0.5 * i);
    INFO(p.name << ", " << p.form << ", tolerance " << tolerance);
    const Run with = integrate(p, tolerance, p.recommended_constraints(), raised, false);
    const Run without = integrate(p, tolerance, p.recommended_constraints(), {}, false);
    REQUIRE(with.flag >= 0);
    REQUIRE(without.flag >= 0);
    sum.error += std::log(with.error / without.error);
    sum.steps += std::log(static_cast<double>(with.steps) / static_cast<double>(without.steps));
  }
  return {std::exp(sum.error / tolerances), std::exp(sum.steps / tolerances)};
}

}  // namespace

TEST_CASE("raised order: errors fall at the same tolerances, for as many steps") {
  for (const Problem& p : {lotka_volterra(2.0, 0.5, 50.0), kepler(0.8, 20.0)}) {
    INFO(p.name);
    const Gain g = gain(p, 1e-3, 13);
    CHECK(g.error <= 0.5);
    CHECK(g.steps <= 1.1);
  }
  // Mostly in the lower half of these tolerances.
  for (const Problem& p : {rigid_body("dzhanibekov", 50.0), car_axis("index 0")}) {
    INFO(p.name);
    const Gain g = gain(p, 1e-6, 13);
    CHECK(g.error <= 0.9);
    CHECK(g.steps <= 1.1);
  }
}

TEST_CASE("raised order: in index 1 only variables with derivatives are corrected") {
  // Mostly in the lower half of these tolerances.
  for (const Problem& p : {car_axis("index 1"), pendulum(1.7, 3.3, 30.0, "index 1 x2"),
                           pendulum(1.7, 3.3, 30.0, "index 1")}) {
    INFO(p.name << ", " << p.form);
    const Gain g = gain(p, 1e-3, 13);
    CHECK(g.error <= 0.9);
    CHECK(g.steps <= 1.05);
  }
  // The algebraic ones are as good as without it, too.
  const Problem car = car_axis("index 1");
  const auto run = [&](double tolerance, const tp::Options& options) {
    const Run r = integrate(car, tolerance, car.recommended_constraints(), options, false);
    REQUIRE(r.flag >= 0);
    return r.y;
  };
  const std::vector<double> reference = run(1e-12, {});
  double sum = 0.0;
  const auto distance = [&](const std::vector<double>& y) {
    double most = 0.0;
    for (std::size_t j = 0; j < y.size(); ++j)
      if (car.id[j] == 0.0) most = std::max(most, std::abs(y[j] - reference[j]));
    return most;
  };
  int known = 0;
  for (double tolerance = 1e-4; tolerance > 0.9e-8; tolerance /= std::sqrt(10.0), ++known)
    sum += std::log(distance(run(tolerance, raised)) / distance(run(tolerance, {})));
  CHECK(known == 9);
  CHECK(std::exp(sum / known) <= 0.8);
}

TEST_CASE("raised order: what is stiff is left alone, undamped modes are not excited") {
  const Gain chemistry = gain(robertson(40.0, "index 0"), 1e-3, 9);
  CHECK(chemistry.error <= 1.1);
  CHECK(chemistry.steps <= 1.02);
  const Gain elastic = gain(slider_crank("index 0"), 1e-3, 9);  // errors scatter by 5 here
  CHECK(elastic.error <= 2.0);
  CHECK(elastic.steps <= 1.15);  // 1.3 with orders 1 and 2 raised as well
}

TEST_CASE("raised order: rows are kept as without it") {
  for (const Problem& p : {pendulum(1.0, 9.81, 10.0, "index 0"), car_axis("index 0")})
    for (const double tolerance : {1e-4, 1e-7}) {
      INFO(p.name << ", tolerance " << tolerance);
      const Run run = integrate(p, tolerance, p.recommended_constraints(), raised);
      REQUIRE(run.flag >= 0);
      CHECK(run.distance <= tp::Options().tolerance);
    }
}

TEST_CASE("raised order: without its conditions runs are those without it, bit for bit") {
  const auto same = [](const Problem& p, tp::Options options) {
    const Run without = integrate(p, 1e-6, p.recommended_constraints(), options, false);
    options.raise_order = true;
    const Run with = integrate(p, 1e-6, p.recommended_constraints(), options, false);
    return same_bits(with.y, without.y) && with.steps == without.steps;
  };
  const Problem p = lotka_volterra(2.0, 0.5, 10.0);
  tp::Options options;
  options.frequency = 3;
  CHECK(same(p, options));
  options = {};
  options.step_smoothing = true;
  CHECK(same(p, options));
  options = {};
  options.extra_iterations = 0;
  CHECK(same(p, options));
  CHECK(same(pendulum(1.0, 9.81, 5.0, "index 2"), {}));  // smoothed by itself
  CHECK_FALSE(same(p, {}));
  CHECK_FALSE(same(pendulum(1.0, 9.81, 5.0, "index 1"), {}));
}

// Tether: the order where high ones excite oscillations. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <problems/kepler.hpp>
#include <problems/pendulum.hpp>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

/// A point on a circle (angle t), driving undamped oscillators: q' = w v, v' = -w q + x / 10, with
/// w from 30 to 3000 / s, released in their slow motion but for `amplitude`. Lengths and tolerances
/// in `unit`.
Problem driven_oscillators(double t_end, double amplitude, double unit = 1.0) {
  constexpr int kModes = 12;
  const auto w = [](int i) { return 30.0 * std::pow(100.0, i / (kModes - 1.0)); };
  // q = c cos t, v = -(c / w) sin t with c = w / (w^2 - 1) / 10.
  const auto slow = [w](int i) { return 0.1 * w(i) / (w(i) * w(i) - 1.0); };
  std::vector<double> y0 = {unit, 0.0};
  for (int i = 0; i < kModes; ++i) {
    y0.push_back(unit * (slow(i) + amplitude));
    y0.push_back(0.0);
  }
  Problem p = ode(y0, t_end, [w](double, const double* y, double* f) {
    f[0] = -y[1];
    f[1] = y[0];
    for (int i = 0; i < kModes; ++i) {
      f[2 + 2 * i] = w(i) * y[3 + 2 * i];
      f[3 + 2 * i] = -w(i) * y[2 + 2 * i] + 0.1 * y[0];
    }
  });
  p.reference = {unit * std::cos(t_end), unit * std::sin(t_end)};
  for (int i = 0; i < kModes; ++i) {
    p.reference.push_back(unit * (slow(i) * std::cos(t_end) + amplitude * std::cos(w(i) * t_end)));
    p.reference.push_back(unit *
                          (-slow(i) / w(i) * std::sin(t_end) - amplitude * std::sin(w(i) * t_end)));
  }
  p.error_components = p.size;
  p.atol_scale.assign(static_cast<std::size_t>(p.size), unit);
  return p;
}

/// Largest difference from the reference, in tolerances of the circle's size.
double error(const Problem& p, const Run& run, double tolerance, double unit) {
  double largest = 0.0;
  for (std::size_t i = 0; i < p.y0.size(); ++i)
    largest = std::max(largest, std::abs(run.y[i] - p.reference[i]) / (tolerance * unit));
  return largest;
}

tp::Constraints on_circle_of(double unit) { return circle_of(unit * unit, "circle"); }

}  // namespace

TEST_CASE("oscillations of the tolerance's size are not excited: few steps, no large error") {
  for (const double unit : {1.0, 1e-8, 1e8})
    for (const auto& [tolerance, amplitude] :
         {std::make_pair(1e-3, 3.0), {1e-3, 10.0}, {1e-4, 10.0}}) {
      INFO("unit " << unit << ", tolerance " << tolerance << ", amplitude " << amplitude);
      const Problem p = driven_oscillators(6.0, amplitude * tolerance, unit);
      const Run run = integrate(p, tolerance, on_circle_of(unit), {}, false);
      REQUIRE(run.flag >= 0);
      CHECK(run.statistics.order_limited >= 1);
      CHECK(run.steps <= 900);  // 26 000 without
      CHECK(error(p, run, tolerance, unit) <= 60.0);
    }
}

TEST_CASE("without limit_order they are resolved, and the order is left alone") {
  tp::Options without;
  without.advanced.limit_order = false;
  const Problem p = driven_oscillators(0.5, 3e-3);
  const Run run = integrate(p, 1e-3, on_circle(), without, false);
  CHECK(run.statistics.order_limited == 0);
  CHECK(run.steps > 1000);
}

TEST_CASE("a motion that is to be resolved keeps its order: the same bits as without the limit") {
  tp::Options without;
  without.advanced.limit_order = false;
  for (const double tolerance : {1e-3, 1e-5, 1e-8}) {
    INFO("tolerance " << tolerance);
    for (const Problem& p : {kepler(0.6, 30.0), pendulum(1.0, 9.81, 5.0, "index 1"),
                             pendulum(1.0, 9.81, 5.0, "index 0")}) {
      INFO(p.name << ", " << p.form);
      const Run a = integrate(p, tolerance, p.recommended_constraints(), {}, false);
      const Run b = integrate(p, tolerance, p.recommended_constraints(), without, false);
      CHECK(a.statistics.order_limited == 0);
      CHECK(same_bits(a.y, b.y));
    }
  }
}

TEST_CASE("the order is not limited where differences of y' overflow in tolerances") {
  for (const int exponent : {0, 520}) {  // the same circle in other units of time
    const double w = std::ldexp(1.0, exponent);
    Problem p = ode({1.0, 0.0}, 20.0 / w, [w](double, const double* y, double* f) {
      f[0] = -w * y[1];
      f[1] = w * y[0];
    });
    p.reference = {std::cos(20.0), std::sin(20.0)};
    p.initial_step = std::ldexp(1e-4, -exponent);
    const Run run = integrate(p, 1e-6, on_circle(), {}, false);
    CHECK(run.statistics.order_limited == 0);
    CHECK(run.steps < 250);
    CHECK(run.error < 2e-5);
  }
}

TEST_CASE(
    "the limit ends: a second run has the steps of the first, and high orders where they pay") {
  const Problem p = driven_oscillators(6.0, 3e-3);
  Host host(p, 1e-3);
  host.attach(on_circle());
  REQUIRE(host.finish() >= 0);
  const long steps = host.steps();
  CHECK(host.projection().statistics().order_limited >= 1);
  REQUIRE(host.restart() == 0);
  REQUIRE(host.finish() >= 0);
  CHECK(host.steps() == steps);
}

TEST_CASE("where the oscillation has died out the limit ends, and the order rises again") {
  const Problem p = driven_oscillators(20.0, 3e-3);
  Host host(p, 1e-3);
  host.attach(on_circle());
  long limited_at = 0, low = 0, high = 0;
  while (host.t < p.t_end) {
    REQUIRE(host.step() >= 0);
    int order = 0;
    IDAGetLastOrder(host.ida, &order);
    if (limited_at == 0 && host.projection().statistics().order_limited > 0)
      limited_at = host.steps();
    if (limited_at > 0) ++(order >= 3 ? high : low);
  }
  REQUIRE(limited_at > 0);
  CHECK(low >= 40);
  CHECK(high >= 20);
}

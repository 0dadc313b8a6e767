// Tether: moves that stiff components must not notice. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "host.hpp"
#include "rod_chain.hpp"
#include "support/catch.hpp"

using namespace tether::test;

namespace {

/// A chain of rods whose joints springs keep straight, K |q_{i+1} - 2 q_i + q_{i-1}|^2 / 2 each, in
/// a form of index 1 with the rods' forces as unknowns; released at rest along the x axis. Its
/// vibrations have w up to 4 sqrt(K).
class BentRods {
 public:
  explicit BentRods(double spring = 1e6, int masses = 60)
      : spring_(spring), N(masses), chain_(masses, kRod) {}

  Problem problem(double t_end) const {
    Problem p = chain_.problem(t_end);
    p.index = 1;
    p.size = 5 * N;
    p.y0.resize(static_cast<std::size_t>(p.size), 0.0);
    p.yp0.assign(p.y0.size(), 0.0);
    for (int i = 0; i < N; ++i) p.yp0[static_cast<std::size_t>(2 * N + 2 * i + 1)] = -kGravity;
    p.id.assign(p.y0.size(), 1.0);
    std::fill(p.id.begin() + 4 * N, p.id.end(), 0.0);
    p.residual = [this](double, const double* y, const double* yp, double* r) {
      residual(y, yp, r);
    };
    p.jacobian = nullptr;
    return p;
  }
  tp::Constraints rows() const { return chain_.dense_rows(); }
  tp::Constraints sparse_rows() const { return chain_.sparse_rows(); }

  /// The energy over its kinetic part: 0 at the start, and for ever.
  double relative_energy(const std::vector<double>& state) const {
    const double* y = state.data();
    double kinetic = 0.0;
    for (int i = 0; i < 2 * N; ++i) kinetic += 0.5 * y[2 * N + i] * y[2 * N + i];
    double sum = kinetic;
    for (int i = 0; i < N; ++i) sum += kGravity * y[2 * i + 1];
    for (int a = 0; a + 2 < 2 * N; ++a) sum += 0.5 * spring_ * bend(y, a) * bend(y, a);
    return sum / kinetic;
  }

 private:
  static constexpr double kGravity = 9.81, kRod = 0.1;

  static double before(const double* x, int a) { return a >= 2 ? x[a - 2] : 0.0; }
  static double bend(const double* q, int a) { return q[a + 2] - 2.0 * q[a] + before(q, a); }

  void residual(const double* y, const double* yp, double* r) const {
    const double *v = y + 2 * N, *pull = y + 4 * N;
    for (int a = 0; a < 2 * N; ++a) {
      r[a] = yp[a] - v[a];
      r[2 * N + a] = yp[2 * N + a] + (a % 2 == 1 ? kGravity : 0.0);
    }
    double* const force = r + 2 * N;
    for (int a = 0; a + 2 < 2 * N; ++a) {
      const double moment = spring_ * bend(y, a);
      force[a + 2] += moment;
      force[a] -= 2.0 * moment;
      if (a >= 2) force[a - 2] += moment;
    }
    for (int i = 0; i < N; ++i) {
      double& row = r[4 * N + i] = 0.0;  // second derivative of the rod's length
      for (int a = 2 * i; a < 2 * i + 2; ++a) {
        const double d = y[a] - before(y, a), w = v[a] - before(v, a);
        force[a] += d * pull[i];
        if (a >= 2) force[a - 2] -= d * pull[i];
        row += w * w + d * (yp[2 * N + a] - before(yp + 2 * N, a));
      }
    }
  }

  double spring_;
  int N;
  RodChain chain_;
};

}  // namespace

TEST_CASE("rods with bending springs: fewer steps than plain IDA, no vibration is started") {
  const BentRods rods;
  const Problem problem = rods.problem(0.3);
  const std::vector<double> tolerances = {3e-3, 1.4e-3, 1e-3, 5e-4, 3e-4, 2e-4, 1e-4};
  double mean = 0.0, off = 0.0, off_plain = 0.0;
  for (const double tolerance : tolerances) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(problem, tolerance, rods.rows(), {}, false);
    const Run plain = integrate_plain(problem, tolerance);
    REQUIRE(run.flag >= 0);
    const double ratio = static_cast<double>(run.steps) / static_cast<double>(plain.steps);
    CHECK(ratio <= 0.8);
    mean += std::log(ratio) / static_cast<double>(tolerances.size());
    // Multipliers that follow late fail no corrector: without that 1 to 30 in each run.
    CHECK(run.statistics.corrector_failures <= 1);
    // Vibrations that moves start grow to a tenth of the energy; the formulas themselves damp.
    CHECK(rods.relative_energy(run.y) <= 1e-3);
    off += std::abs(rods.relative_energy(run.y));
    off_plain += std::abs(rods.relative_energy(plain.y));
    CHECK(run.statistics.largest_drift_after <= 1e-3 * tolerance);  // y(t_end) is interpolated
  }
  CHECK(std::exp(mean) <= 0.6);
  CHECK(off <= 0.5 * off_plain);
}

TEST_CASE("rods with bending springs: a small first step excites nothing") {
  const BentRods rods;
  Problem problem = rods.problem(0.3);
  problem.initial_step = 1e-5;
  double mean = 0.0;
  const std::vector<double> tolerances = {2.4e-4, 1.42e-4, 1.3e-4, 1.1e-4};
  for (const double tolerance : tolerances) {
    INFO("tolerance " << tolerance);
    Host host(problem, tolerance);
    host.attach(rods.rows());
    while (host.t < problem.t_end) REQUIRE(host.step() >= 0);
    CHECK(host.projection().statistics().order_limited >= 1);
    const Run plain = integrate_plain(problem, tolerance);
    const double ratio = static_cast<double>(host.steps()) / static_cast<double>(plain.steps);
    CHECK(ratio <= 0.9);
    mean += std::log(ratio) / static_cast<double>(tolerances.size());
  }
  CHECK(std::exp(mean) <= 0.65);
}

TEST_CASE("rods with bending springs: tight tolerances reach high orders after the start") {
  const BentRods rods;
  Problem problem = rods.problem(2e-3);
  problem.initial_step = 1e-8;
  Host host(problem, 1e-8);
  host.attach(rods.rows());
  int highest = 0;
  while (host.t < problem.t_end) {
    REQUIRE(host.step() >= 0);
    int order = 0;
    IDAGetLastOrder(host.ida, &order);
    highest = std::max(highest, order);
  }
  CHECK(highest == 5);
}

TEST_CASE("many rods at rest: rounding of their rows does not keep the start at order 1") {
  constexpr int kRods = 100;
  const BentRods rods(0.0, kRods);
  Problem problem = rods.problem(5e-4);
  // Placed one after the other: lengths are off by rounding.
  double end = 0.0;
  for (std::size_t i = 0; i < kRods; ++i) problem.y0[2 * i] = end += 0.1;
  const double fallen = 0.5 * 9.81 * problem.t_end * problem.t_end;
  for (const double tolerance : {3e-8, 1e-8, 3e-9, 1e-9}) {
    INFO("tolerance " << tolerance);
    Host host(problem, tolerance);
    host.attach(rods.sparse_rows());
    int low = 0;
    while (host.t < problem.t_end) {
      REQUIRE(host.step() >= 0);
      int order = 0;
      IDAGetLastOrder(host.ida, &order);
      low += order == 1 ? 1 : 0;
    }
    REQUIRE(IDAGetDky(host.ida, problem.t_end, 0, host.y) == 0);
    // At order 1, for 17 to 22 steps, the last mass, which falls freely, was 2 to 5 tolerances off.
    CHECK(low <= 3);
    CHECK(std::abs(host.data()[2 * kRods - 1] + fallen) <= 0.01 * tolerance);
  }
}

TEST_CASE("many rods: what all of them share is not repaired by the first ones alone") {
  constexpr int kRods = 70;
  const BentRods rods(0.0, kRods);
  Problem problem = rods.problem(0.06);
  problem.reference = integrate(problem, 1e-10, rods.sparse_rows(), {}, false).y;
  problem.error_components = 4 * kRods;  // positions and velocities
  const std::vector<double> tolerances = {1e-4, 5e-5, 2e-5, 1e-5, 5e-6, 2e-6, 1e-6, 5e-7};
  double mean = 0.0;
  for (const double tolerance : tolerances) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(problem, tolerance, rods.sparse_rows(), {}, false);
    REQUIRE(run.flag >= 0);
    mean += std::log(run.error / tolerance) / static_cast<double>(tolerances.size());
  }
  // 17 where the metric begins with each unknown's own scale, 7.7 with one for each level.
  CHECK(std::exp(mean) <= 11.0);
}

// Tether: entries of C that are zero at the start and not later. SPDX-License-Identifier:
// BSD-3-Clause
#include <cmath>
#include <problems/rows.hpp>

#include <problems/pendulum.hpp>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;

namespace {

constexpr double kEnd = 4.0;

/// 0 up to t = 0.05, then growing smoothly.
double late(double t) { return t > 0.05 ? (t - 0.05) * (t - 0.05) : 0.0; }

/// x = (sin t, cos t), by a rotation that a small pull off the solution disturbs by some
/// tolerances; z = x1 x2 algebraic.
Problem turning() {
  const double pull = 1e-6;
  Problem p = tether::problems::start_problem("turning", "index 1", 1, kEnd, {0.0, 1.0, 0.0},
                                              {1.0 + pull, 0.0, 0.0}, {1.0, 1.0, 0.0});
  p.residual = [pull](double, const double* y, const double* yp, double* r) {
    r[0] = yp[0] - y[1] - pull;
    r[1] = yp[1] + y[0];
    r[2] = y[2] - y[0] * y[1];
  };
  p.reference = {std::sin(kEnd), std::cos(kEnd), std::sin(kEnd) * std::cos(kEnd)};
  return p;
}

/// A row and its gradient, g of three unknowns.
struct Row {
  std::string name;
  std::function<double(double t, const double* y)> g;
  std::function<void(double t, const double* y, double* c)> gradient;
};

const Row only_late = {"late x1",
                       [](double t, const double* y) { return late(t) * (y[0] - std::sin(t)); },
                       [](double t, const double*, double* c) { c[0] = late(t); }};
const Row late_beside = {
    "late x1 beside x2",
    [](double t, const double* y) { return late(t) * (y[0] - std::sin(t)) + y[1] - std::cos(t); },
    [](double t, const double*, double* c) {
      c[0] = late(t);
      c[1] = 1.0;
    }};
const Row second = {"x2", [](double t, const double* y) { return y[1] - std::cos(t); },
                    [](double, const double*, double* c) { c[1] = 1.0; }};
const Row late_algebraic = {"late z beside x2",
                            [](double t, const double* y) {
                              return y[1] - std::cos(t) + late(t) * (y[2] - y[0] * std::cos(t));
                            },
                            [](double t, const double*, double* c) {
                              c[0] = -late(t) * std::cos(t);
                              c[1] = 1.0;
                              c[2] = late(t);
                            }};

enum class Kind { differences, dense, sparse, gradients };

tp::Constraints one(const Row& row, Kind kind) {
  tp::Constraints set;
  set.count = 1;
  set.names = {row.name};
  set.value = [row](double t, tp::ConstVector y, tp::Vector g) { g[0] = row.g(t, y.data()); };
  if (kind == Kind::dense)
    set.jacobian = tp::DenseJacobian{
        [row](double t, tp::ConstVector y, tp::Matrix c) { row.gradient(t, y.data(), c.data()); }};
  if (kind == Kind::sparse)
    set.jacobian = tp::SparseJacobian{
        {0, 3},
        {0, 1, 2},
        [row](double t, tp::ConstVector y, tp::Vector c) { row.gradient(t, y.data(), c.data()); },
        nullptr};
  if (kind == Kind::gradients) {
    set.value = nullptr;
    set.jacobian = tp::Gradients{
        [row](double t, N_Vector y, double* g) { g[0] = row.g(t, N_VGetArrayPointer(y)); },
        [row](double t, N_Vector y, N_Vector* c) {
          N_VConst(0.0, c[0]);
          row.gradient(t, N_VGetArrayPointer(y), N_VGetArrayPointer(c[0]));
        }};
  }
  return set;
}

/// Largest |x1 - sin t| and |x2 - cos t| over the steps from `from` on, in tolerances.
struct Seen {
  int flag = 0;
  double x1 = 0.0, x2 = 0.0, z = 0.0;
  long steps = 0;
  std::string message;
};

Seen run(const tp::Constraints& rows, double from) {
  constexpr double kTolerance = 1e-7;
  Host host(turning(), kTolerance);
  tp::Options options;
  options.print = false;
  options.advanced.largest_move = 1e3;  // a row that begins finds the error of the run so far
  host.attach(rows, options);
  Seen seen;
  while (host.t < kEnd && host.steps() < 3000 && (seen.flag = host.step()) >= 0) {
    if (host.t < from) continue;
    const double* y = host.data();
    seen.x1 = std::max(seen.x1, std::abs(y[0] - std::sin(host.t)) / kTolerance);
    seen.x2 = std::max(seen.x2, std::abs(y[1] - std::cos(host.t)) / kTolerance);
    seen.z = std::max(seen.z, std::abs(y[2] - y[0] * y[1]) / kTolerance);
  }
  seen.steps = host.steps();
  seen.message = host.projection().message();
  return seen;
}

}  // namespace

TEST_CASE("a row that vanishes at the start and for some time holds from then on") {
  for (const Kind kind : {Kind::differences, Kind::dense, Kind::sparse, Kind::gradients}) {
    INFO("kind " << static_cast<int>(kind));
    const Seen seen = run(one(only_late, kind), 2.5);
    INFO(seen.message);
    REQUIRE(seen.flag >= 0);
    CHECK(seen.steps < 1000);
    CHECK(seen.x1 < 1e-2);
  }
}

TEST_CASE("a column that enters a row late moves with the others") {
  for (const Kind kind : {Kind::differences, Kind::dense, Kind::sparse, Kind::gradients}) {
    INFO("kind " << static_cast<int>(kind));
    const Seen seen = run(one(second, kind) + one(late_beside, kind), 2.5);
    INFO(seen.message);
    REQUIRE(seen.flag >= 0);
    CHECK(seen.steps < 1000);
    CHECK(seen.x1 < 1e-2);
    CHECK(seen.x2 < 1e-2);
  }
}

TEST_CASE("an algebraic variable that enters a row late follows: nothing else is bent for it") {
  for (const Kind kind : {Kind::differences, Kind::dense, Kind::sparse, Kind::gradients}) {
    INFO("kind " << static_cast<int>(kind));
    const Seen seen = run(one(late_algebraic, kind), 0.0);
    INFO(seen.message);
    CHECK(seen.flag >= 0);
    CHECK(seen.steps < 1000);
  }
}

TEST_CASE("products that vanish at the start: project() and make_consistent() there") {
  // x1 x2 = 0 at (0, 1) in (x1, x2): the entry for x2 is zero; sin(t) x1 + x2 - 1: that for x1.
  const Row product = {"product", [](double, const double* y) { return y[0] * y[1]; },
                       [](double, const double* y, double* c) {
                         c[0] = y[1];
                         c[1] = y[0];
                       }};
  const Row sine = {"sine",
                    [](double t, const double* y) { return std::sin(t) * y[0] + y[1] - 1.0; },
                    [](double t, const double*, double* c) {
                      c[0] = std::sin(t);
                      c[1] = 1.0;
                    }};
  for (const Kind kind : {Kind::differences, Kind::dense, Kind::sparse, Kind::gradients}) {
    INFO("kind " << static_cast<int>(kind));
    Host host(turning(), 1e-7);
    tp::Options options;
    options.print = false;
    tp::Projection& projection = host.attach(one(product, kind) + one(sine, kind), options);
    for (const double t : {0.0, 0.5}) {
      N_VGetArrayPointer(host.y)[0] = 0.01;
      N_VGetArrayPointer(host.y)[1] = 1.02;
      N_VGetArrayPointer(host.y)[2] = 0.0;
      const tp::ConsistencyReport report = projection.project(t, host.y, host.yp);
      INFO(report.message);
      CHECK(report.status == tp::Status::success);
      CHECK(std::abs(host.data()[0]) < 1e-9);
      CHECK(std::abs(host.data()[1] - 1.0) < 1e-9);
    }
  }
}

TEST_CASE("a row that all but lacks an algebraic variable is solved for the others") {
  // Position row + c d + e d^2, d = lam - (v^2 - y): zero on the set, and so is its slope where c
  // is.
  for (const auto& [c, e] : {std::make_pair(0.0, 1e-6), {1e-9, 0.0}, {1e-12, 1e-3}})
    for (const char* form : {"index 1", "index 2", "GGL"})
      for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
        INFO(form << ", tolerance " << tolerance << ", c = " << c << ", e = " << e);
        const Problem problem = tether::problems::pendulum(1.0, 1.0, 10.0, form);
        const int n = problem.size;
        const tp::Constraints usual = problem.select({"position", "velocity"});
        const auto defect = [](tp::ConstVector y) {
          return y[4] - y[2] * y[2] - y[3] * y[3] + y[1];
        };
        tp::Constraints set;
        set.count = usual.total_count();
        set.value = [=, c = c, e = e](double t, tp::ConstVector y, tp::Vector g) {
          g = value(usual, t, y.data(), n);
          g[0] += c * defect(y) + e * defect(y) * defect(y);
        };
        set.jacobian =
            tp::DenseJacobian([=, c = c, e = e](double t, tp::ConstVector y, tp::Matrix C) {
              C = jacobian(usual, t, y.data(), n);
              const double slope = c + 2.0 * e * defect(y);
              C(0, 1) += slope;
              C(0, 2) -= 2.0 * slope * y[2];
              C(0, 3) -= 2.0 * slope * y[3];
              C(0, 4) += slope;
            });
        const Run without = integrate(problem, tolerance, usual, {}, false);
        for (const bool sparse : {false, true}) {
          const Run run =
              integrate(problem, tolerance, sparse ? as_sparse(set, n) : set, {}, false);
          INFO((sparse ? "sparse: " : "dense: ") << run.message);
          REQUIRE(run.flag >= 0);
          CHECK(run.error <= 3.0 * without.error + tolerance);
          CHECK(static_cast<double>(run.steps) <= 1.1 * static_cast<double>(without.steps));
          CHECK(run.statistics.failures() == 0);
        }
      }
}

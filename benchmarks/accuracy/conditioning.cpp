// Tether: how much a problem multiplies errors by itself. SPDX-License-Identifier: BSD-3-Clause
#include "conditioning.hpp"

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <tether/linalg/least_squares.hpp>

#include "explicit_form.hpp"
#include "projection/run.hpp"
#include "rows_of.hpp"

namespace tether::bench {

namespace {

using problems::Problem;

// Gauss-Newton by the least move, redundant rows or not.
void onto(const ida_projection::Constraints& rows, double t, Eigen::VectorXd& y) {
  Eigen::VectorXd g(rows.total_count());
  RowMajor C(rows.total_count(), y.size());
  for (int iteration = 0; iteration < 4; ++iteration) {
    evaluate_rows(rows, t, y, g, C);
    linalg::LeastSquares factors(1e-9);
    factors.factor(C);
    y -= factors.solve(g);
  }
}

Problem changed(const Problem& problem, const ExplicitForm& form, double size, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Problem moved = problem;
  Eigen::Map<Eigen::VectorXd> start(moved.y0.data(), moved.size);
  Eigen::VectorXd y = start;
  for (Eigen::Index i = 0; i < y.size(); ++i)
    y[i] += size * (1.0 + std::abs(y[i])) * uniform(random);
  onto(problem.recommended_constraints(), problem.t0, y);
  start = y;
  form.evaluate(moved.t0, moved.y0.data(), moved.yp0.data(), true);
  return moved;
}

double distance(int components, const double* a, const double* b) {
  double worst = 0.0;
  for (int i = 0; i < components; ++i)
    worst = std::max(worst, std::abs(a[i] - b[i]) / (1.0 + std::abs(a[i])));
  return worst;
}

}  // namespace

double amplification(const Case& which) {
  for (const Problem& problem : which.forms) {
    if (!problem.sparse.starts.empty()) continue;
    const ExplicitForm form(problem);
    if (!form.ordinary()) continue;
    Settings settings;
    settings.limits = {300000, 2.0};
    settings.constraints = problem.recommended_constraints();
    settings.options.print = false;
    const Run still = integrate(problem, 1e-9, settings);
    double worst = std::nan("");
    for (const unsigned seed : {1u, 2u}) {
      const Problem moved = changed(problem, form, 1e-5, seed);
      const Run run = integrate(moved, 1e-9, settings);
      const double before = distance(problem.size, problem.y0.data(), moved.y0.data());
      if (still.failed || run.failed || !(before > 0.0)) continue;
      worst = std::fmax(worst,
                        distance(problem.error_components, still.y.data(), run.y.data()) / before);
    }
    return worst;
  }
  return std::nan("");
}

}  // namespace tether::bench

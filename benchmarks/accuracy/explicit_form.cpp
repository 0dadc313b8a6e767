// Tether: M y' = f(t, y) out of F(t, y, y') = 0, for codes that want it so.
// SPDX-License-Identifier: BSD-3-Clause
#include "explicit_form.hpp"

#include <cmath>

namespace tether::bench {

namespace {

std::vector<double> mass_at(const problems::Problem& problem, const std::vector<double>& y) {
  const auto N = static_cast<std::size_t>(problem.size);
  std::vector<double> yp(N, 0.0), base(N), moved(N), mass(N * N);
  problem.residual(problem.t0, y.data(), yp.data(), base.data());
  double probe = 1.0;  // F is linear in y': any size gives M, a large one with less round-off
  for (const double value : base)
    if (std::isfinite(value)) probe = std::max(probe, std::abs(value));
  for (std::size_t j = 0; j < N; ++j) {
    yp[j] = probe;
    problem.residual(problem.t0, y.data(), yp.data(), moved.data());
    yp[j] = 0.0;
    for (std::size_t i = 0; i < N; ++i) mass[i + N * j] = (moved[i] - base[i]) / probe;
  }
  return mass;
}

}  // namespace

ExplicitForm::ExplicitForm(const problems::Problem& problem)
    : problem_(problem), zero_(static_cast<std::size_t>(problem.size), 0.0) {
  const auto N = static_cast<std::size_t>(problem.size);
  mass_ = mass_at(problem, problem.y0);
  double largest = 0.0;
  for (const double entry : mass_) largest = std::max(largest, std::abs(entry));
  for (const double shift : {0.013, -0.021}) {
    std::vector<double> y = problem.y0;
    for (std::size_t i = 0; i < N; ++i)
      y[i] += shift * (0.1 + std::abs(y[i])) * (1.0 + 0.3 * static_cast<double>(i % 5));
    const std::vector<double> other = mass_at(problem, y);
    for (std::size_t k = 0; k < N * N; ++k)
      if (!(std::abs(other[k] - mass_[k]) <= 1e-12 * largest)) constant_ = false;
  }
  for (std::size_t j = 0; j < N; ++j) {
    for (std::size_t i = 0; i < N; ++i) {
      double& entry = mass_[i + N * j];
      if (std::abs(entry) <= 1e-14 * largest) entry = 0.0;  // round-off of the differences
      if ((i == j) != (entry != 0.0)) ordinary_ = false;
    }
  }
}

void ExplicitForm::evaluate(double t, const double* y, double* f, bool solved) const {
  problem_.residual(t, y, zero_.data(), f);
  const auto N = static_cast<std::size_t>(problem_.size);
  for (std::size_t i = 0; i < N; ++i) f[i] = solved ? -f[i] / mass_[i * (N + 1)] : -f[i];
}

}  // namespace tether::bench

// Tether: work against error, and CPU at equal error. SPDX-License-Identifier: BSD-3-Clause
#include "curve.hpp"

#include <algorithm>
#include <cmath>

namespace tether::bench {

void Curve::add(bool failed, double error, double cpu_ms) {
  if (failed || !(error > 0.0) || !(error < 1e-1) || !(cpu_ms > 0.0)) return;
  log_error.push_back(std::log10(error));
  log_cpu.push_back(std::log10(cpu_ms));
}

double Curve::cpu_at(double error, double width) const {
  const double x = std::log10(error);
  if (log_error.size() < 3 || x < *std::min_element(log_error.begin(), log_error.end()) - 0.3 ||
      x > *std::max_element(log_error.begin(), log_error.end()) + 0.3)
    return std::nan("");
  double s = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (std::size_t i = 0; i < log_error.size(); ++i) {
    const double dx = log_error[i] - x, dy = log_cpu[i];
    const double w = width > 0.0 ? std::exp(-dx * dx / (2.0 * width * width)) : 1.0;
    s += w;
    sx += w * dx;
    sy += w * dy;
    sxx += w * dx * dx;
    sxy += w * dx * dy;
  }
  // Errors that hardly differ (a run on its round-off floor) have a mean, but no slope.
  const double spread = s * sxx - sx * sx;
  if (spread <= 1e-2 * s * s) return std::pow(10.0, sy / s);
  return std::pow(10.0, (sxx * sy - sx * sxy) / spread);
}

Best best(const std::vector<Curve>& curves, double error, double width) {
  Best found{std::nan(""), "-"};
  for (const Curve& curve : curves) {
    const double cpu = curve.cpu_at(error, width);
    if (std::isnan(cpu) || cpu >= found.cpu) continue;
    found = {cpu, curve.title};
  }
  return found;
}

void GeometricMean::add(double value) {
  if (!(value > 0.0) || !std::isfinite(value)) return;
  sum_ += std::log(value);
  largest_ = std::max(largest_, value);
  ++count_;
}

double GeometricMean::value() const { return count_ > 0 ? std::exp(sum_ / count_) : std::nan(""); }

double median(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<double> tolerance_ladder(double loose, double tight, int count) {
  std::vector<double> tolerances;
  for (int k = 0; k < count; ++k)
    tolerances.push_back(loose * std::pow(tight / loose, count > 1 ? k / (count - 1.0) : 0.0));
  return tolerances;
}

}  // namespace tether::bench

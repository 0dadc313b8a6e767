// Tether: work against error, and CPU at equal error. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace tether::bench {

/// CPU time against end error of one code on one form, over its tolerances. Single end errors
/// scatter by a factor of three or more, so nothing is read off between two neighbouring runs: the
/// curve is a least-squares line log CPU against log error.
struct Curve {
  std::string title;
  std::vector<double> log_error, log_cpu;  ///< base 10; CPU in ms

  /// Takes the run in unless it failed or its error says nothing (> 0.1).
  void add(bool failed, double error, double cpu_ms);

  /// CPU in ms at this error; NaN outside what was reached by more than a factor of two. `width`:
  /// decades of error within which runs count for the line (Gaussian weight); 0: all alike.
  double cpu_at(double error, double width = 0.0) const;
};

/// The cheapest curve at an error; CPU NaN and title "-" when none reaches it.
struct Best {
  double cpu;
  std::string title = "-";
};
Best best(const std::vector<Curve>& curves, double error, double width = 0.0);

/// Geometric mean of positive finite values; others are left out.
class GeometricMean {
 public:
  void add(double value);
  int count() const { return count_; }
  double value() const;  ///< NaN when empty
  double largest() const { return largest_; }

 private:
  double sum_ = 0.0, largest_ = 0.0;
  int count_ = 0;
};

double median(std::vector<double> values);

/// count tolerances from loose to tight, equally spaced in their logarithms.
std::vector<double> tolerance_ladder(double loose, double tight, int count);

}  // namespace tether::bench

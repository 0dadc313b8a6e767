// Tether: storage of few rows given by their gradients, for VectorRows.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/ida_projection/constraints.hpp>
#include <tether/ida_projection/statistics.hpp>
#include <vector>

#include "constraints/evaluator.hpp"
#include "movers/vector/vector_metric.hpp"
#include "rows/gradient_rows.hpp"

namespace tether::ida_projection {

/// Rows that are Gradients, and their factors. g and the factors are the same on every process.
class GradientStore {
 public:
  GradientStore(const Constraints& constraints, Statistics& statistics, N_Vector like,
                RowsReport& report);

  Status value(double t, N_Vector y);
  Status fill(double t, N_Vector y);
  Status factor(const VectorMetric& metric, N_Vector terms_at);
  /// In the metric D, for tolerances WT.
  Status factor(N_Vector D, N_Vector WT);
  double solve(N_Vector D, N_Vector dy) {
    rows.solve(g, D, dy);
    return 0.0;
  }
  double drift() const;
  /// After fill().
  void sum_terms(N_Vector y);
  /// After fill().
  bool contains_algebraic(N_Vector id);
  bool whole() const { return rows.rank() == rows.rows(); }
  /// After factor() with terms, or sum_terms(): does the rounding of its own terms explain every
  /// g_i? It grows with the root of their number.
  bool rounding_only() const;
  bool contradict(N_Vector dy);

  GradientRows rows;  ///< with gradients after fill(), which factor() changes
  std::vector<double> g;

 private:
  struct Part {
    const Gradients* rows;
    int first, count;
  };
  int flatten(const Constraints& set, int first);

  const Constraints& constraints_;
  Statistics& statistics_;
  RowsReport& report_;
  std::vector<Part> parts_;
  OwnedVector work_;
  GuardedRoom room_;
  std::vector<double> terms_;  // sum_j |C_ij y_j|
};

}  // namespace tether::ida_projection

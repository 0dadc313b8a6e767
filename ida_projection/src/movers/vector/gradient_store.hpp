// Tether: storage of few rows given by their gradients, for VectorRows.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/ida_projection/constraints.hpp>
#include <tether/ida_projection/statistics.hpp>
#include <vector>

#include "constraints/evaluator.hpp"
#include "movers/vector/rows_report.hpp"
#include "movers/vector/vector_metric.hpp"
#include "rows/gradient_rows.hpp"

namespace tether::ida_projection {

/// Rows that are Gradients, and their factors. g and the factors are the same on every process.
class GradientStore {
 public:
  GradientStore(const Constraints& constraints, Statistics& statistics, N_Vector like);

  RowsReport report;

  Status value(double t, N_Vector y);
  Status fill(double t, N_Vector y);
  Status factor(const VectorMetric& metric, N_Vector terms_at);
  /// In the metric D, for tolerances WT.
  Status factor(N_Vector D, N_Vector WT);
  /// Until the next factor() only rows whose independent part is at least `least` take part.
  void keep_firm(double least) { rows_.keep_firm(least); }
  void solve(N_Vector D, N_Vector dy) { rows_.solve(g_, D, dy); }
  /// For other values than g.
  void solve(const std::vector<double>& wanted, N_Vector D, N_Vector dy) {
    rows_.solve(wanted, D, dy);
  }
  double left() const { return 0.0; }
  double drift() const;
  int rows() const { return rows_.rows(); }
  const std::vector<double>& g() const { return g_; }
  /// After fill(), changed by factor().
  std::vector<N_Vector>& gradients() { return rows_.gradients(); }
  /// After fill().
  void sum_terms(N_Vector y);
  /// After fill().
  bool contains_algebraic(N_Vector id);
  bool whole() const { return rows_.rank() == rows_.rows(); }
  /// After factor() with terms, or sum_terms(): does the rounding of its own terms explain every
  /// g_i? It grows with the root of their number.
  bool rounding_only() const;
  bool contradict(N_Vector dy);

 private:
  struct Part {
    const Gradients* rows;
    int first, count;
  };

  int flatten(const Constraints& set, int first);
  Status failed(int flag, const char* what, const std::string& thrown);

  const Constraints& constraints_;
  Statistics& statistics_;
  std::vector<Part> parts_;
  OwnedVector work_;
  GradientRows rows_;
  std::vector<double> g_;
  GuardedRoom room_;
  std::vector<double> terms_;  // sum_j |C_ij y_j|
};

}  // namespace tether::ida_projection

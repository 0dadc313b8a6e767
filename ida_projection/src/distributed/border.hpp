// Tether: a few full rows beside many sparse ones. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <tether/ida_projection/constraints.hpp>
#include <tether/ida_projection/statistics.hpp>
#include <vector>

#include "movers/vector/gradient_store.hpp"

namespace tether::ida_projection {

/// Full rows q joined to sparse rows C. Let w be the part of q that is orthogonal to the rows of C
/// in the metric: a move along w changes the values of q alone. The shortest move for C, followed
/// by moves along the w for what is left of the q, is the shortest move for all. A q that depends
/// on C has no w and must hold by itself.
class Border {
 public:
  /// move <- the shortest one with C move = C v.
  using Onto = std::function<void(N_Vector v, N_Vector move)>;

  /// `constraints`: the rows C, and what is joined to them.
  Border(const Constraints& constraints, N_Vector like);

  bool empty() const { return raw_.empty(); }
  /// g and C of the full rows, their drift, what they report.
  GradientStore& rows() { return rows_; }
  const GradientStore& rows() const { return rows_; }
  /// After rows().fill(). `onto` is called as often on every process.
  Status factor(const VectorMetric& metric, const Onto& onto);
  /// dy, the shortest move for C, becomes that for all rows.
  void add(N_Vector D, N_Vector dy);
  bool whole() const;
  /// After add().
  bool contradict();

 private:
  static Constraints joined(const Constraints& all);

  Constraints set_;
  Statistics uncounted_;  // whoever asks for C counts
  GradientStore rows_;
  std::vector<OwnedVector> raw_;
  std::vector<char> depends_;  // on C
  std::vector<double> wanted_, beyond_, may_be_left_;
  OwnedVector work_;
  long unknowns_;  // of this process
};

}  // namespace tether::ida_projection

// Tether: what is wrong with rows at a point. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "constraints/evaluator.hpp"
#include "host/corrector.hpp"

namespace tether::ida_projection {

/// At an invariant the terms of C y' cancel to less than this part of their size.
constexpr double kNoInvariant = 1e-2;

/// Looks for faults of rows at (t, y), on contiguous vectors. Texts name the fault; empty: none was
/// found, or g is not known there.
class RowFaults {
 public:
  RowFaults(const Constraints& constraints, Statistics& statistics)
      : constraints_(constraints), evaluator_(constraints, statistics) {}

  /// Whether rows on n unknowns can be searched column by column.
  bool may_search(std::size_t n) const;
  /// So that rates() never allocates.
  void reserve(std::size_t n);
  /// "row 2 (energy)".
  std::string name(int row) const;

  /// Names the entry of C that check_jacobian finds wrong, with the reason where that is a kink.
  std::string wrong_entry(double t, const std::vector<double>& y);
  /// Names the row whose C y' + g_t is largest beside its terms, where it is no invariant.
  std::string unkept(double t, const std::vector<double>& y, const std::vector<double>& yp,
                     const std::vector<double>& WT);
  /// Names one of the rows that holds one side of its set only: g_i is constant to one side along
  /// some direction, and moves to the other. Five evaluations of g for all of them.
  std::string one_sided(const std::vector<int>& rows, double t, const std::vector<double>& y);

  /// Names the rows whose gradients, in tolerances WT, depend on each other.
  std::vector<std::string> dependent(double t, const std::vector<double>& y,
                                     const std::vector<double>& WT);

  /// dg/dt of each row along y' by differences of g, independent of C, to either side; false: g is
  /// not known. Where F jumps, a row that it keeps has a kink, and only one side agrees. 0 where
  /// the sides contradict.
  bool rates(double t, const std::vector<double>& y, const std::vector<double>& yp,
             std::vector<double>& out);
  /// Largest relative rate of an unknown, or of t.
  static double fastest(double t, const std::vector<double>& y, const std::vector<double>& yp);

  /// The text of a row that F does not keep, with advice.
  std::string unkept_text(int row, const std::string& where, double rate, double terms) const;
  /// A callback that asked for the end of the run ends it.
  void pass_end_to(Corrector& corrector) {
    if (evaluator_.report.fatal) corrector.stop(-1, evaluator_.report.text);
    evaluator_.report.fatal = false;
  }

 private:
  bool value(double t, const std::vector<double>& y, std::vector<double>& g);
  bool jacobian(double t, const std::vector<double>& y, const std::vector<double>& WT);

  const Constraints& constraints_;
  Evaluator evaluator_;
  std::vector<double> moved_, C_;
  std::vector<double> here_, sides_[4];
};

}  // namespace tether::ida_projection

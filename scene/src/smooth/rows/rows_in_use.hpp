// Tether: which rows of the joints are used. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/pivoted_qr.hpp>

#include "joint_gradient.hpp"
#include "sparse_row_choice.hpp"

namespace tether::scene::smooth {

/// The rows that the projection keeps, and those that carry multipliers, chosen along the motion
/// where rows depend on each other; see rows_in_use.cpp.
class RowsInUse {
 public:
  /// Counts independent rows at the start of the scene; leaves `bodies` in some other state.
  RowsInUse(JointRows& rows, MovingBodies& bodies);

  /// Rows that the projection keeps, in `used()`, one of them in several places near a singular
  /// position.
  int count() const { return count_; }
  const std::vector<int>& used() const { return used_; }
  int place_of(int row) const { return place_of_used_[at(row)]; }  ///< first in used(), or -1
  bool carries_multiplier(int row) const {
    return (sparse_ ? sparse_->carriers().has[at(row)] : carries_[at(row)]) != 0;
  }
  /// Many rows, each in its own place for the whole run; one that is not kept now counts as zero.
  bool in_place() const { return in_place_; }
  bool keeps(int row) const { return sparse_ ? sparse_->keeps(row) : place_of(row) >= 0; }
  /// Grows when other rows carry multipliers: the matrix has other zeros then.
  int multiplier_choices() const { return multiplier_choices_; }
  /// How far the rows in use are from depending on each other: the length of what the last one adds
  /// to the others, rows of unit length; 0 at a singular position, 1 without joints.
  double weakest_pivot() const { return weakest_; }

  /// Chooses at the state that is set, for this local tolerance from now on.
  void choose(double tolerance);
  /// After a step, at the state that is set. True: used() has other rows than before.
  void choose_after_step();
  void choose_now() { choose(); }

 private:
  bool independent_by_structure() const;
  int count_needed_beyond(const Eigen::VectorXd& length, const linalg::PivotedQr& qr);
  bool choose();
  void choose_sparse();
  void choose_multipliers();

  JointRows& rows_;
  MovingBodies& bodies_;
  double weak_ = 0;  // pivot below which a row is not used
  bool in_place_ = false;
  std::unique_ptr<SparseRowChoice> sparse_;  // in place, with closed loops
  int count_ = 0;
  std::vector<int> used_, before_, place_of_used_;
  std::vector<char> carries_;
  double weakest_ = 1;
  int multiplier_choices_ = 0;
  int wait_ = 0;  // steps until the next choice
  JointGradient gradient_;
  Eigen::MatrixXd carried_gradient_;
  linalg::PivotedQr row_choice_, carried_rows_;
};

}  // namespace tether::scene::smooth

// Tether: independent rows of many joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "joint_gradient.hpp"

namespace tether::scene::smooth {

/// Rows whose weakest pivot is less than this part of another set's are much worse.
constexpr double kMuchWorse = 0.1;

/// A set of rows, one entry each, and how far its rows are from depending on each other: the least
/// that those before it leave of one, in the metric of M; 1 without rows, 0 where some do.
struct RowSet {
  std::vector<char> has;
  int count = 0;
  double weakest = 1;
};

/// Rows of joints chosen by the entries of their gradient: those that the projection keeps and
/// those that carry multipliers. What RowsInUse says of them, for scenes with many closed loops.
class SparseRowChoice {
 public:
  /// Finds out, near the start of the scene, how many rows are independent where it moves; leaves
  /// `bodies` in some other state.
  SparseRowChoice(JointRows& rows, MovingBodies& bodies);

  /// At the state that is set; rows of which others leave less than `weak` are not kept. True:
  /// other rows carry multipliers now.
  bool choose(double weak);
  bool keeps(int row) const { return kept_.has[at(row)] != 0; }
  const RowSet& carriers() const { return carriers_; }
  /// From which weakest pivot of the carriers on nothing is to be feared for some steps.
  double good() const;

 private:
  RowSet independent_among(const std::vector<char>& wanted, double dependent);
  void add_thin(RowSet& set);
  RowSet best(int count, double weak);
  double reach() const;
  void move(std::vector<double>& y, const Eigen::VectorXd& v) const;
  void move_freely(std::vector<double>& y);
  void close(std::vector<double>& y);

  JointRows& rows_;
  MovingBodies& bodies_;
  SparseJointGradient gradient_;
  std::vector<char> all_;
  RowSet kept_, carriers_;
  int seen_ = 0;              // of the carriers, those that the factors tell from dependent ones
  double usual_ = 1;          // the largest that their weakest pivot was so far
  double weakest_found_ = 0;  // of the carriers at the last search for better ones
  int steps_to_search_ = 0;   // until the next one
};

}  // namespace tether::scene::smooth

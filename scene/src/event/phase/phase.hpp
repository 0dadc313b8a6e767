// Tether: one smooth phase in the hands of IDA and the projection (method, eq. 3).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/engine.hpp>

#include "motion.hpp"

namespace tether::scene::event {

/// From (t, y) on, with the modes that `motion` has. Its clock starts at 0, so that steps far
/// shorter than the rounding of t can be taken.
class Phase {
 public:
  /// `tolerance`: rtol and atol of IDA; `longest_first`: the first step is no longer, 0: free.
  /// No step passes `length` (s, may be infinite), where forces have a kink.
  Phase(Motion& motion, double tolerance, double max_step, double t, const VectorXd& y,
        double longest_first, double length);
  ~Phase();
  Phase(const Phase&) = delete;
  Phase& operator=(const Phase&) = delete;

  /// One step of IDA; throws SimulationError.
  void step();
  double tolerance() const { return tolerance_; }  ///< of IDA
  double start() const { return start_; }          ///< s
  double step_begin() const { return begin_; }     ///< since the start, s
  double step_end() const { return end_; }
  bool is_at_end() const { return end_ >= length_; }  ///< of its length
  /// y at a time of the last step, since the start: interpolated.
  void at(double time, VectorXd& y) const;
  /// The same, moved onto the constraints; false: it could not be.
  bool projected_at(double time, VectorXd& y);
  /// Joints would be better held by other rows than those that were chosen at the start.
  bool has_weak_rows() const;
  Counts counts() const;  ///< of IDA

 private:
  struct Ida;
  Motion& motion_;
  double tolerance_, start_, begin_ = 0, end_ = 0, length_;
  std::unique_ptr<Ida> ida_;
};

/// y moved onto the constraints of the motion at t in the weights of the tolerance, as for the
/// start of a phase. False: it cannot be.
bool move_onto_constraints(Motion& motion, double tolerance, double t, VectorXd& y);

}  // namespace tether::scene::event

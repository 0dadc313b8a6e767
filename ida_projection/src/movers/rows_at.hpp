// Tether: the rows at a candidate, as Newton's method onto them wants them (method, section 3).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <sundials/sundials_nvector.h>
#include <tether/ida_projection/projection.hpp>
#include <vector>

#include "host/candidate.hpp"

namespace tether::ida_projection {

/// How far y' points out of the constraints.
struct Tangency {
  std::vector<double> rate;       ///< sum_j C_ij y'_j
  std::vector<double> terms;      ///< sum_j |C_ij y'_j|; < 0: the row contains algebraic variables
  std::vector<double> size;       ///< sum_j |C_ij| max(1, |y_j|), of differential y_j
  std::vector<double> tolerance;  ///< |row_i(C WT)|, a move of one tolerance
};

/// The move dy for the present g by the current factors.
struct Solution {
  Status status = Status::success;
  double length = 0.0;  ///< WRMS, in tolerances, of what the error test sees
  double left = 0.0;    ///< the part of it that an iterative solution has left
};

/// The purpose of a solution.
enum class Solve {
  first,  ///< the factors are new: which of the rows are to be trusted is decided
  again,  ///< the same rows as before
  rest,   ///< what a move or a polish has left
  test    ///< no move follows
};

/// g, C and its factors in one storage, for the candidate that was loaded last. Newton's loop asks
/// for load, value, factor, solve, apply and the sizes that rounding explains; the rest of the
/// functions says what the storage is good for.
class RowsAt {
 public:
  /// The same for a storage's whole life.
  struct Traits {
    /// Is there a g? A projection of the caller's own tells none, and one solution is all of it.
    bool gives_g = true;
    /// Are second moves cheap beside the factors? Then what is left is seen on each candidate.
    bool measures_rest = false;
    /// Are there so many rows that moves in the metric may be rough, or be polished before?
    bool many = false;
  };
  explicit RowsAt(const Traits& these) : traits(these) {}
  virtual ~RowsAt() = default;

  const Traits traits;

  /// y = base + correction. `refills`: factors of this candidate's metric follow; else its scale is
  /// looked at.
  virtual Status load(const Candidate& candidate, bool refills) = 0;
  /// g at y; `with_rows`: C will be wanted, too.
  virtual Status value(double t, bool with_rows) = 0;
  /// C at y and its factors; `refill`: in the metric of the correction as it is now.
  virtual Status factor(double t, bool refill) = 0;
  virtual Solution solve(Solve how) = 0;
  /// y and the correction move by -share dy.
  virtual Status apply(double share, const Candidate& candidate) = 0;
  /// WRMS of y and of the corrector's change, in tolerances.
  virtual double size() const = 0;
  virtual double change() const = 0;
  /// Does the rounding of its own terms explain every g_i? The length of a move that it explains.
  virtual bool rounding_only() { return false; }
  virtual double rounding_length() { return 0.0; }

  /// y moves with a correction that was changed; the length of that over the variables that the
  /// error test sees, in tolerances.
  virtual double shift(N_Vector change) = 0;
  /// y for the correction as it is.
  virtual void restart(const Candidate& candidate) = 0;
  /// Largest |g_i| as evaluated last.
  virtual double drift() const = 0;

  virtual bool has_factors() const = 0;
  /// May they tell that there is nothing to move?
  virtual bool may_test_with_factors() const { return has_factors(); }
  /// Was it found out for this candidate which rows are independent?
  virtual bool decided() const { return true; }
  virtual void forget_rank() {}
  /// May the correction be polished before the move?
  virtual bool may_polish_first() const { return false; }
  /// Rows that a solution leaves out contradict the others: `message` and `contradicting` say it.
  virtual bool contradicts() = 0;
  /// Moves were broken or many: perhaps for want of entries that g could not fill before.
  virtual void refresh_pattern_soon() {}

  /// Which components are algebraic (1 differential, 0 algebraic; null: none), at a candidate.
  virtual Status set_algebraic(const Candidate& candidate, N_Vector id) = 0;
  /// D as the last candidate had it, of every component; false: there is none.
  virtual bool metric(N_Vector /*D*/) const { return false; }
  /// The attempt that used the last candidate was accepted: its scale is kept.
  virtual void accept() {}
  virtual void reset() = 0;
  /// One scale for all unknowns of a level (row_levels.hpp) from the next move on, or each its own
  /// again. False: nothing changes, there are too few rows or levels.
  virtual bool use_levels(bool) { return false; }
  virtual bool may_use_levels() const { return false; }

  /// C y' row by row with C as it was evaluated last. False: not known.
  virtual bool tangency(const std::vector<double>& /*yp*/, const double* /*id*/, Tangency&) {
    return false;
  }

  /// Did a callback ask for the end of the run since forget_failure(), in any evaluation?
  virtual bool fatal() const = 0;
  virtual void forget_failure() = 0;

  std::string message;             ///< of what failed
  std::vector<int> contradicting;  ///< rows
};

}  // namespace tether::ida_projection

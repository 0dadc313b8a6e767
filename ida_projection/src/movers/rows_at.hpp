// Tether: the interface of stored rows to Newton's method (method, section 3).
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
  double length = 0.0;  ///< WRMS over the variables of the error test, in tolerances
  double left = 0.0;    ///< part of the move that an iterative solution has left
  int rank = 0;         ///< of Solve::point: rows that take part, if that is known
};

/// The purpose of a solution.
enum class Solve {
  first,  ///< the factors are new: which of the rows are to be trusted is decided
  again,  ///< the same rows as before
  rest,   ///< what a move or a polish has left
  test,   ///< no move follows
  point   ///< a point far away is looked for: all unknowns count
};

/// g, C and its factors for the candidate that was loaded last. Newton's loop calls load(),
/// value(), factor(), solve(), apply() and the functions about rounding. The other functions tell
/// what the storage can do.
class RowsAt {
 public:
  virtual ~RowsAt() = default;

  /// Whether there is a g. A projection of the caller's own has none and consists of one solution.
  virtual bool gives_g() const { return true; }

  /// Loads y = base + correction. `refills`: factor() in the metric of this candidate follows; else
  /// only its scale is updated.
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

  /// Moves y with a changed correction. Returns the length of `change` over the variables of the
  /// error test, in tolerances.
  virtual double shift(N_Vector change) = 0;
  /// Computes y anew from the present correction.
  virtual void restart(const Candidate& candidate) = 0;
  /// Largest |g_i| as evaluated last.
  virtual double drift() const = 0;

  /// Whether there are factors, and they may be used to see that no move is needed.
  virtual bool may_test_with_factors() const = 0;
  /// Whether the independent rows were determined for this candidate.
  virtual bool decided() const { return true; }
  virtual void forget_rank() {}
  /// Whether dropped rows contradict the kept ones; sets `message` and `contradicting`.
  virtual bool contradicts() = 0;
  /// Moves failed or were many: perhaps entries of C are missing that g could not fill before.
  virtual void refresh_pattern_soon() {}

  /// Which components are algebraic (1 differential, 0 algebraic; null: none), at a candidate.
  virtual Status set_algebraic(const Candidate& candidate, N_Vector id) = 0;
  /// D as the last candidate had it, of every component; false: there is none.
  virtual bool metric(N_Vector /*D*/) const { return false; }
  /// The attempt that used the last candidate was accepted: its scale is kept.
  virtual void accept() {}
  virtual void reset() = 0;
  /// From the next move on: one scale for all unknowns of a level (row_levels.hpp), or a scale for
  /// each unknown. Returns false if there are too few rows or levels.
  virtual bool use_levels(bool) { return false; }
  virtual bool may_use_levels() const { return false; }

  /// C y' row by row with C as it was evaluated last. False: not known.
  virtual bool tangency(const std::vector<double>& /*yp*/, const double* /*id*/, Tangency&) {
    return false;
  }

  /// Moves y' onto C y' + g_t = 0, nearest in the metric, with g_t by central differences. Returns
  /// false if it was not found.
  virtual bool tangent(double /*t*/, N_Vector /*yp*/) { return false; }

  /// Whether a callback has returned a fatal flag since forget_failure().
  virtual bool fatal() const = 0;
  virtual void forget_failure() = 0;

  std::string message;             ///< of what failed
  std::vector<int> contradicting;  ///< rows
};

}  // namespace tether::ida_projection

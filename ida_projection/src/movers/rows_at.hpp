// Tether: the interface of stored rows to Newton's method (method, section 3).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <sundials/sundials_nvector.h>
#include <tether/ida_projection/options.hpp>
#include <tether/ida_projection/projection.hpp>
#include <tether/ida_projection/statistics.hpp>
#include <vector>

#include "constraints/evaluator.hpp"
#include "host/candidate.hpp"

namespace tether::ida_projection {

/// How far y' points out of the constraints.
struct Tangency {
  std::vector<double> rate;       ///< sum_j C_ij y'_j
  std::vector<double> terms;      ///< sum_j |C_ij y'_j|; < 0: the row contains algebraic variables
  std::vector<double> size;       ///< sum_j |C_ij| max(1, |y_j|), of differential y_j
  std::vector<double> tolerance;  ///< |row_i(C WT)|, a move of one tolerance
};

struct Move {
  Status status = Status::unused;
  double length = 0.0;        ///< WRMS length of the whole move, in tolerances
  double drift_before = 0.0;  ///< largest |g_i| at the candidate
  int moves = 0;              ///< Newton moves made
  double floor = 0.0;         ///< measure(): length that rounding of y alone explains
  bool not_needed = false;    ///< no move was needed, which g and earlier factors have shown
  bool capped = false;
  double left = 0.0;  ///< of a capped move: what it lacks, in tolerances
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
  rest,   ///< the same for what a polish has left, too little to show which rows are independent
  test,   ///< the same, and no move follows
  point   ///< a point far away is looked for: all unknowns count
};

/// Rows that points are moved onto: g, C and its factors for the candidate that was loaded last,
/// and Newton's method by these (newton.hpp), which is about six of the functions and the data that
/// they leave. The notation is that of docs/method/projection.md: N unknowns, m rows, C = dg/dy, D
/// the metric, WT = 1/w the error weights, s the size of the corrector's changes.
class RowsAt {
 public:
  /// How the rows are given. A projection of the caller's own has no g and is one solution.
  enum class Kind { entries, vectors, projection };
  enum class Factors { none, of_some_rows, of_all_rows };

  explicit RowsAt(Kind of_rows) : kind(of_rows) {}
  virtual ~RowsAt() = default;
  RowsAt(const RowsAt&) = delete;
  RowsAt& operator=(const RowsAt&) = delete;

  const Kind kind;
  RowsReport report;
  double drift = 0.0;  ///< largest |g_i| as evaluated last
  Factors factors = Factors::none;
  int age = 0;  ///< of C and factors, in candidates that were tested with them

  /// A new run starts.
  virtual void reset() = 0;
  /// Length of the first Newton move from the candidate; the candidate is not changed.
  virtual Move measure(const Candidate& candidate) = 0;
  /// Moves the candidate: correction <- correction - dy.
  virtual Move move(const Candidate& candidate) = 0;
  /// After a successful move() the correction was changed by `change`: removes what this changes in
  /// g, with the current factors.
  virtual Status settle(const Candidate& candidate, N_Vector change) = 0;
  /// Largest |g_i| at the present candidate; -1 if g cannot be evaluated.
  virtual double remaining_drift(const Candidate& candidate) = 0;

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
  /// Whether rounding explains every g_i, by its own terms.
  virtual bool is_rounding() = 0;

  /// y follows the correction, which has changed by `change` (null: by anything). Returns the
  /// length of the change over the variables of the error test, in tolerances.
  virtual double follow(const Candidate& candidate, N_Vector change) = 0;
  /// WRMS of the corrector's change over these variables, in tolerances.
  virtual double corrected() const = 0;
  /// Whether dropped rows contradict the kept ones; reported then.
  virtual bool contradicts() { return false; }
  /// Moves do not converge. Whether the row that is least independent of the others is left out, at
  /// this candidate and some to come.
  virtual bool leave_out_weakest() { return false; }
  /// Moves failed: perhaps entries of C are missing that g could not fill before.
  virtual void refresh_pattern_soon() {}

  /// Which components are algebraic (1 differential, 0 algebraic; null: none), at a candidate.
  /// `repeats`: of each row, it is an equation of F; empty: none is.
  virtual Status set_algebraic(const Candidate& /*candidate*/, N_Vector /*id*/,
                               const std::vector<char>& /*repeats*/) {
    return Status::success;
  }
  /// Algebraic variables that rows are solved for, ascending; none where other rows move others, to
  /// which they respond.
  virtual const std::vector<int>& solved_for() const {
    static const std::vector<int> none;
    return none;
  }
  /// Length of the moves so far over algebraic variables that `Solution::length` leaves out.
  virtual double solved_length() const { return 0.0; }
  /// Whether no C that is evaluated later can ask for other blocks than set_algebraic() found.
  virtual bool keeps_blocks() const { return true; }
  /// The attempt that used the last candidate was accepted: its scale is kept.
  virtual void accept() {}
  /// From the next move on: one scale for all unknowns of a level (row_levels.hpp), or a scale for
  /// each unknown. Returns false if there are too few rows or levels.
  virtual bool use_levels(bool) { return false; }
  /// Whether moves in the local metric can be rough.
  virtual bool may_use_levels() const { return false; }
  /// C y' row by row with C as it was evaluated last. False: not known.
  virtual bool tangency(const std::vector<double>& /*yp*/, const double* /*id*/, Tangency&) {
    return false;
  }

  /// For moves on the tangent of the constraints, which leave rounding only: C at y, with the
  /// reciprocal tolerances of y; id and repeats as in set_algebraic(). Rows that are dependent on
  /// the set have dependent derivatives there, up to an error as large as the distance from the
  /// set: thin rows take no part.
  virtual Status linearise(double /*t*/, N_Vector /*y*/, N_Vector /*weights*/, N_Vector /*id*/,
                           const std::vector<char>& /*repeats*/) {
    return Status::misused;
  }
  /// Its factors in the metric D, one entry for each component.
  virtual Status factor_in(N_Vector /*D*/) { return Status::misused; }
  /// r = C s, with the accuracy that g allows, whatever C is good for.
  virtual Status product(N_Vector /*s*/, std::vector<double>& /*r*/) { return Status::misused; }
  /// The shortest ds with C ds = r.
  virtual void solve_for(const std::vector<double>& /*r*/, N_Vector /*ds*/) {}
  /// g at any point, for differences; its size is the number of rows.
  virtual Status value_at(double /*t*/, N_Vector /*y*/, std::vector<double>& /*g*/) {
    return Status::misused;
  }
  virtual int count() const { return 0; }
};

/// The storage that suits the rows. The options and statistics outlive it. Drift is that of the
/// first `reported` rows (-1: of all).
std::unique_ptr<RowsAt> make_rows(const Constraints&, const Options&, Statistics&, N_Vector like,
                                  int reported = -1);
/// The storages of rows on contiguous vectors of `size` unknowns, and of the caller's projection.
std::unique_ptr<RowsAt> make_contiguous_rows(const Constraints&, const Options&, Statistics&,
                                             int size, bool sparse, int reported = -1);
std::unique_ptr<RowsAt> make_user_rows(const Constraints&, const Options&, Statistics&,
                                       N_Vector like);

}  // namespace tether::ida_projection

// Tether: the move of a point onto the constraints, for every storage of their rows (method, eq. 6,
// 8). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <tether/ida_projection/options.hpp>
#include <tether/ida_projection/projection.hpp>
#include <tether/ida_projection/statistics.hpp>
#include <vector>

#include "constraints/evaluator.hpp"
#include "host/candidate.hpp"
#include "movers/curvature.hpp"
#include "movers/rows_at.hpp"

namespace tether::ida_projection {

struct Move {
  Status status = Status::unused;
  double length = 0.0;        ///< WRMS length of the whole move, in tolerances
  double drift_before = 0.0;  ///< largest |g_i| at the candidate
  double drift_after = 0.0;   ///< the same where g was evaluated last; see remaining_drift()
  int moves = 0;              ///< Newton moves made
  double floor = 0.0;         ///< measure(): length that rounding of y alone explains
  bool not_needed = false;    ///< no move was needed, which g and earlier factors have shown
  bool capped = false;
  double left = 0.0;  ///< of a capped move: what it lacks, in tolerances
};

/// Judges a sequence of Newton moves: done, converging, or failed. Lengths are in tolerances.
class Monitor {
 public:
  enum class Verdict { done, go_on, refactor, failed };

  explicit Monitor(const Options& options) : options_(&options) {}
  void reset() { *this = Monitor(*options_); }

  /// Begins a new candidate.
  void start() {
    previous_ = -1.0;
    moves_ = 0;
    ++candidates_;
  }
  /// After a first move of this length: whether judge() would return done for any `floor`, which
  /// then need not be computed.
  bool plainly_done(double length) {
    const bool done = moves_ == 0 && leaves_little(length);
    if (done) moves_ = 1;
    return done;
  }
  /// After a move of this length; `fresh`: the factors belong to the point that was left;
  /// `floor`: length below which rounding of y rules.
  Verdict judge(double length, bool fresh, double floor);

 private:
  // Newton's second move has the length kappa d^2, about.
  bool leaves_little(double length) const {
    return !curvature_.due(length, candidates_) &&
           curvature_.left(length, length) <= options_->advanced.tolerance;
  }

  const Options* options_;
  Curvature curvature_;
  double previous_ = -1.0;
  int moves_ = 0;
  long candidates_ = 0;
};

/// Newton's method onto the constraints, one loop for all storages of their rows. The notation is
/// that of docs/method/projection.md: N unknowns, m rows, C = dg/dy, D the metric, WT = 1/w the
/// error weights, s the size of the corrector's changes.
class Mover {
 public:
  Mover(const Options& options, std::unique_ptr<RowsAt> rows)
      : options_(options), monitor_(options), rows_(std::move(rows)) {}

  RowsAt& rows() { return *rows_; }
  const RowsAt& rows() const { return *rows_; }
  const std::string& message() const { return rows_->message; }
  /// A new run starts.
  void reset();

  /// Length of the first Newton move from the candidate; the candidate is not changed.
  Move measure(const Candidate& candidate);
  /// Moves the candidate: correction <- correction - dy.
  Move move(const Candidate& candidate);
  /// After a successful move() the correction was changed by `change`: removes what this changes in
  /// g, with the current factors.
  Status settle(const Candidate& candidate, N_Vector change);
  /// Largest |g_i| at the present candidate; -1 if g cannot be evaluated.
  double remaining_drift(const Candidate& candidate);
  /// RowsAt::tangency(), unless C is that of an earlier candidate.
  bool tangency(const std::vector<double>& yp, const double* id, Tangency& out) {
    return age_ == 0 && rows_->tangency(yp, id, out);
  }

 private:
  Status factor(double t, bool refill);
  bool clearly_needs_no_move();
  bool needs_no_move_again(const Candidate& candidate, Move& result);
  void newton(const Candidate& candidate, Move& result);
  bool allowed(const Candidate& candidate, Move& result);
  bool done(const Candidate& candidate, const Solution& solution, bool fresh, Move& result,
            Monitor::Verdict& verdict);
  Status remove_rest(const Candidate& candidate, double reach);

  const Options& options_;
  Monitor monitor_;
  std::unique_ptr<RowsAt> rows_;
  double move_length_ = 0.0;  // of the last first move, in tolerances
  int age_ = 0;               // of the factors, in candidates
  int tests_ = 0;             // with the factors of an earlier candidate
  int nothing_in_row_ = 0;    // moves that were none
  bool still_ = false;        // the last candidate needed no move
  Curvature curvature_;       // for what a polish moves
  long settles_ = 0;
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

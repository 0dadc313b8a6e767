// Tether: the move of a point onto the constraints, for every storage of their rows (method, eq. 6,
// 8). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "movers/rows_at.hpp"
#include "rows/row_trust.hpp"

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

constexpr double kStaleSafety = 4.0;  ///< for moves by C of another point

/// Factors of a point `reach` tolerances away leave the part kappa reach of a move. Second moves
/// measure kappa, and are made only where it could matter. Measurements only increase kappa; a
/// safety factor of 4 covers that it is measured rarely (method, eq. 8).
class Curvature {
 public:
  /// Whether kappa is to be measured by a second move.
  bool due(double reach, long candidate) const {
    return kappa_ < 0.0 || !(reach <= kStaleSafety * measured_) || candidate % kMeasureEvery == 0;
  }
  /// A second move, after a first one of length `move`, was `left` long.
  void measured(double reach, double move, double left) {
    measured_ = std::max(measured_, reach);
    kappa_ = std::max({kappa_, 0.0, left / (reach * move)});
  }
  /// Length that a move of this length leaves, in tolerances.
  double left(double reach, double length) const { return kStaleSafety * kappa_ * reach * length; }

 private:
  double kappa_ = -1.0;    // for each tolerance of distance; < 0: not measured
  double measured_ = 0.0;  // longest distance at which it was measured
};

/// Newton's method onto the constraints, one loop for all storages of their rows. The notation is
/// that of docs/method/projection.md: N unknowns, m rows, C = dg/dy, D the metric, WT = 1/w the
/// error weights, s the size of the corrector's changes.
class Mover {
 public:
  Mover(const Options& options, std::unique_ptr<RowsAt> rows)
      : options_(options), rows_(std::move(rows)) {}

  RowsAt& rows() { return *rows_; }
  const std::string& message() const { return rows_->report.text; }
  /// A new run starts.
  void reset() {
    rows_->reset();
    run_ = Run();
  }

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
  enum class Verdict { done, go_on, refactor, failed };
  // From a new run on.
  struct Run {
    Curvature of_moves, of_settles;
    long candidates = 0, settles = 0;
    double length = 0.0;     // of the last first move, in tolerances
    int nothing_in_row = 0;  // moves that were none
  };

  bool may_test() const;
  Status factor(double t, bool refill);
  bool clearly_needs_no_move();
  void newton(const Candidate& candidate, Move& result);
  bool allowed(const Candidate& candidate, Move& result);
  bool leaves_little(double length) const;
  Verdict judge(double length, double previous, const Move& made, bool fresh, double floor);
  bool done(const Candidate& candidate, const Solution& found, double previous, bool fresh,
            Move& result, Verdict* verdict);

  const Options& options_;
  std::unique_ptr<RowsAt> rows_;
  int age_ = 0;  // of the factors, in candidates that were tested with them
  Run run_;
};

}  // namespace tether::ida_projection

// Tether: the move of a point onto the constraints, for every storage of their rows.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
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
  double drift_after = 0.0;   ///< the same where g was evaluated last; see remaining_drift()
  int moves = 0;              ///< Newton moves made
  double floor = 0.0;         ///< measure(): length that rounding of y alone explains
  bool looked = false;        ///< there was nothing to move
  bool capped = false;
  double left = 0.0;  ///< of a capped move: what it lacks, in tolerances
};

/// Moves candidates onto the constraints and keeps the data of the metric.
class Mover {
 public:
  virtual ~Mover() = default;

  /// Length of the first Newton move from the candidate; the candidate is not changed.
  virtual Move measure(const Candidate& candidate) = 0;

  /// Moves the candidate: correction <- correction - dy.
  virtual Move move(const Candidate& candidate) = 0;

  /// Rank of the factors for solve_with_factors(); -1: there are none.
  virtual int rank_of_factors() const { return -1; }
  /// The caller's rows are others than those of the factors at hand.
  virtual void rows_changed() {}
  /// dy (N entries) for g, near a hundredth, by the factors at hand. The moves that follow are the
  /// same with it and without. False: not known.
  virtual bool solve_with_factors(const std::vector<double>& /*g*/, std::vector<double>& /*dy*/) {
    return false;
  }
  /// After that: what rows that the factors leave out ask for beyond the others, in tolerances; 0
  /// where there are none.
  virtual double left_of_dropped(const std::vector<double>& /*WT*/) { return 0.0; }

  /// C y' row by row with C as it was evaluated last, over the first `reported` rows. False: not
  /// known. `id` as in set_algebraic().
  virtual bool tangency(const std::vector<double>& /*yp*/, const double* /*id*/, Tangency&) {
    return false;
  }

  /// Largest |g_i| at the candidate as it is now; -1 where g is not known or fails.
  virtual double remaining_drift(const Candidate& candidate) = 0;

  /// Says which components are algebraic (1 differential, 0 algebraic; null: none). Called once,
  /// before the first move() of a run, with the candidate at which the structure is looked at.
  virtual Status set_algebraic(const Candidate& candidate, N_Vector id) = 0;

  /// The correction was changed by `change` after a successful move(): takes back what leaves the
  /// constraints, with the factors at hand.
  virtual Status settle(const Candidate& candidate, N_Vector change) = 0;

  /// D as the last candidate had it, of every component; false: there is none.
  virtual bool metric(N_Vector /*D*/) const { return false; }

  /// One scale for all unknowns of a level (row_levels.hpp) in the local metric, from the next move
  /// on, or each its own again. False: nothing changes, there are too few rows or levels.
  virtual bool use_levels(bool) { return false; }
  /// May answers to moves ask for use_levels()?
  virtual bool may_use_levels() const { return false; }

  /// Will settle() never be called in this run? Then factors may serve more than one step.
  virtual void expect_no_settle(bool) {}

  /// May the correction be polished before the next move()? So it is where rows are many.
  virtual bool may_polish_first() const { return false; }
  /// No settle() follows the last move(): completes it. `polished`: so the candidate was before it.
  virtual Status finish(const Candidate&, bool /*polished*/) { return Status::success; }

  /// The attempt that used the last candidate was accepted: keep its effect on the metric.
  virtual void accept() {}
  /// A new run starts: reset the metric.
  virtual void reset() {}

  /// Did a callback ask for the end of the run since forget_failure(), in any evaluation?
  virtual bool fatal() const { return fatal_; }
  virtual void forget_failure() { fatal_ = false; }

  const std::string& message() const { return message_; }
  const std::vector<int>& contradicting_rows() const { return contradicting_rows_; }

 protected:
  std::string message_;
  bool fatal_ = false;
  std::vector<int> contradicting_rows_;
};

/// Factories; `size` is N. The options and statistics outlive the mover. Drift is that of the first
/// `reported` rows (-1: of all).
std::unique_ptr<Mover> make_dense_mover(const Constraints&, const Options&, Statistics&, int size,
                                        int reported = -1);
std::unique_ptr<Mover> make_sparse_mover(const Constraints&, const Options&, Statistics&, int size,
                                         int reported = -1);
/// For rows without has_values(), which need no more of a vector than its operations.
std::unique_ptr<Mover> make_vector_mover(const Constraints&, const Options&, Statistics&,
                                         N_Vector like);
std::unique_ptr<Mover> make_user_mover(const Constraints&, const Options&, Statistics&,
                                       N_Vector like);

/// Watches a sequence of Newton moves: is it done, still converging, or broken?
/// Lengths are in tolerances. Rates below are squares of distances: theta bounds d_{k+1}/d_k^2.
class Monitor {
 public:
  enum class Verdict { done, go_on, refactor, failed };

  explicit Monitor(const Options& options) : options_(&options) {}
  void reset() { *this = Monitor(*options_); }

  /// A new candidate.
  void start() {
    previous_ = -1.0;
    moves_ = 0;
    ++candidates_;
  }

  /// After a first move of this length: is it plain, whatever `floor` is, that judge() will call it
  /// done? Then judge() need not be asked.
  bool plainly_done(double length) {
    const bool done = moves_ == 0 && !measures(length) &&
                      4.0 * theta_ * length * length <= options_->advanced.tolerance;
    if (done) moves_ = 1;
    return done;
  }

  /// After a move of this length; `fresh`: the factors belong to the point that was left;
  /// `floor`: length below which rounding of y rules.
  Verdict judge(double length, bool fresh, double floor);

 private:
  // Newton's second move is about theta d^2. It is asked for only when it could matter; the factor
  // 4 pays for theta being measured now and then, not at every step.
  bool measures(double length) const {
    return theta_ < 0.0 || !(length <= 4.0 * measured_) || candidates_ % kMeasureEvery == 0;
  }

  const Options* options_;
  double theta_ = -1.0;    // largest d_2 / d_1^2 seen; < 0: not measured yet
  double measured_ = 0.0;  // longest first move at which theta was looked for: no rounding there
  double previous_ = -1.0;
  int moves_ = 0;
  long candidates_ = 0;
  static constexpr long kMeasureEvery = 64;
};

}  // namespace tether::ida_projection

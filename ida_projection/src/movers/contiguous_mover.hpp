// Tether: the move onto the constraints on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
//
// Notation as in ida_projection/README.md: N unknowns, m rows, C = dg/dy, D the metric, WT = 1/w
// the error weights, s the size of the corrector's changes. The move itself is in
// contiguous_mover.cpp, its metric in local_metric.hpp, what follows the polish in
// contiguous_settle.cpp; their common data is here.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "movers/factor_wear.hpp"
#include "movers/loaded_candidate.hpp"
#include "movers/local_metric.hpp"
#include "movers/mover.hpp"
#include "rows/row_blocks.hpp"
#include "rows/sparse_rows.hpp"

namespace tether::ida_projection {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kLargestFloor = 0.1;  // tolerances
// Factors of an earlier step (Rows::keeps_factors) leave the part slope * age of a move.
constexpr double kUnknownSlope = 0.03;
constexpr double kSafe = 0.25;  // of Options::tolerance, where old factors tell what is left
constexpr double kLong = 1.0;   // tolerances: such a move is made with fresh factors

/// `Rows` keeps C and its factors: RowBlocks (dense) or SparseRows.
template <class Rows>
class ContiguousMover final : public Mover {
 public:
  ContiguousMover(const Constraints& constraints, const Options& options, Statistics& statistics,
                  int size, int reported)
      : options_(options),
        statistics_(statistics),
        evaluator_(constraints, statistics),
        monitor_(options),
        n_(size),
        m_(evaluator_.rows()),
        reported_(reported >= 0 ? reported : m_),
        inverse_n_(1.0 / size),
        keeps_factors_(Rows::keeps_factors(m_)),
        takes_rest_(Rows::many(m_)),
        blocks_(constraints, evaluator_, size),
        at_(size),
        metric_(options, size) {
    const auto n = static_cast<std::size_t>(n_);
    const auto m = static_cast<std::size_t>(m_);
    g_.assign(m, 0.0);
    start_.assign(n, 0.0);
  }

  Move measure(const Candidate& candidate) override;
  Move move(const Candidate& candidate) override;
  // Which of the thin rows count was judged at another point.
  bool may_follow() override { return reusable_ && !thin_ && wear_.usable(); }
  Move follow(const Candidate& candidate, bool again) override;
  Status set_algebraic(const Candidate& candidate, N_Vector id) override;
  Status settle(const Candidate& candidate, N_Vector change) override;
  double remaining_drift(const Candidate& candidate) override {
    at_.restart(candidate);
    return value(candidate.t) == Status::success ? drift() : -1.0;
  }
  bool tangency(const std::vector<double>& yp, const double* id, Tangency& out) override;
  void accept() override { metric_.accept(); }
  bool fatal() const override { return evaluator_.fatal(); }
  void forget_failure() override { evaluator_.forget(); }
  Status finish(const Candidate& candidate) override {
    // Where a move costs little beside the step, what Newton's method left is taken, too.
    if (takes_rest_) return take_rest(candidate, move_length_);
    if (!keeps_factors()) return Status::success;
    const bool unseen = move_length_ > kSafe * options_.tolerance || !dropped_follow();
    return unseen ? take_back(candidate) : Status::success;
  }
  void reset() override {
    reusable_ = false;
    metric_.reset();
    monitor_.reset();
    if constexpr (Rows::kThinRows) blocks_.trust.reset();
    staleness_.reset();
    usual_ = 0.0;
    wear_ = FactorWear();
  }

 private:
  using Block = typename Rows::Block;

  void set_metric(bool for_factors) {
    if (for_factors)
      metric_.fill(at_, blocks_.d, blocks_.a);
    else
      metric_.look(at_);
  }
  bool keeps_factors() const { return keeps_factors_ && lasting_; }
  bool may_reuse() const { return keeps_factors() && reusable_; }
  double left_of_dropped();
  bool dropped_follow();
  Status take_back(const Candidate& candidate);
  Status take_rest(const Candidate& candidate, double reach);
  double rate() const { return slope_ * age_; }
  Status structure(const Candidate& candidate, const double* id);
  Status value(double t);
  Status rows(double t, double* g);
  Status value_with_rows(double t);
  Status factor(double t);
  bool decide();
  double solve();
  double first_solve();
  bool must_learn(double length) const;
  Status learn_trust(double t, double length);
  void restart(const Candidate& candidate);
  Move newton(const Candidate& candidate, double drift_before);
  Move newton_with_firm_rows(const Candidate& candidate, const Move& failed);
  bool too_long(double length, double& limit) const;
  bool contradicts();
  bool rounding_only() const;
  double rounding_length();
  void apply(double factor, double* correction);
  double drift() const;

  const Options& options_;
  Statistics& statistics_;
  Evaluator evaluator_;
  Monitor monitor_;
  int n_, m_;
  int reported_;  // rows whose drift is told; the others are equations of F
  double inverse_n_;
  bool keeps_factors_;  // over several steps
  bool takes_rest_;     // what Newton's method leaves
  Rows blocks_;
  bool thin_ = false;          // the last factor() found rows that need RowTrust
  bool lasting_ = false;       // which rows it has kept is right for the next steps, too
  bool decided_ = false;       // it found that out for this candidate
  bool rows_known_ = false;    // C belongs to the present y
  bool firm_only_ = false;     // this attempt does without them
  std::vector<double> start_;  // the correction before the move, kept where there are thin rows
  bool start_known_ = false;
  LoadedCandidate at_;
  LocalMetric metric_;
  std::vector<double> g_;
  double move_length_ = 0.0;  // of the last first move, in tolerances
  Staleness staleness_;
  double usual_ = 0.0;     // left_of_dropped() after the moves, with decided_
  bool weighed_ = false;   // the blocks know what a tolerance is for their dropped rows
  bool reusable_ = false;  // factors of an earlier step are there
  bool reused_ = false;    // and are in use for this one
  double slope_ = 0.0;     // they leave slope_ * age_ of a move
  int age_ = 0;            // candidates since they were made
  FactorWear wear_;        // for follow()
};

template <class Rows>
Status ContiguousMover<Rows>::value(double t) {
  rows_known_ = false;
  const Status status = evaluator_.value(t, at_.y.data(), n_, g_.data());
  if (status != Status::success) message_ = evaluator_.message();
  return status;
}

// Returns the WRMS length of dy in the error norm. Algebraic columns do not count there: they
// follow the others.
template <class Rows>
double ContiguousMover<Rows>::solve() {
  ++statistics_.iterations;
  blocks_.solve(g_);
  const Block& counted = blocks_.d.rows.empty() ? blocks_.a : blocks_.d;
  double sum = 0.0;
  const double* dy = counted.dy.data();
  counted.for_columns([&sum, dy, w = at_.w](int k, int i) {
    const double move = dy[k] * w[i];
    sum += move * move;
  });
  return std::sqrt(sum * inverse_n_);
}

// After solve(): the largest distance, in tolerances, that the dropped rows ask for beyond the
// others.
template <class Rows>
double ContiguousMover<Rows>::left_of_dropped() {
  if (!blocks_.dropped_rows()) return 0.0;
  if (!weighed_) blocks_.weigh_dropped(at_.WT());
  weighed_ = true;
  const double left = blocks_.left_of_dropped();
  if (decided_) usual_ = left;
  return left;
}

// Rows that an earlier step has dropped are satisfied only while they depend on the others. Where
// they ask for more than they did then, one may have become independent.
template <class Rows>
bool ContiguousMover<Rows>::dropped_follow() {
  const double left = left_of_dropped();
  if (decided_ || left <= std::max(kSafe * options_.tolerance, 2.0 * usual_)) return true;
  return left <= 1e2 * kEpsilon * at_.size();
}

template <class Rows>
void ContiguousMover<Rows>::apply(double factor, double* correction) {
  for (const Block* block : {&blocks_.d, &blocks_.a}) {
    if (block->rows.empty()) continue;
    double* __restrict y = at_.y.data();
    double* __restrict ycor = correction;
    const double* __restrict dy = block->dy.data();
    block->for_columns([=](int k, int i) {
      const double move = factor * dy[k];
      ycor[i] -= move;
      y[i] -= move;
    });
  }
}

template <class Rows>
double ContiguousMover<Rows>::drift() const {
  double largest = 0.0;
  for (int i = 0; i < reported_; ++i)
    largest = std::max(largest, std::abs(g_[static_cast<std::size_t>(i)]));
  return largest;
}

}  // namespace tether::ida_projection

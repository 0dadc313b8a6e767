// Tether: g, C and its factors at a candidate, on contiguous vectors. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "constraints/evaluator.hpp"
#include "host/mechanisms.hpp"
#include "host/rounding.hpp"
#include "movers/loaded_candidate.hpp"
#include "movers/local_metric.hpp"
#include "movers/mover.hpp"
#include "rows/split_rows.hpp"

namespace tether::ida_projection {

constexpr double kFollows = 0.25;  // of Options::tolerance: dropped rows may ask for such a move
constexpr int kFew = 16;           // rows: their moves are not rough

/// `Rows` keeps C and its factors: DenseRows or SparseRows.
template <class Rows>
class ContiguousRows final : public RowsAt {
 public:
  /// Drift is that of the first `reported` rows (-1: of all).
  ContiguousRows(const Constraints& constraints, const Options& options, Statistics& statistics,
                 int size, int reported)
      : evaluator_(constraints, statistics),
        blocks_(constraints, evaluator_, size),
        at_(size),
        metric_(options, size),
        options_(options),
        statistics_(statistics),
        reported_(reported >= 0 ? reported : evaluator_.rows()),
        inverse_n_(1.0 / size) {
    g_.assign(static_cast<std::size_t>(evaluator_.rows()), 0.0);
    kept_g_ = g_;
  }

  Status load(const Candidate& candidate, bool refills) override;
  Status value(double t, bool with_rows) override;
  Status factor(double t, bool refill) override;
  Solution solve(Solve how) override;
  Status apply(double share, const Candidate& candidate) override;
  double size() const override { return at_.size(); }
  double change() const override;
  bool rounding_only() override;
  double rounding_length() override;

  double shift(N_Vector change) override;
  void restart(const Candidate&) override { at_.restart(); }
  double drift() const override;
  bool may_test_with_factors() const override {
    return uses_.there && !uses_.thin && !blocks_.dropped_rows();
  }
  bool decided() const override { return uses_.decided; }
  void forget_rank() override { uses_.lasting = false; }
  bool contradicts() override;
  void refresh_pattern_soon() override { blocks_.refresh_pattern_soon(); }

  Status set_algebraic(const Candidate& candidate, N_Vector id) override {
    at_.load(candidate);
    return structure(candidate, id != nullptr ? N_VGetArrayPointer(id) : nullptr);
  }
  bool metric(N_Vector D) const override {
    std::copy(metric_.D().begin(), metric_.D().end(), N_VGetArrayPointer(D));
    return uses_.there;
  }
  void accept() override { metric_.accept(); }
  void reset() override;
  bool use_levels(bool on) override;
  // Few rows make no rough moves. At singular positions, where rows are nearly dependent, F
  // responds to any move, stiff or not.
  bool may_use_levels() const override {
    return count() > kFew && !uses_.thin && !blocks_.dropped_rows();
  }

  bool tangency(const std::vector<double>& yp, const double* id, Tangency& out) override;
  bool tangent(double t, N_Vector yp) override;
  bool fatal() const override { return evaluator_.fatal(); }
  void forget_failure() override { evaluator_.forget(); }

 private:
  using Block = typename Rows::Block;
  /// The uses of the current factors.
  struct Uses {
    bool there = false;    ///< of this candidate or of an earlier one
    bool thin = false;     ///< the last factor() found rows that need RowTrust
    bool lasting = false;  ///< which rows it has kept is right for the next steps, too
    bool decided = false;  ///< it found that out for this candidate
  };

  int count() const { return static_cast<int>(g_.size()); }
  int unknowns() const { return static_cast<int>(at_.y.size()); }
  double wrms(double sum) const { return std::sqrt(sum * inverse_n_); }
  void fill_metric() { blocks_.set_metric(metric_.find(at_).data()); }
  Block& counted() { return blocks_.d.rows.empty() ? blocks_.a : blocks_.d; }
  Status with_message(Status status) {
    if (status != Status::success) message = evaluator_.message();
    return status;
  }
  const double* WT_of_differences() {
    return evaluator_.uses_differences() ? at_.WT().data() : nullptr;
  }

  Status structure(const Candidate& candidate, const double* id);
  Status rows(double t, double* g);
  bool decide();
  double length_of_solution();
  double length_of_all() const;
  double judge_thin_rows(double length);
  Status learn_trust(double length);
  const std::vector<int>& levels();
  void find_rates();
  bool first_are_rates_of_zeroth(const std::vector<int>& levels);
  bool dropped_follow();
  bool only_rounding(std::size_t i) const;
  static void take(double share, const double* __restrict dy, int n, double* __restrict ycor,
                   double* __restrict y) {
    for (int k = 0; k < n; ++k) {
      const double move = share * dy[k];
      ycor[k] -= move;
      y[k] -= move;
    }
  }

  Evaluator evaluator_;
  Rows blocks_;
  LoadedCandidate at_;
  LocalMetric metric_;
  Uses uses_;
  const Options& options_;
  Statistics& statistics_;
  int reported_;  // the others are equations of F
  double inverse_n_;
  double t_ = 0.0, length_ = 0.0;  // of the last evaluation and solution
  std::vector<double> g_;
  std::vector<double> kept_g_;  // work space of rounding_length()
  bool rows_known_ = false;     // C belongs to the present y
  bool moved_ = false;          // this candidate
  int factored_ = 0, rate_searches_ = 0;
  std::vector<int> found_levels_;
  bool levels_known_ = false;  // they are those of the rows as they are arranged
  double usual_ = 0.0;         // asked for by dropped rows after the moves, when that was decided
};

}  // namespace tether::ida_projection

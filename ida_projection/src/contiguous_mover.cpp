// Tether: the move onto the constraints on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
//
// Notation as in ida_projection/README.md: N unknowns, m rows, C = dg/dy, D the metric, WT = 1/w
// the error weights, s the size of the corrector's changes.
#include <algorithm>
#include <cmath>
#include <limits>

#include "mover.hpp"
#include "row_blocks.hpp"
#include "sparse_rows.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kMetricFloor = 1e-3;  // D_i >= kMetricFloor WT_i
constexpr double kMetricDecay = 0.8;   // per accepted step
constexpr long kMeasureEvery = 64;
constexpr double kLargestFloor = 0.1;  // tolerances
// Factors of an earlier step (Rows::kReuse): used while they leave less than kWorn of a move, and
// what they leave is less than kForLater tolerances, which settle() takes back.
constexpr double kWorn = 0.06, kForLater = 0.1, kUnknownSlope = 0.03;
constexpr double kSlow = 0.1;  // of a move: five would not be enough
constexpr int kLookAgain = 4;  // candidates

/// `Rows` keeps C and its factors: RowBlocks (dense) or SparseRows.
template <class Rows>
class ContiguousMover final : public Mover {
 public:
  ContiguousMover(const Constraints& constraints, const Options& options, Statistics& statistics,
                  int size)
      : options_(options),
        statistics_(statistics),
        evaluator_(constraints, statistics),
        monitor_(options),
        n_(size),
        m_(evaluator_.rows()),
        inverse_n_(1.0 / size),
        blocks_(constraints, evaluator_, size) {
    const auto n = static_cast<std::size_t>(n_);
    const auto m = static_cast<std::size_t>(m_);
    scale_.assign(n, 0.0);
    trial_scale_.assign(n, 0.0);
    y_.assign(n, 0.0);
    WT_.assign(n, 0.0);
    g_.assign(m, 0.0);
    start_.assign(n, 0.0);
  }

  Move measure(const Candidate& candidate) override;
  Move move(const Candidate& candidate) override;
  Status set_algebraic(const Candidate& candidate, N_Vector id) override;
  Status settle(const Candidate& candidate, N_Vector change) override;
  double remaining_drift(const Candidate& candidate) override {
    for (int i = 0; i < n_; ++i)
      y_[static_cast<std::size_t>(i)] = candidate.base_entries[i] + candidate.correction_entries[i];
    return value(candidate.t) == Status::success ? drift() : -1.0;
  }
  void accept() override { std::swap(scale_, trial_scale_); }
  Status finish(const Candidate& candidate) override {
    return left_ > options_.tolerance ? take_back(candidate) : Status::success;
  }
  void reset() override {
    reusable_ = false;
    std::fill(scale_.begin(), scale_.end(), 0.0);
    std::fill(trial_scale_.begin(), trial_scale_.end(), 0.0);
    monitor_.reset();
    if constexpr (Rows::kThinRows) blocks_.trust.reset();
    staleness_ = -1.0;
    measured_ = 0.0;
    settles_ = 0;
  }

 private:
  using Block = typename Rows::Block;

  void load(const Candidate& candidate);
  const std::vector<double>& WT();
  void set_metric(bool for_factors);
  bool may_reuse() const { return Rows::kReuse && reusable_ && !blocks_.dropped_rows(); }
  Status take_back(const Candidate& candidate);
  double rate() const { return slope_ * age_; }
  void set_group_metric();
  Status structure(const Candidate& candidate, const double* id);
  Status value(double t);
  Status factor(double t);
  double solve();
  double first_solve();
  Status learn_trust(double t, double length);
  Move newton(const Candidate& candidate, double drift_before);
  Move newton_with_firm_rows(const Candidate& candidate, const Move& failed);
  bool too_long(double length, double& limit) const;
  bool contradicts();
  bool rounding_only() const;
  double rounding_length();
  void apply(double factor, double* correction);
  double drift() const;
  double size_of_y() const;

  const Options& options_;
  Statistics& statistics_;
  Evaluator evaluator_;
  Monitor monitor_;
  int n_, m_;
  double inverse_n_;
  Rows blocks_;
  bool thin_ = false;          // the last factor() found rows that need RowTrust
  bool firm_only_ = false;     // this attempt does without them
  std::vector<double> start_;  // the correction before the move, kept where there are thin rows
  bool start_known_ = false;
  std::vector<double> scale_, trial_scale_;  // s_i: committed, and with the present candidate
  std::vector<double> y_, WT_, g_;
  std::vector<double> group_sum_;
  std::vector<int> group_members_;
  const double* w_ = nullptr;
  double move_length_ = 0.0;  // of the last first move, in tolerances
  double staleness_ = -1.0;   // of factors, for each tolerance of distance; < 0: not measured
  double measured_ = 0.0;     // longest distance at which it was looked for
  long settles_ = 0;
  bool reusable_ = false;  // factors of an earlier step are there
  bool reused_ = false;    // and are in use for this one
  double slope_ = 0.0;     // they leave slope_ * age_ of a move
  int age_ = 0;            // candidates since they were made
  int measured_age_ = 0;   // the same when slope_ was last looked at
  double left_ = 0.0;      // what the last move() left for settle() or finish(), tolerances
  const double* ycor_ = nullptr;
  bool WT_known_ = false;
};

// y = base + correction.
template <class Rows>
void ContiguousMover<Rows>::load(const Candidate& candidate) {
  const double* base = candidate.base_entries;
  ycor_ = candidate.correction_entries;
  w_ = candidate.weight_entries;
  double* y = y_.data();
  for (int i = 0; i < n_; ++i) y[i] = base[i] + ycor_[i];
  WT_known_ = false;
}

// WT = 1/w. A weight of zero means that the error of this component does not count at all.
template <class Rows>
const std::vector<double>& ContiguousMover<Rows>::WT() {
  if (!WT_known_)
    for (std::size_t i = 0; i < WT_.size(); ++i) WT_[i] = w_[i] > 0.0 ? 1.0 / w_[i] : 0.0;
  WT_known_ = true;
  return WT_;
}

// s <- max(0.8 s, |correction|), D = s or, where the error weights are asked for, WT. Factors that
// are used again keep their D.
template <class Rows>
void ContiguousMover<Rows>::set_metric(bool for_factors) {
  const bool local = options_.metric == Metric::local_correction;
  const bool grouped = local && !options_.group.empty();
  if (!for_factors) {
    for (std::size_t i = 0; i < y_.size(); ++i)
      trial_scale_[i] = std::max(kMetricDecay * scale_[i], std::abs(ycor_[i]));
    return;
  }
  for (Block* block : {&blocks_.d, &blocks_.a}) {
    if (block->rows.empty()) continue;
    double* __restrict D = block->D();
    double* __restrict trial = trial_scale_.data();
    const double* __restrict scale = scale_.data();
    const double* __restrict w = w_;
    const double* __restrict ycor = ycor_;
    block->for_columns([=](int k, int i) {
      const double s = std::max(kMetricDecay * scale[i], std::abs(ycor[i]));
      trial[i] = s;
      // WT = 0 (unweighted): such a component moves freely by what the corrector moved it.
      const double weighted = 1.0 / (w[i] > 0.0 ? w[i] : 1.0);
      const double weight = w[i] > 0.0 ? weighted : s;
      D[k] = local ? std::max(s, kMetricFloor * weight) : weight;
    });
  }
  if (grouped) set_group_metric();
}

// One scale for each group: rms of |correction| in tolerances over its members.
template <class Rows>
void ContiguousMover<Rows>::set_group_metric() {
  const int groups = 1 + *std::max_element(options_.group.begin(), options_.group.end());
  std::vector<double>& sum = group_sum_;  // no allocation after the first step
  std::vector<int>& members = group_members_;
  sum.assign(static_cast<std::size_t>(groups), 0.0);
  members.assign(static_cast<std::size_t>(groups), 0);
  for (std::size_t i = 0; i < y_.size(); ++i) {
    if (options_.group[i] < 0) continue;
    const auto k = static_cast<std::size_t>(options_.group[i]);
    const double s = std::max(kMetricDecay * scale_[i], std::abs(ycor_[i]));
    sum[k] += s * w_[i] * s * w_[i];
    ++members[k];
  }
  const std::vector<double>& WT = this->WT();
  for (std::size_t i = 0; i < y_.size(); ++i) {
    if (options_.group[i] < 0) continue;
    const auto k = static_cast<std::size_t>(options_.group[i]);
    trial_scale_[i] = WT[i] * std::sqrt(sum[k] / members[k]);
  }
  for (Block* block : {&blocks_.d, &blocks_.a}) {
    double* D = block->D();
    for (std::size_t c = 0; c < block->columns.size(); ++c) {
      const auto i = static_cast<std::size_t>(block->columns[c]);
      if (options_.group[i] < 0) continue;
      D[c] = std::max(trial_scale_[i], kMetricFloor * (WT[i] > 0.0 ? WT[i] : trial_scale_[i]));
    }
  }
}

template <class Rows>
Status ContiguousMover<Rows>::structure(const Candidate& candidate, const double* id) {
  reusable_ = false;
  const Status status = blocks_.structure(evaluator_, candidate.t, y_, WT(), options_.hold, id);
  if (status != Status::success) message_ = blocks_.message;
  return status;
}

template <class Rows>
Status ContiguousMover<Rows>::set_algebraic(const Candidate& candidate, N_Vector id) {
  load(candidate);
  const double* mask = id != nullptr ? N_VGetArrayPointer(id) : nullptr;
  return structure(candidate, mask);
}

template <class Rows>
Status ContiguousMover<Rows>::value(double t) {
  const Status status = evaluator_.value(t, y_.data(), n_, g_.data());
  if (status != Status::success) message_ = evaluator_.message();
  return status;
}

template <class Rows>
Status ContiguousMover<Rows>::factor(double t) {
  // Only differences need to know how large a tolerance is.
  const double* WT = evaluator_.uses_differences() ? this->WT().data() : nullptr;
  const Status status = blocks_.evaluate(evaluator_, t, y_.data(), WT);
  if (status != Status::success) {
    message_ = evaluator_.message();
    return status;
  }
  ++statistics_.factorizations;
  reusable_ = false;
  if (!blocks_.factor()) {
    message_ =
        "the constraint Jacobian C has an entry that is not finite at t = " + std::to_string(t);
    return Status::not_finite;
  }
  if (blocks_.dropped_rows()) ++statistics_.rank_drops;
  if constexpr (Rows::kThinRows) thin_ = RowTrust::has_thin_rows(blocks_.counted().solver);
  reusable_ = true;
  slope_ = kUnknownSlope;
  age_ = measured_age_ = 0;
  return Status::success;
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
  counted.for_columns([&sum, dy, w = w_](int k, int i) {
    const double move = dy[k] * w[i];
    sum += move * move;
  });
  return std::sqrt(sum * inverse_n_);
}

// The first solve() after factor(): decides which of the thin rows take part until the next one.
template <class Rows>
double ContiguousMover<Rows>::first_solve() {
  const double length = solve();
  if constexpr (Rows::kThinRows) {
    if (!thin_) return length;
    linalg::MinimumNorm& solver = blocks_.counted().solver;
    const int all = solver.rank();
    if (!firm_only_ && blocks_.trust.trusted_rows(solver, length) == all) return length;
    const bool whole = !blocks_.dropped_rows();
    // Nothing magnifies what the firm rows ask for.
    const int firm = RowTrust::firm_rows(solver);
    solver.use_rank(firm);
    const double firm_length = solve();
    --statistics_.iterations;
    if (!firm_only_) {
      solver.use_rank(all);
      const int trusted = blocks_.trust.trusted_rows(solver, firm_length);
      solver.use_rank(trusted);
      if (trusted > firm) {
        --statistics_.iterations;
        if (whole && trusted < all) ++statistics_.rank_drops;
        return solve();
      }
    }
    if (whole) ++statistics_.rank_drops;
    return firm_length;
  }
  return length;
}

// After the first move: by how much has C turned?
template <class Rows>
Status ContiguousMover<Rows>::learn_trust(double t, double length) {
  if constexpr (Rows::kThinRows) {
    if (!thin_) return Status::success;
    const double* WT = evaluator_.uses_differences() ? this->WT().data() : nullptr;
    const Status status = blocks_.learn_trust(evaluator_, t, y_.data(), WT, length);
    if (status != Status::success) message_ = evaluator_.message();
    return status;
  }
  return Status::success;
}

template <class Rows>
bool ContiguousMover<Rows>::contradicts() {
  if (!blocks_.dropped_rows() || !blocks_.contradict(WT())) return false;
  message_ = blocks_.contradiction.message;
  contradicting_rows_ = blocks_.contradiction.rows;
  return true;
}

template <class Rows>
void ContiguousMover<Rows>::apply(double factor, double* correction) {
  for (const Block* block : {&blocks_.d, &blocks_.a}) {
    if (block->rows.empty()) continue;
    double* __restrict y = y_.data();
    double* __restrict ycor = correction;
    const double* __restrict dy = block->dy.data();
    block->for_columns([=](int k, int i) {
      const double move = factor * dy[k];
      ycor[i] -= move;
      y[i] -= move;
    });
  }
}

// WRMS |y| in tolerances.
template <class Rows>
double ContiguousMover<Rows>::size_of_y() const {
  double sum = 0.0;
  for (std::size_t i = 0; i < y_.size(); ++i) sum += (y_[i] * w_[i]) * (y_[i] * w_[i]);
  return std::sqrt(sum * inverse_n_);
}

template <class Rows>
double ContiguousMover<Rows>::drift() const {
  double largest = 0.0;
  for (double g : g_) largest = std::max(largest, std::abs(g));
  return largest;
}

// Does the rounding of its own terms explain every g_i? Then there is nothing to enforce, however
// short the tolerances are that the metric would make of it.
template <class Rows>
bool ContiguousMover<Rows>::rounding_only() const {
  for (int i = 0; i < m_; ++i) {
    const double terms = blocks_.terms(i, y_.data());
    if (!(std::abs(g_[static_cast<std::size_t>(i)]) <= 64.0 * kEpsilon * terms)) return false;
  }
  return true;
}

// Length of the move that the rounding of g asks for in the worst case, with the present factors.
template <class Rows>
double ContiguousMover<Rows>::rounding_length() {
  const std::vector<double> g = g_;
  double total = 0.0;
  for (std::size_t i = 0; i < g.size(); ++i) {
    const double terms = blocks_.terms(static_cast<int>(i), y_.data());
    std::fill(g_.begin(), g_.end(), 0.0);
    g_[i] = 8.0 * kEpsilon * terms;
    total += solve();
    --statistics_.iterations;
  }
  g_ = g;
  return total;
}

template <class Rows>
Move ContiguousMover<Rows>::measure(const Candidate& candidate) {
  Move result;
  load(candidate);
  if (!blocks_.structured() && (result.status = structure(candidate, nullptr)) != Status::success)
    return result;
  if ((result.status = value(candidate.t)) != Status::success) return result;
  result.drift_before = result.drift_after = drift();
  if (result.drift_before == 0.0) return result;
  set_metric(true);
  if ((result.status = factor(candidate.t)) != Status::success) return result;
  if (rounding_only()) return result;
  firm_only_ = false;
  result.length = first_solve();
  result.floor = 4.0 * kEpsilon * size_of_y();
  if (contradicts()) result.status = Status::inconsistent;
  return result;
}

// Only a long move can be too long: the limit is at least largest_move.
template <class Rows>
bool ContiguousMover<Rows>::too_long(double length, double& limit) const {
  if (length <= options_.largest_move) return false;
  double sum = 0.0;
  for (int j : blocks_.d.columns) {
    const double change = ycor_[j] * w_[j];
    sum += change * change;
  }
  limit = options_.largest_move * std::max(1.0, std::sqrt(sum * inverse_n_));
  return !(length <= limit);
}

template <class Rows>
Move ContiguousMover<Rows>::move(const Candidate& candidate) {
  Move result;
  load(candidate);
  reused_ = may_reuse();
  left_ = 0.0;
  ++age_;
  set_metric(!reused_);
  if ((result.status = value(candidate.t)) != Status::success) return result;
  firm_only_ = start_known_ = false;
  result = newton(candidate, drift());
  const bool broken =
      result.status == Status::not_converged || result.status == Status::move_too_long;
  if (broken && start_known_) result = newton_with_firm_rows(candidate, result);
  if (result.status == Status::success && !result.capped && contradicts())
    result.status = Status::inconsistent;
  return result;
}

// Where rows are nearly parallel they magnify the rounding of g beyond any tolerance. Such a row
// cannot be followed, nor need it be, if without it the others lead to a point where rounding
// explains every g: only then does this count.
template <class Rows>
Move ContiguousMover<Rows>::newton_with_firm_rows(const Candidate& candidate, const Move& failed) {
  const std::string reason = message_;
  for (std::size_t i = 0; i < y_.size(); ++i) {
    candidate.correction_entries[i] = start_[i];
    y_[i] = candidate.base_entries[i] + start_[i];
  }
  Move result = failed;
  if ((result.status = value(candidate.t)) != Status::success) return result;
  firm_only_ = true;
  result = newton(candidate, failed.drift_before);
  if (result.status == Status::success && !result.capped) {
    if ((result.status = value(candidate.t)) != Status::success) return result;
    result.drift_after = drift();
    if (rounding_only()) return result;
  }
  message_ = reason;
  return failed;
}

// Newton's method from y_, with g_ known there.
template <class Rows>
Move ContiguousMover<Rows>::newton(const Candidate& candidate, double drift_before) {
  Move result;
  double* correction = candidate.correction_entries;
  result.drift_before = result.drift_after = drift_before;

  monitor_.start();
  bool fresh = false;  // factors belong to the present y
  bool have_factors = reused_;
  for (;;) {
    if (!have_factors) {
      if ((result.status = factor(candidate.t)) != Status::success) return result;
      have_factors = fresh = true;
      if (result.moves == 0 && !firm_only_) {
        start_known_ = thin_;
        if (thin_) std::copy(correction, correction + n_, start_.begin());
      }
    }
    const double length = fresh ? first_solve() : solve();
    ++result.moves;

    if (result.moves == 1) {
      result.length = move_length_ = length;
      double limit = 0.0;
      if (!std::isfinite(length) || too_long(length, limit)) {
        if (options_.long_move == LongMove::reject || !std::isfinite(length)) {
          result.status = std::isfinite(length) ? Status::move_too_long : Status::not_finite;
          message_ = "the move onto the constraints is " + std::to_string(length) +
                     " tolerances long, the limit is " + std::to_string(limit) +
                     " (Options::largest_move); start closer with make_consistent, or use a "
                     "smaller step";
          return result;
        }
        apply(limit / length, correction);
        result.length = limit;
        result.capped = true;
        result.status = Status::success;
        return result;
      }
    }
    apply(1.0, correction);
    if (reused_) {
      left_ = 2.0 * rate() * length;
      if (left_ <= kForLater) break;
      if ((result.status = value(candidate.t)) != Status::success) return result;
      set_metric(true);
      reused_ = have_factors = false;
      left_ = 0.0;
      continue;
    }
    if (result.moves == 1 && (result.status = learn_trust(candidate.t, length)) != Status::success)
      return result;

    // A first move longer than the largest floor need not know it.
    const double floor = result.moves == 1 && length > kLargestFloor
                             ? 0.0
                             : std::min(kLargestFloor, 1e3 * kEpsilon * size_of_y());
    Monitor::Verdict verdict = monitor_.judge(length, fresh, floor);
    // Almost parallel rows magnify rounding: a move that it explains has converged.
    if ((verdict == Monitor::Verdict::failed || verdict == Monitor::Verdict::refactor) &&
        length <= std::min(kLargestFloor, rounding_length()))
      verdict = Monitor::Verdict::done;
    if (verdict == Monitor::Verdict::done) break;
    if (verdict == Monitor::Verdict::failed) {
      result.status = Status::not_converged;
      message_ = "move " + std::to_string(result.moves) + " onto the constraints still is " +
                 std::to_string(length) +
                 " tolerances long; check the constraint Jacobian with check_jacobian, or whether "
                 "the rows have a common solution here";
      return result;
    }
    if ((result.status = value(candidate.t)) != Status::success) return result;
    result.drift_after = drift();
    fresh = false;
    have_factors = verdict != Monitor::Verdict::refactor;
  }

  result.status = Status::success;
  return result;
}

template <class Rows>
Status ContiguousMover<Rows>::settle(const Candidate& candidate, N_Vector change) {
  const double* e = N_VGetArrayPointer(change);
  for (std::size_t i = 0; i < y_.size(); ++i) y_[i] += e[i];
  if (reused_) return take_back(candidate);
  double sum = 0.0;
  for (int j : blocks_.d.columns) sum += (e[j] * w_[j]) * (e[j] * w_[j]);
  const double reach = move_length_ + std::sqrt(sum * inverse_n_);
  // The factors belong to a point `reach` away: each move leaves about staleness_ reach of itself.
  const bool measure =
      staleness_ < 0.0 || reach > 4.0 * measured_ || ++settles_ % kMeasureEvery == 0;
  double previous = 0.0;
  for (int k = 0; k < options_.maximum_iterations; ++k) {
    const Status status = value(candidate.t);
    if (status != Status::success) return status;
    const double length = solve();
    apply(1.0, candidate.correction_entries);
    const double floor = 1e2 * kEpsilon * size_of_y();
    const bool rounding = length <= floor || (k > 0 && length > 0.5 * previous);
    if (k > 0) {
      measured_ = std::max(measured_, reach);
      staleness_ = std::max({staleness_, 0.0, rounding ? 0.0 : length / (reach * previous)});
    }
    if (rounding) break;
    if ((k > 0 || !measure) && 4.0 * staleness_ * reach * length <= options_.tolerance) break;
    previous = length;
  }
  return Status::success;
}

// The same with factors of an earlier step, which leave a part of each move that grows with their
// age. Where that is more than kSlow they are made anew.
template <class Rows>
Status ContiguousMover<Rows>::take_back(const Candidate& candidate) {
  double previous = 0.0;
  left_ = 0.0;
  const double floor = 1e2 * kEpsilon * size_of_y();
  for (int k = 0; k < options_.maximum_iterations; ++k) {
    Status status = value(candidate.t);
    if (status != Status::success) return status;
    double length = solve();
    if (k > 0 && length > floor) {
      slope_ = length / (previous * age_);
      measured_age_ = age_;
      if (rate() > kSlow) {
        set_metric(true);
        if ((status = factor(candidate.t)) != Status::success) return status;
        age_ = 1;
        length = solve();
      }
    }
    apply(1.0, candidate.correction_entries);
    const bool look = k == 0 && age_ >= measured_age_ + kLookAgain;
    if (length <= floor || (!look && 2.0 * rate() * length <= options_.tolerance)) {
      if (rate() > kWorn) reusable_ = false;
      return Status::success;
    }
    previous = length;
  }
  reusable_ = false;
  message_ = "after " + std::to_string(options_.maximum_iterations) +
             " moves with sparse factors the next one still is " + std::to_string(previous) +
             " tolerances long (Options::maximum_iterations)";
  return Status::not_converged;
}

}  // namespace

std::unique_ptr<Mover> make_dense_mover(const Constraints& constraints, const Options& options,
                                        Statistics& statistics, int size) {
  return std::make_unique<ContiguousMover<RowBlocks>>(constraints, options, statistics, size);
}

std::unique_ptr<Mover> make_sparse_mover(const Constraints& constraints, const Options& options,
                                         Statistics& statistics, int size) {
  return std::make_unique<ContiguousMover<SparseRows>>(constraints, options, statistics, size);
}

}  // namespace tether::ida_projection

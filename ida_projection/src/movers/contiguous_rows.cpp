// Tether: g, C and its factors at a candidate, on contiguous vectors. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "host/mechanisms.hpp"
#include "host/shortest.hpp"
#include "movers/local_metric.hpp"
#include "movers/newton.hpp"
#include "rows/row_levels.hpp"
#include "rows/split_rows.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kFollows = 0.25;  // of Options::tolerance: dropped rows may ask for such a move
constexpr double kWeak = 0.1;      // independent part below which a row may be left out
constexpr int kFew = 16;           // rows: their moves are not rough
constexpr int kEarly = 16;         // decisions about the rank in which rates are looked for
constexpr double kAlike = 0.05;    // relative change of a sum of squares

double square(double x) { return x * x; }

class ContiguousRows final : public Newton<ContiguousRows> {
 public:
  ContiguousRows(const Constraints& constraints, const Options& options, Statistics& statistics,
                 int size, bool sparse, int reported)
      : Newton(Kind::entries, options, statistics),
        evaluator_(constraints, statistics, &report),
        rows_(constraints, evaluator_, size, sparse),
        metric_(options, size),
        reported_(static_cast<std::size_t>(reported >= 0 ? reported : evaluator_.rows())),
        inverse_n_(1.0 / size),
        y_(static_cast<std::size_t>(size), 0.0),
        g_(static_cast<std::size_t>(evaluator_.rows()), 0.0) {}

  TETHER_INLINE Status load(const Candidate& candidate, bool refills) override {
    place(candidate);
    if (!refills) metric_.find(at_);
    decided_ = moved_ = false;
    least_ = 1.0;
    if (left_out_ > 0 && --without_ < 0) {
      left_out_ = 0;
      lasting_ = false;
    }
    solved_ = 0.0;
    return rows_.structured() ? Status::success : structure(candidate.t, nullptr);
  }
  TETHER_INLINE Status value(double t, bool with_rows) override {
    const bool both = with_rows && evaluator_.gives_both();
    const Status status =
        both ? rows(t, g_.data()) : evaluator_.value(t, y_.data(), unknowns(), g_.data());
    rows_known_ = both && status == Status::success;
    double largest = 0.0;
    for (std::size_t i = 0; i < reported_; ++i) largest = std::max(largest, std::abs(g_[i]));
    drift = largest;
    return status;
  }
  TETHER_INLINE Status factor(double t, bool refill) override {
    if (refill) fill_metric();
    if (!rows_known_) {
      const Status status = rows(t, nullptr);
      if (status != Status::success) return status;
    }
    rows_known_ = false;
    t_ = t;
    if (!in_use(Mechanism::kept_rank) || !lasting_ || factors == Factors::none ||
        !rows_.factor_kept())
      return decide(t);
    thin_ = false;
    ++statistics_.refactorizations;
    return Status::success;
  }
  TETHER_INLINE Solution solve(Solve how) override {
    Solution found;
    rows_.solve(g_);
    if (how == Solve::point) return solution_at_point();
    if (how != Solve::test) ++statistics_.iterations;
    found.length = length_of_solution();
    if (!rows_.d.rows.empty() && !rows_.a.rows.empty())
      solved_ = std::max(solved_, length_of(rows_.a));
    length_ = found.length;
    return factors == Factors::of_all_rows ? found : with_independent_rows(found, how);
  }
  Status apply(double share, const Candidate& candidate) override {
    const bool learns = thin_ && !moved_ && share == 1.0;
    moved_ = true;
    rows_.for_moves([=, ycor = candidate.correction_entries, y = y_.data()](int j, double move) {
      ycor[j] -= share * move;
      y[j] -= share * move;
    });
    return learns ? learn_trust(length_) : Status::success;
  }
  double solved_length() const override { return solved_; }
  bool leaves_no_choice() const { return rows_.leave_no_choice(); }
  bool is_rounding() override {
    for (std::size_t i = 0; i < static_cast<std::size_t>(count()); ++i)
      if (!(std::abs(g_[i]) <= kRoundingOfTerms * rows_.C().terms(static_cast<int>(i), y_.data())))
        return false;
    return true;
  }

  double follow(const Candidate& candidate, N_Vector change) override {
    if (change == nullptr) {
      place(candidate);
      return 0.0;
    }
    const double* e = N_VGetArrayPointer(change);
    double* y = y_.data();
    TETHER_ELEMENTWISE
    for (int i = 0; i < unknowns(); ++i) y[i] += e[i];
    return length_over(rows_.d, [e](int, int j) { return e[j]; });
  }
  double corrected() const override {
    return length_over(rows_.d, [e = at_.correction_entries](int, int j) { return e[j]; });
  }
  bool contradicts() override {
    const bool found = drops_rows() && rows_.contradict(WT());
    if (found) left_out_ = 0;
    return found;
  }
  bool leave_out_weakest() override {
    if (!in_use(Mechanism::rows_left_out) || rows_.C().sparse() || counted().rank() < 2 ||
        least_ > kWeak)
      return false;
    left_out_ = counted_rows() - counted().rank() + 1;
    without_ = kOneIn;
    factors = Factors::none;
    return true;
  }
  void refresh_pattern_soon() override { rows_.refresh_pattern_soon(); }

  Status set_algebraic(const Candidate& candidate, N_Vector id,
                       const std::vector<char>& repeats) override {
    place(candidate);
    rows_.set_equations(repeats);
    id_ = id;
    return structure(candidate.t, id);
  }
  const std::vector<int>& solved_for() const override {
    return rows_.d.rows.empty() ? rows_.a.columns : RowsAt::solved_for();
  }
  bool keeps_blocks() const override { return rows_.keeps_blocks(); }
  void accept() override { metric_.accept(); }
  void forget() {
    factors = Factors::none;
    metric_.reset();
    rows_.trust.reset();
    usual_ = 0.0;
    decisions_ = left_out_ = 0;
    levels_.reset();
  }
  bool use_levels(bool on) override {
    if (on && levels().empty()) return false;
    metric_.use_levels(on ? levels() : std::vector<int>());
    factors = Factors::none;
    return true;
  }
  bool may_use_levels() const override { return count() > kFew; }
  bool tangency(const std::vector<double>& yp, const double* id, Tangency& out) override {
    if (!rows_.structured() || factors == Factors::none) return false;
    for (std::vector<double>* each : {&out.rate, &out.terms, &out.tolerance, &out.size})
      each->resize(reported_);
    for (std::size_t i = 0; i < reported_; ++i) {
      double rate = 0.0, terms = 0.0, sum = 0.0, size = 0.0;
      bool algebraic = false;
      rows_.C().visit(static_cast<int>(i), [&](int j, double c) {
        const auto k = static_cast<std::size_t>(j);
        const bool differential = id == nullptr || id[j] != 0.0;
        algebraic = algebraic || (c != 0.0 && !differential);
        rate += c * yp[k];
        terms += std::abs(c * yp[k]);
        if (differential) size += std::abs(c) * std::max(1.0, std::abs(y_[k]));
        sum += at_.weight_entries[k] > 0.0 ? square(c / at_.weight_entries[k]) : 0.0;
      });
      out.rate[i] = rate;
      out.size[i] = size;
      out.terms[i] = algebraic ? -1.0 : terms;
      out.tolerance[i] = std::sqrt(sum);
    }
    return true;
  }

  int count() const override { return evaluator_.rows(); }
  Status value_at(double t, N_Vector y, std::vector<double>& g) override {
    return evaluator_.value(t, N_VGetArrayPointer(y), unknowns(), g.data());
  }
  Status linearise(double t, N_Vector y, N_Vector weights, N_Vector id,
                   const std::vector<char>& repeats) override {
    rows_.set_equations(repeats);
    t_ = t;
    at_.weight_entries = N_VGetArrayPointer(weights);
    std::copy_n(N_VGetArrayPointer(y), y_.size(), y_.begin());
    const bool arranged = std::exchange(id_, id) == id && rows_.structured();
    if (!arranged) {
      const Status status = structure(t, id);
      if (status != Status::success) return status;
    }
    return rows_.evaluate(t, y_.data(), WT().data(), nullptr, [this] { factors = Factors::none; });
  }
  Status factor_in(N_Vector D) override {
    rows_.set_metric([of = N_VGetArrayPointer(D)](int j) { return of[j]; });
    if (factors == Factors::of_all_rows && rows_.factor_kept()) {
      ++statistics_.refactorizations;
      return Status::success;
    }
    const Status status = decide(t_);
    if (status == Status::success && !rows_.C().sparse())
      rows_.for_blocks(
          [](Block& block) { block.dense.use_rank(RowTrust::firm_rows(block.dense)); });
    return status;
  }
  // A C by differences is good for Newton's moves only: C s by those of g along s, of fourth order.
  Status product(N_Vector s, std::vector<double>& r) override {
    const double* along = N_VGetArrayPointer(s);
    if (!evaluator_.uses_differences()) {
      for (int i = 0; i < count(); ++i) r[static_cast<std::size_t>(i)] = rows_.C().times(i, along);
      return Status::success;
    }
    double largest_s = 0.0, largest_y = 0.0;
    for (std::size_t j = 0; j < y_.size(); ++j) {
      largest_s = std::max(largest_s, std::abs(along[j]));
      largest_y = std::max({largest_y, std::abs(y_[j]), WT_[j]});
    }
    std::fill(r.begin(), r.end(), 0.0);
    if (largest_s == 0.0) return Status::success;
    shifted_.resize(y_.size());
    const double d = kWideIncrement * (largest_y > 0.0 ? largest_y : 1.0) / largest_s;
    return central_differences(d, r, g_, [&](double e, std::vector<double>& g) {
      for (std::size_t j = 0; j < y_.size(); ++j) shifted_[j] = y_[j] + e * along[j];
      return evaluator_.value(t_, shifted_.data(), unknowns(), g.data());
    });
  }
  void solve_for(const std::vector<double>& r, N_Vector ds) override {
    rows_.solve(r);
    N_VConst(0.0, ds);
    rows_.for_moves([to = N_VGetArrayPointer(ds)](int j, double move) { to[j] = move; });
  }

 private:
  int unknowns() const { return static_cast<int>(y_.size()); }
  linalg::MinimumNorm& counted() { return rows_.counted().dense; }
  int counted_rows() { return static_cast<int>(rows_.counted().rows.size()); }
  bool drops_rows() const { return factors != Factors::of_all_rows && rows_.drops_rows(); }
  double wrms(double sum) const { return std::sqrt(sum * inverse_n_); }
  TETHER_INLINE void fill_metric() {
    if (metric_.find(at_))
      rows_.set_metric(
          [s = metric_.s(), w = at_.weight_entries](int j) { return LocalMetric::D(s[j], w[j]); });
    else
      rows_.set_metric([D = metric_.D()](int j) { return D[j]; });
  }
  void place(const Candidate& candidate) {
    at_ = candidate;
    add(at_.base_entries, at_.correction_entries, unknowns(), y_.data());
  }
  static void add(const double* __restrict a, const double* __restrict b, int n,
                  double* __restrict sum) {
    for (int i = 0; i < n; ++i) sum[i] = a[i] + b[i];
  }
  // 1/w; 0 for a weight of zero, which means that the error of the component does not count.
  const std::vector<double>& WT() {
    WT_.resize(y_.size());
    for (std::size_t i = 0; i < WT_.size(); ++i)
      WT_[i] = at_.weight_entries[i] > 0.0 ? 1.0 / at_.weight_entries[i] : 0.0;
    return WT_;
  }

  Status structure(double t, N_Vector id) {
    factors = Factors::none;
    left_out_ = 0;
    levels_.reset();
    const double* mask = id != nullptr ? N_VGetArrayPointer(id) : nullptr;
    return rows_.structure(t, y_, WT(), options_.hold, mask);
  }
  // C at the present y, and g if wanted. Only differences and mixed rows need the size of a
  // tolerance.
  TETHER_INLINE Status rows(double t, double* g) {
    return rows_.evaluate(t, y_.data(), rows_.needs_WT() ? WT().data() : nullptr, g, [this] {
      factors = Factors::none;
      left_out_ = 0;
      levels_.reset();
      fill_metric();
    });
  }
  // Factors that show which rows are independent.
  Status decide(double t) {
    factors = Factors::none;
    ++statistics_.factorizations;
    find_rates();
    if (!rows_.factor()) {
      report.text = "the constraint Jacobian C has an entry that is not finite at t = " + brief(t);
      return Status::not_finite;
    }
    if (left_out_ > 0) counted().use_rank(counted_rows() - left_out_);
    const bool drops = rows_.drops_rows();
    if (drops) ++statistics_.rank_drops;
    thin_ = left_out_ == 0 && in_use(Mechanism::row_trust) && !rows_.C().sparse() &&
            RowTrust::has_thin_rows(rows_.counted().dense);
    if (!thin_ && !rows_.C().sparse()) note_least();
    lasting_ = !thin_;
    decided_ = true;
    factors = drops || thin_ ? Factors::of_some_rows : Factors::of_all_rows;
    return Status::success;
  }
  // The least part of this candidate, of the rows that take part.
  void note_least() {
    const int rank = counted().rank();
    if (rank > 0) least_ = std::min(least_, counted().independent_part(rank - 1));
  }
  // In tolerances, of entry(k, j) at the columns j of the block.
  template <class Entry>
  TETHER_INLINE double length_over(const Block& block, Entry entry) const {
    double sum = 0.0;
    block.for_columns(
        [&sum, entry, w = at_.weight_entries](int k, int j) { sum += square(entry(k, j) * w[j]); });
    return wrms(sum);
  }
  TETHER_INLINE double length_of(const Block& block) const {
    return length_over(block, [dy = block.dy.data()](int k, int) { return dy[k]; });
  }
  TETHER_INLINE double length_of_solution() { return length_of(rows_.counted()); }
  double length_with(int rank) {
    rows_.counted().dense.use_rank(rank);
    rows_.solve(g_);
    return length_of_solution();
  }
  // After a solution of this length with all rows: decides which thin rows take part until the next
  // factorisation. Returns the length of the solution with those. Firm rows do not magnify their
  // right-hand side.
  double judge_thin_rows(double length) {
    linalg::MinimumNorm& solver = rows_.counted().dense;
    const int all = solver.rank(), firm = RowTrust::firm_rows(solver);
    if (rows_.trust.trusted_rows(solver, length) == all) {
      note_least();
      return length;
    }
    const bool whole = !rows_.drops_rows();  // the solver's rank is that of all rows here
    const double firm_length = length_with(firm);
    solver.use_rank(all);
    const int trusted = rows_.trust.trusted_rows(solver, firm_length);
    solver.use_rank(trusted);
    note_least();
    lasting_ = RowTrust::lasting(solver, firm, trusted);
    if (whole && trusted < all) ++statistics_.rank_drops;
    return trusted > firm ? length_with(trusted) : firm_length;
  }
  // After a solution: whether the dropped rows follow from the kept ones. They are satisfied only
  // while they depend on these. If they ask for a longer move than when they were dropped, one of
  // them may have become independent.
  bool dropped_follow() {
    if (!drops_rows() || rows_.C().sparse()) return true;
    const double left = rows_.left_of_dropped(WT());
    if (decided_) usual_ = left;
    return decided_ || left <= std::max(kFollows * options_.advanced.tolerance, 2.0 * usual_) ||
           left <= 1e2 * kEpsilon * N_VWrmsNorm(at_.base, at_.weights);
  }
  Status learn_trust(double length) {
    const double* tolerances = evaluator_.uses_differences() ? WT().data() : nullptr;
    return rows_.learn_trust(t_, y_.data(), tolerances, length);
  }
  // Level of each unknown in the rows that are measured in tolerances; empty if there is one level.
  // Structural entries count, also those that are zero now: at rest the entries of positions in
  // rows of velocities are.
  const std::vector<int>& levels() {
    if (levels_) return *levels_;
    levels_ = levels_of_columns(rows_.C().pattern(rows_.d.rows));
    if (*std::max_element(levels_->begin(), levels_->end()) < 1) levels_->clear();
    return *levels_;
  }
  void find_rates() {
    if (!in_use(Mechanism::rate_limit) || at_.predicted_rate == nullptr || metric_.by_rates() ||
        options_.advanced.metric != Metric::local_correction || ++decisions_ > kEarly)
      return;
    const std::vector<int>& found = levels();
    if (found.empty() || !first_are_rates_of_zeroth(found)) return;
    metric_.use_rates(found);
    fill_metric();
  }
  // Whether levels 0 and 1 have equally many unknowns and rows, and unknowns and rates are of equal
  // size. An energy is one row more.
  bool first_are_rates_of_zeroth(const std::vector<int>& levels) {
    double rates = 0.0, values = 0.0;
    int more = 0, more_rows = 0;
    for (std::size_t i = 0; i < levels.size(); ++i) {
      if (levels[i] == 0) {
        rates += square(at_.predicted_rate[i] + at_.cj * at_.correction_entries[i]);
        ++more;
      } else if (levels[i] == 1) {
        values += square(y_[i]);
        --more;
      }
    }
    for (const int i : rows_.d.rows) {
      int level = -1;
      rows_.C().visit(i, [&](int j, double entry) {
        if (entry != 0.0) level = std::max(level, levels[static_cast<std::size_t>(j)]);
      });
      more_rows += level == 0 ? 1 : level == 1 ? -1 : 0;
    }
    return more == 0 && more_rows == 0 && values > 0.0 &&
           std::abs(rates - values) <= kAlike * values;
  }
  // C of another point says nothing about its thin rows.
  Solution solution_at_point() {
    thin_ = lasting_ = false;
    double sum = 0.0;
    rows_.for_moves([&](int j, double move) { sum += square(move * at_.weight_entries[j]); });
    Solution found;
    found.length = wrms(sum);
    found.rank = rows_.rank();
    return found;
  }
  // The solution with the rows that can be trusted, where some are thin or were dropped.
  [[gnu::noinline]] Solution with_independent_rows(Solution found, Solve how) {
    if (how == Solve::first && thin_) {
      found.length = judge_thin_rows(found.length);
      if (!moved_ && rows_.trust.must_learn()) {
        // The move of the firm rows shows how C turns. Then all rows are judged at the start of the
        // move.
        rows_.for_moves([this](int j, double move) { y_[static_cast<std::size_t>(j)] -= move; });
        found.status = learn_trust(found.length);
        place(at_);
        if (found.status == Status::success) found.status = factor(t_, false);
        if (found.status != Status::success) return found;
        rows_.solve(g_);
        found.length = judge_thin_rows(length_of_solution());
      }
    }
    if (how != Solve::rest && !dropped_follow()) {
      lasting_ = false;
      if ((found.status = factor(t_, false)) != Status::success) return found;
      rows_.solve(g_);
      found.length = length_of_solution();
      if (thin_) found.length = judge_thin_rows(found.length);
      (void)dropped_follow();  // notes what they ask for now
    }
    length_ = found.length;
    return found;
  }

  Evaluator evaluator_;
  SplitRows rows_;
  LocalMetric metric_;
  std::size_t reported_;  // the others are equations of F
  double inverse_n_;
  Candidate at_{};
  std::vector<double> y_, WT_, g_;
  std::vector<double> shifted_;     // work space
  double t_ = 0.0, length_ = 0.0;   // of the last evaluation and solution
  double solved_ = 0.0;             // the longest length of rows_.a.dy of this candidate
  bool rows_known_ = false;         // C belongs to the present y
  bool thin_ = false;               // some of the factored rows need RowTrust
  bool lasting_ = false;            // the choice of rows is right for the next steps, too
  bool decided_ = false;            // it was made for this candidate
  bool moved_ = false;              // this candidate
  double least_ = 1.0;              // least independent part of a row at this candidate
  int left_out_ = 0, without_ = 0;  // weak rows, and candidates to come without them
  int decisions_ = 0;
  double usual_ = 0.0;  // asked for by dropped rows after the moves, when that was decided
  std::optional<std::vector<int>> levels_;  // of the rows as they are arranged
  N_Vector id_ = nullptr;                   // that they are arranged by
};

}  // namespace

std::unique_ptr<RowsAt> make_rows(const Constraints& constraints, const Options& options,
                                  Statistics& statistics, N_Vector like, int reported) {
  if (has_values(constraints)) {
    const int size = static_cast<int>(N_VGetLength(like));
    return make_contiguous_rows(constraints, options, statistics, size,
                                wants_sparse_factors(constraints, size), reported);
  }
  MakeRows make = make_user_rows;
  if (const auto* rows = std::get_if<Gradients>(&constraints.jacobian)) make = rows->make;
  if (const auto* rows = std::get_if<DistributedRows>(&constraints.jacobian)) make = rows->make;
  return make(constraints, options, statistics, like);
}

std::unique_ptr<RowsAt> make_contiguous_rows(const Constraints& constraints, const Options& options,
                                             Statistics& statistics, int size, bool sparse,
                                             int reported) {
  return std::make_unique<ContiguousRows>(constraints, options, statistics, size, sparse, reported);
}

}  // namespace tether::ida_projection

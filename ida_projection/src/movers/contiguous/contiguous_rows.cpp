// Tether: g, C and its factors at a candidate, on contiguous vectors. SPDX-License-Identifier:
// BSD-3-Clause
#include "contiguous_rows.hpp"

#include <cstdint>

#include "host/mechanisms.hpp"
#include "host/shortest.hpp"
#include "rows/row_levels.hpp"

namespace tether::ida_projection {

namespace {

constexpr int kSignPatterns = 4;
constexpr int kMostRateSearches = 16;
constexpr int kEarly = 64;       // factorisations that belong to the start of a run
constexpr double kAlike = 0.05;  // relative change of a sum of squares

}  // namespace

template <class Rows>
Status ContiguousRows<Rows>::load(const Candidate& candidate, bool refills) {
  at_.load(candidate);
  if (!refills) metric_.find(at_);
  uses_.decided = moved_ = false;
  return blocks_.structured() ? Status::success : structure(candidate, nullptr);
}

template <class Rows>
Status ContiguousRows<Rows>::value(double t, bool with_rows) {
  rows_known_ = false;
  if (!with_rows || !evaluator_.gives_both())
    return with_message(evaluator_.value(t, at_.y.data(), unknowns(), g_.data()));
  const Status status = rows(t, g_.data());
  rows_known_ = status == Status::success;
  return status;
}

template <class Rows>
Status ContiguousRows<Rows>::structure(const Candidate& candidate, const double* id) {
  uses_.there = levels_known_ = false;
  const Status status =
      blocks_.structure(evaluator_, candidate.t, at_.y, at_.WT(), options_.hold, id);
  if (status != Status::success) message = blocks_.message;
  return status;
}

// Level of each unknown in the rows that are measured in tolerances; empty if there is one level.
// Structural entries count, also those that are zero now: at rest the entries of positions in rows
// of velocities are.
template <class Rows>
const std::vector<int>& ContiguousRows<Rows>::levels() {
  if (levels_known_) return found_levels_;
  found_levels_ = levels_of_columns(blocks_.pattern(blocks_.d.rows));
  if (*std::max_element(found_levels_.begin(), found_levels_.end()) < 1) found_levels_.clear();
  levels_known_ = true;
  return found_levels_;
}

template <class Rows>
bool ContiguousRows<Rows>::use_levels(bool on) {
  if (on && levels().empty()) return false;
  if (on)
    metric_.use_levels(levels());
  else
    metric_.forget_levels();
  uses_.there = false;
  return true;
}

template <class Rows>
void ContiguousRows<Rows>::find_rates() {
  const bool wanted = in_use(Mechanism::rate_limit) &&
                      options_.advanced.metric == Metric::local_correction && at_.knows_rates();
  const bool early = factored_ <= kEarly && rate_searches_ < kMostRateSearches;
  if (!wanted || metric_.by_rates() || !early) return;
  ++rate_searches_;
  const std::vector<int>& found = levels();
  if (found.empty() || !first_are_rates_of_zeroth(found)) return;
  metric_.use_rates(found);
  fill_metric();
}

// Whether levels 0 and 1 have equally many unknowns and rows, and unknowns and rates are of equal
// size. An energy is one row more.
template <class Rows>
bool ContiguousRows<Rows>::first_are_rates_of_zeroth(const std::vector<int>& levels) {
  double rates = 0.0, values = 0.0;
  int more = 0, more_rows = 0;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    if (levels[i] == 0) {
      rates += at_.rate(i) * at_.rate(i);
      ++more;
    } else if (levels[i] == 1) {
      values += at_.y[i] * at_.y[i];
      --more;
    }
  }
  for (const int i : blocks_.d.rows) {
    int level = -1;
    blocks_.visit_row(i, [&](int j, double entry) {
      if (entry != 0.0) level = std::max(level, levels[static_cast<std::size_t>(j)]);
    });
    more_rows += level == 0 ? 1 : level == 1 ? -1 : 0;
  }
  return more == 0 && more_rows == 0 && values > 0.0 && std::abs(rates - values) <= kAlike * values;
}

// C at the present y, and g if wanted.
template <class Rows>
Status ContiguousRows<Rows>::rows(double t, double* g) {
  // Only differences and mixed rows need the size of a tolerance.
  const double* WT = evaluator_.uses_differences() || blocks_.mixed() ? at_.WT().data() : nullptr;
  Status status = blocks_.evaluate(evaluator_, t, at_.y.data(), WT, g);
  if (status == Status::success && blocks_.outgrown()) {
    blocks_.rearrange();
    uses_.there = uses_.lasting = levels_known_ = false;
    fill_metric();
    status = blocks_.evaluate(evaluator_, t, at_.y.data(), WT);
  }
  return with_message(status);
}

template <class Rows>
Status ContiguousRows<Rows>::factor(double t, bool refill) {
  if (refill) fill_metric();
  if (!rows_known_) {
    const Status status = rows(t, nullptr);
    if (status != Status::success) return status;
  }
  rows_known_ = false;
  t_ = t;
  factored_ = std::min(factored_ + 1, kEarly + 1);
  const bool known = in_use(Mechanism::kept_rank) && Rows::kDense && uses_.lasting && uses_.there;
  uses_.there = false;
  if (known && blocks_.factor_kept()) {
    uses_.thin = false;
    ++statistics_.refactorizations;
  } else if (!decide()) {
    message = "the constraint Jacobian C has an entry that is not finite at t = " + brief(t);
    return Status::not_finite;
  }
  uses_.there = true;
  return Status::success;
}

// Factors that show which rows are independent. False: an entry is not finite.
template <class Rows>
bool ContiguousRows<Rows>::decide() {
  ++statistics_.factorizations;
  find_rates();
  if (!blocks_.factor()) return false;
  if (blocks_.dropped_rows()) ++statistics_.rank_drops;
  if constexpr (Rows::kDense)
    uses_.thin = in_use(Mechanism::row_trust) && RowTrust::has_thin_rows(blocks_.counted().solver);
  uses_.lasting = !uses_.thin;
  uses_.decided = true;
  return true;
}

// Algebraic columns do not count: they follow the others, and are not in the error test.
template <class Rows>
double ContiguousRows<Rows>::length_of_solution() {
  ++statistics_.iterations;
  double sum = 0.0;
  const Block& block = counted();
  block.for_columns([&sum, dy = block.dy.data(), w = at_.w](int k, int i) {
    const double move = dy[k] * w[i];
    sum += move * move;
  });
  return wrms(sum);
}

template <class Rows>
double ContiguousRows<Rows>::length_of_all() const {
  double sum = 0.0;
  for (const Block* block : {&blocks_.d, &blocks_.a})
    for (std::size_t k = 0; k < block->columns.size() && !block->rows.empty(); ++k)
      sum += std::pow(block->dy[k] * at_.w[block->columns[k]], 2);
  return wrms(sum);
}

template <class Rows>
Solution ContiguousRows<Rows>::solve(Solve how) {
  Solution found;
  blocks_.solve(g_);
  found.length = length_of_solution();
  if (how == Solve::point) {  // C of another point says nothing about its rows
    uses_.thin = uses_.lasting = false;
    found.length = length_of_all();
    found.rank = blocks_.rank();
    return found;
  }
  if (how == Solve::test) --statistics_.iterations;
  if (how == Solve::first && uses_.thin) {
    const double alone = found.length;
    found.length = judge_thin_rows(alone);
    if (!moved_ && blocks_.trust.must_learn(found.length)) {
      // The move of the firm rows shows how C turns. Then all rows are judged at the start of the
      // move.
      for (const Block* block : {&blocks_.d, &blocks_.a})
        if (!block->rows.empty())
          block->for_columns(
              [y = at_.y.data(), dy = block->dy.data()](int k, int i) { y[i] -= dy[k]; });
      length_ = found.length;
      found.status = learn_trust(length_);
      at_.restart();
      if (found.status == Status::success) found.status = factor(t_, false);
      if (found.status != Status::success) return found;
      blocks_.solve(g_);
      found.length = judge_thin_rows(length_of_solution());
    }
  }
  // A polish is too short to show it.
  if (Rows::kDense && how != Solve::rest && !dropped_follow()) {
    uses_.lasting = false;
    if ((found.status = factor(t_, false)) != Status::success) return found;
    blocks_.solve(g_);
    found.length = length_of_solution();
    if (uses_.thin) found.length = judge_thin_rows(found.length);
    (void)dropped_follow();  // notes what they ask for now
  }
  length_ = found.length;
  return found;
}

// After a solution of this length with all rows: decides which thin rows take part until the next
// factorisation. Returns the length of the solution with those.
template <class Rows>
double ContiguousRows<Rows>::judge_thin_rows(double length) {
  if constexpr (Rows::kDense) {
    linalg::MinimumNorm& solver = blocks_.counted().solver;
    const int all = solver.rank();
    if (blocks_.trust.trusted_rows(solver, length) == all) return length;
    const auto by = [&](int rank) {
      solver.use_rank(rank);
      blocks_.solve(g_);
      --statistics_.iterations;
      return length_of_solution();
    };
    const bool whole = !blocks_.dropped_rows();
    // Firm rows do not magnify their right-hand side.
    const int firm = RowTrust::firm_rows(solver);
    const double firm_length = by(firm);
    solver.use_rank(all);
    const int trusted = blocks_.trust.trusted_rows(solver, firm_length);
    solver.use_rank(trusted);
    uses_.lasting = RowTrust::lasting(solver, firm, trusted);
    if (whole && trusted < all) ++statistics_.rank_drops;
    return trusted > firm ? by(trusted) : firm_length;
  }
  return length;
}

// After a move of this length: measures by how much C has turned.
template <class Rows>
Status ContiguousRows<Rows>::learn_trust(double length) {
  return with_message(
      blocks_.learn_trust(evaluator_, t_, at_.y.data(), WT_of_differences(), length));
}

// After a solution: whether the dropped rows follow from the kept ones. They are satisfied only
// while they depend on these. If they ask for a longer move than when they were dropped, one of
// them may have become independent.
template <class Rows>
bool ContiguousRows<Rows>::dropped_follow() {
  if (!blocks_.dropped_rows()) return true;
  const double left = blocks_.left_of_dropped(at_.WT());
  if (uses_.decided) usual_ = left;
  return uses_.decided || left <= std::max(kFollows * options_.advanced.tolerance, 2.0 * usual_) ||
         left <= 1e2 * kEpsilon * at_.size();
}

template <class Rows>
bool ContiguousRows<Rows>::contradicts() {
  if (!blocks_.dropped_rows() || !blocks_.contradict(at_.WT())) return false;
  message = blocks_.contradiction.message;
  contradicting = blocks_.contradiction.rows;
  return true;
}

template <class Rows>
Status ContiguousRows<Rows>::apply(double share, const Candidate& candidate) {
  double* const correction = candidate.correction_entries;
  const bool learns = uses_.thin && !moved_ && share == 1.0;
  moved_ = true;
  if (const Block& d = blocks_.d; blocks_.a.rows.empty() && d.first >= 0) {
    take(share, d.dy.data(), static_cast<int>(d.columns.size()), correction + d.first,
         at_.y.data() + d.first);
    return learns ? learn_trust(length_) : Status::success;
  }
  for (const Block* block : {&blocks_.d, &blocks_.a}) {
    if (block->rows.empty()) continue;
    if (block->first >= 0)
      take(share, block->dy.data(), static_cast<int>(block->columns.size()),
           correction + block->first, at_.y.data() + block->first);
    else
      block->for_columns([=, y = at_.y.data(), dy = block->dy.data()](int k, int i) {
        correction[i] -= share * dy[k];
        y[i] -= share * dy[k];
      });
  }
  return learns ? learn_trust(length_) : Status::success;
}

template <class Rows>
double ContiguousRows<Rows>::change() const {
  double sum = 0.0;
  blocks_.d.for_columns([&](int, int j) {
    const double change = at_.ycor[j] * at_.w[j];
    sum += change * change;
  });
  return wrms(sum);
}

template <class Rows>
double ContiguousRows<Rows>::shift(N_Vector change) {
  const double *e = N_VGetArrayPointer(change), *w = at_.w;
  double* y = at_.y.data();
  for (int i = 0, n = unknowns(); i < n; ++i) y[i] += e[i];
  double sum = 0.0;
  blocks_.d.for_columns([&sum, e, w](int, int j) { sum += (e[j] * w[j]) * (e[j] * w[j]); });
  return wrms(sum);
}

template <class Rows>
double ContiguousRows<Rows>::drift() const {
  double largest = 0.0;
  for (int i = 0; i < reported_; ++i)
    largest = std::max(largest, std::abs(g_[static_cast<std::size_t>(i)]));
  return largest;
}

template <class Rows>
void ContiguousRows<Rows>::reset() {
  uses_.there = false;
  metric_.reset();
  if constexpr (Rows::kDense) blocks_.trust.reset();
  usual_ = 0.0;
  factored_ = rate_searches_ = 0;
  levels_known_ = false;
}

// Whether the rounding of its own terms explains g_i.
template <class Rows>
bool ContiguousRows<Rows>::only_rounding(std::size_t i) const {
  return std::abs(g_[i]) <= 64.0 * kEpsilon * blocks_.terms(static_cast<int>(i), at_.y.data());
}

// Whether it explains every g_i. Then there is nothing to enforce, however long the move would be.
template <class Rows>
bool ContiguousRows<Rows>::rounding_only() {
  for (std::size_t i = 0; i < g_.size(); ++i)
    if (!only_rounding(i)) return false;
  return true;
}

// Length of the move that the rounding of g asks for in the worst case, with the current factors:
// at most sum_i |dy_i|, dy_i the move for row i alone, and so sqrt(m sum_i |dy_i|^2), the sum of
// squares by moves for all rows with random signs.
template <class Rows>
double ContiguousRows<Rows>::rounding_length() {
  kept_g_ = g_;
  const std::vector<double>& g = kept_g_;
  std::uint32_t random = 1;
  double squares = 0.0;
  for (int pattern = 0; pattern < kSignPatterns; ++pattern) {
    for (std::size_t i = 0; i < g.size(); ++i) {
      random = 1664525u * random + 1013904223u;  // Numerical Recipes, section 7.1
      const double rounding = 8.0 * kEpsilon * blocks_.terms(static_cast<int>(i), at_.y.data());
      g_[i] = random >> 31 != 0 ? rounding : -rounding;
    }
    blocks_.solve(g_);
    squares += std::pow(length_of_solution(), 2);
  }
  g_ = g;
  blocks_.solve(g_);
  return std::sqrt(squares / kSignPatterns * count());
}

template <class Rows>
bool ContiguousRows<Rows>::tangency(const std::vector<double>& yp, const double* id,
                                    Tangency& out) {
  if (!blocks_.structured() || !uses_.there) return false;
  const auto rows = static_cast<std::size_t>(reported_);
  for (std::vector<double>* each : {&out.rate, &out.terms, &out.tolerance, &out.size})
    each->resize(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    double rate = 0.0, terms = 0.0, square = 0.0, size = 0.0;
    bool algebraic = false;
    blocks_.visit_row(static_cast<int>(i), [&](int j, double c) {
      const auto k = static_cast<std::size_t>(j);
      const bool differential = id == nullptr || id[j] != 0.0;
      algebraic = algebraic || (c != 0.0 && !differential);
      rate += c * yp[k];
      terms += std::abs(c * yp[k]);
      if (differential) size += std::abs(c) * std::max(1.0, std::abs(at_.y[k]));
      const double moved = at_.w[k] > 0.0 ? c / at_.w[k] : 0.0;
      square += moved * moved;
    });
    out.rate[i] = rate;
    out.size[i] = size;
    out.terms[i] = algebraic ? -1.0 : terms;
    out.tolerance[i] = std::sqrt(square);
  }
  return true;
}

template <class Rows>
bool ContiguousRows<Rows>::tangent(double t, N_Vector yp) {
  const double h = std::cbrt(kEpsilon) * std::max(1.0, std::abs(t));
  std::vector<double> defect(g_), minus(g_);
  const auto value = [&](double time, std::vector<double>& g) {
    return with_message(evaluator_.value(time, at_.y.data(), unknowns(), g.data())) ==
           Status::success;
  };
  if (!value(t + h, defect) || !value(t - h, minus) || rows(t, nullptr) != Status::success ||
      !blocks_.factor())
    return false;
  double* const slope = N_VGetArrayPointer(yp);
  for (std::size_t i = 0; i < g_.size(); ++i)  // a g that does not contain t has no differences
    defect[i] = (defect[i] - minus[i]) / (2.0 * h) + blocks_.times(static_cast<int>(i), slope);
  blocks_.solve(defect);
  for (const Block* block : {&blocks_.d, &blocks_.a})
    for (std::size_t k = 0; k < block->columns.size() && !block->rows.empty(); ++k)
      slope[block->columns[k]] -= block->dy[k];
  return true;
}

std::unique_ptr<RowsAt> make_contiguous_rows(const Constraints& constraints, const Options& options,
                                             Statistics& statistics, int size, bool sparse,
                                             int reported) {
  if (sparse)
    return std::make_unique<ContiguousRows<SparseRows>>(constraints, options, statistics, size,
                                                        reported);
  return std::make_unique<ContiguousRows<DenseRows>>(constraints, options, statistics, size,
                                                     reported);
}

}  // namespace tether::ida_projection

// Tether: Newton's method onto the constraints, on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
#include <cstdint>

#include "movers/contiguous_mover.hpp"

namespace tether::ida_projection {

namespace {

// Factors of an earlier step leave at most so much for settle(), in tolerances.
constexpr double kForLater = 0.1;
constexpr int kQuick = 3;  // moves with a whole C
constexpr int kRoundedOneByOne = 32, kSignPatterns = 4;

}  // namespace

template <class Rows>
Status ContiguousMover<Rows>::structure(const Candidate& candidate, const double* id) {
  reusable_ = false;
  const Status status =
      blocks_.structure(evaluator_, candidate.t, at_.y, at_.WT(), options_.hold, id);
  if (status != Status::success) message_ = blocks_.message;
  return status;
}

template <class Rows>
Status ContiguousMover<Rows>::set_algebraic(const Candidate& candidate, N_Vector id) {
  at_.load(candidate);
  const double* mask = id != nullptr ? N_VGetArrayPointer(id) : nullptr;
  return structure(candidate, mask);
}

// C at the present y, and g if wanted.
template <class Rows>
Status ContiguousMover<Rows>::rows(double t, double* g) {
  // Only differences and mixed rows need to know how large a tolerance is.
  const double* WT = evaluator_.uses_differences() || blocks_.mixed() ? at_.WT().data() : nullptr;
  Status status = blocks_.evaluate(evaluator_, t, at_.y.data(), WT, g);
  if (status == Status::success && blocks_.outgrown()) {
    blocks_.rearrange();
    reusable_ = lasting_ = false;
    set_metric(true);
    status = blocks_.evaluate(evaluator_, t, at_.y.data(), WT);
  }
  if (status != Status::success) message_ = evaluator_.message();
  return status;
}

// g where C will be wanted, too.
template <class Rows>
Status ContiguousMover<Rows>::value_with_rows(double t) {
  if (!evaluator_.gives_both()) return value(t);
  const Status status = rows(t, g_.data());
  rows_known_ = status == Status::success;
  return status;
}

template <class Rows>
Status ContiguousMover<Rows>::factor(double t) {
  if (!rows_known_) {
    const Status status = rows(t, nullptr);
    if (status != Status::success) return status;
  }
  rows_known_ = false;
  const bool known = Rows::kKeepsRank && lasting_ && reusable_;
  reusable_ = false;
  weighed_ = false;
  if (known && blocks_.factor_kept()) {
    thin_ = false;
    ++(Rows::many(m_) ? statistics_.refactorizations : statistics_.factorizations);
  } else if (!decide()) {
    message_ =
        "the constraint Jacobian C has an entry that is not finite at t = " + std::to_string(t);
    return Status::not_finite;
  }
  reusable_ = true;
  slope_ = kUnknownSlope;
  age_ = 0;
  wear_.renewed();
  return Status::success;
}

// Factors from which it can be seen which rows are independent. False: an entry is not finite.
template <class Rows>
bool ContiguousMover<Rows>::decide() {
  ++statistics_.factorizations;
  if (!blocks_.factor()) return false;
  if (blocks_.dropped_rows()) ++statistics_.rank_drops;
  if constexpr (Rows::kThinRows) thin_ = RowTrust::has_thin_rows(blocks_.counted().solver);
  lasting_ = !thin_;
  decided_ = true;
  return true;
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
    // Nothing magnifies the right-hand side of the firm rows.
    const int firm = RowTrust::firm_rows(solver);
    solver.use_rank(firm);
    const double firm_length = solve();
    --statistics_.iterations;
    if (!firm_only_) {
      solver.use_rank(all);
      const int trusted = blocks_.trust.trusted_rows(solver, firm_length);
      solver.use_rank(trusted);
      lasting_ = RowTrust::lasting(solver, firm, trusted);
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

template <class Rows>
bool ContiguousMover<Rows>::must_learn(double length) const {
  if constexpr (Rows::kThinRows) return thin_ && start_known_ && blocks_.trust.must_learn(length);
  return false;
}

// After the first move: by how much has C turned?
template <class Rows>
Status ContiguousMover<Rows>::learn_trust(double t, double length) {
  if constexpr (Rows::kThinRows) {
    if (!thin_) return Status::success;
    const double* WT = evaluator_.uses_differences() ? at_.WT().data() : nullptr;
    const Status status = blocks_.learn_trust(evaluator_, t, at_.y.data(), WT, length);
    if (status != Status::success) message_ = evaluator_.message();
    return status;
  }
  return Status::success;
}

template <class Rows>
bool ContiguousMover<Rows>::contradicts() {
  if (!blocks_.dropped_rows()) return false;
  if (weighed_ && blocks_.left_of_dropped() <= kContradiction) return false;
  if (!blocks_.contradict(at_.WT())) return false;
  message_ = blocks_.contradiction.message;
  contradicting_rows_ = blocks_.contradiction.rows;
  return true;
}

// Does the rounding of its own terms explain every g_i? Then there is nothing to enforce, however
// short the tolerances are that the metric would make of it.
template <class Rows>
bool ContiguousMover<Rows>::rounding_only() const {
  for (int i = 0; i < m_; ++i) {
    const double terms = blocks_.terms(i, at_.y.data());
    if (!(std::abs(g_[static_cast<std::size_t>(i)]) <= 64.0 * kEpsilon * terms)) return false;
  }
  return true;
}

// Length of the move that the rounding of g asks for in the worst case, with the present factors:
// at most sum_i |dy_i|, dy_i the move for row i alone. Where that would take many solves it is
// bounded by sqrt(m sum_i |dy_i|^2), the sum of squares by moves for all rows with random signs.
template <class Rows>
double ContiguousMover<Rows>::rounding_length() {
  const std::vector<double> g = g_;
  std::vector<double> rounding(g.size());
  for (int i = 0; i < m_; ++i)
    rounding[static_cast<std::size_t>(i)] = 8.0 * kEpsilon * blocks_.terms(i, at_.y.data());
  double total = 0.0;
  const auto add = [&](auto&& length) {
    total += length(solve());
    --statistics_.iterations;
  };
  if (m_ <= kRoundedOneByOne) {
    for (std::size_t i = 0; i < g.size(); ++i) {
      std::fill(g_.begin(), g_.end(), 0.0);
      g_[i] = rounding[i];
      add([](double length) { return length; });
    }
  } else {
    std::uint32_t random = 1;
    for (int pattern = 0; pattern < kSignPatterns; ++pattern) {
      for (std::size_t i = 0; i < g.size(); ++i) {
        random = 1664525u * random + 1013904223u;  // Numerical Recipes, section 7.1
        g_[i] = random >> 31 != 0 ? rounding[i] : -rounding[i];
      }
      add([](double length) { return length * length; });
    }
    total = std::sqrt(total / kSignPatterns * m_);
  }
  g_ = g;
  return total;
}

template <class Rows>
Move ContiguousMover<Rows>::measure(const Candidate& candidate) {
  Move result;
  at_.load(candidate);
  if (!blocks_.structured() && (result.status = structure(candidate, nullptr)) != Status::success)
    return result;
  if ((result.status = value_with_rows(candidate.t)) != Status::success) return result;
  result.drift_before = result.drift_after = drift();
  if (result.drift_before == 0.0) return result;
  set_metric(true);
  lasting_ = false;
  if ((result.status = factor(candidate.t)) != Status::success) return result;
  if (rounding_only()) return result;
  firm_only_ = false;
  result.length = first_solve();
  result.floor = 4.0 * kEpsilon * at_.size();
  if (contradicts()) result.status = Status::inconsistent;
  return result;
}

// Only a long move can be too long: the limit is at least largest_move.
template <class Rows>
bool ContiguousMover<Rows>::too_long(double length, double& limit) const {
  if (length <= options_.largest_move) return false;
  double sum = 0.0;
  for (int j : blocks_.d.columns) {
    const double change = at_.ycor[j] * at_.w[j];
    sum += change * change;
  }
  limit = options_.largest_move * std::max(1.0, std::sqrt(sum * inverse_n_));
  return !(length <= limit);
}

template <class Rows>
Move ContiguousMover<Rows>::move(const Candidate& candidate) {
  Move result;
  at_.load(candidate);
  reused_ = may_reuse();
  ++age_;
  decided_ = false;
  set_metric(!reused_);
  result.status = reused_ ? value(candidate.t) : value_with_rows(candidate.t);
  if (result.status != Status::success) return result;
  firm_only_ = start_known_ = false;
  result = newton(candidate, drift());
  const bool broken =
      result.status == Status::not_converged || result.status == Status::move_too_long;
  if (broken && start_known_) result = newton_with_firm_rows(candidate, result);
  if (broken || result.moves > kQuick) blocks_.look_again_soon();
  // Kept factors are in use only while dropped rows ask for less than that.
  if (result.status == Status::success && !result.capped && !reused_ && contradicts())
    result.status = Status::inconsistent;
  return result;
}

// Back to the correction before the move.
template <class Rows>
void ContiguousMover<Rows>::restart(const Candidate& candidate) {
  for (std::size_t i = 0; i < start_.size(); ++i) candidate.correction_entries[i] = start_[i];
  at_.restart(candidate);
}

// Where rows are nearly parallel they magnify the rounding of g beyond any tolerance. Such a row
// cannot be followed, nor need it be, if without it the others lead to a point where rounding
// explains every g: only then does this count.
template <class Rows>
Move ContiguousMover<Rows>::newton_with_firm_rows(const Candidate& candidate, const Move& failed) {
  const std::string reason = message_;
  restart(candidate);
  Move result = failed;
  if ((result.status = value_with_rows(candidate.t)) != Status::success) return result;
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

// Newton's method from at_.y, with g_ known there.
template <class Rows>
Move ContiguousMover<Rows>::newton(const Candidate& candidate, double drift_before) {
  Move result;
  double* correction = candidate.correction_entries;
  result.drift_before = result.drift_after = drift_before;

  monitor_.start();
  bool fresh = false;  // factors belong to the present y
  bool have_factors = reused_;
  const bool was_reused = reused_;
  if (Rows::kThinRows && was_reused) std::copy(correction, correction + n_, start_.begin());
  bool tried = firm_only_;
  for (;;) {
    if (!have_factors) {
      if ((result.status = factor(candidate.t)) != Status::success) return result;
      have_factors = fresh = true;
      if (!firm_only_ && (result.moves == 0 || was_reused)) {
        start_known_ = thin_;
        if (thin_ && !was_reused) std::copy(correction, correction + n_, start_.begin());
      }
    }
    const double length = fresh ? first_solve() : solve();
    if (result.moves == 0 && !tried && must_learn(length)) {
      // The firm rows' move shows how C turns; then all rows are judged, from the start.
      tried = true;
      apply(1.0, correction);
      if ((result.status = learn_trust(candidate.t, length)) != Status::success) return result;
      restart(candidate);
      have_factors = false;
      continue;
    }
    const bool follow = dropped_follow();
    if (reused_ && !(length <= kLong && follow)) {
      set_metric(true);
      reused_ = have_factors = false;
      continue;
    }
    if (!follow && Rows::kKeepsRank) {
      lasting_ = have_factors = false;
      continue;
    }
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
        result.left = length - limit;
        result.length = limit;
        result.capped = true;
        result.status = Status::success;
        return result;
      }
    }
    apply(1.0, correction);
    if (reused_) {
      if (2.0 * rate() * length <= kForLater) break;
      if ((result.status = value(candidate.t)) != Status::success) return result;
      set_metric(true);
      reused_ = have_factors = false;
      continue;
    }
    if (result.moves == 1 && (result.status = learn_trust(candidate.t, length)) != Status::success)
      return result;

    // A first move longer than the largest floor need not know it.
    const double floor = result.moves == 1 && length > kLargestFloor
                             ? 0.0
                             : std::min(kLargestFloor, 1e3 * kEpsilon * at_.size());
    Monitor::Verdict verdict = monitor_.judge(length, fresh, floor);
    // Almost parallel rows magnify rounding: a move that it explains has converged.
    if ((verdict == Monitor::Verdict::failed || verdict == Monitor::Verdict::refactor) &&
        length <= std::min(kLargestFloor, rounding_length()))
      verdict = Monitor::Verdict::done;
    if (verdict == Monitor::Verdict::done) break;
    if (verdict == Monitor::Verdict::failed) {
      result.status = Status::not_converged;
      message_ =
          "move " + std::to_string(result.moves) + " onto the constraints still is " +
          std::to_string(length) +
          " tolerances long; check the constraint Jacobian with check_jacobian, or whether "
          "the rows have a common solution here; rows written as squares have none but double "
          "roots, and rows with |.| or max no derivative: neither lets Newton's moves shrink";
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

template double ContiguousMover<RowBlocks>::first_solve();
template double ContiguousMover<SparseRows>::first_solve();
template double ContiguousMover<RowBlocks>::rounding_length();
template double ContiguousMover<SparseRows>::rounding_length();

std::unique_ptr<Mover> make_dense_mover(const Constraints& constraints, const Options& options,
                                        Statistics& statistics, int size, int reported) {
  return std::make_unique<ContiguousMover<RowBlocks>>(constraints, options, statistics, size,
                                                      reported);
}

std::unique_ptr<Mover> make_sparse_mover(const Constraints& constraints, const Options& options,
                                         Statistics& statistics, int size, int reported) {
  return std::make_unique<ContiguousMover<SparseRows>>(constraints, options, statistics, size,
                                                       reported);
}

}  // namespace tether::ida_projection

// Tether: moves a polished candidate back onto the constraints, on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
#include "attach/shortest.hpp"
#include "contiguous_mover.hpp"

namespace tether::ida_projection {

namespace {

// This part of Options::tolerance is left where a move costs little beside the factors.
constexpr double kCheapRest = 1e-4;
// Factors of an earlier step are used while they leave less than kWorn of a move. Above kSlow five
// moves would not be enough.
constexpr double kWorn = 0.06, kSlow = 0.1;
constexpr double kHalving = 0.5;  // moves that leave more of each other do not converge

}  // namespace

template <class Rows>
Status ContiguousMover<Rows>::settle(const Candidate& candidate, N_Vector change) {
  const double *e = N_VGetArrayPointer(change), *w = rows_.at.w;
  double* y = rows_.at.y.data();
  for (int i = 0, n = static_cast<int>(rows_.at.y.size()); i < n; ++i) y[i] += e[i];
  if (keeps_factors()) return take_back(candidate, -1.0);
  double sum = 0.0;
  rows_.blocks.d.for_columns([&sum, e, w](int, int j) { sum += (e[j] * w[j]) * (e[j] * w[j]); });
  return take_rest(candidate, move_length_ + rows_.wrms(sum));
}

// With factors that belong to a point `reach` tolerances away.
template <class Rows>
Status ContiguousMover<Rows>::take_rest(const Candidate& candidate, double reach) {
  const bool measure = staleness_.due(reach);
  const double enough = (takes_rest_ ? kCheapRest : 1.0) * options_.advanced.tolerance;
  double previous = 0.0;
  for (int k = 0; k < options_.advanced.maximum_iterations; ++k) {
    const Status status = rows_.value(candidate.t);
    if (status != Status::success) return status;
    double length = rows_.solve();
    const bool lost = takes_rest_ && !rows_.dropped_follow();
    if (lost || (still_ && kept_.age > 0 && length > kNothing)) {
      if (lost) rows_.factors.lasting = false;
      if (still_) rows_.set_metric(true);
      const Status made = factor(candidate.t);
      if (made != Status::success) return made;
      length = first_solve();
    }
    rows_.apply(1.0, candidate.correction_entries);
    if (still_ && kept_.age > 0) break;  // by next to nothing, which says nothing about its rate
    // Only what is seen on this candidate counts where moves are cheap.
    const double expected = takes_rest_ ? length * (k > 0 ? length / previous : kUnknownSlope)
                                        : staleness_.left(reach, length);
    const bool enough_done = (k > 0 || takes_rest_ || !measure) && expected <= enough;
    if (k == 0 && enough_done) break;
    const double floor = 1e2 * kEpsilon * rows_.at.size();
    const bool rounding = length <= floor || (k > 0 && length > 0.5 * previous);
    if (k > 0) staleness_.measured(reach, previous, rounding ? 0.0 : length);
    if (rounding || enough_done) break;
    previous = length;
  }
  return Status::success;
}

// The same with kept factors, which leave a part of each move that grows with their age. Only what
// is seen on this candidate counts: a move shorter than the tolerance, or a part left, measured by
// two moves with the same factors, that makes the next one so; and dropped rows that follow the
// others. Where too much is left, also of dropped rows, or a move is long, factors are made anew.
// `previous`: length of the move before, by the same factors and with nothing in between; < 0:
// there is none.
template <class Rows>
Status ContiguousMover<Rows>::take_back(const Candidate& candidate, double previous) {
  const double floor = 1e2 * kEpsilon * rows_.at.size();
  const double done = std::max(floor, kSafe * options_.advanced.tolerance);
  for (int k = 0; k <= options_.advanced.maximum_iterations; ++k) {
    Status status = rows_.value(candidate.t);
    if (status != Status::success) return status;
    double length = rows_.solve();
    double part = previous > 0.0 && length > floor ? length / previous : 0.0;
    if (part > 0.0 && kept_.age > 0 && k > 0) kept_.slope = part / kept_.age;
    bool follow = rows_.dropped_follow();
    if (kept_.age > 0 && ((k > 0 && part > kSlow) || length > kLong || (k > 0 && !follow))) {
      rows_.set_metric(true);
      if ((status = factor(candidate.t)) != Status::success) return status;
      length = first_solve();
      follow = rows_.dropped_follow();
      part = 0.0;
      previous = -1.0;
    }
    // Almost parallel rows magnify rounding: moves would follow it without end.
    if (k > 0 && part > kHalving && rows_.rounding_only()) return Status::success;
    // One solution leaves most of what rows ask for that nearly depend on the others.
    if (k > 0 && part > kHalving && kept_.age == 0) {
      length = rows_.solve_closely();
      part = 0.0;
    }
    rows_.apply(1.0, candidate.correction_entries);
    // The first of two moves may have been left less of than what remains then would be.
    const double leaves = k > 0 ? part : std::max(part, kept_.rate());
    if (follow && (length <= done ||
                   (part > 0.0 && leaves * length <= kSafe * options_.advanced.tolerance))) {
      if (k > 0 && part > kWorn) rows_.factors.there = false;
      return Status::success;
    }
    previous = length;
  }
  rows_.factors.there = false;
  if (previous <= std::min(kLargestFloor, rows_.rounding_length())) return Status::success;
  message_ = "after " + std::to_string(options_.advanced.maximum_iterations) +
             " moves with kept factors the next one still is " + brief(previous) +
             " tolerances long (Options::maximum_iterations)";
  return Status::not_converged;
}

template Status ContiguousMover<DenseRows>::settle(const Candidate&, N_Vector);
template Status ContiguousMover<SparseRows>::settle(const Candidate&, N_Vector);
template Status ContiguousMover<DenseRows>::take_back(const Candidate&, double);
template Status ContiguousMover<SparseRows>::take_back(const Candidate&, double);

}  // namespace tether::ida_projection

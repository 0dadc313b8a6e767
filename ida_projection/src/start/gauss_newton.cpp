// Tether: a point far from the constraints onto them. SPDX-License-Identifier: BSD-3-Clause
#include "start/gauss_newton.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "host/rounding.hpp"
#include "host/shortest.hpp"
#include "rows/split_rows.hpp"

namespace tether::ida_projection {

namespace {

constexpr int kMaximumIterations = 60;
constexpr double kSmallestDamping = 1.0 / 1024.0;
constexpr double kConverged = 1e-8;  // tolerances: quadratic convergence makes this round-off
constexpr double kNear = 1.0;
constexpr double kAside = 10.0;  // times the move of the kept rows: dropped rows may ask for more

// `Rows` keeps C and its factors: DenseRows (dense) or SparseRows.
template <class Rows>
class GaussNewtonOn final : public GaussNewton {
 public:
  GaussNewtonOn(const Constraints& constraints, int size)
      : evaluator_(constraints, counts_),
        blocks_(constraints, evaluator_, size),
        n_(size),
        g_(static_cast<std::size_t>(evaluator_.rows()), 0.0) {}

  void project(double t, std::vector<double>& y, const std::vector<double>& WT,
               const std::vector<bool>& hold, const double* id, ConsistencyReport& report) override;
  bool tangent(double t, const std::vector<double>& y, double* yp) override;
  bool fatal() const override { return evaluator_.fatal(); }
  const std::string& message() const override { return evaluator_.message(); }

 private:
  using Block = typename Rows::Block;

  bool structured_for(const std::vector<bool>& hold, const double* id);
  bool evaluate(double t, const std::vector<double>& y, ConsistencyReport& report);
  Status evaluate_jacobian(double t, const std::vector<double>& y);
  void fill_metric();
  double correction();  // solves for the present g, returns its length
  double largest(const std::vector<double>& g) const;
  double floor_of(const std::vector<double>& y) const;
  bool rounding_only(const std::vector<double>& y) const;

  Statistics counts_;
  Evaluator evaluator_;
  Rows blocks_;
  int n_;
  std::vector<double> WT_, g_;
  std::vector<bool> hold_;  // those of the last structure
  std::vector<double> id_;
};

// The structure is reused for the next output point. evaluate() notices entries that were zero so
// far. Only the split of rows with variables of both kinds depends on the entries at a point.
template <class Rows>
bool GaussNewtonOn<Rows>::structured_for(const std::vector<bool>& hold, const double* id) {
  const std::vector<double> mask(id, id != nullptr ? id + n_ : id);
  const bool known = blocks_.structured() && !blocks_.mixed() && hold == hold_ && mask == id_;
  hold_ = hold;
  id_ = mask;
  return known;
}

template <class Rows>
bool GaussNewtonOn<Rows>::evaluate(double t, const std::vector<double>& y,
                                   ConsistencyReport& report) {
  report.status = evaluator_.value(t, y.data(), n_, g_.data());
  if (report.status != Status::success) report.message = evaluator_.message();
  return report.status == Status::success;
}

template <class Rows>
Status GaussNewtonOn<Rows>::evaluate_jacobian(double t, const std::vector<double>& y) {
  const Status status = blocks_.evaluate(evaluator_, t, y.data(), WT_.data());
  if (status != Status::success || !blocks_.outgrown()) return status;
  blocks_.rearrange();
  fill_metric();
  return blocks_.evaluate(evaluator_, t, y.data(), WT_.data());
}

template <class Rows>
void GaussNewtonOn<Rows>::fill_metric() {
  for (Block* block : {&blocks_.d, &blocks_.a})
    for (std::size_t k = 0; k < block->columns.size(); ++k)
      block->D()[k] = WT_[static_cast<std::size_t>(block->columns[k])];
}

template <class Rows>
double GaussNewtonOn<Rows>::correction() {
  blocks_.solve(g_);
  double sum = 0.0;
  for (const Block* block : {&blocks_.d, &blocks_.a})
    for (std::size_t k = 0; k < block->columns.size(); ++k) {
      const double move = block->dy[k] / WT_[static_cast<std::size_t>(block->columns[k])];
      if (!block->rows.empty()) sum += move * move;
    }
  return std::sqrt(sum / n_);
}

template <class Rows>
double GaussNewtonOn<Rows>::largest(const std::vector<double>& g) const {
  double value = 0.0;
  for (double x : g) value = std::max(value, std::abs(x));
  return value;
}

// Length of a move that rounding of y alone explains, in tolerances.
template <class Rows>
double GaussNewtonOn<Rows>::floor_of(const std::vector<double>& y) const {
  double size = 0.0;
  for (std::size_t i = 0; i < y.size(); ++i) size += y[i] / WT_[i] * (y[i] / WT_[i]);
  return 64.0 * kEpsilon * std::sqrt(size / n_);
}

// Whether the rounding of its own terms explains every g_i at y, where C was evaluated.
template <class Rows>
bool GaussNewtonOn<Rows>::rounding_only(const std::vector<double>& y) const {
  for (std::size_t i = 0; i < g_.size(); ++i)
    if (!(std::abs(g_[i]) <= 64.0 * kEpsilon * blocks_.terms(static_cast<int>(i), y.data())))
      return false;
  return true;
}

template <class Rows>
void GaussNewtonOn<Rows>::project(double t, std::vector<double>& y0, const std::vector<double>& WT,
                                  const std::vector<bool>& hold, const double* id,
                                  ConsistencyReport& report) {
  WT_ = WT;
  evaluator_.forget();
  std::vector<double> y = y0;
  if (!structured_for(hold, id)) {
    report.status = blocks_.structure(evaluator_, t, y, WT_, hold, id);
    if (report.status != Status::success) {
      report.message = blocks_.message;
      return;
    }
  }
  fill_metric();

  if (!evaluate(t, y, report)) return;
  report.drift_before = report.drift_after = largest(g_);

  double previous = -1.0;
  int halvings_in_a_row = 0;
  std::vector<double> trial(y.size()), dy(y.size());
  for (report.iterations = 0;; ++report.iterations) {
    if (report.iterations == kMaximumIterations) {
      report.status = Status::not_converged;
      break;
    }
    report.status = evaluate_jacobian(t, y);
    if (report.status != Status::success || !blocks_.factor()) {
      report.message = report.status != Status::success
                           ? evaluator_.message()
                           : "the constraint Jacobian C has an entry that is not finite";
      if (report.status == Status::success) report.status = Status::not_finite;
      return;
    }
    const double length = correction();
    report.rank = blocks_.rank();
    const double floor = floor_of(y);
    if (length <= std::max(kConverged, floor)) break;
    // Rounding: small already, and no longer shrinking.
    if (previous >= 0.0 && length <= 1e4 * floor && length > 0.5 * previous) break;
    // Gradients that vanish on the set: the distance halves, |g| falls to a quarter.
    const double rate = previous > 0.0 ? length / previous : 0.0;
    halvings_in_a_row = rate > 0.4 && rate < 0.6 ? halvings_in_a_row + 1 : 0;
    if (halvings_in_a_row >= 4) report.slow_convergence = true;
    previous = length;

    std::fill(dy.begin(), dy.end(), 0.0);
    for (const Block* block : {&blocks_.d, &blocks_.a})
      for (std::size_t k = 0; k < block->columns.size() && !block->rows.empty(); ++k)
        dy[static_cast<std::size_t>(block->columns[k])] = block->dy[k];
    double s = 1.0, left = 0.0;
    bool accepted = false;
    for (; s >= kSmallestDamping && !accepted; s *= 0.5) {
      for (std::size_t i = 0; i < y.size(); ++i) trial[i] = y[i] - s * dy[i];
      ConsistencyReport attempt;
      if (!evaluate(t, trial, attempt)) {
        report.message = attempt.message;
        if (evaluator_.fatal()) {
          report.status = Status::callback_fatal;
          return;
        }
        continue;
      }
      left = correction();
      accepted = left <= (1.0 - 0.5 * s) * length + floor;
    }
    if (!accepted) {
      // Almost dependent rows magnify rounding into moves that lead nowhere.
      if (!evaluate(t, y, report) || !rounding_only(y)) report.status = Status::not_converged;
      break;
    }
    report.message.clear();
    y = trial;
    // Seen with the current factors: others would only confirm it, where no row waits to come back.
    const bool all_seen =
        !blocks_.dropped_rows() ||
        (length <= kNear && blocks_.left_of_dropped(WT_) <= kAside * std::max(kConverged, floor));
    if (all_seen && left <= std::max(kConverged, floor)) {
      ++report.iterations;
      break;
    }
  }

  report.drift_after = largest(g_);
  if (report.status == Status::success && blocks_.dropped_rows() && blocks_.contradict(WT_)) {
    report.status = Status::inconsistent;
    report.message = blocks_.contradiction.message;
    report.contradicting_rows = blocks_.contradiction.rows;
  } else if (report.status == Status::not_converged) {
    if (blocks_.dropped_rows() && blocks_.contradict(WT_)) {
      report.status = Status::inconsistent;
      report.message = blocks_.contradiction.message;
      report.contradicting_rows = blocks_.contradiction.rows;
    } else {
      report.message = "no point on the constraints was found near the given one: |g| is " +
                       brief(report.drift_before) + " there and stalls at " +
                       brief(report.drift_after) +
                       "; the rows may have no common solution, or the start is too far away";
    }
  } else if (report.slow_convergence) {
    report.message =
        "gradients vanish on the constraints: Newton's method only halves the distance, and |g| "
        "says little about it; write the rows without squares";
  }
  if (report.status == Status::success) y0 = y;
}

template <class Rows>
bool GaussNewtonOn<Rows>::tangent(double t, const std::vector<double>& y, double* yp) {
  const double h = std::cbrt(kEpsilon) * std::max(1.0, std::abs(t));
  std::vector<double> plus(g_.size()), minus(g_.size());
  if (evaluator_.value(t + h, y.data(), n_, plus.data()) != Status::success ||
      evaluator_.value(t - h, y.data(), n_, minus.data()) != Status::success ||
      evaluate_jacobian(t, y) != Status::success || !blocks_.factor())
    return false;
  std::vector<double> defect(g_.size());
  for (std::size_t i = 0; i < g_.size(); ++i) {
    // Differences of a g that does not contain t are exactly zero.
    defect[i] = (plus[i] - minus[i]) / (2.0 * h) + blocks_.times(static_cast<int>(i), yp);
  }
  blocks_.solve(defect);
  for (const Block* block : {&blocks_.d, &blocks_.a})
    for (std::size_t k = 0; k < block->columns.size() && !block->rows.empty(); ++k)
      yp[block->columns[k]] -= block->dy[k];
  return true;
}

}  // namespace

std::unique_ptr<GaussNewton> make_gauss_newton(const Constraints& constraints, int size) {
  if (wants_sparse_factors(constraints, size))
    return std::make_unique<GaussNewtonOn<SparseRows>>(constraints, size);
  return std::make_unique<GaussNewtonOn<DenseRows>>(constraints, size);
}

}  // namespace tether::ida_projection

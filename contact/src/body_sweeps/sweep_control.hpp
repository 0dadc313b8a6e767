// Tether: the rules by which sweeps go on or give way. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "graph/contact_graph.hpp"

namespace tether::contact::detail {

// Nesterov's momentum on the sweeps. A sweep is no gradient step, but the same rule serves: where a
// sweep changes more than the one before, the momentum is dropped and its growth set back by half.
// Contacts that toggle between stick and slip cause that again and again. While there is no
// progress, a little more change is allowed in every other window.
class Momentum {
 public:
  // beta, given the sum of squares that the last sweep changed.
  double next(double change) {
    best_ = std::min(best_, change);
    if (++count_ == window_end_) end_window();
    const double grown = 0.5 * (1 + std::sqrt(1 + 4 * t_ * t_));
    double beta = (t_ - 1) / grown;
    if (change > allowed_ * last_) {
      t_ = std::max(1.0, 0.5 * t_);
      beta = 0;
    } else {
      t_ = grown;
    }
    last_ = change;
    return beta;
  }

 private:
  static constexpr double kNone = std::numeric_limits<double>::infinity();

  void end_window() {
    if (best_ > 0.25 * best_before_) {  // of squares: not halved
      allowed_ = allowed_ > 1 ? 1 : 1.2;
      t_ = 1;
      last_ = kNone;
    }
    best_before_ = best_;
    window_ += window_ / 2;
    window_end_ = count_ + window_;
  }

  double t_ = 1, last_ = kNone, allowed_ = 1, best_ = kNone, best_before_ = kNone;
  int count_ = 0, window_ = 100, window_end_ = 100;
};

// Keeps the best point of an island that may never be solved. A test of a point costs a pass. It is
// due where a sweep changes clearly less than at the last test, or that was long ago. It is due
// only where the forecast passes max_sweeps, half of them are used, or changes rise in a long run.
class BestPoint {
 public:
  static constexpr int kFirst = 64;  // sweeps before the first test

  explicit BestPoint(int max_sweeps) : max_sweeps_(max_sweeps) {}
  // residual: of a point that is saved already.
  void want(double residual = std::numeric_limits<double>::infinity()) {
    next_ = kFirst;
    residual_ = residual * residual;
  }
  void forecast(double sweeps) { forecast_ = sweeps; }
  // change: sum of squares that the last sweep changed.
  bool is_due(int sweeps, double change) {
    const bool rises = change > last_ && sweeps >= kLong;
    last_ = change;
    if (sweeps < next_) return false;
    if (!(change < kLess * change_) && sweeps < next_ + kOld) return false;
    if (!rises && forecast_ <= max_sweeps_ && sweeps <= max_sweeps_ / 2) return false;
    change_ = change;
    next_ = sweeps + kApart;
    return true;
  }
  // residual: a sum of squares too. True: the point is to be saved.
  bool improved(double residual) {
    if (!(residual < residual_)) return false;
    residual_ = residual;
    return true;
  }
  // False where the residual of the last point is not a number, unless nothing was saved.
  bool last_is_best(double residual) const { return !(residual_ < kNone) || residual <= residual_; }
  double residual() const { return residual_; }

 private:
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  static constexpr int kApart = 8, kLong = 256, kOld = 120;
  static constexpr double kLess = 0.64;

  int max_sweeps_, next_ = std::numeric_limits<int>::max();  // before want(): never
  double forecast_ = 0, change_ = kNone, last_ = kNone, residual_ = kNone;
};

// Forecasts the sweeps that are still needed, after 5, 10, 20, 40, ... sweeps, from the convergence
// in the last half of them. The least change of a half counts, because single sweeps change more
// where contacts toggle between stick and slip.
class Forecast {
 public:
  static constexpr int kFirst = 5;

  // sweeps: made before, whose least() change was `least`.
  Forecast(int sweeps, double least) : next_(kFirst) {
    if (sweeps == 0) return;
    next_ = 2 * sweeps;
    before_ = earlier_ = least;
  }
  // sum: squares that a sweep has changed.
  void add(double sum) { least_ = std::min(least_, sum); }
  bool due(int sweeps) const { return sweeps == next_; }
  // most: square of the largest change by the last sweep; bound: of it when solved.
  double more(int sweeps, double most, double bound) const {
    return more(earlier_, 0.5 * sweeps, most, bound);
  }
  // When due: the last three quarters of the sweeps forecast more than max_sweeps, or have not
  // halved the squares that a sweep changes. Heaps that are solved may rest for one doubling.
  // Before kLeast sweeps loads may not have reached the ends of a large island.
  bool in_vain(int sweeps, double most, double bound, int max_sweeps) const {
    constexpr int kLeast = 1000;
    return sweeps > kLeast && (least_ > 0.5 * before_ ||
                               sweeps + more(before_, 0.75 * sweeps, most, bound) > max_sweeps);
  }
  void made() {
    before_ = earlier_;
    earlier_ = least_;
    least_ = kNone;
    next_ *= 2;
  }
  // Squares, by the least of the last half of the sweeps, or more.
  double least() const { return std::min(least_, earlier_); }
  // Those sweeps change as much as those before.
  bool no_progress() const { return least() > 0.998 * before_; }

 private:
  static constexpr double kNone = std::numeric_limits<double>::infinity();

  // since: the least change `sweeps` ago
  double more(double since, double sweeps, double most, double bound) const {
    const bool known = least_ > 0 && since > 0 && most > 0 && bound > 0 && std::isfinite(since);
    const double rate = known ? (std::log(least_) - std::log(since)) / sweeps : 0;
    return !known ? 0 : rate < 0 ? (std::log(bound) - std::log(most)) / rate : kNone;
  }

  double before_ = kNone, earlier_ = kNone, least_ = kNone;
  int next_;
};

// Predicted from the graph of an island alone, in the unit of Options::max_work. The order and the
// fill of a factorisation are looked for once, where they are asked for: that takes as long as one
// to three sweeps, and allocates.
class AssemblyPrice {
 public:
  // first, second: moving bodies of each contact, as ContactGraph::build has them.
  AssemblyPrice(const ContactGraph& graph, const Island& island, const std::vector<int>& first,
                const std::vector<int>& second);

  // Cost of a sweep over the bodies.
  double sweep() const { return sweep_; }
  // Cost of a solution by few factorisations, in sweeps over the bodies.
  double sweeps();
  // Whether `work` suffices for the stages of Solver to get anywhere.
  bool within(double work);

 private:
  double factorisation();

  const ContactGraph& graph_;
  const Island& island_;
  const std::vector<int>&first_, &second_;
  double sweep_ = 0, blocks_ = 0, factorisation_ = -1;
};

}  // namespace tether::contact::detail

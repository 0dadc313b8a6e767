// Tether: Gauss-Seidel sweeps with safeguarded Anderson acceleration. SPDX-License-Identifier:
// BSD-3-Clause
#include "assembled/stages/accelerated_sweeps.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::contact::detail {

void AcceleratedSweeps::reset(int contacts) {
  n_ = contacts;
  x_.resize(at(n_));
  g_.resize(at(n_));
  f_.resize(at(n_));
  regime_.assign(at(n_), -1);
  before_.resize(at(n_));
  anderson_.reset(n_, kDepth);
}

void AcceleratedSweeps::start(const PackedVector* x) {
  std::copy(x, x + n_, x_.begin());
  anderson_.clear();
  grown_ = 1;
  sweeps_ = quiet_ = slow_ = 0;
  quiet_checked_ = kLeastQuiet;
  mode_ = carried() ? Mode::waits : Mode::eager;
  earlier_ = {};
  later_ = {kRecent / 2, 0};
}

// The new point makes the measured rate obsolete; the next test remains due when it was.
void AcceleratedSweeps::replace(const PackedVector* x) {
  std::copy(x, x + n_, x_.begin());
  grown_ = 1;
  anderson_.clear();
  slow_ = 0;
  if (mode_ == Mode::eager) mode_ = Mode::helps;
  least_f_ = window_f_ = std::numeric_limits<double>::infinity();
  earlier_ = {};
  later_ = {sweeps_, 0};
}

// The number of contacts whose regime (0 separated, 1 sticking, 2 sliding) differs from that of the
// last sweep.
int AcceleratedSweeps::toggles(const System& system) {
  int count = 0;
  for (int i = 0; i < n_; ++i) {
    const double* g = g_[at(i)].v;
    const double reach = system.problem().locals()[at(i)].mu * g[0];
    const bool inside = g[1] * g[1] + g[2] * g[2] < reach * reach * (1 - 1e-10);
    const char regime = !(g[0] > 0) ? 0 : inside ? 1 : 2;
    count += regime != regime_[at(i)];
    regime_[at(i)] = regime;
  }
  return count;
}

// Extrapolation helps once regimes have settled. Across a change of regime it undoes progress, and
// it keeps toggling contacts toggling. So it begins after some quiet sweeps, in which few regimes
// change, and ends with them. Each failure doubles the number of quiet sweeps required; a reduction
// of |f| to a tenth resets it.
bool AcceleratedSweeps::extrapolates(int sweep, double f, int toggled) {
  const bool calm = toggled <= std::max(kToggles, static_cast<int>(kToggledShare * n_));
  quiet_ = calm ? quiet_ + 1 : 0;
  if (mode_ == Mode::eager && sweep < kWindow) {
    if (sweep == 1) {
      least_f_ = begun_f_ = f;
      window_end_ = kWindow;
    }
    if (f > 2 * least_f_) {
      anderson_.clear();
      least_f_ = f;
      return false;
    }
    least_f_ = std::min(least_f_, f);
    return true;
  }
  if (mode_ == Mode::eager) {
    window_f_ = std::numeric_limits<double>::infinity();
    mode_ = Mode::helps;
  }
  if (mode_ == Mode::waits) {
    if (quiet_ < (carried() ? std::max(2 * kWindow, quiet_checked_) : quiet_checked_)) return false;
    mode_ = Mode::helps;
    anderson_.clear();
    least_f_ = begun_f_ = window_f_ = f;
    window_end_ = sweep + kWindow;
    return true;
  }
  bool failed = !calm || f > 2 * least_f_;
  if (!failed && sweep >= window_end_) {
    failed = f > 0.7 * window_f_;
    window_f_ = f;
    window_end_ = sweep + kWindow;
  }
  if (failed) {
    mode_ = Mode::waits;
    quiet_ = 0;
    quiet_checked_ = std::min(2 * quiet_checked_, kMostQuiet);
    return false;
  }
  if (f < 0.1 * begun_f_) {
    begun_f_ = f;
    quiet_checked_ = kLeastQuiet;
  }
  least_f_ = std::min(least_f_, f);
  return true;
}

// Forecasts the sweeps to the tolerance from the rate of |f|, over the last ten sweeps or over the
// last half to three quarters of all; the better one counts. While contacts toggle the former is
// noise; just after they have settled the latter is out of date.
double AcceleratedSweeps::forecast(int sweep, double f, double log_gain) const {
  const double most = std::numeric_limits<double>::infinity();
  if (sweep <= kRecent) return 0;
  const auto left = [&](double earlier, int sweeps) {
    const double rate = f > 0 && earlier > 0 ? std::log(f / earlier) / sweeps : 0;
    return rate < std::log(0.995) || (sweeps > 200 && rate < -1e-4) ? log_gain / rate : most;
  };
  const double recently = left(recent_[sweep % kRecent], kRecent);
  return earlier_.sweep > 0 ? std::min(recently, left(earlier_.f, sweep - earlier_.sweep))
                            : recently;
}

// x = g + beta (g - the g before), with Nesterov's beta, dropped where the change of a sweep rises:
// it forgets a passage of contacts from one regime to another by itself. While they still pass it
// needs a third to a half of the sweeps.
void AcceleratedSweeps::carry_on(Search& search, double f) {
  double beta = 0;
  if (grown_ > 1 && f > last_f_) {
    grown_ = 1;
  } else {
    const double next = 0.5 * (1 + std::sqrt(1 + 4 * grown_ * grown_));
    beta = (grown_ - 1) / next;
    grown_ = next;
  }
  last_f_ = f;
  search.counts.work += kMomentumCost * n_;
  for (int i = 0; i < n_; ++i) {
    const double *g = g_[at(i)].v, *before = before_[at(i)].v;
    double* x = x_[at(i)].v;
    for (int c = 0; c < 3; ++c) x[c] = beta > 0 ? g[c] + beta * (g[c] - before[c]) : g[c];
    if (beta > 0) clip_cone(search.system.problem().locals()[at(i)].mu, x);
  }
  before_.swap(g_);
}

void AcceleratedSweeps::run(Search& search, const Leave& leave) {
  System& system = search.system;
  const double accelerated_cost = 0.8 * 4 * n_ * kDepth;
  const double begin = search.counts.work;
  // A test costs more than a sweep: it may be late by one.
  constexpr double kForeseen = 1.05;
  double last_error = 0, last_f = 0;
  int next_test = sweeps_ + 1;
  for (;;) {
    const int sweep = ++sweeps_;
    std::copy(x_.begin(), x_.end(), g_.begin());
    system.sweep(g_.data());
    search.count_sweep();
    double f2 = 0;
    for (int i = 0; i < n_; ++i) {
      const double weight = system.weight(i);
      for (int c = 0; c < 3; ++c) {
        const double f = weight * (g_[at(i)].v[c] - x_[at(i)].v[c]);
        f_[at(i)].v[c] = f;
        f2 += f * f;
      }
    }
    const double f = std::sqrt(f2);
    if (sweep >= next_test || last_error * f < kForeseen * search.options.tolerance * last_f) {
      last_error = search.test(g_.data(), By::sweeps);
      last_f = f;
      if (search.solved()) return;
      next_test = std::max(next_test, sweep + 1 + sweep / 8);
    }
    if (search.exhausted()) return;
    if (leave.most_work > 0 && search.counts.work - begin >= leave.most_work) return;
    if (search.counts.work - begin >= leave.least_work) {
      const double left = forecast(sweep, f, std::log(search.options.tolerance / last_error));
      // Work already spent counts: the more was spent, the shorter a forecast has to be.
      const double allowed =
          std::max(0.1 * leave.price, leave.price - (search.counts.work - begin));
      const bool slow = left * (search.sweep_cost + accelerated_cost) > allowed;
      slow_ = slow ? slow_ + 1 : 0;
      // Forecasts scatter: only a row of slow ones counts.
      if (slow_ > std::min(sweep / 8, kPersuaded)) return;
    }
    recent_[sweep % kRecent] = f;
    if (sweep >= 2 * later_.sweep) {
      earlier_ = later_;
      later_ = {sweep, f};
    }
    if (!extrapolates(sweep, f, toggles(system))) {
      if (carried())
        carry_on(search, f);
      else
        std::copy(g_.begin(), g_.end(), x_.begin());
      continue;
    }
    grown_ = 1;
    search.counts.work += accelerated_cost;
    anderson_.step(g_.data(), f_.data(), x_.data());
    for (int i = 0; i < n_; ++i) clip_cone(system.problem().locals()[at(i)].mu, x_[at(i)].v);
  }
}

}  // namespace tether::contact::detail

// Tether: interior points for the exact cones. SPDX-License-Identifier: BSD-3-Clause

#include "assembled/stages/interior/interior_point.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::contact::detail {
namespace {

constexpr double kLeastCentre = 1e-3, kCentreAfterBlocked = 0.2;

}  // namespace

void InteriorPoint::reset(const System& system) {
  n_ = system.size();
  equations_.reset(system);
  newton_.reset(n_);
  sticking_.reset(n_);
  point_.resize(n_);
  swept_.resize(at(n_));
}

void InteriorPoint::stick(Search& search) {
  newton_.matrix().order(search);
  sticking_.find(search, newton_.matrix(), equations_.flat());
}

double InteriorPoint::size_over_sticking(Search& search, const PackedVector* x) {
  stick(search);
  if (!sticking_.found() || !(sticking_.size() > 0)) return 0;
  double size = 0;
  for (int i = 0; i < n_; ++i)
    size += std::abs(search.system.friction(i) * x[i].v[0]) + std::hypot(x[i].v[1], x[i].v[2]);
  return size / sticking_.size();
}

// The point where everything sticks, shifted into the cone; false if it is the solution or cannot
// be found.
bool InteriorPoint::start(Search& search) {
  const System& system = search.system;
  const double speed = system.norm_b() / std::sqrt(n_);
  if (!(speed > 0)) return false;
  stick(search);
  if (search.solved() || !sticking_.found()) return false;
  point_.x = sticking_.point();
  for (int i = 0; i < n_; ++i) {
    double* x = point_.x[at(i)].v;
    double* u = point_.u[at(i)].v;
    x[0] += sticking_.outside() +
            0.1 * std::max(sticking_.size() / n_, speed / mean_diagonal(system.problem().local(i)));
    x[3] = x[0] - tangent(x);
    u[0] = u[3] = speed;
    u[1] = u[2] = 0;
  }
  equations_.evaluate(search, point_);
  return true;
}

// x and the u that belongs to its velocity, both kept off the cone as far as x.u = nu asks for,
// nu = near * (mean size of x) * (mean size of u).
bool InteriorPoint::start_near(Search& search, const PackedVector* start, double near, double tau) {
  System& system = search.system;
  const Problem& p = system.problem();
  velocities(p, false, start, swept_.data());
  double x_size = 0, u_size = 0;
  for (int i = 0; i < n_; ++i) {
    const double mu = p.local(i).mu;
    const double* w = swept_[at(i)].v;
    double* x = point_.x[at(i)].v;
    double* u = point_.u[at(i)].v;
    if (equations_.flat(i)) {
      x[0] = std::max(start[i].v[0], 0.0);
      u[0] = std::max(w[0], 0.0);
      x[1] = x[2] = u[1] = u[2] = 0;
    } else {
      x[0] = mu * start[i].v[0];
      for (int c = 1; c < 3; ++c) x[c] = start[i].v[c];
      double gamma[2];
      system.gamma(i, gamma);
      const double s = slip(w[1], w[2], gamma[0], gamma[1]);
      for (int c = 1; c < 3; ++c) u[c] = w[c] + s * gamma[c - 1];
      // u_n - s(u) = w_n / mu
      const double v = std::max(w[0], 0.0) / mu, q = 1 - kSmooth, uu = u[1] * u[1] + u[2] * u[2];
      u[0] = (v + std::sqrt(std::max(0.0, v * v - q * (v * v - q * uu)))) / q;
    }
    x[3] = std::max(0.0, x[0] - tangent(x));
    u[3] = std::max(0.0, u[0] - tangent(u));
    x_size += tangent(x) + x[3];
    u_size += tangent(u) + u[3];
  }
  if (!(x_size > 0 && u_size > 0)) return false;
  const double nu = near * (x_size / n_) * (u_size / n_), ratio = u_size / x_size;
  for (int i = 0; i < n_; ++i) {
    double* x = point_.x[at(i)].v;
    double* u = point_.u[at(i)].v;
    const double x0 = x[3] + tangent(x), u0 = u[3] + tangent(u);
    x[3] = std::max(x[3], nu / (u0 + std::sqrt(nu * ratio)));
    u[3] = std::max(u[3], nu / (x0 + std::sqrt(nu / ratio)));
    x[0] = x[3] + tangent(x);
    u[0] = u[3] + tangent(u);
  }
  equations_.set_tau(tau);
  equations_.evaluate(search, point_);
  return true;
}

// Predictor and corrector (Mehrotra) at the point whose matrix is factored; last: the length that
// the step before could have had. The one that this step can have.
double InteriorPoint::aim(const System& system, double mean, double last) {
  newton_.direction(system, equations_, 0, false);
  const double affine = std::min(1.0, newton_.longest_step(equations_));
  newton_.keep_predictor();
  // A blocked step leaves products x.u of different size behind.
  const double centre = last < 0.5 ? kCentreAfterBlocked : kLeastCentre;
  const double nu = std::max(centre, std::pow(1 - affine, 3)) * mean;
  newton_.direction(system, equations_, nu, true);
  return newton_.longest_step(equations_);
}

// The impulses of the last evaluation, and what a sweep makes of them.
double InteriorPoint::test_point(Search& search) {
  const double error = search.test(equations_.impulses().data(), By::factors);
  swept_ = equations_.impulses();
  search.system.sweep(swept_.data());
  search.count_sweep();
  return std::min(error, search.test(swept_.data(), By::factors));
}

double InteriorPoint::follow(Search& search, int most, double target) {
  System& system = search.system;
  const double speed = system.norm_b() / std::sqrt(n_);
  double least = std::numeric_limits<double>::infinity(), least_mean = least, last = 1;
  int idle = 0;
  newton_.reset_shift();
  for (int iteration = 0; iteration < most; ++iteration) {
    const double mean = equations_.complementarity(point_);
    if (!newton_.factor(search, equations_, point_)) break;
    const double longest = last = aim(system, mean, last);
    if (!(longest > 1e-8)) break;
    newton_.adapt_shift(longest);
    // Close to the cone only with nearly full steps: blocked ones would spoil the centring.
    const double fraction = longest > 0.9 ? std::max(0.9, 1 - mean / (speed * speed)) : 0.8;
    advance(point_, newton_.change(), std::min(1.0, fraction * longest));
    equations_.evaluate(search, point_);
    double error;
    if (equations_.tau() > 0) {
      error = equations_.natural_map(system);
      if (error <= target) return error;
    } else {
      error = test_point(search);
      if (search.solved()) return error;
    }
    if (search.exhausted()) return error;
    if (error < 0.9 * least || mean < 0.8 * least_mean) {
      least = std::min(least, error);
      least_mean = std::min(least_mean, mean);
      idle = 0;
    } else if (++idle >= 6) {
      break;
    }
  }
  return least;
}

void InteriorPoint::run(Search& search, int most) {
  equations_.set_tau(0);
  if (start(search)) follow(search, most, 0);
}

// Implicit Euler steps 1 / tau of D x' = -F(x): where the contacts that stick and slide admit no
// solution, x drifts at a constant rate until one of them changes (method, section 6).
void InteriorPoint::run_proximal(Search& search, const PackedVector* x, int most,
                                 ProximalNewton& newton, bool whole) {
  constexpr int kCorrections = 4, kSteps = 20, kSweeps = 3;
  constexpr double kFirst = 1e-2, kLeast = 1e-9, kMost = 1;  // tau, for ordinary loads
  constexpr double kLightest = 1e6, kNear = 1e-4;
  System& system = search.system;
  Packed rate(at(n_)), point(at(n_));  // rate: tau (x_k+1 - x_k)
  equations_.set_anchor(x);
  const Packed& anchor = equations_.anchor();
  // Impulses that carry heavy bodies over light ones are |A| |x| times what moves; for x to change
  // by its size at the rate of what is left tau has to be as much smaller.
  const double lighter = std::min(kLightest, std::max(1.0, system.load(x) / kOrdinaryLoad));
  const double least = kLeast / lighter;
  double tau = kFirst / lighter;
  bool drifting = false;
  for (int outer = 0; outer < most; ++outer) {
    int corrections = 0;
    if (drifting) {
      entries(point) = entries(anchor) + entries(rate) / tau;
      corrections = newton.correct(search, tau, anchor.data(), point, kCorrections);
    }
    bool found = corrections > 0;
    if (!found) {
      // Half the natural map of the problem itself at the anchor is enough: with more accuracy the
      // iteration is no better, with more steps each.
      equations_.set_tau(0);
      const double before = equations_.natural_map(search, anchor.data());
      if (!start_near(search, anchor.data(), kNear, tau)) break;
      found = follow(search, kSteps, 0.5 * before) <= 0.8 * before;
      equations_.set_tau(0);
      search.test(equations_.impulses().data(), By::factors);
      if (search.solved()) break;
      if (found) point = equations_.impulses();
    }
    if (search.exhausted() || (!found && !whole)) break;
    if (!found) {
      tau = std::min(kMost, 3 * tau);
      continue;
    }
    entries(rate) = tau * (entries(point) - entries(anchor));
    drifting = true;
    equations_.set_anchor(point.data());
    search.test(anchor.data(), By::factors);
    // Sweeps remove errors of single contacts.
    swept_ = anchor;
    for (int k = 0; k < kSweeps && !search.solved(); ++k) {
      system.sweep(swept_.data());
      search.count_sweep();
    }
    if (!search.solved()) search.test(swept_.data(), By::factors);
    if (search.solved()) break;
    tau = std::max(least, (corrections == 1 ? 0.4 : 0.5) * tau);
  }
  equations_.set_tau(0);
}

}  // namespace tether::contact::detail

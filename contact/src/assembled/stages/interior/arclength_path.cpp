// Tether: the path of interior points by its arclength. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <vector>

#include "assembled/stages/interior/interior_point.hpp"

namespace tether::contact::detail {
namespace {

double inner(const ConePair& a, const ConePair& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.x.size(); ++i)
    for (int c = 0; c < 3; ++c) sum += a.x[i].v[c] * b.x[i].v[c] + a.u[i].v[c] * b.u[i].v[c];
  return sum;
}

// to = factor to + other_factor other
void combine(ConePair& to, double factor, double other_factor, const ConePair& other) {
  for (auto [p, q] : {std::pair(&to.x, &other.x), std::pair(&to.u, &other.u)})
    for (std::size_t i = 0; i < p->size(); ++i)
      for (int c = 0; c < 3; ++c)
        (*p)[i].v[c] = factor * (*p)[i].v[c] + other_factor * (*q)[i].v[c];
}

}  // namespace

// The solutions of x o u = nu e, A x - b = w(u), nu > 0, are a smooth curve that comes from
// nu = infinity. Where contacts that stick and slide admit no solution nearby it turns: nu grows
// for a while, Newton's matrix is singular at the turn, and steps towards smaller nu are blocked.
// By its arclength nothing happens there (README, section 9).
struct InteriorPoint::ArclengthPath {
  ArclengthPath(InteriorPoint& of, Search& s) : own(of), search(s) {
    for (ConePair* p : {&newton, &rate, &metric, &tangent.direction}) p->resize(of.n_);
  }

  // Changes of a contact count by their parts of its own x and u (the metric of the scaling), those
  // of nu by its logarithm: at a turn one contact moves and nu does not.
  struct Tangent {
    ConePair direction;
    double log_nu = 0;
  };
  // A point near the curve, with its tangent and the step that was tried from there, in parts of
  // the way to the cones.
  struct Place {
    ConePair point;
    Tangent tangent;
    double step;
  };

  InteriorPoint& own;
  Search& search;
  double step = 0.5;
  ConePair newton, rate, metric;  // rate: d / d log nu
  Tangent tangent;
  std::vector<Place> places;  // the last ones
  int returns = 0;

  // Newton's direction to the curve at the present mean x.u, and the curve's rate.
  bool directions() {
    const System& system = search.system;
    const double nu = own.equations_.complementarity(own.point_);
    if (!(nu > 0) || !own.newton_.factor(search, own.equations_, own.point_)) return false;
    own.newton_.direction(system, own.equations_, nu, false);
    newton = own.newton_.change();
    own.newton_.direction(system, own.equations_, 2 * nu, false);
    rate = own.newton_.change();
    combine(rate, 1, -1, newton);
    own.newton_.metric(rate, metric);
    // Along the curve det F_y d nu / ds keeps its sign, F(y, nu) = 0 being its equations.
    const double forward = own.newton_.matrix().determinant_sign() > 0 ? -1 : 1;
    const double unit = forward / std::sqrt(inner(metric, rate) / nu + 1);
    if (!std::isfinite(unit)) return false;
    tangent.direction = rate;
    combine(tangent.direction, unit, 0, rate);
    tangent.log_nu = unit;
    // Across the tangent: Newton's direction with another nu.
    const double across = inner(metric, rate) * unit / nu + unit;
    combine(newton, 1, -inner(metric, newton) * unit / nu / across, rate);
    return true;
  }

  void go_along(const Tangent& along) {
    constexpr double kMostFall = 0.98, kMostRise = 2;
    double length = step * own.equations_.longest_step(own.point_, along.direction);
    if (along.log_nu < 0) length = std::min(length, kMostFall / -along.log_nu);
    if (along.log_nu > 0) length = std::min(length, kMostRise / along.log_nu);
    advance(own.point_, along.direction, length);
    own.evaluate_with_digits(search);
  }

  // A shorter step from the last place, or from the one before; false: none is left.
  bool go_back() {
    constexpr double kShorter = 0.25, kMuchShorter = 0.1, kLeast = 1e-3, kFinish = 0.05;
    constexpr int kReturns = 20;
    if (places.empty()) return false;
    step *= kShorter;
    if (step < kFinish && search.best_error < kNearby) return false;  // Newton's method takes over
    if (step < kLeast) {
      if (places.size() < 2 || ++returns > kReturns) return false;
      places.pop_back();
      step = kMuchShorter * places.back().step;
    }
    own.point_ = places.back().point;
    go_along(places.back().tangent);
    return true;
  }

  // To the curve and on along it; false: it is lost.
  bool go_on() {
    // A direction that could be followed for so long is taken, and is the last one where it could
    // be for longer. The next one may not be much shorter.
    constexpr double kTaken = 1.2, kLast = 4, kFewer = 0.7, kInside = 0.9, kMore = 1.7;
    constexpr int kMost = 6;
    constexpr std::size_t kPlaces = 5;
    double before = 0;
    for (int iteration = 1; !search.exhausted(); ++iteration) {
      double longest = 0;
      if (directions()) longest = own.equations_.longest_step(own.point_, newton);
      const bool near = longest >= kLast || (places.empty() && longest >= kTaken);
      if (!near && (longest < std::max(kTaken, kFewer * before) || iteration > kMost)) {
        if (!go_back()) return false;
        iteration = 0;
        before = 0;
        continue;
      }
      before = longest;
      advance(own.point_, newton, std::min(1.0, kInside * longest));
      if (!near) {
        own.evaluate_with_digits(search);
        continue;
      }
      if (iteration <= 2) step = std::min(kInside, kMore * step);
      if (iteration >= 4) step *= kFewer;
      if (places.size() == kPlaces) places.erase(places.begin());
      places.push_back({own.point_, tangent, step});
      go_along(tangent);
      return true;
    }
    return false;
  }

  static constexpr double kNearby = 1e-5;
};

// Close to the end of a path round-off of A x - b would hide what is left of the residual.
void InteriorPoint::evaluate_with_digits(Search& search) {
  constexpr double kLate = 1e-4;
  equations_.set_exact(search.best_error < kLate);
  equations_.evaluate(search.system, point_);
}

void InteriorPoint::run_arclength(Search& search, int most, ProximalNewton& newton) {
  constexpr double kTry = 1e-4, kGain = 0.1;
  constexpr int kFirstProblems = 3, kLastProblems = 30, kLastSteps = 20;
  const int end = search.counts.factorisations + most;
  equations_.set_tau(0);
  newton_.set_shift(0);
  if (!start(search)) return;
  bool on_path = false;
  for (double nu = equations_.complementarity(point_); !on_path && !search.exhausted(); nu *= 10) {
    on_path = centre(search, nu);
    if (!std::isfinite(nu)) return;
  }
  ArclengthPath path(*this, search);
  for (double tried = kTry; path.go_on() && search.counts.factorisations < end;) {
    const double error = test_point(search);
    if (search.solved() || search.exhausted()) return;
    if (!(error < kTry && search.best_error < kGain * tried)) continue;
    tried = search.best_error;
    newton.run(search, search.best.data(), kFirstProblems);
    if (search.solved()) return;
  }
  if (path.places.empty() || search.exhausted()) return;
  point_ = path.places.back().point;
  evaluate_with_digits(search);
  follow(search, kLastSteps, 0);
  if (!search.solved()) newton.run(search, search.best.data(), kLastProblems);
}

}  // namespace tether::contact::detail

// Tether: the path of interior points by its arclength. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "assembled/stages/interior/interior_point.hpp"
#include "assembled/stages/interior/smoothed_pairs.hpp"

namespace tether::contact::detail {
namespace {

// to += factor other
void add(Packed& to, double factor, const Packed& other) {
  for (std::size_t i = 0; i < to.size(); ++i)
    for (int c = 0; c < 3; ++c) to[i].v[c] += factor * other[i].v[c];
}

}  // namespace

// The solutions of x o u = nu e, A x - b = w(u), nu > 0, are a smooth curve that comes from
// nu = infinity. Where contacts that stick and slide admit no solution nearby it turns: nu grows
// for a while, Newton's matrix is singular at the turn, and steps towards smaller nu are blocked.
// By its arclength in z and log nu nothing happens there (method, section 6).
struct InteriorPoint::ArclengthPath {
  ArclengthPath(InteriorPoint& of, Search& s) : own(of), search(s), pairs(s.system, of.equations_) {
    newton.resize(at(of.n_));
    rate.resize(at(of.n_));
  }

  struct Tangent {
    Packed z;
    double log_nu = 0;
  };
  // A point near the curve, with its tangent.
  struct Point {
    SmoothedPairs::Place place;
    Tangent tangent;
  };

  InteriorPoint& own;
  Search& search;
  SmoothedPairs pairs;
  double step = 0.5;    // in parts of what changes the first contact's regime
  Packed newton, rate;  // to the curve, with newton_log_nu; d / d log nu along it
  double newton_log_nu = 0;
  Tangent tangent;
  Point last;

  void evaluate() {
    pairs.set(own.point_);
    own.equations_.evaluate(search.system, own.point_);
  }

  // Newton's direction to the curve, at the present nu or across the tangent, and the tangent.
  bool directions(bool across) {
    const System& system = search.system;
    const double nu = pairs.nu();
    if (!own.newton_.factor(search, own.equations_, own.point_)) return false;
    own.newton_.plain_direction(system, own.equations_, nu);
    pairs.change_of(own.newton_.change(), newton);
    own.newton_.plain_direction(system, own.equations_, 2 * nu);
    pairs.change_of(own.newton_.change(), rate);
    add(rate, -1, newton);
    const double square = pairs.inner(rate, rate) + 1;
    // Along the curve det F_y d nu / ds keeps its sign, F(y, nu) = 0 being its equations.
    const double forward = own.newton_.matrix().determinant_sign() > 0 ? -1 : 1;
    tangent.log_nu = forward / std::sqrt(square);
    if (!std::isfinite(tangent.log_nu)) return false;
    tangent.z.assign(rate.size(), PackedVector());
    add(tangent.z, tangent.log_nu, rate);
    newton_log_nu = across ? -pairs.inner(rate, newton) / square : 0;
    add(newton, newton_log_nu, rate);
    return true;
  }

  // How many times Newton's direction could be followed.
  double reach() const {
    constexpr double kLogNu = 3;
    return 1 / std::max(pairs.largest(newton), std::abs(newton_log_nu) / kLogNu);
  }

  void go_along(const Tangent& along) {
    constexpr double kMostFall = 4.6, kMostRise = 2;  // of log nu
    double length = step / pairs.largest(along.z);
    if (along.log_nu < 0) length = std::min(length, kMostFall / -along.log_nu);
    if (along.log_nu > 0) length = std::min(length, kMostRise / along.log_nu);
    pairs.move(along.z, length, length * along.log_nu);
    evaluate();
  }

  // A shorter step from the last point; false: none is left.
  bool go_back() {
    constexpr double kShorter = 0.25, kLeast = 1e-3;
    step *= kShorter;
    if (step < kLeast) return false;
    pairs.go_to(last.place);
    go_along(last.tangent);
    return true;
  }

  // The first point: Newton's method at constant nu.
  bool begin(double nu) {
    constexpr double kLeast = 1e-3;
    constexpr int kMost = 40;
    pairs.take(own.point_, nu);
    evaluate();
    for (int iteration = 0; iteration < kMost && !search.exhausted(); ++iteration) {
      if (!directions(false)) return false;
      const double longest = reach();
      if (!(longest >= kLeast)) return false;
      pairs.move(newton, std::min(1.0, kInside * longest), 0);
      evaluate();
      if (longest >= kLast) {
        last = {pairs.place(), tangent};
        return true;
      }
    }
    return false;
  }

  // Along the curve and back to it; false: it is lost.
  bool go_on() {
    // A direction that could be followed for so long is taken, and is the last one where it could
    // be for longer. The next one may not be much shorter.
    constexpr double kTaken = 1, kFewer = 0.7, kMore = 1.7, kLongest = 1;
    constexpr int kMost = 6, kMany = 3;
    go_along(tangent);
    double before = 0;
    for (int iteration = 1; !search.exhausted(); ++iteration) {
      const double longest = directions(true) ? reach() : 0;
      const bool near = longest >= kLast;
      if (!near && (!(longest >= std::max(kTaken, kFewer * before)) || iteration > kMost)) {
        if (!go_back()) return false;
        iteration = 0;
        before = 0;
        continue;
      }
      before = longest;
      const double length = std::min(1.0, kInside * longest);
      pairs.move(newton, length, length * newton_log_nu);
      evaluate();
      if (!near) continue;
      if (iteration == 1) step = std::min(kLongest, kMore * step);
      if (iteration >= kMany) step *= kFewer;
      last = {pairs.place(), tangent};
      return true;
    }
    return false;
  }

  static constexpr double kLast = 4, kInside = 0.9;
};

void InteriorPoint::run_arclength(Search& search, int most, ProximalNewton& newton) {
  // The shift, relative to A, keeps digits where contacts stick: there 1 / W^2 = x / u grows
  // without bound, and takes those of the bodies that slide.
  constexpr double kShift = 1e-11, kNear = 1, kFar = 1e5, kFarther = 100;
  constexpr double kTested = 1e-5, kEnd = 1e-24;  // of the first nu
  constexpr double kTry = 1e-6, kGain = 0.1;
  constexpr int kFirstProblems = 3, kLastProblems = 30;
  const int end = search.counts.factorisations + most;
  equations_.set_tau(0);
  equations_.set_exact(false);
  newton_.set_shift(kShift);
  ArclengthPath path(*this, search);
  double first = 0;
  bool on_path = false;
  for (double near = kNear; !on_path && near <= kFar && !search.exhausted(); near *= kFarther) {
    if (!start_near(search, search.best.data(), near)) return;
    first = equations_.complementarity(point_);
    on_path = path.begin(first);
  }
  const bool begun = on_path;
  for (double tried = kTry; on_path; on_path = path.go_on()) {
    if (search.exhausted() || search.counts.factorisations > end) break;
    if (path.pairs.nu() > kTested * first) continue;
    const double error = test_point(search);
    if (search.solved() || search.exhausted()) return;
    if (path.pairs.nu() < kEnd * first) break;
    if (!(error < kTry && search.best_error < kGain * tried)) continue;
    tried = search.best_error;
    newton.run(search, search.best.data(), kFirstProblems);
    if (search.solved()) return;
  }
  if (begun && !search.exhausted()) newton.run(search, search.best.data(), kLastProblems);
}

}  // namespace tether::contact::detail

// Tether: the path of interior points by its arclength. SPDX-License-Identifier: BSD-3-Clause

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tether/linalg/cone_scaling.hpp>
#include <vector>

#include "assembled/stages/interior/interior_point.hpp"
#include "assembled/stages/interior/newton_step.hpp"

namespace tether::contact::detail {

/// x and u with x o u = nu e exactly, from any z = x - rho u: x is the smoothed part of z in the
/// cone and rho u that of -z, eigenvalue by eigenvalue (l + sqrt(l^2 + 4 rho nu)) / 2. A step in z
/// meets no cone: where a contact slides, sticks or is open x and u follow z almost linearly
/// however small nu is, and z_t turns both (method, eq. 25).
class SmoothedPairs {
 public:
  struct Place {
    Packed z;
    double log_nu = 0;
  };

  SmoothedPairs(const System& system, const InteriorEquations& equations);

  /// Takes z from a pair.
  void take(const ConePair& pair, double nu);
  void set(ConePair& pair) const;
  double nu() const { return std::exp(at_.log_nu); }
  const Place& place() const { return at_; }
  void go_to(const Place& place) { at_ = place; }
  void move(const Packed& change, double length, double log_nu);

  /// dz of a change of x and u.
  void change_of(const ConePair& pair, Packed& out) const;
  /// Changes count by their parts of what they change: each eigenvalue by its distance from the
  /// kink between regimes, the direction of z_t by its angle.
  double inner(const Packed& a, const Packed& b) const;
  double largest(const Packed& change) const;

 private:
  std::array<double, 3> parts(int i, const double* change) const;

  const InteriorEquations& equations_;
  std::vector<double> rho_;
  Place at_;
};

namespace {

// (l + sqrt(l^2 + 4 q)) / 2 without cancellation
double positive_part(double l, double q) {
  const double root = std::sqrt(l * l + 4 * q);
  return l > 0 ? 0.5 * (l + root) : 2 * q / (root - l);
}

// z in the frame of its eigenvalues; any direction where z_t = 0.
struct Spectrum {
  explicit Spectrum(const double* z) : length(tangent(z)) {
    if (length > 0) {
      t[0] = z[1] / length;
      t[1] = z[2] / length;
    }
    above = z[0] + length;
    below = z[0] - length;
  }
  double length, above, below;
  double t[2] = {1, 0};
};

void set_cone(double* x, double gap, double length, const double* direction) {
  x[1] = length * direction[0];
  x[2] = length * direction[1];
  x[3] = gap;
  x[0] = tangent(x) + gap;
}

void set_flat(double* x, double value) {
  x[0] = x[3] = value;
  x[1] = x[2] = 0;
}

}  // namespace

SmoothedPairs::SmoothedPairs(const System& system, const InteriorEquations& equations)
    : equations_(equations), rho_(at(system.size())) {
  at_.z.resize(rho_.size());
  for (int i = 0; i < system.size(); ++i)
    rho_[at(i)] = 1 / mean_diagonal(system.problem().local(i));
}

void SmoothedPairs::take(const ConePair& pair, double nu) {
  change_of(pair, at_.z);
  at_.log_nu = std::log(nu);
}

void SmoothedPairs::set(ConePair& pair) const {
  for (std::size_t i = 0; i < rho_.size(); ++i) {
    const double rho = rho_[i], q = rho * nu();
    double *x = pair.x[i].v, *u = pair.u[i].v;
    if (equations_.flat(static_cast<int>(i))) {
      const double z = at_.z[i].v[0];
      set_flat(x, positive_part(z, q));
      set_flat(u, positive_part(-z, q) / rho);
      continue;
    }
    const Spectrum z(at_.z[i].v);
    // |x_t| and rho |u_t| are half of z's length and of what its roots differ by.
    const double roots =
        std::sqrt(z.above * z.above + 4 * q) + std::sqrt(z.below * z.below + 4 * q);
    const double share = roots > 0 ? 2 * z.length * (z.above + z.below) / (2 * roots) : 0;
    const double back[2] = {-z.t[0], -z.t[1]};
    set_cone(x, positive_part(z.below, q), 0.5 * (z.length + share), z.t);
    set_cone(u, positive_part(-z.above, q) / rho, 0.5 * (z.length - share) / rho, back);
  }
}

void SmoothedPairs::move(const Packed& change, double length, double log_nu) {
  entries(at_.z) += length * entries(change);
  at_.log_nu += log_nu;
}

void SmoothedPairs::change_of(const ConePair& pair, Packed& out) const {
  for (std::size_t i = 0; i < rho_.size(); ++i)
    for (int c = 0; c < 3; ++c) out[i].v[c] = pair.x[i].v[c] - rho_[i] * pair.u[i].v[c];
}

std::array<double, 3> SmoothedPairs::parts(int i, const double* d) const {
  const double q = 4 * rho_[at(i)] * nu();
  const double* v = at_.z[at(i)].v;
  if (equations_.flat(i)) return {d[0] / std::sqrt(v[0] * v[0] + q), 0, 0};
  const Spectrum z(v);
  const double along = z.t[0] * d[1] + z.t[1] * d[2], across = z.t[0] * d[2] - z.t[1] * d[1];
  // Inside of a cone directions do not matter, and the distance from it takes the place of |z_t|.
  const double inside = std::max({z.below, -z.above, 0.0});
  return {(d[0] + along) / std::sqrt(z.above * z.above + q),
          (d[0] - along) / std::sqrt(z.below * z.below + q),
          across / std::sqrt(z.length * z.length + inside * inside + q)};
}

double SmoothedPairs::inner(const Packed& a, const Packed& b) const {
  double sum = 0;
  for (std::size_t i = 0; i < rho_.size(); ++i) {
    const auto p = parts(static_cast<int>(i), a[i].v), r = parts(static_cast<int>(i), b[i].v);
    for (std::size_t c = 0; c < 3; ++c) sum += p[c] * r[c];
  }
  return sum;
}

double SmoothedPairs::largest(const Packed& change) const {
  double most = 0;
  for (std::size_t i = 0; i < rho_.size(); ++i)
    for (double v : parts(static_cast<int>(i), change[i].v)) most = std::max(most, std::abs(v));
  return most;
}

// The solutions of x o u = nu e, A x - b = w(u), nu > 0, are a smooth curve that comes from
// nu = infinity. Where contacts that stick and slide admit no solution nearby it turns: nu grows
// for a while, Newton's matrix is singular at the turn, and steps towards smaller nu are blocked.
// By its arclength in z and log nu nothing happens there (method, section 6).
struct InteriorPoint::ArclengthPath {
  ArclengthPath(InteriorPoint& of, Search& s) : own(of), search(s), pairs(s.system, of.equations_) {
    newton.resize(at(of.n_));
    rate.resize(at(of.n_));
  }

  // A point near the curve, and its tangent.
  struct Point {
    SmoothedPairs::Place place, tangent;
  };

  InteriorPoint& own;
  Search& search;
  SmoothedPairs pairs;
  double step = 0.5;    // in parts of what changes the first contact's regime
  Packed newton, rate;  // to the curve, with newton_log_nu; d / d log nu along it
  double newton_log_nu = 0;
  SmoothedPairs::Place tangent;
  Point last;

  void evaluate() {
    pairs.set(own.point_);
    own.equations_.evaluate(search, own.point_);
  }

  // Newton's direction to the curve, at the present nu or across the tangent, and the tangent.
  bool directions(bool across) {
    const System& system = search.system;
    const double nu = pairs.nu();
    if (!own.newton_.factor(search, own.equations_, own.point_)) return false;
    own.newton_.direction(system, own.equations_, nu, false, 0);
    pairs.change_of(own.newton_.change(), newton);
    own.newton_.direction(system, own.equations_, 2 * nu, false, 0);
    pairs.change_of(own.newton_.change(), rate);
    entries(rate) -= entries(newton);
    const double square = pairs.inner(rate, rate) + 1;
    // Along the curve det F_y d nu / ds keeps its sign, F(y, nu) = 0 being its equations.
    const double forward = own.newton_.matrix().determinant_sign() > 0 ? -1 : 1;
    tangent.log_nu = forward / std::sqrt(square);
    if (!std::isfinite(tangent.log_nu)) return false;
    tangent.z.resize(rate.size());
    entries(tangent.z) = tangent.log_nu * entries(rate);
    newton_log_nu = across ? -pairs.inner(rate, newton) / square : 0;
    entries(newton) += newton_log_nu * entries(rate);
    return true;
  }

  // How many times Newton's direction could be followed.
  double reach() const {
    constexpr double kLogNu = 3;
    return 1 / std::max(pairs.largest(newton), std::abs(newton_log_nu) / kLogNu);
  }

  void go_along(const SmoothedPairs::Place& along) {
    constexpr double kMostFall = 4.6, kMostRise = 2;  // of log nu
    double length = step / pairs.largest(along.z);
    if (along.log_nu < 0) length = std::min(length, kMostFall / -along.log_nu);
    if (along.log_nu > 0) length = std::min(length, kMostRise / along.log_nu);
    pairs.move(along.z, length, length * along.log_nu);
    evaluate();
  }

  // A shorter step from the last point; false: none is left.
  bool go_back() {
    constexpr double kShorter = 0.25;
    step *= kShorter;
    if (step < kLeast) return false;
    pairs.go_to(last.place);
    go_along(last.tangent);
    return true;
  }

  // The first point: Newton's method at constant nu.
  bool begin(double nu) {
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
    // A direction that could be followed to its end is taken, and is the last one where it could be
    // for kLast times as long. The next one may not be much shorter.
    constexpr double kFewer = 0.7, kMore = 1.7;
    constexpr int kMost = 6;
    go_along(tangent);
    double before = 0;
    for (int iteration = 1; !search.exhausted(); ++iteration) {
      const double longest = directions(true) ? reach() : 0;
      const bool near = longest >= kLast;
      if (!near && (!(longest >= std::max(1.0, kFewer * before)) || iteration > kMost)) {
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
      if (iteration == 1) step = std::min(1.0, kMore * step);
      if (iteration >= kMost / 2) step *= kFewer;
      last = {pairs.place(), tangent};
      return true;
    }
    return false;
  }

  // kLeast: of steps, and of parts of Newton's direction that can be followed.
  static constexpr double kLast = 4, kInside = 0.9, kLeast = 1e-3;
};

void InteriorPoint::run_arclength(Search& search, int most, ProximalNewton& newton) {
  // The shift, relative to A, keeps digits where contacts stick: there 1 / W^2 = x / u grows
  // without bound, and takes those of the bodies that slide.
  constexpr double kShift = 1e-11, kFar = 1e5, kFarther = 100;
  constexpr double kTested = 1e-5, kEnd = 1e-24;  // of the first nu
  constexpr double kTry = 1e-6, kGain = 0.1;
  constexpr int kProblems = 3;  // of proximal Newton, where the curve is near a solution
  const int end = search.counts.factorisations + most;
  equations_.set_tau(0);
  newton_.set_shift(kShift);
  ArclengthPath path(*this, search);
  double first = 0;
  bool on_path = false;
  for (double near = 1; !on_path && near <= kFar && !search.exhausted(); near *= kFarther) {
    if (!start_near(search, search.best.data(), near)) return;
    first = equations_.complementarity(point_);
    on_path = path.begin(first);
  }
  for (double tried = kTry; on_path; on_path = path.go_on()) {
    if (search.exhausted() || search.counts.factorisations > end) break;
    if (path.pairs.nu() > kTested * first) continue;
    const double error = test_point(search);
    if (search.solved() || search.exhausted()) return;
    if (path.pairs.nu() < kEnd * first) break;
    if (!(error < kTry && search.best_error < kGain * tried)) continue;
    tried = search.best_error;
    newton.run(search, search.best.data(), kProblems);
    if (search.solved()) return;
  }
}

}  // namespace tether::contact::detail

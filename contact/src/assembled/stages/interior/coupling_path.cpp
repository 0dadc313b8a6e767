// Tether: interior points from the convex problem to the law. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>

#include "assembled/stages/interior/interior_point.hpp"

namespace tether::contact::detail {
namespace {

double dot(const Packed& a, const Packed& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    for (int c = 0; c < 3; ++c) sum += a[i].v[c] * b[i].v[c];
  return sum;
}

// to += factor other
void add(ConePair& to, double factor, const ConePair& other) {
  for (auto [p, q] : {std::pair(&to.x, &other.x), std::pair(&to.u, &other.u)})
    for (std::size_t i = 0; i < p->size(); ++i)
      for (int c = 0; c < 3; ++c) (*p)[i].v[c] += factor * (*q)[i].v[c];
}

}  // namespace

// With theta s(u) in place of s(u) the problem is convex at theta = 0 and the law at 1. At a
// constant x o u = nu e, nu > 0, the solutions are a smooth curve that starts at the only one of
// theta = 0; where a solution exists for every theta it cannot turn back to 0 or run off, and
// reaches 1. It may turn on its way: followed by its arclength in (x, u, theta), x and u over their
// lengths.
struct InteriorPoint::CouplingPath {
  CouplingPath(InteriorPoint& of, Search& s, double constant_nu)
      : own(of), search(s), nu(constant_nu) {}

  InteriorPoint& own;
  Search& search;
  double nu;
  double theta = 0, length = 0.1;
  double x_scale = 1, u_scale = 1;  // 1 / squares of lengths
  ConePair newton, rate;            // to the solution at theta, and d/d theta
  ConePair along;                   // unit tangent, with along_theta
  double along_theta = 0;

  double inner(const ConePair& a, const ConePair& b) const {
    return x_scale * dot(a.x, b.x) + u_scale * dot(a.u, b.u);
  }

  bool directions() {
    const System& system = search.system;
    own.equations_.set_coupling(theta);
    own.equations_.evaluate(system, own.point_);
    if (!own.newton_.factor(search, own.equations_, own.point_)) return false;
    own.newton_.direction(system, own.equations_, nu, false);
    newton = own.newton_.change();
    own.equations_.add_coupling_rate(system, own.point_);
    own.newton_.direction(system, own.equations_, nu, false);
    rate = own.newton_.change();
    add(rate, -1, newton);
    return true;
  }

  // From `rate`, onwards.
  void set_tangent() {
    x_scale = 1 / dot(own.point_.x, own.point_.x);
    u_scale = 1 / dot(own.point_.u, own.point_.u);
    double unit = 1 / std::sqrt(inner(rate, rate) + 1);
    if (along_theta != 0 && inner(rate, along) + along_theta < 0) unit = -unit;
    along = rate;
    for (Packed* p : {&along.x, &along.u})
      for (PackedVector& v : *p)
        for (int c = 0; c < 3; ++c) v.v[c] *= unit;
    along_theta = unit;
  }

  // Newton's method across the tangent; iterations, 0: none converges.
  int correct() {
    constexpr int kMost = 8;
    constexpr double kInside = 0.9;
    for (int iteration = 1; iteration <= kMost; ++iteration) {
      if (!directions()) return 0;
      double change = 0;
      if (theta < 1) change = -inner(along, newton) / (inner(along, rate) + along_theta);
      add(newton, change, rate);
      const double step = std::min(1.0, kInside * own.equations_.longest_step(own.point_, newton));
      advance(own.point_, newton, step);
      theta += step * change;
      if (!std::isfinite(theta)) return 0;
      own.equations_.set_coupling(theta);
      own.equations_.evaluate(search.system, own.point_);
      if (step >= 1 && own.centred(search.system, nu)) return iteration;
    }
    return 0;
  }

  bool step() {
    constexpr double kInside = 0.8, kLeast = 1e-4, kMost = 4;
    const ConePair before = own.point_;
    const double theta_before = theta;
    while (length > kLeast) {
      length = std::min(length, kInside * own.equations_.longest_step(before, along));
      advance(own.point_, along, length);
      theta = std::min(1.0, theta + length * along_theta);
      const int iterations = correct();
      if (iterations > 0) {
        length = iterations <= 2   ? std::min(kMost, 1.5 * length)
                 : iterations >= 5 ? 0.7 * length
                                   : length;
        return true;
      }
      own.point_ = before;
      theta = theta_before;
      length *= 0.4;
      if (search.exhausted()) return false;
    }
    return false;
  }
};

// Forecasts by the factorisations of the last steps, which become short near a fold.
struct InteriorPoint::Progress {
  int since;  // count of factorisations at the last look
  double theta = 0;

  bool arrives(double now, int count, int end) {
    constexpr int kLook = 12;
    if (now >= 1) return count < end;
    if (count - since < kLook) return count < end;
    const bool in_time = (now - theta) * (end - count) > (1 - now) * (count - since);
    theta = now;
    since = count;
    return in_time;
  }
};

// Whether every contact's x.u is near nu, and w(u) near A x - b.
bool InteriorPoint::centred(const System& system, double nu) const {
  constexpr double kOff = 0.3, kResidual = 0.02;
  const double speed = system.norm_b() / std::sqrt(n_);
  for (int i = 0; i < n_; ++i) {
    const double *x = point_.x[at(i)].v, *u = point_.u[at(i)].v;
    const double xu = equations_.flat(i) ? x[0] * u[0] : product(x, u);
    if (!(std::abs(xu / nu - 1) < kOff)) return false;
    for (int c = 0; c < 3; ++c)
      if (!(std::abs(equations_.residual()[at(i)].v[c]) < kResidual * speed)) return false;
  }
  return true;
}

bool InteriorPoint::centre(Search& search, double nu) {
  constexpr int kMost = 30;
  for (int iteration = 0; iteration < kMost; ++iteration) {
    if (!newton_.factor(search, equations_, point_)) return false;
    newton_.direction(search.system, equations_, nu, false);
    const double step = std::min(1.0, 0.9 * newton_.longest_step(equations_));
    advance(point_, newton_.change(), step);
    equations_.evaluate(search.system, point_);
    if (step >= 1 && centred(search.system, nu)) return true;
    if (search.exhausted()) return false;
  }
  return false;
}

void InteriorPoint::run_coupling(Search& search, int most) {
  constexpr double kEnd = 1e-3, kReduction = 0.2;  // of x.u
  constexpr int kSteps = 60;
  const int end = search.counts.factorisations + most;
  equations_.set_tau(0);
  equations_.set_coupling(0);
  newton_.reset_shift();
  bool on_path = start(search);
  if (on_path) {
    const double first = equations_.complementarity(point_);
    double nu = first;
    while (on_path && nu > kEnd * first) {
      nu = std::max(kEnd * first, kReduction * nu);
      on_path = centre(search, nu);
    }
    CouplingPath path(*this, search, nu);
    on_path = on_path && path.directions();
    Progress progress{search.counts.factorisations};
    while (on_path && path.theta < 1) {
      path.set_tangent();
      on_path = path.step() && progress.arrives(path.theta, search.counts.factorisations, end) &&
                !search.exhausted();
    }
  }
  equations_.set_coupling(1);
  if (!on_path) return;
  equations_.evaluate(search.system, point_);
  follow(search, kSteps, 0);
}

}  // namespace tether::contact::detail

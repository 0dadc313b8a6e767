// Tether: two damped masses on a rigid link, linear. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <problems/linear_masses.hpp>
#include <problems/mechanism.hpp>

namespace tether::problems {

namespace {

constexpr double kMass = 100.0, kSpring = 2.0, kDamper = 5.0, kPush = 10.0, kUntil = 0.1,
                 kAfter = 0.1, kDecay = 5.0;

double push(double t) { return t < kUntil ? kPush : kAfter * std::exp(-kDecay * t); }

struct Masses {
  static constexpr int n = 2, m = 1;
  static constexpr double sign = -1.0;  // the published equations have + G^T lam

  void mass(const double*, double* M) const { M[0] = M[3] = kMass; }
  void force(double t, const double* q, const double* v, double* f) const {
    f[0] = -kSpring * q[0] - kDamper * v[0] + push(t);
    f[1] = kSpring * (q[0] - q[1]) + kDamper * (v[0] - v[1]);
  }
  void position(double, const double* q, double* r) const { r[0] = q[0] - q[1]; }
  void gradient(double, const double*, double* G) const { link(G); }
  void velocity(double, const double*, const double* v, double* r) const { r[0] = v[0] - v[1]; }
  void velocity_gradient(double, const double*, const double*, double*) const {}
  void acceleration(double, const double*, const double*, const double* a, double* r) const {
    r[0] = a[0] - a[1];
  }
  void acceleration_gradient(double, const double*, const double*, const double*, double*) const {}
  void dynamics_gradient(double, const double*, const double*, const double*, const double*,
                         double* Dq, double* Dv) const {
    const double each[4] = {1.0, 0.0, -1.0, 1.0};
    for (int k = 0; k < 4; ++k) {
      Dq[k] = kSpring * each[k];
      Dv[k] = kDamper * each[k];
    }
  }

 private:
  static void link(double* G) {
    G[0] = 1.0;
    G[1] = -1.0;
  }
};

struct State {
  double x, v;
};

// 2 m x'' + d x' + k x = 0 from `at`, after t.
State swings(State at, double t) {
  const double rate = kDamper / (4.0 * kMass),
               turn = std::sqrt(kSpring / (2.0 * kMass) - rate * rate);
  const double sine = (at.v + rate * at.x) / turn;
  const double c = std::cos(turn * t), s = std::sin(turn * t), e = std::exp(-rate * t);
  return {e * (at.x * c + sine * s),
          e * ((turn * sine - rate * at.x) * c - (turn * at.x + rate * sine) * s)};
}

// Both masses move as one, with twice the mass: a constant force, then an exponential one.
State exact(double t) {
  const double rest = kPush / kSpring;
  State at = swings({-rest, 1.0}, kUntil);
  at.x += rest;
  const double share = kAfter / (2.0 * kMass * kDecay * kDecay - kDamper * kDecay + kSpring);
  const double before = share * std::exp(-kDecay * kUntil), now = share * std::exp(-kDecay * t);
  at = swings({at.x - before, at.v + kDecay * before}, t - kUntil);
  return {at.x + now, at.v - kDecay * now};
}

}  // namespace

std::vector<std::string> linear_masses_forms() { return Mechanism<Masses>::forms(); }

Problem linear_masses(const std::string& form) {
  Problem p =
      Mechanism<Masses>::make(Masses{}, "linear masses", form, {0.0, 0.0}, {1.0, 1.0}, {"link"});
  p.t_end = 20.0;
  const State end = exact(p.t_end);
  double a[2];
  std::vector<double> lam(1);
  Mechanism<Masses>::solve_motion(Masses{}, p.t_end, std::vector<double>{end.x, end.x}.data(),
                                  std::vector<double>{end.v, end.v}.data(), a, lam.data());
  Mechanism<Masses>::set_reference(Masses{}, {end.x, end.x}, {end.v, end.v}, lam, p);
  p.error_components = 4;
  return p;
}

}  // namespace tether::problems

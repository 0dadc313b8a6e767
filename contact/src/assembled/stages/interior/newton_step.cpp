// Tether: the Newton step of interior points. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/stages/interior/newton_step.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "assembled/stages/interior/interior_point.hpp"

namespace tether::contact::detail {
namespace {

constexpr double kLeastShift = 1e-13, kMostShift = 1e-8;

double dot3(const double* x, const double* y) { return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]; }

}  // namespace

void InteriorNewton::reset(int contacts) {
  n_ = contacts;
  for (ConePair* p : {&change_, &scaled_, &affine_}) p->resize(n_);
  for (Packed* p : {&step_, &aim_, &defect_, &z_, &w_}) p->resize(at(n_));
  none_.assign(at(n_), PackedVector());
  scaling_.resize(at(n_));
  sides_.resize(at(n_));
}

void InteriorNewton::reset_shift() { shift_ = kLeastShift; }

void InteriorNewton::adapt_shift(double longest_step) {
  if (longest_step < 0.05) shift_ = std::min(kMostShift, 100 * shift_);
  if (longest_step > 0.5) shift_ = std::max(kLeastShift, 0.1 * shift_);
}

// Scalings and both sides of the Newton matrix; false: a point has reached its cone.
bool InteriorNewton::scale(const System& system, const InteriorEquations& equations,
                           const ConePair& point) {
  for (int i = 0; i < n_; ++i) {
    const double* u = point.u[at(i)].v;
    ConeScaling& s = scaling_[at(i)];
    Sides& sides = sides_[at(i)];
    ContactBlocks& blocks = matrix_[i];
    sides = {};
    blocks = {};
    if (equations.flat(i)) {
      if (!s.set_flat(point.x[at(i)].v[0], u[0])) return false;
      blocks.L.column[0] = blocks.R.column[0] = 1 / s.d[0];
      continue;
    }
    if (!s.set(point.x[at(i)].v, u)) return false;
    double gamma[2];
    system.gamma(i, gamma);
    const double slip = slip_of(u), c = kSmooth, d = 1 - kSmooth;
    const double gradient[3] = {c * u[0] / slip, d * u[1] / slip, d * u[2] / slip};
    const double column[3] = {1, gamma[0], gamma[1]};
    const double f = 1 / (1 - dot3(gradient, column));
    const double inverse_mu = 1 / system.problem().local(i).mu;
    for (int k = 0; k < 3; ++k) {
      sides.gradient[k] = gradient[k];
      sides.column[k] = f * column[k];
    }
    for (int r = 0; r < 3; ++r) {
      const double inverse = 1 / s.d[r], along = dot3(s.Q + 3 * r, sides.column);
      for (int k = 0; k < 3; ++k) {
        const double q = s.Q[3 * r + k] * (k == 0 ? inverse_mu : 1);
        blocks.R.column[4 * r + k] = inverse * q;
        blocks.L.column[4 * k + r] =
            inverse * (q + along * gradient[k] * (k == 0 ? inverse_mu : 1));
      }
    }
  }
  return true;
}

// Unknowns W dx in the frames of the scalings.
bool InteriorNewton::factor(Search& search, const InteriorEquations& equations,
                            const ConePair& point) {
  if (!scale(search.system, equations, point)) return false;
  for (int i = 0; i < n_; ++i) {
    const LocalBlock& L = search.system.problem().local(i);
    PackedBlock& added = matrix_[i].a;
    added = own_block(L, equations.tau());
    for (int c = 0; c < 3; ++c) added.column[5 * c] += shift_ * mean_diagonal(L);
  }
  search.counts.work += step_cost(search);
  return matrix_.factor(search);
}

// aim = lambda \ (centre e - lambda o lambda) and the right-hand side; corrected: with the
// second-order term of the predictor (Mehrotra).
void InteriorNewton::aim(const InteriorEquations& equations, double centre, bool corrected) {
  for (int i = 0; i < n_; ++i) {
    const double* r = equations.residual()[at(i)].v;
    const ConeScaling& s = scaling_[at(i)];
    const Sides& sides = sides_[at(i)];
    const double* l = s.lambda;
    const double* f = affine_.x[at(i)].v;
    const double* g = affine_.u[at(i)].v;
    double* y = aim_[at(i)].v;
    double* rhs = step_[at(i)].v;
    if (equations.flat(i)) {
      y[0] = (centre - l[0] * l[0] - (corrected ? f[0] * g[0] : 0)) / l[0];
      rhs[0] = y[0] - r[0] / s.d[0];
      rhs[1] = rhs[2] = y[1] = y[2] = 0;
      continue;
    }
    double q[3] = {centre - dot3(l, l), -2 * l[0] * l[1], -2 * l[0] * l[2]};
    if (corrected) {
      q[0] -= dot3(f, g);
      q[1] -= f[0] * g[1] + g[0] * f[1];
      q[2] -= f[0] * g[2] + g[0] * f[2];
    }
    double v[3];
    v[0] = (l[0] * q[0] - l[1] * q[1] - l[2] * q[2]) / s.lambda_det;
    v[1] = (q[1] - v[0] * l[1]) / l[0];
    v[2] = (q[2] - v[0] * l[2]) / l[0];
    s.turn(v, y);
    const double along = dot3(sides.gradient, r);
    double e[3];
    for (int c = 0; c < 3; ++c) v[c] = r[c] + along * sides.column[c];
    s.turn(v, e);
    for (int c = 0; c < 3; ++c) rhs[c] = y[c] - e[c] / s.d[c];
  }
}

// dx and du from the solution; returns the relative defect of the equations.
double InteriorNewton::expand(const System& system, const InteriorEquations& equations) {
  const Problem& p = system.problem();
  const double tau = equations.tau();
  for (int i = 0; i < n_; ++i) {
    const ConeScaling& s = scaling_[at(i)];
    const double* xi = step_[at(i)].v;
    const double e[3] = {xi[0] / s.d[0], xi[1] / s.d[1], xi[2] / s.d[2]};
    double* d = change_.x[at(i)].v;
    s.turn_back(xi, scaled_.x[at(i)].v);
    s.turn_back(e, d);
    z_[at(i)] = {{equations.flat(i) ? d[0] : d[0] / p.local(i).mu, d[1], d[2], 0}};
  }
  system.velocities(z_.data(), none_.data(), w_.data());
  double defect = 0, size = 0;
  for (int i = 0; i < n_; ++i) {
    const ConeScaling& s = scaling_[at(i)];
    const Sides& sides = sides_[at(i)];
    const LocalBlock& L = p.local(i);
    const double* w = w_[at(i)].v;
    const double* r = equations.residual()[at(i)].v;
    // J du = P^-1 (A + tau D) P^-1 dx + r
    double v[3] = {w[0], w[1], w[2]}, e[3], g[3];
    if (tau > 0) add_block(L, tau, z_[at(i)].v, v);
    if (equations.flat(i)) {
      v[0] += r[0];
      v[1] = v[2] = 0;
    } else {
      v[0] /= L.mu;
      for (int c = 0; c < 3; ++c) v[c] += r[c];
      const double along = dot3(sides.gradient, v);
      for (int c = 0; c < 3; ++c) v[c] += along * sides.column[c];
    }
    s.turn(v, e);
    const double* xi = step_[at(i)].v;
    const double* y = aim_[at(i)].v;
    for (int c = 0; c < 3; ++c) {
      const double left = y[c] - xi[c] - e[c] / s.d[c];
      defect_[at(i)].v[c] = left;
      defect += left * left;
      size += y[c] * y[c];
      // W^-1 du = y - W dx holds more digits where W is small.
      if (s.d[c] * s.d[c] < mean_diagonal(L)) e[c] = s.d[c] * (y[c] - xi[c]);
      g[c] = e[c] / s.d[c];
    }
    s.turn_back(e, change_.u[at(i)].v);
    s.turn_back(g, scaled_.u[at(i)].v);
  }
  return size > 0 ? std::sqrt(defect / size) : 0;
}

// Newton direction towards x o u = centre e, refined where it has lost digits.
void InteriorNewton::direction(const System& system, const InteriorEquations& equations,
                               double centre, bool corrected, int refinements) {
  constexpr double kRefine = 1e-6;
  aim(equations, centre, corrected);
  matrix_.solve(step_.data());
  double defect = expand(system, equations);
  for (int k = 0; k < refinements && defect > kRefine; ++k) {
    matrix_.solve(defect_.data());
    entries(step_) += entries(defect_);
    const double before = defect;
    defect = expand(system, equations);
    if (!(defect < 0.5 * before)) break;
  }
}

void InteriorNewton::keep_predictor() {
  std::swap(affine_.x, scaled_.x);
  std::swap(affine_.u, scaled_.u);
}

double InteriorNewton::longest_step(const InteriorEquations& equations) const {
  double t = std::numeric_limits<double>::infinity();
  for (int i = 0; i < n_; ++i) {
    const ConeScaling& s = scaling_[at(i)];
    for (const double* d : {scaled_.x[at(i)].v, scaled_.u[at(i)].v}) {
      if (!equations.flat(i)) {
        t = std::min(t, longest(s.lambda, s.lambda_det, d));
      } else if (d[0] < 0) {
        t = std::min(t, -s.lambda[0] / d[0]);
      }
    }
  }
  return t;
}

}  // namespace tether::contact::detail

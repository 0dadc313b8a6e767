// Tether: interior points for the exact cones. SPDX-License-Identifier: BSD-3-Clause
#include "interior_point.hpp"

#include <algorithm>
#include <cmath>

namespace tether::contact::detail {
namespace {

double tangent(const double* x) { return std::sqrt(x[1] * x[1] + x[2] * x[2]); }
double determinant(const double* x) { return x[3] * (x[3] + 2 * tangent(x)); }

// x.u >= 0 for two points of the cone, without cancellation where they are nearly orthogonal.
double product(const double* x, const double* u) {
  const double tx = tangent(x), tu = tangent(u), along = x[1] * u[1] + x[2] * u[2];
  double rest = tx * tu + along;
  if (along < 0) {
    const double across = x[1] * u[2] - x[2] * u[1];
    rest = across * across / (tx * tu - along);
  }
  return x[3] * u[0] + tx * u[3] + rest;
}

// Slip variable: s = |u_t| wherever u lies on the cone, that is, for sliding contacts. Inside of
// it only w_n > 0 matters, which holds for every 0 <= c < 1; c > 0 makes s smooth at u_t = 0.
constexpr double kSmooth = 0.5;
double slip_of(const double* u) {
  return std::sqrt(kSmooth * u[0] * u[0] + (1 - kSmooth) * (u[1] * u[1] + u[2] * u[2]));
}
// grad s . d
double slip_along(const double* u, double s, const double* d) {
  return (kSmooth * u[0] * d[0] + (1 - kSmooth) * (u[1] * d[1] + u[2] * d[2])) / s;
}

constexpr double kLeastCentre = 1e-3;
// Proximal term in the Newton matrix: bounds steps along the null space of A, where J H alone acts.
constexpr double kProximal = 1e-10;

// (2 v v' - J) x
void reflect(const double* v, const double* x, double scale, double* out) {
  const double vx = 2 * (v[0] * x[0] + v[1] * x[1] + v[2] * x[2]);
  out[0] = scale * (vx * v[0] - x[0]);
  out[1] = scale * (vx * v[1] + x[1]);
  out[2] = scale * (vx * v[2] + x[2]);
}

// Largest t with x + t d in the cone.
double longest(const double* x, const double* d) {
  // det(x + t d) = a t^2 + 2 b t + c
  const double a = d[0] * d[0] - d[1] * d[1] - d[2] * d[2];
  const double b = x[0] * d[0] - x[1] * d[1] - x[2] * d[2], c = determinant(x);
  double t = d[0] < 0 ? -x[0] / d[0] : std::numeric_limits<double>::infinity();
  const double D = b * b - a * c;
  if (D >= 0) {
    const double q = -(b + std::copysign(std::sqrt(D), b));
    if (c / q > 0) t = std::min(t, c / q);
    if (q / a > 0) t = std::min(t, q / a);
  }
  return t;
}

double mean_diagonal(const LocalBlock& L) { return (L.a + L.T[0] + L.T[2]) / 3; }

}  // namespace

void InteriorPoint::reset(int contacts) {
  n_ = contacts;
  for (Packed* p : {&x_, &u_, &dx_, &du_, &affine_x_, &affine_u_, &r_, &w_, &z_, &swept_, &anchor_})
    p->resize(at(n_));
  scaling_.resize(at(n_));
  flat_.resize(at(n_));
  ordered_ = false;
}

double InteriorPoint::cost(const Search& search) const {
  const double blocks = static_cast<double>(search.system.problem().blocks().size());
  const double operations = ordered_ ? lu_.operations() : blocks * blocks / std::max(1, n_);
  return 4 * operations + 3 * search.sweep_cost + 25 * blocks + 150.0 * n_;
}

// The point where everything sticks, A x = b, shifted into the cone; false if it is the solution
// or cannot be found.
bool InteriorPoint::start(Search& search) {
  System& system = search.system;
  const Problem& p = system.problem();
  const double speed = system.norm_b() / std::sqrt(n_);
  if (!(speed > 0)) return false;
  if (!ordered_) {
    lu_.order(p);
    lu_.analyse(p, nullptr);
    ordered_ = true;
  }
  constexpr double kShift = 1e-8;
  for (int row = 0; row < n_; ++row) {
    const int i = lu_.contact(row);
    lu_.begin_row(row);
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      PackedBlock block = p.blocks()[at(k)];
      if (p.columns()[at(k)] == i)
        for (int c = 0; c < 3; ++c) block.column[5 * c] += kShift * mean_diagonal(p.local(i));
      lu_.add(p.columns()[at(k)], block.column);
    }
    if (!lu_.end_row()) return false;
  }
  ++search.counts.factorisations;
  search.counts.work += cost(search);
  for (int i = 0; i < n_; ++i) z_[at(i)] = p.packed_b()[at(i)];
  lu_.solve(z_.data());
  double size = 0, outside = 0;
  for (int i = 0; i < n_; ++i) {
    flat_[at(i)] = system.law() == Law::frictionless || !(p.local(i).mu > 0);
    double* x = x_[at(i)].v;
    for (int c = 0; c < 3; ++c) x[c] = z_[at(i)].v[c];
    if (flat_[at(i)]) {
      x[1] = x[2] = 0;
    } else {
      x[0] *= p.local(i).mu;
    }
    const double t = tangent(x);
    size += std::abs(x[0]) + t;
    outside = std::max(outside, t - x[0]);
  }
  if (!std::isfinite(size)) return false;
  // Admissible as it is: two refinements remove the shift of the matrix.
  for (int refinement = 0; refinement < 3 && outside <= 0; ++refinement) {
    for (int i = 0; i < n_; ++i) {
      if (flat_[at(i)]) z_[at(i)].v[1] = z_[at(i)].v[2] = 0;
      clip_cone(p.local(i).mu, z_[at(i)].v);
    }
    search.test(z_.data(), Method::interior_point);
    if (search.solved()) return false;
    system.velocities(z_.data(), w_.data());
    lu_.solve(w_.data());
    search.count_sweep();
    for (int i = 0; i < n_; ++i)
      for (int c = 0; c < 3; ++c) z_[at(i)].v[c] -= w_[at(i)].v[c];
  }
  for (int i = 0; i < n_; ++i) {
    double* x = x_[at(i)].v;
    double* u = u_[at(i)].v;
    x[0] += outside + 0.1 * std::max(size / n_, speed / mean_diagonal(p.local(i)));
    x[3] = x[0] - tangent(x);
    u[0] = u[3] = speed;
    u[1] = u[2] = 0;
  }
  residual(system);
  return true;
}

// x and the u that belongs to its velocity, both kept off the cone as far as x.u = nu asks for,
// nu = near * (mean size of x) * (mean size of u).
bool InteriorPoint::start_near(Search& search, const PackedVector* start, double near) {
  System& system = search.system;
  const Problem& p = system.problem();
  if (!ordered_) {
    lu_.order(p);
    lu_.analyse(p, nullptr);
    ordered_ = true;
  }
  system.velocities(start, w_.data());
  double x_size = 0, u_size = 0;
  for (int i = 0; i < n_; ++i) {
    const double mu = p.local(i).mu;
    const double* w = w_[at(i)].v;
    double* x = x_[at(i)].v;
    double* u = u_[at(i)].v;
    flat_[at(i)] = system.law() == Law::frictionless || !(mu > 0);
    if (flat_[at(i)]) {
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
    double* x = x_[at(i)].v;
    double* u = u_[at(i)].v;
    const double x0 = x[3] + tangent(x), u0 = u[3] + tangent(u);
    x[3] = std::max(x[3], nu / (u0 + std::sqrt(nu * ratio)));
    u[3] = std::max(u[3], nu / (x0 + std::sqrt(nu / ratio)));
    x[0] = x[3] + tangent(x);
    u[0] = u[3] + tangent(u);
  }
  residual(system);
  return true;
}

// r = P^-1 (A x - b) - (u - s (1, gamma)), P = diag(mu, 1, 1)
void InteriorPoint::residual(const System& system) {
  const Problem& p = system.problem();
  for (int i = 0; i < n_; ++i) {
    const double* x = x_[at(i)].v;
    z_[at(i)] = {{flat_[at(i)] ? x[0] : x[0] / p.local(i).mu, x[1], x[2], 0}};
  }
  system.velocities(z_.data(), w_.data());
  if (tau_ > 0) {
    for (int i = 0; i < n_; ++i) {
      const double f = tau_ * mean_diagonal(p.local(i));
      for (int c = 0; c < 3; ++c) w_[at(i)].v[c] += f * (z_[at(i)].v[c] - anchor_[at(i)].v[c]);
    }
  }
  for (int i = 0; i < n_; ++i) {
    const double* u = u_[at(i)].v;
    const double* w = w_[at(i)].v;
    double* r = r_[at(i)].v;
    if (flat_[at(i)]) {
      r[0] = w[0] - u[0];
      r[1] = r[2] = 0;
      continue;
    }
    double gamma[2];
    system.gamma(i, gamma);
    const double s = slip_of(u);
    r[0] = w[0] / p.local(i).mu - (u[0] - s);
    r[1] = w[1] - (u[1] - s * gamma[0]);
    r[2] = w[2] - (u[2] - s * gamma[1]);
  }
}

bool InteriorPoint::scale(int i) {
  const double* x = x_[at(i)].v;
  const double* u = u_[at(i)].v;
  Scaling& s = scaling_[at(i)];
  const double dx = std::sqrt(determinant(x)), du = std::sqrt(determinant(u));
  if (!(dx > 0 && du > 0)) return false;
  const double half = std::sqrt(0.5 * (1 + product(x, u) / (dx * du)));
  for (int c = 0; c < 3; ++c) s.omega[c] = (u[c] / du + (c == 0 ? 1 : -1) * x[c] / dx) / (2 * half);
  const double f = 1 / std::sqrt(2 * (s.omega[0] + 1));
  for (int c = 0; c < 3; ++c) s.root[c] = (s.omega[c] + (c == 0 ? 1 : 0)) * f;
  s.theta = du / dx;
  s.root_theta = std::sqrt(s.theta);
  s.lambda_det = dx * du;
  const double g = std::sqrt(s.lambda_det), q = g / (x[0] / dx + u[0] / du + 2 * half);
  s.lambda[0] = g * half;
  for (int c = 1; c < 3; ++c)
    s.lambda[c] = q * ((half + u[0] / du) * x[c] / dx + (half + x[0] / dx) * u[c] / du);
  return true;
}

// A + P J H P on the contacts with friction, A_nn + u_n / x_n on the others.
bool InteriorPoint::factor(Search& search) {
  const System& system = search.system;
  const Problem& p = system.problem();
  bool regular = true;
  for (int row = 0; row < n_ && regular; ++row) {
    const int i = lu_.contact(row);
    double diagonal[12] = {};  // column c at 4 c
    if (flat_[at(i)]) {
      diagonal[0] = u_[at(i)].v[0] / x_[at(i)].v[0];
    } else {
      if (!scale(i)) return false;
      const Scaling& s = scaling_[at(i)];
      const double* u = u_[at(i)].v;
      const double mu = p.local(i).mu, slip = slip_of(u);
      double gamma[2];
      system.gamma(i, gamma);
      for (int c = 0; c < 3; ++c) {
        const double unit[3] = {c == 0 ? mu : 0.0, c == 1 ? 1.0 : 0.0, c == 2 ? 1.0 : 0.0};
        double h[3];
        reflect(s.omega, unit, s.theta, h);
        const double along = slip_along(u, slip, h);
        diagonal[4 * c] = mu * (h[0] - along);
        diagonal[4 * c + 1] = h[1] - along * gamma[0];
        diagonal[4 * c + 2] = h[2] - along * gamma[1];
      }
    }
    lu_.begin_row(row);
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const int j = p.columns()[at(k)];
      PackedBlock block = p.blocks()[at(k)];
      if (i == j) {
        for (int c = 0; c < 12; ++c) block.column[c] += diagonal[c];
        for (int c = 0; c < 3; ++c) block.column[5 * c] += std::max(kProximal, tau_) * mean_diagonal(p.local(i));
      }
      // No tangential unknowns where mu = 0.
      if (flat_[at(i)])
        for (int c = 0; c < 3; ++c) block.column[4 * c + 1] = block.column[4 * c + 2] = 0;
      if (flat_[at(j)])
        for (int c = 4; c < 12; ++c) block.column[c] = 0;
      if (i == j && flat_[at(i)]) block.column[5] = block.column[10] = 1;
      lu_.add(j, block.column);
    }
    regular = lu_.end_row();
  }
  ++search.counts.factorisations;
  ++search.counts.interior_steps;
  search.counts.work += cost(search);
  return regular;
}

// Newton direction towards x o u = centre e; correct: with the second-order term of the direction
// in affine_x_, affine_u_ (Mehrotra).
void InteriorPoint::direction(const System& system, double centre, bool correct) {
  const Problem& p = system.problem();
  // du = q - H dx with q = W (lambda \ (centre e - lambda o lambda)), hence
  // (A + P J H P) P^-1 dx = P (J q - r).
  for (int i = 0; i < n_; ++i) {
    const double* r = r_[at(i)].v;
    double* d = dx_[at(i)].v;
    double* q = du_[at(i)].v;
    d[3] = q[3] = 0;
    if (flat_[at(i)]) {
      double aim = centre - x_[at(i)].v[0] * u_[at(i)].v[0];
      if (correct) aim -= affine_x_[at(i)].v[0] * affine_u_[at(i)].v[0];
      q[0] = aim / x_[at(i)].v[0];
      q[1] = q[2] = 0;
      d[0] = q[0] - r[0];
      d[1] = d[2] = 0;
      continue;
    }
    const Scaling& s = scaling_[at(i)];
    const double* l = s.lambda;
    double aim[3] = {centre - l[0] * l[0] - l[1] * l[1] - l[2] * l[2], -2 * l[0] * l[1], -2 * l[0] * l[2]};
    if (correct) {
      const double inverse[3] = {s.root[0], -s.root[1], -s.root[2]};
      double f[3], g[3];
      reflect(s.root, affine_x_[at(i)].v, s.root_theta, f);
      reflect(inverse, affine_u_[at(i)].v, 1 / s.root_theta, g);
      aim[0] -= f[0] * g[0] + f[1] * g[1] + f[2] * g[2];
      aim[1] -= f[0] * g[1] + g[0] * f[1];
      aim[2] -= f[0] * g[2] + g[0] * f[2];
    }
    double y[3];
    y[0] = (l[0] * aim[0] - l[1] * aim[1] - l[2] * aim[2]) / s.lambda_det;
    y[1] = (aim[1] - y[0] * l[1]) / l[0];
    y[2] = (aim[2] - y[0] * l[2]) / l[0];
    reflect(s.root, y, s.root_theta, q);
    const double* u = u_[at(i)].v;
    const double along = slip_along(u, slip_of(u), q);
    double gamma[2];
    system.gamma(i, gamma);
    d[0] = p.local(i).mu * (q[0] - along - r[0]);
    d[1] = q[1] - along * gamma[0] - r[1];
    d[2] = q[2] - along * gamma[1] - r[2];
  }
  lu_.solve(dx_.data());
  system.velocities(dx_.data(), w_.data());
  for (int i = 0; i < n_; ++i) {
    double* d = dx_[at(i)].v;
    double* du = du_[at(i)].v;
    if (flat_[at(i)]) {
      du[0] -= u_[at(i)].v[0] / x_[at(i)].v[0] * d[0];
      continue;
    }
    const double mu = p.local(i).mu;
    const Scaling& s = scaling_[at(i)];
    d[0] *= mu;
    if (s.theta * s.omega[0] * s.omega[0] <= mean_diagonal(p.local(i))) {
      double h[3];
      reflect(s.omega, d, s.theta, h);
      for (int c = 0; c < 3; ++c) du[c] -= h[c];
      continue;
    }
    // H dx would cancel: J du = P^-1 A (P^-1 dx) + r instead, J = I - (1, gamma) grad s'.
    const double* u = u_[at(i)].v;
    const double* b = p.packed_b()[at(i)].v;
    const double* r = r_[at(i)].v;
    const double f0 = tau_ * mean_diagonal(p.local(i));
    const double y[3] = {(w_[at(i)].v[0] + b[0] + f0 * d[0] / mu) / mu + r[0],
                         w_[at(i)].v[1] + b[1] + f0 * d[1] + r[1],
                         w_[at(i)].v[2] + b[2] + f0 * d[2] + r[2]};
    double gamma[2];
    system.gamma(i, gamma);
    const double slip = slip_of(u), column[3] = {1, gamma[0], gamma[1]};
    const double f = slip_along(u, slip, y) / (1 - slip_along(u, slip, column));
    for (int c = 0; c < 3; ++c) du[c] = y[c] + f * column[c];
  }
}

double InteriorPoint::longest_step() const {
  double t = std::numeric_limits<double>::infinity();
  for (int i = 0; i < n_; ++i) {
    if (flat_[at(i)]) {
      for (const auto& [x, d] : {std::pair(x_[at(i)].v[0], dx_[at(i)].v[0]), std::pair(u_[at(i)].v[0], du_[at(i)].v[0])})
        if (d < 0) t = std::min(t, -x / d);
    } else {
      t = std::min({t, longest(x_[at(i)].v, dx_[at(i)].v), longest(u_[at(i)].v, du_[at(i)].v)});
    }
  }
  return t;
}

double InteriorPoint::complementarity() const {
  double sum = 0;
  for (int i = 0; i < n_; ++i)
    sum += flat_[at(i)] ? x_[at(i)].v[0] * u_[at(i)].v[0] : product(x_[at(i)].v, u_[at(i)].v);
  return sum / n_;
}

void InteriorPoint::advance(double step) {
  for (auto [point, change] : {std::pair(&x_, &dx_), std::pair(&u_, &du_)}) {
    for (int i = 0; i < n_; ++i) {
      double* x = (*point)[at(i)].v;
      const double d[3] = {step * (*change)[at(i)].v[0], step * (*change)[at(i)].v[1], step * (*change)[at(i)].v[2]};
      const double before = tangent(x);
      const double square = 2 * (x[1] * d[1] + x[2] * d[2]) + d[1] * d[1] + d[2] * d[2];
      for (int c = 0; c < 3; ++c) x[c] += d[c];
      const double after = tangent(x);
      // |x_t| after - before = (|x_t|^2 after - before) / (after + before)
      x[3] += d[0] - (after + before > 0 ? square / (after + before) : 0);
      x[0] = after + x[3];
    }
  }
}

// Of the (proximal) problem at z, whose velocities residual() has left in w_.
double InteriorPoint::natural_map(const System& system) const {
  double sum = 0;
  for (int i = 0; i < n_; ++i) {
    const double* z = z_[at(i)].v;
    const double* w = w_[at(i)].v;
    double v[3] = {std::max(z[0] - w[0], 0.0), 0, 0};
    if (!flat_[at(i)]) {
      double gamma[2];
      system.gamma(i, gamma);
      const double mu = system.problem().local(i).mu, s = slip(w[1], w[2], gamma[0], gamma[1]);
      v[0] = z[0] - w[0] - mu * s;
      for (int c = 1; c < 3; ++c) v[c] = z[c] - w[c] - s * gamma[c - 1];
      project_cone(mu, v);
    }
    for (int c = 0; c < 3; ++c) sum += (z[c] - v[c]) * (z[c] - v[c]);
  }
  return std::sqrt(sum);
}

double InteriorPoint::follow(Search& search, int most, double target) {
  System& system = search.system;
  const double speed = system.norm_b() / std::sqrt(n_);
  double least = std::numeric_limits<double>::infinity(), least_mean = least;
  int idle = 0;
  for (int iteration = 0; iteration < most; ++iteration) {
    const double mean = complementarity();
    if (!factor(search)) break;
    direction(system, 0, false);
    const double affine = std::min(1.0, longest_step());
    affine_x_ = dx_;
    affine_u_ = du_;
    direction(system, std::max(kLeastCentre, std::pow(1 - affine, 3)) * mean, true);
    const double longest = longest_step();
    if (!(longest > 1e-8)) break;
    // Close to the cone only with nearly full steps: blocked ones would spoil the centring.
    const double fraction = longest > 0.9 ? std::max(0.9, 1 - mean / (speed * speed)) : 0.8;
    advance(std::min(1.0, fraction * longest));
    residual(system);
    double error;
    if (tau_ > 0) {
      error = natural_map(system);
      if (error <= target) return error;
    } else {
      error = search.test(z_.data(), Method::interior_point);
      swept_ = z_;
      system.sweep(swept_.data());
      search.count_sweep();
      error = std::min(error, search.test(swept_.data(), Method::interior_point));
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
  tau_ = 0;
  if (start(search)) follow(search, most, 0);
}

void InteriorPoint::run_near(Search& search, const PackedVector* x, int most) {
  tau_ = 0;
  if (start_near(search, x, 1e-3)) follow(search, most, 0);
}

void InteriorPoint::run_proximal(Search& search, const PackedVector* x, int most) {
  System& system = search.system;
  std::copy(x, x + n_, anchor_.begin());
  constexpr int kPatience = 1000;
  double tau = 1e-2, near = 1e-4, reference = search.best_error;
  int since_gain = 0;
  tau_ = 0;
  for (int outer = 0; outer < most; ++outer) {
    // Half the natural map of the problem itself at the anchor is enough: with more accuracy the
    // iteration is no better, with more steps each.
    if (!start_near(search, anchor_.data(), near)) return;
    z_ = anchor_;
    system.velocities(z_.data(), w_.data());
    const double before = natural_map(system);
    tau_ = tau;
    residual(system);
    const double after = follow(search, 20, 0.5 * before);
    tau_ = 0;
    search.test(z_.data(), Method::interior_point);
    if (search.solved() || search.exhausted()) return;
    if (after <= 0.8 * before) {
      anchor_ = z_;
      tau = std::max(1e-7, 0.5 * tau);
    } else {
      tau = std::min(1.0, 3 * tau);
      near = near < 5e-5 ? 1e-3 : near > 5e-4 ? 1e-4 : 1e-5;  // another way to the same point
    }
    if (search.best_error < 0.97 * reference) {
      reference = search.best_error;
      since_gain = 0;
    } else if (++since_gain >= kPatience) {
      return;
    }
  }
}

}  // namespace tether::contact::detail

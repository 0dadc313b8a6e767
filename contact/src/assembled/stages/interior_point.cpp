// Tether: interior points for the exact cones. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/stages/interior_point.hpp"

namespace tether::contact::detail {
namespace {

constexpr double kLeastCentre = 1e-3, kCentreAfterBlocked = 0.2;
constexpr double kLeastShift = 1e-13, kMostShift = 1e-8;

typedef double v4 __attribute__((vector_size(32)));

// out = L A R
TETHER_CLONES void enclose(const PackedBlock& L, const PackedBlock& A, const PackedBlock& R,
                           PackedBlock& out) {
  const v4* l = reinterpret_cast<const v4*>(L.column);
  const v4* a = reinterpret_cast<const v4*>(A.column);
  v4* o = reinterpret_cast<v4*>(out.column);
  for (int c = 0; c < 3; ++c) {
    const double* r = R.column + 4 * c;
    const v4 h = a[0] * r[0] + a[1] * r[1] + a[2] * r[2];
    o[c] = l[0] * h[0] + l[1] * h[1] + l[2] * h[2];
  }
}

// w += f D x, D the diagonal block
void add_block(const LocalBlock& L, double f, const double* x, double* w) {
  w[0] += f * (L.a * x[0] + L.c[0] * x[1] + L.c[1] * x[2]);
  w[1] += f * (L.c[0] * x[0] + L.T[0] * x[1] + L.T[1] * x[2]);
  w[2] += f * (L.c[1] * x[0] + L.T[1] * x[1] + L.T[2] * x[2]);
}

double dot3(const double* x, const double* y) { return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]; }

}  // namespace

void InteriorPoint::reset(int contacts) {
  n_ = contacts;
  for (Packed* p : {
           &point_.x,
           &point_.u,
           &change_.x,
           &change_.u,
           &r_,
           &w_,
           &z_,
           &swept_,
           &anchor_,
           &scaled_.x,
           &scaled_.u,
           &affine_.x,
           &affine_.u,
           &step_,
           &aim_,
           &defect_,
       })
    p->resize(at(n_));
  scaling_.resize(at(n_));
  sides_.resize(at(n_));
  flat_.resize(at(n_));
  tau_ = 0;
  exact_ = false;
  matrix_.reset();
  sticking_.reset(contacts);
}

// w_: velocities at z_, of the proximal problem if there is one
void InteriorPoint::velocities(const System& system) {
  if (exact_)
    system.exact_velocities(z_.data(), w_.data());
  else
    system.velocities(z_.data(), w_.data());
  if (!(tau_ > 0)) return;
  for (int i = 0; i < n_; ++i) {
    const double* z = z_[at(i)].v;
    const double* a = anchor_[at(i)].v;
    const double d[3] = {z[0] - a[0], z[1] - a[1], z[2] - a[2]};
    add_block(system.problem().local(i), tau_, d, w_[at(i)].v);
  }
}

// r = P^-1 (A x - b) - (u - s (1, gamma)), P = diag(mu, 1, 1)
void InteriorPoint::residual(const System& system) {
  const Problem& p = system.problem();
  for (int i = 0; i < n_; ++i) {
    const double* x = point_.x[at(i)].v;
    z_[at(i)] = {{flat_[at(i)] ? x[0] : x[0] / p.local(i).mu, x[1], x[2], 0}};
  }
  velocities(system);
  for (int i = 0; i < n_; ++i) {
    const double* u = point_.u[at(i)].v;
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

// Scalings and both sides of the Newton matrix; false: a point has reached its cone.
bool InteriorPoint::scale(const System& system) {
  for (int i = 0; i < n_; ++i) {
    const double* u = point_.u[at(i)].v;
    ConeScaling& s = scaling_[at(i)];
    Sides& sides = sides_[at(i)];
    sides = {};
    if (flat_[at(i)]) {
      if (!s.set_flat(point_.x[at(i)].v[0], u[0])) return false;
      sides.left.column[0] = sides.right.column[0] = 1 / s.d[0];
      continue;
    }
    if (!s.set(point_.x[at(i)].v, u)) return false;
    double gamma[2];
    system.gamma(i, gamma);
    const double slip = slip_of(u), c = kSmooth;
    const double gradient[3] = {c * u[0] / slip, (1 - c) * u[1] / slip, (1 - c) * u[2] / slip};
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
        sides.right.column[4 * r + k] = inverse * q;
        sides.left.column[4 * k + r] =
            inverse * (q + along * gradient[k] * (k == 0 ? inverse_mu : 1));
      }
    }
  }
  return true;
}

// The diagonal block of the Newton matrix, with A in it (whole) or without.
void InteriorPoint::diagonal(const System& system, int i, bool whole, PackedBlock& scaled) const {
  const Problem& p = system.problem();
  PackedBlock block;
  if (whole)
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k)
      if (p.columns()[at(k)] == i) block = p.blocks()[at(k)];
  for (int c = 0; c < 3; ++c) {
    double unit[3] = {0, 0, 0};
    unit[c] = 1;
    add_block(p.local(i), tau_, unit, block.column + 4 * c);
    block.column[5 * c] += shift_ * mean_diagonal(p.local(i));
  }
  enclose(sides_[at(i)].left, block, sides_[at(i)].right, scaled);
  for (int c = 0; c < 3; ++c) scaled.column[5 * c] += 1;
}

bool InteriorPoint::factor_contacts(const System& system) {
  const Problem& p = system.problem();
  PackedBlock scaled;
  for (int row = 0; row < n_; ++row) {
    const int i = matrix_.contacts().block_row(row);
    matrix_.contacts().begin_row(row);
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const int j = p.columns()[at(k)];
      if (i != j)
        enclose(sides_[at(i)].left, p.blocks()[at(k)], sides_[at(j)].right, scaled);
      else
        diagonal(system, i, true, scaled);
      matrix_.contacts().add(j, scaled.column);
    }
    if (!matrix_.contacts().end_row()) return false;
  }
  return true;
}

bool InteriorPoint::factor_bodies(const System& system) {
  PackedBlock scaled;
  matrix_.bodies().begin();
  for (int i = 0; i < n_; ++i) {
    diagonal(system, i, false, scaled);
    matrix_.bodies().add(i, scaled, sides_[at(i)].left, sides_[at(i)].right);
  }
  return matrix_.bodies().factor();
}

// Unknowns W dx in the frames of the scalings.
bool InteriorPoint::factor(Search& search) {
  if (!scale(search.system)) return false;
  const bool regular =
      matrix_.by_bodies() ? factor_bodies(search.system) : factor_contacts(search.system);
  ++search.counts.factorisations;
  ++search.counts.interior_steps;
  search.counts.work += cost(search);
  return regular;
}

// aim = lambda \ (centre e - lambda o lambda) and the right-hand side; correct: with the
// second-order term of the predictor (Mehrotra).
void InteriorPoint::aim(double centre, bool correct) {
  for (int i = 0; i < n_; ++i) {
    const double* r = r_[at(i)].v;
    const ConeScaling& s = scaling_[at(i)];
    const Sides& sides = sides_[at(i)];
    const double* l = s.lambda;
    const double* f = affine_.x[at(i)].v;
    const double* g = affine_.u[at(i)].v;
    double* y = aim_[at(i)].v;
    double* rhs = step_[at(i)].v;
    if (flat_[at(i)]) {
      y[0] = (centre - l[0] * l[0] - (correct ? f[0] * g[0] : 0)) / l[0];
      rhs[0] = y[0] - r[0] / s.d[0];
      rhs[1] = rhs[2] = y[1] = y[2] = 0;
      continue;
    }
    double q[3] = {centre - dot3(l, l), -2 * l[0] * l[1], -2 * l[0] * l[2]};
    if (correct) {
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
double InteriorPoint::expand(const System& system) {
  const Problem& p = system.problem();
  for (int i = 0; i < n_; ++i) {
    const ConeScaling& s = scaling_[at(i)];
    const double* xi = step_[at(i)].v;
    const double e[3] = {xi[0] / s.d[0], xi[1] / s.d[1], xi[2] / s.d[2]};
    double* d = change_.x[at(i)].v;
    s.turn_back(xi, scaled_.x[at(i)].v);
    s.turn_back(e, d);
    z_[at(i)] = {{flat_[at(i)] ? d[0] : d[0] / p.local(i).mu, d[1], d[2], 0}};
  }
  system.velocities(z_.data(), w_.data());
  double defect = 0, size = 0;
  for (int i = 0; i < n_; ++i) {
    const ConeScaling& s = scaling_[at(i)];
    const Sides& sides = sides_[at(i)];
    const LocalBlock& L = p.local(i);
    const double* w = w_[at(i)].v;
    const double* b = p.packed_b()[at(i)].v;
    const double* r = r_[at(i)].v;
    // J du = P^-1 (A + tau D) P^-1 dx + r
    double v[3] = {w[0] + b[0], w[1] + b[1], w[2] + b[2]}, e[3], g[3];
    if (tau_ > 0) add_block(L, tau_, z_[at(i)].v, v);
    if (flat_[at(i)]) {
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
void InteriorPoint::direction(const System& system, double centre, bool correct) {
  constexpr double kRefine = 1e-6;
  constexpr int kRefinements = 3;
  aim(centre, correct);
  matrix_.solve(step_.data());
  double defect = expand(system);
  for (int k = 0; k < kRefinements && defect > kRefine; ++k) {
    matrix_.solve(defect_.data());
    for (int i = 0; i < n_; ++i)
      for (int c = 0; c < 3; ++c) step_[at(i)].v[c] += defect_[at(i)].v[c];
    const double before = defect;
    defect = expand(system);
    if (!(defect < 0.5 * before)) break;
  }
}

double InteriorPoint::longest_step() const {
  double t = std::numeric_limits<double>::infinity();
  for (int i = 0; i < n_; ++i) {
    const ConeScaling& s = scaling_[at(i)];
    for (const double* d : {scaled_.x[at(i)].v, scaled_.u[at(i)].v}) {
      if (!flat_[at(i)]) {
        t = std::min(t, longest(s.lambda, s.lambda_det, d));
      } else if (d[0] < 0) {
        t = std::min(t, -s.lambda[0] / d[0]);
      }
    }
  }
  return t;
}

double InteriorPoint::complementarity() const {
  double sum = 0;
  for (int i = 0; i < n_; ++i)
    sum += flat_[at(i)] ? point_.x[at(i)].v[0] * point_.u[at(i)].v[0]
                        : product(point_.x[at(i)].v, point_.u[at(i)].v);
  return sum / n_;
}

void InteriorPoint::advance(double step) {
  for (auto [point, change] :
       {std::pair(&point_.x, &change_.x), std::pair(&point_.u, &change_.u)}) {
    for (int i = 0; i < n_; ++i) {
      double* x = (*point)[at(i)].v;
      const double d[3] = {step * (*change)[at(i)].v[0], step * (*change)[at(i)].v[1],
                           step * (*change)[at(i)].v[2]};
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

// Residual of the (proximal) problem at z; velocities() has stored its velocities in w_.
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
  double least = std::numeric_limits<double>::infinity(), least_mean = least, last = 1;
  int idle = 0;
  shift_ = kLeastShift;
  for (int iteration = 0; iteration < most; ++iteration) {
    const double mean = complementarity();
    if (!factor(search)) break;
    direction(system, 0, false);
    const double affine = std::min(1.0, longest_step());
    std::swap(affine_.x, scaled_.x);
    std::swap(affine_.u, scaled_.u);
    // A blocked step leaves products x.u of different size behind.
    const double centre = last < 0.5 ? kCentreAfterBlocked : kLeastCentre;
    direction(system, std::max(centre, std::pow(1 - affine, 3)) * mean, true);
    const double longest = last = longest_step();
    if (!(longest > 1e-8)) break;
    if (longest < 0.05) shift_ = std::min(kMostShift, 100 * shift_);
    if (longest > 0.5) shift_ = std::max(kLeastShift, 0.1 * shift_);
    // Close to the cone only with nearly full steps: blocked ones would spoil the centring.
    const double fraction = longest > 0.9 ? std::max(0.9, 1 - mean / (speed * speed)) : 0.8;
    advance(std::min(1.0, fraction * longest));
    exact_ = search.near_round_off();
    residual(system);
    double error;
    if (tau_ > 0) {
      error = natural_map(system);
      if (error <= target) return error;
    } else {
      error = search.test(z_.data(), Method::interior_point);
      std::copy(z_.begin(), z_.end(), swept_.begin());
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

}  // namespace tether::contact::detail

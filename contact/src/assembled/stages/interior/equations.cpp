// Tether: the equations that interior points solve. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/stages/interior/newton_step.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tether/linalg/cone_scaling.hpp>
#include <utility>

namespace tether::contact::detail {

void InteriorEquations::reset(const System& system) {
  n_ = system.size();
  for (Packed* p : {&anchor_, &r_, &z_, &w_}) p->resize(at(n_));
  flat_.resize(at(n_));
  tau_ = 0;
  for (int i = 0; i < n_; ++i) flat_[at(i)] = !(system.friction(i) > 0);
}

// w_: velocities at z_, of the proximal problem if there is one
void InteriorEquations::velocities(const Search& search) {
  const Problem& p = search.system.problem();
  detail::velocities(p, search.near_round_off(), z_.data(), w_.data());
  if (!(tau_ > 0)) return;
  for (int i = 0; i < n_; ++i) {
    const double* z = z_[at(i)].v;
    const double* a = anchor_[at(i)].v;
    const double d[3] = {z[0] - a[0], z[1] - a[1], z[2] - a[2]};
    add_block(p.local(i), tau_, d, w_[at(i)].v);
  }
}

// r = P^-1 (A x - b) - (u - s (1, gamma)), P = diag(mu, 1, 1)
void InteriorEquations::evaluate(const Search& search, const ConePair& point) {
  const System& system = search.system;
  const Problem& p = system.problem();
  for (int i = 0; i < n_; ++i) {
    const double* x = point.x[at(i)].v;
    z_[at(i)] = {{flat_[at(i)] ? x[0] : x[0] / p.local(i).mu, x[1], x[2], 0}};
  }
  velocities(search);
  for (int i = 0; i < n_; ++i) {
    const double* u = point.u[at(i)].v;
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

double InteriorEquations::natural_map(const System& system) const {
  double sum = 0;
  for (int i = 0; i < n_; ++i) {
    const double* z = z_[at(i)].v;
    double v[3];
    system.natural_point(i, z_[at(i)], w_[at(i)], v);
    for (int c = 0; c < 3; ++c) sum += (z[c] - v[c]) * (z[c] - v[c]);
  }
  return std::sqrt(sum);
}

double InteriorEquations::natural_map(const Search& search, const PackedVector* impulses) {
  std::copy(impulses, impulses + n_, z_.begin());
  velocities(search);
  return natural_map(search.system);
}

double InteriorEquations::complementarity(const ConePair& point) const {
  double sum = 0;
  for (int i = 0; i < n_; ++i)
    sum += flat_[at(i)] ? point.x[at(i)].v[0] * point.u[at(i)].v[0]
                        : product(point.x[at(i)].v, point.u[at(i)].v);
  return sum / n_;
}

void advance(ConePair& to, const ConePair& along, double step) {
  for (auto [point, change] : {std::pair(&to.x, &along.x), std::pair(&to.u, &along.u)}) {
    for (std::size_t i = 0; i < point->size(); ++i) {
      double* x = (*point)[i].v;
      const double* c = (*change)[i].v;
      const double d[3] = {step * c[0], step * c[1], step * c[2]};
      const double before = tangent(x);
      const double square = 2 * (x[1] * d[1] + x[2] * d[2]) + d[1] * d[1] + d[2] * d[2];
      for (int k = 0; k < 3; ++k) x[k] += d[k];
      const double after = tangent(x);
      // |x_t| after - before = (|x_t|^2 after - before) / (after + before)
      x[3] += d[0] - (after + before > 0 ? square / (after + before) : 0);
      x[0] = after + x[3];
    }
  }
}

}  // namespace tether::contact::detail

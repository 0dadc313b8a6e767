// Tether: where interior points start. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <limits>

#include "assembled/stages/interior/interior_point.hpp"

namespace tether::contact::detail {

bool InteriorPoint::order_bodies(Search& search) {
  if (newton_.matrix().ordered()) return newton_.matrix().by_bodies();
  if (!newton_.matrix().order_by_bodies(search)) return false;
  equations_.find_flat(search.system);
  return true;
}

void InteriorPoint::order(Search& search) {
  if (newton_.matrix().ordered()) return;
  newton_.matrix().order(search);
  equations_.find_flat(search.system);
}

void InteriorPoint::stick(Search& search) {
  if (sticking_.tried()) return;
  order(search);
  sticking_.find(search, newton_.matrix(), equations_.flat());
  if (sticking_.found() && sticking_.outside() <= 0) equations_.set_exact(search.near_round_off());
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
  for (int i = 0; i < n_; ++i) {
    double* x = point_.x[at(i)].v;
    double* u = point_.u[at(i)].v;
    for (int c = 0; c < 3; ++c) x[c] = sticking_.point()[at(i)].v[c];
    x[0] += sticking_.outside() +
            0.1 * std::max(sticking_.size() / n_, speed / mean_diagonal(system.problem().local(i)));
    x[3] = x[0] - tangent(x);
    u[0] = u[3] = speed;
    u[1] = u[2] = 0;
  }
  equations_.evaluate(system, point_);
  return true;
}

// x and the u that belongs to its velocity, both kept off the cone as far as x.u = nu asks for,
// nu = near * (mean size of x) * (mean size of u).
bool InteriorPoint::place_near(Search& search, const PackedVector* start, double near) {
  System& system = search.system;
  const Problem& p = system.problem();
  order(search);
  system.velocities(start, swept_.data());
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
  return true;
}

bool InteriorPoint::start_near(Search& search, const PackedVector* start, double near) {
  if (!place_near(search, start, near)) return false;
  equations_.evaluate(search.system, point_);
  return true;
}

// Near the anchor, in the proximal problem around it.
bool InteriorPoint::start_proximal(Search& search, double tau, double near) {
  if (!place_near(search, equations_.anchor().data(), near)) return false;
  equations_.set_tau(tau);
  equations_.evaluate(search.system, point_);
  return true;
}

}  // namespace tether::contact::detail

// Tether: where interior points start. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <limits>

#include "assembled/stages/interior_point.hpp"

namespace tether::contact::detail {

bool InteriorPoint::order_bodies(Search& search) {
  if (ordered_) return by_bodies_;
  if (!bodies_serve(search.system.problem(), cost(search), 3 * search.sweep_cost, bodies_))
    return false;
  search.counts.work += 500.0 * n_;
  ordered_ = by_bodies_ = true;
  find_flat(search.system);
  return true;
}

double InteriorPoint::order_cost(const Search& search) const {
  return 100 * static_cast<double>(search.system.problem().blocks().size());
}

// Breadth-first levels, whose ends separate the graph: a front of a nested elimination is as wide
// as a level, and the widest front takes most of the work.
double InteriorPoint::cost_by_width(const Search& search) const {
  constexpr double kOfBand =
      0.1;  // of the work of eliminating level by level, as measured on packings
  const linalg::BlockPattern p = pattern(search.system.problem());
  std::vector<int> reached;
  std::vector<char> seen(at(n_), 0);
  reached.reserve(at(n_));
  double operations = 0;
  for (int seed = 0; seed < n_; ++seed) {
    if (seen[at(seed)]) continue;
    seen[at(seed)] = 1;
    reached.push_back(seed);
    std::size_t begin = reached.size() - 1;
    while (begin < reached.size()) {
      const std::size_t end = reached.size();
      const double width = static_cast<double>(end - begin);
      operations += width * width * width;
      for (; begin < end; ++begin)
        for (int k = p.starts[reached[begin]]; k < p.starts[reached[begin] + 1]; ++k) {
          const int j = p.columns[k];
          if (seen[at(j)]) continue;
          seen[at(j)] = 1;
          reached.push_back(j);
        }
    }
  }
  return 4 * kOfBand * operations;
}

void InteriorPoint::order(Search& search) {
  if (ordered_ || order_bodies(search)) return;
  search.counts.work += order_cost(search);
  lu_.order(pattern(search.system.problem()));
  lu_.analyse(pattern(search.system.problem()), nullptr);
  ordered_ = true;
  take_bodies_if_cheaper(search);
  find_flat(search.system);
}

// With the fill of both known: four contacts a body cost a quarter in equations of bodies, 2.8 as
// much as in those of contacts.
void InteriorPoint::take_bodies_if_cheaper(Search& search) {
  constexpr int kSome = 3;          // contacts for each body
  constexpr double kClearly = 0.5;  // the digits cost refinements
  const Problem& p = search.system.problem();
  const BodyForm* form = p.body_form();
  if (form == nullptr || n_ < kSome * form->bodies) return;
  const double contacts = cost(search);
  search.counts.work += 500.0 * n_;
  bodies_.order(p);
  by_bodies_ = bodies_.cost() + 3 * search.sweep_cost < kClearly * contacts;
}

void InteriorPoint::find_flat(const System& system) {
  for (int i = 0; i < n_; ++i) flat_[at(i)] = !(system.friction(i) > 0);
}

// A, shifted.
bool InteriorPoint::factor_stuck(const Problem& p) {
  // Below the eigenvalues that light bodies between heavy ones leave (1e-12 of the largest for 200
  // boxes of masses 1 : 1e6), above the rounding of A; by bodies above what cancels.
  const double shift = by_bodies_ ? 1e-9 : 1e-12;
  if (by_bodies_) {
    PackedBlock unit, block;
    for (int c = 0; c < 3; ++c) unit.column[5 * c] = 1;
    bodies_.begin();
    for (int i = 0; i < n_; ++i) {
      for (int c = 0; c < 3; ++c) block.column[5 * c] = shift * mean_diagonal(p.local(i));
      bodies_.add(i, block, unit, unit);
    }
    return bodies_.factor();
  }
  for (int row = 0; row < n_; ++row) {
    const int i = lu_.block_row(row);
    lu_.begin_row(row);
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      PackedBlock block = p.blocks()[at(k)];
      if (p.columns()[at(k)] == i)
        for (int c = 0; c < 3; ++c) block.column[5 * c] += shift * mean_diagonal(p.local(i));
      lu_.add(p.columns()[at(k)], block.column);
    }
    if (!lu_.end_row()) return false;
  }
  return true;
}

// A x = b: the point where everything sticks, in the frame where the cone is its own dual. Where it
// is admissible it is the solution, and refinements remove the shift of the matrix.
void InteriorPoint::stick(Search& search) {
  if (stuck_ != Stuck::untried) return;
  stuck_ = Stuck::unknown;
  System& system = search.system;
  const Problem& p = system.problem();
  order(search);
  constexpr int kRefinements = 6;
  if (!factor_stuck(p)) return;
  ++search.counts.factorisations;
  search.counts.work += cost(search);
  for (int i = 0; i < n_; ++i) z_[at(i)] = p.packed_b()[at(i)];
  solve(z_.data());
  stuck_size_ = outside_ = 0;
  for (int i = 0; i < n_; ++i) {
    double* x = stuck_x_[at(i)].v;
    for (int c = 0; c < 3; ++c) x[c] = z_[at(i)].v[c];
    if (flat_[at(i)]) {
      x[1] = x[2] = 0;
    } else {
      x[0] *= p.local(i).mu;
    }
    const double t = tangent(x);
    stuck_size_ += std::abs(x[0]) + t;
    outside_ = std::max(outside_, t - x[0]);
  }
  if (!std::isfinite(stuck_size_)) return;
  stuck_ = Stuck::found;
  double last = std::numeric_limits<double>::infinity();
  for (int refinement = 0; refinement <= kRefinements && outside_ <= 0; ++refinement) {
    for (int i = 0; i < n_; ++i) {
      if (flat_[at(i)]) z_[at(i)].v[1] = z_[at(i)].v[2] = 0;
      clip_cone(p.local(i).mu, z_[at(i)].v);
    }
    const double error = search.test(z_.data(), Method::interior_point);
    exact_ = search.near_round_off();
    // Errors of many contacts on each other add up: near round-off all digits are taken that cost
    // a solve each.
    if ((search.solved() && !exact_) || !(error < 0.5 * last)) return;
    last = error;
    velocities(system);
    solve(w_.data());
    search.count_sweep();
    for (int i = 0; i < n_; ++i)
      for (int c = 0; c < 3; ++c) z_[at(i)].v[c] -= w_[at(i)].v[c];
  }
}

// The point where everything sticks, shifted into the cone; false if it is the solution or cannot
// be found.
bool InteriorPoint::start(Search& search) {
  const System& system = search.system;
  const double speed = system.norm_b() / std::sqrt(n_);
  if (!(speed > 0)) return false;
  stick(search);
  if (search.solved() || stuck_ != Stuck::found) return false;
  for (int i = 0; i < n_; ++i) {
    double* x = x_[at(i)].v;
    double* u = u_[at(i)].v;
    for (int c = 0; c < 3; ++c) x[c] = stuck_x_[at(i)].v[c];
    x[0] += outside_ +
            0.1 * std::max(stuck_size_ / n_, speed / mean_diagonal(system.problem().local(i)));
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
  order(search);
  system.velocities(start, w_.data());
  double x_size = 0, u_size = 0;
  for (int i = 0; i < n_; ++i) {
    const double mu = p.local(i).mu;
    const double* w = w_[at(i)].v;
    double* x = x_[at(i)].v;
    double* u = u_[at(i)].v;
    flat_[at(i)] = !(system.friction(i) > 0);
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

// Near the anchor, in the proximal problem around it.
bool InteriorPoint::start_proximal(Search& search, double tau, double near) {
  tau_ = 0;
  if (!start_near(search, anchor_.data(), near)) return false;
  tau_ = tau;
  residual(search.system);
  return true;
}

}  // namespace tether::contact::detail

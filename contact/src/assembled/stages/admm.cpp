// Tether: alternating directions with one factorisation. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/stages/admm.hpp"

#include <algorithm>
#include <cmath>

namespace tether::contact::detail {

void Admm::reset(int contacts) {
  n_ = contacts;
  for (Packed* p : {&v_, &z_, &g_, &f_, &r_}) p->resize(at(n_));
  d_.resize(at(n_));
  anderson_.reset(n_, kDepth);
  started_ = factored_ = false;
}

bool Admm::factor(Search& search) {
  const Problem& p = search.system.problem();
  lu_.order(pattern(p));
  lu_.analyse(pattern(p), nullptr);
  for (int i = 0; i < n_; ++i) {
    const LocalBlock& L = p.local(i);
    d_[at(i)] = kRho * (L.a + L.T[0] + L.T[2]) / 3;
  }
  for (int r = 0; r < n_; ++r) {
    const int i = lu_.block_row(r);
    lu_.begin_row(r);
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const int j = p.columns()[at(k)];
      PackedBlock block = p.blocks()[at(k)];
      if (i == j)
        for (int c = 0; c < 3; ++c) block.column[5 * c] += d_[at(i)];
      lu_.add(j, block.column);
    }
    if (!lu_.end_row()) return false;
  }
  ++search.counts.factorisations;
  search.counts.work += 4 * lu_.operations() + 25 * static_cast<double>(p.blocks().size());
  return true;
}

void Admm::start(Search& search, const PackedVector* x) {
  if (!factored_) {
    factored_ = factor(search);
    if (!factored_) return;
  }
  System& system = search.system;
  // v = x + u, u = -(w + De Saxce term) / d: then P_K(v) = x where x is a solution.
  system.velocities(x, r_.data());
  for (int i = 0; i < n_; ++i) {
    const double* w = r_[at(i)].v;
    double gamma[2];
    system.gamma(i, gamma);
    const double mu = system.friction(i);
    const double s = slip(w[1], w[2], gamma[0], gamma[1]), f = 1 / d_[at(i)];
    v_[at(i)].v[0] = x[i].v[0] - f * (w[0] + mu * s);
    v_[at(i)].v[1] = x[i].v[1] - f * (w[1] + s * gamma[0]);
    v_[at(i)].v[2] = x[i].v[2] - f * (w[2] + s * gamma[1]);
    v_[at(i)].v[3] = 0;
  }
  anderson_.clear();
  started_ = true;
}

void Admm::run(Search& search, int most, bool accelerate, bool windowed) {
  if (!started_) return;
  System& system = search.system;
  const Problem& problem = system.problem();
  const double cost = 25 * static_cast<double>(lu_.size()) +
                      5 * std::sqrt(lu_.operations() * lu_.size()) +
                      (accelerate ? 0.8 * 4 * n_ * kDepth : 0);
  const bool frictionless = !system.law().friction;
  double least_f = std::numeric_limits<double>::infinity(), last_error = 0, last_f = 0;
  double window_error = std::numeric_limits<double>::infinity();
  int next_test = 1;
  anderson_.clear();
  for (int iteration = 1; iteration <= most; ++iteration) {
    ++search.counts.admm_iterations;
    search.counts.work += cost;
    for (int i = 0; i < n_; ++i) {
      const double* v = v_[at(i)].v;
      double* z = z_[at(i)].v;
      for (int c = 0; c < 3; ++c) z[c] = v[c];
      const double mu = frictionless ? 0 : problem.locals()[at(i)].mu;
      double gamma[2];
      system.gamma(i, gamma);
      if (frictionless) {
        z[0] = std::max(z[0], 0.0);
        z[1] = z[2] = 0;
      } else {
        project_cone(mu, z);
      }
      const double d = d_[at(i)], u1 = v[1] - z[1], u2 = v[2] - z[2];
      const double s = frictionless ? 0 : d * std::sqrt(u1 * u1 + u2 * u2);
      const double* b = problem.packed_b()[at(i)].v;
      double* r = r_[at(i)].v;
      r[0] = b[0] - mu * s + d * (2 * z[0] - v[0]);
      r[1] = b[1] - s * gamma[0] + d * (2 * z[1] - v[1]);
      r[2] = b[2] - s * gamma[1] + d * (2 * z[2] - v[2]);
      r[3] = 0;
    }
    lu_.solve(r_.data());
    double f2 = 0;
    for (int i = 0; i < n_; ++i) {
      const double weight = system.weight(i);
      for (int c = 0; c < 3; ++c) {
        const double step = r_[at(i)].v[c] - z_[at(i)].v[c];
        g_[at(i)].v[c] = v_[at(i)].v[c] + step;
        f_[at(i)].v[c] = weight * step;
        f2 += weight * step * weight * step;
      }
    }
    const double f = std::sqrt(f2);
    if (!std::isfinite(f)) {
      started_ = false;
      return;
    }
    if (iteration >= next_test || iteration == most ||
        last_error * f < 1.5 * search.options.tolerance * last_f) {
      point_error_ = last_error = search.test(z_.data(), Method::admm);
      last_f = f;
      if (search.solved()) return;
      next_test = iteration + 1 + iteration / 8;
    }
    if (search.exhausted()) return;
    if (windowed && iteration % 40 == 0) {
      // Stay while the error halves, or is predicted to reach the tolerance in three windows.
      const double rate = last_error / window_error;
      const auto left = [&] {
        return std::log(search.options.tolerance / last_error) / std::log(rate);
      };
      if (rate > 0.5 && !(rate < 1 && left() < 3)) return;
      window_error = last_error;
    }
    if (!accelerate || f > 2 * least_f) {
      if (accelerate) {
        anderson_.clear();
        least_f = f;
      }
      std::swap(v_, g_);
      continue;
    }
    least_f = std::min(least_f, f);
    anderson_.step(g_.data(), f_.data(), v_.data());
  }
}

}  // namespace tether::contact::detail

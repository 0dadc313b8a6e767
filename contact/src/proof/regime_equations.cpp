// Tether: an island in units near 1, and Coulomb's law in fixed regimes as a square system.
// SPDX-License-Identifier: BSD-3-Clause

#include "proof/regime_equations.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "problem/refuse.hpp"

namespace tether::contact::detail {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

[[noreturn]] void refuse_range(int contact, const char* what, double value) {
  throw OutOfRange(contact, std::string(what) + " = " + shown(value) +
                                ": leaves the range of doubles in units near 1");
}

double shifted(int contact, const char* what, double value, int exponent) {
  const double out = std::ldexp(value, exponent);
  if (!std::isfinite(out) || std::ldexp(out, -exponent) != value)
    refuse_range(contact, what, value);
  return out;
}

// k so that value 2^-k is near 1; 0 for 0.
int exponent_of(double value) { return value > 0 ? std::ilogb(value) : 0; }

VectorXd without_separating(VectorXd x, const std::vector<Regime>& regimes, int dimension) {
  for (std::size_t i = 0; i < regimes.size(); ++i)
    if (regimes[i] == Regime::separating)
      x.segment(dimension * static_cast<Index>(i), dimension).setZero();
  return x;
}

}  // namespace

ProofIsland proof_island(const Problem& problem, const linalg::VectorView& impulses) {
  const int d = problem.dimension(), n = problem.contacts();
  ProofIsland out;
  out.dimension = d;
  out.A = problem.dense_matrix();
  out.b = problem.b();
  out.x = impulses;
  out.mu.resize(n);
  std::vector<int> half(at(n));  // 2^half is near sqrt(A_nn)
  double largest_x = 0, largest_b = 0;
  const auto grow = [&](double& largest, const char* what, int i, const auto& v, int shift) {
    largest = std::max(largest, std::ldexp(v.segment(d * i, d).stableNorm(), shift));
    if (!std::isfinite(largest)) refuse_range(i, what, largest);
  };
  for (int i = 0; i < n; ++i) {
    out.mu[i] = problem.mu(i);
    half[at(i)] = exponent_of(problem.local(i).a) / 2;
    grow(largest_x, "|x| times about sqrt(A_nn)", i, out.x, half[at(i)]);
    grow(largest_b, "|b| over about sqrt(A_nn)", i, out.b, -half[at(i)]);
  }
  const int unit = exponent_of(largest_x > 0 ? largest_x : largest_b);
  for (int i = 0; i < n; ++i) {
    out.impulse.push_back(unit - half[at(i)]);
    out.velocity.push_back(unit + half[at(i)]);
  }
  for (int r = 0; r < d * n; ++r) {
    const int i = r / d;
    out.b[r] = shifted(i, "b", out.b[r], -out.velocity[at(i)]);
    out.x[r] = shifted(i, "an impulse", out.x[r], -out.impulse[at(i)]);
    for (int k = 0; k < d * n; ++k)
      out.A(r, k) = shifted(i, "A", out.A(r, k), -half[at(i)] - half[at(k / d)]);
  }
  return out;
}

Velocities::Velocities(const ProofIsland& island, const Box& box) {
  const Eigen::Index rows = box.x.size();
  const bool is_point = box.radius.isZero(0);
  w.reserve(static_cast<std::size_t>(rows));
  for (Eigen::Index r = 0; r < rows; ++r) {
    LongSum sum;
    sum.add(-1, island.b[r]);
    for (Eigen::Index k = 0; k < rows; ++k)
      if (island.A(r, k) != 0 && box.x[k] != 0) sum.add(island.A(r, k), box.x[k]);
    const double spread =
        is_point ? 0 : above(island.A.row(r).cwiseAbs().dot(box.radius), static_cast<double>(rows));
    const Interval middle = sum.terms() > 1 ? sum.value() : Interval(-island.b[r]);
    w.push_back(is_point ? middle : middle + Interval(-spread, spread));
    size = std::max(size, sum.size() + spread);
  }
}

Interval tangent_length(const Interval* x, int dimension) {
  return root(dimension == 2 ? square(x[1]) : square(x[1]) + square(x[2]));
}

RegimeEquations::RegimeEquations(const ProofIsland& island, const std::vector<Regime>& regimes,
                                 const VectorXd& x)
    : island_(island),
      regimes_(regimes),
      x_(without_separating(x, regimes, island.dimension)),
      velocities_(island, {x_, VectorXd::Zero(x.size())}),
      c_(VectorXd::Ones(island.contacts())) {
  const int d = island.dimension;
  for (int i = 0; i < island.contacts(); ++i)
    if (regimes[at(i)] != Regime::separating) touching_.push_back(i);
  const int m = static_cast<int>(touching_.size());
  F_.resize(at(d * m));
  J_.resize(d * m, d * m);
  for (int p = 0; p < m; ++p) {
    const int i = touching_[at(p)];
    for (int r = 0; r < d; ++r) F_[at(d * p + r)] = velocities_.w[at(d * i + r)];
    for (int q = 0; q < m; ++q)
      J_.block(d * p, d * q, d, d) = island.A.block(d * i, d * touching_[at(q)], d, d);
    if (regimes[at(i)] == Regime::sliding) slide(d * p, i);
  }
}

void RegimeEquations::slide(int row, int contact) {
  const int d = island_.dimension, from = d * contact;
  const double mu = island_.mu[contact], normal = x_[from], *t = &x_[from + 1];
  if (mu == 0 || d == 2) {
    const double slope = t[0] < 0 ? -mu : mu;
    for (int r = 1; r < d; ++r) {
      J_.row(row + r).setZero();
      J_(row + r, row) = -slope;
      J_(row + r, row + r) = 1;
      F_[at(row + r)] = Interval(t[r - 1]) - Interval(slope) * normal;
    }
    return;
  }
  const double c = c_[contact] = 1 / std::max(std::hypot(t[0], t[1]), kUnit);
  const Interval &w1 = velocities_.w[at(from + 1)], &w2 = velocities_.w[at(from + 2)];
  J_.row(row + 1) = ((t[0] * J_.row(row + 2) - t[1] * J_.row(row + 1)) * c).eval();
  J_(row + 1, row + 1) += c * w2.middle();
  J_(row + 1, row + 2) -= c * w1.middle();
  J_.row(row + 2).setZero();
  J_.block(row + 2, row, 1, 3) << -c * (mu * mu * normal), c * t[0], c * t[1];
  F_[at(row + 1)] = Interval(c) * (Interval(t[0]) * w2 - Interval(t[1]) * w1);
  F_[at(row + 2)] = Interval(c / 2) * (square(t[0]) + square(t[1]) - square(Interval(mu) * normal));
}

VectorXd RegimeEquations::values(double (Interval::*of)() const) const {
  VectorXd out(static_cast<Index>(F_.size()));
  std::transform(F_.begin(), F_.end(), out.begin(), std::mem_fn(of));
  return out;
}

VectorXd RegimeEquations::remainder(const VectorXd& rho, const VectorXd& spread) const {
  VectorXd out = VectorXd::Zero(rho.size());
  if (island_.dimension == 2) return out;  // F is linear
  const double rounding = 8 * kUnit;       // an entry of J has at most five roundings
  for (std::size_t p = 0; p < touching_.size(); ++p) {
    const int i = touching_[p];
    const double mu = island_.mu[i], c = c_[i];
    if (regimes_[at(i)] != Regime::sliding || mu == 0) continue;
    const Index row = 3 * static_cast<Index>(p);
    const double *e = &rho[row], *a = &spread[3 * i];
    const Eigen::Vector3d x = x_.segment(3 * i, 3).cwiseAbs();
    const Interval &w1 = velocities_.w[at(3 * i + 1)], &w2 = velocities_.w[at(3 * i + 2)];
    const double entries =
        x[1] * a[2] + x[2] * a[1] + e[1] * w2.magnitude() + e[2] * w1.magnitude();
    const double middles = e[1] * w2.radius() + e[2] * w1.radius();
    const double quadratic = e[1] * a[2] + e[2] * a[1];
    const double cone = e[1] * x[1] + e[2] * x[2] + mu * mu * e[0] * x[0];
    const double square = (e[1] * e[1] + e[2] * e[2] + mu * mu * e[0] * e[0]) / 2;
    const double lost = static_cast<double>(rho.size()) * kTiny * (1 + c) * (1 + rho.maxCoeff());
    out[row + 1] = above(c * (rounding * entries + middles + quadratic), 16) + lost;
    out[row + 2] = above(c * (rounding * cone + square), 16) + lost;
  }
  return out;
}

VectorXd RegimeEquations::scattered(const VectorXd& unknowns) const {
  const int d = island_.dimension;
  VectorXd out = VectorXd::Zero(x_.size());
  for (std::size_t p = 0; p < touching_.size(); ++p)
    out.segment(d * touching_[p], d) = unknowns.segment(d * static_cast<Index>(p), d);
  return out;
}

}  // namespace tether::contact::detail

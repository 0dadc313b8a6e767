// Tether: problems over products of cones, and their laws in words. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <tether/contact.hpp>
#include <vector>

namespace tether::contact::cone_problems {

using Eigen::MatrixXd;
using Eigen::VectorXd;

inline constexpr double kTolerance = 1e-10;

inline ConeSolution solve(const ConeProblem& p, double tolerance = kTolerance,
                          Law law = Law::coulomb) {
  Options o;
  o.law = law;
  o.tolerance = tolerance;
  return ConeSolver(o).solve(p);
}

struct Data {
  MatrixXd A;
  VectorXd b;
  std::vector<Cone> cones;
  ConeProblem problem() const { return ConeProblem::dense(A, b, cones); }
};

// A = J J' of the given rank share, diagonally strong where `alone` is large (then the law has one
// solution).
inline Data any_data(const std::vector<Cone>& cones, unsigned seed, double alone,
                     double share = 1.2) {
  std::mt19937 g(seed);
  std::normal_distribution<double> normal;
  int rows = 0;
  for (const Cone& c : cones) rows += c.rows;
  const int rank = std::max(1, static_cast<int>(share * rows));
  const MatrixXd J = MatrixXd::NullaryExpr(rows, rank, [&] { return normal(g); });
  Data out{J * J.transpose(), J * VectorXd::NullaryExpr(rank, [&] { return normal(g); }), cones};
  out.A.diagonal().array() += alone * rank;
  return out;
}

// The law from its words, not from residuals: how far x, w are from it, in the units of both.
inline double broken_law(const ConeProblem& p, const VectorXd& x, const VectorXd& w) {
  double most = 0;
  const auto say = [&](double v) { most = std::max(most, v); };
  // |m| <= r; at rest below it, against w at it.
  const auto disc = [&](const VectorXd& m, const VectorXd& v, double r) {
    say(m.norm() - r);
    if (v.norm() < 1e-8) return;
    say(std::abs(m.norm() - r));
    say((m + r * v / v.norm()).norm());
  };
  for (int k = 0; k < static_cast<int>(p.cones().size()); ++k) {
    const Cone& c = p.cones()[static_cast<std::size_t>(k)];
    const VectorXd xk = x.segment(p.first_row(k), c.rows), wk = w.segment(p.first_row(k), c.rows);
    if (c.kind == Cone::Kind::free) {
      say(wk.cwiseAbs().maxCoeff());
      continue;
    }
    if (c.kind == Cone::Kind::bounded) {
      disc(xk, wk, c.bound);
      continue;
    }
    say(-xk[0]);
    say(-wk[0]);
    say(std::min(xk[0], wk[0]));
    const int tangents = c.rows == 1 ? 0 : c.rows == 2 ? 1 : 2;
    disc(xk.segment(1, tangents), wk.segment(1, tangents), c.mu * xk[0]);
    if (c.kind == Cone::Kind::torsional || c.kind == Cone::Kind::rolling_torsional)
      disc(xk.segment(3, 1), wk.segment(3, 1), c.torsional * xk[0]);
    if (c.kind == Cone::Kind::rolling || c.kind == Cone::Kind::rolling_torsional)
      disc(xk.tail(2), wk.tail(2), c.rolling * xk[0]);
  }
  return most;
}

}  // namespace tether::contact::cone_problems

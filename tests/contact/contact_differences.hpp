// Tether: derivatives of contact problems by differences of tight solutions.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <string>
#include <tether/contact.hpp>

namespace tether::contact::differences {

inline constexpr Law kLaws[] = {Law::maximum_dissipation, Law::coulomb, Law::frictionless};

inline Solution tight(const Problem& p, Law law) {
  Options o;
  o.law = law;
  o.tolerance = 1e-12;
  o.strict = true;
  return Solver(o).solve(p);
}

struct Data {
  Eigen::MatrixXd A;
  Eigen::VectorXd b, mu;
  Problem problem() const { return Problem::dense(A, b, mu); }
};

// A block of A as its entries.
inline void add_block(ProblemDirection& to, int row, int column, const Eigen::MatrixXd& block) {
  for (int r = 0; r < block.rows(); ++r)
    for (int c = 0; c < block.cols(); ++c) to.A.push_back({row + r, column + c, block(r, c)});
}

template <class F>
double over_entries(const ProblemDirection& gradient, const ProblemDirection& v, const F& f) {
  std::map<std::pair<int, int>, double> by_place;
  for (const MatrixEntry& g : gradient.A) by_place[{g.row, g.column}] = g.value;
  double sum = 0;
  for (const MatrixEntry& of : v.A)
    if (const auto g = by_place.find({of.row, of.column}); g != by_place.end())
      sum += f(g->second, of.value);
  return sum;
}

inline double product(const ProblemDirection& gradient, const ProblemDirection& v) {
  double sum = 0;
  if (v.b.size() > 0) sum += gradient.b.dot(v.b);
  if (v.mu.size() > 0) sum += gradient.mu.dot(v.mu);
  return sum + over_entries(gradient, v, [](double g, double of) { return g * of; });
}

inline double sizes(const ProblemDirection& gradient, const ProblemDirection& v) {
  double sum = 0;
  if (v.b.size() > 0) sum += gradient.b.cwiseAbs().dot(v.b.cwiseAbs());
  if (v.mu.size() > 0) sum += gradient.mu.cwiseAbs().dot(v.mu.cwiseAbs());
  return sum + over_entries(gradient, v, [](double g, double of) { return std::abs(g * of); });
}

struct Comparison {
  bool regular = false;   // strictly, and stays so where the differences look
  bool unique = false;    // else only velocities are compared
  double error = 0;       // of dx and dw, relative
  double transposed = 0;  // |x'.J v - (J'x').v| over the sizes of its terms
  double residual = 0;    // of the equations: not small where the direction lifts contacts
  std::string words;
};

// A way for the data to change that contacts that stick or slide can follow where they are more
// than bodies can tell apart, as with bodies whose contacts do the same: A(h) = R A R', b(h) = R (b
// + h A c), R = 1 + h E with one factor for each contact.
struct Path {
  Eigen::MatrixXd A;
  Eigen::VectorXd b, mu, factor, of_mu, moved;
  ProblemDirection tangent;

  Path(const Problem& p, unsigned seed)
      : A(p.dense_matrix()), b(p.b()), mu(p.contacts()), factor(p.b().size()), of_mu(p.contacts()) {
    std::mt19937 g(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    const int d = p.dimension();
    for (int i = 0; i < p.contacts(); ++i) {
      mu[i] = p.mu(i);
      of_mu[i] = mu[i] * uniform(g);
      factor.segment(d * i, d).setConstant(0.3 * uniform(g));
    }
    moved = A * Eigen::VectorXd::NullaryExpr(A.rows(), [&] { return uniform(g); });
    moved *= b.cwiseAbs().maxCoeff() / std::max(moved.cwiseAbs().maxCoeff(), 1e-300);
    tangent.b = factor.cwiseProduct(b) + moved;
    tangent.mu = of_mu;
    const Eigen::MatrixXd dA = factor.asDiagonal() * A + A * factor.asDiagonal();
    for (int i = 0; i < p.contacts(); ++i)
      for (int k = p.row_start()[static_cast<std::size_t>(i)];
           k < p.row_start()[static_cast<std::size_t>(i + 1)]; ++k) {
        const int j = p.columns()[static_cast<std::size_t>(k)];
        add_block(tangent, d * i, d * j, dA.block(d * i, d * j, d, d));
      }
  }
  Problem at(double h) const {
    const Eigen::VectorXd R = (1 + h * factor.array()).matrix();
    return Problem::dense(R.asDiagonal() * A * R.asDiagonal(), R.cwiseProduct(b + h * moved),
                          mu + h * of_mu);
  }
};

// Central differences of solutions at 1e-13, with one Richardson extrapolation, in steps h and h/2
// (relative to the data) within which no contact may come near a kink.
inline Comparison compare(const Problem& p, Law law, unsigned seed, double h = 1e-3) {
  Comparison out;
  Options o;
  o.law = law;
  o.tolerance = 1e-13;
  o.strict = true;
  o.max_work = 3e8;
  const Solution s = Solver(o).solve(p);
  if (!(s.error <= 1e-11)) {
    out.words = std::string("error of the solution ") + std::to_string(s.error);
    return out;
  }
  const Derivative D = derivative(p, law, s);
  const DerivativeReport& report = D.report();
  out.words = "rank " + std::to_string(report.rank) + " of " + std::to_string(report.unknowns) +
              ", " + std::to_string(report.kinks.size()) + " kinks; " + report.advice;
  const Path path(p, seed);
  const ProblemDirection& v = path.tangent;
  const SolutionDirection f = D.forward(v);
  const Eigen::VectorXd row = Eigen::VectorXd::LinSpaced(p.b().size(), -1, 2);
  const Eigen::VectorXd row_w = Eigen::VectorXd::LinSpaced(p.b().size(), 1, 3);
  const ProblemDirection gradient = D.adjoint(row, row_w);
  const double left = row.dot(f.impulses) + row_w.dot(f.velocities);
  const double size = sizes(gradient, v) + row.cwiseAbs().dot(f.impulses.cwiseAbs()) +
                      row_w.cwiseAbs().dot(f.velocities.cwiseAbs());
  out.transposed = size > 0 ? std::abs(left - product(gradient, v)) / size : 0;
  out.unique = report.status == DerivativeStatus::unique;
  if (!report.strictly_regular() || !(out.unique || report.velocities_unique)) return out;
  out.residual = f.residual;
  // Smaller steps where a kink is near; none where that leaves no digits.
  const auto same = [&](const Solution& t, const Problem& q) {
    if (!(t.error <= 1e-11)) return false;
    return derivative(q, law, t).report().regimes == report.regimes;
  };
  for (; h > 3e-6; h *= 0.25) {
    Eigen::VectorXd dx[2], dw[2];
    bool regular = true;
    for (int k = 0; k < 2 && regular; ++k) {
      const double step = k == 0 ? h : 0.5 * h;
      const Problem up = path.at(step), down = path.at(-step);
      const Solution a = Solver(o).solve(up, s.impulses), b = Solver(o).solve(down, s.impulses);
      regular = same(a, up) && same(b, down);
      if (!regular) break;
      dx[k] = (a.impulses - b.impulses) / (2 * step);
      dw[k] = (a.velocities - b.velocities) / (2 * step);
    }
    if (!regular) continue;
    const Eigen::VectorXd x = dx[1] + (dx[1] - dx[0]) / 3, w = dw[1] + (dw[1] - dw[0]) / 3;
    const double error =
        std::max(out.unique ? (x - f.impulses).norm() / std::max(x.norm(), 1e-300) : 0,
                 (w - f.velocities).norm() / std::max(w.norm(), v.b.norm()));
    if (!out.regular || error < out.error) out.error = error;
    out.regular = true;
    if (out.error < 1e-8) break;
  }
  return out;
}
inline Comparison compare(const Data& data, Law law, unsigned seed) {
  return compare(data.problem(), law, seed);
}

}  // namespace tether::contact::differences

// Tether: the free rows of a problem over cones. SPDX-License-Identifier: BSD-3-Clause
#include "cones/embedding.hpp"

#include <cmath>
#include <limits>
#include <tether/linalg/disjoint_sets.hpp>
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {

namespace {

using linalg::at;

// The shift eps of the proximal steps, for a matrix with a unit diagonal. Components with singular
// values above it converge in a few steps. In the null space of A rounding grows to 1e-16 / eps.
constexpr double kProximal = 1e-8;

}  // namespace

FreeRows::FreeRows(const ConeProblem& problem) : place_(at(problem.rows()), -1) {
  for (std::size_t k = 0; k < problem.cones().size(); ++k) {
    if (problem.cones()[k].kind != Cone::Kind::free) continue;
    for (int r = 0; r < problem.cones()[k].rows; ++r) {
      const int row = problem.first_row(static_cast<int>(k)) + r;
      place_[at(row)] = static_cast<int>(rows_.size());
      rows_.push_back(row);
    }
  }
  const auto n = static_cast<int>(rows_.size());
  std::vector<Eigen::Triplet<double>> own, down, up;
  scale_.resize(n);
  linalg::DisjointSets joined(n);
  for (int i = 0; i < n; ++i) scale_[i] = problem.row_scale()[at(rows_[at(i)])];
  for (const MatrixEntry& e : problem.entries()) {
    const int r = place_[at(e.row)], c = place_[at(e.column)];
    if (r >= 0 && c >= 0) {
      own.emplace_back(r, c, scale_[r] * e.value * scale_[c]);
      if (e.value != 0) joined.join(r, c);
    } else if (c >= 0) {
      down.emplace_back(e.row, c, e.value);
    } else if (r >= 0) {
      up.emplace_back(r, e.column, e.value);
    }
  }
  for (int i = 0; i < n; ++i)
    part_.push_back(joined.root(i) == i ? parts_++ : part_[at(joined.root(i))]);
  A_.resize(n, n);
  A_.setFromTriplets(own.begin(), own.end());
  coupling_.resize(problem.rows(), n);
  coupling_.setFromTriplets(down.begin(), down.end());
  back_.resize(n, problem.rows());
  back_.setFromTriplets(up.begin(), up.end());
  if (n == 0) return;
  Eigen::SparseMatrix<double> raised(n, n);
  raised.setIdentity();
  raised = (A_ + kProximal * raised).eval();
  factor_.compute(raised);
}

Eigen::VectorXd FreeRows::of(const linalg::VectorView& v) const {
  Eigen::VectorXd out(static_cast<Eigen::Index>(rows_.size()));
  for (std::size_t i = 0; i < rows_.size(); ++i) out[static_cast<Eigen::Index>(i)] = v[rows_[i]];
  return out;
}

void FreeRows::put(const Eigen::VectorXd& free, Eigen::VectorXd& v) const {
  for (std::size_t i = 0; i < rows_.size(); ++i) v[rows_[i]] = free[static_cast<Eigen::Index>(i)];
}

Eigen::VectorXd FreeRows::solve(const Eigen::VectorXd& of) const {
  const Eigen::VectorXd g = scale_.cwiseProduct(of);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(g.size()), r = g, best = x;
  double least = r.stableNorm();
  for (int step = 0; step < 40 && least > 0; ++step) {
    x += factor_.solve(r);
    r = g - A_ * x;
    const double now = r.stableNorm();
    if (!(now < least)) break;
    best = x;
    const bool slow = !(now < 0.5 * least);
    least = now;
    if (slow || now <= std::numeric_limits<double>::epsilon() * g.stableNorm()) break;
  }
  return scale_.cwiseProduct(best);
}

}  // namespace tether::contact::detail

// Tether: minimum-norm problems and their solution by Eigen. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Dense>
#include <limits>
#include <random>
#include <tether/linalg.hpp>
#include <vector>

namespace tether::test {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// C dy = g in the metric D.
struct Case {
  RowMajor C;
  Eigen::VectorXd D, g;
};

inline Eigen::VectorXd random_vector(int n, std::mt19937& random, double low = -1.0,
                                     double high = 1.0) {
  std::uniform_real_distribution<double> uniform(low, high);
  return Eigen::VectorXd::NullaryExpr(n, [&](Eigen::Index) { return uniform(random); });
}

inline RowMajor random_matrix(int m, int n, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  return RowMajor::NullaryExpr(m, n, [&](Eigen::Index, Eigen::Index) { return uniform(random); });
}

/// Random rows, metric over six decades, right-hand side of size 1.
inline Case random_case(int m, int n, unsigned seed) {
  std::mt19937 random(seed);
  Case c{random_matrix(m, n, random), random_vector(n, random, -3.0, 3.0),
         random_vector(m, random)};
  c.D = c.D.unaryExpr([](double x) { return std::pow(10.0, x); });
  return c;
}

/// dy = D (C D)^+ g by a complete orthogonal decomposition of the rows brought to unit length.
Eigen::VectorXd oracle(const Case& c);

/// The shortest x of min |A x - b|, by the same decomposition.
Eigen::VectorXd least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

/// Pivots of that decomposition above `threshold` times the largest.
int rank_of(const Eigen::MatrixXd& A, double threshold);

/// A v_k = sigma_k u_k, the largest first.
struct SingularVectors {
  Eigen::VectorXd sigma;
  Eigen::MatrixXd U, V;
};
SingularVectors singular_vectors(const Eigen::MatrixXd& A);

inline void load(linalg::MinimumNorm& solver, const RowMajor& C) {
  for (int i = 0; i < C.rows(); ++i)
    for (int j = 0; j < C.cols(); ++j) solver.row(i)[j] = C(i, j);
}

inline Eigen::VectorXd solve(linalg::MinimumNorm& solver, const Eigen::VectorXd& g) {
  Eigen::VectorXd dy = Eigen::VectorXd::Constant(solver.columns(), 7.0);  // must be overwritten
  solver.solve(g.data(), dy.data());
  return dy;
}

/// Sizes on both sides of the border between the small kernel and Eigen, and of padded lengths.
inline std::vector<std::pair<int, int>> sizes() {
  return {{1, 1},   {1, 2},   {3, 3},   {3, 4},   {2, 5},   {5, 7},   {4, 8},   {13, 14},
          {15, 16}, {16, 17}, {12, 31}, {16, 32}, {17, 32}, {16, 33}, {17, 33}, {30, 60}};
}

/// |a - b| in the metric D, where D > 0.
inline double distance(const Eigen::VectorXd& a, const Eigen::VectorXd& b,
                       const Eigen::VectorXd& D) {
  double sum = 0.0;
  for (int j = 0; j < D.size(); ++j)
    if (D[j] > 0.0) sum += std::pow((a[j] - b[j]) / D[j], 2);
  return std::sqrt(sum);
}

inline double length(const Eigen::VectorXd& a, const Eigen::VectorXd& D) {
  return distance(a, Eigen::VectorXd::Zero(a.size()), D);
}

/// Length that the shares of solver.dependence(k) leave of dropped row k, all rows of unit length
/// in D.
inline double left_of_dependence(const Case& c, const linalg::MinimumNorm& solver, int k) {
  RowMajor A = c.C * c.D.asDiagonal();
  A = A.rowwise().normalized();
  const std::vector<double> share = solver.dependence(k);
  if (share.size() != static_cast<std::size_t>(solver.rank()))
    return std::numeric_limits<double>::infinity();
  Eigen::RowVectorXd left = A.row(solver.pivot(k));
  for (int i = 0; i < solver.rank(); ++i)
    left -= share[static_cast<std::size_t>(i)] * A.row(solver.pivot(i));
  return left.norm();
}

}  // namespace tether::test

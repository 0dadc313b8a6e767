// Compiled once: Eigen's decompositions take ten seconds. SPDX-License-Identifier: BSD-3-Clause
#include "cases.hpp"

namespace tether::test {

namespace {

using Decomposition = Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd>;

}  // namespace

Eigen::VectorXd oracle(const Case& c) {
  RowMajor A = c.C * c.D.asDiagonal();
  Eigen::VectorXd g = c.g;
  for (int i = 0; i < A.rows(); ++i) {
    const double length = A.row(i).stableNorm();
    if (length == 0.0) {
      g[i] = 0.0;
      continue;
    }
    A.row(i) /= length;
    g[i] /= length;
  }
  Decomposition factors;
  factors.setThreshold(1e-12);
  factors.compute(A);
  return c.D.cwiseProduct(factors.solve(g));
}

Eigen::VectorXd least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b) {
  return Decomposition(A).solve(b);
}

int rank_of(const Eigen::MatrixXd& A, double threshold) {
  Decomposition factors;
  factors.setThreshold(threshold);
  factors.compute(A);
  return static_cast<int>(factors.rank());
}

SingularVectors singular_vectors(const Eigen::MatrixXd& A) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(A, Eigen::ComputeThinU | Eigen::ComputeThinV);
  return {svd.singularValues(), svd.matrixU(), svd.matrixV()};
}

}  // namespace tether::test

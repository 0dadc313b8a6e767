// Tether: impulses that hold all contacts of a mechanism. SPDX-License-Identifier: BSD-3-Clause
#include "joints/held_start.hpp"

#include <cmath>
#include <tether/linalg/index.hpp>
#include <tether/linalg/least_squares.hpp>
#include <tether/linalg/pivoted_qr.hpp>

#include "cones/cone_rows.hpp"

namespace tether::contact::detail {

namespace {

using linalg::at;

constexpr double kRank = 1e-6;  // of rows in their own scale

// A in that scale, and the scale.
Eigen::MatrixXd scaled(const ConeProblem& problem, Eigen::VectorXd& scale) {
  const Eigen::MatrixXd A = problem.dense_matrix();
  scale = A.diagonal();
  for (double& s : scale) s = s > 0 ? 1 / std::sqrt(s) : 0;
  return scale.asDiagonal() * A * scale.asDiagonal();
}

}  // namespace

bool share_loads(const ConeProblem& problem) {
  Eigen::VectorXd scale;
  const Eigen::MatrixXd A = scaled(problem, scale);
  std::vector<int> rows;
  for (std::size_t k = 0; k < problem.cones().size(); ++k)
    if (is_contact(problem.cones()[k].kind)) rows.push_back(problem.first_row(static_cast<int>(k)));
  const auto n = static_cast<Eigen::Index>(rows.size());
  if (n == 0) return false;
  Eigen::MatrixXd normals(n, n);
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = 0; i < n; ++i)
      normals(i, j) = A(rows[static_cast<std::size_t>(i)], rows[static_cast<std::size_t>(j)]);
  linalg::PivotedQr of_normals(kRank);
  of_normals.factor(normals);
  return of_normals.rank() < n;
}

bool hold_all(const ConeProblem& problem, double tolerance, linalg::VectorX& x) {
  Eigen::VectorXd scale;
  linalg::LeastSquares factor(kRank);
  factor.factor(scaled(problem, scale));
  const Eigen::VectorXd held =
      scale.cwiseProduct(Eigen::VectorXd(factor.solve(scale.cwiseProduct(problem.b()))));
  for (std::size_t k = 0; k < problem.cones().size(); ++k) {
    const Cone& cone = problem.cones()[k];
    const int first = problem.first_row(static_cast<int>(k));
    const double normal = held[first];
    if (is_contact(cone.kind) && !(normal >= 0)) return false;
    bool lawful = true;
    each_part(cone.kind, [&](int from, int count) {
      lawful = lawful && held.segment(first + from, count).norm() <= bound_of(cone, from, normal);
    });
    if (!lawful) return false;
  }
  const double enough = 0.1 * tolerance * problem.b().cwiseAbs().maxCoeff();
  if (!(problem.velocities(held).cwiseAbs().maxCoeff() <= enough)) return false;
  x = held;
  return true;
}

}  // namespace tether::contact::detail

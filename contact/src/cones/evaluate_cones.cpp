// Tether: residuals of any impulses for a problem over cones. SPDX-License-Identifier: BSD-3-Clause
//
// method, sections 3 and 8. Shares nothing with the solver: it uses the blocks as they are given.
#include <algorithm>
#include <cmath>
#include <limits>
#include <tether/contact/cones.hpp>
#include <tether/linalg/index.hpp>

#include "cones/cone_rows.hpp"
#include "problem/criterion.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {
namespace {

using linalg::at;

// Natural-map residual of the law |m| <= r, m opposes w, for a part with diagonal entry d of A.
template <int N>
double part_error(const Eigen::Matrix<double, N, 1>& m, const Eigen::Matrix<double, N, 1>& w,
                  double d, double r) {
  if (!(d > 0)) return 0;
  Eigen::Matrix<double, N, 1> p = m - w / d;
  if (const double length = p.norm(); length > r) p *= r / length;
  return d * (m - p).norm();
}

// Residual of block k. D, x and w are scaled so that D has a unit diagonal.
double block_error(const ConeProblem& problem, Law law, int k, const Vector6d& x, const Vector6d& w,
                   const Matrix6d& D) {
  const Cone& cone = problem.cones()[at(k)];
  const int first = problem.first_row(k);
  const std::vector<double>& s = problem.row_scale();
  if (cone.kind == Cone::Kind::bounded)
    return part_error<1>(x.head<1>(), w.head<1>(), D(0, 0),
                         s[at(first)] > 0 ? cone.bound / s[at(first)] : 0);
  const detail::ConeParts parts = detail::parts_of(cone.kind);
  const double mu = law == Law::frictionless ? 0 : cone.mu, n = std::max(0.0, x[0]);
  Eigen::Matrix3d A = Eigen::Matrix3d::Identity();
  A.topLeftCorner(1 + parts.tangents, 1 + parts.tangents) =
      D.topLeftCorner(1 + parts.tangents, 1 + parts.tangents);
  Eigen::Vector3d x3 = Eigen::Vector3d::Zero(), w3 = Eigen::Vector3d::Zero();
  x3.head(1 + parts.tangents) = x.head(1 + parts.tangents);
  w3.head(1 + parts.tangents) = w.head(1 + parts.tangents);
  LocalState state;
  for (int c = 0; c < 3; ++c) state.x[c] = x3[c];
  solve_local(law, LocalBlock(A, mu), A * x3 - w3, state);
  const Eigen::Vector3d z(state.x[0], state.x[1], state.x[2]);
  double most =
      std::max({(A * (x3 - z)).norm(), -A(0, 0) * x[0], A(0, 0) * (x3.tail<2>().norm() - mu * n)});
  const double sn = s[at(first)];
  if (parts.spin >= 0 && s[at(first + parts.spin)] > 0)
    most = std::max(most, part_error<1>(x.segment<1>(parts.spin), w.segment<1>(parts.spin),
                                        D(parts.spin, parts.spin),
                                        cone.torsional * n * sn / s[at(first + parts.spin)]));
  if (parts.rolling >= 0 && s[at(first + parts.rolling)] > 0)
    most = std::max(most, part_error<2>(x.segment<2>(parts.rolling), w.segment<2>(parts.rolling),
                                        D.diagonal().segment<2>(parts.rolling).mean(),
                                        cone.rolling * n * sn / s[at(first + parts.rolling)]));
  return most;
}

// For each block 1 / velocity scale of its island, which is the largest of its blocks.
std::vector<double> inverse_scales(const ConeProblem& problem) {
  const int n = static_cast<int>(problem.cones().size());
  const std::vector<int> island = detail::islands(problem);
  std::vector<double> needed(at(n), 0), square(at(n), 0), out(at(n));
  for (int k = 0; k < n; ++k) {
    double& most = needed[at(island[at(k)])];
    most = std::max(most, detail::needed_change(problem, k));
    for (int r = problem.first_row(k); r < problem.first_row(k) + problem.cones()[at(k)].rows;
         ++r) {
      const double b = problem.row_scale()[at(r)] * problem.b()[r];
      square[at(island[at(k)])] += b * b;
    }
  }
  for (int k = 0; k < n; ++k)
    out[at(k)] = detail::inverse_scale(needed[at(island[at(k)])], square[at(island[at(k)])]);
  return out;
}

}  // namespace

ConeResiduals evaluate(const ConeProblem& problem, Law law, const linalg::VectorView& impulses) {
  detail::require_law(problem, law);
  const linalg::VectorX w = problem.velocities(impulses);
  ConeResiduals out;
  out.blocks.assign(problem.cones().size(), Residuals::kNone);
  if (!impulses.allFinite()) return out;
  const std::vector<double> inverse = inverse_scales(problem);
  const std::vector<double>& s = problem.row_scale();
  out.error = 0;
  for (int k = 0; k < static_cast<int>(problem.cones().size()); ++k) {
    const Cone& cone = problem.cones()[at(k)];
    const int first = problem.first_row(k);
    double error = 0, rounding = 0;
    for (int row = first; row < first + cone.rows; ++row) {
      double sum = 0;
      for (int e = problem.row_start()[at(row)]; e < problem.row_start()[at(row + 1)]; ++e)
        sum += std::abs(problem.entries()[at(e)].value * impulses[problem.entries()[at(e)].column]);
      const double scale = s[at(row)];
      rounding = std::max(rounding, detail::kRoundOff * sum * scale);
      if (cone.kind != Cone::Kind::free) continue;
      // A row of zeros has no scale: its equation holds exactly, or the error is infinite.
      const double lost = scale > 0 || w[row] == 0 ? std::abs(w[row]) * scale
                                                   : std::numeric_limits<double>::infinity();
      error = std::max(error, lost);
    }
    if (cone.kind != Cone::Kind::free) {
      Matrix6d D = detail::diagonal_block(problem, first, cone.rows);
      Vector6d x = Vector6d::Zero(), v = Vector6d::Zero();
      for (int r = 0; r < cone.rows; ++r) {
        const double scale = s[at(first + r)];
        D.row(r) *= scale;
        D.col(r) *= scale;
        x[r] = scale > 0 ? impulses[first + r] / scale : 0;
        v[r] = scale * w[first + r];
      }
      D = (0.5 * (D + D.transpose())).eval();
      error = block_error(problem, law, k, x, v, D);
    }
    const double measure = std::max(error, rounding) * inverse[at(k)];
    out.blocks[at(k)] = measure;
    if (out.worst < 0 || !(measure <= out.error)) {
      out.error = measure;
      out.worst = k;
    }
  }
  return out;
}

}  // namespace tether::contact

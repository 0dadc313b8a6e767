// Tether: frictional problems of the event engine as those of the contact library.
// SPDX-License-Identifier: BSD-3-Clause
#include "cone_blocks.hpp"

#include <tether/linalg/index.hpp>

namespace tether::scene::event {

using contact::Cone;
using contact::Regime;
using linalg::at;

namespace {

constexpr double kNear = 1e-8;

template <class Solution>
bool is_solved(const Solution& answer) {
  return answer.status == contact::Status::solved || answer.status == contact::Status::round_off ||
         (answer.error < kNear && answer.status != contact::Status::infeasible);
}

/// Row and column 0 of a moment are nobody's, of one about the normal (whose second tangent no
/// other row moves) the last, too.
bool is_spin(const MatrixXd& A, int first) {
  return A.row(first + 2).cwiseAbs().sum() == A(first + 2, first + 2) &&
         A(first + 2, first + 2) > 0;
}

/// The cone of a contact with its moments, and where its rows are in blocks of three.
struct Held {
  Cone cone;
  std::vector<int> rows;
};

Held cone_of(const MatrixXd& A, const VectorXd& mu, const Holders& holders, int contact) {
  int spin = -1, rolling = -1;
  for (int k = contact + 1; k < static_cast<int>(holders.size()); ++k)
    if (holders[at(k)] == contact) (spin < 0 && is_spin(A, 3 * k) ? spin : rolling) = k;
  Held out;
  for (int k = 0; k < 3; ++k) out.rows.push_back(3 * contact + k);
  if (spin >= 0) out.rows.push_back(3 * spin + 1);
  if (rolling >= 0)
    for (int k = 1; k < 3; ++k) out.rows.push_back(3 * rolling + k);
  const double m = mu[contact], r = rolling >= 0 ? mu[rolling] : 0, s = spin >= 0 ? mu[spin] : 0;
  out.cone = rolling < 0 ? (spin < 0 ? Cone::friction(m) : Cone::with_torsional(m, s))
             : spin < 0  ? Cone::with_rolling(m, r)
                         : Cone::with_rolling(m, r, s);
  return out;
}

/// Sticking if the rest of the bound, as a velocity, is at least the slip.
Regime regime_of(double mobility, double left, double slip) {
  return mobility * left < slip ? Regime::sliding : Regime::sticking;
}

}  // namespace

FrictionAnswer ConeBlocks::solve(const MatrixXd& A, const VectorXd& b, const VectorXd& mu) {
  if (!holders_.empty()) return solve_with_moments(A, b, mu);
  const contact::Solution found = contacts_.solve(contact::Problem::dense(A, b, mu));
  return {is_solved(found), found.impulses, found.velocities, found.regimes, found.error};
}

FrictionAnswer ConeBlocks::solve_with_moments(const MatrixXd& A, const VectorXd& b,
                                              const VectorXd& mu) {
  const int n = static_cast<int>(mu.size());
  std::vector<Cone> cones;
  std::vector<int> rows;
  for (int i = 0; i < n; ++i) {
    if (is_held(holders_, i)) continue;
    const Held each = cone_of(A, mu, holders_, i);
    cones.push_back(each.cone);
    rows.insert(rows.end(), each.rows.begin(), each.rows.end());
  }
  const SomeRows part(A, b, rows);
  const contact::ConeSolution found =
      cones_.solve(contact::ConeProblem::dense(part.A, part.b, std::move(cones)));
  FrictionAnswer out;
  out.solved = is_solved(found);
  out.error = found.error;
  out.x.setZero(b.size());
  for (std::size_t r = 0; r < rows.size(); ++r)
    out.x[rows[r]] = found.impulses[static_cast<Eigen::Index>(r)];
  out.w = A * out.x - b;
  for (int i = 0; i < n; ++i) {
    const int row = 3 * i, normal = is_held(holders_, i) ? 3 * holders_[at(i)] : row;
    const double force = out.x[normal], slip = out.w.segment<2>(row + 1).norm();
    const double left = mu[i] * force - out.x.segment<2>(row + 1).norm();
    const bool open = !(A(normal, normal) * force > out.w[normal]);
    out.regimes.push_back(
        open ? Regime::separating
             : regime_of(0.5 * (A(row + 1, row + 1) + A(row + 2, row + 2)), left, slip));
  }
  return out;
}

}  // namespace tether::scene::event

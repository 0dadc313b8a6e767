// Tether: rows that are spread over processes, as VectorMover wants them (method, eq. 21).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <string>
#include <tether/ida_projection/constraints.hpp>
#include <tether/ida_projection/statistics.hpp>
#include <tether/linalg/sparse_minimum_norm.hpp>
#include <vector>

#include "constraints/evaluator.hpp"
#include "distributed/border.hpp"
#include "movers/vector/rows_report.hpp"
#include "movers/vector/vector_metric.hpp"

namespace tether::ida_projection {

/// Rows that are DistributedRows, with Gradients joined to them, and their factors.
///
/// With A = C D, A_p its rows on process p, u = D^-1 dy, the shortest u with A u = g solves
///
///     H u = sum_p A_p^+ g_p,     H = sum_p A_p^+ A_p
///
/// a sum of orthogonal projections (block Cimmino method: Elfving, Numer. Math. 35 (1980), 1;
/// accelerated: Arioli, Duff, Noailles, Ruiz, SIAM J. Sci. Stat. Comput. 13 (1992), 478), each of
/// which is a process's own solution of least norm, and so never explodes. Conjugate gradients
/// from u = 0 stay orthogonal to what the rows do not see, and grow towards the solution. H has
/// the eigenvalue 1 apart from what rows of several processes share: their number bounds the
/// number of steps. Without ghosts there is nothing to iterate.
///
/// Inner products are those of the N_Vector, so no message is sent from here but by the caller's
/// two functions of the ghosts. What decides is known to all processes, see largest().
class DistributedStore {
 public:
  DistributedStore(const Constraints& constraints, Statistics& statistics, N_Vector like);

  RowsReport report;

  Status value(double t, N_Vector y);
  Status fill(double t, N_Vector y);
  Status factor(const VectorMetric& metric, N_Vector terms_at);
  void solve(N_Vector D, N_Vector dy);
  double left() const { return left_; }
  double drift() const { return std::max(drift_, border_.rows().drift()); }
  /// After fill().
  bool contains_algebraic(N_Vector id);
  bool whole() const { return whole_; }
  bool rounding_only();
  /// Whether rows ask for more than half a tolerance beyond dy.
  bool contradict(N_Vector dy);

 private:
  using Numbers = std::vector<double>;

  // A vector of this process's unknowns and ghosts, and the parts of it.
  Vector own(Numbers& v) const { return {v.data(), n_}; }
  ConstVector own(const Numbers& v) const { return {v.data(), n_}; }
  Vector ghosts(Numbers& v) const { return {v.data() + n_, ghosts_}; }
  Numbers& load(N_Vector from, Numbers& to);
  void add_up(Numbers& from, N_Vector to);
  void note(int flag, const char* what, const std::string& thrown);

  double largest(double of_this_process);
  Status agree();
  double times(int row, const Numbers& v) const;
  void project(N_Vector v, N_Vector Hv);
  void shortest(N_Vector to);
  void solve_linear(N_Vector D, N_Vector dy, double solved);
  Status of_border(Status status);

  const Constraints& constraints_;
  const DistributedRows& given_;
  Statistics& statistics_;
  int n_, ghosts_, m_;
  linalg::SparseMinimumNorm solver_;
  Border border_;
  std::vector<int> place_;  // of each entry of the solver: the caller's, whose order is free
  Numbers entries_, y_, D_, v_, dy_;
  Numbers g_, linear_;  // g, and C v
  GuardedRoom room_;
  Numbers terms_, norm_;                // sum_j |C_ij y_j|, |row_i(C WT)|
  OwnedVector signal_, r_, p_, q_, u_;  // signal_: 0 but for the first entry of each process
  Status own_outcome_ = Status::success;
  std::string own_text_;
  double drift_ = 0.0, left_ = 0.0, unknowns_of_all_ = 1.0;
  bool whole_ = false, coupled_ = false, coupling_known_ = false;
};

}  // namespace tether::ida_projection

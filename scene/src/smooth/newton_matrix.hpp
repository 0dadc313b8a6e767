// Tether: IDA's matrix of a smooth system and its solver. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sundials/ida_session.hpp"
#include "system.hpp"

namespace tether::scene::smooth {

/// Which unknown comes when, for little fill and pivots on the diagonal. First the coordinates of
/// all bodies: of their columns, pivots cj I, only the velocities of the same body are filled, and
/// what is left has half the width. Then velocities, bodies in approximate minimum degree order of
/// the graph that joints and springs make of them, each multiplier behind the later of its bodies
/// (there its pivot, -G M^-1 G^T less what multipliers before it have of that, is not zero);
/// whatever else there is behind all.
///
/// `places`: (row, column) of each entry, `width` unknowns for each of so many bodies first, of
/// each the `coordinates` before the rest.
std::vector<int> elimination_order(int unknowns, int bodies, int width, int coordinates,
                                   const std::vector<std::pair<int, int>>& places);

/// dF/dy + cj dF/dy' of a system: dense, or sparse with KLU where there are many unknowns. The
/// assembly writes whole blocks, of which more than half may be zero for all states (a ball joint's
/// force does not turn with its bodies); the sparse pattern has what is not zero at states about
/// the first one, and grows where that changes.
class NewtonMatrix {
 public:
  /// Its entries are those of the Jacobian at t, y and y'.
  NewtonMatrix(System& system, double t, N_Vector y, N_Vector yp, SUNContext context);
  NewtonMatrix(const NewtonMatrix&) = delete;
  NewtonMatrix& operator=(const NewtonMatrix&) = delete;

  SUNMatrix matrix() const { return matrix_.get(); }
  SUNLinearSolver solver() const { return solver_.get(); }
  /// The values at this point into J, a matrix like matrix().
  void fill(double t, double cj, N_Vector y, N_Vector yp, SUNMatrix J);

 private:
  void make_dense(N_Vector y, SUNContext context);
  void make_sparse(double t, N_Vector y, N_Vector yp, SUNContext context);
  void note_written(double t, double cj, const std::vector<double>& y,
                    const std::vector<double>& yp);
  void find_entries_nearby(double t, N_Vector y, N_Vector yp);
  void arrange();
  bool grow();

  System& system_;
  OwnedMatrix matrix_;
  OwnedLinearSolver solver_;
  Entries entries_;
  // Sparse. Of each call of Entries::add: has it written anything but zero? Those that have not
  // write behind the entries of the pattern.
  std::vector<char> writes_;
  std::vector<double> values_;
  std::vector<sunindextype> column_starts_, row_indices_;  // the pattern
  std::vector<int> order_;                                 // of KLU's elimination
  int multiplier_choices_ = 0;                             // those that KLU's pivots are for
};

}  // namespace tether::scene::smooth

// Tether: whether F is of index 1 in its own variables. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <utility>

#include "start/algebraic.hpp"
#include "start/differential_index.hpp"
#include "start/nearby_residuals.hpp"
#include "start/undetermined_columns.hpp"

namespace tether::ida_projection {

namespace {

// Largest numbers of unknowns. The search for the index costs two dense Jacobians by differences.
// Beyond kLargestSize it is made only if IDA's own Jacobian is of that kind, too.
constexpr int kLargestSize = 200, kLargestDense = kLargestProbed;
constexpr double kIncrement = 1e-5;  // of y_j, against cancellation at tight tolerances

}  // namespace

// The matrix of exceeds_one() is singular if it has rows of zeros: equations of F that contain
// neither y' nor y_a, as constraints of positions and velocities do. If there are as many of them
// as algebraic variables, it determines none of these. Costs eight evaluations of F at any size.
bool AlgebraicVariables::has_rows_of_zeros(const Candidate& candidate, Corrector& corrector,
                                           double cj) {
  if (!any_ || all_) return false;
  const std::vector<char> free = derivative_free_equations(candidate, corrector, cj);
  std::vector<int> algebraic;
  for (std::size_t j = 0; j < free.size(); ++j)
    if (mask()[j] == 0.0) algebraic.push_back(static_cast<int>(j));
  std::vector<char> noticed(free.size(), 0);
  bool evaluated = false;
  for (const double size : {1.0, -1e3}) {  // F may fail at one of them
    NearbyResiduals near(candidate, corrector, statistics_,
                         NearbyResiduals::irregular_changes(candidate, cj, size));
    evaluated = near.notices(algebraic, NearbyResiduals::Of::values, noticed) || evaluated;
  }
  std::size_t zeros = 0;
  for (std::size_t i = 0; i < free.size(); ++i) zeros += free[i] != 0 && noticed[i] == 0;
  if (!evaluated || zeros == 0) return false;
  if (zeros == algebraic.size()) found_.undetermined = algebraic;
  return true;
}

// The differential variables do not depend on an output, so that their error test says nothing
// about it: no equation with y' contains it, nor an equation that shares an unknown with what such
// an equation contains. `slopes`: F_y'_j of differential and F_y_j of algebraic columns.
void AlgebraicVariables::find_outputs(const Eigen::MatrixXd& slopes) {
  const Eigen::Index n = slopes.cols();
  const double* id = mask();
  std::vector<char> acts(static_cast<std::size_t>(n), 0), known(acts);  // columns, rows
  const auto contains = [&](Eigen::Index i, bool differential, bool acting) {
    for (Eigen::Index j = 0; j < n; ++j)
      if ((id[j] != 0.0) == differential && slopes(i, j) != 0.0 &&
          (!acting || acts[static_cast<std::size_t>(j)] != 0))
        return true;
    return false;
  };
  for (bool more = true; more;) {
    more = false;
    for (Eigen::Index i = 0; i < n; ++i) {
      char& row = known[static_cast<std::size_t>(i)];
      if (row != 0 || !(contains(i, true, false) || contains(i, false, true))) continue;
      row = 1;
      more = true;
      for (Eigen::Index j = 0; j < n; ++j)
        if (id[j] == 0.0 && slopes(i, j) != 0.0) acts[static_cast<std::size_t>(j)] = 1;
    }
  }
  for (Eigen::Index j = 0; j < n; ++j)
    if (id[j] == 0.0 && acts[static_cast<std::size_t>(j)] == 0)
      found_.outputs.push_back(static_cast<int>(j));
}

// `slopes` as exceeds_one() has found them; the index needs F_y of the differential columns as
// well.
int AlgebraicVariables::index_above_one(const Candidate& candidate, Corrector& corrector, double cj,
                                        Eigen::MatrixXd slopes) {
  const Eigen::Index n = slopes.rows();
  std::vector<double> unit(static_cast<std::size_t>(n)), change(unit);
  for (std::size_t j = 0; j < unit.size(); ++j) {
    unit[j] = std::max(1.0, std::abs(candidate.base_entries[j]));
    change[j] = kIncrement * unit[j];
  }
  NearbyResiduals near(candidate, corrector, statistics_, std::move(change));
  Eigen::MatrixXd E = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    if (mask()[j] != 0.0) {
      E.col(j) = slopes.col(j) / cj;
      if (!near.slope(static_cast<int>(j), NearbyResiduals::Of::values, slopes.col(j))) return 0;
    }
    E.col(j) *= unit[static_cast<std::size_t>(j)];
    slopes.col(j) *= unit[static_cast<std::size_t>(j)];
  }
  return differential_index(std::move(E), std::move(slopes));
}

// F determines y'_d and y_a, its index is 1 at most, where the matrix of F_y'_j (j differential)
// and F_y_j (j algebraic) is regular. It is singular for multipliers of position or velocity rows
// (index 2 and 3), and where combinations of differential variables are algebraic. Algebraic
// variables that the matrix leaves free carry rounding divided by the step: they are undetermined.
bool AlgebraicVariables::exceeds_one(const Candidate& candidate, Corrector& corrector, double cj,
                                     long usual) {
  if (candidate.base_entries == nullptr) return false;
  const int size = static_cast<int>(N_VGetLength(candidate.base));
  if (size > (usual >= size ? kLargestDense : kLargestSize))
    return has_rows_of_zeros(candidate, corrector, cj);
  const double* id = mask();
  const auto differential = [id](int j) { return id == nullptr || id[j] != 0.0; };
  std::vector<double> change(static_cast<std::size_t>(size));
  for (int j = 0; j < size; ++j) {
    const double w = candidate.weight_entries[j];
    change[static_cast<std::size_t>(j)] = std::max(
        w > 0.0 ? 1.0 / w : 1.0,
        differential(j) ? 1e-3 / std::abs(cj) : kIncrement * std::abs(candidate.base_entries[j]));
  }
  NearbyResiduals near(candidate, corrector, statistics_, std::move(change));
  bool known = near.known();
  Eigen::MatrixXd slopes(size, size);
  for (int j = 0; j < size && known; ++j) {
    using Of = NearbyResiduals::Of;
    known = near.slope(j, differential(j) ? Of::rates : Of::values, slopes.col(j));
    if (known && differential(j) && slopes.col(j).isZero(0.0))
      found_.without_derivative.push_back(j);
  }
  found_.known = known;  // else the next run tries again
  if (known && id != nullptr) find_outputs(slopes);
  const std::vector<char> left = known ? undetermined_columns(slopes, true) : std::vector<char>();
  if (!left.empty() && id != nullptr && size <= kLargestSize)
    found_.index = index_above_one(candidate, corrector, cj, std::move(slopes));
  for (int j = 0; id != nullptr && j < static_cast<int>(left.size()); ++j)
    if (left[static_cast<std::size_t>(j)] && id[j] == 0.0) found_.undetermined.push_back(j);
  return !left.empty();
}

void AlgebraicVariables::find_index(const Candidate& candidate, Corrector& corrector, double cj,
                                    long usual) {
  index_known_ = true;
  if (found_.known) return;
  found_.known = true;
  found_.without_derivative.clear();
  found_.index = 0;
  found_.high = exceeds_one(candidate, corrector, cj, usual);
}

// Coupled ones are not tested where F is of higher index and does not tell which it leaves free.
bool AlgebraicVariables::choose_tested(bool coupled) {
  coupled_.clear();
  if (!any_ || !found_.known || !is_contiguous(id_)) return false;
  tested_ = OwnedVector(static_cast<N_Vector>(id_));
  N_VScale(1.0, id_, tested_);
  double* tested = N_VGetArrayPointer(tested_);
  for (const int j : found_.outputs) tested[j] = 1.0;
  if (!coupled || (found_.high && found_.undetermined.empty())) return true;
  std::vector<char> free(static_cast<std::size_t>(N_VGetLength(id_)), 0);
  for (const int j : found_.undetermined) free[static_cast<std::size_t>(j)] = 1;
  for (std::size_t j = 0; j < free.size(); ++j) {
    if (free[j] != 0 || tested[j] != 0.0) continue;
    coupled_.push_back(static_cast<int>(j));
    tested[j] = 1.0;
  }
  return true;
}

}  // namespace tether::ida_projection

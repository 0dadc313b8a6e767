// Tether: whether F is of index 1 in its own variables. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "start/algebraic.hpp"
#include "start/differential_index.hpp"
#include "start/undetermined_columns.hpp"

namespace tether::ida_projection {

namespace {

// Unknowns. Beyond the first size the look would be felt, except where each Jacobian of IDA takes
// as many evaluations as there are unknowns, and dense factors: it costs two of these.
constexpr int kLargestSize = 200, kLargestDense = 2000;
constexpr double kIncrement = 1e-5;  // of y_j, against cancellation at tight tolerances

}  // namespace

// The matrix of exceeds_one() is singular where it has rows of zeros: equations of F that contain
// neither y' nor y_a, as those of positions and velocities. Where there are as many of them as
// algebraic variables, it leaves all of these free. Eight evaluations of F, of any size.
bool AlgebraicVariables::has_rows_of_zeros(const Candidate& candidate, Corrector& corrector,
                                           double cj) {
  if (!any_ || all_) return false;
  std::vector<char> zero = derivative_free_equations(candidate, corrector, cj);
  const std::size_t n = zero.size();
  OwnedVector none(candidate.base), base(candidate.base), other(candidate.base),
      saved(candidate.base);
  N_VScale(1.0, candidate.base, saved);
  N_VConst(0.0, none);
  const double* original = N_VGetArrayPointer(saved);
  const auto residual = [&](N_Vector into) {
    ++statistics_.residual_evaluations;
    return corrector.residual(none, into) == 0;
  };
  bool known = residual(base), answered = false;
  for (const double size : {1.0, -1e3}) {
    for (std::size_t j = 0; j < n; ++j) {
      if (mask()[j] != 0.0) continue;
      const double w = candidate.weight_entries[j];
      const double irregular = 1.5 + 0.5 * std::sin(1.0 + 2.3 * static_cast<double>(j));
      candidate.base_entries[j] =
          original[j] +
          size * irregular * std::max(w > 0.0 ? 1.0 / w : 1.0, kIncrement * std::abs(original[j]));
    }
    const bool evaluated = residual(other);
    N_VScale(1.0, saved, candidate.base);
    if (!evaluated) continue;  // F refuses these y; the other size decides
    answered = true;
    for (std::size_t i = 0; i < n; ++i)
      zero[i] = zero[i] && N_VGetArrayPointer(base)[i] == N_VGetArrayPointer(other)[i];
  }
  const auto zeros = std::count(zero.begin(), zero.end(), 1);
  if (!known || !answered || zeros == 0) return false;
  for (std::size_t j = 0; j < n; ++j)
    if (mask()[j] == 0.0) found_.undetermined.push_back(static_cast<int>(j));
  if (static_cast<std::size_t>(zeros) != found_.undetermined.size()) found_.undetermined.clear();
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
  OwnedVector none(candidate.base), before(candidate.base), after(candidate.base);
  N_VConst(0.0, none);
  const auto residual = [&](N_Vector into) {
    ++statistics_.residual_evaluations;
    return corrector.residual(none, into) == 0;
  };
  const Eigen::Map<const Eigen::VectorXd> low(N_VGetArrayPointer(before), n),
      high(N_VGetArrayPointer(after), n);
  Eigen::MatrixXd E = Eigen::MatrixXd::Zero(n, n);
  bool known = residual(before);
  for (Eigen::Index j = 0; j < n && known; ++j) {
    double& y = candidate.base_entries[j];
    const double present = y, unit = std::max(1.0, std::abs(present)), change = kIncrement * unit;
    if (mask()[j] != 0.0) {
      E.col(j) = slopes.col(j) / cj;
      y = present + change;
      known = residual(after);
      y = present;
      slopes.col(j) = (high - low) / change;
    }
    E.col(j) *= unit;
    slopes.col(j) *= unit;
  }
  return known ? differential_index(std::move(E), std::move(slopes)) : 0;
}

// F determines y'_d and y_a, its index is 1 at most, where the matrix of F_y'_j (j differential)
// and F_y_j (j algebraic) is regular. It is singular for multipliers of position or velocity rows
// (index 2 and 3), and where combinations of differential variables are algebraic. The columns are
// differences of IDA's own residual callback, F(t, ypred + ycor, yppred + cj ycor), with ypred
// shifted by -ycor (and put back bit for bit) where only y' is to feel ycor. Algebraic variables
// that the matrix leaves free carry rounding divided by the step: they are undetermined.
bool AlgebraicVariables::exceeds_one(const Candidate& candidate, Corrector& corrector, double cj,
                                     long usual) {
  if (candidate.base_entries == nullptr) return false;
  const int size = static_cast<int>(N_VGetLength(candidate.base));
  if (size > (usual >= size ? kLargestDense : kLargestSize))
    return has_rows_of_zeros(candidate, corrector, cj);
  OwnedVector ycor(candidate.base), base(candidate.base), shifted(candidate.base),
      saved(candidate.base);
  N_VConst(0.0, ycor);
  N_VScale(1.0, candidate.base, saved);
  double* e = N_VGetArrayPointer(ycor);
  double* predicted = N_VGetArrayPointer(candidate.base);
  const double* original = N_VGetArrayPointer(saved);
  const double* w = N_VGetArrayPointer(candidate.weights);
  const double* before = N_VGetArrayPointer(base);
  const double* after = N_VGetArrayPointer(shifted);
  const double* id = mask();
  const auto residual = [&](N_Vector into) {
    ++statistics_.residual_evaluations;
    return corrector.residual(ycor, into) == 0;
  };

  bool known = true;
  Eigen::MatrixXd slopes(size, size);
  for (int j = 0; j < size && known; ++j) {
    const bool differential = id == nullptr || id[j] != 0.0;
    const double tolerance = w[j] > 0.0 ? 1.0 / w[j] : 1.0;
    const double change = std::max(
        tolerance, differential ? 1e-3 / std::abs(cj) : kIncrement * std::abs(original[j]));
    const double low = differential ? original[j] - change : original[j];
    predicted[j] = differential ? low + change : low;  // F sees this y_j twice, bit for bit
    known = residual(base);
    predicted[j] = low;
    e[j] = change;
    known = residual(shifted) && known;
    e[j] = 0.0;
    predicted[j] = original[j];
    for (int i = 0; i < size; ++i) slopes(i, j) = (after[i] - before[i]) / change;
    if (differential && known && slopes.col(j).isZero(0.0)) found_.without_derivative.push_back(j);
  }
  N_VScale(1.0, saved, candidate.base);
  found_.known = known;  // else the next run asks again
  if (known && id != nullptr) find_outputs(slopes);
  const std::vector<char> left = known ? undetermined_columns(slopes, true) : std::vector<char>();
  if (!left.empty() && id != nullptr && size <= kLargestSize)
    found_.index = index_above_one(candidate, corrector, cj, std::move(slopes));
  for (int j = 0; id != nullptr && j < static_cast<int>(left.size()); ++j)
    if (left[static_cast<std::size_t>(j)] && id[j] == 0.0) found_.undetermined.push_back(j);
  return !left.empty();
}

void AlgebraicVariables::look_at_index(const Candidate& candidate, Corrector& corrector, double cj,
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

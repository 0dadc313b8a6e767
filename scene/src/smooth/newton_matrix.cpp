// Tether: IDA's matrix of a smooth system and its solver. SPDX-License-Identifier: BSD-3-Clause
#include "newton_matrix.hpp"

#include <sunmatrix/sunmatrix_dense.h>

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <numeric>
#include <random>

#ifdef TETHER_SCENE_KLU
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>
#endif

#include "mechanics/frames.hpp"
#include "smooth/rows/moving_bodies.hpp"

namespace tether::scene::smooth {

using mechanics::at;

namespace {

using Graph = Eigen::SparseMatrix<char, Eigen::ColMajor, int>;

/// Bodies of each multiplier: the two of its joint, -1 where there are fewer.
using Ends = std::vector<std::pair<int, int>>;

// When each body is eliminated.
std::vector<int> times_of_bodies(int bodies, std::vector<Eigen::Triplet<char>>& edges) {
  Graph graph(bodies, bodies);
  const auto once = [](char a, char) { return a; };
  graph.setFromTriplets(edges.begin(), edges.end(), once);
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(graph.selfadjointView<Eigen::Lower>(), order);
  std::vector<int> time(at(bodies));
  for (int k = 0; k < bodies; ++k) time[at(order.indices()[k])] = k;
  return time;
}

// SUNDIALS calls KLU's singular matrix unrecoverable, and its next setups want the factors that
// were not made. A predictor may meet a singular position exactly; another step passes by.
int factor_or_try_smaller_step(SUNLinearSolver solver, SUNMatrix matrix) {
  if (SUNLinSolSetup_KLU(solver, matrix) == 0) return 0;
  SUNLinSol_KLUReInit(solver, matrix, 0, SUNKLU_REINIT_PARTIAL);
  return 1;
}

// The order that is the user_data of KLU's settings. Nothing is said about the fill.
template <class Int, class Common>
Int given_order(Int count, Int*, Int*, Int* order, Common* settings) {
  const auto& given = *static_cast<const std::vector<int>*>(settings->user_data);
  if (count != static_cast<Int>(given.size())) return 0;
  std::copy(given.begin(), given.end(), order);
  return -1;
}

// KLU's own orders serve any matrix. AMD takes multipliers, whose diagonal is zero, before their
// bodies; pivots then leave its order, and the fill is large. COLAMD leaves the diagonal from the
// start.
void use_order(SUNLinearSolver solver, std::vector<int>& order) {
  auto* settings = SUNLinSol_KLUGetCommon(solver);
  settings->ordering = 3;  // our own
  settings->btf = 0;
  settings->user_order = given_order;
  settings->user_data = &order;
}

}  // namespace

std::vector<int> elimination_order(int unknowns, int bodies, int width, int coordinates,
                                   const std::vector<std::pair<int, int>>& places) {
  const int first = width * bodies;
  Ends ends(at(unknowns - first), {-1, -1});
  std::vector<Eigen::Triplet<char>> edges;
  const auto join = [&](int a, int b) {
    if (a != b) edges.emplace_back(std::max(a, b), std::min(a, b), char(1));
  };
  const auto touch = [&](int multiplier, int body) {
    auto& [a, b] = ends[at(multiplier - first)];
    if (a < 0) a = body;
    if (a != body && b < 0) b = body;
  };
  for (const auto& [row, column] : places) {
    if (row < first && column < first)
      join(row / width, column / width);
    else if (row < first)
      touch(column, row / width);
  }
  for (const auto& [a, b] : ends)
    if (a >= 0 && b >= 0) join(a, b);
  for (int body = 0; body < bodies; ++body) edges.emplace_back(body, body, char(1));
  const std::vector<int> time = times_of_bodies(bodies, edges);

  // Coordinates first; of each other unknown the time of its body; multipliers come behind the
  // later one's unknowns.
  std::vector<std::pair<int, int>> when(at(unknowns));
  for (int i = 0; i < unknowns; ++i) {
    int instant = std::numeric_limits<int>::max();
    if (i < first && i % width < coordinates) {
      instant = -1;
    } else if (i < first) {
      instant = time[at(i / width)];
    } else if (const auto [a, b] = ends[at(i - first)]; a >= 0) {
      instant = std::max(time[at(a)], b >= 0 ? time[at(b)] : 0);
    }
    when[at(i)] = {instant, i};
  }
  std::sort(when.begin(), when.end());
  std::vector<int> order(at(unknowns));
  std::transform(when.begin(), when.end(), order.begin(), [](const auto& w) { return w.second; });
  return order;
}

NewtonMatrix::NewtonMatrix(System& system, double t, N_Vector y, N_Vector yp, SUNContext context)
    : system_(system) {
  entries_.record();
  system_.jacobian(t, 1.0, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), entries_);
#ifdef TETHER_SCENE_KLU
  if (system_.size() >= kManyUnknowns) {
    make_sparse(t, y, yp, context);
    return;
  }
#endif
  make_dense(y, context);
}

void NewtonMatrix::make_dense(N_Vector y, SUNContext context) {
  const int N = system_.size();
  const auto& places = entries_.places;
  std::vector<int> slots(places.size());
  for (std::size_t k = 0; k < places.size(); ++k) slots[k] = places[k].first + N * places[k].second;
  matrix_.reset(SUNDenseMatrix(N, N, context));
  solver_ = dense_solver(y, matrix(), context);
  entries_.finish(std::move(slots));
}

#ifdef TETHER_SCENE_KLU
void NewtonMatrix::make_sparse(double t, N_Vector y, N_Vector yp, SUNContext context) {
  const int N = system_.size();
  writes_.assign(entries_.places.size(), 0);
  find_entries_nearby(t, y, yp);
  arrange();
  matrix_.reset(
      SUNSparseMatrix(N, N, static_cast<sunindextype>(row_indices_.size()), CSC_MAT, context));
  solver_.reset(SUNLinSol_KLU(y, matrix(), context));
  if (!order_.empty()) use_order(solver(), order_);
  solver_->ops->setup = factor_or_try_smaller_step;
}

// Entries that are zero at the start, where all may lie in a plane or rest, are seen at two states
// nearby.
void NewtonMatrix::find_entries_nearby(double t, N_Vector y, N_Vector yp) {
  const double *state = N_VGetArrayPointer(y), *rate = N_VGetArrayPointer(yp);
  const std::vector<double> y0(state, state + system_.size()), yp0(rate, rate + system_.size());
  std::mt19937 random(1);
  const auto moved = [&](std::vector<double> x) {
    for (double& value : x)
      value += 0.25 * (random() / 2147483648.0 - 1.0) * std::max(1.0, std::abs(value));
    return x;
  };
  for (const double cj : {1.0, 0.7}) {
    const std::vector<double> near_y = moved(y0), near_yp = moved(yp0);
    note_written(t, cj, near_y, near_yp);
  }
  note_written(t, 1.0, y0, yp0);  // last: the system is left as it was
}

void NewtonMatrix::note_written(double t, double cj, const std::vector<double>& y,
                                const std::vector<double>& yp) {
  std::vector<double> written(writes_.size(), 0.0);
  std::vector<int> one_by_one(writes_.size());
  std::iota(one_by_one.begin(), one_by_one.end(), 0);
  entries_.finish(std::move(one_by_one));
  entries_.begin(written.data());
  system_.jacobian(t, cj, y.data(), yp.data(), entries_);
  for (std::size_t k = 0; k < written.size(); ++k)
    if (written[k] != 0.0) writes_[k] = 1;
}

// The pattern of what is written, and an order of elimination for it.
void NewtonMatrix::arrange() {
  const auto N = static_cast<std::size_t>(system_.size());
  const auto& places = entries_.places;
  std::vector<std::size_t> ends(N + 1, 0);  // of the calls of each column, first their number
  for (std::size_t k = 0; k < places.size(); ++k)
    if (writes_[k] != 0) ++ends[static_cast<std::size_t>(places[k].second) + 1];
  std::partial_sum(ends.begin(), ends.end(), ends.begin());
  std::vector<std::pair<int, int>> calls(ends.back());  // row, call
  for (std::size_t k = 0; k < places.size(); ++k)
    if (writes_[k] != 0)
      calls[ends[static_cast<std::size_t>(places[k].second)]++] = {places[k].first,
                                                                   static_cast<int>(k)};
  row_indices_.clear();
  column_starts_.assign(N + 1, 0);
  std::vector<int> slots(places.size(), -1);
  std::vector<std::pair<int, int>> written;
  std::size_t begin = 0;
  for (std::size_t column = 0; column < N; begin = ends[column++]) {
    std::sort(calls.begin() + static_cast<std::ptrdiff_t>(begin),
              calls.begin() + static_cast<std::ptrdiff_t>(ends[column]));
    for (std::size_t k = begin; k < ends[column]; ++k) {
      if (k == begin || calls[k].first != calls[k - 1].first) {
        row_indices_.push_back(calls[k].first);
        written.emplace_back(calls[k].first, static_cast<int>(column));
      }
      slots[static_cast<std::size_t>(calls[k].second)] = static_cast<int>(row_indices_.size()) - 1;
    }
    column_starts_[column + 1] = static_cast<sunindextype>(row_indices_.size());
  }
  std::size_t behind = row_indices_.size();
  for (int& slot : slots)
    if (slot < 0) slot = static_cast<int>(behind++);
  values_.assign(behind, 0.0);
  entries_.finish(std::move(slots));
  if (by_entries(system_.rows(), system_.moving()))
    order_ = elimination_order(static_cast<int>(N), system_.moving(), kBody, kVelocity, written);
}

// Has anything been written behind the pattern? Then it belongs to it from here on.
bool NewtonMatrix::grow() {
  const auto behind = values_.begin() + static_cast<std::ptrdiff_t>(row_indices_.size());
  if (std::all_of(behind, values_.end(), [](double value) { return value == 0.0; })) return false;
  for (std::size_t k = 0; k < writes_.size(); ++k)
    if (values_[static_cast<std::size_t>(entries_.slots()[k])] != 0.0) writes_[k] = 1;
  arrange();
  return true;
}
#endif

void NewtonMatrix::fill(double t, double cj, N_Vector y, N_Vector yp, SUNMatrix J) {
  const auto write = [&](double* values) {
    entries_.begin(values);
    system_.jacobian(t, cj, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), entries_);
  };
#ifdef TETHER_SCENE_KLU
  if (!row_indices_.empty()) {
    const auto write_all = [&] {
      std::fill_n(values_.begin(), row_indices_.size(), 0.0);
      write(values_.data());
    };
    write_all();
    const bool grows = grow();
    if (grows) {
      write_all();
      SUNSparseMatrix_Reallocate(J, static_cast<sunindextype>(row_indices_.size()));
    }
    std::copy(column_starts_.begin(), column_starts_.end(), SUNSparseMatrix_IndexPointers(J));
    std::copy(row_indices_.begin(), row_indices_.end(), SUNSparseMatrix_IndexValues(J));
    std::copy_n(values_.begin(), row_indices_.size(), SUNSparseMatrix_Data(J));
    if (grows || multiplier_choices_ != system_.multiplier_choices())
      SUNLinSol_KLUReInit(solver(), J, 0, SUNKLU_REINIT_PARTIAL);  // other pivots
    multiplier_choices_ = system_.multiplier_choices();
    return;
  }
#endif
  SUNMatZero(J);
  write(SUNDenseMatrix_Data(J));
}

}  // namespace tether::scene::smooth

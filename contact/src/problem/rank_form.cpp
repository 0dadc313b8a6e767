// Tether: a factor of a dense Delassus matrix of small rank. SPDX-License-Identifier: BSD-3-Clause
#include "problem/rank_form.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace tether::contact::detail {

using Eigen::Index;
using linalg::at;
using linalg::PackedBlock;

std::shared_ptr<const BodyForm> rank_form(const Problem& problem, int most_rank) {
  // Rest of a diagonal entry, relative to it, at which the rank is reached: A comes with the
  // round-off of the mechanism's equations.
  constexpr double kLeft = 1e-12;
  const int contacts = problem.contacts();
  const Index n = 3 * Index{contacts};
  const std::vector<int>& start = problem.row_start();
  const std::vector<int>& columns = problem.columns();
  // A row, which is the column.
  const auto read = [&](Index row, Eigen::Ref<Eigen::VectorXd> out) {
    out.setZero();
    const std::size_t i = at(static_cast<int>(row / 3));
    for (std::size_t k = at(start[i]); k < at(start[i + 1]); ++k)
      for (int c = 0; c < 3; ++c)
        out[3 * Index{columns[k]} + c] = problem.blocks()[k].column[4 * c + row % 3];
  };

  Eigen::VectorXd diagonal(n);
  for (int i = 0; i < contacts; ++i) {
    const auto row = columns.begin() + start[at(i)];
    const auto k = std::lower_bound(row, columns.begin() + start[at(i + 1)], i) - columns.begin();
    for (int c = 0; c < 3; ++c)
      diagonal[3 * Index{i} + c] = problem.blocks()[static_cast<std::size_t>(k)].column[5 * c];
  }
  Eigen::VectorXd left = diagonal;
  Eigen::MatrixXd H(n, std::min(32, most_rank));
  Index rank = 0;
  for (;; ++rank) {
    Index pivot = 0;
    double share = 0;
    for (Index i = 0; i < n; ++i) {
      if (!(left[i] > share * diagonal[i])) continue;
      share = left[i] / diagonal[i];
      pivot = i;
    }
    if (!(share > kLeft)) break;
    if (rank == most_rank) return nullptr;
    if (rank == H.cols()) H.conservativeResize(n, std::min<Index>(2 * rank, most_rank));
    auto column = H.col(rank);
    read(pivot, column);
    column.noalias() -= H.leftCols(rank) * H.row(pivot).head(rank).transpose();
    column /= std::sqrt(left[pivot]);
    left -= column.cwiseAbs2();
    left[pivot] = 0;
    if (!column.allFinite()) return nullptr;
  }

  auto form = std::make_shared<BodyForm>();
  form->nodes = static_cast<int>((rank + 2) / 3);
  for (int i = 0; i < contacts; ++i) {
    for (int k = 0; k < form->nodes; ++k) {
      PackedBlock block;
      for (int c = 0; c < 3 && 3 * k + c < rank; ++c)
        for (int r = 0; r < 3; ++r) block.column[4 * c + r] = H(3 * Index{i} + r, 3 * Index{k} + c);
      form->add(k, block);
    }
    form->end_contact();
  }
  return form;
}

}  // namespace tether::contact::detail

// Tether: solutions with the factors at hand, on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
#include "contiguous_mover.hpp"

namespace tether::ida_projection {

template <class Rows>
bool ContiguousMover<Rows>::solve_with_factors(const std::vector<double>& g,
                                               std::vector<double>& dy) {
  if (g.size() != static_cast<std::size_t>(rows_.count())) return false;
  Rows& blocks = rows_.blocks;
  blocks.solve_roughly(g);
  std::fill(dy.begin(), dy.end(), 0.0);
  for (const auto* block : {&blocks.d, &blocks.a})
    if (!block->rows.empty())
      block->for_columns([&dy, from = block->dy.data()](int k, int i) {
        dy[static_cast<std::size_t>(i)] = from[k];
      });
  return true;
}

template <class Rows>
bool ContiguousMover<Rows>::solve_at(const Candidate& candidate, double* dy) {
  rows_.at.y.swap(elsewhere_);
  rows_.at.y.resize(elsewhere_.size());
  rows_.at.restart(candidate);
  const bool known = rows_.value(candidate.t) == Status::success;
  if (known) {
    rows_.look();
    std::fill(dy, dy + elsewhere_.size(), 0.0);
    const auto& block = rows_.blocks.d;
    block.for_columns([&](int k, int i) { dy[i] = block.dy[static_cast<std::size_t>(k)]; });
  }
  rows_.at.y.swap(elsewhere_);
  return known;
}

template bool ContiguousMover<DenseRows>::solve_with_factors(const std::vector<double>&,
                                                             std::vector<double>&);
template bool ContiguousMover<SparseRows>::solve_with_factors(const std::vector<double>&,
                                                              std::vector<double>&);
template bool ContiguousMover<DenseRows>::solve_at(const Candidate&, double*);
template bool ContiguousMover<SparseRows>::solve_at(const Candidate&, double*);

}  // namespace tether::ida_projection

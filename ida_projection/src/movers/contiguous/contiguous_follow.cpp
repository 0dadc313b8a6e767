// Tether: a move with factors of an earlier step, on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
#include "contiguous_mover.hpp"

namespace tether::ida_projection {

template <class Rows>
Move ContiguousMover<Rows>::follow(const Candidate& candidate, bool again) {
  rows_.at.load(candidate);
  if (!again) {
    rows_.set_metric(false);
    ++kept_.age;
    rows_.factors.decided = false;
    misdirection_.look(candidate.t);
  }
  const auto allows = [&] { return again || misdirection_.allows(in_metric(nullptr)); };
  return move_with_old_factors(
      wear_, [&] { return rows_.value(candidate.t); }, [&] { return rows_.solve(); },
      [&] { rows_.apply(1.0, candidate.correction_entries); }, [&] { return rows_.drift(); },
      allows, misdirection_.far(), 1e2 * kEpsilon * rows_.at.size(), options_.largest_move,
      kMayFollowLeave);
}

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

// rms of dy_i / D_i over the columns that count, dy the present move less `other`, null or a move.
template <class Rows>
double ContiguousMover<Rows>::in_metric(const std::vector<double>* other) {
  double sum = 0.0;
  std::size_t before = 0;
  rows_.visit_counted([&](auto& block) {
    const double* D = block.D();
    for (std::size_t k = 0; k < block.dy.size(); ++k) {
      const double dy = block.dy[k] - (other != nullptr ? (*other)[before + k] : 0.0);
      if (D[k] > 0.0) sum += (dy / D[k]) * (dy / D[k]);
    }
    before += block.dy.size();
  });
  return rows_.wrms(sum);
}

// The move that the factors of an earlier candidate make for g at hand, in their own metric.
template <class Rows>
void ContiguousMover<Rows>::keep_old_move(double t) {
  old_move_.clear();
  misdirection_.look(t);
  if (reused_ || !rows_.factors.there || rows_.factors.thin) return;
  rows_.look();
  rows_.visit_counted([this](const auto& block) {
    old_move_.insert(old_move_.end(), block.dy.begin(), block.dy.end());
  });
}

// After the first solve() with the factors of this candidate.
template <class Rows>
void ContiguousMover<Rows>::compare_with_old_move() {
  std::size_t size = 0;
  rows_.visit_counted([&size](const auto& block) { size += block.dy.size(); });
  if (old_move_.size() == size) misdirection_.measured(in_metric(&old_move_), in_metric(nullptr));
  old_move_.clear();
}

template Move ContiguousMover<RowBlocks>::follow(const Candidate&, bool);
template Move ContiguousMover<SparseRows>::follow(const Candidate&, bool);
template bool ContiguousMover<RowBlocks>::solve_with_factors(const std::vector<double>&,
                                                             std::vector<double>&);
template bool ContiguousMover<SparseRows>::solve_with_factors(const std::vector<double>&,
                                                              std::vector<double>&);
template bool ContiguousMover<RowBlocks>::solve_at(const Candidate&, double*);
template bool ContiguousMover<SparseRows>::solve_at(const Candidate&, double*);
template double ContiguousMover<RowBlocks>::in_metric(const std::vector<double>*);
template double ContiguousMover<SparseRows>::in_metric(const std::vector<double>*);
template void ContiguousMover<RowBlocks>::keep_old_move(double);
template void ContiguousMover<SparseRows>::keep_old_move(double);
template void ContiguousMover<RowBlocks>::compare_with_old_move();
template void ContiguousMover<SparseRows>::compare_with_old_move();

}  // namespace tether::ida_projection

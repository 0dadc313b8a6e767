// Tether: solves of the parts of a problem where sweeps do not settle. SPDX-License-Identifier:
// BSD-3-Clause

#include <algorithm>
#include <cmath>

#include "assembled/automatic.hpp"

namespace tether::contact::detail {

namespace {

// Entries of place_ for contacts that are not yet in a part, or in none.
enum : int { reached_only = -2, outside };

}  // namespace

struct LocalSolves::Part {
  Search search;
  Automatic automatic;
};

LocalSolves::LocalSolves() = default;
LocalSolves::~LocalSolves() = default;

void LocalSolves::reset(int contacts) {
  n_ = contacts;
  layers_ = 1;
  refused_ = 0;
  most_ = 0;
  solved_ = false;
  error_.resize(at(n_));
  place_.resize(at(n_));
}

// False: there is nothing to solve.
bool LocalSolves::find_errors(Search& search, const Packed& x) {
  most_ = search.errors(x.data(), error_.data());
  return most_ > 0 && std::isfinite(most_);
}

// The contacts that are connected with `seed` through reached ones, unless they are too many.
void LocalSolves::add_part(const Problem& p, int seed, int largest) {
  if (place_[at(seed)] != reached_only) return;
  const std::size_t first = list_.size();
  list_.push_back(seed);
  place_[at(seed)] = 0;
  for (std::size_t k = first; k < list_.size(); ++k)
    for (int q = p.row_start()[at(list_[k])]; q < p.row_start()[at(list_[k] + 1)]; ++q) {
      const int j = p.columns()[at(q)];
      if (place_[at(j)] != reached_only) continue;
      place_[at(j)] = 0;
      list_.push_back(j);
    }
  if (static_cast<int>(list_.size() - first) > largest) {
    list_.resize(first);
    return;
  }
  std::sort(list_.begin() + static_cast<std::ptrdiff_t>(first), list_.end());
  start_.push_back(static_cast<int>(list_.size()));
}

// Parts: connected sets of contacts with an error near the largest and of `layers_` of neighbours.
// False: there are none small enough.
bool LocalSolves::find_parts(Search& search, const Packed& x) {
  constexpr int kLargest = 300;  // contacts of a part
  const Problem& p = search.system.problem();
  if (!find_errors(search, x)) return false;
  // Solving some contacts only disturbs the others if many have errors of one size. But if sweeps
  // do not settle for long, a part may be unstable by itself: each refusal lets more contacts count
  // as few.
  constexpr double kNearLargest = 0.1, kFew = 0.03;
  int many = 0;
  for (double e : error_) many += e > kNearLargest * most_;
  if (many > kFew * (1 + refused_) * n_) {
    ++refused_;
    return false;
  }
  for (double cut : {0.3, 0.6, 0.9}) {
    std::fill(place_.begin(), place_.end(), outside);
    std::vector<int> reached;
    for (int i = 0; i < n_; ++i)
      if (error_[at(i)] > cut * most_) reached.push_back(i);
    for (int i : reached) place_[at(i)] = reached_only;
    std::size_t begin = 0;
    for (int layer = 0; layer < layers_; ++layer) {
      const std::size_t end = reached.size();
      for (; begin < end; ++begin)
        for (int k = p.row_start()[at(reached[begin])]; k < p.row_start()[at(reached[begin] + 1)];
             ++k) {
          const int j = p.columns()[at(k)];
          if (place_[at(j)] != outside) continue;
          place_[at(j)] = reached_only;
          reached.push_back(j);
        }
    }
    if (static_cast<int>(reached.size()) > n_ / 3) continue;
    list_.clear();
    start_.assign(1, 0);
    for (int seed : reached) add_part(p, seed, kLargest);
    if (start_.size() > 1) return true;
  }
  return false;
}

bool LocalSolves::solve_part(Search& search, int part, double budget, Packed& x) {
  constexpr double kGain = 1e-3, kEnough = 0.3;  // of the error, of the tolerance
  const System& system = search.system;
  const Problem& p = system.problem();
  const int first = start_[at(part)], m = start_[at(part + 1)] - first;
  const int* contacts = list_.data() + first;
  std::fill(place_.begin(), place_.end(), outside);
  for (int r = 0; r < m; ++r) place_[at(contacts[r])] = r;
  std::vector<MatrixBlock> blocks;
  Eigen::VectorXd b(3 * m), mu(m);
  Packed start(at(m));
  for (int r = 0; r < m; ++r) {
    const int i = contacts[r];
    // Long sums: held impulses of heavy bodies nearly cancel.
    long double rest[3];
    for (int q = 0; q < 3; ++q) rest[q] = p.packed_b()[at(i)].v[q];
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const int j = p.columns()[at(k)];
      const double* A = p.blocks()[at(k)].column;
      if (place_[at(j)] < 0) {
        for (int c = 0; c < 3; ++c)
          for (int q = 0; q < 3; ++q)
            rest[q] -= static_cast<long double>(A[4 * c + q]) * x[at(j)].v[c];
        continue;
      }
      MatrixBlock block{r, place_[at(j)], Eigen::Matrix3d()};
      for (int c = 0; c < 3; ++c)
        for (int q = 0; q < 3; ++q) block.value(q, c) = A[4 * c + q];
      blocks.push_back(block);
    }
    for (int q = 0; q < 3; ++q) b[3 * r + q] = static_cast<double>(rest[q]);
    mu[r] = p.mu(i);
    start[at(r)] = x[at(i)];
  }
  search.counts.work += 200.0 * static_cast<double>(blocks.size());
  if (!b.allFinite()) return false;
  const Problem problem = Problem::sparse(3, std::move(blocks), b, mu);
  Options options = search.options;
  options.measure = Measure::fixed_point;
  options.tolerance = std::max(kGain * most_, kEnough * search.options.tolerance);
  options.max_work = budget;
  Search& local = part_->search;
  local.reset(problem, options);
  local.system.belong_to(system, contacts);
  local.system.share_as(system, contacts);
  local.system.to_own_units(start.data());
  part_->automatic.reset(m, options);
  const bool solved = part_->automatic.run_part(local, start) == Status::solved;
  search.counts.add(local.counts);
  if (!solved) return false;
  local.system.to_given_units(local.best.data());
  for (int r = 0; r < m; ++r) x[at(contacts[r])] = local.best[at(r)];
  return true;
}

bool LocalSolves::run(Search& search, Packed& x, double budget) {
  constexpr int kMostLayers = 3;
  const double before = most_;
  if (!find_parts(search, x)) return false;
  // An error that comes back after its part was solved depends on more neighbours.
  if (solved_ && most_ < 0.5 * before)
    layers_ = 1;
  else if (solved_)
    layers_ = std::min(kMostLayers, layers_ + 1);
  if (!part_) part_ = std::make_unique<Part>();
  bool any = false;
  for (int part = 0; part + 1 < static_cast<int>(start_.size()) && !search.exhausted(); ++part) {
    if (solve_part(search, part, budget, x)) any = true;
  }
  if (!any) layers_ = layers_ > 1 ? layers_ - 1 : 2;
  solved_ = any;
  return any;
}

}  // namespace tether::contact::detail

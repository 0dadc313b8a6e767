// Tether: solves of the parts of a problem where sweeps do not settle. SPDX-License-Identifier:
// BSD-3-Clause

#include <algorithm>
#include <cmath>

#include "assembled/automatic.hpp"

namespace tether::contact::detail {

namespace {

// Entries of place_ for contacts that are not yet in a part, or in none.
enum : int { reached = -2, outside };

template <class Visit>
void each_neighbour(const Problem& p, int i, const Visit& visit) {
  for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) visit(p.columns()[at(k)]);
}

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

// The contacts that are connected with `seed` through reached ones, unless they are too many.
void LocalSolves::add_part(const Problem& p, int seed) {
  constexpr std::size_t kLargest = 300;  // contacts of a part
  if (place_[at(seed)] != reached) return;
  std::vector<int> part{seed};
  place_[at(seed)] = 0;
  for (std::size_t k = 0; k < part.size(); ++k)
    each_neighbour(p, part[k], [&](int j) {
      if (place_[at(j)] != reached) return;
      place_[at(j)] = 0;
      part.push_back(j);
    });
  if (part.size() > kLargest) return;
  std::sort(part.begin(), part.end());
  parts_.push_back(std::move(part));
}

// Parts: connected sets of contacts with an error near the largest and of `layers_` of neighbours.
// False: there are none small enough.
bool LocalSolves::find_parts(Search& search, const Packed& x) {
  const Problem& p = search.system.problem();
  most_ = search.errors(x.data(), error_.data());
  if (!(most_ > 0 && std::isfinite(most_))) return false;
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
    std::vector<int> list;
    const auto reach = [&](int i) {
      if (place_[at(i)] != outside) return;
      place_[at(i)] = reached;
      list.push_back(i);
    };
    for (int i = 0; i < n_; ++i)
      if (error_[at(i)] > cut * most_) reach(i);
    std::size_t begin = 0;
    for (int layer = 0; layer < layers_; ++layer)
      for (const std::size_t end = list.size(); begin < end; ++begin)
        each_neighbour(p, list[begin], reach);
    if (static_cast<int>(list.size()) > n_ / 3) continue;
    parts_.clear();
    for (int seed : list) add_part(p, seed);
    if (!parts_.empty()) return true;
  }
  return false;
}

bool LocalSolves::solve_part(Search& search, const std::vector<int>& contacts, double budget,
                             Packed& x) {
  constexpr double kGain = 1e-3, kEnough = 0.3;  // of the error, of the tolerance
  const Problem& p = search.system.problem();
  const int m = static_cast<int>(contacts.size());
  std::fill(place_.begin(), place_.end(), outside);
  for (int r = 0; r < m; ++r) place_[at(contacts[at(r)])] = r;
  std::vector<MatrixBlock> blocks;
  Eigen::VectorXd b(3 * m), mu(m);
  Packed start;
  for (int r = 0; r < m; ++r) {
    const int i = contacts[at(r)];
    // Long sums: held impulses of heavy bodies nearly cancel.
    long double rest[3];
    for (int q = 0; q < 3; ++q) rest[q] = p.packed_b()[at(i)].v[q];
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const int j = p.columns()[at(k)];
      const double* A = p.blocks()[at(k)].column;
      if (place_[at(j)] >= 0) blocks.push_back({r, place_[at(j)], as_matrix(p.blocks()[at(k)])});
      for (int c = 0; c < 3 && place_[at(j)] < 0; ++c)
        for (int q = 0; q < 3; ++q)
          rest[q] -= static_cast<long double>(A[4 * c + q]) * x[at(j)].v[c];
    }
    for (int q = 0; q < 3; ++q) b[3 * r + q] = static_cast<double>(rest[q]);
    mu[r] = p.mu(i);
    start.push_back(x[at(i)]);
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
  local.system.belong_to(search.system, contacts);
  local.system.to_own_units(start.data());
  part_->automatic.reset(m, options);
  const bool solved = part_->automatic.run_part(local, start) == Status::solved;
  search.counts.add(local.counts);
  if (!solved) return false;
  local.system.to_given_units(local.best.data());
  for (std::size_t r = 0; r < contacts.size(); ++r) x[at(contacts[r])] = local.best[r];
  return true;
}

bool LocalSolves::run(Search& search, Packed& x, double budget) {
  constexpr int kMostLayers = 3;
  const double before = most_;
  if (!find_parts(search, x)) return false;
  // An error that comes back after its part was solved depends on more neighbours.
  if (solved_) layers_ = most_ < 0.5 * before ? 1 : std::min(kMostLayers, layers_ + 1);
  if (!part_) part_ = std::make_unique<Part>();
  bool any = false;
  for (const std::vector<int>& part : parts_)
    if (!search.exhausted() && solve_part(search, part, budget, x)) any = true;
  if (!any) layers_ = layers_ > 1 ? layers_ - 1 : 2;
  return solved_ = any;
}

}  // namespace tether::contact::detail

// Tether: the factorised matrix of Newton steps, by contacts or by bodies. SPDX-License-Identifier:
// BSD-3-Clause
#include "assembled/stages/newton_matrix.hpp"

#include <algorithm>
#include <vector>

namespace tether::contact::detail {
namespace {

constexpr double kClearly = 0.5;      // of the price by contacts: the digits cost refinements
constexpr double kOrderBodies = 500;  // ns a contact

}  // namespace

double NewtonMatrix::cost(const Search& search) const {
  if (ordered_ && by_bodies_) return bodies_.cost() + sweeps_ * search.sweep_cost;
  const double blocks = static_cast<double>(search.system.problem().blocks().size());
  const double operations =
      ordered_ ? lu_.operations() : blocks * blocks / std::max(1, search.system.size());
  return 4 * operations + sweeps_ * search.sweep_cost + 25 * blocks +
         per_contact_ * search.system.size();
}

// Breadth-first levels, whose ends separate the graph: a front of a nested elimination is as wide
// as a level, and the widest front takes most of the work.
double NewtonMatrix::cost_by_width(const Search& search) const {
  constexpr double kOfBand =
      0.1;  // of the work of eliminating level by level, as measured on packings
  const linalg::BlockPattern p = pattern(search.system.problem());
  const int n = p.size;
  std::vector<int> reached;
  std::vector<char> seen(at(n), 0);
  reached.reserve(at(n));
  double operations = 0;
  for (int seed = 0; seed < n; ++seed) {
    if (seen[at(seed)]) continue;
    seen[at(seed)] = 1;
    reached.push_back(seed);
    std::size_t begin = reached.size() - 1;
    while (begin < reached.size()) {
      const std::size_t end = reached.size();
      const double width = static_cast<double>(end - begin);
      operations += width * width * width;
      for (; begin < end; ++begin)
        for (int k = p.starts[reached[begin]]; k < p.starts[reached[begin] + 1]; ++k) {
          const int j = p.columns[k];
          if (seen[at(j)]) continue;
          seen[at(j)] = 1;
          reached.push_back(j);
        }
    }
  }
  return 4 * kOfBand * operations;
}

bool NewtonMatrix::order_by_bodies(Search& search) {
  if (ordered_) return by_bodies_;
  constexpr int kMany = 2;  // contacts for each node
  const BodyForm* given = search.system.problem().body_form();
  if (given == nullptr || given->contacts() < kMany * given->nodes) return false;
  bodies_.order(*given);
  if (!(bodies_.cost() + sweeps_ * search.sweep_cost < kClearly * cost(search))) return false;
  search.counts.work += kOrderBodies * search.system.size();
  ordered_ = by_bodies_ = true;
  return true;
}

double NewtonMatrix::order_cost(const Search& search) const {
  return 100 * static_cast<double>(search.system.problem().blocks().size());
}

void NewtonMatrix::order(Search& search) {
  if (ordered_ || order_by_bodies(search)) return;
  const linalg::BlockPattern blocks = pattern(search.system.problem());
  search.counts.work += order_cost(search);
  lu_.order(blocks);
  lu_.analyse(blocks, nullptr);
  ordered_ = true;
  take_bodies_if_cheaper(search);
}

// Four contacts a body cost a quarter in equations of bodies, 2.8 as much as in those of contacts.
void NewtonMatrix::take_bodies_if_cheaper(Search& search) {
  constexpr int kSome = 3;  // contacts for two nodes
  const BodyForm* given = search.system.problem().body_form();
  if (given == nullptr || 2 * given->contacts() < kSome * given->nodes) return;
  const double by_contacts = cost(search);
  search.counts.work += kOrderBodies * search.system.size();
  bodies_.order(*given);
  by_bodies_ = bodies_.cost() + sweeps_ * search.sweep_cost < kClearly * by_contacts;
}

void NewtonMatrix::order_for_parts(Search& search) {
  if (ordered_ || order_by_bodies(search)) return;
  lu_.order(pattern(search.system.problem()));
  ordered_ = true;
}

}  // namespace tether::contact::detail

// Tether: the predicted cost of an island as a Problem. SPDX-License-Identifier: BSD-3-Clause
#include "body_sweeps/sweep_control.hpp"

#include <algorithm>
#include <tether/linalg/block_lu.hpp>
#include <tether/linalg/index.hpp>

#include "problem/body_form.hpp"

namespace tether::contact::detail {
namespace {

// Prices in ns, fitted to times of stacks, lattices, heaps and packings.
constexpr double kInFours = 22;    // a contact and sweep
constexpr double kAlone = 48;      // the same of one that is in no group of four
constexpr double kAssembly = 250;  // a block
constexpr double kSteps = 10;      // factorisations from sticking to a solution, mostly
constexpr double kMostSteps = kSteps * 2;
constexpr double kLeastSweeps = 500;  // on the Problem, after which packings begin to end

using linalg::at;

// Rows of a pattern with sorted columns from lists with repetitions.
struct Pattern {
  std::vector<int> starts{0}, columns;
  void close_row() {
    const auto begin = columns.begin() + starts.back();
    std::sort(begin, columns.end());
    columns.erase(std::unique(begin, columns.end()), columns.end());
    starts.push_back(static_cast<int>(columns.size()));
  }
  double operations() const {
    return linalg::elimination_operations(
        {static_cast<int>(starts.size()) - 1, starts.data(), columns.data()});
  }
};

}  // namespace

AssemblyPrice::AssemblyPrice(const ContactGraph& graph, const Island& island,
                             const std::vector<int>& first, const std::vector<int>& second)
    : graph_(graph), island_(island), first_(first), second_(second) {
  for (int place = 0; place < island.contacts; ++place)
    blocks_ += static_cast<double>(graph.coupled[at(island.contact_begin + place)]);
  const Chunk &from = graph.chunks[at(island.chunk_begin)],
              &to = graph.chunks[at(island.chunk_end)];
  int in_fours = 0;
  for (const Kind kind : {Kind::general4, Kind::sphere4})
    in_fours += to.begin[static_cast<int>(kind)] - from.begin[static_cast<int>(kind)];
  sweep_ = kInFours * in_fours + kAlone * (island.contacts - in_fours);
}

// The price of products of blocks, and terms in proportion to the contacts, as in
// InteriorPoint::cost and BodyNewton::cost.
double AssemblyPrice::factorisation() {
  if (factorisation_ >= 0) return factorisation_;
  const int n = island_.contacts, bodies = island_.body_end - island_.body_begin;
  std::vector<std::vector<int>> of(at(bodies));  // contacts of each body
  const auto contact = [&](int place) { return graph_.order[at(island_.contact_begin + place)]; };
  const auto local = [&](int body) { return graph_.slot[at(body)] - island_.body_begin; };
  for (int place = 0; place < n; ++place)
    for (int body : {first_[at(contact(place))], second_[at(contact(place))]})
      if (body >= 0) of[at(local(body))].push_back(place);
  Pattern pattern;
  const bool by_bodies = n >= kContactsOfBody * bodies;
  if (by_bodies) {
    for (int body = 0; body < bodies; ++body) {
      pattern.columns.push_back(body);
      for (int place : of[at(body)])
        for (int other : {first_[at(contact(place))], second_[at(contact(place))]})
          if (other >= 0) pattern.columns.push_back(local(other));
      pattern.close_row();
    }
  } else {
    for (int place = 0; place < n; ++place) {
      for (int body : {first_[at(contact(place))], second_[at(contact(place))]})
        if (body >= 0)
          pattern.columns.insert(pattern.columns.end(), of[at(local(body))].begin(),
                                 of[at(local(body))].end());
      pattern.close_row();
    }
  }
  // A body has six rows, two blocks: 2^3 products.
  const double operations = pattern.operations() * (by_bodies ? 8 : 1);
  factorisation_ = 4 * operations + (by_bodies ? 800.0 * n : 32 * blocks_ + 240.0 * n);
  return factorisation_;
}

double AssemblyPrice::sweeps() { return (kAssembly * blocks_ + kSteps * factorisation()) / sweep_; }

bool AssemblyPrice::within(double work) {
  const double left = work - kAssembly * blocks_;
  const double sweep = 2.2 * blocks_ + 30.0 * island_.contacts;  // Search::sweep_cost
  return kLeastSweeps * sweep <= left || (left > 0 && kMostSteps * factorisation() <= left);
}

}  // namespace tether::contact::detail

// Tether: the factorised matrix of Newton steps, by contacts or by bodies. SPDX-License-Identifier:
// BSD-3-Clause
#include "assembled/stages/newton_matrix.hpp"

#include <algorithm>
#include <vector>

namespace tether::contact::detail {
namespace {

constexpr double kClearly = 0.5;  // of the price by contacts: the digits cost refinements
constexpr double kOrderBodies = 500, kOrderContacts = 100;  // ns a contact, a block

}  // namespace

double NewtonMatrix::cost(const Search& search) const {
  if (ordered_ && by_bodies_) return bodies_.cost() + sweeps_ * search.sweep_cost;
  const double blocks = static_cast<double>(search.system.problem().blocks().size());
  const double operations =
      ordered_ ? lu_.operations() : blocks * blocks / std::max(1, search.system.size());
  return 4 * operations + sweeps_ * search.sweep_cost + 25 * blocks +
         per_contact_ * search.system.size();
}

bool NewtonMatrix::order_by_bodies(Search& search) {
  if (ordered_) return by_bodies_;
  const BodyForm* given = search.system.body_form();
  if (given == nullptr || 2 * given->contacts() < kContactsOfBody * given->nodes) return false;
  bodies_.order(*given);
  if (!(bodies_.cost() + sweeps_ * search.sweep_cost < kClearly * cost(search))) return false;
  search.counts.work += kOrderBodies * search.system.size();
  ordered_ = by_bodies_ = true;
  return true;
}

void NewtonMatrix::order(Search& search) {
  if (ordered_ || order_by_bodies(search)) return;
  const linalg::BlockPattern blocks = pattern(search.system.problem());
  search.counts.work +=
      kOrderContacts * static_cast<double>(search.system.problem().blocks().size());
  lu_.order(blocks);
  lu_.analyse(blocks, nullptr);
  ordered_ = true;
  take_bodies_if_cheaper(search);
}

// Four contacts a body cost a quarter in equations of bodies, 2.8 as much as in those of contacts.
void NewtonMatrix::take_bodies_if_cheaper(Search& search) {
  constexpr int kSome = 3;  // contacts for two nodes
  const BodyForm* given = search.system.body_form();
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

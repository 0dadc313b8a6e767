// Tether: contacts that are too far open to be swept. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/body_solver.hpp>
#include <vector>

#include "body_passes/given_problem.hpp"
#include "graph/graph_parts.hpp"

namespace tether::contact::detail {

// A time step asks for all contacts that could close in it, whatever happens: where bodies are fast
// these are several times as many as press, and nearly all of them end without an impulse. In a
// large island those which the velocities before the solve leave open by far are left out at first,
// and the others fall into islands of their own. Whoever closes after all is taken in, and its
// island solved again: the answer is one of the whole problem. Each island of which something is
// left out is a group by itself, so that its last solve judges it; all others are the group 0.
class FarContacts {
 public:
  using Starts = std::vector<const Vector3d*>;

  // starts: of each contact, or empty. False: none is left out.
  bool leave_out(const GivenProblem& given, const Starts& starts);
  int groups() const { return 1 + static_cast<int>(parted_.size()); }
  // Begins a group; next() then has the contacts to be solved first.
  void begin(int group);
  // Contacts by number, ascending.
  const std::vector<int>& next() const { return next_; }
  // Given the velocities after a solve of next(): what is to be solved again. False: nothing.
  bool take_in(const std::vector<PointContact>& contacts, const BodySolution& solution);

  int count() const;  // of contacts that are left out

 private:
  static constexpr int kLarge = 6000;    // contacts of an island that is worth it
  static constexpr double kPart = 0.05;  // of the speeds at a contact: far
  static constexpr int kRounds = 3;      // then all contacts of an island are taken

  void look_at(const GivenProblem& given);
  void find_pace();
  void mark(const GivenProblem& given, const Starts& starts);
  bool parted(std::size_t island) const { return count_[island] > islands_[island].contacts / 4; }
  void list_next();
  // The island that is the group.
  const Island& island() const {
    return islands_[static_cast<std::size_t>(parted_[static_cast<std::size_t>(group_ - 1)])];
  }
  const int* first() const { return sorted_.data() + island().contact_begin; }
  const int* last() const { return first() + island().contacts; }

  int group_ = 0, round_ = 0;
  IslandFinder finder_;
  std::vector<Island> islands_;
  std::vector<int> sorted_, island_;  // contacts by island; the island of each contact
  std::vector<int> rest_, parted_;    // contacts of the group 0; islands of the others
  std::vector<int> next_;
  std::vector<char> out_;           // contact -> left out
  std::vector<int> count_;          // of an island
  std::vector<double> pace_;        // of an island: root mean square of approaches
  std::vector<double> open_, far_;  // speeds: w at a contact, and from where on it is far
};

}  // namespace tether::contact::detail

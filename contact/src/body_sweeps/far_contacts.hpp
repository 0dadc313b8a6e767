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
// island solved again: the answer is one of the whole problem.
class FarContacts {
 public:
  using Starts = std::vector<const Vector3d*>;

  // starts: of each contact, or empty. False: none is left out.
  bool leave_out(const GivenProblem& given, const Starts& starts);
  // The contacts to be solved next, by number, ascending: at first all that are not left out.
  const std::vector<int>& next() const { return next_; }
  // Given the velocities after a solve of them: what is to be solved again. False: nothing.
  bool take_in(const std::vector<PointContact>& contacts, const BodySolution& solution);

  int count() const;  // of contacts that are left out
  std::size_t bytes() const;

 private:
  static constexpr int kLarge = 6000;    // contacts of an island that is worth it
  static constexpr double kPart = 0.05;  // of the speeds at a contact: far
  static constexpr int kRounds = 3;      // then all contacts of an island are taken

  void look_at(const GivenProblem& given);
  void find_pace();

  int round_ = 0;
  IslandFinder finder_;
  std::vector<Island> islands_;
  std::vector<int> sorted_, island_, next_;  // island_: of each contact
  std::vector<char> out_;                    // contact -> left out
  std::vector<char> again_;                  // island -> to be solved again
  std::vector<int> count_;                   // of an island
  std::vector<double> pace_;                 // of an island: root mean square of approaches
  std::vector<double> open_, far_;           // speeds: w at a contact, and from where on it is far
};

}  // namespace tether::contact::detail

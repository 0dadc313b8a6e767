// Tether: bodies and contacts as the caller gives them. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <tether/contact/body_solver.hpp>
#include <vector>

#include "graph/contact_graph.hpp"
#include "kernels/body_contacts.hpp"
#include "problem/contact_side.hpp"

namespace tether::contact::detail {

// Properties of a body that decide the kinds of its contacts: a sum of these.
enum Trait : std::uint8_t { can_move = 1, isotropic = 2, never_turns = 4 };
std::uint8_t body_traits(const RigidBody& body);

// The bodies of a contact that move, the first one always, `second` is -1 if the other one does
// not; exchanged: the caller's second body is `first`. traits: of each body.
struct MovingPair {
  int first, second;
  bool exchanged;
  Kind kind;  // general, sphere or smooth
};
// `first` is -1 if both bodies are fixed. friction: the law has any.
MovingPair moving_pair(const PointContact& contact, const std::vector<std::uint8_t>& traits,
                       bool friction);

// The caller's lists, checked, each contact seen from a body that moves, and sorted by how much of
// a friction problem it is. Keeps its storage between solves.
class GivenProblem {
 public:
  // Throws std::invalid_argument. The lists are referred to, not copied.
  void read(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
            Law law);

  const std::vector<RigidBody>& bodies() const { return *bodies_; }
  const std::vector<PointContact>& contacts() const { return *contacts_; }
  const PointContact& contact(int i) const { return (*contacts_)[linalg::at(i)]; }

  // Bodies of each contact that move: `first` always does, `second` is -1 if the other one does
  // not.
  const std::vector<int>& first() const { return first_; }
  const std::vector<int>& second() const { return second_; }
  // general, sphere or smooth
  const std::vector<Kind>& kinds() const { return kind_; }

  // The caller's first and second body are exchanged, and with them the sign of the impulse.
  bool exchanged(int i) const { return exchanged_[linalg::at(i)] != 0; }
  Side side(int i) const { return detail::side(*bodies_, contact(i), exchanged(i)); }
  // Unit normal that points to `first`.
  Vector3d normal(int i) const { return with_sign(i, contact(i).normal); }
  // An impulse on `first` as one on the caller's first body, and back.
  Vector3d with_sign(int i, const Vector3d& p) const { return exchanged(i) ? Vector3d(-p) : p; }

  // Velocities of the bodies that do not move; the first one is the world.
  const BodyState* fixed() const { return fixed_.data(); }
  // The second body of contact i in `fixed`, as the kernels name it: -1 - its place.
  int fixed_second(int i) const {
    const int partner = exchanged(i) ? contact(i).first : contact(i).second;
    return partner < 0 ? -1 : -1 - fixed_slot_[linalg::at(partner)];
  }

 private:
  void read_bodies();
  void read_contacts(Law law);

  const std::vector<RigidBody>* bodies_ = nullptr;
  const std::vector<PointContact>* contacts_ = nullptr;
  std::vector<int> first_, second_;
  std::vector<Kind> kind_;
  std::vector<char> exchanged_;
  std::vector<std::uint8_t> traits_;  // of each body
  std::vector<int> fixed_slot_;       // body -> place in fixed_; 0: at rest, as the world
  std::vector<BodyState> fixed_;
};

}  // namespace tether::contact::detail

// Tether: factors of a Delassus matrix by bodies. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <tether/contact/bodies.hpp>
#include <tether/contact/problem.hpp>
#include <tether/linalg/block3.hpp>
#include <tether/linalg/index.hpp>
#include <vector>

namespace tether::contact::detail {

/// C with C C' = inverse mass.
Matrix6d inverse_mass_root(const Matrix6d& inverse_mass);

/// The block as one of Eigen's.
inline auto as_matrix(linalg::PackedBlock& block) {
  return Eigen::Map<Eigen::Matrix3d, 0, Eigen::OuterStride<4>>(block.column);
}
inline auto as_matrix(const linalg::PackedBlock& block) {
  return Eigen::Map<const Eigen::Matrix3d, 0, Eigen::OuterStride<4>>(block.column);
}
inline bool is_zero(const linalg::PackedBlock& block) {
  return std::all_of(block.column, block.column + 12, [](double v) { return v == 0; });
}

/// Contacts a body, from which on equations by bodies cost less whatever their fill.
constexpr int kContactsOfBody = 4;

/// A = H H' in blocks of three columns, the nodes. H = J C, C C' the inverse mass of each body:
/// nodes 2 k and 2 k + 1 are the linear and angular velocity of body k, and a contact has those of
/// its one or two bodies that move.
struct BodyForm {
  int nodes = 0;
  std::vector<int> start{0}, node;             // of contact i: start[i] <= k < start[i + 1]
  std::vector<linalg::PackedBlock> H, turned;  // contact rows; the same, transposed

  int contacts() const { return static_cast<int>(start.size()) - 1; }
  void add(int to, const linalg::PackedBlock& block) {
    node.push_back(to);
    H.push_back(block);
    as_matrix(turned.emplace_back()) = as_matrix(block).transpose();
  }
  void end_contact() { start.push_back(static_cast<int>(node.size())); }
};

/// The form of some contacts, with the nodes that they have.
inline std::shared_ptr<const BodyForm> part_of(const BodyForm& whole,
                                               const std::vector<int>& contacts) {
  auto out = std::make_shared<BodyForm>();
  std::map<int, int> number;
  for (int i : contacts) {
    for (int k = whole.start[linalg::at(i)]; k < whole.start[linalg::at(i) + 1]; ++k) {
      const int node = whole.node[linalg::at(k)];
      out->add(number.emplace(node, static_cast<int>(number.size())).first->second,
               whole.H[linalg::at(k)]);
    }
    out->end_contact();
  }
  out->nodes = static_cast<int>(number.size());
  return out;
}

/// Whether factors by bodies may be smaller than A: its contacts are twice as many as the pairs of
/// bodies that touch. In the plane, where a contact has a velocity of its own, they are not.
bool may_have_bodies(const Problem& problem);

/// Factors A = H H' of a problem that is given by its matrix alone, with a few columns for each
/// body; null where A is not positive semidefinite.
///
/// Contacts between the same two bodies have the same column pattern: they are a class. Two bodies
/// have six relative velocities, so that a few rows of a class determine the others. On these rows
/// a block Cholesky decomposition eliminates one class after another. A class that alone couples a
/// body to what has gone before, as contacts with the ground do at first, takes the whole body
/// away, and nothing fills in.
std::shared_ptr<const BodyForm> bodies_of_matrix(const Problem& problem);

}  // namespace tether::contact::detail

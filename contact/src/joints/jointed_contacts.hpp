// Tether: contacts of bodies that joints hold. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/joints.hpp>
#include <tether/contact/solver.hpp>
#include <tether/linalg/disjoint_sets.hpp>
#include <vector>

#include "joints/mechanisms.hpp"

namespace tether::contact::detail {

/// Solves the contacts of one island after the other. The joints are eliminated by the sparse
/// factors of G M^-1 G' (linalg::SparseMinimumNorm), so that contacts see
///
///     A = J P J',   P = M^-1 - M^-1 G' (G M^-1 G')^+ G M^-1
///
/// A contact whose normal velocity the joints hold (A_nn = 0) has no impulse: it is left out where
/// it does not approach, else named in Result::blocked. A is dense over the contacts of an island.
class JointedContacts {
 public:
  explicit JointedContacts(const Options& options);
  void set_options(const Options& options) { solver_ = Solver(options); }

  struct Result {
    Status status = Status::solved;
    double error = 0;
    int islands = 0;
    std::vector<int> blocked;  ///< ascending
    Counts counts;
  };
  /// Changes velocities that the joints already allow, v, by impulses that keep them so, and adds
  /// what the joints do to the pulls. x (3 each, contact frame): where to start from, and the
  /// impulses found. own: what an impulse moves a contact by besides the bodies, in each direction,
  /// on the diagonal of A; empty: nothing. The last of the contacts, as many as `normal_of` has,
  /// have no normal of their own, but the impulse of that of the contact named there (MomentRows).
  const Result& solve(Mechanisms& mechanisms, const std::vector<ContactRows>& contacts,
                      const std::vector<Eigen::Vector3d>& own, std::vector<Vector6d>& v,
                      linalg::VectorX& x, const std::vector<int>& normal_of = {});

 private:
  /// One body of a contact that moves, and the contact's rows on its u. node: its mechanism, or,
  /// after all of them, the body itself.
  struct Side {
    int contact, body, node;
    Matrix36d H;
  };
  struct HeldSlip {
    int place;  // in members_
    Eigen::Vector2d direction;
  };
  int node_of(const Mechanisms& mechanisms, int body) const;
  void find_islands(const Mechanisms& mechanisms, const std::vector<ContactRows>& contacts);
  void collect_sides(const Mechanisms& mechanisms, const std::vector<ContactRows>& contacts);
  void assemble(Mechanisms& mechanisms, const std::vector<Eigen::Vector3d>& own);
  void add_mechanism(Mechanisms& mechanisms, std::size_t begin, std::size_t end);
  void clear_held_slips();
  void tie_normals();
  void drop_held(const std::vector<ContactRows>& contacts, const std::vector<Vector6d>& v);
  Eigen::Vector3d approach(int place, const ContactRows& contact,
                           const std::vector<Vector6d>& v) const;
  void solve_kept(const std::vector<ContactRows>& contacts, const std::vector<Vector6d>& v,
                  linalg::VectorX& x);
  void apply(Mechanisms& mechanisms, const linalg::VectorX& x, std::vector<Vector6d>& v);

  Solver solver_;
  Result result_;
  linalg::DisjointSets sets_;                         // of mechanisms and single bodies
  std::vector<int> first_of_, order_, island_start_;  // contacts island by island
  // Of the present island: its contacts, those of them that are solved (places in members_), the
  // sides of all, and A, and its diagonal without joints (normals, and sums of
  // both tangents).
  std::vector<int> members_, kept_;
  // Of contacts without a normal of their own: the first; by contact from there on, the one whose
  // impulse it has. Of the members, where that is; -1: they have one.
  int first_tied_ = 0;
  std::vector<int> normal_of_, tied_to_;
  std::vector<Side> sides_;
  std::vector<HeldSlip> held_slips_;
  Eigen::MatrixXd A_, answer_;
  Eigen::VectorXd alone_, slip_alone_;
};

}  // namespace tether::contact::detail

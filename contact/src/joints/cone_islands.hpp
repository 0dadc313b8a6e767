// Tether: islands of a step that are more than friction cones. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <optional>
#include <tether/linalg/disjoint_sets.hpp>
#include <utility>
#include <vector>

#include "joints/body_cones.hpp"
#include "joints/law_rows.hpp"
#include "joints/mechanisms.hpp"
#include "stepping/detection/near_contacts.hpp"

namespace tether::contact::detail {

/// Identity of a contact's moment in warm starts: that of the contact with its surfaces exchanged,
/// an order that no contact of them has.
constexpr std::uint64_t moment_id(std::uint64_t contact) {
  return contact_id(static_cast<int>(contact >> 16 & 0xffffff), static_cast<int>(contact >> 40),
                    static_cast<int>(contact & 0xffff));
}

class ImpulseMemory;

/// Joints, their laws and meetings of materials, which make islands of a step more than friction
/// cones: shared by all its solvers.
struct ConeSources {
  Mechanisms mechanisms;               ///< without joints: none
  std::optional<LawRows> laws;         ///< with joints only
  const NearContacts* near = nullptr;  ///< contacts with moments or elliptic friction; null: none
  std::vector<std::pair<int, int>> links;  ///< connect the bodies of each mechanism
  std::vector<int> under_laws;             ///< bodies of mechanisms that have laws
  /// Moments of rolling and torsional friction in the last problem of a step's velocities: one for
  /// each contact, world axes, N m s.
  std::vector<Eigen::Vector3d> moments;

  /// Whether problems have such islands. Position corrections have no friction.
  bool any(LawUse use) const { return laws || (near != nullptr && use != LawUse::limits); }
};

/// Solves islands that have a mechanism, or contacts with rolling, torsional or elliptic friction.
class ConeIslands {
 public:
  ConeIslands(ConeSources& sources, LawUse use, const BodyOptions& options);

  /// As BodySolver::solve, which `others` is, for all other islands. Its memory has the impulses of
  /// all contacts. Joints keep the velocities that they have: v+ - v satisfies G (v+ - v) = 0.
  void solve(BodySolver& others, const std::vector<RigidBody>& bodies,
             const std::vector<PointContact>& contacts, BodySolution& out);
  void set_options(const BodyOptions& options);

 private:
  bool rolls(const PointContact& c) const { return near_ != nullptr && near_->meeting(c).rolls(); }
  bool is_elliptic(const PointContact& c) const {
    return near_ != nullptr && near_->meeting(c).is_elliptic();
  }
  void find_islands(const std::vector<PointContact>& contacts);
  void add_contacts(const std::vector<PointContact>& contacts, ImpulseMemory& memory);
  void add_laws(ImpulseMemory& memory);
  void take_laws();
  void merge(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
             BodySolution& out);
  void remember_cones(const std::vector<PointContact>& contacts, ImpulseMemory& memory) const;

  Mechanisms& mechanisms_;
  LawRows* laws_;  // null: no joints
  LawUse use_;
  const NearContacts* near_;
  std::vector<Eigen::Vector3d> own_, &moments_;
  BodyCones solver_;
  BodyCones::Result result_;
  linalg::DisjointSets sets_;
  std::vector<char> is_mine_;     // of the root of an island
  std::vector<int> mine_, rest_;  // contacts
  std::vector<PointContact> points_;
  BodySolution solution_;        // of rest_
  std::vector<BodyCone> cones_;  // mine_, then laws
  std::vector<int> law_of_;      // of the latter
  linalg::VectorX x_;
  std::vector<double> start_of_;  // x_ while cones are added
  std::vector<Vector6d> v_;
};

/// A BodySolver, and ConeIslands where there are such. Warm starts have the impulses of all
/// contacts.
class StepSolver : public BodySolver {
 public:
  StepSolver(const BodyOptions& options, ConeSources& sources, LawUse use) : BodySolver(options) {
    if (sources.any(use)) cones_.emplace(sources, use, options);
  }

  void solve(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
             BodySolution& out) {
    if (cones_)
      cones_->solve(*this, bodies, contacts, out);
    else
      BodySolver::solve(bodies, contacts, out);
  }
  void set_options(const BodyOptions& options) {
    BodySolver::set_options(options);
    if (cones_) cones_->set_options(options);
  }

 private:
  std::optional<ConeIslands> cones_;
};

}  // namespace tether::contact::detail

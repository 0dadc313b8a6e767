// Tether: islands of a step that are more than friction cones. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/linalg/disjoint_sets.hpp>
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

/// Solves islands that have a mechanism, or contacts with rolling, torsional or elliptic friction.
class ImpulseHistory;

class ConeIslands final : public JointIslands {
 public:
  /// The mechanisms belong to the joints of the stepper, which update them; without joints `laws`
  /// is null. near: meetings whose contacts hold moments or have elliptic friction; null: none.
  /// moments: receives the moments of all contacts of a solve of a step's velocities, world axes,
  /// N m s.
  ConeIslands(Mechanisms& mechanisms, LawRows* laws, LawUse use, const BodyOptions& options,
              const NearContacts* near, std::vector<Eigen::Vector3d>& moments);

  void solve(BodySolver& others, const std::vector<RigidBody>& bodies,
             const std::vector<PointContact>& contacts, BodySolution& out) override;
  void set_options(const BodyOptions& options) override;

 private:
  bool rolls(const PointContact& c) const { return near_ != nullptr && near_->meeting(c).rolls(); }
  bool is_elliptic(const PointContact& c) const {
    return near_ != nullptr && near_->meeting(c).is_elliptic();
  }
  void find_islands(const std::vector<PointContact>& contacts);
  void add_contacts(const std::vector<PointContact>& contacts, ImpulseHistory& memory);
  void add_laws(ImpulseHistory& memory);
  void take_laws();
  void merge(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
             BodySolution& out);
  void remember_cones(const std::vector<PointContact>& contacts, ImpulseHistory& memory) const;

  Mechanisms& mechanisms_;
  LawRows* laws_;
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

/// Rolling and elliptic friction in steps without joints; `near` must outlive it.
class RollingPart final : public IslandMaker {
 public:
  explicit RollingPart(const NearContacts& near) : near_(near) {}

  std::unique_ptr<JointIslands> make_islands(const BodyOptions& options, LawUse laws) override;

 private:
  const NearContacts& near_;
  Mechanisms mechanisms_;  // none
};

}  // namespace tether::contact::detail

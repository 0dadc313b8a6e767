// Tether: islands of a step that are more than friction cones. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/linalg/disjoint_sets.hpp>
#include <vector>

#include "body_sweeps/impulse_memory.hpp"
#include "joints/body_cones.hpp"
#include "joints/law_rows.hpp"
#include "joints/mechanisms.hpp"
#include "stepping/detection/near_contacts.hpp"

namespace tether::contact::detail {

/// Solves islands that have a mechanism, or contacts with rolling, torsional or elliptic friction.
class ConeIslands final : public JointIslands {
 public:
  /// The mechanisms belong to the joints of the stepper, which update them; without joints `laws`
  /// is null. near: meetings whose contacts hold moments or have elliptic friction; null: none.
  /// moments: receives the moments of all contacts of a solve, world axes, N m s; may be null.
  ConeIslands(Mechanisms& mechanisms, LawRows* laws, LawUse use, const BodyOptions& options,
              const NearContacts* near, std::vector<Eigen::Vector3d>* moments);

  void solve(BodySolver& others, const std::vector<RigidBody>& bodies,
             const std::vector<PointContact>& contacts, BodySolution& out) override;
  void set_options(const BodyOptions& options) override;
  void scale_warm_start(double factor) override { memory_.scale(factor); }
  void take_back() override { memory_.take_back(); }
  void forget() override { memory_.forget(); }
  void set_warm_start(const WarmStart& start) override { memory_.set(start); }

 private:
  bool rolls(const PointContact& c) const { return near_ != nullptr && near_->meeting(c).rolls(); }
  bool is_elliptic(const PointContact& c) const {
    return near_ != nullptr && near_->meeting(c).is_elliptic();
  }
  void find_islands(const std::vector<PointContact>& contacts);
  void add_contacts(const std::vector<PointContact>& contacts);
  void add_laws();
  void take_laws();
  void merge(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
             BodySolution& out);
  void remember(BodySolver& others, const std::vector<PointContact>& contacts,
                const BodySolution& out);

  Mechanisms& mechanisms_;
  LawRows* laws_;
  LawUse use_;
  const NearContacts* near_;
  std::vector<Eigen::Vector3d> own_, &moments_;
  bool warm_;
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
  ImpulseHistory memory_;
  WarmStart start_;
};

/// Rolling and elliptic friction in steps without joints; `near` must outlive it.
class RollingPart final : public IslandMaker {
 public:
  explicit RollingPart(const NearContacts& near) : near_(near) {}

  std::unique_ptr<JointIslands> make_islands(const BodyOptions& options, LawUse laws) override;

 private:
  const NearContacts& near_;
  Mechanisms mechanisms_;  // none
  bool first_ = true;
};

}  // namespace tether::contact::detail

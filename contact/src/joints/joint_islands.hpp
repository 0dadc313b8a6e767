// Tether: islands of contacts and joints in a step. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/disjoint_sets.hpp>
#include <vector>

#include "joints/jointed_contacts.hpp"
#include "joints/law_rows.hpp"
#include "joints/mechanisms.hpp"
#include "joints/moment_rows.hpp"
#include "rolling/rolling_part.hpp"

namespace tether::contact::detail {

/// Splits contacts by whether a mechanism is in their island.
class StepJointIslands final : public JointIslands {
 public:
  /// The mechanisms belong to the joints of the stepper, and are as they left them last.
  StepJointIslands(Mechanisms& mechanisms, LawRows& laws, LawUse use, const BodyOptions& options);
  /// Contacts of meetings with such lengths hold moments, told to `moments` (of all contacts of a
  /// solve, world axes, N m s; null: nobody). `others`: the islands without joints, and theirs.
  void set_rolling(const NearContacts& near, std::unique_ptr<RollingIslands> others,
                   std::vector<Eigen::Vector3d>* moments);

  void solve(BodySolver& others, const std::vector<RigidBody>& bodies,
             const std::vector<PointContact>& contacts, BodySolution& out) override;
  void set_options(const BodyOptions& options) override;
  void scale_warm_start(double factor) override;
  void take_back() override;
  void forget() override;
  void set_warm_start(const WarmStart& start) override;

 private:
  void find_islands(const std::vector<PointContact>& contacts);
  void solve_jointed(const std::vector<RigidBody>& bodies,
                     const std::vector<PointContact>& contacts);
  void remember(BodySolver& others, const std::vector<PointContact>& contacts,
                const BodySolution& out);
  void merge(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
             BodySolution& out);

  void add_laws();
  Eigen::Vector3d law_impulse(std::size_t l) const {
    return x_.segment<3>(3 * static_cast<Eigen::Index>(jointed_.size() + l));
  }
  void take_laws();
  void add_moments(const std::vector<PointContact>& contacts);
  void take_moments(const std::vector<PointContact>& contacts);
  void solve_others(BodySolver& others, const std::vector<RigidBody>& bodies,
                    const std::vector<PointContact>& contacts, BodySolution& out);
  Eigen::Vector3d moment(int k) const {
    const auto first = static_cast<Eigen::Index>(jointed_.size() + law_of_.size());
    return moments_.moment(k, x_.segment<3>(3 * (first + k)));
  }

  Mechanisms& mechanisms_;
  LawRows& laws_;
  LawUse use_;
  Law law_;
  bool warm_;
  JointedContacts solver_;
  JointedContacts::Result result_;
  linalg::DisjointSets sets_;
  std::vector<char> has_joints_;     // of the root of an island
  std::vector<int> jointed_, rest_;  // contacts
  std::vector<PointContact> points_;
  BodySolution solution_;              // of rest_
  std::vector<ContactRows> contacts_;  // jointed_, then laws
  std::vector<int> law_of_;            // of the latter
  std::vector<Eigen::Vector3d> own_;   // mobilities of contacts_; empty: none has any
  // Only where a meeting names rolling or torsional friction.
  const NearContacts* near_ = nullptr;
  std::unique_ptr<RollingIslands> rolling_;
  std::vector<Eigen::Vector3d> own_moments_, *told_ = &own_moments_;
  MomentRows moments_;
  std::vector<int> normal_of_;
  std::vector<Vector6d> v_;
  linalg::VectorX x_;
  ImpulseHistory memory_;
  WarmStart start_;
};

}  // namespace tether::contact::detail

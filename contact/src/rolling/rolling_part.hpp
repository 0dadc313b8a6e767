// Tether: rolling friction in the contact problems of steps. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/linalg/disjoint_sets.hpp>
#include <utility>
#include <vector>

#include "body_sweeps/impulse_memory.hpp"
#include "rolling/rolling_cones.hpp"
#include "stepping/detection/near_contacts.hpp"
#include "stepping/motion/joint_part.hpp"

namespace tether::contact::detail {

/// Where warm starts keep the moment of a contact: contacts have no bits so high (contact_id).
constexpr std::uint64_t moment_id(std::uint64_t contact) {
  return contact | std::uint64_t{1} << 62;
}

/// The same for a problem that is assembled.
Options solver_options(const BodyOptions& options);

/// Islands in which a meeting names rolling or torsional friction are solved with it.
class RollingIslands final : public JointIslands {
 public:
  /// moments: where those of the last solve go; null: nobody else asks for them.
  RollingIslands(const NearContacts& near, const BodyOptions& options,
                 std::vector<Eigen::Vector3d>* moments);

  void solve(BodySolver& others, const std::vector<RigidBody>& bodies,
             const std::vector<PointContact>& contacts, BodySolution& out) override;
  void set_options(const BodyOptions& options) override;
  void scale_warm_start(double factor) override { memory_.scale(factor); }
  void take_back() override { memory_.take_back(); }
  void forget() override { memory_.forget(); }
  void set_warm_start(const WarmStart& start) override { memory_.set(start); }

  /// Of the contacts of the last solve, world axes, N m s.
  const std::vector<Eigen::Vector3d>& moments() const { return moments_; }

 private:
  int island(const std::vector<RigidBody>& bodies, const PointContact& c) {
    return sets_.root(bodies[linalg::at(c.first)].moves() ? c.first : c.second);
  }
  void find_islands(const std::vector<RigidBody>& bodies,
                    const std::vector<PointContact>& contacts);
  void solve_island(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
                    const int* begin, const int* end, BodySolution& out);
  void remember(BodySolver& others, const std::vector<PointContact>& contacts,
                const BodySolution& out);

  const NearContacts& near_;
  Options options_;
  bool warm_;
  ImpulseHistory memory_;
  WarmStart start_;
  linalg::DisjointSets sets_;
  std::vector<char> rolls_;               // of the root of an island
  std::vector<int> rolling_, rest_;       // contacts; the former by islands
  std::vector<PointContact> points_;      // rest_
  BodySolution solution_;                 // of them
  std::vector<RollingContact> contacts_;  // of an island
  std::vector<Eigen::Vector3d> own_, &moments_;
};

/// Makes them; `near` must outlive it.
class RollingPart final : public IslandMaker {
 public:
  explicit RollingPart(const NearContacts& near) : near_(near) {}

  const std::vector<std::pair<int, int>>& links() const override { return links_; }
  std::unique_ptr<JointIslands> make_islands(const BodyOptions& options, LawUse laws) override {
    return make(options, laws);
  }
  std::unique_ptr<RollingIslands> make(const BodyOptions& options, LawUse laws);
  /// Of the last problem of a step's velocities: one for each contact, world axes, N m s.
  const std::vector<Eigen::Vector3d>& moments() const { return moments_; }

 private:
  const NearContacts& near_;
  std::vector<std::pair<int, int>> links_;  // none
  std::vector<Eigen::Vector3d> moments_;
  bool first_ = true;
};

}  // namespace tether::contact::detail

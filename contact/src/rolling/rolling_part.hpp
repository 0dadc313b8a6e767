// Tether: rolling friction in the contact problems of steps. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "stepping/detection/near_contacts.hpp"
#include "stepping/motion/joint_part.hpp"

namespace tether::contact::detail {

/// Islands in which a meeting names rolling or torsional friction are solved with it, the others as
/// ever. `near` must outlive it.
class RollingPart final : public IslandMaker {
 public:
  explicit RollingPart(const NearContacts& near) : near_(near) {}

  const std::vector<std::pair<int, int>>& links() const override { return links_; }
  std::unique_ptr<JointIslands> make_islands(const BodyOptions& options, LawUse laws) override;
  /// Of the last problem of a step's velocities: one for each contact, world axes, N m s.
  const std::vector<Eigen::Vector3d>& moments() const { return moments_; }

 private:
  const NearContacts& near_;
  std::vector<std::pair<int, int>> links_;  // none
  std::vector<Eigen::Vector3d> moments_;
  bool first_ = true;
};

}  // namespace tether::contact::detail

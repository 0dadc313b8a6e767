// Tether: what joints do to their bodies. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/engine.hpp>
#include <vector>

#include "coordinate.hpp"
#include "joints/joint_rows.hpp"

namespace tether::scene::joints {

/// The reactions that the multipliers of the rows make, N and N m, for each joint of the scene.
class Reactions {
 public:
  /// `bodies`: at t = 0.
  Reactions(const Scene& scene, const Bodies& bodies);

  /// Multipliers by row, N or N m, at the places that the rows and bodies are set to.
  std::vector<JointForce> find(const JointRows& rows, const Bodies& bodies,
                               const double* multipliers) const;

 private:
  std::vector<Coordinate> joints_;
};

}  // namespace tether::scene::joints

// Tether: runs of a scene whose poses are compared. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/scene/cost.hpp>
#include <vector>

namespace tether::scene::costs {

/// Poses of the moving bodies at the sampled times.
struct Samples {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Quaterniond> orientations;
};

struct Measured {
  RunResult result;
  Samples samples;
};

/// Thrown where somebody does not want to wait.
struct Interrupted {};

/// Runs the scene, with poses at `options.samples` equal times. Throws Interrupted.
Measured measure_once(const Scene& scene, const CostOptions& options);

/// The largest distance (m) and angle (rad).
double distance(const Samples& a, const Samples& b);

/// The scene with one setting, and nothing written.
Scene with_setting(const Scene& scene, Method method, double setting);

/// Of a scene without [stepping]: a thousandth of the time, at most the default.
double step_of(const Scene& scene);

}  // namespace tether::scene::costs

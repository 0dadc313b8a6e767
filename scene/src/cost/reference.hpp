// Tether: what errors are measured against. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/cost.hpp>

namespace tether::scene::costs {

/// Poses of the moving bodies at times, which ascend: all bodies at the first one, ...
struct Samples {
  std::vector<double> times;
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Quaterniond> orientations;
};

struct Measured {
  RunResult result;
  Samples samples;
};

/// Thrown where somebody does not want to wait.
struct Interrupted {};

/// Runs the scene, with poses at these times. Throws Interrupted.
Measured measure_once(const Scene& scene, const std::vector<double>& times,
                      const CostOptions& options);

/// The largest distance (m) and angle (rad) at those of the times that both have.
double distance(const Samples& a, const Samples& b, const std::vector<double>& times);

/// So many equal times.
std::vector<double> equal_times(double end, int count);
/// The ends of all steps; of more than kMostPoses / bodies, each second, third, ...
std::vector<double> step_ends(const Scene& scene, double step, int least);
constexpr int kMostPoses = 50000;
/// Those of both, once.
std::vector<double> merged(const std::vector<double>& a, const std::vector<double>& b);

/// The scene with one setting, and nothing written.
Scene with_setting(const Scene& scene, CostMethod method, double setting);

/// Step of a scene without [stepping]: a thousandth of the time, at most the default.
double step_of(const Scene& scene);

/// Times at which anything is compared with a reference (`all`), and those at which the reference
/// is compared with others like it (`own`), which do not depend on what it is asked for.
struct Times {
  std::vector<double> all, own;
};

struct Reference {
  Samples samples;
  std::string what;
  double error = 0;  // what it may be off
  double drift = 0;  // how far it left the joints
  CostMethod by = CostMethod::smooth;
};

/// At the times. Each throws std::runtime_error where there is none.
Reference smooth_reference(const Scene& scene, double tolerance, const Times& times,
                           const CostOptions& options);
Reference stepping_reference(const Scene& scene, double step, const Times& times,
                             const CostOptions& options);
/// None: the event engine does not get to the end.
std::optional<Reference> event_reference(const Scene& scene, double tolerance, const Times& times,
                                         const CostOptions& options);

}  // namespace tether::scene::costs

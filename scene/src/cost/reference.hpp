// Tether: what errors are measured against. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "measure.hpp"

namespace tether::scene::costs {

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
  bool of_events = false;
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

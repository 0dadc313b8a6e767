// Tether: what joints that attach, detach or break obey. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>
#include <tether/scene/scene.hpp>

namespace tether::scene::joints {

/// refuse(place, field, value, why) for each rule that a window of the scene breaks.
template <class Refuse>
void check_windows(const Scene& scene, const Refuse& refuse) {
  if (!any_of(scene.joints, [](const Joint& joint) { return joint.window.has_value(); })) return;
  for (const Joint& joint : scene.joints) {
    if (!joint.window) continue;
    const JointWindow& w = *joint.window;
    const auto wrong = [&](const char* field, double value, const std::string& why) {
      refuse(joint.place, fmt::format("joint \"{}\": {}", joint.name, field),
             fmt::format("{}", value), why);
    };
    if (!(w.from >= 0)) wrong("from", w.from, "must be >= 0");
    if (!(w.to > w.from)) wrong("to", w.to, fmt::format("must be after from, {} s", w.from));
    if (!(w.break_force > 0)) wrong("break_force", w.break_force, "must be > 0");
    if (!(w.break_moment > 0)) wrong("break_moment", w.break_moment, "must be > 0");
    if (w.from > 0 && joint.motion)
      wrong("from", w.from, "is of a joint without a motion: what attaches later has none");
  }
  for (const Coupling& coupling : scene.couplings)
    for (const int j : coupling.joints)
      if (const Joint& joint = scene.joints[linalg::at(j)]; joint.window)
        refuse(coupling.place, fmt::format("coupling \"{}\": joints", coupling.name),
               fmt::format("\"{}\"", joint.name),
               "attaches, detaches or breaks; the joints of a coupling hold always");
  if (goes_on_in_steps(scene))
    refuse(scene.joints.front().place, "event: otherwise", "\"stepping\"",
           "is not for scenes whose joints attach, detach or break");
}

}  // namespace tether::scene::joints

// Tether: prescribed motions of joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/joint.hpp>

#include "toml/fields.hpp"
#include "toml/writer.hpp"

namespace tether::scene::joints {

/// The value of a motion and its derivatives at one time.
struct Now {
  double s = 0, s1 = 0, s2 = 0;
};

Now evaluate(const Motion& motion, double t);

/// The fields of motion = {...}; `angle`: in rad or degrees, else in m.
Motion read_motion(files::Fields& in, bool angle);
void write_motion(const Motion& motion, bool angle, files::Writer& out);

}  // namespace tether::scene::joints

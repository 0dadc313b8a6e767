// Scenes for the tests of the reader. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace texts {

/// Every table and every field of a scene with joints, none with its default.
inline const std::string kJointed = R"([scene]
name = "everything"
end = 2.5
gravity = [0.1, -0.2, -9.81]

[smooth]
tolerance = 1e-8
formulation = "index0"
projection = false
max_step = 0.01
max_steps = 5000

[output]
csv = "a.csv"
vtk = "a.pvd"
svg = "a.svg"
state = "a.state"
every = 0.01
checkpoint = 0.5

[[body]]
name = "ground"
shape = "plane"
normal = [1, 2, 3]
fixed = true
position = [0, 0, -5]

[[body]]
name = "rod"
shape = "capsule"
radius = 0.1
length = 1.3
density = 1234.5
position = [0.65, 0, 0]
orientation = { axis = [1, 1, 0], deg = 77 }
velocity = [1, 2, 3]
angular_velocity = [0.1, 0.2, 0.3]
drag = { linear = 0.1, quadratic = 0.2, rotational = 0.3 }

[[body]]
name = "compound"
mass = 2
shapes = [
  { shape = "box", size = [1, 2, 3], position = [1, 0, 0], orientation = { wxyz = [0.6, 0, 0.8, 0] } },
  { shape = "sphere", radius = 0.5, position = [-12.0, 0, 0] },
  { shape = "points", points = [[0, 0, 0], [1, 1, 1]] },
]
inertia = [2, 3, 4, 0.1, 0.2, 0.3]
position = [3, 0, 0]

[[body]]
name = "tetrahedron"
shape = "convex"
points = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
mass = 3

[[joint]]
name = "pin"
kind = "hinge"
bodies = ["rod", "world"]
at = [0, 0, 0]
axis = [0, 3, 4]
motion = { rate_deg = 30, amplitude_rad = 0.1, frequency = 2, phase_deg = 90 }

[[joint]]
kind = "distance"
bodies = ["rod", "compound"]
at = [[1, 0, 0], [3, 0, 0]]
length = 2.5
motion = { rate = 0.1, amplitude = 0.2, frequency = 3, phase_rad = 1 }

[[joint]]
kind = "slider"
bodies = ["compound", "ground"]
axis = [1, 0, 0]

[[joint]]
kind = "ball"
bodies = ["compound", "tetrahedron"]
at = [0, 1, 0]

[[joint]]
kind = "fixed"
bodies = ["world", "tetrahedron"]
at = [0, 0, 1]

[[spring]]
name = "coil"
bodies = ["rod", "world"]
at = [[1, 0, 0], [0, 0, 1]]
stiffness = 100
damping = 3
rest = 0.5

[[load]]
body = "rod"
force = [1, 2, 3]
torque = [4, 5, 6]

[[invariant]]
kind = "energy"

[[invariant]]
kind = "angular_momentum"
project = false

[[expect]]
time = 1
throughout = true
quantity = "position"
body = "rod"
value = [1, 2, 3]
within = 0.1

[[expect]]
quantity = "energy_change"
at_most = 1
at_least = -1

[[expect]]
quantity = "orientation"
body = "rod"
value = [1, 0, 0, 0]
within = 2
)";

/// The same for a scene with contact.
inline const std::string kTouching = R"([scene]
name = "box on a table"
gravity = [0, 0, -9.81]

[stepping]
step = 2e-3
law = "maximum_dissipation"
tolerance = 1e-10
gyroscopic = "implicit"
error_reduction = 0.1
max_depenetration_speed = 2
restitution_law = "poisson"
restitution_threshold = 0.02
impact_threshold = 0.03
acceptance = 10
max_halvings = 2
max_sweeps = 500
accuracy = 1e-3
on_failure = "warn"
threads = 2

[[body]]
name = "table"
shape = "plane"
fixed = true
material = "wood"

[[body]]
name = "box"
shape = "box"
size = [1, 1, 0.5]
mass = 1
position = [0, 0, 0.25]
material = "steel"

[[pair]]
between = ["steel", "wood"]
friction = 0.3
restitution = 0.5

[[expect]]
quantity = "distance_moved"
body = "box"
at_most = 1e-9
)";

/// `text` with the only `old` replaced.
inline std::string with(std::string text, const std::string& old, const std::string& now) {
  const std::size_t at = text.find(old);
  if (at == std::string::npos) throw "the test replaces what is not there";
  return text.replace(at, old.size(), now);
}

}  // namespace texts

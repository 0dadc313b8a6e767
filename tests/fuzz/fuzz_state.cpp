// Fuzz target of saved states: the content behind a check sum that is right.
// SPDX-License-Identifier: BSD-3-Clause
//
// The first byte names the scene. A damaged sum, length or version is refused before anything is
// read (test_restart.cpp); somebody who means harm computes the sum anew.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <tether/scene/files.hpp>
#include <tether/scene/run.hpp>

#include "driver.hpp"
#include "memory_file.hpp"
#include "run/saved_state.hpp"

using namespace tether;
using namespace tether::scene;

namespace {

constexpr double kSaved = 0.03, kEnd = 0.05;

// One for each engine, and for what a state of it holds: joints, laws, moments, sub-steps,
// hand-overs.
const char* const kScenes[] = {
    R"([scene]
gravity = [0, 0, -9.81]
[smooth]
tolerance = 1e-3
[[body]]
name = "rod"
shape = "capsule"
radius = 0.1
length = 1
mass = 1
position = [0.5, 0, 0]
[[joint]]
kind = "ball"
bodies = ["rod", "world"]
at = [0, 0, 0]
[[expect]]
quantity = "energy_change"
throughout = true
at_most = 1
)",
    R"([scene]
gravity = [0.1, 0, -9.81]
[stepping]
step = 5e-3
on_failure = "warn"
[[body]]
name = "floor"
shape = "plane"
fixed = true
material = "a"
[[pair]]
between = ["a", "a"]
friction = 0.4
restitution = 0.3
[[body]]
name = "one"
shape = "sphere"
radius = 0.1
mass = 1
position = [0, 0, 0.1]
material = "a"
[[body]]
name = "two"
shape = "sphere"
radius = 0.1
mass = 2
position = [0.02, 0.01, 0.3]
material = "a"
[[expect]]
quantity = "position"
body = "one"
value = [0, 0, 0.1]
within = 1
)",
    R"([scene]
gravity = [0, 0, -9.81]
[event]
tolerance = 1e-4
[[body]]
name = "floor"
shape = "plane"
fixed = true
material = "a"
[[pair]]
between = ["a", "a"]
friction = 0.3
restitution = 0.5
[[body]]
name = "ball"
shape = "sphere"
radius = 0.1
mass = 1
position = [0, 0, 0.103]
velocity = [1, 0, -1]
material = "a"
[[body]]
name = "slides"
shape = "box"
size = [0.2, 0.2, 0.1]
mass = 1
position = [1, 0, 0.05]
velocity = [0.1, 0, 0]
material = "a"
[[expect]]
quantity = "speed"
body = "ball"
at_most = 10
)",
    R"([scene]
gravity = [0, 0, -9.81]
[stepping]
step = 1e-2
accuracy = 1e-3
gyroscopic = "momentum"
[[body]]
name = "floor"
shape = "plane"
fixed = true
material = "a"
[[body]]
name = "lift"
shape = "box"
size = [0.1, 0.2, 0.1]
mass = 1
position = [0, 0, 0.3]
[[body]]
name = "hangs"
shape = "cylinder"
radius = 0.1
length = 0.3
mass = 1
position = [0.3, 0, 0.3]
angular_velocity = [0, 1, 2]
material = "a"
[[body]]
name = "free"
shape = "ellipsoid"
half_axes = [0.1, 0.2, 0.3]
mass = 1
position = [3, 0, 0.29]
angular_velocity = [3, 0.1, 0]
material = "a"
[[joint]]
kind = "slider"
bodies = ["lift", "world"]
axis = [0, 0, 1]
limits = [-0.01, 0.001]
limit_restitution = 0.5
motor = { rate = 1, force = 20 }
friction = 0.1
[[joint]]
kind = "hinge"
bodies = ["hangs", "lift"]
at = [0.1, 0, 0.3]
axis = [0, 1, 0]
[[pair]]
between = ["a", "a"]
friction = 0.3
[[expect]]
quantity = "joint_drive"
joint = "joint 1"
at_most = 1e3
)",
    R"([scene]
gravity = [0, 0, -9.81]
[stepping]
step = 5e-3
[output]
forces = true
[[body]]
name = "felt"
shape = "plane"
fixed = true
material = "felt"
[[body]]
name = "rolls"
shape = "sphere"
radius = 0.1
mass = 1
position = [0, 0, 0.1]
velocity = [0.5, 0, 0]
angular_velocity = [0, 5, 1]
material = "ball"
[[pair]]
between = ["ball", "felt"]
friction = 0.5
rolling = 0.002
torsional = 0.001
[[pair]]
between = ["ball", "ball"]
[[expect]]
quantity = "contact_force"
body = "rolls"
against = "felt"
at_most = 1e3
)",
    R"([scene]
gravity = [0, 0, -9.81]
[event]
tolerance = 1e-4
max_events = 2
otherwise = "stepping"
[stepping]
step = 1e-3
[[body]]
name = "floor"
shape = "plane"
fixed = true
material = "a"
[[pair]]
between = ["a", "a"]
friction = 0.3
restitution = 0.5
[[body]]
name = "ball"
shape = "sphere"
radius = 0.1
mass = 1
position = [0, 0, 0.1001]
velocity = [1, 0, -0.02]
material = "a"
)"};

Scene scene_of(std::size_t k) {
  Scene scene = parse_scene(kScenes[k], "fuzz.toml");
  scene.end = kEnd;
  scene.output.every = kEnd / 5;
  for (Expect& each : scene.expect) each.time = kEnd;
  return scene;
}

std::string content_of(const std::string& file, std::uint64_t hash) {
  return read_state(file, hash, false).content;
}

[[noreturn]] void found(const char* what, const Summary& s, double time) {
  std::fprintf(stderr, "%s: energies %g, %g, changes %g, %g, drift %g, penetration %g, time %g\n",
               what, s.start_energy, s.end_energy, s.lowest_change, s.largest_change, s.drift,
               s.penetration, time);
  std::abort();
}

const fuzz::MemoryFile& state_file() {
  static const fuzz::MemoryFile file("state");
  return file;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const Scene scene = scene_of(data[0] % std::size(kScenes));
  const std::string content(reinterpret_cast<const char*>(data) + 1, size - 1);
  write_state(state_file().path(), hash_of_motion(scene, make_plan(scene)), content);
  RunOptions options;
  options.restart = state_file().path();
  bool finite = true;
  options.record = [&](const Engine& engine) {
    for (const BodyState& b : engine.bodies())
      finite = finite && b.position.allFinite() && b.velocity.allFinite() &&
               b.angular_velocity.allFinite() && b.orientation.coeffs().allFinite();
    const Diagnostics d = engine.diagnostics();
    finite = finite && std::isfinite(d.kinetic_energy + d.potential_energy);
  };
  int asked = 0;
  options.interrupted = [&] { return ++asked > 2000; };
  try {
    const RunResult result = run(scene, options);
    const Summary& s = result.summary;
    if (result.failure.empty() && !finite)
      found("success with bodies that are no numbers", s, result.time);
    // One by one: their sum may be beyond the largest number where none of them is.
    for (const double x :
         {s.start_energy, s.end_energy, s.lowest_change, s.largest_change, s.drift, s.penetration})
      if (result.failure.empty() && !std::isfinite(x))
        found("success with sums that are no numbers", s, result.time);
    if (result.failure.empty() && !(result.time >= 0 && result.time <= 2 * kEnd))
      found("success at another time", s, result.time);
  } catch (const std::runtime_error&) {  // refused with the reason
  }
  return 0;
}

std::vector<std::string> own_corpus() {
  std::vector<std::string> out;
  for (std::size_t k = 0; k < std::size(kScenes); ++k) {
    Scene scene = scene_of(k);
    scene.end = kSaved;
    scene.output["state"] = state_file().path();
    run(scene);
    out.push_back(std::string(1, static_cast<char>(k)) +
                  content_of(scene.output["state"], hash_of_motion(scene, make_plan(scene))));
  }
  return out;
}

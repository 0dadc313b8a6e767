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

const char* const kScenes[] = {
    "[scene]\ngravity = [0, 0, -9.81]\n[smooth]\ntolerance = 1e-3\n[[body]]\nname = \"rod\"\nshape "
    "= "
    "\"capsule\"\nradius = 0.1\nlength = 1\nmass = 1\nposition = [0.5, 0, 0]\n[[joint]]\nkind = "
    "\"ball\"\nbodies = [\"rod\", \"world\"]\nat = [0, 0, 0]\n[[expect]]\nquantity = "
    "\"energy_change\"\nthroughout = true\nat_most = 1\n",
    "[scene]\ngravity = [0.1, 0, -9.81]\n[stepping]\nstep = 5e-3\non_failure = "
    "\"warn\"\n[[body]]\nname = "
    "\"floor\"\nshape = \"plane\"\nfixed = true\nmaterial = \"a\"\n[[pair]]\nbetween = [\"a\", "
    "\"a\"]\nfriction = 0.4\nrestitution = 0.3\n[[body]]\nname = \"one\"\nshape = "
    "\"sphere\"\nradius = "
    "0.1\nmass = 1\nposition = [0, 0, 0.1]\nmaterial = \"a\"\n[[body]]\nname = \"two\"\nshape = "
    "\"sphere\"\nradius = 0.1\nmass = 2\nposition = [0.02, 0.01, 0.3]\nmaterial = "
    "\"a\"\n[[expect]]\n"
    "quantity = \"position\"\nbody = \"one\"\nvalue = [0, 0, 0.1]\nwithin = 1\n"};

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
  write_state(state_file().path(), hash_of_motion(scene), content);
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
    scene.output.state = state_file().path();
    run(scene);
    out.push_back(std::string(1, static_cast<char>(k)) +
                  content_of(scene.output.state, hash_of_motion(scene)));
  }
  return out;
}

// Fuzz target of runs: scenes that a stranger wrote, moved for some steps by the engine that they
// ask for. SPDX-License-Identifier: BSD-3-Clause
//
// How much a scene may ask for is its author's business; here it is bounded before the run.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string_view>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>

#include "driver.hpp"

using namespace tether::scene;

namespace {

constexpr std::size_t kMost = 12;  // bodies, joints, springs
constexpr double kEnd = 0.03;
constexpr int kAsked = 300;  // steps, of all of them

bool is_small(const Scene& scene) {
  std::size_t points = 0;
  for (const Body& body : scene.bodies)
    for (const Shape& shape : body.shapes) points += 1 + shape.points.size();
  return points < 100 && scene.bodies.size() <= kMost && scene.joints.size() <= kMost &&
         scene.springs.size() <= kMost;
}

void bound(Scene& scene) {
  scene.end = std::min(scene.end, kEnd);
  scene.output = {};
  scene.output.every = scene.end / 3;
  for (Expect& each : scene.expect) each.time = std::min(each.time, scene.end);
  if (scene.smooth) scene.smooth->max_steps = std::min(scene.smooth->max_steps, kAsked);
  if (scene.event) scene.event->max_steps = std::min(scene.event->max_steps, 10 * kAsked);
  if (scene.stepping) {
    scene.stepping->threads = 1;
    scene.stepping->max_halvings = std::min(scene.stepping->max_halvings, 3);
    scene.stepping->max_work = 1e6;
  }
}

[[noreturn]] void found(const char* what, double value) {
  std::fprintf(stderr, "success with %s = %g\n", what, value);
  std::abort();
}

}  // namespace

// Whatever comes in: refused with the reason, or moved; a success is one in numbers.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    Scene scene =
        parse_scene(std::string_view(reinterpret_cast<const char*>(data), size), "fuzz.toml");
    if (!is_small(scene)) return 0;
    bound(scene);
    RunOptions options;
    int asked = 0;
    options.interrupted = [&] { return ++asked > kAsked; };
    bool finite = true;
    options.record = [&](const Engine& engine) {
      for (const BodyState& b : engine.bodies())
        finite = finite && b.position.allFinite() && b.velocity.allFinite() &&
                 b.angular_velocity.allFinite() &&
                 std::abs(b.orientation.coeffs().norm() - 1) < 1e-6;
      (void)engine.contacts();
      (void)engine.forces();
    };
    const RunResult result = run(scene, options);
    if (!result.failure.empty()) return 0;
    if (!finite) found("a body that is nowhere", 0);
    const Summary& s = result.summary;
    for (const double x :
         {s.start_energy, s.end_energy, s.lowest_change, s.largest_change, s.drift, s.penetration})
      if (!std::isfinite(x)) found("a sum", x);
    // A run of steps ends with the first one not before its end.
    const double step = scene.stepping.value_or(SteppingOptions{}).step;
    if (!(result.time >= 0 && result.time <= 2 * kEnd + step)) found("a time", result.time);
    for (const Judgement& each : result.judgements)
      for (const double x : each.value)
        if (each.verdict == Verdict::met && std::isnan(x)) found("an expectation met by", x);
  } catch (const SceneError&) {
  } catch (const std::invalid_argument&) {
  } catch (const std::runtime_error&) {
  }
  return 0;
}

std::vector<std::string> own_corpus() { return {}; }

// Tether: runs of a scene whose poses are compared. SPDX-License-Identifier: BSD-3-Clause
#include "measure.hpp"

#include <algorithm>
#include <cmath>

namespace tether::scene::costs {

namespace {

// Comparisons are for what ends soon: more than these are a storm.
constexpr int kMostEvents = 50000, kMostEventSteps = 1000000;

Eigen::Quaterniond turned(const Eigen::Vector3d& by, const Eigen::Quaterniond& q) {
  const double angle = by.norm();
  if (!(angle > 0)) return q;
  return Eigen::AngleAxisd(angle, by / angle) * q;
}

}  // namespace

Measured measure_once(const Scene& scene, const CostOptions& cost) {
  Measured out;
  RunOptions options;
  options.interrupted = cost.interrupted;
  for (int k = 1; k <= cost.samples; ++k) options.stops.push_back(scene.end * k / cost.samples);
  // Records and expectations stop the run at other times, too.
  std::size_t next = 0;
  options.record = [&](const Engine& engine) {
    while (next < options.stops.size() && engine.time() >= options.stops[next] * (1 - 1e-12)) {
      for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
        if (scene.bodies[b].fixed) continue;
        // A time step ends at its boundary; the way to it is straight, and about one axis.
        const BodyState& state = engine.bodies()[b];
        const double late = engine.time() - options.stops[next];
        out.samples.positions.push_back(state.position - late * state.velocity);
        out.samples.orientations.push_back(
            turned(-late * state.angular_velocity, state.orientation));
      }
      ++next;
    }
  };
  out.result = run(scene, options);
  if (out.result.interrupted) throw Interrupted{};
  return out;
}

double distance(const Samples& a, const Samples& b) {
  double largest = 0;
  for (std::size_t i = 0; i < std::min(a.positions.size(), b.positions.size()); ++i) {
    largest = std::max(largest, (a.positions[i] - b.positions[i]).norm());
    largest = std::max(largest, a.orientations[i].angularDistance(b.orientations[i]));
  }
  return largest;
}

double step_of(const Scene& scene) {
  return scene.stepping ? scene.stepping->step : std::min(SteppingOptions{}.step, 1e-3 * scene.end);
}

Scene with_setting(const Scene& scene, Method method, double setting) {
  Scene out = scene;
  out.output = Output{};
  out.output.every = out.end;  // records cost time
  if (method == Method::smooth) {
    out.smooth = scene.smooth.value_or(SmoothOptions{});
    out.smooth->tolerance = setting;
    return out;
  }
  out.engine = EngineChoice::automatic;
  out.event.reset();
  out.stepping.reset();
  if (method == Method::events) {
    out.event = scene.event.value_or(EventOptions{});
    out.event->otherwise = Otherwise::stop;
    out.event->tolerance = setting;
    out.event->max_events = std::min(out.event->max_events, kMostEvents);
    out.event->max_steps = std::min(out.event->max_steps, kMostEventSteps);
    return out;
  }
  out.stepping = scene.stepping.value_or(SteppingOptions{});
  out.stepping->step = method == Method::steps ? setting : step_of(scene);
  out.stepping->accuracy = method == Method::steps ? 0 : setting;
  return out;
}

}  // namespace tether::scene::costs

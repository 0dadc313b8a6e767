// Tether: runs of a scene whose poses are compared. SPDX-License-Identifier: BSD-3-Clause
#include "measure.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace tether::scene::costs {

namespace {

// Comparisons are for what ends soon: more than these are a storm.
constexpr int kMostEvents = 50000, kMostEventSteps = 1000000;
constexpr double kSame = 1e-12;  // of a time

Eigen::Quaterniond turned(const Eigen::Vector3d& by, const Eigen::Quaterniond& q) {
  const double angle = by.norm();
  if (!(angle > 0)) return q;
  return Eigen::AngleAxisd(angle, by / angle) * q;
}

}  // namespace

Measured measure_once(const Scene& scene, const std::vector<double>& times,
                      const CostOptions& cost) {
  Measured out;
  RunOptions options;
  options.interrupted = cost.interrupted;
  options.stops = times;
  // Records and expectations stop the run at other times, too.
  std::size_t next = 0;
  options.record = [&](const Engine& engine) {
    while (next < options.stops.size() && engine.time() >= options.stops[next] * (1 - kSame)) {
      out.samples.times.push_back(options.stops[next]);
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

Samples picked(const Samples& all, const std::vector<double>& times) {
  Samples out;
  if (all.times.empty()) return out;
  const std::size_t bodies = all.positions.size() / all.times.size();
  std::size_t j = 0;
  for (std::size_t i = 0; i < all.times.size(); ++i) {
    while (j < times.size() && times[j] < all.times[i] * (1 - kSame)) ++j;
    if (j == times.size()) break;
    if (times[j] > all.times[i] * (1 + kSame)) continue;
    out.times.push_back(all.times[i]);
    for (std::size_t k = i * bodies; k < (i + 1) * bodies; ++k) {
      out.positions.push_back(all.positions[k]);
      out.orientations.push_back(all.orientations[k]);
    }
  }
  return out;
}

double distance(const Samples& a, const Samples& b) {
  double largest = 0;
  if (a.times.empty() || b.times.empty()) return largest;
  const std::size_t bodies = a.positions.size() / a.times.size();
  std::size_t j = 0;
  for (std::size_t i = 0; i < a.times.size(); ++i) {
    while (j < b.times.size() && b.times[j] < a.times[i] * (1 - kSame)) ++j;
    if (j == b.times.size()) break;
    if (b.times[j] > a.times[i] * (1 + kSame)) continue;
    for (std::size_t k = 0; k < bodies; ++k) {
      const std::size_t m = i * bodies + k, n = j * bodies + k;
      largest = std::max(largest, (a.positions[m] - b.positions[n]).norm());
      largest = std::max(largest, a.orientations[m].angularDistance(b.orientations[n]));
    }
  }
  return largest;
}

std::vector<double> equal_times(double end, int count) {
  std::vector<double> out;
  for (int k = 1; k <= count; ++k) out.push_back(end * k / count);
  return out;
}

std::vector<double> step_ends(const Scene& scene, double step, int least) {
  const auto bodies = static_cast<double>(
      std::max<std::ptrdiff_t>(1, std::count_if(scene.bodies.begin(), scene.bodies.end(),
                                                [](const Body& b) { return !b.fixed; })));
  const double most = std::max(kMostPoses / bodies, static_cast<double>(least));
  const double stride = std::max(1.0, std::ceil(scene.end / step / most));
  std::vector<double> out;
  for (double k = stride; k * step < scene.end * (1 - kSame); k += stride) out.push_back(k * step);
  out.push_back(scene.end);
  return out;
}

std::vector<double> merged(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> all;
  std::merge(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(all));
  std::vector<double> out;
  for (const double t : all)
    if (out.empty() || t > out.back() * (1 + kSame)) out.push_back(t);
  return out;
}

double step_of(const Scene& scene) {
  return scene.stepping ? scene.stepping->step : std::min(SteppingOptions{}.step, 1e-3 * scene.end);
}

Scene with_setting(const Scene& scene, CostMethod method, double setting) {
  Scene out = scene;
  out.output = Output{};
  out.output.every = out.end;  // records cost time
  if (method == CostMethod::smooth) {
    out.smooth = scene.smooth.value_or(SmoothOptions{});
    out.smooth->tolerance = setting;
    return out;
  }
  out.engine = EngineChoice::automatic;
  out.event.reset();
  out.stepping.reset();
  if (method == CostMethod::events) {
    out.event = scene.event.value_or(EventOptions{});
    out.event->otherwise = Otherwise::stop;
    out.event->tolerance = setting;
    out.event->max_events = std::min(out.event->max_events, kMostEvents);
    out.event->max_steps = std::min(out.event->max_steps, kMostEventSteps);
    return out;
  }
  out.stepping = scene.stepping.value_or(SteppingOptions{});
  out.stepping->step = method == CostMethod::steps ? setting : step_of(scene);
  out.stepping->accuracy = method == CostMethod::steps ? 0 : setting;
  return out;
}

}  // namespace tether::scene::costs

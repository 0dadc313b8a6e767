// Tether: the times at which a run stops. SPDX-License-Identifier: BSD-3-Clause
#include "schedule.hpp"

#include <algorithm>

namespace tether::scene {

namespace {

/// k * every, k = 1, 2, ..., up to the end (to rounding).
std::vector<double> multiples(double every, double end) {
  std::vector<double> times;
  const double count = end / every * (1 + 1e-12);
  for (long k = 1; static_cast<double>(k) <= count; ++k)
    times.push_back(static_cast<double>(k) * every);
  return times;
}

void merge(const Event& from, Event& into) {
  if (from.record && !into.record) into.time = from.time;
  into.record = into.record || from.record;
  into.expect = into.expect || from.expect;
  into.checkpoint = into.checkpoint || from.checkpoint;
  into.stop = into.stop || from.stop;
  into.end = into.end || from.end;
}

}  // namespace

std::vector<Event> schedule(const Scene& scene, const std::vector<double>& stops) {
  std::vector<Event> all;
  const auto add = [&](double time, bool Event::*reason) {
    if (!(time > 0) || (time > scene.end && !same_time(time, scene.end))) return;
    Event event;
    event.time = time;
    event.*reason = true;
    all.push_back(event);
  };
  const double every = scene.output.every > 0 ? scene.output.every : scene.end / 1000;
  for (const double t : multiples(every, scene.end)) add(t, &Event::record);
  if (scene.output.checkpoint > 0)
    for (const double t : multiples(scene.output.checkpoint, scene.end)) add(t, &Event::checkpoint);
  for (const Expect& expect : scene.expect) add(expect.time, &Event::expect);
  for (const double t : stops) add(t, &Event::stop);
  add(scene.end, &Event::end);
  std::stable_sort(all.begin(), all.end(),
                   [](const Event& a, const Event& b) { return a.time < b.time; });
  std::vector<Event> merged;
  for (const Event& event : all)
    if (merged.empty() || !same_time(merged.back().time, event.time))
      merged.push_back(event);
    else
      merge(event, merged.back());
  return merged;
}

}  // namespace tether::scene

// Tether: an event engine that steps give back to. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/engine.hpp>

namespace tether::scene::event {

constexpr const char* kNoState = "this is not a state of the event engine";

/// A state that steps of a length have led to. Gaps and speeds of contacts that rest there are as
/// large as what such a step makes of the accelerations.
struct SteppedState {
  double time = 0;  ///< s
  const std::vector<BodyState>& bodies;
  double step = 0;  ///< s
};

class ResumableEngine : public Engine {
 public:
  /// The contacts that are closed in that state; nothing where bodies overlap otherwise, which
  /// events have no rule for.
  virtual std::optional<std::vector<int>> closed_in(const SteppedState& state) = 0;
  /// Goes on from there; events() are those since, counts() go on from `so_far`. Throws
  /// SimulationError and std::invalid_argument, and then is as it was.
  virtual void resume(const SteppedState& state, const Counts& so_far) = 0;
};

/// As make_event_engine, which begins at once; the other one has no state before it is given one.
enum class Begin : bool { at_start, later };
std::unique_ptr<ResumableEngine> make_resumable_engine(const Scene& scene, Begin begin);

/// As make_event_engine_with_steps, of engines that are made so.
using MakeResumable = std::function<std::unique_ptr<ResumableEngine>(const Scene&, Begin)>;
std::unique_ptr<Engine> make_events_then_steps(const Scene& scene, MakeResumable make);

}  // namespace tether::scene::event

// Tether: steps, whole or in halves. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <chrono>

#include "stepping/stepper_parts.hpp"

namespace tether::contact {

void Stepper::Implementation::step() {
  outcome = {};
  part.unmeetable = false;
  const double start = static_cast<double>(counts.steps) * options.step + late;
  const double length = options.step - late;
  if (options.accuracy > 0)
    advance_accurately(start, length);
  else {
    part.cuts_left = cuts ? detail::StepCuts::kMost : 0;
    if (cuts) cuts->earn();
    advance(whole(start, length));
  }
  if (!is_finite()) {
    outcome.succeeded = false;
    outcome.status = Status::unsolved;
  }
  late = 0;
  ++counts.steps;
}

// Velocities near the largest number leave none to the next operation.
bool Stepper::Implementation::is_finite() const {
  for (std::size_t i = 0; i < bodies.position.size(); ++i)
    if (!bodies.position[i].allFinite() || !bodies.orientation[i].coeffs().allFinite() ||
        !bodies.motion[i].velocity.allFinite() || !bodies.motion[i].angular_velocity.allFinite())
      return false;
  return true;
}

namespace {

// w dt of what joints hold: an explicit step is stable below 2, and its iterations for the joints
// contract by (w dt)^2.
constexpr double kResolved = 1;
// w^2 goes with the ratio of load and link, and with the shock where a slack chain snaps taut: each
// halving allows four times as much.
constexpr int kJointHalvings = 20;

}  // namespace

detail::SubStep Stepper::Implementation::whole(double start, double length) const {
  return {start, length, options.max_halvings, kJointHalvings};
}

void Stepper::Implementation::advance(detail::SubStep s) {
  part.now = s;
  if (joints && part.joints_active && s.joint_halvings > 0 && !resolves_joints()) {
    --s.joint_halvings;
    return take_halves(s);
  }
  if (run_stages()) return;
  // Nothing has moved yet.
  bodies.motion = impacts->coming();
  if (part.end == Part::End::cut) return advance_cut(s);
  if (part.end == Part::End::woken) return advance(s);
  if (part.end == Part::End::unmet) {
    --s.joint_halvings;
  } else {
    solver->take_back();
    --s.halvings;
  }
  take_halves(s);
}

bool Stepper::Implementation::resolves_joints() const {
  const double turn = joints->vibration().frequency * part.now.length;
  return !(turn > kResolved) || !std::isfinite(turn);  // no step helps where it is no number
}

void Stepper::Implementation::take_halves(const detail::SubStep& s) {
  const double half = s.length / 2;
  if (solver) solver->scale_warm_start(0.5);
  ++counts.halved;
  advance(s.over(s.start, half));
  advance(s.over(s.start + half, half));
  if (solver) solver->scale_warm_start(2);
}

// false: the contact problem failed, and the step is to be taken in halves; or it is
// to be cut, or taken anew with what it has woken.
bool Stepper::Implementation::run_stages() {
  using Clock = std::chrono::steady_clock;
  Clock::time_point start = Clock::now();
  part.failed = false;
  part.end = Part::End::none;
  for (Stage& stage : stages) {
    if (stage.method)
      (this->*stage.method)();
    else
      force[at(stage.force)](bodies, part.now.start, part.now.length);
    const Clock::time_point end = Clock::now();
    stage.seconds += std::chrono::duration<double>(end - start).count();
    start = end;
    if (part.end != Part::End::none) return false;
  }
  return true;
}

// Whether a shorter step would not help: there is none, or there is an impact. What an impact takes
// does not hang on the length of the step. Who accepts nothing gets the shorter steps even so.
bool Stepper::Implementation::shortest() const {
  const bool impact = options.acceptance > 1 && !impacts->list().empty();
  return options.max_halvings > 0 && (part.now.halvings == 0 || impact);
}

detail::Judgement Stepper::Implementation::judged() const {
  return {outcome, counts.bounces, counts.accepted, counts.unsolved};
}

void Stepper::Implementation::set_judged(const detail::Judgement& b) {
  outcome = b.outcome;
  counts.bounces = b.bounces;
  counts.accepted = b.accepted;
  counts.unsolved = b.unsolved;
}

// Accepts the solution, or not; one that a shorter step replaces leaves no trace.
void Stepper::Implementation::judge() {
  const bool solved = solution.status == Status::solved;
  const double last = options.acceptance > 1 ? detail::kLast : detail::kGood;
  const double most = std::max(accepted_residual(options), shortest() ? last : 0.0);
  part.failed = !solved && !(solution.error <= most);
  if (part.failed && part.now.halvings > 0) {
    part.end = Part::End::unsolved;
    return;
  }
  counts.accepted += !solved && !part.failed;
  counts.unsolved += part.failed;
  if (!solved) outcome.status = solution.status;
  outcome.succeeded = outcome.succeeded && !part.failed;
  if (!(solution.error <= outcome.residual)) outcome.residual = solution.error;
}

}  // namespace tether::contact

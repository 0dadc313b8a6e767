// Tether: the stages of a step. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <limits>

#include "joints/cone_islands.hpp"
#include "stepping/stepper_parts.hpp"

namespace tether::contact {

using Eigen::Vector3d;

namespace {

// Rounding of gaps in many steps, in parts of the positions.
constexpr double kClosed = 1e3 * std::numeric_limits<double>::epsilon();

}  // namespace

void Stepper::Implementation::make_stages() {
  using I = Implementation;
  motion.list(bodies, joints.get(), options.gyroscopic);
  if (joints) add_stage("joints", &I::begin_joints);
  const char* impact = restitution ? "restitution" : solver ? "collision" : "joints";
  if (impacts) add_stage(impact, &I::remember_velocities);
  if (options.gravity) add_stage("gravity", &I::apply_gravity);
  if (falls()) add_stage("gravity", &I::remember_weight);
  after_forces = stages.size();
  if (motion.any_long()) {
    if (options.gyroscopic == Gyroscopic::explicit_step)
      add_stage("gyroscopic term", &I::gyrate_explicit);
    if (options.gyroscopic == Gyroscopic::implicit_step)
      add_stage("gyroscopic term", &I::gyrate_implicit);
  }
  if (sleeping) add_stage("sleep", &I::hold_sleepers);
  if (joints) add_stage("joints", &I::predict_joints);
  if (falls()) add_stage("gravity", &I::find_falling);
  if (near) {
    add_stage("collision", &I::find_contacts);
    add_stage(impact, &I::choose_impacts);
    if (cuts) add_stage(impact, &I::look_for_cut);
    if (restitution) add_stage("restitution", &I::choose_bounces);
    add_stage("contact", &I::solve_contacts);
    if (restitution) add_stage("restitution", &I::rebound);
    add_stage(impact, &I::take_later_impacts);
    add_stage("collision", &I::meet_others);
    if (positions) add_stage("penetration", &I::close_gaps);
    if (positions) add_stage("penetration", &I::take_penetrations_back);
    if (joints) add_stage("joints", &I::put_back_joints);
  } else if (solver) {
    if (restitution) add_stage("joints", &I::choose_bounces);
    add_stage("joints", &I::solve_contacts);
    if (restitution) add_stage("joints", &I::rebound);
  }
  add_stage("motion", &I::move);
  if (falls()) add_stage("gravity", &I::fall);
  if (motion.any_free_round()) add_stage("motion", &I::turn_round);
  if (motion.any_free_long()) {
    if (options.gyroscopic == Gyroscopic::momentum)
      add_stage("gyroscopic term", &I::turn_keeping_momentum);
    else
      add_stage("motion", &I::turn_plain);
  }
  if (joints) add_stage("joints", &I::move_joints);
  if (sleeping) add_stage("sleep", &I::end_sleep);
}

void Stepper::Implementation::find_contacts() {
  if (options.team) options.team->place(bodies.position);
  near->find(bodies, part.now.length, contacts);
  if (joints) leave_out_joined();
  if (sleeping && sleeping->wake_touched(*near, bodies, *impacts, part.now.length, contacts)) {
    part.end = Part::End::woken;
    return;
  }
  leave_out_passive();
  if (part.before_impact) leave_out_striking();
  set_gaps();
  part.free_motion = bodies.motion;
  part.before = judged();
}

// Gaps that rounding leaves differ from contact to contact, and where bodies rest on more contacts
// than they need no velocities have them all: in gap / dt they would choose who carries the load.
void Stepper::Implementation::set_gaps() {
  for (std::size_t k = 0; k < contacts.gaps.size(); ++k) {
    const double gap = contacts.gaps[k];
    outcome.deepest = std::max(outcome.deepest, -gap);
    PointContact& c = contacts.points[k];
    const double size = c.r1.lpNorm<1>() + bodies.position[at(c.first)].lpNorm<1>();
    const double open = std::min(gap, 2 * (gap - kClosed * size));
    c.bias = open > 0 ? open / part.now.length : 0;
  }
}

// Bodies that impacts have sent where their velocities before did not take them: with what they
// would go into, the problem is solved again. What is left after three times the next step sees.
void Stepper::Implementation::meet_others() {
  for (int again = 0; again < 3 && !part.failed; ++again) {
    const std::size_t before = contacts.points.size();
    if (!near->find_more(bodies, part.now.length, contacts)) return;
    if (joints) leave_out_joined();
    if (sleeping) sleeping->leave_out(contacts);
    leave_out_passive();
    if (contacts.points.size() == before) return;
    bodies.motion = part.free_motion;
    solver->take_back();
    set_judged(part.before);
    set_gaps();
    choose_impacts();
    if (restitution) choose_bounces();
    solve_contacts();
    if (part.end != Part::End::none) return;
    if (restitution) rebound();
    take_later_impacts();
  }
}

void Stepper::Implementation::hold_sleepers() {
  sleeping->hold(impacts->coming(), part.now.length, bodies);
  if (!sleeping->take_changed()) return;
  near->set_resting(sleeping->asleep());
  const WarmStart woken = sleeping->take_woken(part.now.length);
  if (woken.ids.empty()) return;
  WarmStart start = solver->warm_start();
  start.ids.insert(start.ids.end(), woken.ids.begin(), woken.ids.end());
  start.impulses.insert(start.impulses.end(), woken.impulses.begin(), woken.impulses.end());
  solver->set_warm_start(start);
}

void Stepper::Implementation::end_sleep() {
  if (!part.failed && !part.of_cut) sleeping->fall_asleep(part.now.length, bodies, contacts);
  sleeping->end(part.now.length, bodies, contacts);
}

void Stepper::Implementation::choose_impacts() {
  impacts->choose(*near, bodies, part.now.length, contacts);
}

void Stepper::Implementation::solve_problem() {
  solver->solve(bodies.motion, turned, solution);
  ++counts.contact_problems;
  counts.sweeps += solution.sweeps;
  counts.assembled_islands += solution.assembled_islands;
}

void Stepper::Implementation::solve_contacts() {
  contacts.impulses.resize(contacts.points.size());  // assign() would grow without reserve
  std::fill(contacts.impulses.begin(), contacts.impulses.end(), Vector3d::Zero());
  contacts.moments.clear();
  part.failed = false;
  const bool laws = joints && joints->has_laws() && part.joints_active;
  if ((contacts.points.empty() && !laws) || (part.of_cut && !laws && nothing_presses())) {
    solver->forget();
    return;
  }
  turned.reserve(contacts.points.capacity());
  turned = contacts.points;
  if (near)
    mid_step.turn(*near, *impacts, bodies, joints.get(), options.gyroscopic, part.now.length,
                  turned);
  solve_problem();
  if (shortest() && solution.status != Status::solved &&
      !(solution.error <= std::max(accepted_residual(options), detail::kGood))) {
    solver->set_options(detail::patient_options(options));
    solve_problem();
    solver->set_options(detail::contact_options(options));
  }
  judge();
  if (part.end != Part::End::none) return;
  detail::take_velocities(solution, bodies);
  std::copy(solution.impulses.begin(), solution.impulses.end(), contacts.impulses.begin());
  if (rolling) contacts.moments = joints ? joints->moments() : rolling->moments();
}

void Stepper::Implementation::take_later_impacts() {
  if (impacts->list().empty()) return;
  const detail::LaterImpacts::Counts taken =
      later->take(*near, *impacts, part.now.length, bodies, contacts);
  counts.contact_problems += taken.problems;
  counts.sweeps += taken.sweeps;
  counts.bounces += taken.bounces;
}

// Contacts of bodies that a joint connects.
void Stepper::Implementation::leave_out_joined() {
  detail::keep_contacts(contacts, [&](std::size_t k) {
    return !joints->are_joined(contacts.points[k].first, contacts.points[k].second);
  });
}

// In parts, where their equations have no solution near the start of the iteration.
void Stepper::Implementation::predict_joints() {
  if (!part.joints_active) return;
  if (joints->predict(bodies, part.now.start, part.now.length) && resolves_joints()) return;
  if (part.now.joint_halvings > 0 && !part.unmeetable)
    part.end = Part::End::unmet;
  else
    part.unmeetable = true;
}

void Stepper::Implementation::move_joints() {
  if (!part.joints_active || joints->move(bodies, part.now.start, part.now.length, contacts))
    return;
  outcome.succeeded = outcome.joints_met = false;
}

}  // namespace tether::contact

// Tether: a sub-step as a list of stages. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/sub_stepper.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "stepping/detection/collide.hpp"

namespace tether::contact::detail {

using linalg::at;

namespace {

// Throws std::invalid_argument on options that this friction does not go with.
void check_friction(const char* of, const SteppingOptions& options) {
  const std::string kind = of;
  if (options.restitution_law != RestitutionLaw::newton)
    throw std::invalid_argument(kind + " friction needs restitution_law = newton");
  if (options.sleep > 0)
    throw std::invalid_argument("stepping: sleep does not go with " + kind + " friction");
}

std::vector<double> body_sizes(const BodySet& bodies, const std::vector<Surface>& surfaces) {
  std::vector<double> out(bodies.mass.size(), 0);
  for (const Surface& each : surfaces) {
    const auto i = at(each.body);
    if (i < out.size() && each.shape.kind != ShapeKind::plane)
      out[i] =
          std::max(out[i], each.shape.position.norm() + form(each.shape.kind).reach(each.shape));
  }
  for (std::size_t i = 0; i < out.size(); ++i)
    if (out[i] == 0 && bodies.mass[i] > 0)
      out[i] = std::sqrt(bodies.inertia[i].trace() / (2 * bodies.mass[i]));
  return out;
}

}  // namespace

SubStepper::SubStepper(BodySet given, std::vector<Surface> surfaces,
                       const std::vector<Meeting>& meetings, const SteppingOptions& o)
    : bodies(std::move(given)), options(o) {
  if (options.sleep > 0 || options.accuracy > 0) sizes = body_sizes(bodies, surfaces);
  if (!meetings.empty() && !surfaces.empty()) {
    near = std::make_unique<NearContacts>(bodies, std::move(surfaces), meetings, options.law,
                                          options.near_part);
    if (near->any_rolling()) {
      if (options.law != Law::coulomb)
        throw std::invalid_argument(
            std::string("rolling and torsional friction need law = coulomb, not ") +
            name(options.law));
      check_friction("rolling", options);
    }
    if (near->any_elliptic()) check_friction("elliptic", options);
    make_solvers();
    if (options.sleep > 0)
      sleeping = std::make_unique<Sleeping>(bodies, sizes, threshold_speed(options.sleep, options),
                                            options.gravity->norm());
  }
  make_stages();
}

SubStepper::~SubStepper() = default;

// The first solver is that of velocities, whose moments are those of the step.
void SubStepper::make_solvers() {
  const BodyOptions o = contact_options(options);
  const double impact = threshold_speed(options.impact_threshold, options);
  const double bounce = threshold_speed(options.restitution_threshold, options);
  const bool laws = joints && joints->has_laws(),
             bounces = near && near->any([](const Meeting&m) { return m.restitution > 0; });
  if (near && (near->any_rolling() || near->any_elliptic())) cones.near = near.get();
  const auto new_restitution = [&](LawUse use) {
    return std::make_unique<Restitution>(options.restitution_law, o, cones, use);
  };
  solver = std::make_unique<StepSolver>(o, cones, LawUse::all);
  if (!impacts) impacts = std::make_unique<Impacts>(impact, bounce);
  if (bounces || laws) restitution = new_restitution(LawUse::plastic);
  if (!near) return;
  if (options.cut_at_impacts && !(options.accuracy > 0))
    cuts = std::make_unique<StepCuts>(o, cones);
  if (bounces && cuts) bounces_at_once = new_restitution(LawUse::none);
  if (options.error_reduction > 0 && options.max_depenetration_speed > 0)
    positions = std::make_unique<PositionCorrection>(options, cones);
  if (laws && cuts && options.simultaneous_impacts == SimultaneousImpacts::together)
    cuts->leave_whole(cones.under_laws);
}

void SubStepper::add_force(const char* effect, Force force) {
  stages.insert(
      stages.begin() + static_cast<std::ptrdiff_t>(first_force + forces++),
      {effect, [this, force = std::move(force)] { force(bodies, now.start, now.length); }});
}

void SubStepper::add_joints(std::unique_ptr<StepJoints> part) {
  joints = std::move(part);
  if (!impacts)
    impacts = std::make_unique<Impacts>(threshold_speed(options.impact_threshold, options),
                                        threshold_speed(options.restitution_threshold, options));
  joints->begin(bodies, static_cast<double>(counts.steps) * options.step);
  if (sleeping) sleeping->set_joints(*joints);
  if (solver || joints->has_laws()) make_solvers();
  stages.clear();
  make_stages();
}

void SubStepper::observe(StepObserver observer) {
  using When = StepStage::When;
  const auto tell = [this, observer = std::move(observer)](const char* effect, When when) {
    static const std::vector<double> none;
    observer({effect, when, now.start, now.length, now.active, turned,
              joints ? joints->impulses_at_end : none});
  };
  for (std::size_t k = 0; k < stages.size(); ++k)
    stages[k].run = [this, tell, k, run = std::move(stages[k].run)] {
      const char* effect = stages[k].effect;
      if (k == 0) tell(effect, When::before_all);
      run();
      if (end == SubStepEnd::whole)
        tell(effect, k + 1 == stages.size() ? When::after_all : When::between);
    };
}

void SubStepper::make_stages() {
  using S = SubStepper;
  motion.list(bodies, joints.get(), options.gyroscopic);
  const bool falls = options.gravity && cuts;
  const char* impact = restitution ? "restitution" : solver ? "collision" : "joints";
  if (joints)
    stage("joints", [](S& s) {
      if (s.acting_joints) s.joints->begin(s.bodies, s.now.start);
    });
  if (impacts) stage(impact, [](S& s) { s.impacts->remember(s.bodies); });
  if (options.gravity)
    stage("gravity",
          [](S& s) { s.motion.accelerate(s.now.length * *s.options.gravity, s.bodies); });
  if (falls) stage("gravity", [](S& s) { s.motion.remember_weight(s.bodies); });
  first_force = stages.size();
  const bool explicit_or_implicit = options.gyroscopic == Gyroscopic::explicit_step ||
                                    options.gyroscopic == Gyroscopic::implicit_step;
  if (motion.any_long() && explicit_or_implicit)
    stage("gyroscopic term",
          [](S& s) { s.motion.gyrate(s.options.gyroscopic, s.now.length, s.bodies); });
  if (sleeping) stage("sleep", std::mem_fn(&S::hold_sleepers));
  if (joints) stage("joints", std::mem_fn(&S::predict_joints));
  if (falls) stage("gravity", [](S& s) { s.motion.find_falling(s.bodies); });
  add_contact_stages(impact);
  stage("motion", [](S& s) { s.motion.move(s.now.length, s.bodies); });
  if (falls)
    stage("gravity",
          [](S& s) { s.motion.fall(*s.options.gravity, s.now.length, s.contacts, s.bodies); });
  if (motion.any_free_round())
    stage("motion", [](S& s) { s.motion.turn_round(s.now.length, s.bodies); });
  if (motion.any_free_long()) {
    if (options.gyroscopic == Gyroscopic::momentum)
      stage("gyroscopic term",
            [](S& s) { s.motion.turn_keeping_momentum(s.now.length, s.bodies); });
    else
      stage("motion", [](S& s) { s.motion.turn_plain(s.now.length, s.bodies); });
  }
  if (joints) stage("joints", std::mem_fn(&S::move_joints));
  if (sleeping) stage("sleep", std::mem_fn(&S::end_sleep));
}

void SubStepper::add_contact_stages(const char* impact) {
  using S = SubStepper;
  if (near) {
    stage("collision", std::mem_fn(&S::find_contacts));
    stage(impact, std::mem_fn(&S::choose_impacts));
    if (cuts) stage(impact, std::mem_fn(&S::choose_cut));
  }
  const char* contact = near ? "contact" : "joints";
  if (restitution) stage(near ? impact : contact, std::mem_fn(&S::choose_bounces));
  if (solver) stage(contact, std::mem_fn(&S::solve_contacts));
  if (restitution) stage(near ? impact : contact, std::mem_fn(&S::rebound));
  if (!near) return;
  stage("collision", std::mem_fn(&S::meet_others));
  if (positions)
    stage("penetration", [](S& s) {
      s.positions->close_gaps(*s.impacts, s.free_motion, s.now.length, s.contacts,
                              s.motion.moving(), s.bodies);
      s.positions->take_back(s.tally.deepest, negligible_depth(s.options, s.now.length),
                             s.now.length, s.contacts, s.motion.moving(), s.bodies);
    });
  if (joints)
    stage("joints", [](S& s) {
      if (s.acting_joints) s.joints->put_back(s.bodies, s.now.start);
    });
}

void SubStepper::set_now(const SubStep& s) {
  now = s;
  if (!joints) return;
  const bool act =
      now.active == nullptr || std::any_of(motion.moving().begin(), motion.moving().end(),
                                           [&](int i) { return joints->holds(i) && now.has(i); });
  acting_joints = act ? joints.get() : nullptr;
  joints->set_active(act);
}

SubStepEnd SubStepper::take() {
  using Clock = std::chrono::steady_clock;
  Clock::time_point start = Clock::now();
  end = SubStepEnd::whole;
  for (Stage& stage : stages) {
    stage.run();
    const Clock::time_point stop = Clock::now();
    stage.seconds += std::chrono::duration<double>(stop - start).count();
    start = stop;
    if (end != SubStepEnd::whole) break;
  }
  return end;
}

bool SubStepper::resolves_joints() const {
  const double turn = joints->vibration().frequency * now.length;
  // w dt: an explicit step is stable below 2, and its iterations for joints contract by (w dt)^2.
  return !(turn > 1) || !std::isfinite(turn);  // no step helps where it is no number
}

// Velocities near the largest number leave none to the next operation.
bool SubStepper::is_finite() const {
  for (std::size_t i = 0; i < bodies.position.size(); ++i)
    if (!bodies.position[i].allFinite() || !bodies.orientation[i].coeffs().allFinite() ||
        !bodies.motion[i].velocity.allFinite() || !bodies.motion[i].angular_velocity.allFinite())
      return false;
  return true;
}

void SubStepper::remember(BodiesState& state) const {
  state.position = bodies.position;
  state.orientation = bodies.orientation;
  state.motion = bodies.motion;
  state.spin = motion.spins();
}

void SubStepper::restore(const BodiesState& state) {
  bodies.position = state.position;
  bodies.orientation = state.orientation;
  bodies.motion = state.motion;
  motion.spins() = state.spin;
}

StepMark SubStepper::mark() const {
  StepMark m;
  remember(m.bodies);
  m.contacts = solver->warm_start();
  if (positions) m.corrections = positions->warm_start();
  return m;
}

void SubStepper::go_back(const StepMark& m) {
  restore(m.bodies);
  solver->set_warm_start(m.contacts);
  if (positions) positions->set_warm_start(m.corrections);
}

}  // namespace tether::contact::detail

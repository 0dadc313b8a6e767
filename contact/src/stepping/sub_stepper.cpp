// Tether: takes the sub-steps of a step. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/sub_stepper.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "joints/cone_islands.hpp"
#include "stepping/detection/collide.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

// Rounding of gaps in many steps, in parts of the positions.
constexpr double kClosed = 1e3 * std::numeric_limits<double>::epsilon();
// w dt of what joints hold: an explicit step is stable below 2, and its iterations for the joints
// contract by (w dt)^2.
constexpr double kResolved = 1;

// Refuses by name what it does not go with.
void check_rolling(const SteppingOptions& options) {
  if (options.law != Law::coulomb)
    throw std::invalid_argument(
        std::string("rolling and torsional friction need law = coulomb, not ") + name(options.law));
  if (options.restitution_law != RestitutionLaw::newton)
    throw std::invalid_argument("rolling and torsional friction need restitution_law = newton");
  if (options.sleep > 0)
    throw std::invalid_argument("stepping: sleep does not go with rolling friction");
}

std::vector<double> body_sizes(const BodySet& bodies, const std::vector<Surface>& surfaces) {
  std::vector<double> out(bodies.mass.size(), 0);
  for (const Surface& each : surfaces) {
    const auto i = at(each.body);
    if (i < out.size() && each.shape.kind != ShapeKind::plane)
      out[i] = std::max(out[i], each.shape.position.norm() + reach(each.shape));
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
    if (near->any_rolling()) check_rolling(options);
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
  const bool laws = joints && joints->has_laws(), bounces = near && near->any_restitution();
  if (near && near->any_rolling()) rolling = std::make_unique<RollingPart>(*near);
  if (joints && rolling) joints->set_rolling(*near);
  IslandMaker* maker = rolling.get();
  if (joints) maker = joints.get();
  const auto new_restitution = [&](LawUse use) {
    return std::make_unique<Restitution>(options.restitution_law, o, maker, use);
  };
  solver = std::make_unique<StepSolver>(o, maker, LawUse::all);
  if (!impacts) impacts = std::make_unique<Impacts>(impact, bounce);
  if (bounces || laws) restitution = new_restitution(LawUse::plastic);
  if (laws) restitution->set_laws(*joints);
  if (!near) return;
  later = std::make_unique<LaterImpacts>(impact, bounce, o, maker,
                                         bounces ? new_restitution(LawUse::none) : nullptr);
  if (options.cut_at_impacts && !(options.accuracy > 0))
    cuts = std::make_unique<StepCuts>(o, maker);
  if (bounces && cuts) bounces_at_once = new_restitution(LawUse::none);
  if (options.error_reduction > 0 && options.max_depenetration_speed > 0)
    positions = std::make_unique<PositionCorrection>(options, maker);
  if (!laws) return;
  later->set_laws(*joints);
  if (cuts && options.simultaneous_impacts == SimultaneousImpacts::together)
    cuts->set_laws(*joints);
}

void SubStepper::add_force(const char* effect, Force force) {
  has_forces = true;
  stages.insert(
      stages.begin() + static_cast<std::ptrdiff_t>(after_forces++),
      {effect, [this, force = std::move(force)] { force(bodies, now.start, now.length); }});
}

void SubStepper::add_joints(std::unique_ptr<JointPart> part) {
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

void SubStepper::add_stage(const char* effect, void (SubStepper::*method)()) {
  stages.push_back({effect, [this, method] { (this->*method)(); }});
}

void SubStepper::make_stages() {
  using S = SubStepper;
  motion.list(bodies, joints.get(), options.gyroscopic);
  if (joints) add_stage("joints", &S::begin_joints);
  const char* impact = restitution ? "restitution" : solver ? "collision" : "joints";
  if (impacts) add_stage(impact, &S::remember_velocities);
  if (options.gravity) add_stage("gravity", &S::apply_gravity);
  if (falls()) add_stage("gravity", &S::remember_weight);
  after_forces = stages.size();
  if (motion.any_long()) {
    if (options.gyroscopic == Gyroscopic::explicit_step)
      add_stage("gyroscopic term", &S::gyrate_explicit);
    if (options.gyroscopic == Gyroscopic::implicit_step)
      add_stage("gyroscopic term", &S::gyrate_implicit);
  }
  if (sleeping) add_stage("sleep", &S::hold_sleepers);
  if (joints) add_stage("joints", &S::predict_joints);
  if (falls()) add_stage("gravity", &S::find_falling);
  if (near) {
    add_stage("collision", &S::find_contacts);
    add_stage(impact, &S::choose_impacts);
    if (cuts) add_stage(impact, &S::look_for_cut);
    if (restitution) add_stage("restitution", &S::choose_bounces);
    add_stage("contact", &S::solve_contacts);
    if (restitution) add_stage("restitution", &S::rebound);
    add_stage(impact, &S::take_later_impacts);
    add_stage("collision", &S::meet_others);
    if (positions) add_stage("penetration", &S::close_gaps);
    if (positions) add_stage("penetration", &S::take_penetrations_back);
    if (joints) add_stage("joints", &S::put_back_joints);
  } else if (solver) {
    if (restitution) add_stage("joints", &S::choose_bounces);
    add_stage("joints", &S::solve_contacts);
    if (restitution) add_stage("joints", &S::rebound);
  }
  add_stage("motion", &S::move);
  if (falls()) add_stage("gravity", &S::fall);
  if (motion.any_free_round()) add_stage("motion", &S::turn_round);
  if (motion.any_free_long()) {
    if (options.gyroscopic == Gyroscopic::momentum)
      add_stage("gyroscopic term", &S::turn_keeping_momentum);
    else
      add_stage("motion", &S::turn_plain);
  }
  if (joints) add_stage("joints", &S::move_joints);
  if (sleeping) add_stage("sleep", &S::end_sleep);
}

void SubStepper::set_now(const SubStep& s) {
  now = s;
  if (!joints) return;
  joints_active =
      now.active == nullptr || std::any_of(motion.moving().begin(), motion.moving().end(),
                                           [&](int i) { return joints->holds(i) && now.has(i); });
  joints->set_active(joints_active);
}

SubStepEnd SubStepper::take() {
  using Clock = std::chrono::steady_clock;
  Clock::time_point start = Clock::now();
  failed = false;
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
  return !(turn > kResolved) || !std::isfinite(turn);  // no step helps where it is no number
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

void SubStepper::leave_out_joined() {
  if (!joints) return;
  keep_contacts(contacts, [&](std::size_t k) {
    return !joints->are_joined(contacts.points[k].first, contacts.points[k].second);
  });
}

// Islands were apart when they were chosen: bodies that an impact has sent to others must take
// their step with them.
void SubStepper::leave_out_passive() {
  if (now.active == nullptr) return;
  const auto waits = [&](int i) { return bodies.mass[at(i)] > 0 && !now.has(i); };
  const auto moves = [&](int i) { return bodies.mass[at(i)] > 0 && now.has(i); };
  keep_contacts(contacts, [&](std::size_t k) {
    const PointContact& c = contacts.points[k];
    if (!waits(c.first) && !waits(c.second)) return true;
    met = met || moves(c.first) || moves(c.second);
    return false;
  });
}

// Before an impact its contacts are left out, so that nothing of it is taken: how far forces of
// other contacts let them go by then differs from where they touch by the square of the length.
void SubStepper::find_contacts() {
  if (options.team) options.team->place(bodies.position);
  near->find(bodies, now.length, contacts);
  leave_out_joined();
  if (sleeping && sleeping->wake_touched(*near, bodies, *impacts, now.length, contacts)) {
    end = SubStepEnd::woken;
    return;
  }
  leave_out_passive();
  if (now.side == SubStep::Side::approach)
    keep_contacts(contacts, [&](std::size_t k) { return !cuts->strikes(contacts.points[k]); });
  set_gaps();
  free_motion = bodies.motion;
  tally_before = tally;
}

// Gaps that rounding leaves differ from contact to contact, and where bodies rest on more contacts
// than they need no velocities have them all: in gap / dt they would choose who carries the load.
void SubStepper::set_gaps() {
  for (std::size_t k = 0; k < contacts.gaps.size(); ++k) {
    const double gap = contacts.gaps[k];
    tally.deepest = std::max(tally.deepest, -gap);
    PointContact& c = contacts.points[k];
    const double size = c.r1.lpNorm<1>() + bodies.position[at(c.first)].lpNorm<1>();
    const double open = std::min(gap, 2 * (gap - kClosed * size));
    c.bias = open > 0 ? open / now.length : 0;
  }
}

// Impacts; and, where anything bounces, contacts that are slow at the start of the sub-step, or
// that bodies leave and fall back to, but that an impact closes in it; or later, though the problem
// of the sub-step would hold them where they are above it.
void SubStepper::look_for_cut() {
  const std::vector<Impact>& chosen = impacts->list();
  if (now.cuts == 0 || !(restitution || !chosen.empty()) || !cuts->may_cut(contacts.points.size()))
    return;
  approaches.clear();
  approaches.reserve(contacts.points.capacity());  // no more often than contacts do
  const auto fall = [&](const PointContact& c) {
    const double apart = options.gravity ? now.length * c.normal.dot(*options.gravity) : 0;
    return (motion.falls(c.second) ? apart : 0) - (motion.falls(c.first) ? apart : 0);
  };
  for (const Impact& i : chosen)
    approaches.push_back({i.contact, i.came, i.comes, fall(contacts.points[at(i.contact)])});
  std::size_t next = 0;  // of those chosen, which are in order
  for (std::size_t k = 0; restitution && k < contacts.points.size(); ++k) {
    if (next < chosen.size() && at(chosen[next].contact) == k) {
      ++next;
      continue;
    }
    const PointContact& c = contacts.points[k];
    const double comes = -normal_velocity(bodies.motion, c);
    if (!(comes * now.length > contacts.gaps[k])) continue;
    const Approach a{static_cast<int>(k), -normal_velocity(impacts->coming(), c), comes, fall(c)};
    if (a.more(now.length) > 0 &&
        impacts->is_impact(*near, c, a.speed(contacts.gaps[k], now.length)))
      approaches.push_back(a);
  }
  if (cuts->choose(approaches, now.length, *near, bodies, contacts)) end = SubStepEnd::cut;
}

void SubStepper::choose_bounces() {
  const bool laws = joints && joints_active;
  restitution->choose(*impacts, *impacts, laws ? joints->strikes() : std::vector<Strike>(), bodies,
                      contacts);
}

void SubStepper::solve_problem() {
  solver->solve(bodies.motion, turned, solution);
  ++counts.contact_problems;
  counts.sweeps += solution.sweeps;
  counts.assembled_islands += solution.assembled_islands;
}

// No contact closes by the velocities that bodies have: there is nothing to solve.
bool SubStepper::nothing_presses() const {
  for (const PointContact& c : contacts.points)
    if (normal_velocity(bodies.motion, c) + c.bias < 0) return false;
  return true;
}

void SubStepper::solve_contacts() {
  contacts.impulses.resize(contacts.points.size());  // assign() would grow without reserve
  std::fill(contacts.impulses.begin(), contacts.impulses.end(), Vector3d::Zero());
  contacts.moments.clear();
  failed = false;
  const bool laws = joints && joints->has_laws() && joints_active;
  const bool of_cut = now.side != SubStep::Side::none;
  if ((contacts.points.empty() && !laws) || (of_cut && !laws && nothing_presses())) {
    solver->forget();
    return;
  }
  turned.reserve(contacts.points.capacity());
  turned = contacts.points;
  if (near)
    mid_step.turn(*near, *impacts, bodies, joints.get(), options.gyroscopic, now.length, turned);
  solve_problem();
  if (shortest() && solution.status != Status::solved &&
      !(solution.error <= std::max(accepted_residual(options), kGood))) {
    solver->set_options(patient_options(options));
    solve_problem();
    solver->set_options(contact_options(options));
  }
  judge();
  if (end != SubStepEnd::whole) return;
  take_velocities(solution, bodies);
  std::copy(solution.impulses.begin(), solution.impulses.end(), contacts.impulses.begin());
  if (rolling) contacts.moments = joints ? joints->moments() : rolling->moments();
}

// Whether a shorter step would not help: there is none, or there is an impact. What an impact takes
// does not hang on the length of the step. Who accepts nothing gets the shorter steps even so.
bool SubStepper::shortest() const {
  const bool impact = options.acceptance > 1 && !impacts->list().empty();
  return options.max_halvings > 0 && (now.halvings == 0 || impact);
}

void SubStepper::judge() {
  const bool solved = solution.status == Status::solved;
  const double last = options.acceptance > 1 ? kLast : kGood;
  const double most = std::max(accepted_residual(options), shortest() ? last : 0.0);
  failed = !solved && !(solution.error <= most);
  if (failed && now.halvings > 0) {
    end = SubStepEnd::unsolved;
    return;
  }
  tally.accepted += !solved && !failed;
  tally.unsolved += failed;
  if (!solved) tally.status = solution.status;
  tally.succeeded = tally.succeeded && !failed;
  if (!(solution.error <= tally.residual)) tally.residual = solution.error;
}

void SubStepper::take_later_impacts() {
  if (impacts->list().empty()) return;
  const LaterImpacts::Counts taken = later->take(*near, *impacts, now.length, bodies, contacts);
  counts.contact_problems += taken.problems;
  counts.sweeps += taken.sweeps;
  tally.bounces += taken.bounces;
}

// Bodies that impacts have sent where their velocities before did not take them: with what they
// would go into, the problem is solved again. What is left after three times the next step sees.
void SubStepper::meet_others() {
  for (int again = 0; again < 3 && !failed; ++again) {
    const std::size_t before = contacts.points.size();
    if (!near->find_more(bodies, now.length, contacts)) return;
    leave_out_joined();
    if (sleeping) sleeping->leave_out(contacts);
    leave_out_passive();
    if (contacts.points.size() == before) return;
    bodies.motion = free_motion;
    solver->take_back();
    tally = tally_before;
    set_gaps();
    choose_impacts();
    if (restitution) choose_bounces();
    solve_contacts();
    if (end != SubStepEnd::whole) return;
    if (restitution) rebound();
    take_later_impacts();
  }
}

void SubStepper::hold_sleepers() {
  sleeping->hold(impacts->coming(), now.length, bodies);
  if (!sleeping->take_changed()) return;
  near->set_resting(sleeping->asleep());
  const WarmStart woken = sleeping->take_woken(now.length);
  if (woken.ids.empty()) return;
  WarmStart start = solver->warm_start();
  start.ids.insert(start.ids.end(), woken.ids.begin(), woken.ids.end());
  start.impulses.insert(start.impulses.end(), woken.impulses.begin(), woken.impulses.end());
  solver->set_warm_start(start);
}

void SubStepper::end_sleep() {
  if (!failed && now.side == SubStep::Side::none)
    sleeping->fall_asleep(now.length, bodies, contacts);
  sleeping->end(now.length, bodies, contacts);
}

// In parts, where their equations have no solution near the start of the iteration.
void SubStepper::predict_joints() {
  if (!joints_active) return;
  if (joints->predict(bodies, now.start, now.length) && resolves_joints()) return;
  if (now.joint_halvings > 0 && !unmeetable)
    end = SubStepEnd::unmet;
  else
    unmeetable = true;
}

void SubStepper::move_joints() {
  if (!joints_active || joints->move(bodies, now.start, now.length, contacts)) return;
  tally.succeeded = tally.joints_met = false;
}

}  // namespace tether::contact::detail

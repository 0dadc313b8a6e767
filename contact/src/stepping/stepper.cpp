// Tether: impulse-velocity steps. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tether/contact/stepping.hpp>
#include <utility>

#include "near_contacts.hpp"
#include "restitution.hpp"
#include "rotation.hpp"

namespace tether::contact {

using detail::NearContacts;
using detail::Restitution;
using Eigen::Vector3d;

namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

void check(const SteppingOptions& o) {
  const auto demand = [](bool holds, const char* what) {
    if (!holds) throw std::invalid_argument(std::string("stepping: ") + what);
  };
  demand(o.step > 0 && std::isfinite(o.step), "step must be > 0 and finite");
  demand(!o.gravity || o.gravity->allFinite(), "gravity must be finite");
  demand(o.tolerance > 0, "tolerance must be > 0");
  demand(o.error_reduction >= 0 && o.error_reduction <= 1, "error_reduction must lie in 0 .. 1");
  demand(o.max_depenetration_speed >= 0, "max_depenetration_speed must be >= 0");
  demand(o.restitution_threshold >= 0, "restitution_threshold must be >= 0");
  demand(o.near_part >= 0, "near_part must be >= 0");
}

BodyOptions solver_options(const SteppingOptions& o) {
  BodyOptions b;
  b.law = o.law;
  b.tolerance = o.tolerance;
  b.min_sweeps = o.min_sweeps;
  b.max_sweeps = o.max_sweeps;
  b.max_assembled = o.max_assembled;
  b.max_work = o.max_work;
  b.threads = o.threads;
  return b;
}

// Penetrations need not vanish in one step: a rough answer is good enough, as the next step sees
// what is left.
BodyOptions correction_options(const SteppingOptions& o) {
  BodyOptions b = solver_options(o);
  b.law = Law::frictionless;
  b.tolerance = 1e-2;
  b.min_sweeps = 0;
  b.max_sweeps = 10;
  b.max_assembled = 0;
  return b;
}

}  // namespace

const char* name(Gyroscopic gyroscopic) {
  switch (gyroscopic) {
    case Gyroscopic::none:
      return "none";
    case Gyroscopic::explicit_step:
      return "explicit";
    case Gyroscopic::implicit_step:
      return "implicit";
    case Gyroscopic::momentum:
      return "momentum";
  }
  return "?";
}

// A step is the list of stages, made once from what the scene asks for.
struct Stepper::Implementation {
  using Method = void (Implementation::*)();
  struct Stage {
    const char* effect;
    Method method;  // null: the force
    int force;
    double seconds;
  };

  BodySet bodies;
  SteppingOptions options;
  std::vector<Stage> stages;
  std::size_t after_forces = 0;  // where the next force goes
  std::vector<Force> force;
  std::vector<int> moving, round_bodies, long_bodies;  // of inertia 1 or not

  std::vector<detail::FreeSpin> free_spin;  // of long_bodies

  // Only with meetings.
  std::unique_ptr<NearContacts> near;
  std::unique_ptr<BodySolver> solver;
  std::unique_ptr<Restitution> restitution;
  StepContacts contacts;
  BodySolution solution;
  double deepest = 0;

  // Only with error reduction.
  std::unique_ptr<BodySolver> correction;
  BodySolution correction_solution;
  std::vector<RigidBody> at_rest;
  bool corrects = false;

  StepCounts counts;

  void add_stage(const char* effect, Method method) { stages.push_back({effect, method, -1, 0}); }
  void make_stages();

  void remember_velocities() { restitution->remember(bodies); }
  void apply_gravity();
  void gyrate_explicit();
  void gyrate_implicit();
  void find_contacts();
  void choose_bounces() { restitution->choose(*near, bodies, options.step, contacts); }
  void solve_contacts();
  void rebound() { counts.bounces += restitution->apply(bodies, contacts); }
  void correct_penetration();
  void move();
  void turn_round();
  void turn_plain();
  void turn_keeping_momentum();
};

void Stepper::Implementation::make_stages() {
  using I = Implementation;
  for (int i = 0; i < bodies.size(); ++i) {
    if (bodies.mass[at(i)] == 0) continue;
    moving.push_back(i);
    const bool round = detail::is_isotropic(bodies.inertia[at(i)]);
    (round ? round_bodies : long_bodies).push_back(i);
  }
  if (restitution) add_stage("restitution", &I::remember_velocities);
  if (options.gravity) add_stage("gravity", &I::apply_gravity);
  after_forces = stages.size();
  if (!long_bodies.empty()) {
    if (options.gyroscopic == Gyroscopic::explicit_step)
      add_stage("gyroscopic term", &I::gyrate_explicit);
    if (options.gyroscopic == Gyroscopic::implicit_step)
      add_stage("gyroscopic term", &I::gyrate_implicit);
  }
  if (near) {
    add_stage("collision", &I::find_contacts);
    if (restitution) add_stage("restitution", &I::choose_bounces);
    add_stage("contact", &I::solve_contacts);
    if (restitution) add_stage("restitution", &I::rebound);
    if (correction) add_stage("penetration", &I::correct_penetration);
  }
  add_stage("motion", &I::move);
  if (!round_bodies.empty()) add_stage("motion", &I::turn_round);
  if (!long_bodies.empty()) {
    if (options.gyroscopic == Gyroscopic::momentum) free_spin.resize(long_bodies.size());
    if (options.gyroscopic == Gyroscopic::momentum)
      add_stage("gyroscopic term", &I::turn_keeping_momentum);
    else
      add_stage("motion", &I::turn_plain);
  }
}

void Stepper::Implementation::apply_gravity() {
  const Vector3d dv = options.step * *options.gravity;
  for (const int i : moving) bodies.motion[at(i)].velocity += dv;
}

void Stepper::Implementation::gyrate_explicit() {
  for (const int i : long_bodies) {
    Vector3d& w = bodies.motion[at(i)].angular_velocity;
    w += detail::gyroscopic_explicit(bodies.inertia[at(i)], bodies.inverse_inertia[at(i)],
                                     bodies.orientation[at(i)], w, options.step);
  }
}

void Stepper::Implementation::gyrate_implicit() {
  for (const int i : long_bodies) {
    Vector3d& w = bodies.motion[at(i)].angular_velocity;
    w += detail::gyroscopic_implicit(bodies.inertia[at(i)], bodies.orientation[at(i)], w,
                                     options.step);
  }
}

void Stepper::Implementation::find_contacts() {
  near->find(bodies, options.step, contacts);
  deepest = 0;
  for (std::size_t k = 0; k < contacts.gaps.size(); ++k) {
    const double gap = contacts.gaps[k];
    deepest = std::max(deepest, -gap);
    contacts.points[k].bias = gap > 0 ? gap / options.step : 0;
  }
}

void Stepper::Implementation::solve_contacts() {
  contacts.impulses.resize(contacts.points.size());  // assign() would grow without reserve
  std::fill(contacts.impulses.begin(), contacts.impulses.end(), Vector3d::Zero());
  if (contacts.points.empty()) {
    solution.status = Status::solved;
    solution.error = 0;
    solver->forget();
    return;
  }
  solver->solve(bodies.motion, contacts.points, solution);
  for (const int i : moving) {
    bodies.motion[at(i)].velocity = solution.velocities[at(i)];
    bodies.motion[at(i)].angular_velocity = solution.angular_velocities[at(i)];
  }
  std::copy(solution.impulses.begin(), solution.impulses.end(), contacts.impulses.begin());
  ++counts.contact_problems;
  counts.sweeps += solution.sweeps;
  counts.assembled_islands += solution.assembled_islands;
  counts.unsolved += solution.status != Status::solved;
}

// The least move (in the metric of the masses) that takes penetrations back; contacts that are open
// may close by as much as they are open. Its velocity is not kept.
void Stepper::Implementation::correct_penetration() {
  corrects = deepest > 0;
  if (!corrects) return;
  at_rest.resize(bodies.motion.size());
  for (std::size_t i = 0; i < bodies.motion.size(); ++i) {
    at_rest[i].inverse_mass = bodies.motion[i].inverse_mass;
    at_rest[i].inverse_inertia = bodies.motion[i].inverse_inertia;
  }
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    const double gap = contacts.gaps[k];
    contacts.points[k].bias = gap > 0 ? gap / options.step
                                      : std::max(options.error_reduction * gap / options.step,
                                                 -options.max_depenetration_speed);
  }
  correction->solve(at_rest, contacts.points, correction_solution);
  for (const int i : moving) {
    bodies.position[at(i)] += options.step * correction_solution.velocities[at(i)];
    const Vector3d w = correction_solution.angular_velocities[at(i)];
    if (w.isZero(0)) continue;
    // Body axes keep their angular velocity in world axes.
    bodies.orientation[at(i)] =
        (detail::exponential(options.step * w) * bodies.orientation[at(i)]).normalized();
  }
}

void Stepper::Implementation::move() {
  for (const int i : moving) bodies.position[at(i)] += options.step * bodies.motion[at(i)].velocity;
}

void Stepper::Implementation::turn_round() {
  for (const int i : round_bodies) {
    const Vector3d& w = bodies.motion[at(i)].angular_velocity;
    if (w.isZero(0)) continue;
    linalg::Quaternion& q = bodies.orientation[at(i)];
    q = (detail::exponential(options.step * w) * q).normalized();
  }
}

void Stepper::Implementation::turn_plain() {
  for (const int i : long_bodies) {
    RigidBody& b = bodies.motion[at(i)];
    linalg::Quaternion& q = bodies.orientation[at(i)];
    q = (detail::exponential(options.step * b.angular_velocity) * q).normalized();
    b.inverse_inertia = detail::turned(bodies.inverse_inertia[at(i)], q);
  }
}

void Stepper::Implementation::turn_keeping_momentum() {
  for (std::size_t k = 0; k < long_bodies.size(); ++k) {
    const int i = long_bodies[k];
    RigidBody& b = bodies.motion[at(i)];
    linalg::Quaternion& q = bodies.orientation[at(i)];
    detail::turn_with_momentum(bodies.inertia[at(i)], bodies.inverse_inertia[at(i)], options.step,
                               q, b.angular_velocity, free_spin[k]);
    b.inverse_inertia = detail::turned(bodies.inverse_inertia[at(i)], q);
  }
}

Stepper::Stepper(BodySet bodies, std::vector<Surface> surfaces, std::vector<Meeting> meetings,
                 const SteppingOptions& options, std::unique_ptr<PairCollision> polyhedra)
    : implementation_(std::make_unique<Implementation>()) {
  check(options);
  Implementation& s = *implementation_;
  s.bodies = std::move(bodies);
  s.options = options;
  if (!meetings.empty() && !surfaces.empty()) {
    s.near = std::make_unique<NearContacts>(s.bodies, std::move(surfaces), std::move(meetings),
                                            options.law, options.near_part, std::move(polyhedra));
    s.solver = std::make_unique<BodySolver>(solver_options(options));
    if (s.near->any_restitution())
      s.restitution =
          std::make_unique<Restitution>(options.restitution_threshold, solver_options(options));
    if (options.error_reduction > 0 && options.max_depenetration_speed > 0)
      s.correction = std::make_unique<BodySolver>(correction_options(options));
  }
  s.solution.status = Status::solved;
  s.solution.error = 0;
  s.make_stages();
}

Stepper::~Stepper() = default;
Stepper::Stepper(Stepper&&) noexcept = default;
Stepper& Stepper::operator=(Stepper&&) noexcept = default;

void Stepper::add_force(const char* effect, Force force) {
  Implementation& s = *implementation_;
  s.force.push_back(std::move(force));
  s.stages.insert(s.stages.begin() + static_cast<std::ptrdiff_t>(s.after_forces++),
                  {effect, nullptr, static_cast<int>(s.force.size()) - 1, 0});
}

void Stepper::step() {
  using Clock = std::chrono::steady_clock;
  Implementation& s = *implementation_;
  Clock::time_point start = Clock::now();
  for (Implementation::Stage& stage : s.stages) {
    if (stage.method)
      (s.*stage.method)();
    else
      s.force[at(stage.force)](s.bodies, time(), s.options.step);
    const Clock::time_point end = Clock::now();
    stage.seconds += std::chrono::duration<double>(end - start).count();
    start = end;
  }
  ++s.counts.steps;
}

double Stepper::time() const {
  return static_cast<double>(implementation_->counts.steps) * implementation_->options.step;
}
const BodySet& Stepper::bodies() const { return implementation_->bodies; }
BodySet& Stepper::bodies() { return implementation_->bodies; }
const StepContacts& Stepper::contacts() const { return implementation_->contacts; }
double Stepper::penetration() const { return implementation_->deepest; }
double Stepper::residual() const { return implementation_->solution.error; }
Status Stepper::status() const { return implementation_->solution.status; }
const StepCounts& Stepper::counts() const { return implementation_->counts; }
const SteppingOptions& Stepper::options() const { return implementation_->options; }

std::vector<StageCost> Stepper::costs() const {
  std::vector<StageCost> sums;
  for (const Implementation::Stage& stage : implementation_->stages) {
    const auto same = std::find_if(sums.begin(), sums.end(), [&](const StageCost& c) {
      return std::string(c.effect) == stage.effect;
    });
    if (same != sums.end())
      same->seconds += stage.seconds;
    else
      sums.push_back({stage.effect, stage.seconds});
  }
  return sums;
}

void Stepper::start_anew(long steps) {
  Implementation& s = *implementation_;
  s.counts.steps = steps;
  s.free_spin.assign(s.free_spin.size(), {});
  for (const int i : s.long_bodies)
    s.bodies.motion[at(i)].inverse_inertia =
        detail::turned(s.bodies.inverse_inertia[at(i)], s.bodies.orientation[at(i)]);
  // New solvers: nothing of the past is left.
  if (s.solver) s.solver = std::make_unique<BodySolver>(solver_options(s.options));
  if (s.correction) s.correction = std::make_unique<BodySolver>(correction_options(s.options));
  if (s.restitution)
    s.restitution =
        std::make_unique<Restitution>(s.options.restitution_threshold, solver_options(s.options));
}

}  // namespace tether::contact

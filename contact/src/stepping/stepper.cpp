// Tether: impulse-velocity steps. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tether/contact/stepping.hpp>
#include <utility>

#include "closing.hpp"
#include "impacts.hpp"
#include "near_contacts.hpp"
#include "restitution.hpp"
#include "rotation.hpp"

namespace tether::contact {

using detail::Closing;
using detail::Impacts;
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
  demand(o.impact_threshold >= 0, "impact_threshold must be >= 0");
  demand(o.acceptance >= 1, "acceptance must be >= 1");
  demand(o.max_halvings >= 0 && o.max_halvings <= 30, "max_halvings must lie in 0 .. 30");
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

// Of a threshold in parts of sqrt(g size): m/s for a size of 1 m.
double speed(double threshold, const SteppingOptions& o) {
  return o.gravity ? threshold * std::sqrt(o.gravity->norm()) : 0;
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

namespace {
constexpr double kRough = 1e-4;  // residual above which an answer is none
}  // namespace

double accepted_residual(const SteppingOptions& o) {
  return std::max(o.tolerance, std::min(o.acceptance * o.tolerance, kRough));
}

const char* name(RestitutionLaw law) {
  return law == RestitutionLaw::newton ? "newton" : "poisson";
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
  std::unique_ptr<Impacts> impacts;
  std::unique_ptr<Restitution> restitution;
  StepContacts contacts;
  BodySolution solution;

  // Of the step: the length of the part that is taken, and what is worst of all its parts.
  double dt = 0;
  bool may_halve = false, failed = false, succeeded = true;
  Status status = Status::solved;
  double residual = 0, deepest = 0;

  // Only with error reduction.
  std::unique_ptr<Closing> closing;
  std::unique_ptr<BodySolver> correction;
  BodySolution correction_solution;
  std::vector<RigidBody> at_rest, closing_move;
  bool corrects = false;

  StepCounts counts;

  void add_stage(const char* effect, Method method) { stages.push_back({effect, method, -1, 0}); }
  void make_stages();
  void turn_inertias();

  void make_solvers();
  void step();
  void advance(double time, double length, int halvings);
  bool run_stages(double time);
  void judge();

  void remember_velocities() { impacts->remember(bodies); }
  void apply_gravity();
  void gyrate_explicit();
  void gyrate_implicit();
  void find_contacts();
  void choose_impacts();
  void choose_bounces() { restitution->choose(impacts->list(), bodies, contacts); }
  void solve_contacts();
  void rebound() { counts.bounces += restitution->apply(bodies, contacts); }
  void close_gaps();
  void correct_penetration();
  void shift(int body, const Vector3d& v, const Vector3d& w);
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
  const char* impact = restitution ? "restitution" : "collision";
  if (near) add_stage(impact, &I::remember_velocities);
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
    add_stage(impact, &I::choose_impacts);
    if (restitution) add_stage("restitution", &I::choose_bounces);
    add_stage("contact", &I::solve_contacts);
    if (restitution) add_stage("restitution", &I::rebound);
    if (closing) add_stage("penetration", &I::close_gaps);
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
  const Vector3d dv = dt * *options.gravity;
  for (const int i : moving) bodies.motion[at(i)].velocity += dv;
}

void Stepper::Implementation::gyrate_explicit() {
  for (const int i : long_bodies) {
    Vector3d& w = bodies.motion[at(i)].angular_velocity;
    w += detail::gyroscopic_explicit(bodies.inertia[at(i)], bodies.inverse_inertia[at(i)],
                                     bodies.orientation[at(i)], w, dt);
  }
}

void Stepper::Implementation::gyrate_implicit() {
  for (const int i : long_bodies) {
    Vector3d& w = bodies.motion[at(i)].angular_velocity;
    w += detail::gyroscopic_implicit(bodies.inertia[at(i)], bodies.orientation[at(i)], w, dt);
  }
}

void Stepper::Implementation::find_contacts() {
  near->find(bodies, dt, contacts);
  for (std::size_t k = 0; k < contacts.gaps.size(); ++k) {
    const double gap = contacts.gaps[k];
    deepest = std::max(deepest, -gap);
    contacts.points[k].bias = gap > 0 ? gap / dt : 0;
  }
}

void Stepper::Implementation::solve_contacts() {
  contacts.impulses.resize(contacts.points.size());  // assign() would grow without reserve
  std::fill(contacts.impulses.begin(), contacts.impulses.end(), Vector3d::Zero());
  failed = false;
  if (contacts.points.empty()) {
    solver->forget();
    return;
  }
  solver->solve(bodies.motion, contacts.points, solution);
  ++counts.contact_problems;
  counts.sweeps += solution.sweeps;
  counts.assembled_islands += solution.assembled_islands;
  judge();
  if (failed && may_halve) return;
  for (const int i : moving) {
    bodies.motion[at(i)].velocity = solution.velocities[at(i)];
    bodies.motion[at(i)].angular_velocity = solution.angular_velocities[at(i)];
  }
  std::copy(solution.impulses.begin(), solution.impulses.end(), contacts.impulses.begin());
}

// Accepts the solution, or not; one that a shorter step replaces leaves no trace.
void Stepper::Implementation::judge() {
  const bool solved = solution.status == Status::solved;
  const bool shortest = options.max_halvings > 0 && !may_halve;
  const double most = std::max(accepted_residual(options), shortest ? kRough : 0.0);
  failed = !solved && !(solution.error <= most);
  if (failed && may_halve) return;
  counts.accepted += !solved && !failed;
  counts.unsolved += failed;
  if (!solved) status = solution.status;
  succeeded = succeeded && !failed;
  residual = solution.error <= residual ? residual : solution.error;
}

void Stepper::Implementation::choose_impacts() {
  impacts->choose(*near, bodies, dt, contacts);
  if (closing) closing->begin(impacts->list(), bodies, contacts);
}

void Stepper::Implementation::close_gaps() {
  if (!closing->find(bodies, dt, contacts, closing_move)) return;
  for (const int i : moving)
    shift(i, closing_move[at(i)].velocity, closing_move[at(i)].angular_velocity);
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
    contacts.points[k].bias =
        gap > 0 ? gap / dt
                : std::max(options.error_reduction * gap / dt, -options.max_depenetration_speed);
  }
  correction->solve(at_rest, contacts.points, correction_solution);
  for (const int i : moving)
    shift(i, correction_solution.velocities[at(i)], correction_solution.angular_velocities[at(i)]);
}

// By velocities that are not kept. The angular velocity turns with the body: so its energy stays.
void Stepper::Implementation::shift(int body, const Vector3d& v, const Vector3d& w) {
  bodies.position[at(body)] += dt * v;
  if (w.isZero(0)) return;
  const linalg::Quaternion turn = detail::exponential(dt * w);
  linalg::Quaternion& q = bodies.orientation[at(body)];
  q = (turn * q).normalized();
  Vector3d& spin = bodies.motion[at(body)].angular_velocity;
  spin = turn * spin;
}

void Stepper::Implementation::move() {
  for (const int i : moving) bodies.position[at(i)] += dt * bodies.motion[at(i)].velocity;
}

// To world axes, after orientations were set from outside.
void Stepper::Implementation::turn_inertias() {
  for (const int i : long_bodies)
    bodies.motion[at(i)].inverse_inertia =
        detail::turned(bodies.inverse_inertia[at(i)], bodies.orientation[at(i)]);
}

void Stepper::Implementation::turn_round() {
  for (const int i : round_bodies) {
    const Vector3d& w = bodies.motion[at(i)].angular_velocity;
    if (w.isZero(0)) continue;
    linalg::Quaternion& q = bodies.orientation[at(i)];
    q = (detail::exponential(dt * w) * q).normalized();
  }
}

void Stepper::Implementation::turn_plain() {
  for (const int i : long_bodies) {
    RigidBody& b = bodies.motion[at(i)];
    linalg::Quaternion& q = bodies.orientation[at(i)];
    q = (detail::exponential(dt * b.angular_velocity) * q).normalized();
    b.inverse_inertia = detail::turned(bodies.inverse_inertia[at(i)], q);
  }
}

void Stepper::Implementation::turn_keeping_momentum() {
  for (std::size_t k = 0; k < long_bodies.size(); ++k) {
    const int i = long_bodies[k];
    RigidBody& b = bodies.motion[at(i)];
    linalg::Quaternion& q = bodies.orientation[at(i)];
    detail::turn_with_momentum(bodies.inertia[at(i)], bodies.inverse_inertia[at(i)], dt, q,
                               b.angular_velocity, free_spin[k]);
    b.inverse_inertia = detail::turned(bodies.inverse_inertia[at(i)], q);
  }
}

// New ones: nothing of the past is left.
void Stepper::Implementation::make_solvers() {
  const BodyOptions o = solver_options(options);
  solver = std::make_unique<BodySolver>(o);
  if (near->any_restitution())
    restitution = std::make_unique<Restitution>(options.restitution_law, o);
  if (options.error_reduction > 0 && options.max_depenetration_speed > 0) {
    correction = std::make_unique<BodySolver>(correction_options(options));
    closing = std::make_unique<Closing>(o);
  }
}

void Stepper::Implementation::step() {
  status = Status::solved;
  succeeded = true;
  residual = deepest = 0;
  advance(static_cast<double>(counts.steps) * options.step, options.step, options.max_halvings);
  ++counts.steps;
}

void Stepper::Implementation::advance(double time, double length, int halvings) {
  dt = length;
  may_halve = halvings > 0;
  if (run_stages(time)) return;
  // Nothing has moved yet.
  bodies.motion = impacts->coming();
  solver->scale_warm_start(0.5);
  ++counts.halved;
  advance(time, length / 2, halvings - 1);
  advance(time + length / 2, length / 2, halvings - 1);
  solver->scale_warm_start(2);
}

// false: the contact problem failed, and the step is to be taken in halves.
bool Stepper::Implementation::run_stages(double time) {
  using Clock = std::chrono::steady_clock;
  Clock::time_point start = Clock::now();
  failed = false;
  for (Stage& stage : stages) {
    if (stage.method)
      (this->*stage.method)();
    else
      force[at(stage.force)](bodies, time, dt);
    const Clock::time_point end = Clock::now();
    stage.seconds += std::chrono::duration<double>(end - start).count();
    start = end;
    if (failed && may_halve) return false;
  }
  return true;
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
    s.impacts = std::make_unique<Impacts>(speed(options.impact_threshold, options),
                                          speed(options.restitution_threshold, options));
    s.make_solvers();
  }
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

void Stepper::step() { implementation_->step(); }

double Stepper::time() const {
  return static_cast<double>(implementation_->counts.steps) * implementation_->options.step;
}
const BodySet& Stepper::bodies() const { return implementation_->bodies; }
BodySet& Stepper::bodies() { return implementation_->bodies; }
const StepContacts& Stepper::contacts() const { return implementation_->contacts; }
double Stepper::penetration() const { return implementation_->deepest; }
double Stepper::residual() const { return implementation_->residual; }
Status Stepper::status() const { return implementation_->status; }
bool Stepper::succeeded() const { return implementation_->succeeded; }
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

StepperMemory Stepper::memory() const {
  const Implementation& s = *implementation_;
  StepperMemory m;
  m.steps = s.counts.steps;
  if (s.solver) m.contacts = s.solver->warm_start();
  if (s.correction) m.corrections = s.correction->warm_start();
  if (s.restitution) m.bounces = s.restitution->warm_start();
  if (s.closing) m.closings = s.closing->warm_start();
  for (const detail::FreeSpin& each : s.free_spin)
    m.spins.push_back({each.L, each.w, {each.q.x(), each.q.y(), each.q.z(), each.q.w()}});
  m.last = s.contacts;
  m.penetration = s.deepest;
  m.residual = s.residual;
  m.status = s.status;
  return m;
}

void Stepper::set_memory(const StepperMemory& m) {
  Implementation& s = *implementation_;
  if (m.spins.size() != s.free_spin.size() || m.steps < 0)
    throw std::invalid_argument("stepping: a memory of " + std::to_string(m.steps) + " steps of " +
                                std::to_string(m.spins.size()) + " turning bodies, but there are " +
                                std::to_string(s.free_spin.size()));
  s.counts.steps = m.steps;
  s.turn_inertias();
  if (s.solver) s.solver->set_warm_start(m.contacts);
  if (s.correction) s.correction->set_warm_start(m.corrections);
  if (s.restitution) s.restitution->set_warm_start(m.bounces);
  if (s.closing) s.closing->set_warm_start(m.closings);
  for (std::size_t k = 0; k < m.spins.size(); ++k) {
    const std::array<double, 4>& q = m.spins[k].orientation;
    s.free_spin[k] = {m.spins[k].momentum, m.spins[k].angular_velocity, {q[3], q[0], q[1], q[2]}};
  }
  s.contacts = m.last;
  s.deepest = m.penetration;
  s.residual = m.residual;
  s.status = m.status;
}

void Stepper::start_anew(long steps) {
  Implementation& s = *implementation_;
  s.counts.steps = steps;
  s.free_spin.assign(s.free_spin.size(), {});
  s.turn_inertias();
  if (s.near) s.make_solvers();  // nothing of the past is left
}

}  // namespace tether::contact

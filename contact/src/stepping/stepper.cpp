// Tether: impulse-velocity steps. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "joints/cone_islands.hpp"
#include "problem/refuse.hpp"
#include "stepping/detection/collide.hpp"
#include "stepping/stepper_parts.hpp"

namespace tether::contact {

// New ones: nothing of the past is left. The first solver is that of velocities, whose moments are
// those of the step.
void Stepper::Implementation::make_solvers() {
  using detail::LawUse;
  const BodyOptions o = detail::contact_options(options);
  const bool laws = joints && joints->has_laws(), bounces = near && near->any_restitution();
  if (near && near->any_rolling()) rolling = std::make_unique<detail::RollingPart>(*near);
  if (joints && rolling) joints->set_rolling(*near);
  detail::IslandMaker* maker = rolling.get();
  if (joints) maker = joints.get();
  const auto new_restitution = [&](LawUse use) {
    return std::make_unique<detail::Restitution>(options.restitution_law, o, maker, use);
  };
  solver = std::make_unique<detail::StepSolver>(o, maker, LawUse::all);
  make_impacts();
  if (bounces || laws) restitution = new_restitution(LawUse::plastic);
  if (laws) restitution->set_laws(*joints);
  if (!near) return;
  later = std::make_unique<detail::LaterImpacts>(
      detail::threshold_speed(options.impact_threshold, options),
      detail::threshold_speed(options.restitution_threshold, options), o, maker,
      bounces ? new_restitution(LawUse::none) : nullptr);
  if (options.cut_at_impacts && !(options.accuracy > 0))
    cuts = std::make_unique<detail::StepCuts>(o, maker);
  if (bounces && cuts) bounces_at_once = new_restitution(LawUse::none);
  if (options.error_reduction > 0 && options.max_depenetration_speed > 0)
    positions = std::make_unique<detail::PositionCorrection>(options, maker);
  if (!laws) return;
  later->set_laws(*joints);
  const bool together = options.simultaneous_impacts == SimultaneousImpacts::together;
  if (cuts && together) cuts->set_laws(*joints);
}

void Stepper::Implementation::make_impacts() {
  if (!impacts)
    impacts = std::make_unique<detail::Impacts>(
        detail::threshold_speed(options.impact_threshold, options),
        detail::threshold_speed(options.restitution_threshold, options));
}

// Refuses by name what it does not go with.
static void check_rolling(const SteppingOptions& options) {
  if (options.law != Law::coulomb)
    throw std::invalid_argument(
        std::string("rolling and torsional friction need law = coulomb, not ") + name(options.law));
  if (options.restitution_law != RestitutionLaw::newton)
    throw std::invalid_argument("rolling and torsional friction need restitution_law = newton");
}

// Sizes of bodies, m: the reach of their surfaces, or the radius of gyration.
static std::vector<double> sizes(const BodySet& bodies, const std::vector<Surface>& surfaces) {
  std::vector<double> out(bodies.mass.size(), 0);
  for (const Surface& each : surfaces) {
    const auto i = static_cast<std::size_t>(each.body);
    if (i < out.size() && each.shape.kind != ShapeKind::plane)
      out[i] = std::max(out[i], each.shape.position.norm() + detail::reach(each.shape));
  }
  for (std::size_t i = 0; i < out.size(); ++i)
    if (out[i] == 0 && bodies.mass[i] > 0)
      out[i] = std::sqrt(bodies.inertia[i].trace() / (2 * bodies.mass[i]));
  return out;
}

Stepper::Stepper(BodySet bodies, std::vector<Surface> surfaces, std::vector<Meeting> meetings,
                 const SteppingOptions& options)
    : implementation_(std::make_unique<Implementation>()) {
  detail::check(options);
  Implementation& s = *implementation_;
  s.bodies = std::move(bodies);
  s.options = options;
  if (options.accuracy > 0) s.parts.radius = sizes(s.bodies, surfaces);
  std::vector<double> size;
  if (options.sleep > 0) size = sizes(s.bodies, surfaces);
  if (!meetings.empty() && !surfaces.empty()) {
    s.near = std::make_unique<detail::NearContacts>(s.bodies, std::move(surfaces), meetings,
                                                    options.law, options.near_part);
    if (s.near->any_rolling()) check_rolling(options);
    s.make_solvers();
    if (options.sleep > 0) {
      if (s.near->any_rolling())
        throw std::invalid_argument("stepping: sleep does not go with rolling friction");
      s.sleeping = std::make_unique<detail::Sleeping>(
          s.bodies, std::move(size), detail::threshold_speed(options.sleep, options),
          options.gravity->norm());
    }
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
  const Implementation& s = *implementation_;
  return static_cast<double>(s.counts.steps) * s.options.step + s.late;
}
const BodySet& Stepper::bodies() const { return implementation_->bodies; }
BodySet& Stepper::bodies() { return implementation_->bodies; }
const StepContacts& Stepper::contacts() const { return implementation_->contacts; }
const std::vector<Eigen::Vector3d>& Stepper::contact_moments() const {
  return implementation_->contacts.moments;
}
double Stepper::penetration() const { return implementation_->outcome.deepest; }
double Stepper::residual() const { return implementation_->outcome.residual; }
Status Stepper::status() const { return implementation_->outcome.status; }
bool Stepper::succeeded() const { return implementation_->outcome.succeeded; }
bool Stepper::joints_met() const { return implementation_->outcome.joints_met; }
double Stepper::joint_drift() const {
  return implementation_->joints ? implementation_->joints->drift() : 0;
}
const std::vector<double>& Stepper::joint_impulses() const {
  static const std::vector<double> none;
  return implementation_->joints ? implementation_->joints->impulses() : none;
}
const std::vector<double>& Stepper::law_impulses() const {
  static const std::vector<double> none;
  return implementation_->joints ? implementation_->joints->law_impulses() : none;
}
double Stepper::last_part() const { return implementation_->part.now.length; }
int Stepper::asleep() const {
  return implementation_->sleeping ? implementation_->sleeping->count() : 0;
}
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
  if (s.positions) m.corrections = s.positions->warm_start();
  if (s.restitution) m.bounces = s.restitution->warm_start();
  for (const detail::FreeSpin& each : s.motion.spins())
    m.spins.push_back({each.L, each.w, {each.q.x(), each.q.y(), each.q.z(), each.q.w()}});
  m.last = s.contacts;
  m.penetration = s.outcome.deepest;
  m.residual = s.outcome.residual;
  m.status = s.outcome.status;
  m.control = s.parts.control;
  m.drift = joint_drift();
  if (s.joints) m.vibration = s.joints->vibration();
  if (s.cuts) m.cuts = s.cuts->kept();
  if (s.sleeping) m.sleep = s.sleeping->memory();
  return m;
}

void Stepper::set_memory(const StepperMemory& m) {
  Implementation& s = *implementation_;
  if (m.spins.size() != s.motion.spins().size() || m.steps < 0)
    throw std::invalid_argument("stepping: a memory of " + std::to_string(m.steps) + " steps of " +
                                std::to_string(m.spins.size()) + " turning bodies, but there are " +
                                std::to_string(s.motion.spins().size()));
  s.counts.steps = m.steps;
  s.late = 0;
  s.motion.turn_inertias(s.bodies);
  if (s.solver) s.solver->set_warm_start(m.contacts);
  if (s.positions) s.positions->set_warm_start(m.corrections);
  if (s.restitution) s.restitution->set_warm_start(m.bounces);
  for (std::size_t k = 0; k < m.spins.size(); ++k) {
    const std::array<double, 4>& q = m.spins[k].orientation;
    s.motion.spins()[k] = {
        m.spins[k].momentum, m.spins[k].angular_velocity, {q[3], q[0], q[1], q[2]}};
  }
  s.contacts = m.last;
  s.outcome.deepest = m.penetration;
  s.outcome.residual = m.residual;
  s.outcome.status = m.status;
  s.parts.control = m.control;
  if (s.cuts) s.cuts->set_kept(std::clamp(m.cuts, 0.0, detail::StepCuts::kMostKept));
  if (s.joints) {
    if (!m.vibration.mode.empty() && m.vibration.mode.size() != s.bodies.position.size())
      throw std::invalid_argument("stepping: a memory of the joints of other bodies");
    s.joints->set_drift(m.drift);
    s.joints->set_vibration(m.vibration);
  }
  if (!s.sleeping) return;
  if (m.sleep.bodies.empty())
    s.sleeping->wake_everybody();
  else
    s.sleeping->set_memory(m.sleep, s.bodies);
}

void Stepper::start_anew(long steps, double late) {
  Implementation& s = *implementation_;
  if (!(late >= 0 && late < s.options.step))
    throw std::invalid_argument("stepping: a start that is " + detail::shown(late) +
                                " s late, but a step has " + detail::shown(s.options.step) + " s");
  s.counts.steps = steps;
  s.late = late;
  s.parts.control = {};
  if (s.joints) s.joints->set_vibration({});
  s.motion.spins().assign(s.motion.spins().size(), {});
  s.motion.turn_inertias(s.bodies);
  if (s.solver) s.make_solvers();  // nothing of the past is left
  if (s.sleeping) s.sleeping->wake_everybody();
}

}  // namespace tether::contact

// Tether: impulse-velocity steps. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/stepper.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <utility>

#include "problem/refuse.hpp"

namespace tether::contact {

Stepper::Implementation::Implementation(BodySet bodies, std::vector<Surface> surfaces,
                                        const std::vector<Meeting>& meetings,
                                        const SteppingOptions& options)
    : steps(std::move(bodies), std::move(surfaces), meetings, options),
      halving(steps),
      accurate(steps, halving),
      count(steps.bodies.position.size()) {}

// Callers of bodies() may have changed their number.
void Stepper::Implementation::check_lengths() const {
  const auto demand = [this](const char* name, std::size_t entries) {
    if (entries != count)
      detail::refuse_size(std::string("bodies: ") + name, static_cast<Eigen::Index>(entries),
                          static_cast<Eigen::Index>(count), "one for each body of the start");
  };
  const BodySet& b = steps.bodies;
  demand("position", b.position.size());
  demand("orientation", b.orientation.size());
  demand("motion", b.motion.size());
  demand("mass", b.mass.size());
  demand("inertia", b.inertia.size());
  demand("inverse_inertia", b.inverse_inertia.size());
}

void Stepper::Implementation::step() {
  check_lengths();
  steps.tally = {};
  steps.unmeetable = false;
  const double start = static_cast<double>(steps.counts.steps) * steps.options.step + late;
  const double length = steps.options.step - late;
  if (steps.options.accuracy > 0) {
    accurate.take(start, length);
  } else {
    if (steps.cuts) steps.cuts->earn();
    halving.advance(halving.whole(start, length));
  }
  if (!steps.is_finite()) {
    steps.tally.worsen(detail::Outcome::unsolved);
    steps.tally.status = Status::unsolved;
  }
  late = 0;
  StepCounts& counts = steps.counts;
  counts.bounces += steps.tally.bounces;
  counts.accepted += steps.tally.accepted;
  counts.unsolved += steps.tally.unsolved;
  ++counts.steps;
}

Stepper::Stepper(BodySet bodies, std::vector<Surface> surfaces, std::vector<Meeting> meetings,
                 const SteppingOptions& options) {
  detail::check(options);
  implementation_ =
      std::make_unique<Implementation>(std::move(bodies), std::move(surfaces), meetings, options);
}

Stepper::~Stepper() = default;
Stepper::Stepper(Stepper&&) noexcept = default;
Stepper& Stepper::operator=(Stepper&&) noexcept = default;

void Stepper::add_force(const char* effect, Force force) {
  if (!force) throw std::invalid_argument("Stepper::add_force: force is empty");
  implementation_->steps.add_force(effect, std::move(force));
}

void Stepper::observe(StepObserver observer) {
  if (!observer) throw std::invalid_argument("Stepper::observe: observer is empty");
  implementation_->steps.observe(std::move(observer));
}

void Stepper::step() { implementation_->step(); }

double Stepper::time() const {
  const Implementation& s = *implementation_;
  return static_cast<double>(s.steps.counts.steps) * s.steps.options.step + s.late;
}
const BodySet& Stepper::bodies() const { return implementation_->steps.bodies; }
BodySet& Stepper::bodies() { return implementation_->steps.bodies; }
const StepContacts& Stepper::contacts() const { return implementation_->steps.contacts; }
const std::vector<Eigen::Vector3d>& Stepper::contact_moments() const {
  return implementation_->steps.contacts.moments;
}
double Stepper::penetration() const { return implementation_->steps.tally.deepest; }
double Stepper::residual() const { return implementation_->steps.tally.residual; }
Status Stepper::status() const { return implementation_->steps.tally.status; }
bool Stepper::succeeded() const {
  return implementation_->steps.tally.outcome == detail::Outcome::met;
}
bool Stepper::joints_met() const {
  return implementation_->steps.tally.outcome != detail::Outcome::joints_unmet;
}
double Stepper::joint_drift() const {
  const auto& joints = implementation_->steps.joints;
  return joints ? joints->drift : 0;
}
const std::vector<double>& Stepper::joint_impulses() const {
  static const std::vector<double> none;
  const auto& joints = implementation_->steps.joints;
  return joints ? joints->impulses : none;
}
const std::vector<double>& Stepper::law_impulses() const {
  static const std::vector<double> none;
  const auto& joints = implementation_->steps.joints;
  return joints ? joints->law_impulses() : none;
}
double Stepper::last_sub_step() const { return implementation_->steps.now.length; }
int Stepper::asleep() const {
  const auto& sleeping = implementation_->steps.sleeping;
  return sleeping ? sleeping->count() : 0;
}
const StepCounts& Stepper::counts() const { return implementation_->steps.counts; }
const SteppingOptions& Stepper::options() const { return implementation_->steps.options; }

std::vector<StageCost> Stepper::costs() const {
  std::vector<StageCost> sums;
  for (const detail::SubStepper::Stage& stage : implementation_->steps.stages) {
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
  const detail::SubStepper& s = implementation_->steps;
  StepperMemory m;
  m.steps = s.counts.steps;
  if (s.solver) m.contacts = s.solver->warm_start();
  if (s.positions) m.corrections = s.positions->warm_start();
  if (s.restitution) m.bounces = s.restitution->warm_start();
  m.spins = s.motion.spins();
  m.last = s.contacts;
  m.penetration = s.tally.deepest;
  m.residual = s.tally.residual;
  m.status = s.tally.status;
  m.control = implementation_->accurate.control;
  m.drift = joint_drift();
  if (s.joints) m.vibration = s.joints->vibration();
  if (s.cuts) m.cuts = s.cuts->kept();
  if (s.sleeping) m.sleep = s.sleeping->memory();
  return m;
}

void Stepper::set_memory(const StepperMemory& m) {
  detail::SubStepper& s = implementation_->steps;
  if (m.spins.size() != s.motion.spins().size() || m.steps < 0)
    throw std::invalid_argument("stepping: a memory of " + std::to_string(m.steps) + " steps of " +
                                std::to_string(m.spins.size()) + " turning bodies, but there are " +
                                std::to_string(s.motion.spins().size()));
  s.counts.steps = m.steps;
  implementation_->late = 0;
  s.motion.turn_inertias(s.bodies);
  if (s.solver) s.solver->set_warm_start(m.contacts);
  if (s.positions) s.positions->set_warm_start(m.corrections);
  if (s.restitution) s.restitution->set_warm_start(m.bounces);
  s.motion.spins() = m.spins;
  s.contacts = m.last;
  s.tally.deepest = m.penetration;
  s.tally.residual = m.residual;
  s.tally.status = m.status;
  implementation_->accurate.control = m.control;
  if (s.cuts) s.cuts->set_kept(std::clamp(m.cuts, 0.0, detail::StepCuts::kMostKept));
  if (s.joints) {
    if (!m.vibration.mode.empty() && m.vibration.mode.size() != s.bodies.position.size())
      throw std::invalid_argument("stepping: a memory of the joints of other bodies");
    s.joints->drift = m.drift;
    s.joints->set_vibration(m.vibration);
  }
  if (!s.sleeping) return;
  if (m.sleep.bodies.empty())
    s.sleeping->wake_everybody();
  else
    s.sleeping->set_memory(m.sleep, s.bodies);
}

void Stepper::start_anew(long steps, double late) {
  detail::SubStepper& s = implementation_->steps;
  detail::require(steps >= 0, "stepping: steps", static_cast<double>(steps), "must be >= 0");
  if (!(late >= 0 && late < s.options.step))
    throw std::invalid_argument("stepping: a start that is " + detail::shown(late) +
                                " s late, but a step has " + detail::shown(s.options.step) + " s");
  s.counts.steps = steps;
  implementation_->late = late;
  implementation_->accurate.control = {};
  if (s.joints) s.joints->set_vibration({});
  s.motion.spins().assign(s.motion.spins().size(), {});
  s.motion.turn_inertias(s.bodies);
  if (s.solver) s.make_solvers();  // nothing of the past is left
  if (s.sleeping) s.sleeping->wake_everybody();
}

}  // namespace tether::contact

// Tether: the engine that steps with impulses. SPDX-License-Identifier: BSD-3-Clause
#include "stepping_engine.hpp"

#include <cstring>
#include <tether/scene/run.hpp>

#include "effects/list.hpp"
#include "output/binary.hpp"
#include "step_scribe.hpp"

namespace tether::scene::stepping {

using binary::Archive;
using contact::StepperMemory;
using Eigen::Vector3d;

/// Sums what those steps change of the energy in which nothing strikes or slips, where nothing but
/// weight and what holds bodies acts on them. It is an error: contacts that hold do no work.
class EnergyError {
 public:
  /// dt: length of a step, s. `joined`: by body, whether joints hold it.
  EnergyError(const Eigen::Vector3d& gravity, double dt, std::vector<char> joined,
              const contact::BodySet& bodies)
      : gravity_(gravity), dt_(dt), joined_(std::move(joined)) {
    begin_at(bodies);
  }

  /// Goes on from other states.
  void begin_at(const contact::BodySet& bodies) {
    last_.clear();
    energy_ = energy(bodies);
    power_ = power(bodies);
  }
  /// After each step.
  // Contacts hold by the velocity at the end of a step, which moves a body, too: the work of its
  // weight is the mean of two steps, as it is along the parabola of a free body. Corrections of
  // positions are no motion.
  void add(const contact::BodySet& bodies, const contact::StepContacts& contacts) {
    const bool steady = note(contacts);
    const double last = std::exchange(energy_, energy(bodies));
    const double pulled = std::exchange(power_, power(bodies));
    if (steady) sum_ += energy_ - last - 0.5 * dt_ * (pulled + power_);
  }
  /// J.
  double sum() const { return sum_; }

 private:
  // A normal impulse that changes by more from step to step is one of an impact, or of a force that
  // the steps do not resolve.
  static constexpr double kSteady = 2;

  // The normal impulse of the step before; 0: none. Contacts mostly keep their order.
  double before(std::uint64_t id) {
    for (std::size_t k = 0; k < last_.size(); ++k, ++next_) {
      if (next_ >= last_.size()) next_ = 0;
      if (last_[next_].first == id) return last_[next_++].second;
    }
    return 0;
  }
  // Keeps the impulses of the step; whether the same contacts as before hold.
  bool note(const contact::StepContacts& contacts) {
    bool steady = true;
    next_ = 0;
    now_.clear();
    for (std::size_t k = 0; k < contacts.impulses.size(); ++k) {
      const contact::PointContact& c = contacts.points[k];
      const double normal = c.normal.dot(contacts.impulses[k]);
      if (!(normal > 0)) continue;
      const double friction = (contacts.impulses[k] - normal * c.normal).norm(),
                   last = before(c.id);
      // A contact with more of its largest friction may slip in a part of the step.
      steady = steady && normal <= kSteady * last && last <= kSteady * normal &&
               (friction == 0 || friction < 0.99 * c.mu * normal);
      now_.emplace_back(c.id, normal);
    }
    steady = steady && now_.size() == last_.size();
    std::swap(last_, now_);
    return steady;
  }
  // Kinetic, and potential of bodies that joints hold. Their velocity at the end of a step is that
  // of its middle, and so is the place.
  double energy(const contact::BodySet& bodies) const {
    double sum = contact::kinetic_energy(bodies);
    for (std::size_t i = 0; i < joined_.size(); ++i)
      if (joined_[i] != 0)
        sum -= bodies.mass[i] *
               gravity_.dot(bodies.position[i] - 0.5 * dt_ * bodies.motion[i].velocity);
    return sum;
  }
  // The power of the weight of all others, W.
  double power(const contact::BodySet& bodies) const {
    double sum = 0;
    for (std::size_t i = 0; i < joined_.size(); ++i)
      if (joined_[i] == 0) sum += bodies.mass[i] * gravity_.dot(bodies.motion[i].velocity);
    return sum;
  }

  Eigen::Vector3d gravity_;
  double dt_;
  std::vector<char> joined_;
  double energy_ = 0, power_ = 0, sum_ = 0;                   // after the last step
  std::vector<std::pair<std::uint64_t, double>> last_, now_;  // contacts and normal impulses
  std::size_t next_ = 0;                                      // of `last_`: where before() begins
};

namespace {

void refuse(const Scene& scene) {
  for (const Invariant& each : scene.invariants)
    if (each.project)
      throw std::invalid_argument(
          "the stepping engine projects no invariants: give them project = false, or, without "
          "contacts, use the smooth engine");
}

// Materials that no pair names get none, so that their bodies have no surfaces at all.
std::map<std::string, int> materials(const Scene& scene) {
  std::map<std::string, int> index;
  for (const Pair& pair : scene.pairs) {
    if (!pair.touch) continue;
    index.emplace(pair.first, static_cast<int>(index.size()));
    index.emplace(pair.second, static_cast<int>(index.size()));
  }
  return index;
}

void exchange(Archive& io, contact::WarmStart& start) {
  std::size_t k = 0;
  io.list(start.ids, [&](std::uint64_t& id) {
    if (io.reads()) start.impulses.emplace_back();
    io(id, start.impulses[k++]);
  });
}

void exchange(Archive& io, int bodies, contact::StepContacts& contacts) {
  std::size_t k = 0;
  io.list(contacts.points, [&](contact::PointContact& c) {
    if (io.reads()) {
      contacts.gaps.emplace_back();
      contacts.impulses.emplace_back();
    }
    io(c.first, c.second, c.mu, c.bias, c.id, c.r1, c.r2, c.normal);
    io(contacts.gaps[k], contacts.impulses[k]);
    io.demand(std::isfinite(c.mu) && std::isfinite(c.bias) && std::isfinite(contacts.gaps[k]),
              "a number in it is not finite");
    io.demand(c.first >= 0 && c.first < bodies && c.second >= -1 && c.second < bodies,
              "it has contacts of no bodies");
    ++k;
  });
}

// The stepper checks whether they fit the bodies.
void exchange(Archive& io, int bodies, StepperMemory::Sleep& sleep) {
  io.list(sleep.bodies, [&](StepperMemory::Rest& r) {
    io(r.slow, r.island, r.fresh, r.acceleration, r.angular_acceleration);
    io.demand(std::isfinite(r.slow), "a number in it is not finite");
  });
  exchange(io, bodies, sleep.contacts);
  io.list(sleep.neighbours, [&](StepperMemory::Neighbour& n) {
    io(n.body, n.island, n.position, n.orientation, n.velocity, n.angular_velocity);
  });
}

/// Throws std::runtime_error on a memory that no stepper of so many bodies has written.
void exchange(Archive& io, int bodies, StepperMemory& m) {
  const auto demand_not_negative = [&](std::initializer_list<double> numbers, const char* why) {
    for (const double x : numbers) io.demand(x >= 0 && std::isfinite(x), why);
  };
  io(m.steps);
  io.demand(m.steps >= 0, "it has no time");
  for (contact::WarmStart* each : {&m.contacts, &m.corrections, &m.bounces}) exchange(io, *each);
  io.list(m.spins, [&](StepperMemory::Spin& spin) {
    io(spin.momentum, spin.angular_velocity, spin.orientation);
  });
  exchange(io, bodies, m.last);
  io(m.penetration, m.residual, m.status);
  io.demand(contact::name(m.status) != std::string_view("?"), "no contact problem ends so");
  StepperMemory::Control& control = m.control;
  io(control.next, control.last, control.error, control.length);
  demand_not_negative({control.next, control.last, control.error, control.length},
                      "no sub-step is so long");
  io(m.drift, m.vibration.frequency, m.vibration.acceleration);
  demand_not_negative({m.drift}, "joints are off by no length");
  demand_not_negative({m.vibration.frequency, m.vibration.acceleration},
                      "joints vibrate at no frequency");
  io.list(m.vibration.mode, [&](contact::Vector6d& v) { io(v); });
  exchange(io, bodies, m.sleep);
  io(m.cuts);
  demand_not_negative({m.cuts}, "steps are cut at no impacts");
}

// A state cannot do without the same bodies and step. Whether the rest of the scene is the
// same is checked by the owner of the file.
std::uint64_t fingerprint(const Scene& scene, double step) {
  std::string text(reinterpret_cast<const char*>(&step), sizeof step);
  for (const Body& body : scene.bodies) {
    const double mass = body.fixed ? 0 : body.mass;
    text.append(body.name.c_str(), body.name.size() + 1);
    text.append(reinterpret_cast<const char*>(&mass), sizeof mass);
  }
  return binary::hash_of(text);
}

// Velocity of the point at r from the centre of a body; -1: the world.
Vector3d velocity(const contact::BodySet& bodies, int body, const Vector3d& r) {
  if (body < 0) return Vector3d::Zero();
  const contact::RigidBody& motion = bodies.motion[static_cast<std::size_t>(body)];
  return motion.velocity + motion.angular_velocity.cross(r);
}

// The last letter is the format.
constexpr binary::Magic kMagic = {'T', 'E', 'T', 'H', 'S', 'T', 'P', '9'};

/// Throws std::invalid_argument, naming what the scene asks for and stepping does not have.
contact::Stepper make_stepper(const Scene& scene, contact::SolverTeam* team) {
  refuse(scene);
  contact::BodySet bodies;
  std::vector<contact::Surface> surfaces;
  std::vector<contact::Meeting> meetings;
  const std::map<std::string, int> material = materials(scene);
  for (const Body& body : scene.bodies) {
    const std::string where = "body \"" + body.name + "\": ";
    int index = 0;
    try {
      index = body.fixed ? bodies.add_fixed(body.position, body.orientation)
                         : bodies.add(body.mass, body.inertia, body.position, body.orientation,
                                      body.velocity, body.angular_velocity);
    } catch (const std::invalid_argument& problem) {
      throw std::invalid_argument(where + problem.what());
    }
    const auto found = material.find(body.material);
    if (found == material.end()) continue;
    const SurfaceSpeed speed = body.surface.value_or(SurfaceSpeed{});
    for (const Shape& shape : body.shapes)
      surfaces.push_back({index, shape, found->second, speed.velocity, speed.angular_velocity,
                          body.friction_axis.value_or(Vector3d::Zero())});
  }
  for (const Pair& pair : scene.pairs) {
    if (!pair.touch) continue;
    contact::Meeting meeting;
    meeting.first = material.at(pair.first);
    meeting.second = material.at(pair.second);
    for (const effects::Effect* each : effects::all()) each->configure_pair(pair, meeting);
    meetings.push_back(meeting);
  }

  contact::SteppingOptions options = scene.stepping.value_or(SteppingOptions{});
  options.gravity.reset();
  options.simultaneous_impacts = scene.simultaneous_impacts;
  for (const effects::Effect* each : effects::all()) each->configure(scene, options);
  options.team = team;
  return contact::Stepper(std::move(bodies), std::move(surfaces), std::move(meetings), options);
}

}  // namespace

SteppingEngine::SteppingEngine(const Scene& scene, contact::SolverTeam* team)
    : stepper_(make_stepper(scene, team)),
      stepped_(scene),
      forces_(effects::make_forces(scene, stepped_.bodies())),
      on_failure_(scene.stepping.value_or(SteppingOptions{}).on_failure),
      fingerprint_(fingerprint(scene, stepper_.options().step)),
      bodies_(scene.bodies.size()) {
  if (!scene.joints.empty() || effects::has_joint_laws(scene)) {
    auto joints = std::make_unique<SteppedJoints>(scene);
    joints_ = joints.get();
    stepper_.add_joints(std::move(joints));
  }
  if (any_of(scene.bodies, [](const Body& body) { return body.surface.has_value(); }))
    for (const Body& body : scene.bodies) surface_.push_back(body.surface.value_or(SurfaceSpeed{}));
  add_forces(scene);
  if (scene.certificate)
    scribe_ = std::make_unique<StepScribe>(scene, stepper_, *scene.certificate);
  if (scene.start) begin_at(scene.start->time, scene.start->bodies);
  watch_energy(scene);
  read_bodies();
}

SteppingEngine::~SteppingEngine() = default;

// Explicit forces first: implicit ones need the velocities that they leave.
void SteppingEngine::add_forces(const Scene& scene) {
  using Stepping = mechanics::Force::Stepping;
  const Vector3d gravity = scene.gravity.value_or(Vector3d::Zero());
  bool first = true;
  for (const Stepping wanted : {Stepping::explicit_, Stepping::implicit})
    for (const auto& force : forces_) {
      if (force->stepping() != wanted) continue;
      force->check_step(scene, stepped_.bodies(), stepper_.options().step);
      stepper_.add_force(force->name(), [this, force = force.get(), gravity, first](
                                            contact::BodySet& bodies, double t, double dt) {
        if (first) stepped_.begin(bodies, dt * gravity);
        stepped_.set_time(t, dt);
        stepped_.read(bodies);
        force->step(stepped_, dt);
      });
      first = false;
    }
}

void SteppingEngine::advance(double t) {
  const double slack = kSameFigure * std::min(stepper_.options().step, t);
  bool moved = false, above = false;
  for (; time() < t - slack && !above && !interrupted(); moved = true) {
    take_step();
    above = excess() && excess()(forces()) > 0;
  }
  if (moved) read_bodies();
}

void SteppingEngine::step() {
  try {
    stepper_.step();
  } catch (const std::invalid_argument& e) {  // by contacts whose gap or place is no number
    throw SimulationError(
        fmt::format("t = {:g} s: the motion has left the range of numbers: {}", time(), e.what()));
  }
  if (energy_error_) energy_error_->add(stepper_.bodies(), stepper_.contacts());
}

void SteppingEngine::watch_energy(const Scene& scene) {
  const auto acts = [](const auto& force) {
    return force->stepping() != mechanics::Force::Stepping::by_contact;
  };
  const bool springs = any_of(forces_, acts) || (joints_ != nullptr && joints_->has_laws());
  if (springs || !effects::keeps_energy(scene) || stepper_.options().accuracy > 0) return;
  std::vector<char> joined(scene.bodies.size(), 0);
  for (const Joint& joint : scene.joints)
    for (const int body : {joint.first, joint.second})
      if (body >= 0) joined[static_cast<std::size_t>(body)] = 1;
  energy_error_ =
      std::make_unique<EnergyError>(scene.gravity.value_or(Vector3d::Zero()),
                                    stepper_.options().step, std::move(joined), stepper_.bodies());
}

void SteppingEngine::report_failure() const {
  for (const BodyState& b : bodies_)
    if (!b.is_finite())
      throw SimulationError(fmt::format(
          "t = {:g} s: the motion has left the range of numbers, about 1e-150 to 1e150 in SI "
          "units, or a step is far too long for it",
          time()));
  if (!stepper_.joints_met())
    throw SimulationError(fmt::format(
        "t = {:g} s: the joints are not met at the end of the step, off by up to {:g} m or rad, "
        "also in its sub-steps: bodies turn too far in them; reduce stepping.step, or set "
        "on_failure = \"warn\"",
        time(), stepper_.joint_drift()));
  const std::size_t contacts = stepper_.contacts().points.size();
  std::string text = fmt::format(
      "t = {:g} s: the problem of {} was not solved: {} at a residual of {:g}, wanted {:g}, also "
      "in sub-steps of {:g} s; raise stepping.tolerance or stepping.max_halvings, reduce "
      "stepping.step, or set on_failure = \"warn\"",
      time(),
      contacts == 0 ? std::string("the limits, motors and friction of joints and cables")
                    : fmt::format("{} contact{}", contacts, contacts == 1 ? "" : "s"),
      contact::name(stepper_.status()), stepper_.residual(), stepper_.options().tolerance,
      std::ldexp(stepper_.options().step, -stepper_.options().max_halvings));
  if (stepper_.status() == contact::Status::infeasible)
    text +=
        "; no impulses keep the bodies apart: joints, prescribed motions or fixed bodies drive "
        "them into each other";
  if (stepper_.joint_drift() > 0)
    text += fmt::format("; joints are off by up to {:g} m or rad", stepper_.joint_drift());
  throw SimulationError(text);
}

void SteppingEngine::read_bodies() {
  const contact::BodySet& b = stepper_.bodies();
  for (int i = 0; i < b.size(); ++i) bodies_[mechanics::at(i)] = mechanics::state_of(b, i);
}

Diagnostics SteppingEngine::diagnostics() const {
  const contact::BodySet& b = stepper_.bodies();
  Diagnostics d;
  d.kinetic_energy = contact::kinetic_energy(b);
  stepped_.copy(b);
  for (const auto& force : forces_) d.potential_energy += force->potential(stepped_.bodies());
  if (energy_error_) d.energy_error = energy_error_->sum();
  d.momentum = contact::momentum(b);
  d.angular_momentum = contact::angular_momentum(b);
  d.contacts = static_cast<int>(stepper_.contacts().points.size());
  d.penetration = stepper_.penetration();
  d.residual = stepper_.residual();
  d.drift = stepper_.joint_drift();
  return d;
}

Vector3d SteppingEngine::surface_velocity(int body, const Vector3d& r) const {
  if (body < 0) return Vector3d::Zero();
  const SurfaceSpeed& s = surface_[static_cast<std::size_t>(body)];
  const linalg::Quaternion& q = stepper_.bodies().orientation[static_cast<std::size_t>(body)];
  return q * s.velocity + (q * s.angular_velocity).cross(r);
}

const std::vector<ContactState>& SteppingEngine::contacts() const {
  if (contacts_of_ == stepper_.counts().steps) return contacts_;
  contacts_of_ = stepper_.counts().steps;
  const contact::StepContacts& c = stepper_.contacts();
  const contact::BodySet& b = stepper_.bodies();
  const std::vector<Vector3d>& moments = stepper_.contact_moments();
  const double dt = stepper_.last_sub_step();
  contacts_.resize(c.points.size());
  for (std::size_t k = 0; k < c.points.size(); ++k) {
    const contact::PointContact& p = c.points[k];
    ContactState& s = contacts_[k];
    s.first = p.first;
    s.second = p.second;
    s.point = b.position[static_cast<std::size_t>(p.first)] + p.r1;
    s.normal = p.normal;
    s.impulse = k < c.impulses.size() ? c.impulses[k] : Vector3d(Vector3d::Zero());
    s.gap = c.gaps[k];
    s.force = dt > 0 ? Vector3d(s.impulse / dt) : Vector3d::Zero();
    s.slip = velocity(b, p.first, p.r1) - velocity(b, p.second, p.r2);
    if (!surface_.empty())
      s.slip += surface_velocity(p.first, p.r1) - surface_velocity(p.second, p.r2);
    s.slip -= p.normal.dot(s.slip) * p.normal;
    s.moment = k < moments.size() && dt > 0 ? Vector3d(moments[k] / dt) : Vector3d::Zero();
  }
  return contacts_;
}

Forces SteppingEngine::forces() const {
  Forces out;
  if (joints_)
    out.joints = joints_->reactions(stepper_.bodies(), time(), stepper_.joint_impulses(),
                                    stepper_.last_sub_step());
  stepped_.set_time(time(), 0);
  stepped_.copy(stepper_.bodies());
  for (const auto& force : forces_) force->report(stepped_.bodies(), out);
  if (joints_) joints_->add_law_forces(stepper_.law_impulses(), stepper_.last_sub_step(), out);
  return out;
}

Counts SteppingEngine::counts() const {
  const contact::StepCounts& c = stepper_.counts();
  Counts out;
  out.steps = c.steps;
  out.contact_problems = c.contact_problems;
  out.sweeps = c.sweeps;
  out.unsolved = c.unsolved;
  out.accepted = c.accepted;
  out.halved = c.halved;
  out.error_test_failures = c.rejected;
  return out;
}

void SteppingEngine::save(std::ostream& out) const {
  out.write(kMagic, sizeof kMagic);
  binary::Archive io(out);
  double now = time();
  io(fingerprint_);
  exchange_bodies(io, now, bodies_);
  contact::StepperMemory memory = stepper_.memory();
  exchange(io, static_cast<int>(bodies_.size()), memory);
  if (!out) throw std::runtime_error("the state could not be written");
}

void SteppingEngine::set_bodies(const std::vector<BodyState>& states) {
  contact::BodySet& b = stepper_.bodies();
  for (int i = 0; i < b.size(); ++i) mechanics::put_state(states[mechanics::at(i)], i, b);
  if (energy_error_) energy_error_->begin_at(b);
}

// Goes on from what another engine saved.
void SteppingEngine::take_over(std::istream& in) {
  std::vector<BodyState> states(bodies_.size());
  binary::Archive io(in);
  double time = 0;
  exchange_bodies(io, time, states);
  if (!(time >= 0 && time <= kMostSteps * stepper_.options().step))
    throw std::runtime_error("the saved state is damaged: it has no time");
  in.ignore(std::numeric_limits<std::streamsize>::max());
  begin_at(time, states);
}

// The first step is shorter. It is taken at once: states that are saved are those of boundaries.
void SteppingEngine::begin_at(double time, const std::vector<BodyState>& states) {
  const double step = stepper_.options().step, nearest = std::round(time / step);
  const bool boundary = std::abs(time - nearest * step) <= kSameFigure * step + 1e-15 * time;
  const double steps = boundary ? nearest : std::floor(time / step);
  set_bodies(states);
  stepper_.start_anew(std::lround(steps), boundary ? 0 : time - steps * step);
  contacts_of_ = -1;
  if (!boundary) take_step();
  read_bodies();
}

void SteppingEngine::restore(std::istream& in, Restore how) {
  binary::Magic magic;
  in.read(magic, sizeof magic);
  if (in && how == Restore::near && std::memcmp(magic, kBodiesFirst, sizeof magic) == 0)
    return take_over(in);
  if (!in || std::memcmp(magic, kMagic, sizeof magic - 1) != 0)
    throw std::runtime_error("this is no saved state of the stepping engine");
  const char format = magic[sizeof magic - 1];
  if (format != kMagic[sizeof magic - 1])
    throw std::runtime_error(std::string("the saved state has format ") + format +
                             ", and this version reads " + kMagic[sizeof magic - 1] +
                             ": read it with the version that wrote it");
  binary::Archive io(in);
  std::uint64_t of = 0;
  io(of);
  const bool same = of == fingerprint_;
  if (!same && how == Restore::exact)
    throw std::runtime_error("the saved state is of another scene or another step");
  double time = 0;
  std::vector<BodyState> states(bodies_.size());
  exchange_bodies(io, time, states);
  contact::StepperMemory memory;
  exchange(io, static_cast<int>(bodies_.size()), memory);
  if (!(std::abs(time) <= kMostSteps * stepper_.options().step))
    throw std::runtime_error("the saved state is damaged: it has no time");
  set_bodies(states);
  try {
    if (same)
      stepper_.set_memory(memory);
    else
      stepper_.start_anew(std::lround(time / stepper_.options().step));
  } catch (const std::invalid_argument&) {
    throw std::runtime_error("the saved state is of another scene");
  }
  if (same && this->time() != time)
    throw std::runtime_error("the saved state is damaged: its steps lead to another time");
  contacts_of_ = -1;
  read_bodies();
}

}  // namespace tether::scene::stepping

std::unique_ptr<tether::scene::Engine> tether::scene::make_stepping_engine(const Scene& scene) {
  return std::make_unique<stepping::SteppingEngine>(scene);
}

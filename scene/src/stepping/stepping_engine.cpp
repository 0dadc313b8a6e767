// Tether: the engine that steps with impulses. SPDX-License-Identifier: BSD-3-Clause
#include "stepping_engine.hpp"

#include <cmath>
#include <cstring>
#include <istream>
#include <ostream>
#include <sstream>
#include <stdexcept>
#include <utility>

#if defined(TETHER_HAVE_COLLISION)
#include <tether/contact/polyhedra.hpp>
#endif

namespace tether::scene::stepping {

using Eigen::Vector3d;

namespace {

std::unique_ptr<contact::PairCollision> polyhedra(const Scene& scene) {
#if defined(TETHER_HAVE_COLLISION)
  if (!scene.pairs.empty()) return contact::make_polyhedra();
#else
  (void)scene;
#endif
  return nullptr;
}

contact::Stepper make_stepper(const Scene& scene, Mapped mapped) {
  return contact::Stepper(std::move(mapped.bodies), std::move(mapped.surfaces),
                          std::move(mapped.meetings), mapped.options, polyhedra(scene));
}

// FNV-1a over what makes saved states of two scenes interchangeable.
std::uint64_t fingerprint(const Scene& scene, double step) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  const auto add = [&](const void* data, std::size_t size) {
    const auto* byte = static_cast<const unsigned char*>(data);
    for (std::size_t k = 0; k < size; ++k) hash = (hash ^ byte[k]) * 0x100000001b3u;
  };
  add(&step, sizeof step);
  for (const Body& body : scene.bodies) {
    add(body.name.data(), body.name.size() + 1);
    const double mass = body.fixed ? 0 : body.mass;
    add(&mass, sizeof mass);
  }
  return hash;
}

constexpr char kMagic[8] = {'T', 'E', 'T', 'H', 'S', 'T', 'P', '1'};

template <class T>
void put(std::ostream& out, const T& value) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  out.write(bytes, sizeof(T));
}

template <class T>
T get(std::istream& in) {
  char bytes[sizeof(T)];
  if (!in.read(bytes, sizeof(T))) throw std::runtime_error("the saved state ends too early");
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

}  // namespace

SteppingEngine::SteppingEngine(const Scene& scene) : SteppingEngine(scene, map_scene(scene)) {}

SteppingEngine::SteppingEngine(const Scene& scene, Mapped mapped)
    : gravity_(scene.gravity),
      springs_(attach(scene)),
      on_failure_(scene.stepping.value_or(SteppingOptions{}).on_failure),
      stepper_(make_stepper(scene, std::move(mapped))),
      fingerprint_(fingerprint(scene, stepper_.options().step)),
      bodies_(scene.bodies.size()) {
  add_forces(scene, springs_, stepper_);
  read_bodies();
}

void SteppingEngine::advance(double t) {
  // A time that is a multiple of the step up to round-off is that step.
  const double slack = 1e-9 * stepper_.options().step;
  while (time() < t - slack) {
    stepper_.step();
    if (on_failure_ == OnFailure::stop && !stepper_.succeeded()) {
      read_bodies();
      report_failure();
    }
  }
  read_bodies();
}

void SteppingEngine::report_failure() const {
  std::ostringstream text;
  text << "t = " << time() << " s: the contact problem (" << stepper_.contacts().points.size()
       << " contacts) was not solved: " << contact::name(stepper_.status()) << " at a residual of "
       << stepper_.residual() << ", wanted " << stepper_.options().tolerance << ", also in parts of "
       << std::ldexp(stepper_.options().step, -stepper_.options().max_halvings)
       << " s; raise stepping.tolerance or stepping.max_halvings, reduce stepping.step, or set "
          "on_failure = \"warn\"";
  throw SimulationError(text.str());
}

void SteppingEngine::read_bodies() {
  const contact::BodySet& b = stepper_.bodies();
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    bodies_[i] = {b.position[i], b.orientation[i], b.motion[i].velocity,
                  b.motion[i].angular_velocity};
}

Diagnostics SteppingEngine::diagnostics() const {
  const contact::BodySet& b = stepper_.bodies();
  Diagnostics d;
  d.kinetic_energy = contact::kinetic_energy(b);
  if (gravity_)
    for (std::size_t i = 0; i < b.position.size(); ++i)
      d.potential_energy -= b.mass[i] * gravity_->dot(b.position[i]);
  d.potential_energy += potential_energy(springs_, b);
  d.momentum = contact::momentum(b);
  d.angular_momentum = contact::angular_momentum(b);
  d.contacts = static_cast<int>(stepper_.contacts().points.size());
  d.penetration = stepper_.penetration();
  d.residual = stepper_.residual();
  return d;
}

const std::vector<ContactState>& SteppingEngine::contacts() const {
  if (contacts_of_ == stepper_.counts().steps) return contacts_;
  contacts_of_ = stepper_.counts().steps;
  const contact::StepContacts& c = stepper_.contacts();
  const contact::BodySet& b = stepper_.bodies();
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
  }
  return contacts_;
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
  return out;
}

std::vector<EffectCost> SteppingEngine::costs() const {
  std::vector<EffectCost> out;
  for (const contact::StageCost& c : stepper_.costs()) out.push_back({c.effect, c.seconds});
  return out;
}

void SteppingEngine::save(std::ostream& out) {
  out.write(kMagic, sizeof kMagic);
  put(out, fingerprint_);
  put(out, static_cast<std::int64_t>(stepper_.counts().steps));
  const contact::BodySet& b = stepper_.bodies();
  for (std::size_t i = 0; i < b.position.size(); ++i) {
    for (int k = 0; k < 3; ++k) put(out, b.position[i][k]);
    for (int k = 0; k < 4; ++k) put(out, b.orientation[i].coeffs()[k]);
    for (int k = 0; k < 3; ++k) put(out, b.motion[i].velocity[k]);
    for (int k = 0; k < 3; ++k) put(out, b.motion[i].angular_velocity[k]);
  }
  if (!out) throw std::runtime_error("the state could not be written");
  // Warm starts are not saved; the run that goes on does without them as well, to the same bits.
  stepper_.start_anew(stepper_.counts().steps);
}

void SteppingEngine::restore(std::istream& in) {
  char magic[sizeof kMagic];
  if (!in.read(magic, sizeof magic) || std::memcmp(magic, kMagic, sizeof magic) != 0)
    throw std::runtime_error("this is no saved state of the stepping engine");
  if (get<std::uint64_t>(in) != fingerprint_)
    throw std::runtime_error("the saved state is of another scene or another step");
  const auto steps = get<std::int64_t>(in);
  if (steps < 0) throw std::runtime_error("the saved state is damaged");
  std::vector<BodyState> states(bodies_.size());
  for (BodyState& s : states) {
    for (int k = 0; k < 3; ++k) s.position[k] = get<double>(in);
    for (int k = 0; k < 4; ++k) s.orientation.coeffs()[k] = get<double>(in);
    for (int k = 0; k < 3; ++k) s.velocity[k] = get<double>(in);
    for (int k = 0; k < 3; ++k) s.angular_velocity[k] = get<double>(in);
    if (!s.position.allFinite() || !(std::abs(s.orientation.norm() - 1) < 1e-6) ||
        !s.velocity.allFinite() || !s.angular_velocity.allFinite())
      throw std::runtime_error("the saved state is damaged");
  }
  contact::BodySet& b = stepper_.bodies();
  for (std::size_t i = 0; i < states.size(); ++i) {
    b.position[i] = states[i].position;
    b.orientation[i] = states[i].orientation;
    b.motion[i].velocity = states[i].velocity;
    b.motion[i].angular_velocity = states[i].angular_velocity;
  }
  stepper_.start_anew(static_cast<long>(steps));
  contacts_of_ = -1;
  read_bodies();
}

}  // namespace tether::scene::stepping

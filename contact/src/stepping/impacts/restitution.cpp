// Tether: restitution that cannot create energy. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/impacts/restitution.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>

#include "stepping/motion/rotation.hpp"
#include "stepping/sub_step.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;

namespace {

using linalg::at;

constexpr double kRounding = 1e-14;  // of the kinetic energy of what changes

// Kinetic energy of body i with velocities `now` against `came`, J.
double kinetic_gain(const BodySet& bodies, std::size_t i, const RigidBody& now,
                    const RigidBody& came) {
  const Vector3d dw = now.angular_velocity - came.angular_velocity;
  return 0.5 * bodies.mass[i] * (now.velocity - came.velocity).dot(now.velocity + came.velocity) +
         0.5 * spin(bodies.inertia[i], bodies.orientation[i], dw)
                   .dot(now.angular_velocity + came.angular_velocity);
}

// Work of the forces of a step on body i, which have changed its velocities by those of `change`:
// their impulse times the velocities `now` that it moves with. For a weight it is the potential
// energy that is lost, exactly.
double work(const BodySet& bodies, std::size_t i, const Vector6d& change, const Vector6d& now) {
  return bodies.mass[i] * change.head<3>().dot(now.head<3>()) +
         spin(bodies.inertia[i], bodies.orientation[i], change.tail<3>()).dot(now.tail<3>());
}
// to = a - b
void subtract(const std::vector<RigidBody>& a, const std::vector<RigidBody>& b,
              std::vector<Vector6d>& to) {
  to.resize(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) to[i] = a[i].velocities() - b[i].velocities();
}

}  // namespace

BodyOptions cold(BodyOptions options) {
  options.warm_start = false;
  return options;
}

Restitution::Restitution(RestitutionLaw law, const BodyOptions& options, ConeSources& sources,
                         LawUse use)
    : law_(law), sources_(sources), islands_(sources.links), solver_(cold(options), sources, use) {}

void Restitution::choose(const Impacts& chosen, const std::vector<Strike>& limits,
                         const BodySet& bodies, StepContacts& contacts) {
  bounces_.clear();
  biased_.clear();
  limits_.clear();
  for (const Strike& s : limits)
    if (s.restitution > 0) limits_.push_back(s.moves);
  for (const Impact& i : chosen.list()) {
    if (i.restitution == 0) continue;
    PointContact& c = contacts.points[at(i.contact)];
    // Restitution of the speed that the forces of this step add would make a body at rest hop.
    const double speed = i.restitution * std::min(i.came, i.comes);
    bounces_.push_back({i.contact, speed / i.comes});
    if (law_ != RestitutionLaw::newton) continue;
    c.bias = -speed;
    biased_.push_back(i.contact);
  }
  if (bounces_.empty() && limits_.empty()) return;
  before_ = bodies.motion;
  came_ = chosen.coming();
  subtract(before_, came_, force_);
}

// By motors and friction of joints, whose impulses count as forces of the step.
void Restitution::add_laws(bool plastic, const BodySet& bodies,
                           std::vector<Vector6d>& forces) const {
  forces.assign(bodies.motion.size(), Vector6d::Zero());
  if (sources_.laws) sources_.laws->add_bounded(plastic, bodies, forces);
}

// An island gains the energy constant + linear s + square s^2 in the step, where s is the scale of
// `change_` from the velocities in `bodies`. The gain is the kinetic energy less that of `came_`
// and less the work of the forces. Their work is their impulse, which s changes for motors, times
// the velocities that bodies move with. Without restitution the gain is at most 0:
// -|M^-1 (f dt + J'x)|^2 / 2 in the metric of the masses, and what friction takes.
void Restitution::sum_energies(const BodySet& bodies) {
  const std::size_t n = bodies.motion.size();
  for (std::vector<double>* sum : {&constant_, &linear_, &square_, &kinetic_}) sum->assign(n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    if (bodies.mass[i] == 0) continue;
    const Vector6d is = bodies.motion[i].velocities(), &d = change_[i], &f = force_[i];
    const std::size_t r = at(islands_.root(static_cast<int>(i)));
    constant_[r] += kinetic_gain(bodies, i, bodies.motion[i], came_[i]) - work(bodies, i, f, is) -
                    work(bodies, i, driven_[i], is);
    linear_[r] += work(bodies, i, is, d) - work(bodies, i, f, d) - work(bodies, i, driven_[i], d) -
                  work(bodies, i, driven_change_[i], is);
    const double kinetic = 0.5 * work(bodies, i, d, d);
    square_[r] += kinetic - work(bodies, i, driven_change_[i], d);
    kinetic_[r] += kinetic;
  }
}

// Marks the islands that bounce and gain energy in the step; false: none does.
bool Restitution::gains_energy(const BodySet& bodies, const StepContacts& contacts) {
  subtract(bodies.motion, before_, change_);
  add_laws(false, bodies, driven_);
  driven_change_ = driven_;
  sum_energies(bodies);
  gains_.assign(change_.size(), 0);
  islands_.mark(limits_, gains_);
  for (const Bounce& b : bounces_)
    gains_[at(islands_.root(bodies, contacts.points[at(b.contact)]))] = 1;
  bool any = false;
  for (std::size_t i = 0; i < gains_.size(); ++i) {
    gains_[i] = gains_[i] != 0 && constant_[i] > kRounding * kinetic_[i];
    any = any || gains_[i] != 0;
  }
  return any;
}

// The largest s <= 1 that leaves no island with more energy than before; at s = 0 none has.
void Restitution::limit_energy(const BodySet& bodies) {
  sum_energies(bodies);
  scale_.assign(constant_.size(), 1);
  for (std::size_t i = 0; i < scale_.size(); ++i) {
    const double a = square_[i], b = linear_[i], c = std::min(constant_[i], 0.0);
    if (!(kinetic_[i] > 0) || a + b + c <= kRounding * kinetic_[i]) continue;
    const double root_of = std::sqrt(b * b - 4 * a * c);
    const double s = b > 0 ? -2 * c / (b + root_of) : (root_of - b) / (2 * a);
    scale_[i] = std::clamp(s, 0.0, 1.0);
  }
}

// From the solution without restitution in `bodies` and `contacts` to `change_` and `added_`.
void Restitution::add_impulses_again(BodySet& bodies, StepContacts& contacts) {
  change_.resize(bodies.motion.size());
  for (std::size_t i = 0; i < change_.size(); ++i) change_[i] = bodies.motion[i].velocities();
  for (const Bounce& b : bounces_) {
    const PointContact& c = contacts.points[at(b.contact)];
    const Vector3d p = b.part * contacts.impulses[at(b.contact)];
    push(bodies.motion[at(c.first)], c.r1, p);
    push(bodies.motion[at(c.second)], c.r2, -p);
  }
  solver_.solve(bodies.motion, contacts.points, solution_);
  for (std::size_t i = 0; i < bodies.motion.size(); ++i) {
    bodies.motion[i].set_velocities(change_[i]);
    change_[i] = found(i) - change_[i];
  }
  added_ = solution_.impulses;
  for (const Bounce& b : bounces_)
    added_[at(b.contact)] += b.part * contacts.impulses[at(b.contact)];
}

// Takes islands that gain energy from the solution with restitution to the one without it, in
// `bodies` and `contacts`; the difference is in `change_` and `added_`.
void Restitution::solve_without(BodySet& bodies, StepContacts& contacts) {
  for (const int k : biased_)
    if (gains(islands_.root(bodies, contacts.points[at(k)]))) contacts.points[at(k)].bias = 0;
  points_.clear();
  contact_.clear();
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    if (!gains(islands_.root(bodies, contacts.points[k]))) continue;
    points_.push_back(contacts.points[k]);
    contact_.push_back(k);
  }
  solver_.solve(before_, points_, solution_);
  change_.resize(bodies.motion.size());
  for (std::size_t i = 0; i < bodies.motion.size(); ++i) {
    const bool changes = bodies.mass[i] > 0 && gains(static_cast<int>(i));
    change_[i].setZero();
    if (!changes) continue;
    change_[i] = bodies.motion[i].velocities() - found(i);
    bodies.motion[i].set_velocities(found(i));
  }
  added_.assign(contacts.impulses.size(), Vector3d::Zero());
  for (std::size_t j = 0; j < contact_.size(); ++j) {
    Vector3d& x = contacts.impulses[contact_[j]];
    added_[contact_[j]] = x - solution_.impulses[j];
    x = solution_.impulses[j];
  }
  add_laws(true, bodies, driven_);
  for (std::size_t i = 0; i < driven_.size(); ++i) driven_change_[i] -= driven_[i];
}

// Both ends obey the contacts and the cones; so does everything between them.
void Restitution::add_change(BodySet& bodies, StepContacts& contacts) {
  const auto scale = [&](int body) { return scale_[at(islands_.root(body))]; };
  for (std::size_t i = 0; i < bodies.motion.size(); ++i) {
    if (bodies.mass[i] == 0) continue;
    RigidBody& body = bodies.motion[i];
    body.set_velocities(body.velocities() + scale(static_cast<int>(i)) * change_[i]);
  }
  for (std::size_t k = 0; k < contacts.points.size(); ++k)
    contacts.impulses[k] += scale(islands_.root(bodies, contacts.points[k])) * added_[k];
  if (sources_.laws)
    sources_.laws->scale_restitution(sources_.mechanisms,
                                     [&](int body) { return gains(body) ? scale(body) : 1; });
}

int Restitution::apply(BodySet& bodies, StepContacts& contacts) {
  bounces_.erase(
      std::remove_if(bounces_.begin(), bounces_.end(),
                     [&](const Bounce& b) { return contacts.impulses[at(b.contact)].isZero(0); }),
      bounces_.end());
  if (bounces_.empty() && limits_.empty()) return 0;
  islands_.join(bodies, contacts);
  if (law_ == RestitutionLaw::poisson) {
    add_impulses_again(bodies, contacts);
    add_laws(false, bodies, driven_);
    driven_change_ = driven_;
  } else {
    if (!gains_energy(bodies, contacts)) return static_cast<int>(bounces_.size());
    solve_without(bodies, contacts);
  }
  limit_energy(bodies);
  add_change(bodies, contacts);
  return static_cast<int>(bounces_.size());
}

}  // namespace tether::contact::detail

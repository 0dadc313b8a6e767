// Tether: restitution that cannot create energy. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/impacts/restitution.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>

#include "stepping/impacts/step_energy.hpp"
#include "stepping/motion/rotation.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;

namespace {

using linalg::at;

void push(RigidBody& body, const Vector3d& r, const Vector3d& p) {
  body.velocity += body.inverse_mass * p;
  body.angular_velocity += body.inverse_inertia * r.cross(p);
}

}  // namespace

BodyOptions cold(BodyOptions options) {
  options.warm_start = false;
  return options;
}

Restitution::Restitution(RestitutionLaw law, const BodyOptions& options)
    : law_(law), solver_(cold(options)) {}

void Restitution::choose(const Impacts& chosen, const Impacts& forces, const BodySet& bodies,
                         StepContacts& contacts) {
  bounces_.clear();
  biased_.clear();
  for (const Impact& i : chosen.list()) {
    if (i.restitution == 0) continue;
    PointContact& c = contacts.points[at(i.contact)];
    // The speed that the forces of this step added is not given back: a body at rest would hop.
    const double speed = i.restitution * std::min(i.came, i.comes);
    bounces_.push_back({i.contact, speed, speed / i.comes});
    if (law_ != RestitutionLaw::newton) continue;
    c.bias = -speed;
    biased_.push_back(i.contact);
  }
  if (bounces_.empty()) return;
  before_ = bodies.motion;
  came_ = chosen.coming();
  add_of_forces(forces, force_);
}

// What an island gains in the step as a function of the scale s of `change_`, from `now`: kinetic
// energy against `came_` less the work of the forces, which is their impulse times the velocities
// that bodies move with (in a later pass of a step: less the work that they would do without it).
// constant + linear s + square s^2. Without restitution it is at most 0:
// -|M^-1 (f dt + J'x)|^2 / 2 in the metric of the masses, and what friction takes.
void Restitution::sum_energies(const BodySet& bodies, const std::vector<RigidBody>& now) {
  const std::size_t n = now.size();
  constant_.assign(n, 0);
  linear_.assign(n, 0);
  square_.assign(n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    const double m = bodies.mass[i];
    if (m == 0) continue;
    const auto spin_of = [&](const Vector3d& w) {
      return spin(bodies.inertia[i], bodies.orientation[i], w);
    };
    const RigidBody &is = now[i], &was = came_[i], &d = change_[i], &f = force_[i];
    const std::size_t r = at(islands_.root(static_cast<int>(i)));
    RigidBody counted = f;  // in earlier passes
    counted.velocity -= before_[i].velocity - was.velocity;
    counted.angular_velocity -= before_[i].angular_velocity - was.angular_velocity;
    constant_[r] += kinetic_gain(bodies, i, is, was) - work(bodies, i, f, is) +
                    work(bodies, i, counted, before_[i]);
    const Vector3d L = spin_of(d.angular_velocity);
    linear_[r] += m * (is.velocity - f.velocity).dot(d.velocity) +
                  (is.angular_velocity - f.angular_velocity).dot(L);
    square_[r] += 0.5 * (m * d.velocity.squaredNorm() + d.angular_velocity.dot(L));
  }
}

// Does an island gain energy in the step?
bool Restitution::gains_energy(const BodySet& bodies) {
  change_ = bodies.motion;
  for (std::size_t i = 0; i < change_.size(); ++i) {
    change_[i].velocity -= before_[i].velocity;
    change_[i].angular_velocity -= before_[i].angular_velocity;
  }
  sum_energies(bodies, bodies.motion);
  for (std::size_t i = 0; i < change_.size(); ++i)
    if (constant_[i] > 1e-14 * square_[i]) return true;
  return false;
}

// The largest s <= 1 that leaves no island with more energy than before; at s = 0 none has.
void Restitution::limit_energy(const BodySet& bodies) {
  sum_energies(bodies, bodies.motion);
  scale_.assign(constant_.size(), 1);
  for (std::size_t i = 0; i < scale_.size(); ++i) {
    const double a = square_[i], b = linear_[i], c = std::min(constant_[i], 0.0);
    if (!(a > 0) || a + b + c <= 1e-14 * a) continue;
    const double root_of = std::sqrt(b * b - 4 * a * c);
    const double s = b > 0 ? -2 * c / (b + root_of) : (root_of - b) / (2 * a);
    scale_[i] = std::clamp(s, 0.0, 1.0);
  }
}

// From the solution without restitution in `bodies` and `contacts` to `change_` and `added_`.
void Restitution::add_impulses_again(BodySet& bodies, StepContacts& contacts) {
  change_ = bodies.motion;
  for (const Bounce& b : bounces_) {
    const PointContact& c = contacts.points[at(b.contact)];
    const Vector3d p = b.part * contacts.impulses[at(b.contact)];
    push(bodies.motion[at(c.first)], c.r1, p);
    push(bodies.motion[at(c.second)], c.r2, -p);
  }
  solver_.solve(bodies.motion, contacts.points, solution_);
  for (std::size_t i = 0; i < bodies.motion.size(); ++i) {
    bodies.motion[i].velocity = change_[i].velocity;
    bodies.motion[i].angular_velocity = change_[i].angular_velocity;
    change_[i].velocity = solution_.velocities[i] - change_[i].velocity;
    change_[i].angular_velocity = solution_.angular_velocities[i] - change_[i].angular_velocity;
  }
  added_ = solution_.impulses;
  for (const Bounce& b : bounces_)
    added_[at(b.contact)] += b.part * contacts.impulses[at(b.contact)];
}

// From the solution with restitution to the one without it, in `bodies` and `contacts`, and the
// difference in `change_` and `added_`.
void Restitution::solve_without(BodySet& bodies, StepContacts& contacts) {
  for (const int k : biased_) contacts.points[at(k)].bias = 0;
  change_ = bodies.motion;
  added_ = contacts.impulses;
  solver_.solve(before_, contacts.points, solution_);
  for (std::size_t i = 0; i < bodies.motion.size(); ++i) {
    if (bodies.mass[i] == 0) continue;
    bodies.motion[i].velocity = solution_.velocities[i];
    bodies.motion[i].angular_velocity = solution_.angular_velocities[i];
    change_[i].velocity -= solution_.velocities[i];
    change_[i].angular_velocity -= solution_.angular_velocities[i];
  }
  for (std::size_t k = 0; k < added_.size(); ++k) {
    contacts.impulses[k] = solution_.impulses[k];
    added_[k] -= solution_.impulses[k];
  }
}

// Both ends obey the contacts and the cones; so does everything between them.
void Restitution::add_change(BodySet& bodies, StepContacts& contacts) {
  for (std::size_t i = 0; i < bodies.motion.size(); ++i) {
    if (bodies.mass[i] == 0) continue;
    const double s = scale_[at(islands_.root(static_cast<int>(i)))];
    bodies.motion[i].velocity += s * change_[i].velocity;
    bodies.motion[i].angular_velocity += s * change_[i].angular_velocity;
  }
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    const double s = scale_[at(islands_.root(bodies, contacts.points[k]))];
    contacts.impulses[k] += s * added_[k];
  }
}

int Restitution::apply(BodySet& bodies, StepContacts& contacts) {
  bounces_.erase(
      std::remove_if(bounces_.begin(), bounces_.end(),
                     [&](const Bounce& b) { return contacts.impulses[at(b.contact)].isZero(0); }),
      bounces_.end());
  if (bounces_.empty()) return 0;
  islands_.join(bodies, contacts);
  if (law_ == RestitutionLaw::poisson) {
    add_impulses_again(bodies, contacts);
  } else {
    if (!gains_energy(bodies)) return static_cast<int>(bounces_.size());
    solve_without(bodies, contacts);
  }
  limit_energy(bodies);
  add_change(bodies, contacts);
  return static_cast<int>(bounces_.size());
}

}  // namespace tether::contact::detail

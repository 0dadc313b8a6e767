// Tether: restitution that cannot create energy. SPDX-License-Identifier: BSD-3-Clause
#include "restitution.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "rotation.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;

namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

double normal_velocity(const std::vector<RigidBody>& motion, const PointContact& c) {
  const RigidBody &a = motion[at(c.first)], &b = motion[at(c.second)];
  return c.normal.dot(a.velocity + a.angular_velocity.cross(c.r1) - b.velocity -
                      b.angular_velocity.cross(c.r2));
}

void push(RigidBody& body, const Vector3d& r, const Vector3d& p) {
  body.velocity += body.inverse_mass * p;
  body.angular_velocity += body.inverse_inertia * r.cross(p);
}

BodyOptions cold(BodyOptions options) {
  options.warm_start = false;
  return options;
}

}  // namespace

Restitution::Restitution(double threshold, const BodyOptions& options)
    : threshold_(threshold), solver_(cold(options)) {}

void Restitution::remember(const BodySet& bodies) { coming_ = bodies.motion; }

void Restitution::choose(const NearContacts& near, const BodySet& bodies, double dt,
                         StepContacts& contacts) {
  bounces_.clear();
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    PointContact& c = contacts.points[k];
    const double epsilon = near.meeting(c).restitution;
    if (epsilon == 0) continue;
    const double came = -normal_velocity(coming_, c);
    if (!(came > threshold_)) continue;
    const double comes = -normal_velocity(bodies.motion, c);
    if (!(comes * dt > contacts.gaps[k])) continue;
    // The speed that the forces of this step added is not given back: a body at rest would hop.
    bounces_.push_back({static_cast<int>(k), epsilon * std::min(1.0, came / comes)});
    c.bias = 0;
  }
  if (!bounces_.empty()) before_ = bodies.motion;
}

int Restitution::root(int body) {
  while (parent_[at(body)] != body) body = parent_[at(body)] = parent_[at(parent_[at(body)])];
  return body;
}

// Energy of an island against `before_` as a function of the scale s of `change_`:
// constant + linear s + square s^2, constant <= 0. The largest s <= 1 that keeps it <= 0.
void Restitution::limit_energy(const BodySet& bodies, const StepContacts& contacts) {
  const std::size_t n = bodies.motion.size();
  parent_.resize(n);
  std::iota(parent_.begin(), parent_.end(), 0);
  for (const PointContact& c : contacts.points)
    if (bodies.mass[at(c.first)] > 0 && bodies.mass[at(c.second)] > 0)
      parent_[at(root(c.first))] = root(c.second);
  constant_.assign(n, 0);
  linear_.assign(n, 0);
  square_.assign(n, 0);
  scale_.assign(n, 1);
  for (std::size_t i = 0; i < n; ++i) {
    const double m = bodies.mass[i];
    if (m == 0) continue;
    const auto spin_of = [&](const Vector3d& w) {
      return spin(bodies.inertia[i], bodies.orientation[i], w);
    };
    const RigidBody &now = bodies.motion[i], &was = before_[i], &d = change_[i];
    const std::size_t r = at(root(static_cast<int>(i)));
    constant_[r] += 0.5 * m * (now.velocity - was.velocity).dot(now.velocity + was.velocity) +
                    0.5 * spin_of(now.angular_velocity - was.angular_velocity)
                              .dot(now.angular_velocity + was.angular_velocity);
    const Vector3d L = spin_of(d.angular_velocity);
    linear_[r] += m * now.velocity.dot(d.velocity) + now.angular_velocity.dot(L);
    square_[r] += 0.5 * (m * d.velocity.squaredNorm() + d.angular_velocity.dot(L));
  }
  for (std::size_t i = 0; i < n; ++i) {
    const double a = square_[i], b = linear_[i], c = std::min(constant_[i], 0.0);
    if (!(a > 0) || a + b + c <= 1e-14 * a) {
      scale_[i] = 1;
      continue;
    }
    const double root_of = std::sqrt(b * b - 4 * a * c);
    const double s = b > 0 ? -2 * c / (b + root_of) : (root_of - b) / (2 * a);
    scale_[i] = std::clamp(s, 0.0, 1.0);
  }
}

int Restitution::apply(BodySet& bodies, StepContacts& contacts) {
  bounces_.erase(
      std::remove_if(bounces_.begin(), bounces_.end(),
                     [&](const Bounce& b) { return contacts.impulses[at(b.contact)].isZero(0); }),
      bounces_.end());
  if (bounces_.empty()) return 0;

  // change_: first the velocities without restitution, at the end what restitution adds to them.
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

  // Both ends obey the contacts and the cones; so does everything between them.
  limit_energy(bodies, contacts);
  for (std::size_t i = 0; i < bodies.motion.size(); ++i) {
    if (bodies.mass[i] == 0) continue;
    const double s = scale_[at(root(static_cast<int>(i)))];
    bodies.motion[i].velocity += s * change_[i].velocity;
    bodies.motion[i].angular_velocity += s * change_[i].angular_velocity;
  }
  for (const Bounce& b : bounces_)
    solution_.impulses[at(b.contact)] += b.part * contacts.impulses[at(b.contact)];
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    const PointContact& c = contacts.points[k];
    const int moving = bodies.mass[at(c.first)] > 0 ? c.first : c.second;
    contacts.impulses[k] += scale_[at(root(moving))] * solution_.impulses[k];
  }
  return static_cast<int>(bounces_.size());
}

}  // namespace tether::contact::detail

// Tether: the bodies of a smooth scene and their unknowns. SPDX-License-Identifier: BSD-3-Clause
#include "moving_bodies.hpp"

#include <Eigen/LU>
#include <tether/linalg/symmetric_eigen.hpp>

#include "mechanics/force.hpp"
#include "mechanics/frames.hpp"

namespace tether::scene::smooth {

namespace {

Inertia inertia_of(const Body& body) {
  if (!(body.mass > 0) || !(linalg::symmetric_eigenvalues(body.inertia)[0] > 0))
    throw std::invalid_argument(
        "body \"" + body.name +
        "\" moves, so the smooth engine needs its mass and all three moments of inertia > 0 "
        "(a point mass: give it a small sphere)");
  return {-1, body.mass, body.inertia, body.inertia.inverse()};
}

}  // namespace

MovingBodies::MovingBodies(const Scene& scene) : bodies_(mechanics::placed_bodies(scene)) {
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const Body& body = scene.bodies[b];
    if (body.fixed) {
      if (!body.velocity.isZero(0.0) || !body.angular_velocity.isZero(0.0))
        throw std::invalid_argument("body \"" + body.name +
                                    "\" is fixed but has a velocity: a fixed body stands still");
      continue;
    }
    bodies_.inertia[b] = inertia_of(body);
    bodies_.inertia[b].slot = bodies_.moving++;
    body_of_slot_.push_back(static_cast<int>(b));
    const BodyState begins = scene.start ? scene.start->bodies[b]
                                         : BodyState{body.position, body.orientation.normalized(),
                                                     body.velocity, body.angular_velocity};
    const Eigen::Quaterniond& q = begins.orientation;
    const Vector3d w = q.toRotationMatrix().transpose() * begins.angular_velocity;
    for (int k = 0; k < 3; ++k) start_.push_back(begins.position[k]);
    start_.insert(start_.end(), {q.w(), q.x(), q.y(), q.z()});
    for (int k = 0; k < 3; ++k) start_.push_back(begins.velocity[k]);
    for (int k = 0; k < 3; ++k) start_.push_back(w[k]);
  }
  if (bodies_.moving == 0) throw std::invalid_argument("the scene has no body that can move");
  bodies_.turns.resize(at(bodies_.moving));
}

void MovingBodies::set_state(const double* y) {
  for (int k = 0; k < count(); ++k) {
    const int b = body(k);
    Frame<double>& f = bodies_.frames[at(b)];
    const double* s = y + kBody * k;
    f.x = Eigen::Map<const Vector3d>(s + kPosition);
    f.R = rotation(s + kQuaternion);
    f.v = Eigen::Map<const Vector3d>(s + kVelocity);
    bodies_.w[at(b)] = Eigen::Map<const Vector3d>(s + kSpin);
    f.W = f.R * bodies_.w[at(b)];
  }
}

void MovingBodies::read(const double* y, std::vector<BodyState>& out) const {
  for (int k = 0; k < count(); ++k) {
    const double* s = y + kBody * k;
    BodyState& state = out[at(body(k))];
    state.position = Eigen::Map<const Vector3d>(s + kPosition);
    state.orientation = Eigen::Quaterniond(s[3], s[4], s[5], s[6]).normalized();
    state.velocity = Eigen::Map<const Vector3d>(s + kVelocity);
    state.angular_velocity = state.orientation * Vector3d(Eigen::Map<const Vector3d>(s + kSpin));
  }
}

}  // namespace tether::scene::smooth

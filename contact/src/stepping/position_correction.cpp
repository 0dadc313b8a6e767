// Tether: moves of a step that are no velocities. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/position_correction.hpp"

#include "stepping/motion/rotation.hpp"
#include "stepping/step_settings.hpp"
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {

using Eigen::Vector3d;

namespace {

using linalg::at;

// By velocities that are not kept. The angular velocity turns with the body: so its energy stays.
void shift(BodySet& bodies, int body, double dt, const Vector3d& v, const Vector3d& w) {
  bodies.position[at(body)] += dt * v;
  if (w.isZero(0)) return;
  const linalg::Quaternion turn = exponential(dt * w);
  linalg::Quaternion& q = bodies.orientation[at(body)];
  q = (turn * q).normalized();
  Vector3d& spin = bodies.motion[at(body)].angular_velocity;
  spin = turn * spin;
}

}  // namespace

PositionCorrection::PositionCorrection(const SteppingOptions& options)
    : depenetration_(depenetration(options)),
      closing_(closing_options(options), depenetration_),
      solver_(correction_options(options)) {}

void PositionCorrection::set_joints(IslandMaker& joints, const SteppingOptions& options) {
  solver_.set_joints(joints.make_islands(correction_options(options), LawUse::limits));
  closing_.set_joints(joints, closing_options(options));
}

void PositionCorrection::close_gaps(const Impacts& impacts, double dt, const StepContacts& contacts,
                                    const std::vector<int>& moving, BodySet& bodies) {
  closes_ = closing_.find(impacts, bodies, dt, contacts, closing_move_);
  if (!closes_) return;
  for (const int i : moving)
    shift(bodies, i, dt, closing_move_[at(i)].velocity, closing_move_[at(i)].angular_velocity);
}

void PositionCorrection::take_back(double deepest, double negligible, double dt,
                                   const StepContacts& contacts, const std::vector<int>& moving,
                                   BodySet& bodies) {
  if (!(deepest > negligible)) return;
  points_.clear();
  bool corrects = false;
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    if (closes_ && closing_.treats(bodies, contacts.points[k])) continue;
    points_.push_back(contacts.points[k]);
    points_.back().bias = depenetration_.bias(contacts.gaps[k], dt);
    corrects = corrects || contacts.gaps[k] < 0;
  }
  if (!corrects) return;
  at_rest_.resize(bodies.motion.size());
  for (std::size_t i = 0; i < bodies.motion.size(); ++i) {
    at_rest_[i].inverse_mass = bodies.motion[i].inverse_mass;
    at_rest_[i].inverse_inertia = bodies.motion[i].inverse_inertia;
  }
  solver_.solve(at_rest_, points_, solution_);
  for (const int i : moving)
    shift(bodies, i, dt, solution_.velocities[at(i)], solution_.angular_velocities[at(i)]);
}

}  // namespace tether::contact::detail

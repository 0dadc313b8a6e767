// Tether: positions that joints allow. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>
#include <tether/linalg/index.hpp>

#include "problem/refuse.hpp"
#include "step_joints.hpp"
#include "stepping/motion/rotation.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

double StepJoints::size(const BodySet& bodies) const {
  double sum = 0;
  for (const int i : held_)
    sum +=
        bodies.mass[at(i)] * bodies.position[at(i)].squaredNorm() + bodies.inertia[at(i)].trace();
  return std::sqrt(sum);
}

// Sets change_ to the least change of positions, over `dt`, that makes g vanish at time t. Returns
// its length in the metric of the masses.
double StepJoints::least_move(const BodySet& bodies, double t, double dt) {
  equations_->values(bodies, t, g_.data());
  change_.assign(v_.size(), Vector6d::Zero());
  double square = 0;
  left_ = 0;
  for (int m = 0; m < mechanisms_.count(); ++m) {
    Mechanism& mechanism = mechanisms_[m];
    for (std::size_t k = 0; k < mechanism.rows().size(); ++k)
      b_[k] = -g_[at(mechanism.rows()[k])] / dt;
    u_.resize(at(mechanism.entries()));
    mechanism.least(b_.data(), u_.data());
    mechanisms_.add(m, u_.data(), change_);
    square += std::pow(norm(u_) * dt, 2);
    for (std::size_t k = 0; k < mechanism.rows().size(); ++k)
      left_ = std::max(left_, std::abs(mechanism.left(static_cast<int>(k))) * dt);
  }
  return std::sqrt(square);
}

// Whether g is rounding. Where rows lose rank, as in a closed chain whose links lie on one line,
// rounding of g would cause moves without end.
bool StepJoints::is_rounding(const BodySet& bodies) const {
  double largest = 0;
  for (const int i : held_)
    largest = std::max(largest, bodies.position[at(i)].cwiseAbs().maxCoeff());
  for (const double g : g_)
    if (!(std::abs(g) <= 2e-15 * largest)) return false;
  return true;
}

// By change_.
void StepJoints::move_back(BodySet& bodies) const {
  for (const int i : held_) {
    bodies.position[at(i)] += change_[at(i)].head<3>();
    const Vector3d turn = change_[at(i)].tail<3>();
    if (turn.isZero(0)) continue;
    RigidBody& motion = bodies.motion[at(i)];
    linalg::Quaternion& q = bodies.orientation[at(i)];
    turn_with_velocity(turn, q, motion.angular_velocity);
    motion.inverse_inertia = turned(bodies.inverse_inertia[at(i)], q);
  }
}

bool StepJoints::project_positions(BodySet& bodies, double t) {
  const double whole = size(bodies);
  double before = INFINITY;
  for (int k = 0; k < kMoves; ++k) {
    if (k > 0 || factored_.none()) factor(bodies, t);
    const double move = least_move(bodies, t, 1);
    if (!std::isfinite(move)) return false;
    if (move <= kNoMove * whole) break;
    if (k > 3 && move > 0.5 * before) return move + left_ <= kMet * whole || is_rounding(bodies);
    before = move;
    move_back(bodies);
  }
  return left_ <= kMet * whole;
}

void StepJoints::begin(BodySet& bodies, double t) {
  put_onto(bodies, t);
  if (!has_laws()) return;
  take_velocities(bodies);
  laws_.remember(v_);
}

void StepJoints::put_onto(BodySet& bodies, double t) {
  if (factored_.is(bodies, t)) return;
  factor(bodies, t);
  // The result of a step stays the same to the last bit, also in a continued run.
  if (!(least_move(bodies, t, 1) + left_ <= kMet * size(bodies))) {
    if (!project_positions(bodies, t)) refuse(bodies, t);
    factor(bodies, t);
  }
  take_velocities(bodies);
  if (mechanisms_.error(rows_, v_) <= kMet) return;
  mechanisms_.satisfy(rows_, v_);
  if (!mechanisms_.contradicting().empty()) refuse_rates();
  give_velocities(bodies);
}

// The rows that least squares leave the most of.
void StepJoints::refuse(const BodySet& bodies, double t) {
  equations_->values(bodies, t, g_.data());
  double most = 0;
  for (const double g : g_) most = std::max(most, std::abs(g));
  std::set<std::string> names;
  for (int row = 0; row < rows_.count(); ++row)
    if (!(std::abs(g_[at(row)]) < 0.1 * most)) names.insert(equations_->name(rows_.joint(row)));
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  throw std::invalid_argument("joints contradict each other at t = " + shown(t) +
                              " s: no positions near these satisfy " + text + " (off by up to " +
                              shown(most) + " m or rad)");
}

void StepJoints::refuse_rates() {
  std::string text;
  for (const int joint : mechanisms_.contradicting())
    text += (text.empty() ? "" : ", ") + equations_->name(joint);
  throw std::invalid_argument("joints contradict each other: no velocities satisfy " + text);
}

}  // namespace tether::contact::detail

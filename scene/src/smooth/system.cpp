// Tether: unknowns and state of a smooth scene. SPDX-License-Identifier: BSD-3-Clause
#include "system.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "quaternions.hpp"

namespace tether::scene::smooth {

namespace {

constexpr double kTurn = 6.283185307179586;

// Index 0: of the diagonal of G M^-1 G^T.
constexpr double kEpsilon = 1e-11;

std::size_t at(int index) { return static_cast<std::size_t>(index); }

Now evaluate(const Motion& motion, double t) {
  const double speed = kTurn * motion.frequency, angle = speed * t + motion.phase;
  Now now;
  now.s = motion.rate * t + motion.amplitude * (std::sin(angle) - std::sin(motion.phase));
  now.s1 = motion.rate + motion.amplitude * speed * std::cos(angle);
  now.s2 = -motion.amplitude * speed * speed * std::sin(angle);
  return now;
}

}  // namespace

System::System(const Scene& scene, const Units& units)
    : form_(scene.smooth.value_or(SmoothOptions{}).formulation), units_(units) {
  const std::size_t count = scene.bodies.size();
  bodies_.inertia.resize(count + 1);
  bodies_.frames.resize(count + 1);
  bodies_.w.assign(count + 1, Vector3d::Zero());
  for (std::size_t b = 0; b <= count; ++b) {
    Frame<double>& f = bodies_.frames[b];
    f.x = f.v = f.W = f.a = f.alpha = Vector3d::Zero();
    f.R = Matrix3d::Identity();
    if (b == count) continue;  // the world
    const Body& body = scene.bodies[b];
    f.x = body.position;
    f.R = body.orientation.normalized().toRotationMatrix();
    if (body.fixed) {
      if (!body.velocity.isZero(0.0) || !body.angular_velocity.isZero(0.0))
        throw std::invalid_argument("body \"" + body.name +
                                    "\" is fixed but has a velocity: a fixed body stands still");
      continue;
    }
    Inertia& inertia = bodies_.inertia[b];
    const Eigen::SelfAdjointEigenSolver<Matrix3d> moments(body.inertia, Eigen::EigenvaluesOnly);
    if (!(body.mass > 0) || !(moments.eigenvalues()[0] > 0))
      throw std::invalid_argument(
          "body \"" + body.name +
          "\" moves, so the smooth engine needs its mass and all three moments of inertia > 0 "
          "(a point mass: give it a small sphere)");
    inertia.slot = bodies_.moving++;
    inertia.mass = body.mass;
    inertia.inertia = body.inertia;
    inertia.inverse = body.inertia.inverse();
    body_of_slot_.push_back(static_cast<int>(b));
    const Eigen::Quaterniond q = body.orientation.normalized();
    const Vector3d w = f.R.transpose() * body.angular_velocity;
    for (int k = 0; k < 3; ++k) start_.push_back(body.position[k]);
    start_.insert(start_.end(), {q.w(), q.x(), q.y(), q.z()});
    for (int k = 0; k < 3; ++k) start_.push_back(body.velocity[k]);
    for (int k = 0; k < 3; ++k) start_.push_back(w[k]);
  }
  if (bodies_.moving == 0) throw std::invalid_argument("the scene has no body that can move");
  bodies_.turns.resize(at(bodies_.moving));

  add_joints(scene);
  count_independent_rows();
  effects_ = make_effects(scene, bodies_);
  add_invariants(scene);
  size_ = first_multiplier();
  if (form_ == Formulation::index1) size_ += m_;
  if (form_ == Formulation::stabilised_index2) size_ += 2 * m_;

  const int n = 6 * moving();
  loads_.resize(at(moving()));
  pulls_.resize(at(moving()));
  update(0.0, start_.data());
  form_gradient();
  lambda_.setZero(m_);
  gamma_.setZero(m_);
  right_.setZero(m_);
  scratch_.setZero(m_);
  a_.setZero(n);
  free_.setZero(n);
  factor_ = Eigen::LLT<Eigen::MatrixXd>(m_);
  size_of_row_ = S_.diagonal();
  epsilon_ = kEpsilon * size_of_row_;
  if (form_ == Formulation::index0) left_.setZero(n + m_, kBody * moving());
}

double System::absolute_tolerance(int i, double tolerance) const {
  // Multipliers follow the state; where rows depend on each other they are known to round-off / eps
  // only, and at a dead point they have a pole. Newton's test is left to the state.
  return i < first_multiplier() ? tolerance : 1e10 * tolerance;
}

Eigen::VectorXd System::start_state() const {
  Eigen::VectorXd y = Eigen::VectorXd::Zero(size_);
  std::copy(start_.begin(), start_.end(), y.data());
  return y;
}

void System::update(double t, const double* y) {
  for (std::size_t i = 0; i < motions_.size(); ++i) now_[i] = evaluate(motions_[i], t);
  for (int k = 0; k < moving(); ++k) {
    const int b = body_of_slot_[at(k)];
    Frame<double>& f = bodies_.frames[at(b)];
    const double* s = y + kBody * k;
    f.x = Eigen::Map<const Vector3d>(s + kPosition);
    f.R = rotation(s + kQuaternion);
    f.v = Eigen::Map<const Vector3d>(s + kVelocity);
    bodies_.w[at(b)] = Eigen::Map<const Vector3d>(s + kSpin);
    f.W = f.R * bodies_.w[at(b)];
  }
}

void System::update_accelerations(const double* yp) {
  for (int k = 0; k < moving(); ++k) {
    Frame<double>& f = bodies_.frames[at(body_of_slot_[at(k)])];
    f.a = Eigen::Map<const Vector3d>(yp + kBody * k + kVelocity);
    f.alpha = f.R * Eigen::Map<const Vector3d>(yp + kBody * k + kSpin);
  }
}

void System::bodies(const double* y, std::vector<BodyState>& out) const {
  for (int k = 0; k < moving(); ++k) {
    const double* s = y + kBody * k;
    BodyState& body = out[at(body_of_slot_[at(k)])];
    body.position = Eigen::Map<const Vector3d>(s + kPosition);
    body.orientation = Eigen::Quaterniond(s[3], s[4], s[5], s[6]).normalized();
    body.velocity = Eigen::Map<const Vector3d>(s + kVelocity);
    body.angular_velocity = body.orientation * Vector3d(Eigen::Map<const Vector3d>(s + kSpin));
  }
}

std::vector<std::string> System::effect_names() const {
  std::vector<std::string> names;
  for (const auto& effect : effects_) names.emplace_back(effect->name());
  names.emplace_back("joints");
  names.emplace_back("equations of motion");
  return names;
}

}  // namespace tether::scene::smooth

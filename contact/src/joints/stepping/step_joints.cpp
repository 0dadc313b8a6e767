// Tether: joints in a step. SPDX-License-Identifier: BSD-3-Clause
#include "step_joints.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>
#include <tether/linalg/index.hpp>

#include "joints/cone_islands.hpp"
#include "problem/refuse.hpp"
#include "stepping/motion/rotation.hpp"
#include "stepping/stepper.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;

using linalg::at;

StepJoints::StepJoints(std::unique_ptr<JointEquations> equations, const BodySet& bodies,
                       Gyroscopic gyroscopic, ConeSources& sources)
    : equations_(std::move(equations)),
      gyroscopic_(gyroscopic),
      sources_(sources),
      mechanisms_(sources.mechanisms),
      laws_(sources.laws.emplace()),
      v_(bodies.motion.size(), Vector6d::Zero()),
      g_(at(equations_->rows())),
      b_(g_.size()) {
  impulses.resize(g_.size());
  impulses_at_end.resize(g_.size());
  factor(bodies, 0);
  for (int i = 0; i < bodies.size(); ++i)
    if (holds(i)) held_.push_back(i);
  for (const int i : held_) round_.push_back(is_isotropic(bodies.inertia[at(i)]));
  place_.resize(held_.size());
  for (int m = 0; m < mechanisms_.count(); ++m) {
    const std::vector<int>& list = mechanisms_[m].bodies();
    for (std::size_t k = 1; k < list.size(); ++k) sources_.links.emplace_back(list[k - 1], list[k]);
  }
  std::multiset<std::pair<int, int>> pairs;
  for (int row = 0; row < rows_.count(); ++row) {
    if (rows_.end(row) - rows_.begin(row) != 2) continue;
    pairs.insert(std::minmax(rows_.begin(row)->body, rows_.begin(row)[1].body));
  }
  for (auto p = pairs.begin(); p != pairs.end(); p = pairs.upper_bound(*p))
    // Bodies that fewer rows connect may touch.
    if (pairs.count(*p) >= 3) joined_.push_back(*p);
  factored_.clear();  // begin() factors at the present positions
}

bool StepJoints::are_joined(int first, int second) const {
  return std::binary_search(joined_.begin(), joined_.end(),
                            std::pair<int, int>(std::minmax(first, second)));
}

void StepJoints::list_laws(std::vector<LawState>& out) const {
  for (int k = 0; k < laws_.laws.count(); ++k) out.push_back(laws_.state(k, v_));
}

// Equations of the positions at time t. Factors are of no place while they are made: the caller's
// equations may throw.
void StepJoints::factor(const BodySet& bodies, double t) {
  factored_.clear();
  rows_at(bodies, t, rows_);
  mechanisms_.update(bodies.motion, rows_);
  factored_.set(bodies, t);
}

// All storage is as long as the first rows, and on their bodies.
void StepJoints::rows_at(const BodySet& bodies, double t, JointRows& rows) {
  rows.clear();
  equations_->add_rows(bodies, t, rows);
  const auto refuse_other = [t](const std::string& what) {
    throw std::invalid_argument(what + " (JointEquations::add_rows at t = " + shown(t) +
                                " s): rows and their bodies do not change");
  };
  if (at(rows.count()) != g_.size())
    refuse_other("joints: " + std::to_string(rows.count()) + " rows instead of " +
                 std::to_string(g_.size()));
  const bool first = bodies_of_rows_.empty();
  std::size_t k = 0;
  for (int row = 0; row < rows.count(); ++row) {
    for (const JointRows::Term* term = rows.begin(row); term <= rows.end(row); ++term) {
      const int body = term < rows.end(row) ? term->body : -1;
      if (first)
        bodies_of_rows_.push_back(body);
      else if (k >= bodies_of_rows_.size() || bodies_of_rows_[k++] != body)
        refuse_other(equations_->name(rows.joint(row)) + ": row " + std::to_string(row) +
                     " is on other bodies than at first");
    }
  }
}

void StepJoints::check_laws(const BodySet& bodies) {
  const JointRows& rows = laws_.laws.rows();
  const bool first = laws_in_step_ < 0;
  if (first) laws_in_step_ = rows.count();
  if (rows.count() != laws_in_step_)
    throw std::invalid_argument("joints: " + std::to_string(rows.count()) + " laws instead of " +
                                std::to_string(laws_in_step_) +
                                " (JointEquations::add_laws): always as many");
  for (int law = 0; law < rows.count(); ++law)
    for (const JointRows::Term* term = rows.begin(law); term != rows.end(law); ++term)
      if (term->body >= bodies.size() ||
          (bodies.motion[at(term->body)].moves() && !holds(term->body)))
        throw std::invalid_argument(equations_->name(rows.joint(law)) + ": law " +
                                    std::to_string(law) + " is on body " +
                                    std::to_string(term->body) + ", which no joint holds");
  if (!first) return;
  std::vector<char> has_law(at(mechanisms_.count()), 0);
  for (int law = 0; law < rows.count(); ++law)
    has_law[at(mechanisms_.mechanism_of(laws_.moving(law, mechanisms_)))] = 1;
  for (const int body : held_)
    if (has_law[at(mechanisms_.mechanism_of(body))] != 0) sources_.under_laws.push_back(body);
}

void StepJoints::FactoredAt::set(const BodySet& bodies, double t) {
  position_.assign(bodies.position.begin(), bodies.position.end());
  orientation_.assign(bodies.orientation.begin(), bodies.orientation.end());
  time_ = t;
}

bool StepJoints::FactoredAt::is(const BodySet& bodies, double t) const {
  return !none() && std::abs(t - time_) <= 1e-9 * std::abs(t) && position_ == bodies.position &&
         std::equal(orientation_.begin(), orientation_.end(), bodies.orientation.begin(),
                    [](const linalg::Quaternion& a, const linalg::Quaternion& b) {
                      return a.coeffs() == b.coeffs();
                    });
}

void StepJoints::take_velocities(const BodySet& bodies) {
  for (std::size_t i = 0; i < v_.size(); ++i)
    v_[i] << bodies.motion[i].velocity, bodies.motion[i].angular_velocity;
}

void StepJoints::give_velocities(BodySet& bodies) const {
  for (const int i : held_) {
    bodies.motion[at(i)].velocity = v_[at(i)].head<3>();
    bodies.motion[at(i)].angular_velocity = v_[at(i)].tail<3>();
  }
}

void StepJoints::store(const BodySet& bodies) {
  for (std::size_t k = 0; k < held_.size(); ++k)
    place_[k] = {bodies.position[at(held_[k])], bodies.orientation[at(held_[k])]};
}

void StepJoints::restore(BodySet& bodies) const {
  for (std::size_t k = 0; k < held_.size(); ++k) {
    bodies.position[at(held_[k])] = place_[k].position;
    bodies.orientation[at(held_[k])] = place_[k].orientation;
  }
}

// From the stored places by v_ over dt; angular velocities as they are then.
void StepJoints::advance_bodies(BodySet& bodies, double dt) const {
  for (std::size_t k = 0; k < held_.size(); ++k) {
    const std::size_t i = at(held_[k]);
    bodies.position[i] = place_[k].position + dt * v_[i].head<3>();
    linalg::Quaternion q = place_[k].orientation;
    Vector3d w = v_[i].tail<3>();
    turn_freely(bodies.inertia[i], bodies.inverse_inertia[i],
                !round_[k] && gyroscopic_ == Gyroscopic::momentum, dt, q, w);
    bodies.orientation[i] = q;
    bodies.motion[i].angular_velocity = w;
  }
}

// Impulses along the rows of the start, until the end meets g = 0. Leaves the bodies at the end.
bool StepJoints::meet(BodySet& bodies, double t, double dt) {
  const double whole = size(bodies);
  double before = INFINITY;
  for (int k = 0;; ++k) {
    advance_bodies(bodies, dt);
    const double move = least_move(bodies, t + dt, dt);
    if (move <= kNoMove * whole) return left_ <= kMet * whole;
    if (k == kMoves || !(move <= 0.5 * before))
      return move + left_ <= kMet * whole || is_rounding(bodies);
    before = move;
    for (const int i : held_) v_[at(i)] += change_[at(i)];
  }
}

bool StepJoints::predict(BodySet& bodies, double t, double dt) {
  take_velocities(bodies);
  start_ = v_;
  mechanisms_.satisfy(rows_, v_);
  bend = v_;
  store(bodies);
  const bool reached = meet(bodies, t, dt);
  restore(bodies);
  give_velocities(bodies);
  double sum = 0;
  for (const int i : held_) {
    bend[at(i)] = v_[at(i)] - bend[at(i)];
    const Vector6d dv = v_[at(i)] - start_[at(i)];
    sum += bodies.mass[at(i)] * dv.head<3>().squaredNorm() +
           dv.tail<3>().dot(spin(bodies.inertia[at(i)], bodies.orientation[at(i)], dv.tail<3>()));
  }
  frequency_.follow(std::sqrt(sum) / dt);
  const bool met = reached && frequency_.resolves_change(dt);
  if (!has_laws()) return met;
  laws_.laws.clear();
  equations_->add_laws(bodies, t, laws_.laws);
  check_laws(bodies);
  laws_.prepare(v_, dt, mechanisms_);
  return met;
}

void StepJoints::put_back(BodySet& bodies, double t) {
  if (factored_.is(bodies, t)) return;
  const double whole = size(bodies);
  double before = INFINITY;
  for (int k = 0; k < kMoves; ++k) {
    const double move = least_move(bodies, t, 1);
    if (move <= kNoMove * whole || !(move <= 0.5 * before)) return;
    before = move;
    move_back(bodies);
  }
}

// Changes of the momenta since predict(), other than by contacts.
void StepJoints::find_impulses(const BodySet& bodies, const StepContacts& contacts) {
  for (std::size_t k = 0; k < held_.size(); ++k) {
    const std::size_t i = at(held_[k]);
    const Vector6d dv = v_[i] - start_[i];
    change_[i] << bodies.mass[i] * dv.head<3>(),
        spin(bodies.inertia[i], place_[k].orientation, dv.tail<3>());
  }
  const std::vector<Vector3d>& moments = sources_.moments;
  for (std::size_t c = 0; c < contacts.impulses.size(); ++c) {
    const PointContact& p = contacts.points[c];
    const auto take = [&](int body, const Vector3d& r, double sign) {
      if (body < 0 || !holds(body)) return;
      change_[at(body)].head<3>() -= sign * contacts.impulses[c];
      change_[at(body)].tail<3>() -= sign * r.cross(contacts.impulses[c]);
      if (!moments.empty()) change_[at(body)].tail<3>() -= sign * moments[c];
    };
    take(p.first, p.r1, 1);
    take(p.second, p.r2, -1);
  }
  const JointRows& laws = laws_.laws.rows();
  for (int k = 0; k < laws.count(); ++k)
    for (const JointRows::Term* t = laws.begin(k); t != laws.end(k); ++t)
      change_[at(t->body)] -= laws_.impulses[at(k)] * t->G;
  for (int m = 0; m < mechanisms_.count(); ++m) {
    std::vector<double>& u = mechanisms_.pull(m);
    const std::vector<int>& list = mechanisms_[m].bodies();
    for (std::size_t k = 0; k < list.size(); ++k)
      Eigen::Map<Eigen::Matrix<double, 6, 1>>(u.data() + 6 * k) =
          mechanisms_.root(list[k]).transpose() * change_[at(list[k])];
  }
  mechanisms_.impulses(impulses.data());
}

// Laws take no part in impacts.
void StepJoints::take_impact(const std::vector<RigidBody>& before, const BodySet& bodies,
                             const StepContacts& contacts) {
  take_velocities(bodies);
  store(bodies);
  for (const int i : held_) start_[at(i)] << before[at(i)].velocity, before[at(i)].angular_velocity;
  std::fill(laws_.impulses.begin(), laws_.impulses.end(), 0.0);
  find_impulses(bodies, contacts);
}

bool StepJoints::move(BodySet& bodies, double t, double dt, const StepContacts& contacts) {
  take_velocities(bodies);
  store(bodies);
  bool met = meet(bodies, t, dt);
  find_impulses(bodies, contacts);
  const double acceleration = mechanisms_.pull_norm() / dt;
  for (std::size_t k = 0; k < held_.size(); ++k) {
    const std::size_t i = at(held_[k]);
    bodies.motion[i].velocity = v_[i].head<3>();
    if (!round_[k])
      bodies.motion[i].inverse_inertia = turned(bodies.inverse_inertia[i], bodies.orientation[i]);
  }
  if (!met) met = project_positions(bodies, t + dt);
  factor(bodies, t + dt);
  take_velocities(bodies);
  mechanisms_.clear_pulls();
  mechanisms_.satisfy(rows_, v_);
  met = met && mechanisms_.contradicting().empty();
  give_velocities(bodies);
  mechanisms_.impulses(impulses_at_end.data());
  for (std::size_t row = 0; row < impulses.size(); ++row) impulses[row] += impulses_at_end[row];
  equations_->values(bodies, t + dt, g_.data());
  drift = 0;
  for (const double g : g_)
    if (!(std::abs(g) <= drift)) drift = std::isnan(drift) ? drift : std::abs(g);
  const auto rows = [this](const BodySet& at, double time, JointRows& out) {
    rows_at(at, time, out);
  };
  frequency_.update(rows, rows_, impulses, acceleration, t + dt, dt, mechanisms_, bodies);
  return met && std::isfinite(drift);
}

}  // namespace tether::contact::detail

namespace tether::contact {

void Stepper::add_joints(std::unique_ptr<JointEquations> joints) {
  detail::SubStepper& s = implementation_->steps;
  if (s.joints || s.forces > 0)
    throw std::invalid_argument("Stepper::add_joints: once, and before add_force");
  if (!joints || joints->rows() == 0) return;
  if (joints->has_laws() && s.options.law != Law::coulomb)
    throw std::invalid_argument(
        std::string(
            "Stepper::add_joints: limits, motors and friction of joints need law = coulomb, "
            "not ") +
        name(s.options.law));
  if (joints->has_laws() && s.options.restitution_law != RestitutionLaw::newton)
    throw std::invalid_argument(
        "Stepper::add_joints: limits, motors and friction of joints need restitution_law = newton");
  try {
    s.add_joints(std::make_unique<detail::StepJoints>(std::move(joints), s.bodies,
                                                      s.options.gyroscopic, s.cones));
  } catch (...) {  // the stepper goes on without them
    s.cones.laws.reset();
    s.cones.links.clear();
    s.cones.mechanisms = {};
    throw;
  }
}

}  // namespace tether::contact

// Tether: the stages of a step. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "stepping/stepper_parts.hpp"

namespace tether::contact {

using Eigen::Vector3d;

void Stepper::Implementation::make_stages() {
  using I = Implementation;
  for (int i = 0; i < bodies.size(); ++i) {
    if (bodies.mass[at(i)] == 0) continue;
    moving.push_back(i);
    const bool round = detail::is_isotropic(bodies.inertia[at(i)]);
    if (!round) long_bodies.push_back(i);
    if (joints && joints->holds(i)) continue;
    free.push_back(i);
    (round ? free_round : free_long).push_back(i);
  }
  if (joints) add_stage("joints", &I::begin_joints);
  const char* impact = restitution ? "restitution" : "collision";
  if (solver) add_stage(impact, &I::remember_velocities);
  if (options.gravity) add_stage("gravity", &I::apply_gravity);
  after_forces = stages.size();
  if (!long_bodies.empty()) {
    if (options.gyroscopic == Gyroscopic::explicit_step)
      add_stage("gyroscopic term", &I::gyrate_explicit);
    if (options.gyroscopic == Gyroscopic::implicit_step)
      add_stage("gyroscopic term", &I::gyrate_implicit);
  }
  if (joints) add_stage("joints", &I::predict_joints);
  if (near) {
    add_stage("collision", &I::find_contacts);
    add_stage(impact, &I::choose_impacts);
    if (restitution) add_stage("restitution", &I::choose_bounces);
    add_stage("contact", &I::solve_contacts);
    if (restitution) add_stage("restitution", &I::rebound);
    add_stage(impact, &I::take_later_impacts);
    add_stage("collision", &I::meet_others);
    if (closing) add_stage("penetration", &I::close_gaps);
    if (correction) add_stage("penetration", &I::correct_penetration);
    if (joints) add_stage("joints", &I::put_back_joints);
  } else if (solver) {
    add_stage("joints", &I::solve_contacts);
  }
  add_stage("motion", &I::move);
  if (!free_round.empty()) add_stage("motion", &I::turn_round);
  if (!free_long.empty()) {
    if (options.gyroscopic == Gyroscopic::momentum) free_spin.resize(free_long.size());
    if (options.gyroscopic == Gyroscopic::momentum)
      add_stage("gyroscopic term", &I::turn_keeping_momentum);
    else
      add_stage("motion", &I::turn_plain);
  }
  if (joints) add_stage("joints", &I::move_joints);
}

void Stepper::Implementation::apply_gravity() {
  const Vector3d dv = dt * *options.gravity;
  for (const int i : moving) bodies.motion[at(i)].velocity += dv;
}

void Stepper::Implementation::gyrate_explicit() {
  for (const int i : long_bodies) {
    Vector3d& w = bodies.motion[at(i)].angular_velocity;
    w += detail::gyroscopic_explicit(bodies.inertia[at(i)], bodies.inverse_inertia[at(i)],
                                     bodies.orientation[at(i)], w, dt);
  }
}

void Stepper::Implementation::gyrate_implicit() {
  for (const int i : long_bodies) {
    Vector3d& w = bodies.motion[at(i)].angular_velocity;
    w += detail::gyroscopic_implicit(bodies.inertia[at(i)], bodies.orientation[at(i)], w, dt);
  }
}

void Stepper::Implementation::find_contacts() {
  near->find(bodies, dt, contacts);
  if (joints) leave_out_joined();
  set_gaps();
  free_motion = bodies.motion;
  before_problem = judged();
}

void Stepper::Implementation::set_gaps() {
  for (std::size_t k = 0; k < contacts.gaps.size(); ++k) {
    const double gap = contacts.gaps[k];
    deepest = std::max(deepest, -gap);
    contacts.points[k].bias = gap > 0 ? gap / dt : 0;
  }
}

// Bodies that impacts have sent where their velocities before did not take them: with what they
// would go into, the problem is solved again. What is left after three times the next step sees.
void Stepper::Implementation::meet_others() {
  for (int again = 0; again < 3 && !failed; ++again) {
    const std::size_t before = contacts.points.size();
    if (!near->find_more(bodies, dt, contacts)) return;
    if (joints) leave_out_joined();
    if (contacts.points.size() == before) return;
    bodies.motion = free_motion;
    solver->take_back();
    set_judged(before_problem);
    set_gaps();
    choose_impacts();
    if (restitution) choose_bounces();
    solve_contacts();
    if (failed && may_halve) return;
    if (restitution) rebound();
    take_later_impacts();
  }
}

void Stepper::Implementation::choose_impacts() { impacts->choose(*near, bodies, dt, contacts); }

void Stepper::Implementation::solve_problem() {
  solver->solve(bodies.motion, contacts.points, solution);
  ++counts.contact_problems;
  counts.sweeps += solution.sweeps;
  counts.assembled_islands += solution.assembled_islands;
}

void Stepper::Implementation::solve_contacts() {
  contacts.impulses.resize(contacts.points.size());  // assign() would grow without reserve
  std::fill(contacts.impulses.begin(), contacts.impulses.end(), Vector3d::Zero());
  failed = false;
  if (contacts.points.empty() && !has_laws()) {
    solver->forget();
    return;
  }
  solve_problem();
  if (shortest() && solution.status != Status::solved &&
      !(solution.error <= std::max(accepted_residual(options), detail::kGood))) {
    solver->set_options(detail::patient_options(options));
    solve_problem();
    solver->set_options(detail::contact_options(options));
  }
  judge();
  if (failed && may_halve) return;
  for (const int i : moving) {
    bodies.motion[at(i)].velocity = solution.velocities[at(i)];
    bodies.motion[at(i)].angular_velocity = solution.angular_velocities[at(i)];
  }
  std::copy(solution.impulses.begin(), solution.impulses.end(), contacts.impulses.begin());
}

void Stepper::Implementation::take_later_impacts() {
  if (impacts->list().empty() || has_laws()) return;
  const detail::LaterImpacts::Counts taken = later->take(*near, *impacts, dt, bodies, contacts);
  counts.contact_problems += taken.problems;
  counts.sweeps += taken.sweeps;
  counts.bounces += taken.bounces;
}

void Stepper::Implementation::close_gaps() {
  closes = closing->find(*impacts, bodies, dt, contacts, closing_move);
  if (!closes) return;
  for (const int i : moving)
    shift(i, closing_move[at(i)].velocity, closing_move[at(i)].angular_velocity);
}

// The least move (in the metric of the masses) that takes penetrations back; contacts that are open
// may close by as much as they are open. Its velocity is not kept. Islands whose gaps have just
// been closed are left out: that has taken theirs back.
void Stepper::Implementation::correct_penetration() {
  corrects = false;
  if (!(deepest > detail::negligible_depth(options, dt))) return;
  const detail::Depenetration take_back = detail::depenetration(options);
  deep_points.clear();
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    if (closes && closing->treats(bodies, contacts.points[k])) continue;
    deep_points.push_back(contacts.points[k]);
    deep_points.back().bias = take_back.bias(contacts.gaps[k], dt);
    corrects = corrects || contacts.gaps[k] < 0;
  }
  if (!corrects) return;
  at_rest.resize(bodies.motion.size());
  for (std::size_t i = 0; i < bodies.motion.size(); ++i) {
    at_rest[i].inverse_mass = bodies.motion[i].inverse_mass;
    at_rest[i].inverse_inertia = bodies.motion[i].inverse_inertia;
  }
  correction->solve(at_rest, deep_points, correction_solution);
  for (const int i : moving)
    shift(i, correction_solution.velocities[at(i)], correction_solution.angular_velocities[at(i)]);
}

// By velocities that are not kept. The angular velocity turns with the body: so its energy stays.
void Stepper::Implementation::shift(int body, const Vector3d& v, const Vector3d& w) {
  bodies.position[at(body)] += dt * v;
  if (w.isZero(0)) return;
  const linalg::Quaternion turn = detail::exponential(dt * w);
  linalg::Quaternion& q = bodies.orientation[at(body)];
  q = (turn * q).normalized();
  Vector3d& spin = bodies.motion[at(body)].angular_velocity;
  spin = turn * spin;
}

// Contacts of bodies that a joint connects.
void Stepper::Implementation::leave_out_joined() {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    const PointContact& c = contacts.points[k];
    if (joints->are_joined(c.first, c.second)) continue;
    contacts.points[kept] = c;
    contacts.gaps[kept++] = contacts.gaps[k];
  }
  contacts.points.resize(kept);
  contacts.gaps.resize(kept);
}

void Stepper::Implementation::move_joints() {
  if (joints->move(bodies, part_start, dt, contacts)) return;
  succeeded = false;
  if (status == Status::solved) status = Status::stalled;
}

void Stepper::Implementation::move() {
  for (const int i : free) bodies.position[at(i)] += dt * bodies.motion[at(i)].velocity;
}

// To world axes, after orientations were set from outside.
void Stepper::Implementation::turn_inertias() {
  for (const int i : long_bodies)
    bodies.motion[at(i)].inverse_inertia =
        detail::turned(bodies.inverse_inertia[at(i)], bodies.orientation[at(i)]);
}

void Stepper::Implementation::turn_round() {
  for (const int i : free_round) {
    const Vector3d& w = bodies.motion[at(i)].angular_velocity;
    if (w.isZero(0)) continue;
    linalg::Quaternion& q = bodies.orientation[at(i)];
    q = (detail::exponential(dt * w) * q).normalized();
  }
}

void Stepper::Implementation::turn_plain() {
  for (const int i : free_long) {
    RigidBody& b = bodies.motion[at(i)];
    linalg::Quaternion& q = bodies.orientation[at(i)];
    q = (detail::exponential(dt * b.angular_velocity) * q).normalized();
    b.inverse_inertia = detail::turned(bodies.inverse_inertia[at(i)], q);
  }
}

void Stepper::Implementation::turn_keeping_momentum() {
  for (std::size_t k = 0; k < free_long.size(); ++k) {
    const int i = free_long[k];
    RigidBody& b = bodies.motion[at(i)];
    linalg::Quaternion& q = bodies.orientation[at(i)];
    detail::turn_with_momentum(bodies.inertia[at(i)], bodies.inverse_inertia[at(i)], dt, q,
                               b.angular_velocity, free_spin[k]);
    b.inverse_inertia = detail::turned(bodies.inverse_inertia[at(i)], q);
  }
}

}  // namespace tether::contact

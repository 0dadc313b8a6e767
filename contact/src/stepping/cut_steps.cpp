// Tether: steps that are cut at impacts. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/stepper_parts.hpp"

namespace tether::contact {

// Laws of joints and rolling friction, whose moments go with the contacts of one problem, stay in
// whole steps; parts that keep an accuracy are cut where that asks for it.
bool Stepper::Implementation::may_cut() const {
  return part.cuts_left > 0 && !impacts->list().empty() && !has_laws() && !rolling;
}

void Stepper::Implementation::look_for_cut() {
  if (!may_cut()) return;
  falling.clear();
  for (const detail::Impact& i : impacts->list()) {
    const PointContact& c = contacts.points[at(i.contact)];
    const double apart = options.gravity ? c.normal.dot(*options.gravity) : 0;
    falling.push_back((motion.falls(bodies, c.second) ? apart : 0) -
                      (motion.falls(bodies, c.first) ? apart : 0));
  }
  part.cut = cuts->choose(*impacts, part.dt, contacts, falling);
}

// No contact closes by the velocities that bodies have: there is nothing to solve.
bool Stepper::Implementation::nothing_presses() const {
  for (const PointContact& c : contacts.points)
    if (detail::normal_velocity(bodies.motion, c) + c.bias < 0) return false;
  return true;
}

// Before the impact its contacts are left out, so that nothing of it is taken: how far forces of
// other contacts let them go by then differs from where they touch by the square of the length.
void Stepper::Implementation::leave_out_striking() {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    if (cuts->strikes(contacts.points[k])) continue;
    contacts.points[kept] = contacts.points[k];
    contacts.gaps[kept++] = contacts.gaps[k];
  }
  contacts.points.resize(kept);
  contacts.gaps.resize(kept);
}

// The impact, at the places where bodies are. False: its problem is not solved, and the part that
// follows takes it as one that is not cut does.
bool Stepper::Implementation::strike() {
  near->find(bodies, part.dt, contacts);
  if (joints) leave_out_joined();
  if (sleeping) sleeping->leave_out(contacts);
  contacts.impulses.assign(contacts.points.size(), Eigen::Vector3d::Zero());
  if (!cuts->gather(*near, bodies, options.step, *impacts, contacts)) return true;
  if (restitution) choose_bounces();
  const BodySolution& s = cuts->solve(bodies.motion, contacts);
  ++counts.contact_problems;
  counts.sweeps += s.sweeps;
  counts.assembled_islands += s.assembled_islands;
  if (s.status != Status::solved && !(s.error <= accepted_residual(options))) return false;
  for (const int i : motion.moving()) {
    bodies.motion[at(i)].velocity = s.velocities[at(i)];
    bodies.motion[at(i)].angular_velocity = s.angular_velocities[at(i)];
  }
  contacts.impulses = s.impulses;
  if (restitution) rebound();
  if (joints) joints->take_impact(impacts->coming(), bodies, contacts);
  add_to_sum();
  return true;
}

// Of the part, or impact, that has been taken.
void Stepper::Implementation::add_to_sum() {
  cuts->add(contacts);
  if (joints) joints->add_to_sum();
}

void Stepper::Implementation::advance_cut(double time, double length, int halvings) {
  const double when = cuts->when(), rest = length - when;
  const int cuts_left = part.cuts_left;
  const bool whole = cuts_left == detail::StepCuts::kMost;
  const auto take = [&](double start, double dt, int more) {
    part.cuts_left = more;
    part.of_cut = true;
    solver->scale_warm_start(dt / length);
    advance(start, dt, halvings);
    solver->scale_warm_start(length / dt);
  };
  if (whole) {
    cuts->begin_sum();
    if (joints) joints->begin_sum();
  }
  cuts->remember(solver->warm_start());
  if (when > 0) {
    part.before_impact = true;
    take(time, when, 0);
    part.before_impact = false;
    if (!(rest > 0)) {
      part.of_cut = !whole;
      return;
    }
    add_to_sum();
    cuts->remember(solver->warm_start());
  }
  part.start = time + when;
  part.dt = rest;
  take(time + when, rest, strike() ? cuts_left - 1 : 0);
  if (!whole) return;
  part.of_cut = false;
  cuts->add_sum_to(contacts);
  if (joints) joints->give_sum();
  part.dt = length;
}

}  // namespace tether::contact

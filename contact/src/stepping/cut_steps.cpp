// Tether: steps that are cut at impacts. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "stepping/stepper_parts.hpp"

namespace tether::contact {

// Parts that keep an accuracy are cut where that asks for it.
bool Stepper::Implementation::may_cut() const {
  return part.cuts_left > 0 && (restitution || !impacts->list().empty());
}

// Impacts; and, where anything bounces, contacts that are slow at the start of the part, or that
// bodies leave and fall back to, but that an impact closes in it; or later, though the problem of
// the part would hold them where they are above it.
void Stepper::Implementation::look_for_cut() {
  if (!may_cut() || !cuts->may_cut(contacts.points.size())) return;
  approaches.clear();
  approaches.reserve(contacts.points.capacity());  // no more often than contacts do
  const auto fall = [&](const PointContact& c) {
    const double apart = options.gravity ? part.now.length * c.normal.dot(*options.gravity) : 0;
    return (motion.falls(c.second) ? apart : 0) - (motion.falls(c.first) ? apart : 0);
  };
  const std::vector<detail::Impact>& chosen = impacts->list();
  for (const detail::Impact& i : chosen)
    approaches.push_back({i.contact, i.came, i.comes, fall(contacts.points[at(i.contact)])});
  std::size_t next = 0;  // of those chosen, which are in order
  for (std::size_t k = 0; restitution && k < contacts.points.size(); ++k) {
    if (next < chosen.size() && at(chosen[next].contact) == k) {
      ++next;
      continue;
    }
    const PointContact& c = contacts.points[k];
    const double comes = -detail::normal_velocity(bodies.motion, c);
    if (!(comes * part.now.length > contacts.gaps[k])) continue;
    const detail::Approach a{static_cast<int>(k), -detail::normal_velocity(impacts->coming(), c),
                             comes, fall(c)};
    if (a.more(part.now.length) > 0 &&
        impacts->is_impact(*near, c, a.speed(contacts.gaps[k], part.now.length)))
      approaches.push_back(a);
  }
  if (cuts->choose(approaches, part.now.length, *near, bodies, contacts)) part.end = Part::End::cut;
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
  detail::keep_contacts(contacts,
                        [&](std::size_t k) { return !cuts->strikes(contacts.points[k]); });
}

// The impact, at the places where bodies are. Unsolved: the part that follows takes it as one that
// is not cut does.
Stepper::Implementation::Struck Stepper::Implementation::strike() {
  near->find(bodies, part.now.length, contacts);
  if (joints) leave_out_joined();
  if (sleeping) sleeping->leave_out(contacts);
  leave_out_passive();
  contacts.impulses.assign(contacts.points.size(), Eigen::Vector3d::Zero());
  contacts.moments.clear();
  if (!cuts->gather(*near, bodies, options.step, *impacts, contacts)) return Struck::nothing;
  const bool in_turn = options.simultaneous_impacts == SimultaneousImpacts::in_turn;
  if (in_turn) before_turns = bodies.motion;
  if (!(in_turn ? take_impacts_in_turn() : take_impact())) return Struck::unsolved;
  if (joints && part.joints_active)
    joints->take_impact(in_turn ? before_turns : impacts->coming(), bodies, contacts);
  return Struck::impact;
}

// Solves the impact of the contacts, which touch. False: it is not solved, and nothing has changed.
bool Stepper::Implementation::take_impact() {
  if (bounces_at_once) bounces_at_once->choose(*impacts, *impacts, {}, bodies, contacts);
  const BodySolution& s = cuts->solve(bodies.motion, contacts);
  ++counts.contact_problems;
  counts.sweeps += s.sweeps;
  counts.assembled_islands += s.assembled_islands;
  if (s.status != Status::solved && !(s.error <= accepted_residual(options))) return false;
  detail::take_velocities(s, bodies);
  contacts.impulses = s.impulses;
  if (bounces_at_once) counts.bounces += bounces_at_once->apply(bodies, contacts);
  return true;
}

// Contacts that approach strike alone; those that this makes approach are next. What is left after
// very many turns, as where bodies rattle between two others, strikes together.
bool Stepper::Implementation::take_impacts_in_turn() {
  constexpr int kMostTurns = 2000;
  const StepContacts touching = contacts;
  StepContacts sum;
  for (int turn = 0; turn <= kMostTurns; ++turn) {
    contacts = touching;
    impacts->remember(bodies);
    impacts->choose(*near, bodies, options.step, contacts);
    if (impacts->list().empty()) break;
    if (turn < kMostTurns) impacts->keep_only_impacts(contacts);
    if (!take_impact()) {
      if (turn == 0) return false;
      break;
    }
    detail::add_impulses(contacts, sum);
  }
  contacts = sum;
  return true;
}

// Advances by sub-step s of a part of this length.
void Stepper::Implementation::take_of_cut(detail::SubStep s, double length) {
  part.of_cut = true;
  solver->scale_warm_start(s.length / length);
  advance(s);
  solver->scale_warm_start(length / s.length);
}

// The part up to the impact; once more where bodies that turn were off the surface by then. Returns
// its length.
double Stepper::Implementation::approach(detail::SubStep s) {
  const WarmStart start = solver->warm_start();
  const detail::Judgement before = judged();
  remember_part(parts.before);
  part.before_impact = true;
  part.cuts_left = 0;
  double when = cuts->when();
  take_of_cut(s.over(s.start, when), s.length);
  const double then = std::min(when + cuts->left(*near, bodies, s.length), s.length);
  if (then > 0 && then != when) {
    restore_part(parts.before);
    set_judged(before);
    solver->set_warm_start(start);
    when = then;
    take_of_cut(s.over(s.start, when), s.length);
  }
  part.before_impact = false;
  return when;
}

// Up to the impact, the impact, and the rest; `contacts` has the impulses of all.
void Stepper::Implementation::take_striking(detail::SubStep s) {
  const int cuts_left = part.cuts_left;
  StepContacts sum;
  const auto add_to_sum = [&] {
    detail::add_impulses(contacts, sum);
    if (joints && part.joints_active) joints->add_to_sum();
  };
  cuts->remember(solver->warm_start());
  double rest = s.length;
  if (cuts->when() > 0) {
    rest -= approach(s);
    if (!(rest > 0)) return;
    add_to_sum();
    cuts->remember(solver->warm_start());
  }
  part.now = s.over(s.start + (s.length - rest), rest);
  const Struck struck = strike();
  if (struck == Struck::impact) add_to_sum();
  part.cuts_left = struck == Struck::unsolved ? 0 : cuts_left - 1;
  take_of_cut(part.now, s.length);
  detail::add_impulses(sum, contacts);
}

}  // namespace tether::contact

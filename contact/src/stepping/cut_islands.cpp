// Tether: steps of which islands are cut apart from each other. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <utility>

#include "stepping/stepper_parts.hpp"

namespace tether::contact {

namespace {

// A solver that had nothing to solve in between still has what it had before.
void add_missing(const WarmStart& from, WarmStart& to) {
  std::vector<std::uint64_t> known = to.ids;
  std::sort(known.begin(), known.end());
  for (std::size_t k = 0; k < from.ids.size(); ++k) {
    if (std::binary_search(known.begin(), known.end(), from.ids[k])) continue;
    to.ids.push_back(from.ids[k]);
    to.impulses.push_back(from.impulses[k]);
  }
}

void append(const StepContacts& from, StepContacts& to) {
  to.points.insert(to.points.end(), from.points.begin(), from.points.end());
  to.gaps.insert(to.gaps.end(), from.gaps.begin(), from.gaps.end());
  to.impulses.insert(to.impulses.end(), from.impulses.begin(), from.impulses.end());
  if (from.moments.empty() && to.moments.empty()) return;
  to.moments.resize(to.points.size() - from.points.size(), Eigen::Vector3d::Zero());
  to.moments.insert(to.moments.end(), from.moments.begin(), from.moments.end());
  to.moments.resize(to.points.size(), Eigen::Vector3d::Zero());
}

}  // namespace

detail::PartMark Stepper::Implementation::mark() const {
  detail::PartMark m;
  remember_part(m.bodies);
  m.contacts = solver->warm_start();
  if (positions) m.corrections = positions->warm_start();
  return m;
}

void Stepper::Implementation::go_back(const detail::PartMark& m) {
  restore_part(m.bodies);
  solver->set_warm_start(m.contacts);
  if (positions) positions->set_warm_start(m.corrections);
}

void Stepper::Implementation::set_active(std::vector<char> active) {
  part.active = std::move(active);
  part.joints_active = !joints || part.active.empty();
  for (const int i : motion.moving())
    part.joints_active = part.joints_active || (joints->holds(i) && takes_part(i));
  if (joints) joints->set_active(part.joints_active);
}

// Contacts of bodies that do not take part. Islands were apart when they were chosen: bodies that
// an impact has sent to others must take their step with them.
void Stepper::Implementation::leave_out_passive() {
  if (part.active.empty()) return;
  const auto waits = [&](int i) { return bodies.mass[at(i)] > 0 && !takes_part(i); };
  const auto moves = [&](int i) { return bodies.mass[at(i)] > 0 && takes_part(i); };
  detail::keep_contacts(contacts, [&](std::size_t k) {
    const PointContact& c = contacts.points[k];
    if (!waits(c.first) && !waits(c.second)) return true;
    part.met = part.met || moves(c.first) || moves(c.second);
    return false;
  });
}

// The same length of those that nothing has struck, whole; islands that strike later are cut there.
void Stepper::Implementation::take_others(const detail::PartMark& start,
                                          const std::vector<char>& striking, detail::SubStep s) {
  const detail::PartMark end = mark();
  const StepContacts struck = std::move(contacts);
  contacts = {};
  go_back(start);
  advance(s);
  for (const int i : motion.moving()) {
    if (striking[at(i)] == 0) continue;
    bodies.position[at(i)] = end.bodies.position[at(i)];
    bodies.orientation[at(i)] = end.bodies.orientation[at(i)];
    bodies.motion[at(i)] = end.bodies.motion[at(i)];
  }
  for (std::size_t k = 0; k < end.bodies.spin.size(); ++k)
    if (striking[at(motion.free_long()[k])] != 0) motion.spins()[k] = end.bodies.spin[k];
  append(struck, contacts);
  WarmStart both = solver->warm_start();
  add_missing(end.contacts, both);
  solver->set_warm_start(both);
  if (!positions) return;
  both = positions->warm_start();
  add_missing(end.corrections, both);
  positions->set_warm_start(both);
}

// Bodies that the islands that strike do not touch move as in a step without cuts.
void Stepper::Implementation::take_cut(detail::SubStep s) {
  std::vector<char> striking;
  if (!part.may_split || !cuts->find_striking(bodies, contacts, motion.moving(), motion.falling(),
                                              part.active, striking))
    return take_striking(s);
  const detail::PartMark start = mark();
  const std::vector<char> active = part.active;
  const int cuts_left = part.cuts_left;
  const bool of_cut = part.of_cut;
  set_active(striking);
  take_striking(s);
  if (part.met) return;
  std::vector<char> others(striking.size(), 0);
  for (const int i : motion.moving())
    others[at(i)] = striking[at(i)] == 0 && (active.empty() || active[at(i)] != 0);
  set_active(std::move(others));
  part.cuts_left = cuts_left;
  part.of_cut = of_cut;
  take_others(start, striking, s);
  set_active(active);
}

void Stepper::Implementation::advance_cut(detail::SubStep s) {
  if (part.in_cut) return take_cut(s);
  const int cuts_left = part.cuts_left;
  const detail::PartMark start = mark();
  const detail::Judgement before = judged();
  const auto begin = [&](bool may_split) {
    part.in_cut = true;
    part.may_split = may_split;
    part.met = false;
    if (joints) joints->begin_sum();
  };
  begin(!sleeping);
  take_cut(s);
  if (part.met) {  // what that has cost of what cuts may cost is spent
    go_back(start);
    set_judged(before);
    set_active({});
    part.cuts_left = cuts_left;
    part.of_cut = false;
    begin(false);
    advance(s);
  }
  part.in_cut = part.of_cut = false;
  if (joints) joints->give_sum();
  part.now = s;
}

}  // namespace tether::contact

// Tether: sub-steps that are cut at impacts. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/step_halving.hpp"

#include <algorithm>
#include <utility>

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

// Adds the impulses of `from` for contacts that `to` does not have: a solver that had nothing to
// solve in between keeps its warm start.
template <class Solver>
void add_missing(const WarmStart& from, Solver& to) {
  WarmStart both = to.warm_start();
  std::vector<std::uint64_t> known = both.ids;
  std::sort(known.begin(), known.end());
  for (std::size_t k = 0; k < from.ids.size(); ++k) {
    if (std::binary_search(known.begin(), known.end(), from.ids[k])) continue;
    both.ids.push_back(from.ids[k]);
    both.impulses.push_back(from.impulses[k]);
  }
  to.set_warm_start(both);
}

void append(const StepContacts& from, StepContacts& to) {
  to.points.insert(to.points.end(), from.points.begin(), from.points.end());
  to.gaps.insert(to.gaps.end(), from.gaps.begin(), from.gaps.end());
  to.impulses.insert(to.impulses.end(), from.impulses.begin(), from.impulses.end());
  if (from.moments.empty() && to.moments.empty()) return;
  to.moments.resize(to.points.size() - from.points.size(), Vector3d::Zero());
  to.moments.insert(to.moments.end(), from.moments.begin(), from.moments.end());
  to.moments.resize(to.points.size(), Vector3d::Zero());
}

}  // namespace

void add_impulses(const StepContacts& part, StepContacts& sum) {
  for (std::size_t k = 0; k < part.impulses.size(); ++k) {
    if (part.impulses[k].isZero(0)) continue;
    std::size_t j = 0;
    while (j < sum.points.size() && sum.points[j].id != part.points[k].id) ++j;
    if (j == sum.points.size()) {
      sum.points.push_back(part.points[k]);
      sum.gaps.push_back(part.gaps[k]);
      sum.impulses.emplace_back(Vector3d::Zero());
    }
    sum.impulses[j] += part.impulses[k];
    if (k >= part.moments.size()) continue;
    sum.moments.resize(sum.points.size(), Vector3d::Zero());
    sum.moments[j] += part.moments[k];
  }
}

// Takes the islands that strike apart from the others. If they meet, the step is repeated with all
// islands together; the cost counts against what cuts may cost.
int StepCutting::take(const SubStep& s) {
  if (s.within != SubStep::Within::step) return take_islands(s);
  const auto begin = [&] {
    stepper_.met = false;
    joint_sum_.clear();
    law_sum_.clear();
  };
  const StepMark start = stepper_.mark();
  const Tally before = stepper_.tally;
  SubStep inside = s;
  inside.within = stepper_.sleeping ? SubStep::Within::cut : SubStep::Within::cut_by_islands;
  begin();
  int left = take_islands(inside);
  if (stepper_.met) {
    stepper_.go_back(start);
    stepper_.tally = before;
    inside.within = SubStep::Within::cut;
    begin();
    left = halving_.advance(inside);
  }
  if (stepper_.joints) {
    add_joint_impulses();
    stepper_.joints->impulses = joint_sum_;
    stepper_.joints->law_impulses() = law_sum_;
  }
  stepper_.set_now(s);
  return left;
}

// Cuts the step of the striking islands only; all other bodies move as in a step without cuts.
int StepCutting::take_islands(const SubStep& s) {
  std::vector<char> striking;
  if (s.within != SubStep::Within::cut_by_islands ||
      !stepper_.cuts->find_striking(stepper_.bodies, stepper_.contacts, stepper_.motion.moving(),
                                    stepper_.motion.falling(), s, striking))
    return take_striking(s);
  const StepMark start = stepper_.mark();
  SubStep some = s;
  some.active = &striking;
  const int left = take_striking(some);
  if (stepper_.met) return left;
  std::vector<char> others(striking.size(), 0);
  for (const int i : stepper_.motion.moving()) others[at(i)] = striking[at(i)] == 0 && s.has(i);
  some.active = &others;
  return take_others(start, striking, some);
}

// Takes the other bodies over the whole length; it is cut again where islands of theirs strike.
int StepCutting::take_others(const StepMark& start, const std::vector<char>& striking,
                             const SubStep& s) {
  BodySet& bodies = stepper_.bodies;
  const StepMark end = stepper_.mark();
  const StepContacts struck = std::exchange(stepper_.contacts, {});
  stepper_.go_back(start);
  const int left = halving_.advance(s);
  for (const int i : stepper_.motion.moving()) {
    if (striking[at(i)] == 0) continue;
    bodies.position[at(i)] = end.bodies.position[at(i)];
    bodies.orientation[at(i)] = end.bodies.orientation[at(i)];
    bodies.motion[at(i)] = end.bodies.motion[at(i)];
  }
  for (std::size_t k = 0; k < end.bodies.spin.size(); ++k)
    if (striking[at(stepper_.motion.free_long()[k])] != 0)
      stepper_.motion.spins()[k] = end.bodies.spin[k];
  append(struck, stepper_.contacts);
  add_missing(end.contacts, *stepper_.solver);
  if (stepper_.positions) add_missing(end.corrections, *stepper_.positions);
  return left;
}

int StepCutting::take_striking(const SubStep& s) {
  StepContacts sum;
  const auto add_to_sum = [&] {
    add_impulses(stepper_.contacts, sum);
    if (stepper_.acting_joints) add_joint_impulses();
  };
  stepper_.cuts->remember(stepper_.solver->warm_start());
  double rest = s.length;
  if (stepper_.cuts->when() > 0) {
    rest -= approach(s);
    if (!(rest > 0)) return 0;
    add_to_sum();
    stepper_.cuts->remember(stepper_.solver->warm_start());
  }
  SubStep after = s.over(s.start + (s.length - rest), rest);
  stepper_.set_now(after);
  const Struck struck = strike();
  if (struck == Struck::impact) add_to_sum();
  after.cuts = struck == Struck::unsolved ? 0 : s.cuts - 1;
  const int left = take_side(after, SubStep::Side::rest, s.length);
  add_impulses(sum, stepper_.contacts);
  return left;
}

void StepCutting::add_joint_impulses() {
  const auto add = [](const std::vector<double>& from, std::vector<double>& to) {
    to.resize(from.size());
    for (std::size_t k = 0; k < from.size(); ++k) to[k] += from[k];
  };
  add(stepper_.joints->impulses, joint_sum_);
  add(stepper_.joints->law_impulses(), law_sum_);
}

// Takes one side of a cut; `length` is that of the sub-step whose impulses the warm start has.
int StepCutting::take_side(const SubStep& s, SubStep::Side side, double length) {
  SubStep part = s;
  part.side = side;
  stepper_.solver->scale_warm_start(s.length / length);
  const int left = halving_.advance(part);
  stepper_.solver->scale_warm_start(length / s.length);
  return left;
}

// The sub-step up to the impact. It is repeated with a corrected length if turning bodies are off
// the surface at its end. Returns its length.
double StepCutting::approach(const SubStep& s) {
  const WarmStart start = stepper_.solver->warm_start();
  const Tally before = stepper_.tally;
  stepper_.remember(before_);
  double when = stepper_.cuts->when();
  const auto take = [&] {
    SubStep to = s.over(s.start, when);
    to.cuts = 0;
    take_side(to, SubStep::Side::approach, s.length);
  };
  take();
  const double then =
      std::min(when + stepper_.cuts->left(*stepper_.near, stepper_.bodies, s.length), s.length);
  if (then > 0 && then != when) {
    stepper_.restore(before_);
    stepper_.tally = before;
    stepper_.solver->set_warm_start(start);
    when = then;
    take();
  }
  return when;
}

// The impact at the present positions. Unsolved: the rest of the step takes it as without a cut.
StepCutting::Struck StepCutting::strike() {
  SubStepper& s = stepper_;
  s.near->find(s.bodies, s.now.length, s.contacts);
  s.leave_out_joined();
  if (s.sleeping) s.sleeping->leave_out(s.contacts);
  s.leave_out_passive();
  s.contacts.impulses.assign(s.contacts.points.size(), Vector3d::Zero());
  s.contacts.moments.clear();
  if (!s.cuts->gather(*s.near, s.bodies, s.options.step, *s.impacts, s.contacts))
    return Struck::nothing;
  const bool in_turn = s.options.simultaneous_impacts == SimultaneousImpacts::in_turn;
  if (in_turn) before_turns_ = s.bodies.motion;
  if (!(in_turn ? take_impacts_in_turn() : take_impact())) return Struck::unsolved;
  if (s.acting_joints)
    s.joints->take_impact(in_turn ? before_turns_ : s.impacts->coming(), s.bodies, s.contacts);
  return Struck::impact;
}

// Solves the impact of the touching contacts. False: not solved, and nothing has changed.
bool StepCutting::take_impact() {
  SubStepper& s = stepper_;
  if (s.bounces_at_once) s.bounces_at_once->choose(*s.impacts, {}, s.bodies, s.contacts);
  const BodySolution& found = s.cuts->solve(s.bodies.motion, s.contacts);
  s.count(found);
  if (found.status != Status::solved && !(found.error <= accepted_residual(s.options)))
    return false;
  take_velocities(found, s.bodies);
  s.contacts.impulses = found.impulses;
  if (s.bounces_at_once) s.tally.bounces += s.bounces_at_once->apply(s.bodies, s.contacts);
  return true;
}

// Approaching contacts strike alone; then those that this makes approach. After kMostTurns, as with
// bodies that rattle between two others, the remaining ones strike together.
bool StepCutting::take_impacts_in_turn() {
  constexpr int kMostTurns = 2000;
  SubStepper& s = stepper_;
  const StepContacts touching = s.contacts;
  StepContacts sum;
  for (int turn = 0; turn <= kMostTurns; ++turn) {
    s.contacts = touching;
    s.impacts->remember(s.bodies);
    s.impacts->choose(*s.near, s.bodies, s.options.step, s.contacts);
    if (s.impacts->list().empty()) break;
    if (turn < kMostTurns) s.impacts->keep_only_impacts(s.contacts);
    if (!take_impact()) {
      if (turn == 0) return false;
      break;
    }
    add_impulses(s.contacts, sum);
  }
  s.contacts = sum;
  return true;
}

}  // namespace tether::contact::detail

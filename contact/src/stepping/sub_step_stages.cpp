// Tether: what the stages of a sub-step do with contacts, sleepers and joints.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>

#include "stepping/sub_stepper.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

void SubStepper::leave_out_joined() {
  if (!joints) return;
  keep_contacts(contacts, [&](std::size_t k) {
    return !joints->are_joined(contacts.points[k].first, contacts.points[k].second);
  });
}

// Leaves out contacts of bodies that do not take part. If one of them touches a body that does,
// their islands have met since they were separated, and the step has to be taken for both together.
void SubStepper::leave_out_passive() {
  if (now.active == nullptr) return;
  const auto waits = [&](int i) { return bodies.mass[at(i)] > 0 && !now.has(i); };
  const auto moves = [&](int i) { return bodies.mass[at(i)] > 0 && now.has(i); };
  keep_contacts(contacts, [&](std::size_t k) {
    const PointContact& c = contacts.points[k];
    if (!waits(c.first) && !waits(c.second)) return true;
    met = met || moves(c.first) || moves(c.second);
    return false;
  });
}

// In the sub-step before an impact its contacts are left out, so that they carry no impulse yet.
// Other contacts change where the gaps close by the square of the length only.
void SubStepper::find_contacts() {
  if (options.team) options.team->place(bodies.position);
  near->find(bodies, now.length, contacts);
  leave_out_joined();
  if (sleeping && sleeping->wake_touched(*near, bodies, *impacts, now.length, contacts)) {
    end = SubStepEnd::woken;
    return;
  }
  leave_out_passive();
  if (now.side == SubStep::Side::approach)
    keep_contacts(contacts, [&](std::size_t k) { return !cuts->strikes(contacts.points[k]); });
  set_gaps();
  free_motion = bodies.motion;
  tally_before = tally;
}

// Gaps of the size of rounding count as closed. They differ from contact to contact, and bodies on
// more contacts than they need cannot close all of them: with gap / dt, rounding would decide which
// contacts carry the load. In many steps rounding grows to 1e3 units of the positions.
void SubStepper::set_gaps() {
  for (std::size_t k = 0; k < contacts.gaps.size(); ++k) {
    const double gap = contacts.gaps[k];
    tally.deepest = std::max(tally.deepest, -gap);
    PointContact& c = contacts.points[k];
    const double size = c.r1.lpNorm<1>() + bodies.position[at(c.first)].lpNorm<1>();
    const double rounding = 1e3 * std::numeric_limits<double>::epsilon() * size;
    const double open = std::min(gap, 2 * (gap - rounding));
    c.bias = open > 0 ? open / now.length : 0;
  }
}

// Chooses the impact at which the sub-step is cut. Candidates are the impacts and, with
// restitution, contacts whose gap closes within the sub-step though they are slow at its start, and
// contacts that would separate and fall back.
void SubStepper::choose_cut() {
  const std::vector<Impact>& chosen = impacts->list();
  if (now.cuts == 0 || !(restitution || !chosen.empty()) || !cuts->may_cut(contacts.points.size()))
    return;
  approaches.clear();
  approaches.reserve(contacts.points.capacity());  // allocates no more often than the contacts
  const auto fall = [&](const PointContact& c) {
    const double apart = options.gravity ? now.length * c.normal.dot(*options.gravity) : 0;
    return (motion.falls(c.second) ? apart : 0) - (motion.falls(c.first) ? apart : 0);
  };
  for (const Impact& i : chosen)
    approaches.push_back({i.contact, i.came, i.comes, fall(contacts.points[at(i.contact)])});
  impacts->each_other(restitution ? contacts.points.size() : 0, [&](std::size_t k) {
    const PointContact& c = contacts.points[k];
    const double comes = -normal_velocity(bodies.motion, c);
    if (!(comes * now.length > contacts.gaps[k])) return;
    const Approach a{static_cast<int>(k), -normal_velocity(impacts->coming(), c), comes, fall(c)};
    if (a.more(now.length) > 0 &&
        impacts->is_impact(*near, c, a.speed(contacts.gaps[k], now.length)))
      approaches.push_back(a);
  });
  if (cuts->choose(approaches, now.length, *near, bodies, contacts)) end = SubStepEnd::cut;
}

void SubStepper::choose_bounces() {
  restitution->choose(*impacts, acting_joints ? joints->strikes() : std::vector<Strike>(), bodies,
                      contacts);
}

void SubStepper::count(const BodySolution& solved) {
  ++counts.contact_problems;
  counts.sweeps += solved.sweeps;
  counts.assembled_islands += solved.assembled_islands;
}

void SubStepper::solve_problem() {
  const bool holds = near && near->any_static();
  if (holds) hold_all();
  for (int round = 0;; ++round) {
    solver->solve(bodies.motion, turned, solution);
    count(solution);
    const bool slips = holds && lets_slip();
    // Bounds that follow impulses contract.
    const bool changed = acting_joints && round < 50 && acting_joints->change_bounds(now.length);
    if (!slips && !changed) return;
    solver->take_back();
  }
}

// By the coefficient of contacts that hold; impacts have the other one.
void SubStepper::hold_all() {
  impacts->each_other(turned.size(), [&](std::size_t k) {
    turned[k].mu = contacts.points[k].mu = near->meeting(turned[k]).largest_holding();
  });
}

// Whether contacts that should hold slip, which have the other coefficient from here on. A slip is
// one that is above the geometric mean of what friction takes from it and of the error of that.
bool SubStepper::lets_slip() {
  const double error = std::sqrt(std::max(solution.error, options.tolerance));
  bool any = false;
  for (std::size_t k = 0; k < turned.size(); ++k) {
    PointContact& c = turned[k];
    const double slips = near->meeting(c).largest_friction();
    if (!(c.mu > slips)) continue;
    const auto velocity = [&](int body, const Vector3d& r) {
      return Vector3d(solution.velocities[at(body)] +
                      solution.angular_velocities[at(body)].cross(r));
    };
    const auto across = [&](const Vector3d& v) { return (v - c.normal.dot(v) * c.normal).norm(); };
    const double taken = across(solution.impulses[k]) * (bodies.motion[at(c.first)].inverse_mass +
                                                         bodies.motion[at(c.second)].inverse_mass);
    if (!(across(velocity(c.first, c.r1) - velocity(c.second, c.r2) + c.slip) > error * taken))
      continue;
    c.mu = contacts.points[k].mu = slips;
    any = true;
  }
  return any;
}

// Whether no contact closes with the present velocities, so that there is nothing to solve.
bool SubStepper::nothing_presses() const {
  for (const PointContact& c : contacts.points)
    if (normal_velocity(bodies.motion, c) + c.bias < 0) return false;
  return true;
}

void SubStepper::solve_contacts() {
  contacts.impulses.resize(contacts.points.size());  // assign() would grow without reserve
  std::fill(contacts.impulses.begin(), contacts.impulses.end(), Vector3d::Zero());
  contacts.moments.clear();
  const bool laws = acting_joints && joints->has_laws();
  const bool of_cut = now.side != SubStep::Side::none;
  if ((contacts.points.empty() && !laws) || (of_cut && !laws && nothing_presses())) {
    solver->forget();
    return;
  }
  turned.reserve(contacts.points.capacity());
  turned = contacts.points;
  if (near)
    mid_step.turn(*near, *impacts, bodies, joints.get(), options.gyroscopic, now.length, turned);
  solve_problem();
  if (shortest() && solution.status != Status::solved &&
      !(solution.error <= std::max(accepted_residual(options), kGood))) {
    solver->set_options(patient_options(options));
    solve_problem();
    solver->set_options(contact_options(options));
  }
  judge();
  if (end != SubStepEnd::whole) return;
  take_velocities(solution, bodies);
  std::copy(solution.impulses.begin(), solution.impulses.end(), contacts.impulses.begin());
  if (near && near->any_rolling()) contacts.moments = cones.moments;
}

// Whether a shorter sub-step would not help: none is allowed, or there is an impact, whose impulse
// does not depend on the length. With acceptance 1 shorter ones are tried all the same.
bool SubStepper::shortest() const {
  const bool impact = options.acceptance > 1 && !impacts->list().empty();
  return options.max_halvings > 0 && (now.halvings == 0 || impact);
}

void SubStepper::judge() {
  const bool solved = solution.status == Status::solved;
  const double last = options.acceptance > 1 ? kLast : kGood;
  const double most = std::max(accepted_residual(options), shortest() ? last : 0.0);
  const bool failed = !solved && !(solution.error <= most);
  if (failed && now.halvings > 0) {
    end = SubStepEnd::unsolved;
    return;
  }
  tally.accepted += !solved && !failed;
  tally.unsolved += failed;
  if (!solved) tally.status = solution.status;
  if (failed) tally.worsen(Outcome::unsolved);
  if (!(solution.error <= tally.residual)) tally.residual = solution.error;
}

// An impact may send a body towards others that its earlier velocity did not reach. The contacts
// with them are added and the problem is solved again, three times at most; the next step finds the
// rest.
void SubStepper::meet_others() {
  for (int again = 0; again < 3 && !failed(); ++again) {
    const std::size_t before = contacts.points.size();
    if (!near->find_more(bodies, now.length, contacts)) return;
    leave_out_joined();
    if (sleeping) sleeping->leave_out(contacts);
    leave_out_passive();
    if (contacts.points.size() == before) return;
    bodies.motion = free_motion;
    solver->take_back();
    tally = tally_before;
    set_gaps();
    choose_impacts();
    if (restitution) choose_bounces();
    solve_contacts();
    if (end != SubStepEnd::whole) return;
    if (restitution) rebound();
  }
}

void SubStepper::hold_sleepers() {
  sleeping->hold(impacts->coming(), now.length, bodies);
  near->set_resting(sleeping->asleep());
  const WarmStart woken = sleeping->take_woken(now.length);
  if (woken.ids.empty()) return;
  WarmStart start = solver->warm_start();
  start.ids.insert(start.ids.end(), woken.ids.begin(), woken.ids.end());
  start.impulses.insert(start.impulses.end(), woken.impulses.begin(), woken.impulses.end());
  solver->set_warm_start(start);
}

void SubStepper::end_sleep() {
  if (!failed() && now.side == SubStep::Side::none)
    sleeping->fall_asleep(now.length, bodies, contacts);
  sleeping->end(now.length, bodies, contacts);
}

// Joint impulses for the end of the sub-step; if the iteration finds none, the sub-step is halved.
void SubStepper::predict_joints() {
  if (!acting_joints) return;
  if (joints->predict(bodies, now.start, now.length) && resolves_joints()) return;
  if (now.joint_halvings > 0 && !unmeetable)
    end = SubStepEnd::unmet;
  else
    unmeetable = true;
}

void SubStepper::move_joints() {
  if (!acting_joints || joints->move(bodies, now.start, now.length, contacts)) return;
  tally.worsen(Outcome::joints_unmet);
}

}  // namespace tether::contact::detail

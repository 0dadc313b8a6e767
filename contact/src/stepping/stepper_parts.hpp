// Tether: the parts of a step. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <tether/contact/stepping.hpp>
#include <vector>

#include "stepping/detection/near_contacts.hpp"
#include "stepping/impacts/impacts.hpp"
#include "stepping/impacts/later_impacts.hpp"
#include "stepping/impacts/restitution.hpp"
#include "stepping/impacts/step_cuts.hpp"
#include "stepping/motion/free_motion.hpp"
#include "stepping/motion/joint_part.hpp"
#include "stepping/motion/mid_step.hpp"
#include "stepping/motion/rotation.hpp"
#include "stepping/position_correction.hpp"
#include "stepping/sleeping.hpp"
#include "stepping/step_contacts.hpp"
#include "stepping/step_settings.hpp"

namespace tether::contact {

namespace detail {

class RollingPart;

/// A part of a step, and how often it may still be halved: where its contact problem is not solved,
/// and where its joints cannot be met.
struct SubStep {
  double start = 0, length = 0;
  int halvings = 0, joint_halvings = 0;

  SubStep over(double from, double time) const { return {from, time, halvings, joint_halvings}; }
};

/// Bodies, at the start of a part of a step or at its end.
struct PartState {
  std::vector<Eigen::Vector3d> position;
  std::vector<linalg::Quaternion> orientation;
  std::vector<RigidBody> motion;
  std::vector<FreeSpin> spin;
};

/// How steps that keep an accuracy go on, and what their parts are compared by.
struct PartControl {
  struct Active {
    std::uint64_t id;
    int what;  // 1: sticks, 2: slips, 3: an impact; > 3: a moment; laws of joints as contacts
    Eigen::Vector3d slip;  // impulse, or moment, against it
    // Values of a contact: normal force and what is left of the cone, means of the part; its slip
    // where the part begins, and how fast it is where it ends.
    double force = 0, margin = 0, speed = 0, size = 0;
    Eigen::Vector3d came = Eigen::Vector3d::Zero();
  };
  StepperMemory::Control control;
  std::vector<double> radius;  // of bodies
  PartState before, whole;
  std::array<std::vector<Active>, 3> active;
  // Contacts of the second half of the part before this one, in the same step; its length.
  std::vector<Active> past;
  double past_length = 0;
};

/// How the contact problems of a step have ended, the worst of its parts.
struct Outcome {
  Status status = Status::solved;
  bool succeeded = true, joints_met = true;
  double residual = 0, deepest = 0;
};

/// Before the problem of a part: what a second one of the same part replaces leaves no trace.
struct Judgement {
  Outcome outcome;
  long bounces = 0, accepted = 0, unsolved = 0;
};

/// State where a part begins, or has ended.
struct PartMark {
  PartState bodies;
  WarmStart contacts, corrections;
};

}  // namespace detail

// A step is the list of stages, made once from the options and the bodies.
struct Stepper::Implementation {
  using Method = void (Implementation::*)();
  struct Stage {
    const char* effect;
    Method method;  // null: the force
    int force;
    double seconds;
  };

  BodySet bodies;
  SteppingOptions options;
  std::vector<Stage> stages;
  std::size_t after_forces = 0;  // where the next force goes
  std::vector<Force> force;
  detail::FreeMotion motion;

  // Only with meetings; impacts also with joints, the solver with laws of these.
  std::unique_ptr<detail::NearContacts> near;
  std::unique_ptr<detail::StepSolver> solver;
  std::unique_ptr<detail::Impacts> impacts;
  std::unique_ptr<detail::Restitution> restitution;
  std::unique_ptr<detail::Restitution> bounces_at_once;  // of impacts that a step is cut at
  std::unique_ptr<detail::LaterImpacts> later;
  std::unique_ptr<detail::StepCuts> cuts;  // only where asked for
  std::vector<detail::Approach> approaches;
  std::unique_ptr<detail::PositionCorrection> positions;  // only with error reduction
  std::unique_ptr<detail::Sleeping> sleeping;             // only where bodies may sleep
  StepContacts contacts;
  detail::MidStep mid_step;
  std::vector<PointContact> turned;  // contacts as of the middle of the step
  BodySolution solution;
  std::unique_ptr<detail::JointPart> joints;     // only where they have been added
  std::unique_ptr<detail::RollingPart> rolling;  // only where a meeting names it

  // The part of the step that is taken.
  struct Part {
    detail::SubStep now;
    // Who ends it before its last stage: its problem, its joints, an impact on the way, or a body
    // that has woken.
    enum class End : std::uint8_t { none, unsolved, unmet, cut, woken } end = End::none;
    bool failed = false;      // its problem, though it may be used
    bool unmeetable = false;  // joints, however short the part
    int cuts_left = 0;        // that it may be taken in parts for
    bool of_cut = false, before_impact = false;
    bool in_cut = false;                  // of a step that is being cut
    std::vector<char> active;             // bodies that take part; empty: all
    bool joints_active = true;            // those that joints hold
    bool may_split = false, met = false;  // islands apart; they have met
    std::vector<RigidBody> free_motion;   // before its problem
    detail::Judgement before;
  } part;
  detail::Outcome outcome;
  std::vector<RigidBody> before_turns;  // before impacts in turn
  detail::PartControl parts;            // only with an accuracy
  StepCounts counts;
  double late = 0;  // how much later than its boundary the next step begins, s

  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  void add_stage(const char* effect, Method method) { stages.push_back({effect, method, -1, 0}); }
  void make_stages();

  void make_solvers();
  void step();
  bool is_finite() const;
  detail::SubStep whole(double start, double length) const;
  void advance(detail::SubStep s);
  void take_halves(const detail::SubStep& s);
  bool resolves_joints() const;
  bool run_stages();
  void solve_problem();
  bool shortest() const;
  void remember_part(detail::PartState& p) const;
  void restore_part(const detail::PartState& p);
  void advance_part(double time, double length);
  struct Moment {
    double when, early;  // s
  };
  Moment moment(double gap, double came, double comes, double size, double length) const;
  Moment moment(const detail::Impact& i, double length) const;
  void list_active(double length, std::vector<detail::PartControl::Active>& list) const;
  void list_laws(double length, std::vector<detail::PartControl::Active>& list) const;
  void list_moments(std::vector<detail::PartControl::Active>& list) const;
  static bool same(const std::vector<detail::PartControl::Active>& a,
                   const std::vector<detail::PartControl::Active>& b);
  double first_impact(double length, double& at_once) const;
  double first_switch(double length) const;
  double part_error(const detail::PartState& whole, double length, bool smooth) const;
  void extrapolate(const detail::PartState& whole);
  double take_part(double time, double length, bool shortened, double shortest);
  void advance_accurately(double start, double length);

  bool may_cut() const;
  void look_for_cut();
  void hold_sleepers();
  void end_sleep();
  bool nothing_presses() const;
  void leave_out_striking();
  enum class Struck : std::uint8_t { nothing, impact, unsolved };
  Struck strike();
  bool take_impact();
  bool take_impacts_in_turn();
  detail::PartMark mark() const;
  void go_back(const detail::PartMark& m);
  bool takes_part(int body) const { return part.active.empty() || part.active[at(body)] != 0; }
  void set_active(std::vector<char> active);
  void leave_out_passive();
  void take_of_cut(detail::SubStep s, double length);
  double approach(detail::SubStep s);
  void take_striking(detail::SubStep s);
  void take_others(const detail::PartMark& start, const std::vector<char>& striking,
                   detail::SubStep s);
  void take_cut(detail::SubStep s);
  void advance_cut(detail::SubStep s);

  void judge();
  detail::Judgement judged() const;
  void set_judged(const detail::Judgement& b);

  void make_impacts();
  void remember_velocities() { impacts->remember(bodies); }
  void begin_joints() {
    if (part.joints_active) joints->begin(bodies, part.now.start);
  }
  void predict_joints();
  void put_back_joints() {
    if (part.joints_active) joints->put_back(bodies, part.now.start);
  }
  void leave_out_joined();
  void move_joints();
  void find_contacts();
  void set_gaps();
  void choose_impacts();
  void choose_bounces() {
    const bool laws = joints && part.joints_active;
    restitution->choose(*impacts, *impacts,
                        laws ? joints->strikes() : std::vector<detail::Strike>(), bodies, contacts);
  }
  void solve_contacts();
  void rebound() { counts.bounces += restitution->apply(bodies, contacts); }
  void take_later_impacts();
  void meet_others();
  void close_gaps() {
    positions->close_gaps(*impacts, part.now.length, contacts, motion.moving(), bodies);
  }
  void take_penetrations_back() {
    positions->take_back(outcome.deepest, detail::negligible_depth(options, part.now.length),
                         part.now.length, contacts, motion.moving(), bodies);
  }
  void apply_gravity() { motion.accelerate(part.now.length * *options.gravity, bodies); }
  void gyrate_explicit() { motion.gyrate_explicit(part.now.length, bodies); }
  void gyrate_implicit() { motion.gyrate_implicit(part.now.length, bodies); }
  void move() { motion.move(part.now.length, bodies); }
  bool falls() const { return options.gravity && cuts; }
  void remember_weight() { motion.remember_weight(bodies); }
  void find_falling() { motion.find_falling(bodies); }
  void fall() { motion.fall(*options.gravity, part.now.length, contacts, bodies); }
  void turn_round() { motion.turn_round(part.now.length, bodies); }
  void turn_plain() { motion.turn_plain(part.now.length, bodies); }
  void turn_keeping_momentum() { motion.turn_keeping_momentum(part.now.length, bodies); }
};

}  // namespace tether::contact

// Tether: the parts of a step. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <tether/contact/stepping.hpp>
#include <vector>

#include "stepping/closing.hpp"
#include "stepping/impacts.hpp"
#include "stepping/joint_part.hpp"
#include "stepping/later_impacts.hpp"
#include "stepping/near_contacts.hpp"
#include "stepping/restitution.hpp"
#include "stepping/rotation.hpp"

namespace tether::contact {

namespace detail {

/// Parts of the largest velocity that a contact needs. A better answer than `kGood` is worth no
/// more work where the tolerance is not met. Answers within `kUseful` are as good as the step: it
/// moves bodies by velocities of its end, an error of half of what it changes them by, while one
/// contact is off by so much in a problem that is not solved.
constexpr double kGood = 1e-4, kUseful = 1e-2;

/// Bodies, at the start of a part of a step or at its end.
struct PartState {
  std::vector<Eigen::Vector3d> position;
  std::vector<linalg::Quaternion> orientation;
  std::vector<RigidBody> motion;
  std::vector<FreeSpin> spin;
};

/// Throws std::invalid_argument.
void check(const SteppingOptions& o);
/// Options of the contact problem of a step, and of the one that reduces penetrations.
BodyOptions contact_options(const SteppingOptions& o);
/// Options of contact problems that a shorter step would not make easier.
BodyOptions patient_options(const SteppingOptions& o);
BodyOptions correction_options(const SteppingOptions& o);
Depenetration depenetration(const SteppingOptions& o);
/// Depth that the residual itself allows in a step: m.
double negligible_depth(const SteppingOptions& o, double dt);
/// Options of the problem that finds the gaps closed by inelastic impacts.
BodyOptions closing_options(const SteppingOptions& o);
/// Of a threshold in parts of sqrt(g size): m/s for a size of 1 m.
double threshold_speed(double threshold, const SteppingOptions& o);

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
  std::vector<int> moving, long_bodies;  // long: of inertia other than 1
  // Those that no joint moves: all, round and long ones.
  std::vector<int> free, free_round, free_long;
  std::vector<detail::FreeSpin> free_spin;  // of free_long

  // Only with meetings.
  std::unique_ptr<detail::NearContacts> near;
  std::unique_ptr<detail::StepSolver> solver;
  std::unique_ptr<detail::Impacts> impacts;
  std::unique_ptr<detail::Restitution> restitution;
  std::unique_ptr<detail::LaterImpacts> later;
  StepContacts contacts;
  BodySolution solution;

  std::unique_ptr<detail::JointPart> joints;  // only where they have been added

  // Of the step: start and length of the part that is taken, what is worst of all its parts.
  double part_start = 0, dt = 0;
  bool may_halve = false, failed = false, succeeded = true;
  Status status = Status::solved;
  double residual = 0, deepest = 0;

  // As they were before the problem: what a second one of the same part replaces leaves no trace.
  struct Judgement {
    Status status;
    bool succeeded;
    double residual;
    long bounces, accepted, unsolved;
  } before_problem = {};

  // Only with error reduction.
  std::unique_ptr<detail::Closing> closing;
  std::unique_ptr<detail::StepSolver> correction;
  BodySolution correction_solution;
  std::vector<RigidBody> at_rest, closing_move, free_motion;
  std::vector<PointContact> deep_points;
  bool closes = false, corrects = false;

  // Only with an accuracy.
  struct Active {
    std::uint64_t id;
    int what;              // 1: sticks, 2: slips, 3: an impact
    Eigen::Vector3d slip;  // impulse against it
  };
  StepperMemory::Control control;
  std::vector<double> radius;  // of bodies
  detail::PartState part_before, part_whole;
  std::array<std::vector<Active>, 3> active;

  StepCounts counts;

  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  void add_stage(const char* effect, Method method) { stages.push_back({effect, method, -1, 0}); }
  void make_stages();
  void turn_inertias();

  void make_solvers();
  void give_joints();
  void step();
  void advance(double time, double length, int halvings);
  bool run_stages(double time);
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
  void list_active(double length, std::vector<Active>& list) const;
  void list_laws(std::vector<Active>& list) const;
  static bool same(const std::vector<Active>& a, const std::vector<Active>& b);
  double first_impact(double length, double& at_once) const;
  double part_error(const detail::PartState& whole, double length, bool smooth) const;
  void extrapolate(const detail::PartState& whole);
  double take_part(double time, double length, bool shortened, double shortest);
  void advance_accurately(double start, double length);

  void judge();
  Judgement judged() const;
  void set_judged(const Judgement& b);

  void remember_velocities() { impacts->remember(bodies); }
  void begin_joints() { joints->begin(bodies, part_start); }
  void predict_joints() { joints->predict(bodies, part_start, dt); }
  void put_back_joints() { joints->put_back(bodies, part_start); }
  void leave_out_joined();
  void move_joints();
  void apply_gravity();
  void gyrate_explicit();
  void gyrate_implicit();
  void find_contacts();
  void set_gaps();
  void choose_impacts();
  void choose_bounces() { restitution->choose(*impacts, *impacts, bodies, contacts); }
  void solve_contacts();
  bool has_laws() const { return joints && joints->has_laws(); }
  // A motor may give what energy is held against: with laws of joints the one solve stands.
  void rebound() {
    if (!has_laws()) counts.bounces += restitution->apply(bodies, contacts);
  }
  void take_later_impacts();
  void meet_others();
  void close_gaps();
  void correct_penetration();
  void shift(int body, const Eigen::Vector3d& v, const Eigen::Vector3d& w);
  void move();
  void turn_round();
  void turn_plain();
  void turn_keeping_momentum();
};

}  // namespace tether::contact

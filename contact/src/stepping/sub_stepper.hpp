// Tether: takes the sub-steps of a step. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <tether/contact/stepping.hpp>
#include <vector>

#include "joints/stepping/step_joints.hpp"
#include "stepping/detection/near_contacts.hpp"
#include "stepping/impacts/impacts.hpp"
#include "stepping/impacts/restitution.hpp"
#include "stepping/impacts/step_cuts.hpp"
#include "stepping/motion/free_motion.hpp"
#include "stepping/motion/mid_step.hpp"
#include "stepping/position_correction.hpp"
#include "stepping/sleeping.hpp"
#include "stepping/step_settings.hpp"
#include "stepping/sub_step.hpp"

namespace tether::contact::detail {

/// Takes one sub-step: a list of stages, made once from the options and the bodies. StepHalving,
/// StepCutting and AccurateSteps decide about shorter sub-steps.
struct SubStepper {
  struct Stage {
    const char* effect;
    std::function<void()> run;
    double seconds = 0;
  };

  SubStepper(BodySet bodies, std::vector<Surface> surfaces, const std::vector<Meeting>& meetings,
             const SteppingOptions& options);
  SubStepper(const SubStepper&) = delete;  // stages refer to it
  SubStepper& operator=(const SubStepper&) = delete;
  ~SubStepper();
  void add_force(const char* effect, Force force);
  /// Before forces.
  void add_joints(std::unique_ptr<StepJoints> part);
  /// Calls it between the stages.
  void observe(StepObserver observer);
  /// New solvers, without warm starts.
  void make_solvers();

  /// The sub-step that is taken, or what it consists of.
  void set_now(const SubStep& s);
  SubStepEnd take();
  /// Whether an explicit step of this length is stable for what the joints hold.
  bool resolves_joints() const;
  bool is_finite() const;

  void remember(BodiesState& state) const;
  void restore(const BodiesState& state);
  void count(const BodySolution& solved);  // into `counts`
  StepMark mark() const;
  void go_back(const StepMark& mark);

  /// Remove contacts of bodies that a joint connects, and of bodies that do not take part.
  void leave_out_joined();
  void leave_out_passive();

  BodySet bodies;
  SteppingOptions options;
  // With an accuracy or sleep, of bodies, m: the reach of their surfaces or the radius of gyration.
  std::vector<double> sizes;
  std::vector<Stage> stages;
  std::size_t first_force = 0, forces = 0;  // the first stage of a force, and how many there are
  FreeMotion motion;

  ConeSources cones;
  // Only with meetings; impacts also with joints, the solver with laws of these.
  std::unique_ptr<NearContacts> near;
  std::unique_ptr<StepSolver> solver;
  std::unique_ptr<Impacts> impacts;
  std::unique_ptr<Restitution> restitution;
  std::unique_ptr<Restitution> bounces_at_once;  // of impacts that a step is cut at
  std::unique_ptr<StepCuts> cuts;                // only where asked for
  std::vector<Approach> approaches;
  std::unique_ptr<PositionCorrection> positions;  // only with error reduction
  std::unique_ptr<Sleeping> sleeping;             // only where bodies may sleep
  StepContacts contacts;
  MidStep mid_step;
  std::vector<PointContact> turned;  // contacts as of the middle of the step
  BodySolution solution;
  std::unique_ptr<StepJoints> joints;   // only where they have been added
  StepJoints* acting_joints = nullptr;  // the same where bodies that they hold take part

  SubStep now;
  SubStepEnd end = SubStepEnd::whole;
  bool unmeetable = false;             // joints, in this step: however short the sub-step
  bool met = false;                    // islands that were apart, in this step
  Tally tally, tally_before;           // the latter: before the problem of the sub-step,
  std::vector<RigidBody> free_motion;  // and what bodies would do without
  StepCounts counts;                   // but for those of `tally`

  /// Whether its contact problem is above what is accepted, though it is used.
  bool failed() const { return tally.unsolved > tally_before.unsolved; }

 private:
  /// Adds a stage that calls run(*this).
  template <class Run>
  void stage(const char* effect, const Run& run) {
    stages.push_back({effect, [this, run] { run(*this); }});
  }
  void make_stages();
  void add_contact_stages(const char* impact);
  void solve_problem();
  void hold_all();
  bool lets_slip();
  void judge();
  bool shortest() const;
  bool nothing_presses() const;

  void find_contacts();
  void set_gaps();
  void choose_cut();
  void choose_impacts() { impacts->choose(*near, bodies, now.length, contacts); }
  void choose_bounces();
  void solve_contacts();
  void rebound() { tally.bounces += restitution->apply(bodies, contacts); }
  void meet_others();
  void hold_sleepers();
  void end_sleep();
  void predict_joints();
  void move_joints();
};

}  // namespace tether::contact::detail

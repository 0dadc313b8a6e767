// Tether: joints in a step. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/contact/joint_equations.hpp>
#include <tether/contact/stepping.hpp>
#include <utility>
#include <vector>

#include "joint_frequency.hpp"
#include "joints/cone_islands.hpp"

namespace tether::contact::detail {

/// Joints in a step (method, section 8), which starts with G v = rate. Impulses along the rows G of
/// its start make its end meet g = 0 (SHAKE): first without contacts, so that the contact problem
/// has velocities that the joints allow, then for the changes by contacts. Finally velocities are
/// projected onto the rows of the end (RATTLE). All impulses act along G', so free mechanisms keep
/// their linear and angular momentum.
class StepJoints {
 public:
  /// Makes the mechanisms, laws and links of `sources`.
  StepJoints(std::unique_ptr<JointEquations> equations, const BodySet& bodies,
             Gyroscopic gyroscopic, ConeSources& sources);

  std::vector<double> impulses;         ///< of the last sub-step, by row
  std::vector<double> impulses_at_end;  ///< the part of them along the rows at its end
  /// Velocities that predict() has added to bodies that joints hold, for the joints to be met at
  /// the end of the step, beyond velocities that meet them at its start.
  std::vector<Vector6d> bend;
  double drift = 0;  ///< largest |g| at the end of the last sub-step, m or rad

  bool holds(int body) const { return mechanisms_.mechanism_of(body) >= 0; }
  /// Bodies that a joint of three rows or more connects pass through each other.
  bool are_joined(int first, int second) const;

  /// Called at the start of a step, before its forces. Positions and velocities that the caller has
  /// changed are put back onto the joints by the least change. Throws std::invalid_argument on
  /// joints that contradict each other.
  void begin(BodySet& bodies, double t);
  /// Called before the contacts are solved: velocities that meet the joints at the end of the step.
  /// False: none were found, for instance because the step is too long.
  bool predict(BodySet& bodies, double t, double dt);
  /// Makes the least move back onto the joints if something has moved the bodies since begin().
  void put_back(BodySet& bodies, double t);
  /// Moves the bodies of the mechanisms to the end of the step. False: it does not meet the joints
  /// to round-off.
  bool move(BodySet& bodies, double t, double dt, const StepContacts& contacts);
  /// An impact has changed the velocities where the bodies are: `impulses` are those that it takes.
  void take_impact(const std::vector<RigidBody>& before, const BodySet& bodies,
                   const StepContacts& contacts);

  /// Whether there are laws; then contact problems are solved without contacts, too.
  bool has_laws() const { return equations_->has_laws(); }
  /// Whether problems include the laws: not while the bodies of joints wait.
  void set_active(bool active) { laws_.active = active; }
  /// Changes the bounds of laws that depend on the impulses of the last problem of velocities, over
  /// dt. False: they are as they were.
  bool change_bounds(double dt) {
    return laws_.any(LawUse::all) && equations_->change_bounds(laws_.impulses, dt, laws_.laws);
  }
  /// Impulses of the laws in the last sub-step.
  std::vector<double>& law_impulses() { return laws_.impulses; }
  void list_laws(std::vector<LawState>& out) const;
  const std::vector<Strike>& strikes() const { return laws_.strikes; }
  /// Which steps have to resolve.
  const StepperMemory::Vibration& vibration() const { return frequency_.memory(); }
  void set_vibration(const StepperMemory::Vibration& v) { frequency_.set_memory(v); }

 private:
  // Relative to the size of the mechanism, the root of mass times squared distance from the origin:
  // an iteration ends at a move of kNoMove, and is accepted below kMet if it stalls.
  static constexpr double kNoMove = 1e-14, kMet = 1e-11;
  static constexpr int kMoves = 30;

  struct Place {
    Eigen::Vector3d position;
    linalg::Quaternion orientation;
  };
  // Positions of all bodies and the time for which the factors were made.
  class FactoredAt {
   public:
    void set(const BodySet& bodies, double t);
    void clear() { position_.clear(); }
    bool none() const { return position_.empty(); }
    // False where a body has moved, or the time is another one.
    bool is(const BodySet& bodies, double t) const;

   private:
    std::vector<Eigen::Vector3d> position_;
    std::vector<linalg::Quaternion> orientation_;
    double time_ = 0;
  };
  void put_onto(BodySet& bodies, double t);
  void factor(const BodySet& bodies, double t);
  void rows_at(const BodySet& bodies, double t, JointRows& rows);
  void check_laws(const BodySet& bodies);
  void take_velocities(const BodySet& bodies);
  void give_velocities(BodySet& bodies) const;
  bool is_rounding(const BodySet& bodies) const;
  double size(const BodySet& bodies) const;
  double least_move(const BodySet& bodies, double t, double dt);
  void move_back(BodySet& bodies) const;
  bool project_positions(BodySet& bodies, double t);
  [[noreturn]] void refuse(const BodySet& bodies, double t);
  [[noreturn]] void refuse_rates();
  void store(const BodySet& bodies);
  void restore(BodySet& bodies) const;
  void advance_bodies(BodySet& bodies, double dt) const;
  bool meet(BodySet& bodies, double t, double dt);
  void find_impulses(const BodySet& bodies, const StepContacts& contacts);

  std::unique_ptr<JointEquations> equations_;
  Gyroscopic gyroscopic_;
  ConeSources& sources_;
  Mechanisms& mechanisms_;
  LawRows& laws_;
  JointRows rows_;
  std::vector<int> bodies_of_rows_;  // of the first rows; -1 behind each
  int laws_in_step_ = -1;            // of the first step
  std::vector<int> held_;            // bodies of mechanisms
  std::vector<char> round_;          // of them: of inertia 1
  std::vector<std::pair<int, int>> joined_;
  std::vector<Vector6d> v_, start_, change_;  // of all bodies; at the start of the step
  std::vector<double> g_, b_;                 // by row
  std::vector<double> u_;                     // the entries of a mechanism
  std::vector<Place> place_;                  // of held_, at the start of the step
  FactoredAt factored_;
  JointFrequency frequency_;
  double left_ = 0;  // of the last least_move(): what no move takes back, in its metric
};

}  // namespace tether::contact::detail

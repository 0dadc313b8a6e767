// Tether: impacts that a step is cut at. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <tether/contact/stepping.hpp>
#include <vector>

#include "stepping/detection/near_contacts.hpp"
#include "stepping/impacts/impacts.hpp"
#include "stepping/motion/joint_part.hpp"

namespace tether::contact::detail {

/// README, section 13. When an approach over this gap ends: gap = came t + more t^2.
double closing_time(double gap, double came, double more);

/// A step with few contacts is taken in parts: up to where the first of them closes, the impact
/// itself, which takes no time, and the rest. Where impacts are taken at the start of a step
/// instead, positions are off by the way that the velocities before and after it differ by, from
/// the start to the closing: an error of the step's length times the phase of the impact in it,
/// which no two step lengths have in common.
class StepCuts {
 public:
  static constexpr std::size_t kMostContacts = 16;  // as LaterImpacts
  static constexpr int kMost = 8;                   // in a step; then as without

  explicit StepCuts(const BodyOptions& options);
  /// After the above.
  void set_joints(IslandMaker& joints, const BodyOptions& options) {
    solver_.set_joints(joints.make_islands(options, LawUse::none));
  }

  /// Which contacts have pressed in the part before: of its solve.
  void remember(const WarmStart& solved);
  /// After the impacts are chosen: false where none of them is on the way. `falls`: by how much of
  /// dt the weight of falling bodies adds to each approach, whose positions have half of that.
  bool choose(const Impacts& impacts, double dt, const StepContacts& contacts,
              const std::vector<double>& falls);
  /// From the start of the part to the impact, s; all of it: none before its end.
  double when() const { return when_; }
  bool strikes(const PointContact& c) const;

  /// At the impact: leaves contacts that touch, with those that strike among `impacts`. Those that
  /// have pressed touch, and gaps that the slowest impact closes in a step. False: none strikes.
  bool gather(const NearContacts& near, const BodySet& bodies, double step, Impacts& impacts,
              StepContacts& contacts) const;
  /// Impulses of a step are those of all its parts and impacts: add() after each but the last.
  void begin_sum() { sum_ = {}; }
  void add(const StepContacts& contacts);
  void add_sum_to(StepContacts& contacts) const;

  const BodySolution& solve(const std::vector<RigidBody>& motion, const StepContacts& contacts) {
    solver_.solve(motion, contacts.points, solution_);
    return solution_;
  }

 private:
  double when_ = 0;
  std::vector<std::uint64_t> pressing_, striking_;  // identities, sorted
  std::vector<double> time_;                        // of impacts
  StepContacts sum_;
  StepSolver solver_;
  BodySolution solution_;
};

}  // namespace tether::contact::detail

// Tether: impacts that a step is cut at. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <tether/contact/stepping.hpp>
#include <vector>

#include "joints/cone_islands.hpp"
#include "stepping/detection/near_contacts.hpp"
#include "stepping/impacts/impacts.hpp"
#include "stepping/motion/moving_islands.hpp"
#include "stepping/sub_step.hpp"

namespace tether::contact::detail {

/// Time at which an approach closes this gap: gap = came t + more t^2. A contact that separates,
/// came < 0, needs more > 0.
double closing_time(double gap, double came, double more);

/// A contact that may close in a sub-step: forces raise its speed of approach from `came` to
/// `comes`, m/s. `falls`: the share of freely falling bodies, whose positions change by half of it.
struct Approach {
  int contact;
  double came, comes, falls;
  double more(double dt) const { return (comes - came - 0.5 * falls) / dt; }
  /// When it closes a gap, s, and the speed that it has there.
  double time(double gap, double dt) const { return closing_time(gap, came, more(dt)); }
  double speed(double gap, double dt) const { return came + (comes - came) * time(gap, dt) / dt; }
};

/// Cuts the step of striking islands (method, section 7.1): up to the first closing gap, the impact
/// itself, which takes no time, and the rest. Without a cut an impact is taken at the start of its
/// step. The positions then have an error of the step's length times the phase of the impact in the
/// step, and this phase differs from one step length to the next.
class StepCuts {
 public:
  /// Most contacts of a scene, or, in scenes of up to the second number, of a striking island.
  static constexpr std::size_t kMostContacts = 16, kMostInScene = 512;
  static constexpr int kMost = 32;  // in a step; then as without
  /// Budget of cuts with more than kMostContacts, in contact problems: income of a step, most that
  /// is kept, price of a cut, which is the first stock.
  static constexpr double kShare = 0.05, kMostKept = 16, kPrice = 3;

  StepCuts(const BodyOptions& options, ConeSources& sources);
  /// Islands of these bodies are not cut, nor are those with rolling friction: laws of joints, and
  /// moments of contacts, act over a time. (Impacts in turn leave what a limit takes to the
  /// sub-step after them: they need no laws.)
  void leave_whole(const std::vector<int>& bodies) { left_whole_ = &bodies; }
  /// Adds the income of a step.
  void earn() { kept_ = std::min(kept_ + kShare, kMostKept); }
  double kept() const { return kept_; }
  void set_kept(double kept) { kept_ = kept; }

  /// Keeps which contacts pressed in the solve of the sub-step before.
  void remember(const WarmStart& solved);
  /// Whether a step of so many contacts may be cut.
  bool may_cut(std::size_t contacts) const {
    return contacts <= kMostContacts || (contacts <= kMostInScene && kept_ >= kPrice);
  }
  /// Chooses the impact to cut at in a step that may be cut. False: none of the impacts is on the
  /// way.
  bool choose(const std::vector<Approach>& impacts, double dt, const NearContacts& near,
              const BodySet& bodies, const StepContacts& contacts);
  /// Marks the bodies of the islands that are to strike. `falls`: bodies that nothing but contacts
  /// connects to others. False: no other body moves among those that take part in the sub-step.
  bool find_striking(const BodySet& bodies, const StepContacts& contacts,
                     const std::vector<int>& moving, const std::vector<char>& falls,
                     const SubStep& now, std::vector<char>& striking);
  /// From the start of the sub-step to the impact, s; all of it: none before its end.
  double when() const { return when_; }
  bool strikes(const PointContact& c) const;
  /// At the end of the approach: time, s, until the first striking contact touches at its speed
  /// then.
  double left(NearContacts& near, const BodySet& bodies, double dt);

  /// At the impact: leaves contacts that touch, with those that strike among `impacts`. Those that
  /// have pressed touch, and gaps that the slowest impact closes in a step. False: none strikes.
  bool gather(const NearContacts& near, const BodySet& bodies, double step, Impacts& impacts,
              StepContacts& contacts);

  const BodySolution& solve(const std::vector<RigidBody>& motion, const StepContacts& contacts) {
    solver_.solve(motion, contacts.points, solution_);
    return solution_;
  }

 private:
  void find_islands(const NearContacts& near, const BodySet& bodies, const StepContacts& contacts);

  double when_ = 0, kept_ = kPrice;
  const std::vector<int>* left_whole_ = nullptr;
  MovingIslands islands_;
  std::vector<std::size_t> size_;                   // of islands, by their root: contacts
  std::vector<char> marked_, whole_;                // islands, by their root
  std::vector<std::uint64_t> pressing_, striking_;  // identities, sorted
  std::vector<double> time_;                        // of impacts
  StepContacts found_;
  StepSolver solver_;
  BodySolution solution_;
};

}  // namespace tether::contact::detail

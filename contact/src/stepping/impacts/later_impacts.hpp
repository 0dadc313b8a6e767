// Tether: impacts that impacts cause. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <tether/contact/stepping.hpp>
#include <vector>

#include "stepping/detection/near_contacts.hpp"
#include "stepping/impacts/impacts.hpp"
#include "stepping/impacts/restitution.hpp"
#include "stepping/motion/joint_part.hpp"
#include "stepping/motion/moving_islands.hpp"

namespace tether::contact::detail {

/// Impacts within a step that an impact of the same step causes (method, section 7.1): the next
/// ball of a row, the other end of a rod. One solve with bias gap / dt would leave a part of them
/// to the next step. The island is therefore solved again from the velocities before the impulses,
/// in passes; each pass has the contacts that touch or close with its velocities. If an impact does
/// not bounce, the displacement up to it counts for the others; if it bounces, the velocities after
/// it move the bodies for the whole step. Contacts that still close after kPasses get bias gap /
/// dt. Islands of more than kFewContacts keep the one solve.
class LaterImpacts {
 public:
  static constexpr int kPasses = kFewContacts;
  struct Counts {
    int problems = 0, sweeps = 0, bounces = 0;
  };

  /// Thresholds: see Impacts. restitution: null where nothing bounces.
  LaterImpacts(double threshold, double restitution_threshold, const BodyOptions& options,
               IslandMaker* maker, std::unique_ptr<Restitution> restitution);
  /// Not in islands of mechanisms with laws, whose impulses are those of one problem.
  void set_laws(const JointPart& joints) { laws_ = &joints; }

  /// Called after the solve and restitution. If there are later impacts and their problems are all
  /// solved, changes velocities and impulses, and adds to `impacts`.
  Counts take(const NearContacts& near, Impacts& impacts, double dt, BodySet& bodies,
              StepContacts& contacts);

 private:
  struct Member {
    int contact, root;
    double least;     // approach that counts, m/s
    double left;      // gap at the time of the pass, m
    double approach;  // before the pass, m/s
    bool touches;     // at the start, or closed by an impact that does not bounce
  };

  bool find_islands(const NearContacts& near, const Impacts& impacts, const BodySet& bodies,
                    double dt, const StepContacts& contacts);
  void start(const NearContacts& near, const Impacts& impacts, double dt, BodySet& bodies,
             StepContacts& contacts);
  double remaining(const Member& m, double dt) const { return dt - time_[root(m)]; }
  static std::size_t root(const Member& m) { return static_cast<std::size_t>(m.root); }
  bool gather(const BodySet& bodies, double dt, const StepContacts& contacts, bool all);
  void pass_time(const StepContacts& contacts);
  bool solve_pass(const NearContacts& near, const Impacts& impacts, double dt, BodySet& bodies,
                  StepContacts& contacts, Counts& counts);
  bool run_passes(const NearContacts& near, const Impacts& impacts, double dt, BodySet& bodies,
                  StepContacts& contacts, Counts& counts);

  void keep_energy(const Impacts& impacts, BodySet& bodies, StepContacts& contacts);

  const JointPart* laws_ = nullptr;
  MovingIslands islands_;
  std::vector<char> marked_;     // islands, by their root
  std::vector<int> size_;        // of each island, contacts
  std::vector<Member> members_;  // contacts of the marked islands
  std::vector<double> time_,
      way_;                  // of islands: since the start of the step, to the impacts of a pass
  std::vector<int> member_;  // of each contact of a pass
  StepContacts part_;        // of a pass
  Impacts pass_impacts_;
  std::vector<Impact> taken_;
  std::vector<RigidBody> first_, force_;
  std::vector<double> gain_, kinetic_;  // of islands, J
  std::vector<double> fastest_;         // of their impacts, m/s
  std::vector<Eigen::Vector3d> first_impulses_;
  std::unique_ptr<Restitution> restitution_;
  StepSolver solver_;
  BodySolution solution_;
  int bounces_ = 0;  // of the last pass
};

}  // namespace tether::contact::detail

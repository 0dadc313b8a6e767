// Tether: bodies at rest that steps leave out. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <tether/contact/stepping.hpp>
#include <tether/linalg/index.hpp>
#include <utility>
#include <vector>

#include "stepping/detection/near_contacts.hpp"
#include "stepping/impacts/impacts.hpp"
#include "stepping/motion/moving_islands.hpp"

namespace tether::contact::detail {

class StepJoints;

/// method, section 7. Islands of bodies that press on each other fall asleep when all of them have
/// been slow for a while: they stay where they are, take part in no problem, and their contacts
/// press as they did last. Bodies that joints hold do not sleep, nor do fixed ones: they are
/// neighbours, which the contacts of those that sleep go on pressing on. An island wakes as a whole
/// where the forces on one of its bodies change, a neighbour moves or is struck, another body is
/// about to touch it, or the caller moves one of it.
class Sleeping {
 public:
  /// `sizes`: of bodies, m. `speed`: m/s for a size of 1 m; goes with its root.
  Sleeping(const BodySet& bodies, std::vector<double> sizes, double speed, double gravity);
  void set_joints(const StepJoints& joints);

  int count() const { return count_; }
  const std::vector<char>& asleep() const { return asleep_; }  ///< of each body

  /// After the forces of a sub-step, before joints and contacts: wakes islands whose forces or
  /// neighbours have changed, holds the others, and presses on their neighbours.
  void hold(const std::vector<RigidBody>& coming, double dt, BodySet& bodies);
  /// After contacts are found. True: something is about to touch an island, which is awake now: the
  /// sub-step begins anew. Else contacts of bodies asleep are left out.
  bool wake_touched(const NearContacts& near, const BodySet& bodies, const Impacts& impacts,
                    double dt, StepContacts& contacts);
  void leave_out(StepContacts& contacts) const;
  /// At the end of a sub-step whose problem is solved, before end(): who falls asleep.
  void fall_asleep(double dt, BodySet& bodies, const StepContacts& contacts);
  /// Bodies asleep are where they were to the last bit; adds their contacts.
  void end(double dt, BodySet& bodies, StepContacts& contacts) const;
  /// Impulses in a sub-step of length dt of contacts that have woken since the last call.
  WarmStart take_woken(double dt);

  void wake_everybody();

  StepperMemory::Sleep memory() const;
  /// After the bodies are set. Throws std::invalid_argument where it is of others.
  void set_memory(const StepperMemory::Sleep& memory, const BodySet& bodies);

 private:
  struct Place {
    Eigen::Vector3d position;
    linalg::Quaternion orientation;
    RigidBody motion;
  };
  void wake(int island);
  bool wake_all();
  void list_kept();
  bool has_changed(int body, const Eigen::Vector3d& a, const Eigen::Vector3d& turn,
                   const RigidBody& came, const BodySet& bodies) const;
  bool has_moved(const StepperMemory::Neighbour& n, const BodySet& bodies) const;
  bool has_rested(int body) const;
  void find_rested(double dt, BodySet& bodies, const StepContacts& contacts);
  void add_neighbour(int body, int island, const BodySet& bodies);
  bool sleeps(const PointContact& c) const {
    return asleep_[linalg::at(c.first)] != 0 || asleep_[linalg::at(c.second)] != 0;
  }
  int island_of(const PointContact& c) const {
    return body_[linalg::at(asleep_[linalg::at(c.first)] != 0 ? c.first : c.second)].island;
  }
  std::vector<double> size_;
  double speed_, gravity_;
  std::vector<char> may_, held_;  // bodies: may sleep, are held by joints
  std::vector<StepperMemory::Rest> body_;
  std::vector<char> asleep_;
  int count_ = 0;
  std::vector<Place> place_;             // of bodies asleep
  StepContacts kept_;                    // their contacts, with forces in the place of impulses
  std::vector<std::uint64_t> kept_ids_;  // sorted
  std::vector<StepperMemory::Neighbour> neighbours_;
  WarmStart woken_;
  std::vector<int> woken_islands_;
  StepContacts pressing_;
  std::vector<std::size_t> loads_;  // contacts that press on a body that may sleep
  MovingIslands islands_;
  std::vector<char> rested_;  // islands, by their root
};

}  // namespace tether::contact::detail

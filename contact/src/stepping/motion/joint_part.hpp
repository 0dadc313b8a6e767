// Tether: the part of joints in a step, as the stages call it. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <tether/contact/stepping.hpp>
#include <tether/linalg/disjoint_sets.hpp>
#include <utility>
#include <vector>

namespace tether::contact::detail {

class NearContacts;

/// Which laws of joints (JointLaws) a problem includes: velocities: all; velocities without
/// restitution: all, and limits do not bounce; closing of gaps: all, their impulses are discarded;
/// correction of positions: limits; impacts: none.
enum class LawUse { all, plastic, closing, limits, none };

/// A limit of a joint that is struck within a sub-step.
struct Strike {
  double gap;          ///< m or rad, at the start of the part
  double came, comes;  ///< approach before and with the forces of the part, > 0
  int body;            ///< one that moves along; -1: the coordinate is an angle
  int moves;           ///< a body of the law that moves
  double restitution;  ///< of the limit
};

/// Record of what a law of a joint has done in a sub-step.
struct LawState {
  int side = 0;                   ///< sign of the impulse that its bound allows no more of; else 0
  double came = 0, left = 0;      ///< speeds beside the wanted one, where the part began and ended
  double impulse = 0, bound = 0;  ///< N s, N m s
  int body = -1;                  ///< as of Strike
};

/// Contact problems of islands with joints or rolling friction (ConeIslands).
class JointIslands {
 public:
  virtual ~JointIslands() = default;
  /// As BodySolver::solve, which `others` is, for all islands that no joint takes part in. Its
  /// memory has the impulses of all contacts. Joints keep the velocities that they have: v+ - v
  /// satisfies G (v+ - v) = 0.
  virtual void solve(BodySolver& others, const std::vector<RigidBody>& bodies,
                     const std::vector<PointContact>& contacts, BodySolution& out) = 0;
  virtual void set_options(const BodyOptions& options) = 0;
};

/// Who has contact problems of its own, and bodies that it connects.
class IslandMaker {
 public:
  virtual ~IslandMaker() = default;
  std::vector<std::pair<int, int>> links;  ///< connect the bodies of each mechanism
  /// Moments of rolling and torsional friction in the last problem of a step's velocities: one for
  /// each contact, world axes, N m s.
  std::vector<Eigen::Vector3d> moments;
  /// Null: none of its own for this use.
  virtual std::unique_ptr<JointIslands> make_islands(const BodyOptions& options, LawUse laws) = 0;
};

class JointPart : public IslandMaker {
 public:
  std::vector<double> impulses;         ///< of the last sub-step, by row
  std::vector<double> impulses_at_end;  ///< the part of them along the rows at its end
  /// Velocities that predict() has added to bodies that joints hold, for the joints to be met at
  /// the end of the step, beyond velocities that meet them at its start.
  std::vector<Vector6d> bend;
  std::vector<int> under_laws;  ///< bodies of mechanisms that have laws
  double drift = 0;             ///< largest |g| at the end of the last sub-step, m or rad

  virtual bool holds(int body) const = 0;
  /// Bodies that a joint of three rows or more connects pass through each other.
  virtual bool are_joined(int first, int second) const = 0;
  /// Whether there are laws; then contact problems are solved without contacts, too.
  virtual bool has_laws() const = 0;
  /// Whether problems include the laws: not while the bodies of joints wait.
  virtual void set_active(bool active) = 0;
  /// Rolling and torsional friction of contacts, before islands are made.
  virtual void set_rolling(const NearContacts& near) = 0;

  /// Called at the start of a step, before its forces. Positions and velocities that the caller has
  /// changed are put back onto the joints by the least change. Throws std::invalid_argument on
  /// joints that contradict each other.
  virtual void begin(BodySet& bodies, double t) = 0;
  /// Called before the contacts are solved: velocities that meet the joints at the end of the step.
  /// False: none were found, for instance because the step is too long.
  virtual bool predict(BodySet& bodies, double t, double dt) = 0;
  /// Makes the least move back onto the joints if something has moved the bodies since begin().
  virtual void put_back(BodySet& bodies, double t) = 0;
  /// Moves the bodies of the mechanisms to the end of the step. False: it does not meet the joints
  /// to round-off.
  virtual bool move(BodySet& bodies, double t, double dt, const StepContacts& contacts) = 0;
  /// An impact has changed the velocities where the bodies are: `impulses` are those that it takes.
  virtual void take_impact(const std::vector<RigidBody>& before, const BodySet& bodies,
                           const StepContacts& contacts) = 0;

  /// Changes the bounds of laws that depend on the impulses of the last problem of velocities, over
  /// dt. False: they are as they were.
  virtual bool change_bounds(double dt) = 0;
  /// Impulses of the laws in the last sub-step.
  virtual std::vector<double>& law_impulses() = 0;
  /// Velocities that motors and friction of joints have added in the last problem of velocities,
  /// `plastic`: without restitution, before joints pass them on.
  virtual void add_bounded(bool plastic, const BodySet& bodies,
                           std::vector<RigidBody>& change) const = 0;
  /// Impulses of laws on body i are those without restitution and scale(i) of what it adds.
  virtual void scale_restitution(const std::function<double(int)>& scale) = 0;
  virtual void list_laws(std::vector<LawState>& out) const = 0;
  virtual const std::vector<Strike>& strikes() const = 0;
  /// Which steps have to resolve.
  virtual const StepperMemory::Vibration& vibration() const = 0;
  virtual void set_vibration(const StepperMemory::Vibration& vibration) = 0;
};

/// A BodySolver, and JointIslands where there are joints.
class StepSolver {
 public:
  /// maker: null where there are none.
  StepSolver(const BodyOptions& options, IslandMaker* maker, LawUse laws) : solver_(options) {
    if (maker != nullptr) joints_ = maker->make_islands(options, laws);
  }

  void solve(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
             BodySolution& out) {
    if (joints_)
      joints_->solve(solver_, bodies, contacts, out);
    else
      solver_.solve(bodies, contacts, out);
  }
  const BodyOptions& options() const { return solver_.options(); }
  void set_options(const BodyOptions& options) {
    solver_.set_options(options);
    if (joints_) joints_->set_options(options);
  }
  void scale_warm_start(double factor) { solver_.scale_warm_start(factor); }
  void take_back() { solver_.take_back(); }
  void forget() { solver_.forget(); }
  /// Impulses of all contacts.
  WarmStart warm_start() const { return solver_.warm_start(); }
  void set_warm_start(const WarmStart& start) { solver_.set_warm_start(start); }

 private:
  BodySolver solver_;
  std::unique_ptr<JointIslands> joints_;
};

/// Sets of moving bodies that contacts and links connect.
class MovingIslands {
 public:
  explicit MovingIslands(const IslandMaker* maker = nullptr) {
    if (maker != nullptr) links_ = maker->links;
  }

  void join(const BodySet& bodies, const StepContacts& contacts) {
    sets_.reset(bodies.size());
    for (const auto& [first, second] : links_) sets_.join(first, second);
    for (const PointContact& c : contacts.points)
      if (moves(bodies, c.first) && moves(bodies, c.second)) sets_.join(c.first, c.second);
  }
  /// After join(): marks the roots of these bodies.
  void mark(const std::vector<int>& bodies, std::vector<char>& marks, char mark = 1) {
    for (const int i : bodies) marks[static_cast<std::size_t>(root(i))] = mark;
  }
  int root(int body) { return sets_.root(body); }
  /// Island of a contact's bodies, one of which moves.
  int root(const BodySet& bodies, const PointContact& c) {
    return root(moves(bodies, c.first) ? c.first : c.second);
  }

 private:
  static bool moves(const BodySet& bodies, int body) {
    return bodies.mass[static_cast<std::size_t>(body)] > 0;
  }
  linalg::DisjointSets sets_;
  std::vector<std::pair<int, int>> links_;
};

}  // namespace tether::contact::detail

// Tether: the laws of joints in a step, as rows of its contact problems.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <tether/contact/joint_laws.hpp>
#include <tether/contact/stepping.hpp>
#include <vector>

#include "joints/body_cones.hpp"

namespace tether::contact::detail {

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

/// A limit is the cone x >= 0, a bounded law |x| <= bound dt, a sprung one a compliant row.
class LawRows {
 public:
  /// Keeps the velocities at the start of a sub-step, before its forces.
  void remember(const std::vector<Vector6d>& v) { coming_ = v; }
  /// Prepares the laws at the start of the sub-step; v: velocities after its forces.
  void prepare(const std::vector<Vector6d>& v, double dt, const Mechanisms& mechanisms);
  /// A body of the law that moves.
  int moving(int law, const Mechanisms& mechanisms) const;

  JointLaws laws;
  std::vector<double> impulses;  ///< of the last problem of the step's velocities, by law
  std::vector<double> plastic;   ///< of the last one without restitution
  bool active = true;            ///< false: no problem includes them

  std::vector<Strike> strikes;  ///< of limits, in this sub-step

  bool in(LawUse use, int law) const {
    return use == LawUse::all || use == LawUse::plastic || use == LawUse::closing ||
           (use == LawUse::limits && laws[law].is_limit());
  }
  bool any(LawUse use) const { return active && use != LawUse::none && laws.count() > 0; }
  /// Identity in warm starts: one of a contact of a surface with itself, which there is not.
  static std::uint64_t id(int law) { return contact_id(law >> 16, law >> 16, law & 0xffff); }
  /// The cone of a law; with LawUse::limits for a correction of positions.
  BodyCone cone(int law, LawUse use) const;
  /// Starting impulse from that of the last step; null: there is none.
  double start(int law, const Eigen::Vector3d* last) const;
  /// Adds the velocities that motors and friction of joints have added in the last problem of
  /// velocities, `without_restitution`: in that without, before joints pass them on.
  void add_bounded(bool without_restitution, const BodySet& bodies,
                   std::vector<Vector6d>& change) const;
  /// Impulses of laws on body i are those without restitution and scale(i) of what it adds.
  void scale_restitution(const Mechanisms& mechanisms, const std::function<double(int)>& scale);
  /// v: at the end of the sub-step.
  LawState state(int law, const std::vector<Vector6d>& v) const;

 private:
  int at_bound(int law) const;
  int moving_along(int law) const;
  double speed(int law, const std::vector<Vector6d>& v) const;

  std::vector<Vector6d> coming_;
  struct Row {
    double bias = 0, plastic_bias = 0, compliance = 0;
  };
  std::vector<Row> rows_;  // of the laws
  double dt_ = 0;
};

}  // namespace tether::contact::detail

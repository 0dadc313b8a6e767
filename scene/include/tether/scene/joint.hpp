// Tether: joints and their prescribed motions, places in files. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <tether/linalg/eigen.hpp>
#include <utility>
#include <vector>

namespace tether::scene {

/// A place in a file.
struct Place {
  std::string file;          ///< its name
  int line = 0, column = 0;  ///< from 1; line 0: made by a program; column 0: not known
};

/// The words of files for the enumerators of E, which are counted from 0 on.
template <class E, std::size_t n>
constexpr std::array<std::pair<std::string_view, E>, n> in_order(
    const std::string_view (&words)[n]) {
  std::array<std::pair<std::string_view, E>, n> list{};
  for (std::size_t k = 0; k < n; ++k) {
    list[k].first = words[k];
    list[k].second = static_cast<E>(k);
  }
  return list;
}

/// s(t) = rate t + amplitude sin(2 pi frequency t + phase) - amplitude sin(phase), so that s(0) =
/// 0.
struct Motion {
  /// m/s or rad/s; m or rad; Hz; rad.
  double rate = 0, amplitude = 0, frequency = 0, phase = 0;
};

/// Bounds on the angle of a hinge or the way of a slider, which are 0 at t = 0.
struct JointLimits {
  double lower = 0, upper = 0;  ///< rad (a turn apart at most), m
  double restitution = 0;       ///< 0 .. 1
};

/// Drives the speed of a hinge or slider towards `rate`, with at most the force `bound`. With gains
/// the force is -stiffness (s - target - rate t) - damping (s' - rate), at most `bound`, which may
/// be infinite; without them it is what the speed needs.
struct JointMotor {
  double rate = 0, bound = 0;         ///< rad/s, N m; m/s, N
  double stiffness = 0, damping = 0;  ///< N m/rad, N m s/rad; N/m, N s/m
  double target = 0;                  ///< rad, m

  /// Whether it is a controlled drive.
  bool has_gains() const { return stiffness > 0 || damping > 0; }
};

/// The force -stiffness (s - rest) - damping s' along the angle or way s of a hinge or slider. The
/// moment -stiffness turn - damping (angular velocity) of a ball, whose rest is that of t = 0.
struct JointSpring {
  double stiffness = 0, damping = 0;  ///< N m/rad, N m s/rad; N/m, N s/m
  double rest = 0;                    ///< rad, m

  /// In place of them: rows of stretch or speed, above 0, and the force against it, straight
  /// between and constant after them; on the other side the opposite.
  std::vector<std::array<double, 2>> stiffness_table = {}, damping_table = {};
};

/// When a joint holds, and what it bears. It closes as its bodies are at `from`, by an impulse.
struct JointWindow {
  /// The time that does not come, s; the bound that nothing reaches, N, N m.
  static constexpr double kNever = std::numeric_limits<double>::infinity();
  double from = 0, to = kNever;  ///< s
  /// It breaks, for good, where its force or moment (see JointForce) reaches these: N, N m.
  double break_force = kNever, break_moment = kNever;

  /// Whether it can break.
  bool breaks() const { return break_force < kNever || break_moment < kNever; }
};

/// A place and an attitude, world axes.
struct Pose {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();               ///< m
  linalg::Quaternion orientation = linalg::Quaternion::Identity();  ///< unit; body to world
};

/// Couples the angles and ways s of hinges and sliders, which are 0 at t = 0. The sum of weight s
/// is 0, or, of two joints, s_1 = polynomial(s_2), coefficients from degree 1 on.
struct Coupling {
  std::string name;                         ///< for messages
  std::vector<int> joints;                  ///< indices of Scene::joints
  std::vector<double> weights, polynomial;  ///< one for each joint; coefficients; one is empty
  Place place;                              ///< in the file
};

/// Kinds of joints, with 1, 3, 5, 5, 6, 4 and 3 rows on positions.
enum class JointKind : std::uint8_t { distance, ball, hinge, slider, fixed, universal, planar };

/// The words of files for them.
inline constexpr auto kJointWords =
    in_order<JointKind>({"distance", "ball", "hinge", "slider", "fixed", "universal", "planar"});

/// `first` and `second` are indices of bodies, -1 the world. Points and axes in world coordinates
/// at t = 0. A motion prescribes the angle of a hinge (rad, of first against second about axis),
/// the displacement of a slider (m, of first along axis) or the change of a distance (m).
struct Joint {
  JointKind kind = JointKind::ball;                     ///< what it leaves free
  std::string name;                                     ///< for messages and expectations
  int first = -1, second = -1;                          ///< indices of bodies
  Eigen::Vector3d at = Eigen::Vector3d::Zero();         ///< its point, m
  Eigen::Vector3d at_second = Eigen::Vector3d::Zero();  ///< distance only: the point on `second`
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< hinge, slider, universal; planar: normal
  std::optional<double> length;                     ///< distance, m: default the one at t = 0
  std::optional<Motion> motion;                     ///< distance, hinge, slider
  std::optional<JointLimits> limits;                ///< hinge, slider
  std::optional<JointMotor> motor;                  ///< hinge, slider
  std::optional<JointSpring> spring;                ///< hinge, slider, ball
  double friction = 0;  ///< of a hinge or slider: Coulomb's, at most this moment (N m) or force (N)
  Place place;          ///< in the file
  /// Universal only: the arm of the cross on `second`, at right angles to `axis`, that on `first`.
  Eigen::Vector3d axis_second = Eigen::Vector3d::UnitX();
  std::optional<JointWindow> window = {};  ///< absent: it holds always and bears everything
  /// The second body at closing, seen with the first one at its place of t = 0: points and axes are
  /// on it from there. Not of files; absent: as at t = 0.
  std::optional<Pose> closed = {};
};

}  // namespace tether::scene

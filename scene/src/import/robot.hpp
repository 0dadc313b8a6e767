// Tether: a robot as its file has it, before it becomes a scene. SPDX-License-Identifier:
// BSD-3-Clause
//
// Links form a tree. A link's frame at reference is that of its parent times `pose`; its joints
// move it one after the other, the first one next to the parent.
#pragma once

#include <algorithm>
#include <tether/scene/scene.hpp>
#include <tuple>

namespace tether::scene::import {

/// One line for each kind of thing, with the names of all that it concerns.
class Remarks {
 public:
  void add(const std::string& what, const std::string& name = "");
  bool empty() const { return lines_.empty(); }
  /// "what: a, b, c" or "what (3)", in the order of their first appearance.
  std::vector<std::string> lines() const;

 private:
  struct Line {
    std::string what;
    std::vector<std::string> names;
    long count = 0;
  };
  std::vector<Line> lines_;
  std::map<std::string, std::size_t> index_;
};

enum class MotionKind { hinge, slide, ball, free, planar };

/// A joint follows another one: multiplier (its coordinate) + offset.
struct Mimic {
  std::string of;
  double multiplier = 1, offset = 0;
};

/// One joint; its coordinate is the angle (rad) or way (m) that the file means, `reference` where
/// the link stands at `pose`.
struct LinkJoint {
  std::string name;
  MotionKind kind = MotionKind::hinge;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< length 1, in the frame of the link
  Eigen::Vector3d at = Eigen::Vector3d::Zero();     ///< in the frame of the link, m
  std::optional<std::pair<double, double>> limits;
  double reference = 0;
  double friction = 0;                ///< N m, N
  double stiffness = 0, damping = 0;  ///< N/m, N s/m: of slides; N m/rad, N m s: of hinges
  double armature = 0;                ///< kg m^2, kg: inertia of a rotor
  bool is_driven = false;             ///< by an actuator that exerts something
  bool is_summed = false;             ///< in a kept sum
  double rest = 0;                    ///< of the stiffness
  std::optional<Mimic> mimic;
  int line = 0;
};

/// How the surface of a link meets others: MuJoCo's rules, of which a URDF uses the defaults.
struct Touch {
  double friction = 0;
  bool tangential = true;  ///< false: without friction, unless the other one has it
  unsigned type = 1, affinity = 1;
  int own = -1;  ///< a number of a link that passes through some others

  /// Makes this touch whatever touches either of the two.
  void join(const Touch& o) {
    friction = std::max(friction, o.friction);
    tangential = tangential || o.tangential;
    type |= o.type;
    affinity |= o.affinity;
  }
  bool operator<(const Touch& o) const {
    return std::tie(friction, tangential, type, affinity, own) <
           std::tie(o.friction, o.tangential, o.type, o.affinity, o.own);
  }
};

struct Link {
  std::string name;
  int parent = -1;  ///< an earlier link; -1: the world
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::vector<LinkJoint> joints;                      ///< none: welded to its parent
  double mass = 0;                                    ///< kg
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();   ///< m, in the frame of the link
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  ///< about the centre, axes of the link
  std::vector<Shape> shapes;                          ///< that touch, in the frame of the link
  std::optional<Touch> touch;                         ///< none: its shapes touch nothing
  bool scenery = false;                               ///< a thing of the world, not of the robot
  bool is_weighed = true;                             ///< false: the file gives no mass
  int line = 0;
};

/// Two links that are held to each other beside the tree; "world": the world.
struct Closure {
  std::string name, first, second;
  bool weld = false;                             ///< false: at one point
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< in the frame of the first, m
  int line = 0;
};

/// The part of a joint in the length of a fixed tendon, or of what an actuator pulls.
struct Transmission {
  std::string joint;
  double ratio = 1;
};

/// An actuator whose force is (gain control + bias) . (1, length, speed), within bounds.
struct Drive {
  std::string name;
  std::vector<Transmission> to;  ///< none: it pulls at something else
  Eigen::Vector3d gain = Eigen::Vector3d::Zero(), bias = Eigen::Vector3d::Zero();
  std::optional<std::pair<double, double>> control, force;
  bool has_activation = false;  ///< its control acts through a state, which starts at 0
  int line = 0;
};

/// The sum of ratio times coordinate keeps its value.
struct KeptSum {
  std::string name;
  std::vector<Transmission> terms;
};

struct Model {
  std::string name, format;
  std::vector<Link> links;  ///< parents before children
  std::optional<Eigen::Vector3d> gravity;
  double step = 0;              ///< s; 0: not said
  bool base_is_said = true;     ///< false: whether the base is fixed is up to who uses the file
  bool touches_itself = false;  ///< moving links touch each other, but for neighbours in the tree
  bool touches = true;          ///< false: nothing touches anything
  std::vector<Closure> closures;
  std::vector<Drive> drives;
  std::map<std::string, std::vector<Transmission>> tendons;  ///< fixed ones
  std::vector<KeptSum> kept_sums;
  std::vector<std::pair<std::string, std::string>> excluded;  ///< names of links that do not
  Remarks remarks;
};

/// Fixed axes: R = Rz(yaw) Ry(pitch) Rx(roll), rad.
Eigen::Quaterniond from_rpy(const Eigen::Vector3d& rpy);

Eigen::Isometry3d placed(const Eigen::Quaterniond& orientation, const Eigen::Vector3d& position);

/// Shapes must have no larger or smaller numbers: m.
constexpr double kLargestLength = 1e9;

/// The nearest inertia that a body may have: negative and vanishing moments become small ones, then
/// the smaller two of the moments grow alike until they carry the largest.
Eigen::Matrix3d mended_inertia(const Eigen::Matrix3d& inertia);

/// Adds a part to a sum of parts: masses, their common centre, inertias about it.
void add_mass(double mass, const Eigen::Vector3d& centre, const Eigen::Matrix3d& inertia,
              double& total, Eigen::Vector3d& common, Eigen::Matrix3d& sum);

}  // namespace tether::scene::import

// Tether: a robot as its file has it, before it becomes a scene. SPDX-License-Identifier:
// BSD-3-Clause
//
// Links form a tree. A link's frame at reference is that of its parent times `pose`; its joints
// move it one after the other, the first one next to the parent.
#pragma once

#include <algorithm>
#include <tether/scene/scene.hpp>
#include <tuple>

#include "geometry/shape_type.hpp"

namespace tether::scene::import {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using linalg::at;

/// One line for each kind of thing, with the names of all that it concerns.
class Remarks {
 public:
  void add(const std::string& what, const std::string& name = "") {
    const auto [found, is_new] = index_.emplace(what, lines_.size());
    if (is_new) lines_.push_back({what, {}, 0});
    Line& line = lines_[found->second];
    ++line.count;
    if (!name.empty() && line.names.size() < kMostListed) line.names.push_back(name);
  }
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

/// A joint follows another one: multiplier (its coordinate) + offset.
struct Mimic {
  std::string of;
  double multiplier = 1, offset = 0;
};

/// One joint; its coordinate is the angle (rad) or way (m) that the file means, `reference` where
/// the link stands at `pose`.
struct LinkJoint {
  std::string name;
  std::optional<JointKind> kind = JointKind::hinge;  ///< hinge, slider, ball, planar; none: free
  Vector3d axis = Vector3d::UnitZ();                 ///< length 1, in the frame of the link
  Vector3d at = Vector3d::Zero();                    ///< in the frame of the link, m
  std::optional<std::pair<double, double>> limits;
  double reference = 0;
  double friction = 0;                ///< N m, N
  double stiffness = 0, damping = 0;  ///< N/m, N s/m: of slides; N m/rad, N m s: of hinges
  double armature = 0;                ///< kg m^2, kg: inertia of a rotor
  double rest = 0;                    ///< of the stiffness
  std::optional<Mimic> mimic;
  int line = 0;

  bool has_coordinate() const { return kind == JointKind::hinge || kind == JointKind::slider; }
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

/// A part of a robot that weighs and touches as one, in a frame of its own.
struct Matter {
  std::string name;
  int line = 0;
  double mass = 0;                      ///< kg
  Vector3d centre = Vector3d::Zero();   ///< m
  Matrix3d inertia = Matrix3d::Zero();  ///< about the centre
  std::vector<Shape> shapes;            ///< that touch
  std::optional<Touch> touch;           ///< none: its shapes touch nothing

  /// Adds what has its frame at `place`.
  void add(const Matter& part, const Isometry3d& place);
};

struct Link : Matter {
  int parent = -1;  ///< an earlier link; -1: the world
  Isometry3d pose = Isometry3d::Identity();
  std::vector<LinkJoint> joints;  ///< none: welded to its parent
  bool scenery = false;           ///< a thing of the world, not of the robot
  bool is_weighed = true;         ///< false: the file gives no mass
};

/// Two links that are held to each other beside the tree; "world": the world.
struct Closure {
  std::string name, first, second;
  JointKind kind = JointKind::ball;  ///< or fixed
  Vector3d at = Vector3d::Zero();    ///< in the frame of the first, m
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
  std::optional<Vector3d> gain;  ///< none: its control acts through a state, which starts at 0
  Vector3d bias = Vector3d::Zero();
  std::optional<std::pair<double, double>> control, force;
  int line = 0;
};

/// The sum of ratio times coordinate keeps its value.
struct KeptSum {
  std::string name;
  std::vector<Transmission> terms;
};

/// Whether the base of a URDF is fixed is up to who uses it, and its links pass through each other.
/// In MJCF moving links touch each other, but for neighbours in the tree.
enum class Format { urdf, mjcf };

struct Model {
  std::string name;
  Format format = Format::urdf;
  std::vector<Link> links;  ///< parents before children
  std::optional<Vector3d> gravity = Vector3d(0, 0, -9.81);
  double step = 0;      ///< s; 0: not said
  bool touches = true;  ///< false: nothing touches anything
  std::vector<Closure> closures;
  std::vector<Drive> drives;
  std::map<std::string, std::vector<Transmission>> tendons;  ///< fixed ones
  std::vector<KeptSum> kept_sums;
  std::vector<std::pair<std::string, std::string>> excluded;  ///< names of links that do not
  Remarks remarks;
};

Isometry3d placed(const Quaterniond& orientation, const Vector3d& position);

/// Shapes must have no larger or smaller numbers: m.
constexpr double kLargestLength = 1e9;

/// The convex hull of a mesh, but for points that are hardly above it; nothing, with a remark,
/// where it is flat.
std::optional<Shape> hull_of(const Shape& mesh, const std::string& of, Remarks& remarks);

/// Puts convex parts in the place of meshes, or with a remark the hull of one that bounds no solid
/// or needs too many parts, or `as_hulls` of all.
void make_convex(Model& model, bool as_hulls);

}  // namespace tether::scene::import

// Tether: what moves as one. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "import.hpp"
#include "robot.hpp"
#include "xml.hpp"

namespace tether::scene::import {

/// A joint at the start, in world axes.
struct PlacedJoint {
  LinkJoint law;
  Eigen::Vector3d axis, at;
  double value = 0;  ///< of its coordinate, as the file counts it
};

/// Links that are welded to each other, as one body in the frame of the first of them.
struct Part {
  std::string name;
  std::vector<std::string> links;
  std::vector<Eigen::Isometry3d> places;  ///< of the links, in the frame of the first
  int line = 0, parent = -1;              ///< an earlier part; -1: the world
  std::vector<PlacedJoint> joints;        ///< none: fixed
  bool fixed() const { return joints.empty(); }
  bool gone = false;  ///< folded into another one, or left out
  bool scenery = false;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  ///< in the world
  double mass = 0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();   ///< in the frame of the first link
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  ///< about the centre
  std::vector<Shape> shapes;                          ///< in the frame of the first link
  std::optional<Touch> touch;
};

/// Small bodies have this part of the mass or inertia of the one that they carry.
constexpr double kSmallBody = 1e-6;

/// At most, kg m^2.
double inertia_about_joints(const Part& part);

/// Limits that the angle of a hinge of scenes, which is one of all turns, does not tell.
bool has_wide_limits(const LinkJoint& joint);

/// The parts at the start, parents before children. Parts without mass are folded into what hangs
/// on them, or left out where nothing does. Reports parts that no scene can have. Throws
/// std::invalid_argument where an option names a joint that is not there, or asks too much of it.
std::vector<Part> make_parts(Model& model, const ImportOptions& options, Problems& problems);

/// A scene, with a comment for each of its bodies and joints.
struct Draft {
  Scene scene;
  std::vector<std::string> body_comments, joint_comments;
};

/// The force of an actuator is (1, length, speed) . this, before its bounds.
Eigen::Vector3d law_of(const Drive& drive, const ImportOptions& options);

/// Adds couplings, what actuators exert, and bodies for the armature of hinges and sliders.
void add_common_laws(const Model& model, const std::vector<Part>& parts,
                     const ImportOptions& options, Draft& draft, Remarks& remarks);

/// Adds the joints that carry `part`, which is the body `body`, on the body `on` (-1: the world).
/// Several joints without laws are one where scenes have it (universal, ball, planar, none), else
/// small bodies stand between them.
void add_joints(const Part& part, int body, int on, const ImportOptions& options, Draft& draft,
                Remarks& remarks);

Draft make_draft(const Model& model, const std::vector<Part>& parts, const ImportOptions& options,
                 Remarks& remarks);

/// Adds a ball or fixed joint for each closure of the model, at the start. `body_of`: of each part,
/// -1: the world.
void add_closures(const Model& model, const std::vector<Part>& parts,
                  const std::vector<int>& body_of, Draft& draft, Remarks& remarks);

}  // namespace tether::scene::import

// Tether: what moves as one. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "import.hpp"
#include "robot.hpp"
#include "xml.hpp"

namespace tether::scene::import {

/// A joint at the start, its axis and point in world axes.
struct PlacedJoint : LinkJoint {
  double value = 0;  ///< of its coordinate, as the file counts it
};

/// Links that are welded to each other, as one body in the frame of the first of them.
struct Part : Matter {
  std::vector<std::string> links;
  std::vector<Isometry3d> places;   ///< of the links, in the frame of the first
  int parent = -1;                  ///< an earlier part; -1: the world
  std::vector<PlacedJoint> joints;  ///< none: fixed
  bool gone = false;                ///< folded into another one, or left out
  bool scenery = false;
  Isometry3d pose = Isometry3d::Identity();  ///< in the world

  bool fixed() const { return joints.empty(); }
  /// At most, kg m^2.
  double inertia_about_joints() const {
    double out = inertia.cwiseAbs().maxCoeff();
    for (const PlacedJoint& each : joints) out += mass * (each.at - pose * centre).squaredNorm();
    return out;
  }
};

/// Small bodies have this part of the mass or inertia of the one that they carry.
constexpr double kSmallBody = 1e-6;

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

  /// Their numbers.
  int add(Body body, std::string comment) {
    scene.bodies.push_back(std::move(body));
    body_comments.push_back(std::move(comment));
    return static_cast<int>(scene.bodies.size()) - 1;
  }
  int add(Joint joint, std::string comment) {
    scene.joints.push_back(std::move(joint));
    joint_comments.push_back(std::move(comment));
    return static_cast<int>(scene.joints.size()) - 1;
  }
};

/// The force of an actuator is (1, length, speed) . this, before its bounds.
Vector3d law_of(const Drive& drive, const ImportOptions& options);

/// Adds couplings, what actuators exert, and bodies for the armature of hinges and sliders.
void add_common_laws(const Model& model, const std::vector<Part>& parts,
                     const ImportOptions& options, Draft& draft, Remarks& remarks);

Draft make_draft(const Model& model, const std::vector<Part>& parts, const ImportOptions& options,
                 Remarks& remarks);

}  // namespace tether::scene::import

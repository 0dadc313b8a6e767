// Tether: robots of other programs as scenes. SPDX-License-Identifier: BSD-3-Clause
//
// URDF (wiki.ros.org/urdf/XML) and MJCF (mujoco.readthedocs.io, "XML reference").
#pragma once

#include <set>
#include <tether/scene/files.hpp>

namespace tether::scene::import {

enum class Base { as_file, fixed, free };

struct ImportOptions {
  Base base = Base::as_file;  ///< as_file: what an MJCF says; of a URDF: fixed
  double height = 0;          ///< m: the base is raised by this
  std::vector<std::pair<std::string, double>> positions;  ///< of joints: rad, m
  std::set<std::string> held;                             ///< joints that do not move
  std::vector<std::pair<std::string, double>> controls;   ///< of actuators; others: 0
  bool joint_laws = true;                                 ///< limits and friction of joints
  std::optional<double> ground;                           ///< m: the height of a plane to stand on
  std::optional<double> friction;  ///< of all contacts; without: as the file says, 1 in a URDF
  bool mend = false;               ///< inertias that no body has become the nearest ones
  bool hulls = false;              ///< meshes touch as their hulls, in a URDF, too
  /// kg/m^3: links of a URDF without <inertial> weigh as their collision shapes.
  std::optional<double> density;
  /// Folder in or below which the files are that the robot names; empty: that of the robot.
  std::string files;
  double end = 1;  ///< s
};

struct Imported {
  std::string toml;                  ///< the scene, with comments
  std::vector<std::string> remarks;  ///< what was left out or changed, as in its comments
};

/// The scene of a URDF or MJCF, told apart by the root element. Throws SceneError for what is wrong
/// in it, std::invalid_argument for wrong options, and nothing else.
Imported import_robot(std::string_view text, const std::string& file, const ImportOptions& options);

}  // namespace tether::scene::import

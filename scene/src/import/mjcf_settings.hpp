// Tether: settings of an MJCF file, classes of its elements and its meshes.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <set>
#include <string>
#include <tether/linalg/pi.hpp>

#include "robot.hpp"
#include "xml.hpp"

namespace tether::scene::import::mjcf {

enum class InertiaFrom { as_said, geoms, inertial };

struct Settings {
  // <compiler>
  bool degrees = true, autolimits = true;
  std::string euler = "xyz";  ///< lower case: about turned axes, upper case: about fixed ones
  InertiaFrom inertia = InertiaFrom::as_said;
  double total_mass = 0;                ///< kg; 0: as it comes
  int least_group = 0, most_group = 5;  ///< of geoms that have mass
  bool balance_inertia = false;         ///< inertias that no body has are replaced by their mean
  // <default>
  std::set<std::string> outermost{"main"};  ///< names of the class of elements without one, ""
  std::map<std::string, std::map<std::string, Attributes>, std::less<>> classes;  ///< by element
  std::string mesh_folder;              ///< in that of the robot's file, with its /
  std::map<std::string, Shape> meshes;  ///< of <asset>, by name; without points: it has no file
  std::size_t copied = 0;               ///< attributes that classes have from those around them

  double angle(double x) const { return degrees ? x * (linalg::kPi / 180) : x; }
  /// Attributes of elements called `element` (empty: as the node) in a class ("": the outermost).
  /// Reports a class that is not there.
  const Attributes* defaults(const Node& node, const std::string& name, Problems& problems,
                             std::string_view element = {}) const;
};

/// Angles in the unit and sequence of the file.
Eigen::Quaterniond from_euler(const Eigen::Vector3d& angles, const Settings& settings);

/// One of quat, axisangle, euler, xyaxes, zaxis; none: the identity.
Eigen::Quaterniond read_orientation(Tag& tag, const Settings& settings);

/// Reads <compiler>, <option>, <default> and the meshes of <asset> below the root; gravity and step
/// go to the model.
Settings read_settings(const Node& root, Model& model, Problems& problems);

}  // namespace tether::scene::import::mjcf

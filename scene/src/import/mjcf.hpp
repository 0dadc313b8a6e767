// Tether: parts of the reader of MJCF. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <tether/linalg/pi.hpp>

#include "robot.hpp"
#include "xml.hpp"

namespace tether::scene::import::mjcf {

enum class InertiaFrom { as_said, geoms, inertial };

/// The settings of <compiler>, <default> and <asset>.
struct Settings {
  double angle = linalg::kPi / 180;  ///< rad: the unit of angles
  std::string euler = "xyz";  ///< lower case: about carried axes, upper case: about fixed ones
  bool autolimits = true;
  InertiaFrom inertia = InertiaFrom::as_said;
  double total_mass = 0;                ///< kg; 0: as it comes
  int least_group = 0, most_group = 5;  ///< of geoms that have mass
  bool balance_inertia = false;         ///< inertias that no body has are replaced by their mean
  std::set<std::string> outermost{"main"};  ///< names of the class of elements without one, ""
  std::map<std::string, std::map<std::string, Attributes>, std::less<>> classes;  ///< by element
  std::string mesh_folder;              ///< in that of the robot's file, with its /
  std::map<std::string, Shape> meshes;  ///< of <asset>, by name; without points: it has no file
  std::size_t copied = 0;               ///< attributes that classes have from those around them

  /// Attributes of elements called `element` (empty: as the node) in the class of the node, or in
  /// `otherwise` ("": the outermost). Reports a class that is not there.
  const Attributes* defaults(const Node& node, const std::string& otherwise, Problems& problems,
                             std::string_view element = {}) const;
  /// Angles in the unit and sequence of the file.
  Quaterniond from_euler(const Vector3d& angles) const;
  /// One of quat, axisangle, euler, xyaxes, zaxis; none: the identity.
  Quaterniond orientation(Tag& tag) const;
  /// Two numbers, where the attribute `limited` does not leave them out; empty: there are none.
  std::vector<double> range(Tag& tag, const char* key, const char* limited) const {
    const std::string word = tag.word(limited, "auto", {"true", "false", "auto"});
    std::vector<double> range = tag.numbers(key, 2, 2);
    if (word == "false" || (word == "auto" && !autolimits)) range.clear();
    return range;
  }
};

/// The limits that two numbers are; without numbers none. Reports where they are in the wrong
/// order.
std::optional<std::pair<double, double>> limits_of(Tag& tag, const char* key,
                                                   const std::vector<double>& range);

/// Reads <compiler>, <option>, <default> and the meshes of <asset> below the root; gravity and step
/// go to the model.
Settings read_settings(const Node& root, Model& model, Problems& problems);

/// A <geom> of a body in this class, in the frame of the body: without mass where its group has
/// none, < 0 where nobody knows it; of one shape, or of none where nothing that scenes have
/// touches; touching unless its contype and conaffinity say that it never does.
Matter read_geom(const Node& node, const std::string& class_name, const Settings& settings,
                 Problems& problems, Remarks& remarks);

/// Names that an MJCF file gives, by kind. An attribute that names nothing of its kind is wrong.
struct Names {
  explicit Names(Model& model) : bodies{"world"} {
    for (Link& link : model.links) {
      if (!link.scenery) bodies.insert(link.name);
      for (LinkJoint& joint : link.joints) joints.emplace(joint.name, &joint);
    }
  }
  LinkJoint* joint(Tag& tag, const char* key) const;  ///< null: there is none
  void tendon(Tag& tag, const char* key) const;
  void body(Tag& tag, const char* key) const;

  std::map<std::string, LinkJoint*> joints;
  std::set<std::string> bodies, tendons, actuators;
};

/// Names those that act by themselves, which scenes do not have. After all joints.
void read_tendons(const Node& root, const Settings& settings, Names& names, Model& model,
                  Problems& problems);

/// Reads an element below <equality>: connect and weld become closures, joint becomes a mimic,
/// tendon a kept sum. False: it is none of them. After all joints and tendons.
bool read_equality(const Node& node, const Names& names, Model& model, Problems& problems);

/// Reads an element below <actuator>, after all tendons. Another law than an affine one gets a
/// remark.
void read_actuator(const Node& node, const Settings& settings, Names& names, Model& model,
                   Problems& problems);

}  // namespace tether::scene::import::mjcf

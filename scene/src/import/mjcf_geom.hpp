// Tether: geoms of MJCF. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "mjcf_settings.hpp"

namespace tether::scene::import::mjcf {

struct Geom {
  std::string name;
  std::optional<Shape> shape;  ///< none: nothing that scenes have touches
  Touch touch;
  bool touches = true;  ///< false: by its contype and conaffinity it never does
  bool has_mass = true;
  double mass = 0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();   ///< in the frame of the body
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  ///< about the centre, axes of the body
};

/// A <geom> of a body in this class.
Geom read_geom(const Node& node, const std::string& class_name, const Settings& settings,
               Problems& problems, Remarks& remarks);

}  // namespace tether::scene::import::mjcf

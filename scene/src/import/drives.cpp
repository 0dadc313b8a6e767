// Tether: rotors and actuators of imported joints. SPDX-License-Identifier: BSD-3-Clause
//
// Armature a adds a s'^2 / 2 to the kinetic energy, s' being the rate of the joint. That is the
// energy of a wheel with moment of inertia a about an axis at rest, or of a mass a on a level rail,
// which turns or slides as the joint does.
//
// A force f = c - k l - d l' between two bounds, l = r q, is the force r f along q. About the mean
// m of the bounds it is a constant r m and a drive of a scene, whose bounds are opposite:
//
//   -r^2 k (q - r (c - m) / (r^2 k)) - r^2 d q'
#include <fmt/format.h>

#include <cmath>
#include <tether/linalg/pi.hpp>

#include "bounds.hpp"
#include "parts.hpp"

namespace tether::scene::import {

namespace {

using Eigen::Vector3d;

/// A hinge or slider of the draft; `value`: of its coordinate at the start, as the file counts it.
struct PlacedCoordinate {
  std::size_t joint;
  double value;
  const LinkJoint* law;
};
using Coordinates = std::map<std::string, PlacedCoordinate>;

bool has_coordinate(const Joint& joint) {
  return joint.kind == JointKind::hinge || joint.kind == JointKind::slider;
}

Coordinates coordinates_of(const std::vector<Part>& parts, const Draft& draft) {
  std::map<std::string, std::size_t> joints;
  for (std::size_t j = 0; j < draft.scene.joints.size(); ++j)
    if (has_coordinate(draft.scene.joints[j])) joints.emplace(draft.scene.joints[j].name, j);
  Coordinates out;
  for (const Part& part : parts)
    for (const PlacedJoint& placed : part.joints)
      if (const auto found = joints.find(placed.law.name); found != joints.end())
        out.emplace(placed.law.name, PlacedCoordinate{found->second, placed.value, &placed.law});
  return out;
}

void add_rotor(const PlacedCoordinate& of, Draft& draft) {
  Scene& scene = draft.scene;
  const Joint carried = scene.joints[of.joint];
  Body rotor;
  rotor.name = "rotor of " + carried.name;
  rotor.mass = of.law->armature;  // of a hinge: as if 1 m from its axis
  rotor.inertia = of.law->armature * Eigen::Matrix3d::Identity();
  rotor.position = carried.at;
  Joint bearing;
  bearing.kind = carried.kind;
  bearing.name = rotor.name;
  bearing.first = static_cast<int>(scene.bodies.size());
  bearing.at = carried.at;
  bearing.axis = carried.axis;
  if (carried.kind == JointKind::slider)
    bearing.axis = scene.gravity && scene.gravity->norm() > 0 ? scene.gravity->unitOrthogonal()
                                                              : Vector3d::UnitX();
  Coupling coupling;
  coupling.name = rotor.name;
  coupling.joints = {static_cast<int>(scene.joints.size()), static_cast<int>(of.joint)};
  coupling.polynomial = {1};
  scene.bodies.push_back(std::move(rotor));
  scene.joints.push_back(std::move(bearing));
  scene.couplings.push_back(std::move(coupling));
  const std::string comment = fmt::format("line {}, armature", of.law->line);
  draft.body_comments.push_back(comment);
  draft.joint_comments.push_back(comment);
}

/// Along the coordinate, by loads that are constant in the axes of both bodies: those of a slider
/// move against each other along the force only.
void add_constant(const Joint& joint, double force, Scene& scene) {
  const Vector3d along = force * joint.axis.normalized();
  const auto push = [&](int b, const Vector3d& pull, const Vector3d& torque) {
    if (b < 0 || scene.bodies[static_cast<std::size_t>(b)].fixed) return;
    const auto turn = scene.bodies[static_cast<std::size_t>(b)].orientation.conjugate();
    Load load;
    load.body = b;
    load.in_body = true;
    load.force = turn * pull;
    load.torque = turn * torque;
    scene.loads.push_back(std::move(load));
  };
  const Vector3d none = Vector3d::Zero();
  if (joint.kind == JointKind::hinge) {
    push(joint.first, none, along);
    return push(joint.second, none, -along);
  }
  push(joint.first, along, none);
  if (joint.second < 0) return;
  const Vector3d arm = scene.bodies[static_cast<std::size_t>(joint.first)].position -
                       scene.bodies[static_cast<std::size_t>(joint.second)].position;
  push(joint.second, -along, -arm.cross(along));
}

class Driving {
 public:
  Driving(const Coordinates& coordinates, const ImportOptions& options, Draft& draft,
          Remarks& remarks)
      : coordinates_(coordinates), options_(options), scene_(draft.scene), remarks_(remarks) {}

  void add(const Drive& drive) {
    const Vector3d law = law_of(drive, options_);
    if (law.isZero(0)) return remarks_.add("actuators that exert nothing (--control)", drive.name);
    for (const Transmission& to : drive.to)
      if (coordinates_.count(to.joint) == 0)
        return remarks_.add("actuators of what is no hinge or slider here", drive.name);
    if (drive.to.empty())
      return remarks_.add("actuators of other things than joints and fixed tendons", drive.name);
    const auto [lower, upper] = drive.force.value_or(std::pair(-kInfinity, kInfinity));
    if (law[1] == 0 && law[2] == 0) {
      const double force = std::min(std::max(law[0], lower), upper);
      for (const Transmission& to : drive.to)
        if (force * to.ratio != 0)
          add_constant(scene_.joints[coordinates_.at(to.joint).joint], force * to.ratio, scene_);
    } else if (drive.to.size() > 1) {
      remarks_.add("actuators with feedback from several joints", drive.name);
    } else if (law[1] > 0 || law[2] > 0) {
      remarks_.add("actuators with negative stiffness or damping", drive.name);
    } else {
      add_feedback(drive, law, lower, upper);
    }
  }

 private:
  void add_feedback(const Drive& drive, const Vector3d& law, double lower, double upper) {
    const Transmission& to = drive.to.front();
    const PlacedCoordinate& along = coordinates_.at(to.joint);
    Joint& joint = scene_.joints[along.joint];
    if (joint.motor) return remarks_.add("further actuators of a joint", drive.name);
    const double mean = drive.force ? (lower + upper) / 2 : 0, r = to.ratio;
    JointMotor motor;
    motor.bound = std::abs(r) * (upper - lower) / 2;
    motor.stiffness = -r * r * law[1];
    motor.damping = -r * r * law[2];
    if (motor.stiffness > 0)
      motor.target = r * (law[0] - mean) / motor.stiffness - along.value;
    else
      motor.rate = r * (law[0] - mean) / motor.damping;
    if (mean != 0) add_constant(joint, r * mean, scene_);
    joint.motor = motor;
  }

  const Coordinates& coordinates_;
  const ImportOptions& options_;
  Scene& scene_;
  Remarks& remarks_;
};

/// Springs and drives of hinges take the turn that is nearest to their rest, those of MuJoCo all
/// turns: -k (q - rest) is k (rest - m) - k (q - m), m being the middle between the limits.
void keep_turns(Joint& joint, Scene& scene, Remarks& remarks) {
  if (joint.kind != JointKind::hinge) return;
  const auto keep = [&](double stiffness, double& rest, double bound) {
    if (!(stiffness > 0)) return;
    const JointLimits limits = joint.limits.value_or(JointLimits{-kInfinity, kInfinity});
    if (limits.lower >= rest - linalg::kPi && limits.upper <= rest + linalg::kPi) return;
    if (!joint.limits || bound < kInfinity)
      return remarks.add("springs and drives of hinges pull to the nearest of all turns",
                         joint.name);
    const double middle = (limits.lower + limits.upper) / 2;
    add_constant(joint, stiffness * (rest - middle), scene);
    rest = middle;
  };
  if (joint.spring) keep(joint.spring->stiffness, joint.spring->rest, kInfinity);
  if (joint.motor) keep(joint.motor->stiffness, joint.motor->target, joint.motor->bound);
}

}  // namespace

Eigen::Vector3d law_of(const Drive& drive, const ImportOptions& options) {
  double control = 0;
  for (const auto& [name, value] : options.controls)
    if (name == drive.name) control = value;
  if (drive.control)
    control = std::min(std::max(control, drive.control->first), drive.control->second);
  return drive.has_activation ? drive.bias : Vector3d(control * drive.gain + drive.bias);
}

void add_rotors_and_drives(const Model& model, const std::vector<Part>& parts,
                           const ImportOptions& options, Draft& draft, Remarks& remarks) {
  const Coordinates coordinates = coordinates_of(parts, draft);
  Driving driving(coordinates, options, draft, remarks);
  for (const Drive& drive : model.drives) driving.add(drive);
  for (Joint& joint : draft.scene.joints) keep_turns(joint, draft.scene, remarks);
  for (const Part& part : parts)
    for (const PlacedJoint& placed : part.joints) {
      if (!(placed.law.armature > 0)) continue;
      if (const auto found = coordinates.find(placed.law.name); found != coordinates.end())
        add_rotor(found->second, draft);
      else
        remarks.add("armature of what is no hinge or slider here", placed.law.name);
    }
}

}  // namespace tether::scene::import

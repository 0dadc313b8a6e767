// Tether: couplings, actuators and rotors of imported joints. SPDX-License-Identifier: BSD-3-Clause
//
// Armature a adds a q'^2 / 2 to the kinetic energy, q' being the rate of the joint. That is the
// energy of a mass a on a level rail at rest, which the joint moves by 1 m for a radian or metre.
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

/// A hinge or slider of the draft, and what the file says of it.
struct PlacedCoordinate {
  std::size_t joint;
  const PlacedJoint* law;
};
using Coordinates = std::map<std::string, PlacedCoordinate>;

constexpr double kMost = 1e100;  // of the numbers of a scene, whose products are numbers, too
constexpr const char* kBeyond = "actuators whose gains are beyond all numbers";

bool is_number(double x) { return std::abs(x) < kMost; }

// f(part, joint) for each joint of the draft.
template <class F>
void each_joint(const std::vector<Part>& parts, const F& f) {
  for (const Part& part : parts)
    if (!part.gone)  // else its joints are those of another one
      for (const PlacedJoint& placed : part.joints) f(part, placed);
}

Coordinates coordinates_of(const std::vector<Part>& parts, const Draft& draft) {
  std::map<std::string, std::size_t> joints;
  for (std::size_t j = 0; j < draft.scene.joints.size(); ++j) {
    const Joint& joint = draft.scene.joints[j];
    if (joint.kind == JointKind::hinge || joint.kind == JointKind::slider)
      joints.emplace(joint.name, j);
  }
  Coordinates out;
  each_joint(parts, [&](const Part&, const PlacedJoint& placed) {
    if (const auto found = joints.find(placed.name); found != joints.end())
      out.emplace(placed.name, PlacedCoordinate{found->second, &placed});
  });
  return out;
}

/// The joints of these ratios, of one each, as a coupling; null: one of them is not there.
std::optional<Coupling> coupling_of(const std::vector<Transmission>& terms,
                                    const Coordinates& coordinates) {
  Coupling out;
  for (const Transmission& term : terms) {
    const auto found = coordinates.find(term.joint);
    if (found == coordinates.end() || term.ratio == 0 || !is_number(term.ratio)) return {};
    out.joints.push_back(static_cast<int>(found->second.joint));
    out.weights.push_back(term.ratio);
  }
  return out.joints.size() < 2 ? std::nullopt : std::optional<Coupling>(out);
}

void add_couplings(const Model& model, const std::vector<Part>& parts,
                   const Coordinates& coordinates, Scene& scene, Remarks& remarks) {
  each_joint(parts, [&](const Part&, const PlacedJoint& placed) {
    if (!placed.mimic) return;
    const Mimic& mimic = *placed.mimic;
    std::optional<Coupling> coupling =
        coupling_of({{placed.name, 1}, {mimic.of, mimic.multiplier}}, coordinates);
    if (!coupling || mimic.of == placed.name)
      return remarks.add("mimic of joints that are none of their own here", placed.name);
    coupling->name = fmt::format("mimic {}", scene.couplings.size() + 1);
    coupling->weights.clear();
    coupling->polynomial = {mimic.multiplier};
    scene.couplings.push_back(std::move(*coupling));
  });
  for (const KeptSum& sum : model.kept_sums) {
    std::optional<Coupling> coupling = coupling_of(sum.terms, coordinates);
    if (!coupling) {
      remarks.add("equalities of tendons with one joint, or of what is no hinge or slider here",
                  sum.name);
      continue;
    }
    coupling->name = sum.name;
    scene.couplings.push_back(std::move(*coupling));
  }
}

/// Along the coordinate, by loads that are constant in the axes of both bodies: those of a slider
/// move against each other along the force only.
void add_constant(const Joint& joint, double force, Scene& scene) {
  const Vector3d along = force * joint.axis.normalized();
  const auto push = [&](int b, const Vector3d& pull, const Vector3d& torque) {
    if (b < 0 || scene.bodies[at(b)].fixed) return;
    const auto turn = scene.bodies[at(b)].orientation.conjugate();
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
  const Vector3d arm =
      scene.bodies[at(joint.first)].position - scene.bodies[at(joint.second)].position;
  push(joint.second, -along, -arm.cross(along));
}

class Driving {
 public:
  Driving(const Coordinates& coordinates, const ImportOptions& options, Draft& draft,
          Remarks& remarks)
      : coordinates_(coordinates), options_(options), scene_(draft.scene), remarks_(remarks) {}

  void add(const Drive& drive) {
    const Vector3d law = law_of(drive, options_);
    const bool idle =
        !drive.to.empty() && all_of(drive.to, [](const Transmission& to) { return to.ratio == 0; });
    if (law.isZero(0) || idle)
      return remarks_.add("actuators that exert nothing (--control)", drive.name);
    for (const Transmission& to : drive.to)
      if (coordinates_.count(to.joint) == 0)
        return remarks_.add("actuators of what is no hinge or slider here", drive.name);
    if (drive.to.empty())
      return remarks_.add("actuators of other things than joints and fixed tendons", drive.name);
    const auto [lower, upper] = drive.force.value_or(std::pair(-kInfinity, kInfinity));
    if (law[1] == 0 && law[2] == 0) {
      const double force = std::min(std::max(law[0], lower), upper);
      if (!all_of(drive.to, [&](const Transmission& to) { return is_number(force * to.ratio); }))
        return remarks_.add(kBeyond, drive.name);
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
      motor.target = r * (law[0] - mean) / motor.stiffness - along.law->value;
    else
      motor.rate = r * (law[0] - mean) / motor.damping;
    if (!is_number(motor.stiffness) || !is_number(motor.damping) || !is_number(motor.target) ||
        !is_number(motor.rate) || !is_number(r * mean))
      return remarks_.add(kBeyond, drive.name);
    if (mean != 0) add_constant(joint, r * mean, scene_);
    joint.motor = motor;
  }

  const Coordinates& coordinates_;
  const ImportOptions& options_;
  Scene& scene_;
  Remarks& remarks_;
};

/// Whether a hinge leaves the turn in which the angle from `rest` is its own.
bool leaves_turn(const Joint& hinge, double rest) {
  return !hinge.limits || hinge.limits->lower < rest - linalg::kPi ||
         hinge.limits->upper > rest + linalg::kPi;
}

/// The rotor of a hinge or slider, on a level rail: 1 m for a radian, whose turns it counts. Laws
/// that need the count are its own.
class Rotor {
 public:
  Rotor(const PlacedCoordinate& of, bool with_limits, Scene& scene)
      : of_(of), carried_(scene.joints[of.joint]) {
    if (carried_.kind != JointKind::hinge) return;
    const auto take = [&](auto& law, double rest, auto& to) {
      if (!law || !(law->stiffness > 0) || !leaves_turn(carried_, rest)) return;
      to = law;
      law.reset();
    };
    Joint& joint = scene.joints[of.joint];
    take(joint.spring, joint.spring ? joint.spring->rest : 0, rail_.spring);
    take(joint.motor, joint.motor ? joint.motor->target : 0, rail_.motor);
    const PlacedJoint& law = *of.law;
    if (!with_limits || !has_wide_limits(law)) return;
    const double lower = law.limits->first - law.value, upper = law.limits->second - law.value;
    if (lower <= 0 && upper >= 0) rail_.limits = JointLimits{lower, upper, 0};
  }
  bool counts() const { return rail_.spring || rail_.motor || rail_.limits; }

  void add(double mass, Draft& draft) {
    Scene& scene = draft.scene;
    Body body;
    body.name = rail_.name = "rotor of " + carried_.name;
    body.mass = mass;
    body.inertia = mass * Eigen::Matrix3d::Identity();
    body.position = rail_.at = carried_.at;
    rail_.kind = JointKind::slider;
    rail_.first = static_cast<int>(scene.bodies.size());
    const Vector3d down = scene.gravity.value_or(Vector3d::Zero()).stableNormalized();
    rail_.axis = down.norm() > 0 ? down.unitOrthogonal() : Vector3d::UnitX();
    Coupling coupling;
    coupling.name = rail_.name;
    coupling.joints = {static_cast<int>(scene.joints.size()), static_cast<int>(of_.joint)};
    coupling.polynomial = {1};
    scene.couplings.push_back(std::move(coupling));
    const std::string comment = fmt::format("line {}, its coordinate on a rail", of_.law->line);
    draft.add(std::move(body), comment);
    draft.add(std::move(rail_), comment);
  }

 private:
  const PlacedCoordinate& of_;
  Joint carried_, rail_;
};

}  // namespace

Vector3d law_of(const Drive& drive, const ImportOptions& options) {
  double control = 0;
  for (const auto& [name, value] : options.controls)
    if (name == drive.name) control = value;
  if (drive.control)
    control = std::min(std::max(control, drive.control->first), drive.control->second);
  return drive.gain ? Vector3d(control * *drive.gain + drive.bias) : drive.bias;
}

void add_common_laws(const Model& model, const std::vector<Part>& parts,
                     const ImportOptions& options, Draft& draft, Remarks& remarks) {
  const Coordinates coordinates = coordinates_of(parts, draft);
  add_couplings(model, parts, coordinates, draft.scene, remarks);
  Driving driving(coordinates, options, draft, remarks);
  for (const Drive& drive : model.drives) driving.add(drive);
  each_joint(parts, [&](const Part& part, const PlacedJoint& placed) {
    const double armature = placed.armature;
    const auto found = coordinates.find(placed.name);
    if (found == coordinates.end()) {
      if (armature > 0) remarks.add("armature of what is no hinge or slider here", placed.name);
      return;
    }
    Rotor rotor(found->second, options.joint_laws, draft.scene);
    if (rotor.counts() && !(armature > 0))
      remarks.add(fmt::format("small bodies that count turns of hinges, for limits, springs and "
                              "drives ({:g} of the inertia)",
                              kSmallBody),
                  placed.name);
    if (!rotor.counts() && !(armature > 0)) return;
    const double mass = armature > 0 ? armature : kSmallBody * part.inertia_about_joints();
    if (is_number(mass) && mass > 1 / kMost)
      rotor.add(mass, draft);
    else
      remarks.add("rotors whose inertia is beyond 1e100 or below 1e-100", placed.name);
  });
}

}  // namespace tether::scene::import

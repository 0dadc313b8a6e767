// Tether: joints of a robot as joints of a scene. SPDX-License-Identifier: BSD-3-Clause
#include "import/joints.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <tether/linalg/pi.hpp>

namespace tether::scene::import {

namespace {

using Eigen::Vector3d;

constexpr double kFullTurn = 2 * linalg::kPi;
constexpr double kSmallBody = 1e-6;  // of the mass of the body that they carry
constexpr double kNear = 1e-9;       // m: lines this near to each other meet

using Chain = std::vector<PlacedJoint>;

long count(const Chain& chain, MotionKind kind) {
  return std::count_if(chain.begin(), chain.end(),
                       [&](const PlacedJoint& each) { return each.law.kind == kind; });
}

/// Point in which the axes of two hinges meet.
std::optional<Vector3d> crossing(const PlacedJoint& a, const PlacedJoint& b) {
  const Vector3d across = a.axis.cross(b.axis), d = b.at - a.at;
  const double square = across.squaredNorm();
  if (square < 1e-12) return {};
  const Vector3d on_a = a.at + d.cross(b.axis).dot(across) / square * a.axis;
  const Vector3d on_b = b.at + d.cross(a.axis).dot(across) / square * b.axis;
  if (!((on_a - on_b).norm() <= kNear * (1 + d.norm()))) return {};
  return (on_a + on_b) / 2;
}

bool passes(const PlacedJoint& joint, const Vector3d& point) {
  return (point - joint.at).cross(joint.axis).norm() <= kNear * (1 + (point - joint.at).norm());
}

/// The joints as one; `chain` from the parent outwards.
std::optional<Joint> as_one(const Chain& chain) {
  const long hinges = count(chain, MotionKind::hinge), slides = count(chain, MotionKind::slide);
  if (hinges + slides != static_cast<long>(chain.size())) return {};
  Joint out;
  if (hinges == 2 && slides == 0) {
    const auto point = crossing(chain[0], chain[1]);
    if (!point || std::abs(chain[0].axis.dot(chain[1].axis)) > 1e-9) return {};
    out.kind = JointKind::universal;
    out.at = *point;
    out.axis = chain[1].axis;         // carried by the body itself
    out.axis_second = chain[0].axis;  // by the one that it hangs on
    return out;
  }
  if (hinges == 3 && slides == 0) {
    const auto point = crossing(chain[0], chain[1]);
    const double volume = std::abs(chain[0].axis.cross(chain[1].axis).dot(chain[2].axis));
    if (!point || !passes(chain[2], *point) || volume < 1e-3) return {};
    out.kind = JointKind::ball;
    out.at = *point;
    return out;
  }
  if (hinges == 1 && slides == 2) {
    std::vector<Vector3d> ways;
    for (const PlacedJoint& each : chain) {
      if (each.law.kind == MotionKind::slide) ways.push_back(each.axis);
      if (each.law.kind != MotionKind::hinge) continue;
      out.axis = each.axis;
      out.at = each.at;
    }
    if (std::abs(ways[0].dot(out.axis)) > 1e-9 || std::abs(ways[1].dot(out.axis)) > 1e-9 ||
        ways[0].cross(ways[1]).norm() < 1e-3)
      return {};
    out.kind = JointKind::planar;
    return out;
  }
  return {};
}

void name_lost_laws(const Chain& chain, Remarks& remarks) {
  for (const PlacedJoint& each : chain) {
    const LinkJoint& law = each.law;
    if (law.limits) remarks.add("limits of joints that are one joint here", law.name);
    if (law.friction > 0) remarks.add("friction of joints that are one joint here", law.name);
    const bool sprung = law.kind == MotionKind::ball && chain.size() == 1;
    if (law.damping > 0 && !sprung)
      remarks.add("damping of joints that are one joint here", law.name);
    if (law.stiffness > 0 && !sprung)
      remarks.add("stiffness of joints that are one joint here", law.name);
  }
}

std::string names(const Chain& chain) {
  std::string out;
  for (const PlacedJoint& each : chain) out += (out.empty() ? "" : " + ") + each.law.name;
  return out;
}

void add_laws(const PlacedJoint& placed, const ImportOptions& options, Joint& joint,
              std::string& comment, Remarks& remarks) {
  const LinkJoint& law = placed.law;
  if (placed.value != 0) comment += fmt::format("; 0 here is {} there", placed.value);
  if (!options.joint_laws) return;
  joint.friction = law.friction;
  if (!law.limits) return;
  const double lower = law.limits->first - placed.value, upper = law.limits->second - placed.value;
  const bool turns = law.kind == MotionKind::hinge;
  if (turns && !(upper - lower < kFullTurn))
    return remarks.add("limits of a full turn or more", law.name);
  if (!(lower <= 0 && upper >= 0 && lower < upper))
    return remarks.add("limits that the start is beyond", law.name);
  joint.limits = JointLimits{lower, upper, 0};
}

void add_single(const PlacedJoint& placed, int first, int second, const ImportOptions& options,
                Draft& draft, Remarks& remarks) {
  static constexpr std::pair<MotionKind, JointKind> kKinds[] = {
      {MotionKind::hinge, JointKind::hinge},
      {MotionKind::slide, JointKind::slider},
      {MotionKind::ball, JointKind::ball},
      {MotionKind::planar, JointKind::planar}};
  Joint joint;
  for (const auto& [from, to] : kKinds)
    if (from == placed.law.kind) joint.kind = to;
  joint.name = placed.law.name;
  joint.first = first;
  joint.second = second;
  joint.at = placed.at;
  joint.axis = placed.axis;
  std::string comment = fmt::format("line {}", placed.law.line);
  const LinkJoint& law = placed.law;
  const bool one_way = law.kind == MotionKind::hinge || law.kind == MotionKind::slide;
  if (one_way)
    add_laws(placed, options, joint, comment, remarks);
  else
    name_lost_laws({placed}, remarks);
  if ((one_way || law.kind == MotionKind::ball) && (law.stiffness > 0 || law.damping > 0))
    joint.spring = JointSpring{law.stiffness, law.damping, one_way ? law.rest - placed.value : 0};
  draft.scene.joints.push_back(std::move(joint));
  draft.joint_comments.push_back(std::move(comment));
}

/// A body that hardly weighs anything, between two joints of `part`.
int add_between(const Part& part, int body, std::size_t number, Draft& draft) {
  const Body& carried = draft.scene.bodies[static_cast<std::size_t>(body)];
  Body small;
  small.name = fmt::format("{} joint {}", carried.name, number);
  small.mass = kSmallBody * carried.mass;
  small.inertia = kSmallBody * part.inertia.cwiseAbs().maxCoeff() * Eigen::Matrix3d::Identity();
  small.position = carried.position;
  small.orientation = carried.orientation;
  draft.scene.bodies.push_back(std::move(small));
  draft.body_comments.push_back(
      fmt::format("between two joints of \"{}\"; {:g} of its mass", part.name, kSmallBody));
  return static_cast<int>(draft.scene.bodies.size()) - 1;
}

}  // namespace

void add_joints(const Part& part, int body, int on, const ImportOptions& options, Draft& draft,
                Remarks& remarks) {
  const Chain& chain = part.joints;
  if (count(chain, MotionKind::free) > 0) {
    if (chain.size() > 1)
      remarks.add("joints in a row with a free one, which leaves nothing of them", part.name);
    return;
  }
  if (chain.size() == 1) return add_single(chain[0], body, on, options, draft, remarks);
  if (std::optional<Joint> one = as_one(chain)) {
    one->name = names(chain);
    one->first = body;
    one->second = on;
    name_lost_laws(chain, remarks);
    draft.joint_comments.push_back(
        fmt::format("{} joints from line {} on", chain.size(), chain.front().law.line));
    draft.scene.joints.push_back(std::move(*one));
    return;
  }
  remarks.add(fmt::format("small bodies between joints in a row ({:g} of the mass)", kSmallBody),
              part.name);
  int below = on;
  for (std::size_t k = 0; k < chain.size(); ++k) {
    const int above = k + 1 < chain.size() ? add_between(part, body, k + 1, draft) : body;
    add_single(chain[k], above, below, options, draft, remarks);
    below = above;
  }
}

}  // namespace tether::scene::import

// Tether: where the links of a robot stand at the start. SPDX-License-Identifier: BSD-3-Clause
#include "import/start.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <stdexcept>

namespace tether::scene::import {

namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Translation3d;

bool has_coordinate(const LinkJoint& joint) {
  return joint.kind == MotionKind::hinge || joint.kind == MotionKind::slide;
}

/// Refuses names that no joint has.
void check_names(const Model& model, const ImportOptions& options) {
  std::map<std::string, const LinkJoint*> all;
  std::string known;
  for (const Link& link : model.links)
    for (const LinkJoint& joint : link.joints) {
      all[joint.name] = &joint;
      if (all.size() <= 30) known += (known.empty() ? "" : ", ") + joint.name;
    }
  const auto look = [&](const char* option, const std::string& name) {
    const auto found = all.find(name);
    if (found == all.end())
      throw std::invalid_argument(shown(fmt::format(
          "{} {}: no joint that moves has this name; {}{}", option, name,
          known.empty() ? "none does" : "there are " + known, all.size() > 30 ? ", ..." : "")));
    return found->second;
  };
  for (const auto& [name, value] : options.positions) {
    const LinkJoint& joint = *look("--joint", name);
    if (!has_coordinate(joint))
      throw std::invalid_argument(
          fmt::format("--joint {}: is no hinge or slider, whose position is one number", name));
    if (options.joint_laws && joint.limits &&
        !(value >= joint.limits->first && value <= joint.limits->second))
      throw std::invalid_argument(fmt::format("--joint {}={}: its limits are {} and {}", name,
                                              value, joint.limits->first, joint.limits->second));
  }
  for (const std::string& name : options.held) look("--hold", name);
}

const LinkJoint* find_joint(const Model& model, const std::string& name) {
  for (const Link& link : model.links)
    for (const LinkJoint& joint : link.joints)
      if (joint.name == name) return &joint;
  return nullptr;
}

// `depth`: of joints that follow each other in a circle the last one stands as if alone.
double value_of(const LinkJoint& joint, const ImportOptions& options, const Model& model,
                Remarks& remarks, std::size_t depth = 0) {
  for (const auto& [name, value] : options.positions)
    if (name == joint.name) return value;
  if (joint.mimic && depth < model.links.size())
    if (const LinkJoint* of = find_joint(model, joint.mimic->of))
      return joint.mimic->multiplier * value_of(*of, options, model, remarks, depth + 1) +
             joint.mimic->offset;
  if (!joint.limits || !options.joint_laws || !has_coordinate(joint)) return joint.reference;
  const auto [lower, upper] = *joint.limits;
  if (joint.reference < lower || joint.reference > upper)
    remarks.add(
        "joints that start at their nearest limit, since zero lies beyond it (--joint "
        "NAME=VALUE)",
        joint.name);
  return std::min(std::max(joint.reference, lower), upper);
}

Isometry3d moved(const LinkJoint& joint, double way) {
  if (joint.kind == MotionKind::slide) return Isometry3d(Translation3d(way * joint.axis));
  return Translation3d(joint.at) * AngleAxisd(way, joint.axis) * Translation3d(-joint.at);
}

/// Joints that --base gives a link in the world.
std::vector<LinkJoint> base_joints(const Link& link, Base base) {
  if (base == Base::as_file || link.scenery) return link.joints;
  if (base == Base::free) {
    LinkJoint free;
    free.kind = MotionKind::free;
    free.name = "base";
    free.line = link.line;
    return {free};
  }
  std::vector<LinkJoint> out;
  for (const LinkJoint& joint : link.joints)
    if (joint.kind != MotionKind::free) out.push_back(joint);
  return out;
}

}  // namespace

std::vector<LinkStart> starts_of(Model& model, const ImportOptions& options) {
  check_names(model, options);
  std::vector<LinkStart> out;
  for (const Link& link : model.links) {
    LinkStart start;
    start.weld = link.pose;
    const bool base = link.parent < 0;
    Isometry3d pose =
        base ? link.pose : out[static_cast<std::size_t>(link.parent)].pose * link.pose;
    if (base && !link.scenery) pose.pretranslate(Eigen::Vector3d(0, 0, options.height));
    for (const LinkJoint& joint : base ? base_joints(link, options.base) : link.joints) {
      PlacedJoint placed{joint, pose.linear() * joint.axis, pose * joint.at, 0};
      if (has_coordinate(joint)) {
        placed.value = value_of(joint, options, model, model.remarks);
        const double way = placed.value - joint.reference;
        // Turning by nothing would only add rounding.
        if (way != 0) {
          const Isometry3d motion = moved(joint, way);
          pose = pose * motion;
          start.weld = start.weld * motion;
        }
      }
      const bool has_no_range = options.joint_laws && has_coordinate(joint) && joint.limits &&
                                joint.limits->first == joint.limits->second;
      if (options.held.count(joint.name) == 0 && !has_no_range)
        start.joints.push_back(std::move(placed));
    }
    start.pose = pose;
    out.push_back(std::move(start));
  }
  return out;
}

}  // namespace tether::scene::import

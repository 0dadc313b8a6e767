// Tether: closures of loops as joints of a scene. SPDX-License-Identifier: BSD-3-Clause
#include "parts.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tether::scene::import {

namespace {

struct Side {
  bool found = false;
  int body = -1;  // -1: the world
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
};

Side side_of(const std::string& link, const std::vector<Part>& parts,
             const std::vector<int>& body_of) {
  if (link == "world") return {true};
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const Part& part = parts[k];
    const auto found = std::find(part.links.begin(), part.links.end(), link);
    if (found == part.links.end() || part.gone || part.scenery) continue;
    const auto place = static_cast<std::size_t>(found - part.links.begin());
    return {true, body_of[k], part.pose * part.places[place]};
  }
  return {};
}

}  // namespace

void add_closures(const Model& model, const std::vector<Part>& parts,
                  const std::vector<int>& body_of, Draft& draft, Remarks& remarks) {
  const auto is_held = [&](int body) {
    return body < 0 || draft.scene.bodies[static_cast<std::size_t>(body)].fixed;
  };
  for (const Closure& each : model.closures) {
    const Side first = side_of(each.first, parts, body_of);
    const Side second = side_of(each.second, parts, body_of);
    if (!first.found || !second.found || first.body == second.body ||
        (is_held(first.body) && is_held(second.body))) {
      remarks.add("equalities of bodies that are not there, or do not move against each other",
                  each.name);
      continue;
    }
    Joint joint;
    joint.kind = each.weld ? JointKind::fixed : JointKind::ball;
    joint.name = each.name;
    joint.first = first.body;
    joint.second = second.body;
    joint.at = first.pose * each.at;
    if (joint.first < 0) std::swap(joint.first, joint.second);
    draft.scene.joints.push_back(std::move(joint));
    draft.joint_comments.push_back(fmt::format("line {}, closes a loop", each.line));
  }
  const auto is_moved = [](const Part& part) {
    return any_of(part.joints, [](const PlacedJoint& joint) {
      return joint.value != joint.law.reference &&
             (joint.law.kind == MotionKind::hinge || joint.law.kind == MotionKind::slide);
    });
  };
  if (!model.closures.empty() && any_of(parts, is_moved))
    remarks.add("loops are closed where the joints start, not where the file has them at zero");
}

}  // namespace tether::scene::import

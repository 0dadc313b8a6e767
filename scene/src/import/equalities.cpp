// Tether: <equality> of MJCF. SPDX-License-Identifier: BSD-3-Clause
//
// An equality of two joints, y - y0 = a0 + a1 (x - x0), is y = a1 x + (y0 + a0 - a1 x0).
#include "xml.hpp"

#include <algorithm>

namespace tether::scene::import {

namespace {

void must_exist(bool exists, Tag& tag, const char* key, const char* kind) {
  if (tag.has(key) && !exists) tag.wrong(key, fmt::format("there is no such {}", kind));
}

// Softness of the solver, which rows do not have, and classes, which have nothing else here.
void finish(Tag& tag, Model& model) {
  tag.finish(model.remarks, {"name", "class", "solref", "solimp", "active", "torquescale"});
}

void read_joints(Tag& tag, const std::string& name, const Names& names, Model& model) {
  LinkJoint* const first = names.joint(tag, "joint1");
  LinkJoint* const second = names.joint(tag, "joint2");
  std::vector<double> a = tag.numbers("polycoef", 1, 5);
  finish(tag, model);
  if (a.empty()) a = {0, 1};
  a.resize(5, 0.0);
  if (a[2] != 0 || a[3] != 0 || a[4] != 0)
    return model.remarks.add("equalities of joints by polynomials of degree 2 to 4", name);
  if (first == nullptr || second == nullptr || first == second)
    return model.remarks.add("equalities of one joint", name);
  if (first->mimic) return model.remarks.add("second equalities of a joint", name);
  first->mimic = Mimic{second->name, a[1], first->reference + a[0] - a[1] * second->reference};
}

// The lengths of fixed tendons, y - y0 = a0 + a1 (x - x0), as they start.
void read_tendons(Tag& tag, const std::string& name, const Names& names, Model& model) {
  for (const char* key : {"tendon1", "tendon2"}) names.tendon(tag, key);
  const auto first = model.tendons.find(tag.text("tendon1")),
             second = model.tendons.find(tag.text("tendon2"));
  const bool has_second = tag.has("tendon2"), none = first == model.tendons.end();
  std::vector<double> a = tag.numbers("polycoef", 1, 5);
  finish(tag, model);
  if (a.empty()) a = {0, 1};
  a.resize(5, 0.0);
  if (none || (has_second && second == model.tendons.end()))
    return model.remarks.add("equalities of tendons that are not fixed ones", name);
  if (a[0] != 0 || (has_second && (a[2] != 0 || a[3] != 0 || a[4] != 0)))
    return model.remarks.add("equalities of tendons with a constant or of degree 2 to 4", name);
  std::map<std::string, double> ratios;
  for (const Transmission& each : first->second) ratios[each.joint] += each.ratio;
  if (has_second)
    for (const Transmission& each : second->second) ratios[each.joint] -= a[1] * each.ratio;
  KeptSum out{name, {}};
  for (const auto& [joint, ratio] : ratios)
    if (ratio != 0) out.terms.push_back({joint, ratio});
  model.kept_sums.push_back(std::move(out));
}

// 0 0 0 and a quaternion of zeros, or nothing: the bodies keep their places.
bool is_said(const std::vector<double>& place) {
  return place.size() == 7 &&
         std::any_of(place.begin() + 3, place.end(), [](double x) { return x != 0; });
}

void read_closure(Tag& tag, bool weld, const std::string& name, const Names& names, Model& model) {
  for (const char* key : {"body1", "body2"}) names.body(tag, key);
  if (tag.has("site1") || tag.has("site2"))
    return model.remarks.add("equalities between sites", name);
  Closure out;
  out.name = name;
  out.line = tag.line();
  out.weld = weld;
  out.first = tag.text("body1");
  out.second = tag.text("body2", "world");
  if (out.first.empty()) tag.missing("body1", "the name of a body");
  if (!weld && !tag.has("anchor")) tag.missing("anchor", "a point of body1, m");
  out.at = tag.vector("anchor", Eigen::Vector3d::Zero());
  if (weld) {
    if (is_said(tag.numbers("relpose", 7, 7)))
      model.remarks.add("relpose of welds, which hold the bodies as they start", name);
    std::swap(out.first, out.second);  // the anchor is of body2
  }
  finish(tag, model);
  model.closures.push_back(std::move(out));
}

}  // namespace

Names::Names(Model& model) : bodies{"world"} {
  for (Link& link : model.links) {
    if (!link.scenery) bodies.insert(link.name);
    for (LinkJoint& joint : link.joints) joints.emplace(joint.name, &joint);
  }
}

LinkJoint* Names::joint(Tag& tag, const char* key) const {
  const auto found = joints.find(tag.text(key));
  must_exist(found != joints.end(), tag, key, "joint");
  return found == joints.end() ? nullptr : found->second;
}

void Names::tendon(Tag& tag, const char* key) const {
  must_exist(tendons.count(tag.text(key)) > 0, tag, key, "tendon");
}

void Names::body(Tag& tag, const char* key) const {
  must_exist(bodies.count(tag.text(key)) > 0, tag, key, "body");
}

bool read_equality(const Node& node, const Names& names, Model& model, Problems& problems) {
  const bool weld = is(node, "weld"), joints = is(node, "joint"), tendons = is(node, "tendon");
  if (!weld && !joints && !tendons && !is(node, "connect")) return false;
  Tag tag(node, problems);
  const std::string name = tag.has("name") ? tag.name("name", "")
                                           : std::string(node.Name()) + " of " + name_or_line(node);
  if (!tag.flag("active", true))
    model.remarks.add("equalities that are not active", name);
  else if (joints)
    read_joints(tag, name, names, model);
  else if (tendons)
    read_tendons(tag, name, names, model);
  else
    read_closure(tag, weld, name, names, model);
  return true;
}

}  // namespace tether::scene::import

// Tether: equalities, actuators and tendons of MJCF. SPDX-License-Identifier: BSD-3-Clause
//
// An equality of two joints or tendons, y - y0 = a0 + a1 (x - x0), is y = a1 x + (y0 + a0 - a1 x0).
//
// The force of an actuator is gain(l, l') u + bias(l, l'), both affine, u the control or what the
// activation makes of it, which starts at 0. l is the length of its transmission.
#include <fmt/format.h>

#include <algorithm>

#include "mjcf.hpp"

namespace tether::scene::import::mjcf {

namespace {

void must_exist(bool exists, Tag& tag, const char* key, const char* kind) {
  if (tag.has(key) && !exists) tag.wrong(key, fmt::format("there is no such {}", kind));
}

// Softness of the solver, which rows do not have, and classes, which have nothing else here.
void finish(Tag& tag, Model& model) {
  tag.finish(model.remarks, {"name", "class", "solref", "solimp", "active", "torquescale"});
}

/// The coefficients of an equality, of degree 0 to 4.
std::vector<double> read_polynomial(Tag& tag, Model& model) {
  std::vector<double> a = tag.numbers("polycoef", 1, 5);
  finish(tag, model);
  if (a.empty()) a = {0, 1};
  a.resize(5, 0.0);
  return a;
}
bool is_straight(const std::vector<double>& a) { return a[2] == 0 && a[3] == 0 && a[4] == 0; }

void equate_joints(Tag& tag, const std::string& name, const Names& names, Model& model) {
  LinkJoint* const first = names.joint(tag, "joint1");
  LinkJoint* const second = names.joint(tag, "joint2");
  const std::vector<double> a = read_polynomial(tag, model);
  if (!is_straight(a))
    return model.remarks.add("equalities of joints by polynomials of degree 2 to 4", name);
  if (first == nullptr || second == nullptr || first == second)
    return model.remarks.add("equalities of one joint", name);
  if (first->mimic) return model.remarks.add("second equalities of a joint", name);
  first->mimic = Mimic{second->name, a[1], first->reference + a[0] - a[1] * second->reference};
}

/// The lengths of fixed tendons, as they start.
void equate_tendons(Tag& tag, const std::string& name, const Names& names, Model& model) {
  for (const char* key : {"tendon1", "tendon2"}) names.tendon(tag, key);
  const auto first = model.tendons.find(tag.text("tendon1")),
             second = model.tendons.find(tag.text("tendon2"));
  const bool has_second = tag.has("tendon2"), none = first == model.tendons.end();
  const std::vector<double> a = read_polynomial(tag, model);
  if (none || (has_second && second == model.tendons.end()))
    return model.remarks.add("equalities of tendons that are not fixed ones", name);
  if (a[0] != 0 || (has_second && !is_straight(a)))
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

void read_closure(Tag& tag, JointKind kind, const std::string& name, const Names& names,
                  Model& model) {
  for (const char* key : {"body1", "body2"}) names.body(tag, key);
  if (tag.has("site1") || tag.has("site2"))
    return model.remarks.add("equalities between sites", name);
  const bool weld = kind == JointKind::fixed;
  Closure out;
  out.name = name;
  out.line = tag.line();
  out.kind = kind;
  out.first = tag.text("body1");
  out.second = tag.text("body2", "world");
  if (out.first.empty()) tag.missing("body1", "the name of a body");
  if (!weld && !tag.has("anchor")) tag.missing("anchor", "a point of body1, m");
  out.at = tag.vector("anchor", Vector3d::Zero());
  if (weld) {
    if (is_said(tag.numbers("relpose", 7, 7)))
      model.remarks.add("relpose of welds, which hold the bodies as they start", name);
    std::swap(out.first, out.second);  // the anchor is of body2
  }
  finish(tag, model);
  model.closures.push_back(std::move(out));
}

Vector3d first_three(const std::vector<double>& v, double otherwise) {
  Vector3d out(otherwise, 0, 0);
  std::copy_n(v.begin(), std::min<std::size_t>(v.size(), 3), out.data());
  return out;
}

Vector3d read_law(Tag& tag, const char* type, const char* numbers, const char* constant,
                  double otherwise) {
  const std::string kind = tag.text(type, constant);
  const Vector3d read = first_three(tag.numbers(numbers, 1, 10), otherwise);
  if (kind == "affine") return read;
  if (kind == "fixed") return {read[0], 0, 0};
  return Vector3d::Zero();
}

/// False where the law is another one.
bool read_laws(Tag& tag, const std::string& kind, Drive& out) {
  Vector3d gain = Vector3d::UnitX();
  const std::string activation = tag.text("dyntype", kind == "cylinder"      ? "filter"
                                                     : kind == "intvelocity" ? "integrator"
                                                                             : "none");
  if (kind == "general") {
    const auto is_one = [&](const char* key, const char* otherwise,
                            std::initializer_list<std::string_view> known) {
      return contains(known, tag.text(key, otherwise));
    };
    if (!is_one("gaintype", "fixed", {"fixed", "affine"}) ||
        !is_one("biastype", "none", {"none", "affine"}) ||
        !is_one("dyntype", "none", {"none", "integrator", "filter", "filterexact"}))
      return false;
    gain = read_law(tag, "gaintype", "gainprm", "fixed", 1);
    out.bias = read_law(tag, "biastype", "biasprm", "none", 0);
    tag.numbers("dynprm", 1, 10);
  } else if (kind == "position" || kind == "intvelocity") {
    const double kp = tag.not_negative("kp", 1);
    gain[0] = kp;
    out.bias = {0, -kp, -tag.not_negative("kv", 0)};
  } else if (kind == "velocity") {
    gain[0] = tag.not_negative("kv", 1);
    out.bias[2] = -gain[0];
  } else if (kind == "damper") {
    gain = {0, 0, -tag.not_negative("kv", 1)};
  } else if (kind == "cylinder") {
    const double d = tag.number("diameter", 0);
    gain[0] = d > 0 ? linalg::kPi * d * d / 4 : tag.number("area", 1);
    out.bias = first_three(tag.numbers("bias", 3, 3), 0);
    tag.number("timeconst", 1);
  } else if (kind != "motor") {
    return false;
  }
  if (activation == "none") out.gain = gain;
  return true;
}

/// The joints that it pulls; none: it pulls something else.
std::vector<Transmission> read_transmission(Tag& tag, const Names& names, const Model& model) {
  const std::vector<double> gear = tag.numbers("gear", 1, 6);
  const double ratio = gear.empty() ? 1 : gear[0];
  std::vector<Transmission> out;
  for (const char* key : {"joint", "jointinparent"}) {
    names.joint(tag, key);
    if (out.empty() && tag.has(key)) out.push_back({tag.text(key), ratio});
  }
  names.tendon(tag, "tendon");
  const auto found = model.tendons.find(tag.text("tendon"));
  if (!out.empty() || found == model.tendons.end()) return out;
  out = found->second;
  for (Transmission& each : out) each.ratio *= ratio;
  return out;
}

/// Names tell elements of a kind apart.
void take_name(const Node& node, std::set<std::string>& names, Problems& problems) {
  const char* const name = node.Attribute("name");
  if (name != nullptr && *name != '\0' && !names.insert(name).second)
    problems.add(node, "name", "another one has it already");
}

}  // namespace

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
    equate_joints(tag, name, names, model);
  else if (tendons)
    equate_tendons(tag, name, names, model);
  else
    read_closure(tag, weld ? JointKind::fixed : JointKind::ball, name, names, model);
  return true;
}

void read_tendons(const Node& root, const Settings& settings, Names& names, Model& model,
                  Problems& problems) {
  for (const Node* section : elements(root, "tendon"))
    for (const Node* each : elements(*section)) {
      Tag tag(*each, problems, settings.defaults(*each, "", problems, "tendon"));
      const std::string name = name_or_line(*each);
      take_name(*each, names.tendons, problems);
      bool acts = tag.text("limited", "auto") != "false" && tag.has("range");
      for (const char* key : {"stiffness", "damping", "frictionloss", "armature"})
        acts = tag.number(key, 0) != 0 || acts;
      model.remarks.add(acts ? "tendons with stiffness, damping, friction, armature or limits"
                             : "tendons without a force of their own",
                        name);
      if (!is(*each, "fixed")) continue;
      for (const Node* part : elements(*each, "joint")) {
        Tag of(*part, problems);
        names.joint(of, "joint");
        model.tendons[name].push_back({of.text("joint"), of.number("coef", 1)});
      }
    }
}

void read_actuator(const Node& node, const Settings& settings, Names& names, Model& model,
                   Problems& problems) {
  take_name(node, names.actuators, problems);
  // Classes have one set of attributes for all kinds of actuators.
  Attributes defaults;
  for (const char* each : {node.Name(), "general"})
    if (const Attributes* of = settings.defaults(node, "", problems, each))
      defaults.insert(of->begin(), of->end());
  Tag tag(node, problems, &defaults);
  Drive out;
  out.name = name_or_line(node);
  out.line = node.GetLineNum();
  if (!read_laws(tag, node.Name(), out))
    return model.remarks.add(fmt::format("actuators of kind {}", node.Name()), out.name);
  out.control = limits_of(tag, "ctrlrange", settings.range(tag, "ctrlrange", "ctrllimited"));
  out.force = limits_of(tag, "forcerange", settings.range(tag, "forcerange", "forcelimited"));
  out.to = read_transmission(tag, names, model);
  tag.finish(model.remarks, {"name", "class", "group", "user", "tendon", "gaintype", "biastype",
                             "gainprm", "biasprm", "dynprm", "lengthrange"});
  model.drives.push_back(std::move(out));
}

}  // namespace tether::scene::import::mjcf

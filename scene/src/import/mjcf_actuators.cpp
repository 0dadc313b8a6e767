// Tether: actuators and tendons of MJCF. SPDX-License-Identifier: BSD-3-Clause
//
// The force of an actuator is gain(l, l') u + bias(l, l'), both affine, u the control or what the
// activation makes of it, which starts at 0. l is the length of its transmission.
#include "mjcf_actuators.hpp"

#include <fmt/format.h>

namespace tether::scene::import::mjcf {

namespace {

Eigen::Vector3d first_three(const std::vector<double>& v, double otherwise) {
  Eigen::Vector3d out(otherwise, 0, 0);
  for (std::size_t k = 0; k < std::min<std::size_t>(v.size(), 3); ++k)
    out[static_cast<Eigen::Index>(k)] = v[k];
  return out;
}

Eigen::Vector3d read_law(Tag& tag, const char* type, const char* numbers, const char* constant,
                         double otherwise) {
  const std::string kind = tag.text(type, constant);
  const Eigen::Vector3d read = first_three(tag.numbers(numbers, 1, 10), otherwise);
  if (kind == "affine") return read;
  if (kind == "fixed") return {read[0], 0, 0};
  return Eigen::Vector3d::Zero();
}

std::string activation(Tag& tag, const std::string& kind) {
  return tag.text("dyntype", kind == "cylinder"      ? "filter"
                             : kind == "intvelocity" ? "integrator"
                                                     : "none");
}

/// False where the law is another one.
bool read_laws(Tag& tag, const std::string& kind, Drive& out) {
  out.has_activation = activation(tag, kind) != "none";
  out.gain = {1, 0, 0};
  out.bias.setZero();
  if (kind == "general") {
    const std::string gain = tag.text("gaintype", "fixed"), bias = tag.text("biastype", "none"),
                      way = tag.text("dyntype", "none");
    if ((gain != "fixed" && gain != "affine") || (bias != "none" && bias != "affine") ||
        (way != "none" && way != "integrator" && way != "filter" && way != "filterexact"))
      return false;
    out.gain = read_law(tag, "gaintype", "gainprm", "fixed", 1);
    out.bias = read_law(tag, "biastype", "biasprm", "none", 0);
    tag.numbers("dynprm", 1, 10);
  } else if (kind == "position" || kind == "intvelocity") {
    const double kp = tag.not_negative("kp", 1);
    out.gain[0] = kp;
    out.bias = {0, -kp, -tag.not_negative("kv", 0)};
  } else if (kind == "velocity") {
    out.gain[0] = tag.not_negative("kv", 1);
    out.bias[2] = -out.gain[0];
  } else if (kind == "damper") {
    out.gain = {0, 0, -tag.not_negative("kv", 1)};
  } else if (kind == "cylinder") {
    const double d = tag.number("diameter", 0);
    out.gain[0] = d > 0 ? linalg::kPi * d * d / 4 : tag.number("area", 1);
    out.bias = first_three(tag.numbers("bias", 3, 3), 0);
    tag.number("timeconst", 1);
  } else {
    return kind == "motor";
  }
  return true;
}

std::optional<std::pair<double, double>> read_range(Tag& tag, const char* key, const char* limited,
                                                    const Settings& settings) {
  const std::string word = tag.text(limited, "auto");
  if (word != "auto" && word != "true" && word != "false")
    tag.wrong(limited, "must be true, false or auto");
  const std::vector<double> range = tag.numbers(key, 2, 2);
  if (word == "false" || (word == "auto" && !settings.autolimits) || range.empty()) return {};
  if (!(range[0] < range[1])) {
    tag.wrong(key, "must be two numbers, the smaller one first");
    return {};
  }
  return std::pair{range[0], range[1]};
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
    problems.add(node.GetLineNum(), path(node) + ": name", "", "another one has it already");
}

}  // namespace

void read_tendons(const Node& root, const Settings& settings, Names& names, Model& model,
                  Problems& problems) {
  for (const Node* section = root.FirstChildElement("tendon"); section != nullptr;
       section = section->NextSiblingElement("tendon"))
    for (const Node* each = section->FirstChildElement(); each != nullptr;
         each = each->NextSiblingElement()) {
      Tag own(*each, problems);
      Tag tag(*each, problems, settings.defaults(*each, own.text("class"), problems, "tendon"));
      const std::string name = name_or_line(*each);
      take_name(*each, names.tendons, problems);
      bool acts = tag.text("limited", "auto") != "false" && tag.has("range");
      for (const char* key : {"stiffness", "damping", "frictionloss", "armature"})
        acts = tag.number(key, 0) != 0 || acts;
      model.remarks.add(acts ? "tendons with stiffness, damping, friction, armature or limits"
                             : "tendons without a force of their own",
                        name);
      if (!is(*each, "fixed")) continue;
      for (const Node* part = each->FirstChildElement("joint"); part != nullptr;
           part = part->NextSiblingElement("joint")) {
        Tag of(*part, problems);
        names.joint(of, "joint");
        model.tendons[name].push_back({of.text("joint"), of.number("coef", 1)});
      }
    }
}

void read_actuator(const Node& node, const Settings& settings, Names& names, Model& model,
                   Problems& problems) {
  take_name(node, names.actuators, problems);
  const std::string kind = node.Name();
  Tag own(node, problems);
  const std::string of_class = own.text("class");
  // Classes have one set of attributes for all kinds of actuators.
  Attributes defaults;
  for (const char* each : {node.Name(), "general"})
    if (const Attributes* of = settings.defaults(node, of_class, problems, each))
      defaults.insert(of->begin(), of->end());
  Tag tag(node, problems, &defaults);
  Drive out;
  out.name = name_or_line(node);
  out.line = node.GetLineNum();
  if (!read_laws(tag, kind, out))
    return model.remarks.add(fmt::format("actuators of kind {}", kind), out.name);
  out.control = read_range(tag, "ctrlrange", "ctrllimited", settings);
  out.force = read_range(tag, "forcerange", "forcelimited", settings);
  out.to = read_transmission(tag, names, model);
  tag.finish(model.remarks, {"name", "class", "group", "user", "tendon", "gaintype", "biastype",
                             "gainprm", "biasprm", "dynprm", "lengthrange"});
  model.drives.push_back(std::move(out));
}

}  // namespace tether::scene::import::mjcf

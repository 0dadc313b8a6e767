// Tether: reads MJCF. SPDX-License-Identifier: BSD-3-Clause
//
// Bodies stand inside each other; a body without joints is welded to the one around it, one with
// several moves by them in turn. Things of the world that touch become links of their own.
#include "mjcf.hpp"

#include <fmt/format.h>

#include <cmath>
#include <tether/linalg/symmetric_eigen.hpp>

#include "bounds.hpp"

namespace tether::scene::import {

namespace {

using mjcf::InertiaFrom;
using mjcf::Names;
using mjcf::Settings;

/// Elements have a class from those around them, and from <frame> and <replicate> a place in the
/// frame of their link and an end of their names.
struct Around {
  std::string class_name;
  Isometry3d frame = Isometry3d::Identity();
  std::string suffix = {};
};

bool is_joint(const Node& node) { return is(node, "joint") || is(node, "freejoint"); }

class Reader {
 public:
  Reader(Model& model, const Settings& settings, Problems& problems)
      : model_(model), settings_(settings), problems_(problems) {}

  void world(const Node& node) {
    Tag tag(node, problems_);
    children(node, -1, {tag.text("childclass")});
    tag.finish(model_.remarks, {"name"});
  }

 private:
  void children(const Node& node, int of, const Around& around) {
    // Geoms last: whether they give mass is known then.
    for (const Node* each : elements(node))
      if (of >= 0 && is_joint(*each))
        joint(*each, of, around);
      else if (of >= 0 && is(*each, "inertial"))
        inertial(*each, of);
    for (const Node* each : elements(node, "geom")) geom(*each, of, around);
    for (const Node* each : elements(node)) child(*each, of, around);
  }
  void child(const Node& node, int of, const Around& around) {
    if (is(node, "geom") || (of >= 0 && (is_joint(node) || is(node, "inertial")))) return;  // read
    if (is(node, "body")) return body(node, of, around);
    if (is(node, "frame")) return frame(node, of, around);
    if (is(node, "replicate")) return replicate(node, of, around);
    if (is(node, "light") || is(node, "camera") || is(node, "site"))
      return model_.remarks.add(fmt::format("<{}>", node.Name()));
    if (is(node, "composite") || is(node, "flexcomp") || is(node, "attach"))
      return problems_.add(
          node, "",
          "is not read; MuJoCo writes the model without it (mj_saveLastXML, or save "
          "in its viewer)");
    model_.remarks.add(fmt::format("<{}> in <{}>", node.Name(), node.Parent()->Value()),
                       name_or_line(node));
  }
  void frame(const Node& node, int of, Around around) {
    Tag tag(node, problems_);
    const Vector3d at = tag.vector("pos", Vector3d::Zero());
    around.frame = around.frame * placed(settings_.orientation(tag), at);
    around.class_name = tag.text("childclass", around.class_name);
    tag.finish(model_.remarks, {"name"});
    children(node, of, around);
  }
  /// As in MuJoCo copy k is turned by k times the angles, and lies by the offset of copy k - 1 from
  /// that; its number has the digits of the count.
  void replicate(const Node& node, int of, const Around& around) {
    Tag tag(node, problems_);
    const double count = tag.positive("count", 1);
    if (count != std::floor(count) || count > kMostListed)
      return tag.wrong("count", fmt::format("must be a whole number of at most {}", kMostListed));
    const Vector3d offset = tag.vector("offset", Vector3d::Zero()),
                   angles = tag.vector("euler", Vector3d::Zero());
    Around copy = around;
    copy.class_name = tag.text("childclass", around.class_name);
    const std::string separator = tag.text("sep");
    if (!files::is_name("x" + separator) || separator.size() + around.suffix.size() > kLongestName)
      return tag.wrong("sep", std::string("must be part of a name: it ") + files::kName);
    tag.finish(model_.remarks);
    const std::size_t digits = fmt::format("{}", count).size();
    Vector3d at = Vector3d::Zero();
    for (int k = 0; k < count && problems_.clean(); ++k) {
      const Quaterniond turn = settings_.from_euler(k * angles);
      copy.frame = around.frame * placed(turn, at);
      copy.suffix = fmt::format("{}{:0{}}", separator, k, digits) + around.suffix;
      at += turn * offset;
      children(node, of, copy);
      if (++repeated_ > kMostListed)
        problems_.add(node, "",
                      fmt::format("all copies have at most {} bodies and geoms", kMostListed));
    }
  }
  void body(const Node& node, int parent, const Around& around) {
    Tag tag(node, problems_);
    if (!around.suffix.empty() && ++repeated_ > kMostListed) return;
    Link out;
    out.line = tag.line();
    out.parent = parent;
    out.name = tag.has("name") ? tag.name("name", "") + around.suffix
                               : fmt::format("body {}", bodies_.size() + 1);
    problems_.take(out.line, "body", out.name, bodies_);
    const Vector3d at = tag.vector("pos", Vector3d::Zero());
    out.pose = around.frame * placed(settings_.orientation(tag), at);
    const Around inside{tag.text("childclass", around.class_name), Isometry3d::Identity(),
                        around.suffix};
    tag.finish(model_.remarks, {"user"});
    const int index = static_cast<int>(model_.links.size());
    model_.links.push_back(std::move(out));
    children(node, index, inside);
  }
  void joint(const Node& node, int of, const Around& around) {
    static const std::map<std::string, std::optional<JointKind>> kinds{{"hinge", JointKind::hinge},
                                                                       {"slide", JointKind::slider},
                                                                       {"ball", JointKind::ball},
                                                                       {"free", std::nullopt}};
    const bool is_freejoint = is(node, "freejoint");
    Tag tag(node, problems_,
            is_freejoint ? nullptr : settings_.defaults(node, around.class_name, problems_));
    LinkJoint out;
    out.line = tag.line();
    out.name = tag.has("name")
                   ? tag.name("name", "") + around.suffix
                   : fmt::format("joint {} of {}", link(of).joints.size() + 1, link(of).name);
    problems_.take(out.line, "joint", out.name, joints_);
    const auto kind = kinds.find(
        is_freejoint ? "free" : tag.word("type", "hinge", {"hinge", "slide", "ball", "free"}));
    if (kind != kinds.end()) out.kind = kind->second;
    if (!out.kind && link(of).parent >= 0)
      problems_.add(node, "", "a free joint is of bodies in the world only");
    const double unit = out.kind == JointKind::hinge ? settings_.angle : 1;
    out.axis = around.frame.linear() * tag.direction("axis", Vector3d::UnitZ());
    out.at = around.frame * tag.vector("pos", Vector3d::Zero());
    out.reference = unit * tag.number("ref", 0);
    out.rest = unit * tag.number("springref", 0);
    for (const auto& [key, to] : {std::pair("stiffness", &out.stiffness),
                                  {"damping", &out.damping},
                                  {"frictionloss", &out.friction},
                                  {"armature", &out.armature}})
      *to = tag.not_negative(key, 0);
    const std::vector<double> range = settings_.range(tag, "range", "limited");
    if (out.kind == JointKind::ball && !range.empty())
      model_.remarks.add("limits of ball joints", out.name);
    else if (out.kind)
      out.limits = mjcf::limits_of(tag, "range", range);
    if (out.limits) out.limits = {unit * out.limits->first, unit * out.limits->second};
    tag.finish(model_.remarks, {"class", "group", "user"});
    link(of).joints.push_back(std::move(out));
  }
  void geom(const Node& node, int of, const Around& around) {
    if (!around.suffix.empty() && ++repeated_ > kMostListed) return;
    Matter geom = mjcf::read_geom(node, around.class_name, settings_, problems_, model_.remarks);
    if (of < 0) {  // of the world
      if (geom.shapes.empty()) return;
      geom.mass = 0;
      geom.inertia.setZero();
      Link out;
      out.line = node.GetLineNum();
      out.name =
          geom.name.empty() ? fmt::format("geom of line {}", out.line) : geom.name + around.suffix;
      out.scenery = true;
      out.add(geom, around.frame);
      model_.links.push_back(std::move(out));
      return;
    }
    Link& out = link(of);
    if (!geom.shapes.empty() && geom.shapes[0].kind == ShapeKind::plane)
      return problems_.add(node, "", "a plane stands in the world only");
    const bool weighs = settings_.inertia == InertiaFrom::geoms ||
                        (settings_.inertia == InertiaFrom::as_said && weighed_.count(of) == 0);
    if (weighs && geom.mass < 0)
      problems_.add(
          node, "type",
          "the mass of a mesh is not known here: give the body an <inertial>, or the geom "
          "mass=\"0\"");
    if (!weighs) {
      geom.mass = 0;
      geom.inertia.setZero();
    }
    if (!geom.touch && !geom.shapes.empty()) {
      geom.shapes.clear();
      model_.remarks.add("geoms that touch nothing by their contype and conaffinity",
                         geom.name.empty() ? name_or_line(node) : geom.name);
    }
    if (geom.shapes.empty()) geom.touch.reset();
    if (out.touch && geom.touch &&
        (out.touch->friction != geom.touch->friction ||
         out.touch->tangential != geom.touch->tangential))
      model_.remarks.add("bodies whose geoms differ in friction have the largest of it", out.name);
    out.add(geom, around.frame);
  }
  void inertial(const Node& node, int of) {
    if (settings_.inertia == InertiaFrom::geoms) return;
    Tag tag(node, problems_);
    Link& out = link(of);
    if (!weighed_.insert(of).second) return problems_.add(node, "", "stands twice");
    if (!tag.has("mass")) tag.missing("mass", "kg");
    out.mass = tag.not_negative("mass", 0);
    out.centre = tag.vector("pos", Vector3d::Zero());
    const Matrix3d R = settings_.orientation(tag).toRotationMatrix();
    Matrix3d inertia = Matrix3d::Zero();
    if (const auto full = tag.numbers("fullinertia", 6, 6); !full.empty())
      inertia << full[0], full[3], full[4], full[3], full[1], full[5], full[4], full[5], full[2];
    else
      inertia = tag.vector("diaginertia", Vector3d::Zero()).asDiagonal();
    out.inertia = rotated(R, inertia);
    tag.finish(model_.remarks);
  }
  Link& link(int k) { return model_.links[at(k)]; }

  Model& model_;
  const Settings& settings_;
  Problems& problems_;
  std::set<std::string> bodies_, joints_;
  std::set<int> weighed_;     // links that <inertial> gives mass
  std::size_t repeated_ = 0;  // bodies and geoms of <replicate>
};

/// All three principal moments become their mean where one exceeds the sum of the others.
void balance_inertia(Model& model) {
  for (Link& link : model.links) {
    if (!link.inertia.allFinite()) continue;
    const Vector3d moment = linalg::symmetric_eigenvalues(link.inertia);  // ascending
    if (!(moment[0] + moment[1] < moment[2])) continue;
    link.inertia = link.inertia.trace() / 3 * Matrix3d::Identity();
    model.remarks.add("inertias that no body has, replaced by their mean (balanceinertia)",
                      link.name);
  }
}

/// Pairs of bodies that pass through each other, of <contact>.
void read_excluded(const Node& node, const Names& names, Model& model, Problems& problems) {
  Tag tag(node, problems);
  for (const char* key : {"body1", "body2"}) {
    if (!tag.has(key)) tag.missing(key, "the name of a body");
    names.body(tag, key);
  }
  model.excluded.emplace_back(tag.text("body1"), tag.text("body2"));
  tag.finish(model.remarks, {"name"});
}

void set_total_mass(double total, Model& model) {
  double sum = 0;
  for (const Link& link : model.links) sum += link.mass;
  if (!(total > 0) || !(sum > 0)) return;
  for (Link& link : model.links) {
    link.mass *= total / sum;
    link.inertia *= total / sum;
  }
}

}  // namespace

Model read_mjcf(const Node& root, Problems& problems) {
  Model model;
  Tag tag(root, problems);
  model.format = Format::mjcf;
  model.name = tag.text("model");
  const Settings settings = mjcf::read_settings(root, model, problems);
  Reader reader(model, settings, problems);
  const std::vector<const Node*> worlds = elements(root, "worldbody");
  for (const Node* each : worlds) reader.world(*each);
  if (worlds.empty()) problems.add(root.GetLineNum(), "mujoco: worldbody", "", "is missing");
  Names names(model);
  mjcf::read_tendons(root, settings, names, model, problems);
  for (const Node* section : elements(root)) {
    if (any_of(std::array{"compiler", "option", "default", "tendon", "worldbody"},
               [&](const char* name) { return is(*section, name); }))
      continue;
    for (const Node* each : elements(*section))
      if (is(*section, "contact") && is(*each, "exclude"))
        read_excluded(*each, names, model, problems);
      else if (is(*section, "actuator"))
        mjcf::read_actuator(*each, settings, names, model, problems);
      else if (!is(*section, "equality") || !mjcf::read_equality(*each, names, model, problems))
        model.remarks.add(fmt::format("<{}> in <{}>", each->Name(), section->Name()),
                          each->Attribute("name") != nullptr ? name_or_line(*each) : "");
  }
  if (settings.balance_inertia && problems.clean()) balance_inertia(model);
  set_total_mass(settings.total_mass, model);
  return model;
}

}  // namespace tether::scene::import

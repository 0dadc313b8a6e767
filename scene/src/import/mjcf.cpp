// Tether: reads MJCF. SPDX-License-Identifier: BSD-3-Clause
//
// Bodies stand inside each other; a body without joints is welded to the one around it, one with
// several moves by them in turn. Things of the world that touch become links of their own.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <tether/linalg/symmetric_eigen.hpp>

#include "bounds.hpp"
#include "lists.hpp"
#include "mjcf_actuators.hpp"
#include "mjcf_geom.hpp"

namespace tether::scene::import {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using mjcf::Geom;
using mjcf::InertiaFrom;
using mjcf::Settings;

/// Elements have a class from those around them, and from <frame> and <replicate> a place in the
/// frame of their link and an end of their names.
struct Around {
  std::string class_name;
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
  std::string suffix = {};
};

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
  void children(const Node& node, int link, const Around& around);
  void frame(const Node& node, int link, Around around);
  void replicate(const Node& node, int link, const Around& around);
  void body(const Node& node, int parent, const Around& around);
  void joint(const Node& node, int link, const Around& around);
  void geom(const Node& node, int link, const Around& around);
  void inertial(const Node& node, int link);
  void take_name(int line, const std::string& name, const char* kind, std::set<std::string>& names);
  Link& link(int k) { return model_.links[static_cast<std::size_t>(k)]; }

  Model& model_;
  const Settings& settings_;
  Problems& problems_;
  std::set<std::string> bodies_, joints_;
  std::set<int> weighed_;     // links that <inertial> gives mass
  std::size_t repeated_ = 0;  // bodies and geoms of <replicate>
};

void Reader::take_name(int line, const std::string& name, const char* kind,
                       std::set<std::string>& names) {
  if (!names.insert(name).second)
    problems_.add(line, fmt::format("{} \"{}\": name", kind, name), "",
                  fmt::format("another {} has it already", kind));
}

void Reader::children(const Node& node, int of, const Around& around) {
  // Geoms last: whether they give mass is known then.
  for (const Node* each = node.FirstChildElement(); each != nullptr;
       each = each->NextSiblingElement()) {
    if (of >= 0 && (is(*each, "joint") || is(*each, "freejoint")))
      joint(*each, of, around);
    else if (of >= 0 && is(*each, "inertial"))
      inertial(*each, of);
  }
  for (const Node* each = node.FirstChildElement("geom"); each != nullptr;
       each = each->NextSiblingElement("geom"))
    geom(*each, of, around);
  for (const Node* each = node.FirstChildElement(); each != nullptr;
       each = each->NextSiblingElement()) {
    if (is(*each, "body")) {
      body(*each, of, around);
    } else if (is(*each, "frame")) {
      frame(*each, of, around);
    } else if (is(*each, "replicate")) {
      replicate(*each, of, around);
    } else if (is(*each, "light") || is(*each, "camera") || is(*each, "site")) {
      model_.remarks.add(fmt::format("<{}>", each->Name()));
    } else if (is(*each, "composite") || is(*each, "flexcomp") || is(*each, "attach")) {
      problems_.add(each->GetLineNum(), path(*each), "",
                    "is not read; MuJoCo writes the model without it (mj_saveLastXML, or save in "
                    "its viewer)");
    } else if (!is(*each, "geom") && !(of >= 0 && (is(*each, "joint") || is(*each, "freejoint") ||
                                                   is(*each, "inertial")))) {
      model_.remarks.add(fmt::format("<{}> in <{}>", each->Name(), node.Name()),
                         name_or_line(*each));
    }
  }
}

void Reader::frame(const Node& node, int of, Around around) {
  Tag tag(node, problems_);
  const Vector3d at = tag.vector("pos", Vector3d::Zero());
  around.frame = around.frame * placed(mjcf::read_orientation(tag, settings_), at);
  around.class_name = tag.text("childclass", around.class_name);
  tag.finish(model_.remarks, {"name"});
  children(node, of, around);
}

/// As in MuJoCo copy k is turned by k times the angles, and lies by the offset of copy k - 1 from
/// that; its number has the digits of the count.
void Reader::replicate(const Node& node, int of, const Around& around) {
  Tag tag(node, problems_);
  const double count = tag.positive("count", 1);
  if (count != std::floor(count) || count > kMostListed)
    return tag.wrong("count", fmt::format("must be a whole number of at most {}", kMostListed));
  const Vector3d offset = tag.vector("offset", Vector3d::Zero()),
                 angles = tag.vector("euler", Vector3d::Zero());
  Around copy = around;
  copy.class_name = tag.text("childclass", around.class_name);
  const std::string separator = tag.text("sep");
  constexpr std::size_t kLongestSuffix = 200;  // bytes
  if (!files::is_name("x" + separator) || separator.size() + around.suffix.size() > kLongestSuffix)
    return tag.wrong("sep", std::string("must be part of a name: it ") + files::kName);
  tag.finish(model_.remarks);
  const std::size_t digits = fmt::format("{}", count).size();
  Vector3d at = Vector3d::Zero();
  for (int k = 0; k < count && problems_.clean(); ++k) {
    const Eigen::Quaterniond turn = mjcf::from_euler(k * angles, settings_);
    copy.frame = around.frame * placed(turn, at);
    copy.suffix = fmt::format("{}{:0{}}", separator, k, digits) + around.suffix;
    at += turn * offset;
    children(node, of, copy);
    if (++repeated_ > kMostListed)
      problems_.add(node.GetLineNum(), path(node), "",
                    fmt::format("all copies have at most {} bodies and geoms", kMostListed));
  }
}

void Reader::body(const Node& node, int parent, const Around& around) {
  Tag tag(node, problems_);
  if (!around.suffix.empty() && ++repeated_ > kMostListed) return;
  Link out;
  out.line = tag.line();
  out.parent = parent;
  out.name = tag.has("name") ? tag.name("name", "") + around.suffix
                             : fmt::format("body {}", bodies_.size() + 1);
  take_name(out.line, out.name, "body", bodies_);
  const Vector3d at = tag.vector("pos", Vector3d::Zero());
  out.pose = around.frame * placed(mjcf::read_orientation(tag, settings_), at);
  const Around inside{tag.text("childclass", around.class_name), Eigen::Isometry3d::Identity(),
                      around.suffix};
  tag.finish(model_.remarks, {"user"});
  const int index = static_cast<int>(model_.links.size());
  model_.links.push_back(std::move(out));
  children(node, index, inside);
}

void Reader::joint(const Node& node, int of, const Around& around) {
  const bool is_freejoint = is(node, "freejoint");
  Tag own(node, problems_);
  Tag tag(node, problems_,
          is_freejoint ? nullptr
                       : settings_.defaults(node, own.text("class", around.class_name), problems_));
  LinkJoint out;
  out.line = tag.line();
  out.name = tag.has("name")
                 ? tag.name("name", "") + around.suffix
                 : fmt::format("joint {} of {}", link(of).joints.size() + 1, link(of).name);
  take_name(out.line, out.name, "joint", joints_);
  const std::string type = is_freejoint ? "free" : tag.text("type", "hinge");
  out.kind = type == "slide"  ? MotionKind::slide
             : type == "ball" ? MotionKind::ball
             : type == "free" ? MotionKind::free
                              : MotionKind::hinge;
  if (out.kind == MotionKind::hinge && type != "hinge")
    tag.wrong("type", "must be hinge, slide, ball or free");
  if (out.kind == MotionKind::free && link(of).parent >= 0)
    problems_.add(out.line, path(node), "", "a free joint is of bodies in the world only");
  const bool turns = out.kind == MotionKind::hinge;
  const auto value = [&](double x) { return turns ? settings_.angle(x) : x; };
  out.axis = around.frame.linear() * tag.direction("axis", Vector3d::UnitZ());
  out.at = around.frame * tag.vector("pos", Vector3d::Zero());
  out.reference = value(tag.number("ref", 0));
  out.rest = value(tag.number("springref", 0));
  out.stiffness = tag.not_negative("stiffness", 0);
  out.damping = tag.not_negative("damping", 0);
  out.friction = tag.not_negative("frictionloss", 0);
  out.armature = tag.not_negative("armature", 0);
  const std::string limited = tag.text("limited", "auto");
  if (limited != "auto" && limited != "true" && limited != "false")
    tag.wrong("limited", "must be true, false or auto");
  const std::vector<double> range = tag.numbers("range", 2, 2);
  const bool is_limited = limited == "true" || (limited == "auto" && settings_.autolimits);
  if (is_limited && !range.empty() && out.kind != MotionKind::free) {
    if (out.kind == MotionKind::ball)
      model_.remarks.add("limits of ball joints", out.name);
    else if (!(range[0] < range[1]))
      tag.wrong("range", "must be two numbers, the smaller one first");
    else
      out.limits = {value(range[0]), value(range[1])};
  }
  tag.finish(model_.remarks, {"class", "group", "user"});
  link(of).joints.push_back(std::move(out));
}

void Reader::inertial(const Node& node, int of) {
  if (settings_.inertia == InertiaFrom::geoms) return;
  Tag tag(node, problems_);
  Link& out = link(of);
  if (!weighed_.insert(of).second) return problems_.add(tag.line(), path(node), "", "stands twice");
  if (!tag.has("mass")) tag.missing("mass", "kg");
  out.mass = tag.not_negative("mass", 0);
  out.centre = tag.vector("pos", Vector3d::Zero());
  const Matrix3d R = mjcf::read_orientation(tag, settings_).toRotationMatrix();
  Matrix3d inertia = Matrix3d::Zero();
  if (const auto full = tag.numbers("fullinertia", 6, 6); !full.empty())
    inertia << full[0], full[3], full[4], full[3], full[1], full[5], full[4], full[5], full[2];
  else
    inertia = tag.vector("diaginertia", Vector3d::Zero()).asDiagonal();
  const Matrix3d turned = R * inertia * R.transpose();
  out.inertia = R == Matrix3d::Identity() ? inertia : Matrix3d((turned + turned.transpose()) / 2);
  tag.finish(model_.remarks);
}

void move(const Eigen::Isometry3d& frame, Geom& geom) {
  if (frame.matrix() == Eigen::Matrix4d::Identity()) return;  // would only add rounding
  const Matrix3d R = frame.linear(), turned = R * geom.inertia * R.transpose();
  geom.centre = frame * geom.centre;
  geom.inertia = (turned + turned.transpose()) / 2;
  if (!geom.shape) return;
  geom.shape->position = frame * geom.shape->position;
  geom.shape->orientation = Eigen::Quaterniond(R) * geom.shape->orientation;
}

void Reader::geom(const Node& node, int of, const Around& around) {
  if (!around.suffix.empty() && ++repeated_ > kMostListed) return;
  Geom geom = mjcf::read_geom(node, around.class_name, settings_, problems_, model_.remarks);
  move(around.frame, geom);
  const bool plane = geom.shape && geom.shape->kind == ShapeKind::plane;
  if (of < 0) {  // of the world
    if (!geom.shape) return;
    Link out;
    out.line = node.GetLineNum();
    out.name =
        geom.name.empty() ? fmt::format("geom of line {}", out.line) : geom.name + around.suffix;
    out.scenery = true;
    out.shapes.push_back(std::move(*geom.shape));
    if (geom.touches) out.touch = geom.touch;
    model_.links.push_back(std::move(out));
    return;
  }
  Link& out = link(of);
  if (plane)
    return problems_.add(node.GetLineNum(), path(node), "", "a plane stands in the world only");
  const bool weighs = settings_.inertia == InertiaFrom::geoms ||
                      (settings_.inertia == InertiaFrom::as_said && weighed_.count(of) == 0);
  if (weighs && geom.has_mass && geom.mass < 0)
    problems_.add(node.GetLineNum(), path(node) + ": type", "",
                  "the mass of a mesh is not known here: give the body an <inertial>, or the geom "
                  "mass=\"0\"");
  if (weighs && geom.has_mass)
    add_mass(geom.mass, geom.centre, geom.inertia, out.mass, out.centre, out.inertia);
  if (!geom.shape) return;
  if (!geom.touches)
    return model_.remarks.add("geoms that touch nothing by their contype and conaffinity",
                              geom.name.empty() ? name_or_line(node) : geom.name);
  out.shapes.push_back(std::move(*geom.shape));
  if (!out.touch) {
    out.touch = geom.touch;
    return;
  }
  if (out.touch->friction != geom.touch.friction || out.touch->tangential != geom.touch.tangential)
    model_.remarks.add("bodies whose geoms differ in friction have the largest of it", out.name);
  out.touch->join(geom.touch);
}

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
  model.format = "MJCF";
  model.touches_itself = true;
  model.name = tag.text("model");
  const Settings settings = mjcf::read_settings(root, model, problems);
  Reader reader(model, settings, problems);
  bool has_world = false;
  for (const Node* each = root.FirstChildElement("worldbody"); each != nullptr;
       each = each->NextSiblingElement("worldbody")) {
    has_world = true;
    reader.world(*each);
  }
  if (!has_world) problems.add(root.GetLineNum(), "mujoco: worldbody", "", "is missing");
  Names names(model);
  mjcf::read_tendons(root, settings, names, model, problems);
  const auto is_read = [](const Node& section) {
    return any_of(std::array{"compiler", "option", "default", "tendon", "worldbody"},
                  [&](const char* name) { return is(section, name); });
  };
  for (const Node* each = root.FirstChildElement(); each != nullptr;
       each = each->NextSiblingElement())
    for (const Node* part = is_read(*each) ? nullptr : each->FirstChildElement(); part != nullptr;
         part = part->NextSiblingElement())
      if (is(*each, "contact") && is(*part, "exclude"))
        read_excluded(*part, names, model, problems);
      else if (is(*each, "actuator"))
        mjcf::read_actuator(*part, settings, names, model, problems);
      else if (!is(*each, "equality") || !read_equality(*part, names, model, problems))
        model.remarks.add(fmt::format("<{}> in <{}>", part->Name(), each->Name()),
                          part->Attribute("name") != nullptr ? name_or_line(*part) : "");
  if (settings.balance_inertia && problems.clean()) balance_inertia(model);
  set_total_mass(settings.total_mass, model);
  return model;
}

}  // namespace tether::scene::import

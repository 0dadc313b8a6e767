// Tether: reads URDF. SPDX-License-Identifier: BSD-3-Clause
//
// A link's frame is that of the joint which carries it; `origin` places it in the parent's frame,
// `axis` is in its own. Inertias are about the centre of mass in the axes of <inertial>.
#include <fmt/format.h>

#include "robot.hpp"
#include "xml.hpp"

namespace tether::scene::import {

namespace {

struct UrdfJoint {
  std::string name, parent, child;
  Isometry3d pose = Isometry3d::Identity();
  std::vector<LinkJoint> joints;  ///< none: fixed
  int line = 0;
};

struct Tree {
  std::vector<const UrdfJoint*> carrier;   // of each link; null: a root
  std::vector<std::vector<int>> children;  // of each link
};

std::map<std::string, int> names_of(const std::vector<Link>& links) {
  std::map<std::string, int> out;
  for (std::size_t k = 0; k < links.size(); ++k) out.emplace(links[k].name, static_cast<int>(k));
  return out;
}

Tree tree_of(const std::vector<Link>& links, const std::vector<UrdfJoint>& joints,
             Problems& problems) {
  const std::map<std::string, int> index = names_of(links);
  std::set<std::string> links_named, names;
  for (const Link& link : links) problems.take(link.line, "link", link.name, links_named);
  Tree out{std::vector<const UrdfJoint*>(links.size(), nullptr),
           std::vector<std::vector<int>>(links.size())};
  for (const UrdfJoint& joint : joints) {
    const std::string path = fmt::format("joint \"{}\": ", joint.name);
    problems.take(joint.line, "joint", joint.name, names);
    const auto parent = index.find(joint.parent), child = index.find(joint.child);
    for (const auto& [found, key, name] :
         {std::tuple(parent, "parent", &joint.parent), {child, "child", &joint.child}})
      if (found == index.end())
        problems.add(joint.line, path + key, fmt::format("\"{}\"", *name), "there is no such link");
    if (parent == index.end() || child == index.end()) continue;
    const UrdfJoint*& carrier = out.carrier[at(child->second)];
    if (carrier != nullptr) {
      problems.add(joint.line, path + "child", fmt::format("\"{}\"", joint.child),
                   fmt::format("is carried by joint \"{}\" already; closed loops are no URDF",
                               carrier->name));
      continue;
    }
    carrier = &joint;
    out.children[at(parent->second)].push_back(child->second);
  }
  for (const UrdfJoint& joint : joints)
    for (const LinkJoint& law : joint.joints)
      if (law.mimic && names.count(law.mimic->of) == 0)
        problems.add(joint.line, fmt::format("joint \"{}\": mimic: joint", joint.name),
                     fmt::format("\"{}\"", law.mimic->of), "there is no such joint");
  return out;
}

/// The only child of that name; null: there is none.
const Node* only_child(const Node& node, const char* name, Problems& problems) {
  const Node* const first = node.FirstChildElement(name);
  if (first != nullptr && first->NextSiblingElement(name) != nullptr)
    problems.add(first->NextSiblingElement(name)->GetLineNum(), path(node) + ": " + name, "",
                 "stands twice");
  return first;
}

void name_children(const Node& node, std::initializer_list<const char*> known, Remarks& remarks) {
  for (const Node* each : elements(node))
    if (!any_of(known, [&](const char* name) { return is(*each, name); }))
      remarks.add(fmt::format("<{}> in <{}>", each->Name(), node.Name()), name_or_line(node));
}

Isometry3d read_origin(const Node& node, Problems& problems, Remarks& remarks) {
  const Node* const origin = only_child(node, "origin", problems);
  if (origin == nullptr) return Isometry3d::Identity();
  Tag tag(*origin, problems);
  const Vector3d xyz = tag.vector("xyz", Vector3d::Zero()),
                 rpy = tag.vector("rpy", Vector3d::Zero());
  tag.finish(remarks);
  // Fixed axes: R = Rz(yaw) Ry(pitch) Rx(roll).
  const auto turn = [&](int k) { return Eigen::AngleAxisd(rpy[k], Vector3d::Unit(k)); };
  return placed(turn(2) * turn(1) * turn(0), xyz);
}

void read_inertial(const Node& node, Link& link, Problems& problems, Remarks& remarks) {
  const Isometry3d origin = read_origin(node, problems, remarks);
  link.centre = origin.translation();
  if (const Node* const mass = only_child(node, "mass", problems)) {
    Tag tag(*mass, problems);
    if (!tag.has("value")) tag.missing("value", "kg");
    link.mass = tag.not_negative("value", 0);
    tag.finish(remarks);
  } else {
    problems.add(node, "mass", "is missing: <mass value=\"kg\"/>");
  }
  const Node* const inertia = only_child(node, "inertia", problems);
  if (inertia == nullptr)
    return problems.add(node, "inertia", "is missing: ixx, ixy, ixz, iyy, iyz, izz in kg m^2");
  Tag tag(*inertia, problems);
  const auto entry = [&](const char* key) {
    if (!tag.has(key)) tag.missing(key, "kg m^2");
    return tag.number(key, 0);
  };
  const double xx = entry("ixx"), xy = entry("ixy"), xz = entry("ixz"), yy = entry("iyy"),
               yz = entry("iyz"), zz = entry("izz");
  tag.finish(remarks);
  Matrix3d matrix;
  matrix << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  link.inertia = rotated(origin.linear(), matrix);
  name_children(node, {"origin", "mass", "inertia"}, remarks);
}

/// Nothing where it has no size.
std::optional<Shape> read_geometry(const Node& node, Problems& problems, Remarks& remarks) {
  Tag tag(node, problems);
  Shape shape;
  double least = HUGE_VAL;
  if (is(node, "box")) {
    shape.kind = ShapeKind::box;
    if (!tag.has("size")) tag.missing("size", "the full edges, m");
    shape.size = tag.vector("size", Vector3d::Zero());
    least = shape.size.minCoeff();
    if (!(least >= 0)) tag.wrong("size", "must be three numbers > 0");
  } else {
    shape.kind = is(node, "sphere")     ? ShapeKind::sphere
                 : is(node, "cylinder") ? ShapeKind::cylinder
                                        : ShapeKind::capsule;
    for (const auto& [key, to] : {std::pair("radius", &shape.radius), {"length", &shape.length}}) {
      if (shape.kind == ShapeKind::sphere && to == &shape.length) continue;
      if (!tag.has(key)) tag.missing(key, "m");
      least = std::min(least, *to = tag.not_negative(key, 0));
    }
  }
  tag.finish(remarks);
  return least > 0 ? std::optional(shape) : std::nullopt;
}

std::optional<Shape> read_urdf_mesh(const Node& node, const std::string& link, Problems& problems,
                                    Remarks& remarks) {
  Tag tag(node, problems);
  const std::string name = tag.name("filename", "a file of a mesh");
  const Vector3d scale = tag.vector("scale", Vector3d::Ones());
  if (scale.cwiseAbs().minCoeff() == 0) tag.wrong("scale", "must be three numbers that are not 0");
  tag.finish(remarks);
  return read_mesh(problems, name, scale, link, remarks);
}

void read_collision(const Node& node, Link& link, Problems& problems, Remarks& remarks) {
  const Isometry3d origin = read_origin(node, problems, remarks);
  const Node* const geometry = only_child(node, "geometry", problems);
  const Node* const kind = geometry != nullptr ? geometry->FirstChildElement() : nullptr;
  if (kind == nullptr)
    return problems.add(node, "geometry", "is missing: a box, cylinder, sphere, capsule or mesh");
  const bool is_mesh = is(*kind, "mesh"),
             known = any_of(std::array{"box", "sphere", "cylinder", "capsule"},
                            [&](const char*k) { return is(*kind, k); });
  std::optional<Shape> shape;
  if (is_mesh)
    shape = read_urdf_mesh(*kind, link.name, problems, remarks);
  else if (known)
    shape = read_geometry(*kind, problems, remarks);
  if (!shape && !is_mesh)
    return remarks.add(
        fmt::format("collision geometry <{}>{}", kind->Name(), known ? " without size" : ""),
        link.name);
  if (shape) {
    shape->position = origin.translation();
    if (origin.linear() != Matrix3d::Identity()) shape->orientation = origin.linear();
    link.shapes.push_back(std::move(*shape));
  }
  name_children(node, {"origin", "geometry"}, remarks);
  name_children(*geometry, {kind->Name()}, remarks);
}

Link read_link(const Node& node, Problems& problems, Remarks& remarks) {
  Tag tag(node, problems);
  Link link;
  link.line = tag.line();
  link.name = tag.name("name", "every link has one");
  tag.finish(remarks, {"type"});
  if (const Node* const inertial = only_child(node, "inertial", problems))
    read_inertial(*inertial, link, problems, remarks);
  else
    link.is_weighed = false;
  for (const Node* each : elements(node, "collision"))
    read_collision(*each, link, problems, remarks);
  if (node.FirstChildElement("visual") != nullptr)
    remarks.add("<visual>, which shows and does not touch");
  name_children(node, {"inertial", "collision", "visual"}, remarks);
  link.touch = Touch{1, true, 1, 1};
  return link;
}

void read_limit(const Node& node, bool has_range, LinkJoint& joint, Problems& problems,
                Remarks& remarks) {
  const Node* const limit = only_child(node, "limit", problems);
  if (limit == nullptr) {
    if (has_range) remarks.add("joints without <limit>, which move freely", joint.name);
    return;
  }
  Tag tag(*limit, problems);
  for (const char* key : {"effort", "velocity"})
    if (tag.has(key) && tag.number(key, 0) > 0)
      remarks.add(fmt::format("limit {} of joints, which is of their drives", key));
  const bool given = tag.has("lower") || tag.has("upper");
  const double lower = tag.number("lower", 0), upper = tag.number("upper", 0);
  tag.finish(remarks);
  if (!has_range) return;
  if (lower > upper) return tag.wrong("lower", "must be at most upper");
  // Programs write 0 and 0 where they know no limits.
  if (!given || (lower == 0 && upper == 0))
    return remarks.add("limits 0 and 0, so these joints move freely (--hold NAME fixes one)",
                       joint.name);
  if (lower == upper)
    remarks.add("joints whose limits are equal, which are fixed there", joint.name);
  joint.limits = {lower, upper};
}

void read_joint_parts(const Node& node, const std::string& type, LinkJoint& joint,
                      Problems& problems, Remarks& remarks) {
  if (const Node* const axis = only_child(node, "axis", problems)) {
    Tag tag(*axis, problems);
    joint.axis = tag.direction("xyz", Vector3d::UnitX());
    tag.finish(remarks);
  } else {
    joint.axis = Vector3d::UnitX();
  }
  read_limit(node, type == "revolute" || type == "prismatic", joint, problems, remarks);
  if (const Node* const dynamics = only_child(node, "dynamics", problems)) {
    Tag tag(*dynamics, problems);
    joint.damping = tag.not_negative("damping", 0);
    joint.friction = tag.not_negative("friction", 0);
    tag.finish(remarks);
  }
  if (const Node* const mimic = only_child(node, "mimic", problems)) {
    Tag tag(*mimic, problems);
    joint.mimic = Mimic{tag.name("joint", "the name of a joint"), tag.number("multiplier", 1),
                        tag.number("offset", 0)};
    tag.finish(remarks);
  }
  name_children(node, {"origin", "parent", "child", "axis", "limit", "dynamics", "mimic"}, remarks);
}

UrdfJoint read_joint(const Node& node, Problems& problems, Remarks& remarks) {
  static const std::map<std::string, std::optional<JointKind>> kinds{
      {"revolute", JointKind::hinge},   {"continuous", JointKind::hinge},
      {"prismatic", JointKind::slider}, {"floating", std::nullopt},
      {"planar", JointKind::planar},    {"spherical", JointKind::ball}};
  UrdfJoint out;
  Tag tag(node, problems);
  out.line = tag.line();
  out.name = tag.name("name", "every joint has one");
  const std::string type = tag.text("type");
  tag.finish(remarks);
  const auto link_of = [&](const char* which) {
    const Node* const end = only_child(node, which, problems);
    if (end == nullptr) {
      problems.add(node, which, fmt::format("is missing: <{} link=\"...\"/>", which));
      return std::string();
    }
    Tag of_end(*end, problems);
    return of_end.name("link", "the name of a link");
  };
  out.parent = link_of("parent");
  out.child = link_of("child");
  out.pose = read_origin(node, problems, remarks);
  const auto kind = kinds.find(type);
  if (kind == kinds.end() && type != "fixed")
    tag.wrong("type", "must be revolute, continuous, prismatic, fixed, floating or planar");
  if (kind == kinds.end()) {
    name_children(node,
                  {"origin", "parent", "child", "axis", "limit", "dynamics", "mimic",
                   "safety_controller", "calibration"},
                  remarks);
    return out;
  }
  LinkJoint joint;
  joint.name = out.name;
  joint.line = out.line;
  joint.kind = kind->second;
  read_joint_parts(node, type, joint, problems, remarks);
  out.joints.push_back(std::move(joint));
  return out;
}

std::vector<Link> in_tree_order(std::vector<Link> links, const std::vector<UrdfJoint>& joints,
                                Problems& problems) {
  const Tree tree = tree_of(links, joints, problems);
  if (!problems.clean()) return {};
  std::vector<int> order, place(links.size(), -1);
  for (std::size_t k = 0; k < links.size(); ++k)
    if (tree.carrier[k] == nullptr) {
      if (!order.empty())
        problems.add(links[k].line, fmt::format("link \"{}\"", links[k].name), "",
                     fmt::format("no joint carries it, as none carries \"{}\": one link is the "
                                 "base",
                                 links[at(order[0])].name));
      order.push_back(static_cast<int>(k));
    }
  for (std::size_t next = 0; next < order.size(); ++next)
    for (const int child : tree.children[at(order[next])]) order.push_back(child);
  for (std::size_t k = 0; k < order.size(); ++k) place[at(order[k])] = static_cast<int>(k);
  for (std::size_t k = 0; k < links.size(); ++k)
    if (place[k] < 0) {
      problems.add(links[k].line, fmt::format("link \"{}\"", links[k].name), "",
                   "is in a loop of joints: a URDF is a tree");
      break;
    }
  if (!problems.clean()) return {};
  std::vector<Link> out;
  const std::map<std::string, int> index = names_of(links);
  for (const int k : order) {
    Link link = std::move(links[at(k)]);
    if (const UrdfJoint* joint = tree.carrier[at(k)]) {
      link.parent = place[at(index.at(joint->parent))];
      link.pose = joint->pose;
      link.joints = joint->joints;
    }
    out.push_back(std::move(link));
  }
  return out;
}

}  // namespace

Model read_urdf(const Node& root, Problems& problems) {
  Model model;
  Tag robot(root, problems);
  model.name = robot.text("name");
  std::vector<Link> links;
  std::vector<UrdfJoint> joints;
  for (const Node* each : elements(root)) {
    if (is(*each, "link"))
      links.push_back(read_link(*each, problems, model.remarks));
    else if (is(*each, "joint"))
      joints.push_back(read_joint(*each, problems, model.remarks));
    else if (std::string_view(each->Name()).substr(0, 6) == "xacro:")
      problems.add(*each, "", "is xacro: expand it first (xacro FILE > robot.urdf)");
    else
      model.remarks.add(fmt::format("<{}>", each->Name()));
  }
  if (links.empty()) problems.add(root.GetLineNum(), "robot", "", "has no link");
  // Parts that were wrong stand as defaults, which must not be blamed in turn.
  if (problems.clean()) model.links = in_tree_order(std::move(links), joints, problems);
  return model;
}

}  // namespace tether::scene::import

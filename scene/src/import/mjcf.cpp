// Tether: reads MJCF. SPDX-License-Identifier: BSD-3-Clause
//
// Bodies stand inside each other; a body without joints is welded to the one around it, one with
// several moves by them in turn. Things of the world that touch become links of their own.
#include <fmt/format.h>

#include <tether/linalg/pi.hpp>
#include <tether/linalg/shortest_turn.hpp>
#include <tether/linalg/symmetric_eigen.hpp>

#include "geometry/shape_type.hpp"
#include "mesh.hpp"
#include "robot.hpp"
#include "xml.hpp"

namespace tether::scene::import::mjcf {

enum class InertiaFrom { as_said, geoms, inertial };

struct Settings {
  // <compiler>
  bool degrees = true, autolimits = true;
  std::string euler = "xyz";  ///< lower case: about turned axes, upper case: about fixed ones
  InertiaFrom inertia = InertiaFrom::as_said;
  double total_mass = 0;                ///< kg; 0: as it comes
  int least_group = 0, most_group = 5;  ///< of geoms that have mass
  bool balance_inertia = false;         ///< inertias that no body has are replaced by their mean
  // <default>
  std::set<std::string> outermost{"main"};  ///< names of the class of elements without one, ""
  std::map<std::string, std::map<std::string, Attributes>, std::less<>> classes;  ///< by element
  std::string mesh_folder;              ///< in that of the robot's file, with its /
  std::map<std::string, Shape> meshes;  ///< of <asset>, by name; without points: it has no file
  std::size_t copied = 0;               ///< attributes that classes have from those around them

  double angle(double x) const { return degrees ? x * (linalg::kPi / 180) : x; }
  /// Attributes of `element` in a class ("": the outermost). Reports a class that is not there.
  const Attributes* defaults(const Node& node, const std::string& name, Problems& problems) const;
};

/// One of quat, axisangle, euler, xyaxes, zaxis; none: the identity.
Eigen::Quaterniond read_orientation(Tag& tag, const Settings& settings);

namespace {

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;

void read_compiler(const Node& node, Settings& out, Problems& problems, Remarks& remarks) {
  Tag tag(node, problems);
  const std::string angle = tag.text("angle", out.degrees ? "degree" : "radian");
  if (angle != "degree" && angle != "radian") tag.wrong("angle", "must be degree or radian");
  out.degrees = angle == "degree";
  out.autolimits = tag.flag("autolimits", out.autolimits);
  if (tag.text("coordinate", "local") != "local")
    tag.wrong("coordinate", "must be local; global ones were dropped by MuJoCo 2.3.4");
  out.euler = tag.text("eulerseq", out.euler);
  if (out.euler.size() != 3 || out.euler.find_first_not_of("xyzXYZ") != std::string::npos) {
    tag.wrong("eulerseq", "must be three of the letters x, y, z, X, Y, Z");
    out.euler = "xyz";  // orientations are read on, for further errors
  }
  const std::string from = tag.text("inertiafromgeom", "auto");
  if (from != "auto" && from != "true" && from != "false")
    tag.wrong("inertiafromgeom", "must be true, false or auto");
  out.inertia = from == "true"    ? InertiaFrom::geoms
                : from == "false" ? InertiaFrom::inertial
                                  : InertiaFrom::as_said;
  out.total_mass = tag.number("settotalmass", 0);
  if (const auto range = tag.numbers("inertiagrouprange", 2, 2); !range.empty()) {
    out.least_group = static_cast<int>(std::min(std::max(range[0], -1e9), 1e9));
    out.most_group = static_cast<int>(std::min(std::max(range[1], -1e9), 1e9));
  }
  for (const char* key : {"boundmass", "boundinertia"})
    if (tag.number(key, 0) > 0) remarks.add(fmt::format("compiler {}", key));
  out.balance_inertia = tag.flag("balanceinertia", out.balance_inertia);
  const std::string folder = tag.text("meshdir", tag.text("assetdir"));
  if (!folder.empty()) out.mesh_folder = folder + "/";
  tag.finish(remarks, {"meshdir", "texturedir", "assetdir", "convexhull", "discardvisual",
                       "usethread", "strippath", "alignfree", "fusestatic"});
}

void read_option(const Node& node, Model& model, Problems& problems) {
  Tag tag(node, problems);
  model.gravity = tag.vector("gravity", model.gravity.value_or(Vector3d::Zero()));
  if (tag.has("timestep")) model.step = tag.positive("timestep", 0.002);
  tag.finish(model.remarks);
  if (const Node* const flags = node.FirstChildElement("flag")) {
    Tag flag(*flags, problems);
    if (flag.text("gravity", "enable") == "disable") model.gravity.reset();
    flag.finish(model.remarks);
  }
}

constexpr std::size_t kMostInClasses = 1000000;

std::size_t size_of(const std::map<std::string, Attributes>& elements) {
  std::size_t size = elements.size();
  for (const auto& [name, attributes] : elements) size += attributes.size();
  return size;
}

/// A class has what it says, and what it does not say of the one around it. The outermost one may
/// have any name, and holds for elements without a class in either case.
void read_class(const Node& node, const std::string* around, Settings& out, Problems& problems,
                Remarks& remarks) {
  Tag tag(node, problems);
  std::string name = tag.text("class", around == nullptr ? "main" : "");
  if (name.empty()) tag.missing("class", "a class inside another one has a name");
  tag.finish(remarks);
  if (around == nullptr) {
    out.outermost.insert(name);
    name.clear();
  }
  auto& own = out.classes[name];
  if (around != nullptr && name != *around) {
    if (out.copied > kMostInClasses) return;  // said
    const auto& outer = out.classes[*around];
    out.copied += size_of(outer);  // a few lines may copy what many others say
    if (out.copied > kMostInClasses)
      return problems.add(node.GetLineNum(), path(node), "",
                          fmt::format("all classes together have at most {} attributes, with those "
                                      "of the classes around them",
                                      kMostInClasses));
    own = outer;
  }
  for (const Node* each = node.FirstChildElement(); each != nullptr;
       each = each->NextSiblingElement()) {
    if (is(*each, "default")) continue;
    Attributes& of = own[each->Name()];
    for (const auto* a = each->FirstAttribute(); a != nullptr; a = a->Next())
      of[a->Name()] = a->Value();
    if (of.size() > kMostAttributes)
      return problems.add(each->GetLineNum(), path(*each), "",
                          fmt::format("must have at most {} attributes", kMostAttributes));
  }
  for (const Node* each = node.FirstChildElement("default"); each != nullptr;
       each = each->NextSiblingElement("default"))
    read_class(*each, &name, out, problems, remarks);
}

Quaterniond from_euler(const Vector3d& angles, const std::string& sequence) {
  Quaterniond out = Quaterniond::Identity();
  for (int k = 0; k < 3; ++k) {
    const char letter = sequence[static_cast<std::size_t>(k)];
    const bool fixed = letter < 'a';
    const Vector3d axis = Vector3d::Unit(letter - (fixed ? 'X' : 'x'));
    const Quaterniond turn(AngleAxisd(angles[k], axis));
    out = fixed ? turn * out : out * turn;
  }
  return out;
}

using Eigen::Matrix3d;

/// Volume and inertia of density 1 in the axes of the geom, and the shape that touches.
struct Solid {
  double volume = 0;
  Matrix3d inertia = Matrix3d::Zero();
  std::optional<Shape> shape;
  Vector3d centre = Vector3d::Zero();
};

Solid of_shape(const Shape& shape) {
  const MassProperties properties = mass_properties(shape);
  return {properties.volume, properties.inertia, shape, properties.centre};
}

/// As in MuJoCo a mesh touches as its hull, and weighs as what is within its surface.
Solid read_mesh_solid(const Settings& settings, const std::string& name, const std::string& geom,
                      bool touches, Remarks& remarks) {
  const auto found = settings.meshes.find(name);
  if (found == settings.meshes.end() || found->second.points.empty()) return {};
  const Shape& mesh = found->second;
  if (!touches) {  // hulls of what only shows would take the longest
    Solid out = of_shape(mesh);
    out.shape.reset();
    return out;
  }
  const std::optional<Shape> hull = hull_of(mesh, geom, remarks);
  if (!hull) return {};
  remarks.add("meshes touch as their convex hulls", geom);
  Solid out = of_shape(mesh.triangles.empty() ? *hull : mesh);
  out.shape = hull;
  return out;
}

/// The numbers of `size` from `from` on, which must be there and > 0.
bool sizes(Tag& tag, const std::vector<double>& size, std::size_t count) {
  bool good = size.size() >= count;
  for (std::size_t k = 0; good && k < count; ++k) good = size[k] > 0 && size[k] < kLargestLength;
  if (!good)
    tag.wrong("size", fmt::format("must have {}, > 0, here",
                                  count == 1 ? "a number" : fmt::format("{} numbers", count)));
  return good;
}

Solid read_solid(Tag& tag, const std::string& type, const std::vector<double>& size) {
  Shape shape;
  if (type == "sphere" && sizes(tag, size, 1)) {
    shape.radius = size[0];
    return of_shape(shape);
  }
  if (type == "box" && sizes(tag, size, 3)) {
    shape.kind = ShapeKind::box;
    shape.size = 2 * Vector3d(size[0], size[1], size[2]);
    return of_shape(shape);
  }
  if ((type == "cylinder" || type == "capsule") && sizes(tag, size, 2)) {
    shape.kind = type == "cylinder" ? ShapeKind::cylinder : ShapeKind::capsule;
    shape.radius = size[0];
    shape.length = 2 * size[1];
    return of_shape(shape);
  }
  if (type == "ellipsoid" && sizes(tag, size, 3)) {
    shape.kind = ShapeKind::ellipsoid;
    shape.size = Vector3d(size[0], size[1], size[2]);
    return of_shape(shape);
  }
  return {};
}

/// Ends of the axis in place of size, position and orientation. As in MuJoCo the z axis of the geom
/// points from the second to the first of them, which turns the edges of boxes.
Eigen::Isometry3d read_place(Tag& tag, const std::string& type, const Settings& settings,
                             std::vector<double>& size) {
  const std::vector<double> ends = tag.numbers("fromto", 6, 6);
  if (ends.empty()) {
    const Vector3d at = tag.vector("pos", Vector3d::Zero());
    return placed(read_orientation(tag, settings), at);
  }
  const Vector3d from(ends[0], ends[1], ends[2]), to(ends[3], ends[4], ends[5]);
  if (!((to - from).stableNorm() > 0)) tag.wrong("fromto", "must be two points");
  if (size.empty()) size.push_back(0);  // reported by `sizes`
  size.resize(1);
  if (type == "box" || type == "ellipsoid") size.push_back(size[0]);
  size.push_back((to - from).stableNorm() / 2);
  return placed(linalg::shortest_turn(Vector3d::UnitZ(), from - to), (from + to) / 2);
}

Touch read_touch(Tag& tag, bool& touches) {
  Touch out;
  const std::vector<double> friction = tag.numbers("friction", 1, 3);
  out.friction = friction.empty() ? 1 : friction[0];
  if (!(out.friction >= 0)) tag.wrong("friction", "must be >= 0");
  const double condim = tag.number("condim", 3);
  if (condim != 1 && condim != 3 && condim != 4 && condim != 6)
    tag.wrong("condim", "must be 1, 3, 4 or 6");
  out.tangential = condim > 1;
  const auto bits = [&](const char* key) {
    const double value = tag.number(key, 1);
    if (!(value >= 0 && value < 4294967296.0 && value == std::floor(value))) {
      tag.wrong(key, "must be a whole number of 32 bits");
      return 1U;
    }
    return static_cast<unsigned>(value);
  };
  out.type = bits("contype");
  out.affinity = bits("conaffinity");
  touches = out.type != 0 || out.affinity != 0;
  return out;
}

}  // namespace

const Attributes* Settings::defaults(const Node& node, const std::string& name,
                                     Problems& problems) const {
  auto found = classes.find(name);
  const bool is_outermost = name.empty() || outermost.count(name) > 0;
  if (found == classes.end() && is_outermost) found = classes.find("");
  if (found == classes.end()) {
    if (!is_outermost)
      problems.add(node.GetLineNum(), path(node) + ": class", "\"" + name + "\"",
                   "no <default> has this class");
    return nullptr;
  }
  const auto of = found->second.find(node.Name());
  return of == found->second.end() ? nullptr : &of->second;
}

/// A mesh by its file or its vertices, without triangles then.
void read_mesh_asset(const Node& node, Settings& out, Problems& problems, Remarks& remarks) {
  Tag own(node, problems);
  Tag tag(node, problems, out.defaults(node, own.text("class"), problems));
  const std::string file = tag.text("file");
  std::string stem = file.substr(std::min(file.find_last_of('/') + 1, file.size()));
  stem = stem.substr(0, stem.find_last_of('.'));
  const std::string name = tag.text("name", stem);
  const Vector3d scale = tag.vector("scale", Vector3d::Ones());
  const Vector3d at = tag.vector("refpos", Vector3d::Zero());
  const std::vector<double> q = tag.numbers("refquat", 4, 4);
  const std::vector<double> vertices = tag.numbers("vertex", 12, 3 * kMostPoints);
  tag.finish(remarks, {"class", "normal", "texcoord", "face", "smoothnormal", "maxhullvert",
                       "inertia", "content_type"});
  Shape mesh = Shape::mesh({}, {});
  if (!file.empty()) {
    mesh = read_mesh(problems.file(), out.mesh_folder + file, scale, name, remarks).value_or(mesh);
  } else {
    for (std::size_t k = 0; k + 2 < vertices.size(); k += 3)
      mesh.points.push_back(
          Vector3d(vertices[k], vertices[k + 1], vertices[k + 2]).cwiseProduct(scale));
  }
  Quaterniond turn = Quaterniond::Identity();
  if (!q.empty()) turn.coeffs() = Eigen::Vector4d(q[1], q[2], q[3], q[0]).stableNormalized();
  for (Vector3d& p : mesh.points) p = turn.conjugate() * (p - at);
  out.meshes[name] = std::move(mesh);
}

/// Reads <compiler>, <option>, <default> and the meshes of <asset> below the root; gravity and step
/// go to the model.
Settings read_settings(const Node& root, Model& model, Problems& problems) {
  Settings out;
  model.gravity = Vector3d(0, 0, -9.81);
  for (const Node* each = root.FirstChildElement(); each != nullptr;
       each = each->NextSiblingElement()) {
    if (is(*each, "compiler")) read_compiler(*each, out, problems, model.remarks);
    if (is(*each, "option")) read_option(*each, model, problems);
    if (is(*each, "default")) read_class(*each, nullptr, out, problems, model.remarks);
  }
  for (const Node* each = root.FirstChildElement("asset"); each != nullptr;
       each = each->NextSiblingElement("asset"))
    for (const Node* mesh = each->FirstChildElement("mesh"); mesh != nullptr;
         mesh = mesh->NextSiblingElement("mesh"))
      read_mesh_asset(*mesh, out, problems, model.remarks);
  return out;
}

Quaterniond read_orientation(Tag& tag, const Settings& settings) {
  if (const auto q = tag.numbers("quat", 4, 4); !q.empty()) {
    const Quaterniond read(q[0], q[1], q[2], q[3]);
    if (read.coeffs().stableNorm() > 0) return Quaterniond(read.coeffs().stableNormalized());
    tag.wrong("quat", "must not be zero");
  } else if (const auto a = tag.numbers("axisangle", 4, 4); !a.empty()) {
    const Vector3d axis(a[0], a[1], a[2]);
    if (axis.stableNorm() > 0)
      return Quaterniond(AngleAxisd(settings.angle(a[3]), axis.stableNormalized()));
    tag.wrong("axisangle", "must have an axis that is not zero");
  } else if (const auto e = tag.numbers("euler", 3, 3); !e.empty()) {
    return from_euler({settings.angle(e[0]), settings.angle(e[1]), settings.angle(e[2])},
                      settings.euler);
  } else if (const auto v = tag.numbers("xyaxes", 6, 6); !v.empty()) {
    const Vector3d x = Vector3d(v[0], v[1], v[2]).stableNormalized();
    const Vector3d y = Vector3d(v[3], v[4], v[5]).stableNormalized();
    const Vector3d z = x.cross(y);
    if (z.norm() > 1e-9) {
      Eigen::Matrix3d R;
      R << x, z.normalized().cross(x), z.normalized();
      return Quaterniond(R);
    }
    tag.wrong("xyaxes", "must be two directions that are not parallel");
  } else if (tag.has("zaxis")) {
    return linalg::shortest_turn(Vector3d::UnitZ(), tag.direction("zaxis", Vector3d::UnitZ()));
  }
  return Quaterniond::Identity();
}

struct Geom {
  std::string name;
  std::optional<Shape> shape;  ///< none: nothing that scenes have touches
  Touch touch;
  bool touches = true;  ///< false: by its contype and conaffinity it never does
  bool has_mass = true;
  double mass = 0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();   ///< in the frame of the body
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  ///< about the centre, axes of the body
};

// Sizes of MJCF are halves: of edges, of the height of a cylinder, of the way between the centres
// of a capsule's caps.

Geom read_geom(const Node& node, const std::string& class_name, const Settings& settings,
               Problems& problems, Remarks& remarks) {
  Tag own(node, problems);
  Tag tag(node, problems, settings.defaults(node, own.text("class", class_name), problems));
  Geom out;
  out.name = tag.text("name");
  if (tag.has("name")) tag.name("name", "");
  std::string type = tag.text("type", "sphere");
  if (tag.has("mesh") && !tag.has("type")) type = "mesh";
  std::vector<double> size = tag.numbers("size", 1, 3);
  const Eigen::Isometry3d place = read_place(tag, type, settings, size);
  out.touch = read_touch(tag, out.touches);
  const double group = tag.number("group", 0), density = tag.not_negative("density", 1000);
  out.has_mass = group >= settings.least_group && group <= settings.most_group && type != "plane";

  Solid solid;
  if (type == "plane") {
    solid.shape.emplace().kind = ShapeKind::plane;
  } else if (type == "mesh" || type == "hfield" || type == "sdf") {
    if (type == "mesh")
      solid = read_mesh_solid(settings, tag.text("mesh"), name_or_line(node), out.touches, remarks);
    if (!solid.shape) remarks.add(fmt::format("geoms of type {}", type), name_or_line(node));
    const bool weighs = !tag.has("mass") || tag.number("mass", 0) > 0;
    if (!(solid.volume > 0) && weighs) out.mass = -1;  // nobody knows
  } else if (type != "sphere" && type != "capsule" && type != "box" && type != "cylinder" &&
             type != "ellipsoid") {
    tag.wrong("type", "must be plane, sphere, capsule, cylinder, box, ellipsoid, mesh or hfield");
  } else {
    solid = read_solid(tag, type, size);
  }
  const double mass = tag.has("mass") ? tag.not_negative("mass", 0) : density * solid.volume;
  if (solid.volume > 0) {
    const Matrix3d R = place.linear(), turned = R * solid.inertia * R.transpose();
    out.mass = mass;
    out.inertia = mass / solid.volume / 2 * (turned + turned.transpose());
    out.centre = place * solid.centre;
  }
  if (solid.shape) {
    out.shape = std::move(solid.shape);
    out.shape->position = place.translation();
    if (place.linear() != Matrix3d::Identity()) out.shape->orientation = place.linear();
  }
  tag.finish(remarks, {"class", "rgba", "material", "user", "mesh", "hfield", "fitscale"});
  return out;
}

}  // namespace tether::scene::import::mjcf

namespace tether::scene::import {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using mjcf::Geom;
using mjcf::InertiaFrom;
using mjcf::Settings;

class Reader {
 public:
  Reader(Model& model, const Settings& settings, Problems& problems)
      : model_(model), settings_(settings), problems_(problems) {}

  void world(const Node& node) {
    Tag tag(node, problems_);
    children(node, -1, tag.text("childclass"));
    tag.finish(model_.remarks, {"name"});
  }

 private:
  void children(const Node& node, int link, const std::string& class_name);
  void body(const Node& node, int parent, const std::string& around);
  void joint(const Node& node, int link, const std::string& class_name);
  void geom(const Node& node, int link, const std::string& class_name);
  void inertial(const Node& node, int link);
  void take_name(int line, const std::string& name, const char* kind, std::set<std::string>& names);
  Link& link(int k) { return model_.links[static_cast<std::size_t>(k)]; }

  Model& model_;
  const Settings& settings_;
  Problems& problems_;
  std::set<std::string> bodies_, joints_;
  std::set<int> weighed_;  // links that <inertial> gives mass
};

void Reader::take_name(int line, const std::string& name, const char* kind,
                       std::set<std::string>& names) {
  if (!names.insert(name).second)
    problems_.add(line, fmt::format("{} \"{}\": name", kind, name), "",
                  fmt::format("another {} has it already", kind));
}

void Reader::children(const Node& node, int of, const std::string& class_name) {
  // Geoms last: whether they give mass is known then.
  for (const Node* each = node.FirstChildElement(); each != nullptr;
       each = each->NextSiblingElement()) {
    if (of >= 0 && (is(*each, "joint") || is(*each, "freejoint")))
      joint(*each, of, class_name);
    else if (of >= 0 && is(*each, "inertial"))
      inertial(*each, of);
  }
  for (const Node* each = node.FirstChildElement("geom"); each != nullptr;
       each = each->NextSiblingElement("geom"))
    geom(*each, of, class_name);
  for (const Node* each = node.FirstChildElement(); each != nullptr;
       each = each->NextSiblingElement()) {
    if (is(*each, "body")) {
      body(*each, of, class_name);
    } else if (is(*each, "light") || is(*each, "camera") || is(*each, "site")) {
      model_.remarks.add(fmt::format("<{}>", each->Name()));
    } else if (is(*each, "frame") || is(*each, "replicate") || is(*each, "composite") ||
               is(*each, "flexcomp") || is(*each, "attach") || is(*each, "include")) {
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

void Reader::body(const Node& node, int parent, const std::string& around) {
  Tag tag(node, problems_);
  Link out;
  out.line = tag.line();
  out.parent = parent;
  out.name = tag.has("name") ? tag.name("name", "") : fmt::format("body {}", bodies_.size() + 1);
  take_name(out.line, out.name, "body", bodies_);
  const Vector3d at = tag.vector("pos", Vector3d::Zero());
  out.pose = placed(mjcf::read_orientation(tag, settings_), at);
  const std::string class_name = tag.text("childclass", around);
  tag.finish(model_.remarks, {"user"});
  const int index = static_cast<int>(model_.links.size());
  model_.links.push_back(std::move(out));
  children(node, index, class_name);
}

void Reader::joint(const Node& node, int of, const std::string& class_name) {
  const bool is_freejoint = is(node, "freejoint");
  Tag own(node, problems_);
  Tag tag(
      node, problems_,
      is_freejoint ? nullptr : settings_.defaults(node, own.text("class", class_name), problems_));
  LinkJoint out;
  out.line = tag.line();
  out.name = tag.has("name")
                 ? tag.name("name", "")
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
  out.axis = tag.direction("axis", Vector3d::UnitZ());
  out.at = tag.vector("pos", Vector3d::Zero());
  out.reference = value(tag.number("ref", 0));
  out.rest = value(tag.number("springref", 0));
  out.stiffness = tag.not_negative("stiffness", 0);
  out.damping = tag.not_negative("damping", 0);
  out.friction = tag.not_negative("frictionloss", 0);
  if (tag.not_negative("armature", 0) > 0)
    model_.remarks.add("armature (inertia of rotors)", out.name);
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

void Reader::geom(const Node& node, int of, const std::string& class_name) {
  Geom geom = mjcf::read_geom(node, class_name, settings_, problems_, model_.remarks);
  const bool plane = geom.shape && geom.shape->kind == ShapeKind::plane;
  if (of < 0) {  // of the world
    if (!geom.shape) return;
    Link out;
    out.line = node.GetLineNum();
    out.name = geom.name.empty() ? fmt::format("geom of line {}", out.line) : geom.name;
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
void read_excluded(const Node& node, Model& model, Problems& problems) {
  Tag tag(node, problems);
  for (const char* key : {"body1", "body2"})
    if (!tag.has(key)) tag.missing(key, "the name of a body");
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
  std::vector<const Node*> equalities;
  for (const Node* each = root.FirstChildElement(); each != nullptr;
       each = each->NextSiblingElement()) {
    if (is(*each, "worldbody")) {
      has_world = true;
      reader.world(*each);
    } else if (is(*each, "include")) {
      problems.add(each->GetLineNum(), "include", "",
                   "other files are not read; MuJoCo writes the model in one file");
    } else if (!is(*each, "compiler") && !is(*each, "option") && !is(*each, "default")) {
      for (const Node* part = each->FirstChildElement(); part != nullptr;
           part = part->NextSiblingElement())
        if (is(*each, "contact") && is(*part, "exclude"))
          read_excluded(*part, model, problems);
        else if (is(*each, "equality"))
          equalities.push_back(part);
        else
          model.remarks.add(fmt::format("<{}> in <{}>", part->Name(), each->Name()),
                            part->Attribute("name") != nullptr ? name_or_line(*part) : "");
    }
  }
  for (const Node* each : equalities)
    if (!read_equality(*each, model, problems))
      model.remarks.add(fmt::format("<{}> in <equality>", each->Name()),
                        each->Attribute("name") != nullptr ? name_or_line(*each) : "");
  if (!has_world) problems.add(root.GetLineNum(), "mujoco: worldbody", "", "is missing");
  if (settings.balance_inertia && problems.clean()) balance_inertia(model);
  set_total_mass(settings.total_mass, model);
  return model;
}

}  // namespace tether::scene::import

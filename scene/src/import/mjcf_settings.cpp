// Tether: settings of an MJCF file, classes of its elements and its meshes.
// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <tether/linalg/shortest_turn.hpp>

#include "mjcf.hpp"

namespace tether::scene::import::mjcf {

using Eigen::AngleAxisd;

namespace {

void read_compiler(const Node& node, Settings& out, Problems& problems, Remarks& remarks) {
  Tag tag(node, problems);
  if (tag.has("angle"))
    out.angle = tag.word("angle", "", {"degree", "radian"}) == "degree" ? linalg::kPi / 180 : 1;
  out.autolimits = tag.flag("autolimits", out.autolimits);
  if (tag.text("coordinate", "local") != "local")
    tag.wrong("coordinate", "must be local; global ones were dropped by MuJoCo 2.3.4");
  out.euler = tag.text("eulerseq", out.euler);
  if (out.euler.size() != 3 || out.euler.find_first_not_of("xyzXYZ") != std::string::npos) {
    tag.wrong("eulerseq", "must be three of the letters x, y, z, X, Y, Z");
    out.euler = "xyz";  // orientations are read on, for further errors
  }
  const std::string from = tag.word("inertiafromgeom", "auto", {"true", "false", "auto"});
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
    model.touches = flag.text("contact", "enable") != "disable";
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
      return problems.add(node, "",
                          fmt::format("all classes together have at most {} attributes, with those "
                                      "of the classes around them",
                                      kMostInClasses));
    own = outer;
  }
  for (const Node* each : elements(node)) {
    if (is(*each, "default")) continue;
    Attributes& of = own[each->Name()];
    for (const auto* a = each->FirstAttribute(); a != nullptr; a = a->Next())
      of[a->Name()] = a->Value();
    if (of.size() > kMostAttributes)
      return problems.add(*each, "",
                          fmt::format("must have at most {} attributes", kMostAttributes));
  }
  for (const Node* each : elements(node, "default"))
    read_class(*each, &name, out, problems, remarks);
}

/// A mesh by its file or its vertices, without triangles then.
void read_mesh_asset(const Node& node, Settings& out, Problems& problems, Remarks& remarks) {
  Tag tag(node, problems, out.defaults(node, "", problems));
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
    mesh = read_mesh(problems, out.mesh_folder + file, scale, name, remarks).value_or(mesh);
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

}  // namespace

Settings read_settings(const Node& root, Model& model, Problems& problems) {
  Settings out;
  for (const Node* each : elements(root)) {
    if (is(*each, "compiler")) read_compiler(*each, out, problems, model.remarks);
    if (is(*each, "option")) read_option(*each, model, problems);
    if (is(*each, "default")) read_class(*each, nullptr, out, problems, model.remarks);
  }
  for (const Node* each : elements(root, "asset"))
    for (const Node* mesh : elements(*each, "mesh"))
      read_mesh_asset(*mesh, out, problems, model.remarks);
  return out;
}

const Attributes* Settings::defaults(const Node& node, const std::string& otherwise,
                                     Problems& problems, std::string_view element) const {
  const char* const own = node.Attribute("class");
  const std::string name = own != nullptr ? own : otherwise;
  auto found = classes.find(name);
  const bool is_outermost = name.empty() || outermost.count(name) > 0;
  if (found == classes.end() && is_outermost) found = classes.find("");
  if (found == classes.end()) {
    if (!is_outermost)
      problems.add(node.GetLineNum(), path(node) + ": class", "\"" + name + "\"",
                   "no <default> has this class");
    return nullptr;
  }
  const auto of = found->second.find(element.empty() ? node.Name() : std::string(element));
  return of == found->second.end() ? nullptr : &of->second;
}

std::optional<std::pair<double, double>> limits_of(Tag& tag, const char* key,
                                                   const std::vector<double>& range) {
  if (range.empty()) return {};
  if (range[0] < range[1]) return std::pair(range[0], range[1]);
  tag.wrong(key, "must be two numbers, the smaller one first");
  return {};
}

Quaterniond Settings::from_euler(const Vector3d& angles) const {
  Quaterniond out = Quaterniond::Identity();
  for (int k = 0; k < 3; ++k) {
    const char letter = euler[at(k)];
    const bool fixed = letter < 'a';
    const Vector3d axis = Vector3d::Unit(letter - (fixed ? 'X' : 'x'));
    const Quaterniond turn(AngleAxisd(angle * angles[k], axis));
    out = fixed ? turn * out : out * turn;
  }
  return out;
}

Quaterniond Settings::orientation(Tag& tag) const {
  if (const auto q = tag.numbers("quat", 4, 4); !q.empty()) {
    const Quaterniond read(q[0], q[1], q[2], q[3]);
    if (read.coeffs().stableNorm() > 0) return Quaterniond(read.coeffs().stableNormalized());
    tag.wrong("quat", "must not be zero");
  } else if (const auto a = tag.numbers("axisangle", 4, 4); !a.empty()) {
    const Vector3d axis(a[0], a[1], a[2]);
    if (axis.stableNorm() > 0)
      return Quaterniond(AngleAxisd(angle * a[3], axis.stableNormalized()));
    tag.wrong("axisangle", "must have an axis that is not zero");
  } else if (const auto e = tag.numbers("euler", 3, 3); !e.empty()) {
    return from_euler({e[0], e[1], e[2]});
  } else if (const auto v = tag.numbers("xyaxes", 6, 6); !v.empty()) {
    const Vector3d x = Vector3d(v[0], v[1], v[2]).stableNormalized();
    const Vector3d y = Vector3d(v[3], v[4], v[5]).stableNormalized();
    const Vector3d z = x.cross(y);
    if (z.norm() > 1e-9) {
      Matrix3d R;
      R << x, z.normalized().cross(x), z.normalized();
      return Quaterniond(R);
    }
    tag.wrong("xyaxes", "must be two directions that are not parallel");
  } else if (tag.has("zaxis")) {
    return linalg::shortest_turn(Vector3d::UnitZ(), tag.direction("zaxis", Vector3d::UnitZ()));
  }
  return Quaterniond::Identity();
}

}  // namespace tether::scene::import::mjcf

// Tether: what a page shows of a scene: shapes, joints, springs. SPDX-License-Identifier:
// BSD-3-Clause
#include "scene_data.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "geometry/mesh.hpp"
#include "joints/list.hpp"
#include "json.hpp"

namespace tether::scene::player {

namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr int kAround = 24, kAroundOfMany = 10;  // segments of a circle
constexpr std::size_t kMany = 300;               // bodies
constexpr std::size_t kMostDots = 64;            // single points of a shape that are shown

double reach(const Shape& shape) {
  double out = 0;
  for (const Vector3d& p : mesh(shape, 8, 0).points) out = std::max(out, p.norm());
  return out;
}

/// Shapes of one form share it: spheres and boxes of every size, others that are equal.
class Forms {
 public:
  Forms(int around, const View& view) : around_(around), view_(view) {}

  /// Entries of a part: the number of the form and its scale.
  std::string part(const Shape& shape) {
    Shape form;
    form.kind = shape.kind;
    Vector3d scale = Vector3d::Ones();
    switch (shape.kind) {
      case ShapeKind::sphere:
        form.radius = 1;
        scale.setConstant(shape.radius / view_.length);
        return entry(form, scale, true, false);
      case ShapeKind::box:
        form.size.setOnes();
        scale = shape.size / view_.length;
        return entry(form, scale, false, false);
      case ShapeKind::capsule:
        form.radius = shape.radius;
        form.length = shape.length;
        return entry(form, scale, true, true);
      default:
        form.points = shape.points;
        return entry(form, scale, false, true);
    }
  }
  const std::string& list() const { return list_; }

 private:
  std::string entry(const Shape& form, const Vector3d& scale, bool round, bool in_metres) {
    Mesh m = mesh(form, around_, 0);
    std::string points, faces;
    for (const Vector3d& p : m.points)
      points += (points.empty() ? "" : ",") + json(in_metres ? Vector3d(p / view_.length) : p);
    for (const std::vector<std::size_t>& face : m.faces)
      faces += fmt::format("{}[{}]", faces.empty() ? "" : ",", fmt::join(face, ","));
    const std::string text =
        fmt::format("{{\"points\":[{}],\"faces\":[{}],\"round\":{}}}", points, faces, round);
    const auto [at, fresh] = known_.emplace(text, known_.size());
    if (fresh) list_ += (list_.empty() ? "" : ",") + text;
    return fmt::format("\"form\":{},\"scale\":{}", at->second, json(scale));
  }

  int around_;
  View view_;
  std::map<std::string, std::size_t> known_;
  std::string list_;
};

/// A point, given in world axes at t = 0, in the axes of its body; body -1: the world.
std::string anchor(const Scene& scene, int body, const Vector3d& at, const View& view) {
  Vector3d local = at - view.centre;
  if (body >= 0) {
    const Body& b = scene.bodies[static_cast<std::size_t>(body)];
    local = b.orientation.conjugate() * (at - b.position);
  }
  return fmt::format("{{\"body\":{},\"at\":{}}}", body, json(Vector3d(local / view.length)));
}

std::string turned(const Scene& scene, int body, const Vector3d& axis) {
  const Vector3d along = axis.stableNormalized();
  if (body < 0) return json(along);
  return json(
      Vector3d(scene.bodies[static_cast<std::size_t>(body)].orientation.conjugate() * along));
}

std::string joint_entry(const Scene& scene, const Joint& joint, const View& view) {
  std::string_view kind;
  for (const auto& [word, each] : kJointWords)
    if (each == joint.kind) kind = word;
  // A slider has no point: it is shown where its first body is.
  const bool slider = joint.kind == JointKind::slider;
  const int shown = joint.first >= 0 ? joint.first : joint.second;
  const Vector3d at =
      slider && shown >= 0 ? scene.bodies[static_cast<std::size_t>(shown)].position : joint.at;
  const std::string first = anchor(scene, slider ? shown : joint.first, at, view);
  const std::string second =
      slider ? first
             : anchor(scene, joint.second, joints::type(joint.kind).point_on_second(joint), view);
  return fmt::format(
      "{{\"name\":{},\"kind\":{},\"first\":{},\"second\":{},\"axis\":{},\"axis_body\":{}}}",
      json(joint.name), json(kind), first, second, turned(scene, joint.second, joint.axis),
      joint.second);
}

std::string spring_entry(const Scene& scene, const Spring& spring, const View& view) {
  return fmt::format("{{\"name\":{},\"first\":{},\"second\":{}}}", json(spring.name),
                     anchor(scene, spring.first, spring.at, view),
                     anchor(scene, spring.second, spring.at_second, view));
}

std::string part_entry(const Shape& shape, const View& view, Forms& forms) {
  const std::string place = fmt::format("\"position\":{},\"orientation\":{}",
                                        json(Vector3d(shape.position / view.length)),
                                        json(Quaterniond(shape.orientation)));
  if (shape.kind == ShapeKind::plane)
    return fmt::format("{{\"normal\":{},{}}}", json(Vector3d(shape.normal.stableNormalized())),
                       place);
  std::string dots;
  if (const Mesh m = mesh(shape, 8, 0); !m.single.empty())
    for (std::size_t k = 0; k < std::min(kMostDots, m.single.size()); ++k)
      dots += (k == 0 ? "" : ",") + json(Vector3d(m.points[m.single[k]] / view.length));
  if (!dots.empty()) return fmt::format("{{\"dots\":[{}],{}}}", dots, place);
  return fmt::format("{{{},{}}}", forms.part(shape), place);
}

}  // namespace

View view_of(const Scene& scene) {
  Eigen::AlignedBox3d box;
  const auto take = [&](const Vector3d& p) {
    if (p.allFinite()) box.extend(p);
  };
  double largest = 0;
  for (const Body& body : scene.bodies) {
    const bool plane = std::any_of(body.shapes.begin(), body.shapes.end(),
                                   [](const Shape& s) { return s.kind == ShapeKind::plane; });
    if (plane) continue;
    double around = 0;
    for (const Shape& shape : body.shapes) around = std::max(around, reach(shape));
    largest = std::max(largest, around);
    take(body.position - Vector3d::Constant(around));
    take(body.position + Vector3d::Constant(around));
  }
  for (const Joint& joint : scene.joints) take(joint.at);
  View out;
  if (box.isEmpty()) return out;
  out.centre = box.center();
  out.length = std::max(box.diagonal().norm() / 2, largest);
  if (!(out.length > 0) || !std::isfinite(out.length)) out.length = 1;
  return out;
}

std::string scene_entries(const Scene& scene, const std::vector<std::size_t>& moving,
                          const View& view) {
  Forms forms(scene.bodies.size() > kMany ? kAroundOfMany : kAround, view);
  std::map<std::size_t, std::size_t> number;  // of a moving body in the film
  for (std::size_t i = 0; i < moving.size(); ++i) number.emplace(moving[i], i);
  std::string bodies, joints, springs, centres;
  const auto add = [](std::string& to, const std::string& entry) {
    to += (to.empty() ? "" : ",\n") + entry;
  };
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const Body& body = scene.bodies[b];
    std::string parts;
    for (const Shape& shape : body.shapes) add(parts, part_entry(shape, view, forms));
    const auto film = number.find(b);
    add(bodies,
        fmt::format("{{\"name\":{},\"film\":{},\"position\":{},\"orientation\":{},\"parts\":[{}]}}",
                    json(body.name),
                    film == number.end() ? "null" : fmt::format("{}", film->second),
                    json(Vector3d((body.position - view.centre) / view.length)),
                    json(Quaterniond(body.orientation)), parts));
  }
  for (const Joint& joint : scene.joints) add(joints, joint_entry(scene, joint, view));
  for (const Spring& spring : scene.springs) add(springs, spring_entry(scene, spring, view));
  for (const CentralGravity& each : scene.central_gravity)
    add(centres, json(Vector3d((each.at - view.centre) / view.length)));
  const Vector3d down = scene.gravity.value_or(Vector3d::Zero());
  return fmt::format(
      "\"name\":{},\"length\":{},\"centre\":{},\"up\":{},\n\"bodies\":[{}],\n\"forms\":[{}],\n"
      "\"joints\":[{}],\n\"springs\":[{}],\n\"centres\":[{}]",
      json(scene.name), json(view.length), json(view.centre),
      json(Vector3d(down.norm() > 0 ? Vector3d(-down.stableNormalized()) : Vector3d::UnitZ())),
      bodies, forms.list(), joints, springs, centres);
}

}  // namespace tether::scene::player

// Tether: the certificate of a run as it is written. SPDX-License-Identifier: BSD-3-Clause
#include "sheet.hpp"

#include <tether/scene/words.hpp>

#include "joints/joint_rows.hpp"
#include "joints/joint_type.hpp"

namespace tether::scene::certificate {

Line& Line::operator<<(std::string_view text) {
  out_ += ' ';
  for (const char c : text) out_ += c == '\n' || c == '\r' ? ' ' : c;
  return *this;
}

namespace {

void put_bodies(const Scene& scene, const std::map<std::string, int>& materials, std::string& out) {
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const Body& body = scene.bodies[b];
    const auto material = materials.find(body.material);
    const Eigen::Matrix3d& I = body.inertia;
    Line(out, "body") << static_cast<int>(b) << (body.fixed ? 0.0 : body.mass) << I(0, 0) << I(1, 1)
                      << I(2, 2) << I(1, 2) << I(0, 2) << I(0, 1)
                      << (material == materials.end() ? -1 : material->second) << body.name;
    if (body.fixed) {
      BodyState still;
      still.position = body.position;
      still.orientation = body.orientation.normalized();
      Line(out, "to") << static_cast<int>(b) << still;
    }
    const SurfaceSpeed speed = body.surface.value_or(SurfaceSpeed{});
    if (body.surface || body.friction_axis)
      Line(out, "surface") << static_cast<int>(b) << speed.velocity << speed.angular_velocity
                           << body.friction_axis.value_or(Vector3d::Zero());
  }
}

}  // namespace

Friction friction(const Scene& scene, int first, int second, const std::vector<BodyState>& states) {
  const contact::Law law = scene.stepping.value_or(SteppingOptions{}).law;
  Friction out;
  out.associated = law == contact::Law::maximum_dissipation;
  if (law == contact::Law::frictionless) return out;
  for (const Pair& pair : scene.pairs)
    for (const auto& [a, b] : {std::pair(first, second), std::pair(second, first)}) {
      const Body &body = scene.bodies[at(a)], &other = scene.bodies[at(b)];
      if (body.material != pair.first || other.material != pair.second) continue;
      out.along = pair.friction;
      out.across = pair.friction_across.value_or(pair.friction);
      if (pair.is_elliptic())
        out.axis = states[at(a)].orientation * body.friction_axis.value_or(Vector3d::Zero());
      return out;
    }
  return out;
}

Sheet::Sheet(const Scene& scene) {
  std::string out = kCertificateHead;
  out += "1\n";
  std::map<std::string, int> materials;
  for (const Pair& pair : scene.pairs)
    for (const std::string& each : {pair.first, pair.second})
      materials.emplace(each, static_cast<int>(materials.size()));
  put_bodies(scene, materials, out);
  for (const Pair& pair : scene.pairs)
    if (pair.touch)
      Line(out, "pair") << materials[pair.first] << materials[pair.second] << pair.friction
                        << pair.friction_across.value_or(pair.friction) << pair.restitution
                        << pair.rolling << pair.torsional;
  Line(out, "gravity") << scene.gravity.value_or(Vector3d::Zero());
  put(out);
}

void Sheet::open(const std::string& file) {
  file_.emplace(file, 0);
  file_->put(std::exchange(waiting_, {}));
}

void Sheet::put(std::string_view lines) {
  lines_ += static_cast<long>(std::count(lines.begin(), lines.end(), '\n'));
  if (file_)
    file_->put(lines);
  else
    waiting_ += lines;
}

void Sheet::keep() {
  flush();
  file_->keep();
}

void Sheet::end() {
  keep();
  std::string out;
  Line(out, "end") << static_cast<double>(lines_);
  put(out);
  file_->keep();
}

void Sheet::begin(const Scene& scene, const char* engine, Source& source) {
  flush();
  source_ = &source;
  std::string out;
  const SteppingOptions stepping = scene.stepping.value_or(SteppingOptions{});
  Line(out, "engine") << engine << contact::name(stepping.gyroscopic)
                      << contact::name(stepping.law);
  const mechanics::Bodies bodies = mechanics::placed_bodies(scene);
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const Joint& joint = scene.joints[j];
    const joints::JointType& type = joints::type(joint.kind);
    Eigen::Matrix3d F;
    F.col(2) = joint.axis.norm() > 0 ? Vector3d(joint.axis.normalized()) : Vector3d::UnitZ();
    F.col(0) = joint.kind == JointKind::universal ? Vector3d(joint.axis_second.normalized())
                                                  : Vector3d(F.col(2).unitOrthogonal());
    F.col(1) = F.col(2).cross(F.col(0));
    const auto& A = bodies.frames[at(bodies.index(joint.first))];
    const auto B = joints::second_at_closing(joint, bodies.frames[at(bodies.index(joint.second))]);
    const Vector3d& on_second = type.point_on_second(joint);
    const Motion motion = joint.motion.value_or(Motion{});
    Line(out, "joint") << static_cast<int>(j) << joint.first << joint.second
                       << mechanics::point_in(A, joint.at)
                       << linalg::Quaternion(A.R.transpose() * F)
                       << mechanics::point_in(B, on_second)
                       << linalg::Quaternion(B.R.transpose() * F)
                       << joint.length.value_or((joint.at - on_second).norm())
                       << (joint.motion                                                         ? 1
                           : joint.limits || joint.motor || joint.spring || joint.friction != 0 ? 2
                                                                                                : 0)
                       << motion.rate << motion.amplitude << motion.frequency << motion.phase
                       << word(joint.kind) << joints::name_of(joint, j);
  }
  for (std::size_t k = 0; k < scene.couplings.size(); ++k) {
    const auto parts = couplings::polynomials(scene, scene.couplings[k]);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      Line line(out, "coupled");
      line << static_cast<int>(k) << scene.couplings[k].joints[i];
      for (const double coefficient : parts[i]) line << coefficient;
    }
  }
  put(out);
}

}  // namespace tether::scene::certificate

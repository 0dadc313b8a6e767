// Tether: writes instants of smooth motion to the certificate. SPDX-License-Identifier:
// BSD-3-Clause
#include "instant_scribe.hpp"

#include <Eigen/LU>

namespace tether::scene::certificate {

InstantScribe::InstantScribe(const Scene& scene, const Engine& engine, Accelerations accelerations,
                             Sheet& sheet)
    : scene_(scene),
      engine_(engine),
      accelerations_(std::move(accelerations)),
      sheet_(sheet),
      bodies_(mechanics::placed_bodies(scene)) {
  for (const std::size_t b : scene.moving()) {
    const Body& body = scene.bodies[b];
    bodies_.inertia[b] = {bodies_.moving++, body.mass, body.inertia, body.inertia.inverse()};
  }
  forces_ = effects::make_forces(scene, bodies_);
  loads_.resize(at(bodies_.moving));
  sheet.begin(scene, engine.name(), *this);
}

void InstantScribe::flush() {
  if (engine_.time() == last_) return;
  last_ = engine_.time();
  std::string out;
  Line(out, "instant") << last_ << static_cast<int>(engine_.events().size());
  const std::vector<std::array<Vector3d, 2>> rates = accelerations_();
  std::size_t slot = 0;
  for (const std::size_t b : scene_.moving()) {
    const BodyState& s = engine_.bodies()[b];
    mechanics::Frame<double>& f = bodies_.frames[b];
    f.x = s.position;
    f.R = s.orientation.toRotationMatrix();
    f.v = s.velocity;
    f.W = s.angular_velocity;
    bodies_.w[b] = f.R.transpose() * f.W;
    Line(out, "to") << static_cast<int>(b) << s;
    Line(out, "rate") << static_cast<int>(b) << rates[slot][0] << rates[slot][1];
    ++slot;
  }
  bodies_.time = last_;
  put_pushes(out);
  put_contacts(out);
  put_joints(out);
  sheet_.put(out);
}

void InstantScribe::put_pushes(std::string& out) {
  for (const auto& force : forces_) {
    const std::string_view name = force->name();
    // The judge has the gyroscopic term of its own; forces of joints have those of their springs.
    if (name == "gyroscopic term" || name == "joint springs") continue;
    for (mechanics::Load6& each : loads_)
      each.force = each.torque_body = each.torque_world = Vector3d::Zero();
    force->add(bodies_, loads_);
    for (const std::size_t b : scene_.moving()) {
      const mechanics::Load6& load = loads_[at(bodies_.inertia[b].slot)];
      const Vector3d torque = load.torque_world + bodies_.frames[b].R * load.torque_body;
      if (load.force.isZero(0) && torque.isZero(0)) continue;
      Line(out, "push") << static_cast<int>(b) << load.force << torque << name;
    }
  }
}

Vector3d InstantScribe::centre(int body) const {
  return body < 0 ? Vector3d(Vector3d::Zero()) : engine_.bodies()[at(body)].position;
}

Vector3d InstantScribe::surface_velocity(int body, const Vector3d& point) const {
  const auto& surface = scene_.bodies[at(body)].surface;
  if (!surface) return Vector3d::Zero();
  const linalg::Quaternion& q = engine_.bodies()[at(body)].orientation;
  return q * surface->velocity + (q * surface->angular_velocity).cross(point - centre(body));
}

void InstantScribe::put_contacts(std::string& out) const {
  for (const ContactState& c : engine_.contacts()) {
    Vector3d belts = surface_velocity(c.first, c.point) - surface_velocity(c.second, c.point);
    belts -= c.normal.dot(belts) * c.normal;
    Line(out, "contact") << c.first << c.second << c.point << c.point << c.normal << c.gap << 0.0
                         << belts << c.force << c.moment;
  }
}

void InstantScribe::put_joints(std::string& out) const {
  if (scene_.joints.empty()) return;
  const std::vector<JointForce> forces = engine_.forces().joints;
  for (std::size_t j = 0; j < forces.size(); ++j) {
    const JointForce& f = forces[j];
    const auto about = [&](int body) { return Vector3d((f.at - centre(body)).cross(f.force)); };
    Line(out, "pull") << static_cast<int>(j) << 0 << f.force
                      << Vector3d(f.moment + about(scene_.joints[j].first)) << Vector3d(-f.force)
                      << Vector3d(-f.moment - about(scene_.joints[j].second));
  }
}

}  // namespace tether::scene::certificate

// Tether: writes instants of smooth motion to the certificate. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include "certificate/joint_lines.hpp"
#include "certificate/sheet.hpp"
#include "effects/cable.hpp"
#include "effects/list.hpp"

namespace tether::scene::certificate {

/// Writes the state of an engine of this scene, and all forces with where they act. Forces of
/// effects are evaluated anew, in SI; those of joints and contacts are the engine's.
class InstantScribe final : public Source {
 public:
  /// Accelerations, linear and angular, of the moving bodies: m/s^2, rad/s^2, world axes.
  using Accelerations = std::function<std::vector<std::array<Vector3d, 2>>()>;
  InstantScribe(const Scene& scene, const Engine& engine, Accelerations accelerations,
                Sheet& sheet);
  ~InstantScribe() override { sheet_.leave(*this); }
  InstantScribe(const InstantScribe&) = delete;
  InstantScribe& operator=(const InstantScribe&) = delete;

  void flush() override;
  /// An impact at this time of bodies in the same places: velocities before and after, and its
  /// contacts, with impulses in the place of forces. `rest`: impulses that end accumulating
  /// impacts. What they leave of it joints have done. `exact`: velocities obey the law of impacts.
  void put_impact(double time, const std::vector<BodyState>& before,
                  const std::vector<BodyState>& after, const std::vector<ContactState>& contacts,
                  const std::vector<ContactState>& rest, bool exact);

 private:
  void put_pushes(std::string& out);
  void put_contacts(std::string& out) const {
    for (const ContactState& c : engine_.contacts()) {
      Vector3d belts = surface_velocity(c.first, c.point) - surface_velocity(c.second, c.point);
      belts -= c.normal.dot(belts) * c.normal;
      Line(out, "contact") << c.first << c.second << c.point << c.point << c.normal << c.gap << 0.0
                           << belts << c.force << c.moment;
    }
  }
  void put_reactions(double time, const Eigen::VectorXd& momenta, std::string& out);
  void set_places(double time, const std::vector<BodyState>& states) {
    bodies_.time = time;
    for (const std::size_t b : scene_.moving()) bodies_.put(static_cast<int>(b), states[b]);
  }
  Vector3d surface_velocity(int body, const Vector3d& point) const {
    const auto& surface = scene_.bodies[at(body)].surface;
    if (!surface) return Vector3d::Zero();
    const linalg::Quaternion& q = engine_.bodies()[at(body)].orientation;
    return q * surface->velocity + (q * surface->angular_velocity).cross(point - centre(body));
  }
  Vector3d centre(int body) const {
    return body < 0 ? Vector3d(Vector3d::Zero()) : engine_.bodies()[at(body)].position;
  }

  const Scene scene_;
  const Engine& engine_;
  Accelerations accelerations_;
  Sheet& sheet_;
  mechanics::Bodies bodies_;
  JointLines joints_;
  std::vector<std::unique_ptr<mechanics::Force>> forces_;
  std::vector<effects::CapstanSlip> slips_;
  std::vector<mechanics::Load6> loads_;
  double last_ = -1;  // s, written
};

}  // namespace tether::scene::certificate

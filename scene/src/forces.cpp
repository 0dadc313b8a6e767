// Tether: sums of forces. SPDX-License-Identifier: BSD-3-Clause
#include <tether/scene/engine.hpp>

namespace tether::scene {

Forces Engine::forces() const {
  throw SimulationError(std::string("the ") + name() + " engine does not tell forces");
}

Forces total_forces(const Engine& engine) {
  Forces out = engine.forces();
  const std::vector<BodyState>& bodies = engine.bodies();
  out.contact.assign(bodies.size(), Eigen::Vector3d::Zero());
  out.contact_moment = out.contact;
  const auto add = [&](int body, const Eigen::Vector3d& force, const Eigen::Vector3d& point) {
    if (body < 0) return;
    const auto i = static_cast<std::size_t>(body);
    out.contact[i] += force;
    out.contact_moment[i] += (point - bodies[i].position).cross(force);
  };
  for (const ContactState& c : engine.contacts()) {
    add(c.first, c.force, c.point);
    add(c.second, -c.force, c.point);
    if (c.moment.isZero(0)) continue;
    if (c.first >= 0) out.contact_moment[static_cast<std::size_t>(c.first)] += c.moment;
    if (c.second >= 0) out.contact_moment[static_cast<std::size_t>(c.second)] -= c.moment;
  }
  return out;
}

}  // namespace tether::scene

// Tether: kinds of events in words. SPDX-License-Identifier: BSD-3-Clause
#include <tether/scene/engine.hpp>
#include <tether/scene/words.hpp>

namespace tether::scene {

const char* name(ContactEvent::Kind kind) {
  constexpr std::array words = {"impact", "touch",     "lift",   "slip",      "stop",
                                "rest",   "jam",       "border", "hand_over", "resume",
                                "roll",   "roll_stop", "attach", "detach",    "break"};
  const auto k = static_cast<std::size_t>(kind);
  return k < words.size() ? words[k] : "?";
}

const std::vector<ContactEvent>& Engine::events() const {
  static const std::vector<ContactEvent> none;
  return none;
}

Counts& Counts::operator+=(Counts more) {
  std::vector<long> numbers;
  more.each([&](long n) { numbers.push_back(n); });
  std::size_t k = 0;
  each([&](long& n) { n += numbers[k++]; });
  return *this;
}

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

// Every value of scene.hpp has a word: the last one of each enumeration is found.

namespace tether::scene {

static_assert(word(kJointWords.back().second) != "?" &&
              word(InvariantKind::angular_momentum) == "angular_momentum" &&
              word(Formulation::index0) == "index0" && word(OnFailure::warn) == "warn" &&
              word(Otherwise::stepping) == "stepping" &&
              word(Quantity::spring_force) == "spring_force");

}  // namespace tether::scene

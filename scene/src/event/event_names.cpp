// Tether: kinds of events in words. SPDX-License-Identifier: BSD-3-Clause
#include <tether/scene/engine.hpp>
#include <utility>

namespace tether::scene {

const char* name(ContactEvent::Kind kind) {
  using Kind = ContactEvent::Kind;
  for (const auto& [each, word] :
       {std::pair(Kind::impact, "impact"), std::pair(Kind::touch, "touch"),
        std::pair(Kind::lift, "lift"), std::pair(Kind::slip, "slip"), std::pair(Kind::stop, "stop"),
        std::pair(Kind::rest, "rest"), std::pair(Kind::jam, "jam"),
        std::pair(Kind::border, "border"), std::pair(Kind::hand_over, "hand_over"),
        std::pair(Kind::resume, "resume"), std::pair(Kind::roll, "roll"),
        std::pair(Kind::roll_stop, "roll_stop")})
    if (each == kind) return word;
  return "?";
}

const std::vector<ContactEvent>& Engine::events() const {
  static const std::vector<ContactEvent> none;
  return none;
}

}  // namespace tether::scene

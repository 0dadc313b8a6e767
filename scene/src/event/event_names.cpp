// Tether: kinds of events in words. SPDX-License-Identifier: BSD-3-Clause
#include <tether/scene/engine.hpp>

namespace tether::scene {

const char* name(ContactEvent::Kind kind) {
  switch (kind) {
    case ContactEvent::Kind::impact:
      return "impact";
    case ContactEvent::Kind::touch:
      return "touch";
    case ContactEvent::Kind::lift:
      return "lift";
    case ContactEvent::Kind::slip:
      return "slip";
    case ContactEvent::Kind::stop:
      return "stop";
    case ContactEvent::Kind::rest:
      return "rest";
    case ContactEvent::Kind::jam:
      return "jam";
    case ContactEvent::Kind::border:
      return "border";
    case ContactEvent::Kind::hand_over:
      return "hand_over";
    case ContactEvent::Kind::resume:
      return "resume";
    case ContactEvent::Kind::roll:
      return "roll";
    case ContactEvent::Kind::roll_stop:
      return "roll_stop";
  }
  return "?";
}

const std::vector<ContactEvent>& Engine::events() const {
  static const std::vector<ContactEvent> none;
  return none;
}

}  // namespace tether::scene

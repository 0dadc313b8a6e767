// Tether: contacts that steps have left closed. SPDX-License-Identifier: BSD-3-Clause
//
// After a step a contact that is closed has a gap and a normal speed of the step's order. Its
// bodies are moved until it has none, as the driver of events keeps it from there on: velocities by
// impulses, places by the least move.
#include <cmath>
#include <tether/linalg/index.hpp>
#include <tether/scene/engine.hpp>

#include "driver.hpp"

namespace tether::scene::event {

using linalg::at;

std::optional<std::vector<int>> closed_contacts(Model& model, const StartState& state) {
  std::vector<int> out;
  for (int i = 0; i < model.contacts(); ++i) {
    if (!model.law(i).has_normal()) continue;
    if (model.is_apart(i, state.gap)) continue;
    double rate = 0;
    const double gap = model.gap(i, rate), margin = model.margin(i);
    if (gap > state.gap || margin < -state.gap) continue;
    if (gap >= -state.gap && std::abs(rate) <= state.speed)
      out.push_back(i);
    else if (gap < 0 && (gap >= -state.gap || std::isinf(margin)))
      return {};  // what lies deep behind a face with a border may be beside it
  }
  return out;
}

void Driver::close_contacts(const StartState& start) {
  const std::optional<std::vector<int>> closed = closed_contacts(model_, start);
  if (!closed) throw std::invalid_argument("bodies overlap");
  if (closed->empty()) return;
  // Frictionless: what slips slips on.
  std::vector<ContactMode> modes(at(model_.contacts()));
  for (const int i : without_doubles(*closed)) {
    modes[at(i)].mode = Mode::slide;
    modes[at(i)].direction = VectorXd::Unit(model_.tangents(), 0);
  }
  motion_.choose(time_, y_, std::move(modes));
  motion_.settle_velocities(time_, y_);
  motion_.set_levels(std::vector<double>(at(model_.contacts()), 0.0));
  motion_.leave_energy_free();
  if (!move_onto_constraints(motion_, local_, time_, y_))
    throw SimulationError("contacts of a step cannot be closed together");
  motion_.choose(time_, y_, std::vector<ContactMode>(at(model_.contacts())));
  model_.set(time_, y_.data(), y_.data() + motion_.coordinates());
  model_.settle();
}

}  // namespace tether::scene::event

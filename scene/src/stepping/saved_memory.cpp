// Tether: the memory of a stepper in a saved state. SPDX-License-Identifier: BSD-3-Clause
#include "saved_memory.hpp"

#include <cmath>
#include <string_view>

namespace tether::scene::stepping {

using binary::Archive;
using contact::StepperMemory;

namespace {

void exchange(Archive& io, contact::WarmStart& start) {
  std::size_t k = 0;
  io.list(start.ids, [&](std::uint64_t& id) {
    if (io.reads()) start.impulses.emplace_back();
    io(id, start.impulses[k++]);
  });
}

void exchange(Archive& io, int bodies, contact::StepContacts& contacts) {
  std::size_t k = 0;
  io.list(contacts.points, [&](contact::PointContact& c) {
    if (io.reads()) {
      contacts.gaps.emplace_back();
      contacts.impulses.emplace_back();
    }
    io(c.first, c.second, c.mu, c.bias, c.id, c.r1, c.r2, c.normal);
    io(contacts.gaps[k], contacts.impulses[k]);
    io.demand(std::isfinite(c.mu) && std::isfinite(c.bias) && std::isfinite(contacts.gaps[k]),
              "a number in it is not finite");
    io.demand(c.first >= 0 && c.first < bodies && c.second >= -1 && c.second < bodies,
              "it has contacts of no bodies");
    ++k;
  });
}

// Whether they fit the bodies is looked at by the stepper.
void exchange(Archive& io, int bodies, StepperMemory::Sleep& sleep) {
  io.list(sleep.bodies, [&](StepperMemory::Rest& r) {
    io(r.slow, r.island, r.fresh, r.acceleration, r.angular_acceleration);
    io.demand(std::isfinite(r.slow), "a number in it is not finite");
  });
  exchange(io, bodies, sleep.contacts);
  io.list(sleep.neighbours, [&](StepperMemory::Neighbour& n) {
    io(n.body, n.island, n.position, n.orientation, n.velocity, n.angular_velocity);
  });
}

}  // namespace

void exchange(Archive& io, int bodies, StepperMemory& m) {
  const auto demand_not_negative = [&](std::initializer_list<double> numbers, const char* why) {
    for (const double x : numbers) io.demand(x >= 0 && std::isfinite(x), why);
  };
  io(m.steps);
  io.demand(m.steps >= 0, "it has no time");
  for (contact::WarmStart* each : {&m.contacts, &m.corrections, &m.bounces}) exchange(io, *each);
  io.list(m.spins, [&](StepperMemory::Spin& spin) {
    Eigen::Map<Eigen::Vector4d> orientation(spin.orientation.data());
    io(spin.momentum, spin.angular_velocity, orientation);
  });
  exchange(io, bodies, m.last);
  io(m.penetration, m.residual, m.status);
  io.demand(contact::name(m.status) != std::string_view("?"), "no contact problem ends so");
  StepperMemory::Control& control = m.control;
  io(control.next, control.last, control.error, control.length);
  demand_not_negative({control.next, control.last, control.error, control.length},
                      "no part of a step is so long");
  io(m.drift, m.vibration.frequency, m.vibration.acceleration);
  demand_not_negative({m.drift}, "joints are off by no length");
  demand_not_negative({m.vibration.frequency, m.vibration.acceleration},
                      "joints vibrate at no frequency");
  io.list(m.vibration.mode, [&](contact::Vector6d& v) { io(v); });
  exchange(io, bodies, m.sleep);
  io(m.cuts);
  demand_not_negative({m.cuts}, "steps are cut at no impacts");
}

}  // namespace tether::scene::stepping

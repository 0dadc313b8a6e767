// Tether: the memory of a stepper in a saved state. SPDX-License-Identifier: BSD-3-Clause
#include "saved_memory.hpp"

#include <cmath>
#include <stdexcept>
#include <string_view>

#include "output/binary.hpp"

namespace tether::scene::stepping {

using contact::PointContact;
using contact::StepperMemory;
using contact::WarmStart;

namespace {

template <class... Vector>
void demand_finite(const Vector&... vectors) {
  if (!(vectors.allFinite() && ...))
    throw std::runtime_error("the saved state is damaged: a number in it is not finite");
}

void put(std::ostream& out, const WarmStart& start) {
  binary::put(out, static_cast<std::uint64_t>(start.ids.size()));
  for (std::size_t k = 0; k < start.ids.size(); ++k) {
    binary::put(out, start.ids[k]);
    binary::put_array(out, start.impulses[k]);
  }
}

// Lists grow by what is there: a damaged length asks for no memory.
WarmStart get_warm_start(std::istream& in) {
  WarmStart start;
  for (auto left = binary::get<std::uint64_t>(in); left > 0; --left) {
    start.ids.push_back(binary::get<std::uint64_t>(in));
    binary::get_array(in, start.impulses.emplace_back());
    demand_finite(start.impulses.back());
  }
  return start;
}

void put(std::ostream& out, const PointContact& c) {
  binary::put(out, c.first, c.second, c.mu, c.bias, c.id);
  binary::put_array(out, c.r1, c.r2, c.normal);
}

PointContact get_contact(std::istream& in, int bodies) {
  PointContact c;
  binary::get(in, c.first, c.second, c.mu, c.bias, c.id);
  binary::get_array(in, c.r1, c.r2, c.normal);
  demand_finite(c.r1, c.r2, c.normal, Eigen::Vector2d(c.mu, c.bias));
  if (c.first < 0 || c.first >= bodies || c.second < -1 || c.second >= bodies)
    throw std::runtime_error("the saved state is damaged: it has contacts of no bodies");
  return c;
}

void put(std::ostream& out, const contact::StepContacts& contacts) {
  binary::put(out, static_cast<std::uint64_t>(contacts.points.size()));
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    put(out, contacts.points[k]);
    binary::put(out, contacts.gaps[k]);
    binary::put_array(out, contacts.impulses[k]);
  }
}

void get_contacts(std::istream& in, int bodies, contact::StepContacts& contacts) {
  for (auto left = binary::get<std::uint64_t>(in); left > 0; --left) {
    contacts.points.push_back(get_contact(in, bodies));
    binary::get(in, contacts.gaps.emplace_back());
    binary::get_array(in, contacts.impulses.emplace_back());
    demand_finite(contacts.impulses.back(), Eigen::Matrix<double, 1, 1>(contacts.gaps.back()));
  }
}

void put(std::ostream& out, const StepperMemory::Sleep& sleep) {
  binary::put(out, static_cast<std::uint64_t>(sleep.bodies.size()));
  for (const StepperMemory::Rest& r : sleep.bodies) {
    binary::put(out, r.slow, static_cast<std::int32_t>(r.island),
                static_cast<std::int32_t>(r.fresh));
    binary::put_array(out, r.acceleration, r.angular_acceleration);
  }
  put(out, sleep.contacts);
  binary::put(out, static_cast<std::uint64_t>(sleep.neighbours.size()));
  for (const StepperMemory::Neighbour& n : sleep.neighbours) {
    binary::put(out, static_cast<std::int32_t>(n.body), static_cast<std::int32_t>(n.island));
    binary::put_array(out, n.position, n.orientation.coeffs(), n.velocity, n.angular_velocity);
  }
}

// Whether they fit the bodies is looked at by the stepper.
void get_sleep(std::istream& in, int bodies, StepperMemory::Sleep& sleep) {
  std::int32_t island = 0, flag = 0;
  for (auto left = binary::get<std::uint64_t>(in); left > 0; --left) {
    StepperMemory::Rest& r = sleep.bodies.emplace_back();
    binary::get(in, r.slow, island, flag);
    r.island = island;
    r.fresh = flag != 0;
    binary::get_array(in, r.acceleration, r.angular_acceleration);
    demand_finite(r.acceleration, r.angular_acceleration, Eigen::Matrix<double, 1, 1>(r.slow));
  }
  get_contacts(in, bodies, sleep.contacts);
  for (auto left = binary::get<std::uint64_t>(in); left > 0; --left) {
    StepperMemory::Neighbour& n = sleep.neighbours.emplace_back();
    binary::get(in, flag, island);
    n.body = flag;
    n.island = island;
    binary::get_array(in, n.position, n.orientation.coeffs(), n.velocity, n.angular_velocity);
    demand_finite(n.position, n.orientation.coeffs(), n.velocity, n.angular_velocity);
  }
}

// As get_sleep.
void get_vibration(std::istream& in, StepperMemory::Vibration& vibration) {
  binary::get(in, vibration.frequency, vibration.acceleration);
  for (const double x : {vibration.frequency, vibration.acceleration})
    if (!(x >= 0) || !std::isfinite(x))
      throw std::runtime_error("the saved state is damaged: joints vibrate at no frequency");
  for (auto left = binary::get<std::uint64_t>(in); left > 0; --left) {
    binary::get_array(in, vibration.mode.emplace_back());
    demand_finite(vibration.mode.back());
  }
}

}  // namespace

void put_memory(std::ostream& out, const StepperMemory& m) {
  binary::put(out, static_cast<std::int64_t>(m.steps));
  put(out, m.contacts);
  put(out, m.corrections);
  put(out, m.bounces);
  binary::put(out, static_cast<std::uint64_t>(m.spins.size()));
  for (const StepperMemory::Spin& spin : m.spins) {
    binary::put_array(out, spin.momentum, spin.angular_velocity);
    for (const double x : spin.orientation) binary::put(out, x);
  }
  put(out, m.last);
  binary::put(out, m.penetration, m.residual, static_cast<std::int32_t>(m.status));
  binary::put(out, m.control.next, m.control.last, m.control.error, m.control.length, m.drift);
  binary::put(out, m.vibration.frequency, m.vibration.acceleration,
              static_cast<std::uint64_t>(m.vibration.mode.size()));
  for (const contact::Vector6d& v : m.vibration.mode) binary::put_array(out, v);
  put(out, m.sleep);
  binary::put(out, m.cuts);
}

StepperMemory get_memory(std::istream& in, int bodies) {
  StepperMemory m;
  m.steps = static_cast<long>(binary::get<std::int64_t>(in));
  if (m.steps < 0) throw std::runtime_error("the saved state is damaged: it has no time");
  m.contacts = get_warm_start(in);
  m.corrections = get_warm_start(in);
  m.bounces = get_warm_start(in);
  for (auto left = binary::get<std::uint64_t>(in); left > 0; --left) {
    StepperMemory::Spin& spin = m.spins.emplace_back();
    binary::get_array(in, spin.momentum, spin.angular_velocity);
    for (double& x : spin.orientation) binary::get(in, x);
    demand_finite(spin.momentum, spin.angular_velocity,
                  Eigen::Map<const Eigen::Vector4d>(spin.orientation.data()));
  }
  get_contacts(in, bodies, m.last);
  std::int32_t status = 0;
  binary::get(in, m.penetration, m.residual, status);
  m.status = static_cast<contact::Status>(status);
  if (contact::name(m.status) == std::string_view("?"))
    throw std::runtime_error("the saved state is damaged: no contact problem ends so");
  binary::get(in, m.control.next, m.control.last, m.control.error, m.control.length);
  for (const double x : {m.control.next, m.control.last, m.control.error, m.control.length})
    if (!(x >= 0) || !std::isfinite(x))
      throw std::runtime_error("the saved state is damaged: no part of a step is so long");
  binary::get(in, m.drift);
  if (!(m.drift >= 0) || !std::isfinite(m.drift))
    throw std::runtime_error("the saved state is damaged: joints are off by no length");
  get_vibration(in, m.vibration);
  get_sleep(in, bodies, m.sleep);
  binary::get(in, m.cuts);
  if (!(m.cuts >= 0) || !std::isfinite(m.cuts))
    throw std::runtime_error("the saved state is damaged: steps are cut at no impacts");
  return m;
}

}  // namespace tether::scene::stepping

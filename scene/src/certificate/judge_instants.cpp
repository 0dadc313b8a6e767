// Tether: the laws of an instant and from one to the next, by forces. SPDX-License-Identifier:
// BSD-3-Clause
#include "judging.hpp"

#include <array>
#include <cmath>

namespace tether::scene::certificate {

// Places by the mean of the velocities, over whatever time has passed.
void Judge::follows(const States& to) {
  for (const auto& [number, s] : to) {
    const JudgedBody& b = body(number);
    if (!b.state) continue;
    const double h = when_ - b.time;
    expect("time goes on", -h, kRounding * (1 + std::abs(when_)), b.name);
    expect("places follow velocities", (s.x - b.state->x - h / 2 * (s.v + b.state->v)).norm(),
           kLeads * (s.x.norm() + 0.1) + std::abs(h) / 4 * (s.v - b.state->v).norm(), b.name);
  }
}

// Equations of motion: accelerations by the forces, as the joints allow them.
void Judge::instant(const States& to) {
  Loads loads, none;
  for (const auto& [number, s] : to) body(number).state = s, loads[number];
  push(1, to, loads);
  pull(to, loads, none);
  push_by_contacts(loads);
  const States now = told_states();
  double speed = 0;
  each("contact",
       [&](const auto& n, const auto&) { contact(JudgedContact(n), 0, now, now, now, speed); });
  Instant here;
  States rates;
  here.time = when_, here.events = block_->numbers[1];
  each("rate", [&](const auto& n, const auto&) {
    rates[n[0]].v = vector(n, 1), rates[n[0]].w = vector(n, 4);
  });
  for (const auto& [number, s] : to) {
    const JudgedBody& b = body(number);
    const auto rate = rates.find(number);
    if (rate == rates.end()) throw Damaged("an acceleration is missing");
    const Load& load = loads[number];
    const Vector3d momentum = b.spin(s.q, s.w), spun = b.spin(s.q, rate->second.w);
    const Vector3d gyroscopic = s.w.cross(momentum);
    expect("equations of motion", (b.mass * rate->second.v - load.force).norm(),
           kEquations * (load.forces + b.mass * rate->second.v.norm()), b.name);
    expect("equations of rotation", (spun + gyroscopic - load.torque).norm(),
           kEquations * (load.torques + gyroscopic.norm() + spun.norm()) +
               kRounding * (b.inertia.norm() + load.forces),
           b.name);
    here.bodies[number] = {
        {Led{s.v, rate->second.v, 0.1}, Led{momentum, load.torque, 0.1 * b.inertia.trace()},
         Led{s.x, s.v, 0.1}, Led{Vector3d::Zero(), s.w, 1}},
        s.q};
  }
  for (const auto& [number, joint] : joints_) accelerates(joint, rates);
  if (!past_.empty() && past_.back().events != here.events) past_.clear();
  past_.push_back(std::move(here));
  if (past_.size() > 4) past_.pop_front();
  for (const auto& [number, s] : to)
    if (past_.size() == 4) leads(number);
}

// The errors of a joint's speeds do not grow.
void Judge::accelerates(const JudgedJoint& joint, const States& rates) {
  Told s[2];
  Vector3d a[2], alpha[2];
  double scale = 0, spins = 0;
  for (int k = 0; k < 2; ++k) {
    s[k] = state(joint.body[k]);
    const auto found = rates.find(joint.body[k]);
    const Told rate = found == rates.end() ? Told() : found->second;
    a[k] = rate.v, alpha[k] = rate.w;
    const double spin = alpha[k].norm() + s[k].w.squaredNorm();
    spins += spin;
    scale += a[k].norm() + spin * joint.arms();
  }
  const auto [off, bad] = joint.accelerations(s, a, alpha, when_);
  expect("joint's acceleration", off, kInstant * scale + 1e-6, joint.name);
  expect("joint's angular acceleration", bad, kInstant * spins + 1e-6, joint.name);
}

// From the second to the third of four instants, by fourth order.
void Judge::leads(double number) {
  const std::string& name = body(number).name;
  const double h = past_[2].time - past_[1].time;
  if (!(h > 0)) return expect("time goes on", 1, 0, name);
  std::array<const Instant::One*, 4> one{};
  for (std::size_t i = 0; i < 4; ++i) {
    const auto found = past_[i].bodies.find(number);
    if (found == past_[i].bodies.end()) throw Damaged(name + " is not in every instant");
    one[i] = &found->second;
  }
  const char* const laws[] = {"momentum between instants", "angular momentum between instants",
                              "places between instants", "orientation between instants"};
  for (std::size_t k = 0; k < 4; ++k) {
    std::array<Vector3d, 4> f;
    for (std::size_t i = 0; i < 4; ++i) f[i] = one[i]->led[k].rate;
    const Vector3d g0 = (f[2] - f[0]) / (past_[2].time - past_[0].time);
    const Vector3d g1 = (f[3] - f[1]) / (past_[3].time - past_[1].time);
    const Vector3d way = h / 2 * (f[1] + f[2]) + h * h / 12 * (g0 - g1);
    const Vector3d &from = one[1]->led[k].value, &to = one[2]->led[k].value;
    const bool turns = k == 3;
    const double off =
        turns ? apart(rotation(way) * one[1]->q, one[2]->q) : (to - from - way).norm();
    const double bent = turns ? h * h / 6 * f[1].cross(f[2]).norm() : 0;
    expect(laws[k], off,
           kLeads * (from.norm() + to.norm() + one[1]->led[k].tiny) +
               h * h / 20 * (g0.norm() + g1.norm()) +
               h / 5 * (f[3] - 3 * f[2] + 3 * f[1] - f[0]).norm() + bent,
           name);
  }
}

}  // namespace tether::scene::certificate

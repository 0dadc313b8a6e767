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

void Judge::touch(const JudgedContact& c) {
  const std::string what = name_of(c);
  const auto [law, pair] = friction(c);
  const Told s[2] = {state(c.first), state(c.second)};
  double inverse = 0, fast = 1;
  Vector3d w = c.slip;
  for (int k = 0; k < 2; ++k) {
    const JudgedBody& b = body(k == 0 ? c.first : c.second);
    if (b.mass > 0) inverse += 1 / b.mass;
    const Vector3d v = s[k].v + s[k].w.cross(c.on_first - s[k].x);
    fast += v.norm();
    w += k == 0 ? v : Vector3d(-v);
  }
  expect("law of contact", natural_residual(law, c.n, inverse * c.x, w),
         kInstant * fast + kBalance * c.x.norm() * inverse, what);
  expect("contact closed", std::max(std::abs(c.gap), (c.on_first - c.on_second).norm()), kInstant,
         what);
  moments(c, pair, what);
}

// Equations of motion: accelerations by the forces, as the joints allow them.
void Judge::instant(const States& to) {
  for (const auto& [number, s] : to) body(number).state = s;
  Loads loads, none;
  for (const auto& [number, s] : to) loads[number];
  push(1, to, loads);
  pull(to, loads, none);
  each("contact", [&](const auto& n, const auto&) {
    touch(JudgedContact(n));
    load_contact(JudgedContact(n), loads);
  });
  Instant now;
  std::size_t told = 0;
  now.time = when_, now.events = block_->numbers[1];
  for (const auto& [number, load] : loads) {
    const JudgedBody& b = body(number);
    const Vector3d spin = b.spin(b.state->q, b.state->w);
    now.bodies[number] = {*b.state, load.force / b.mass,
                          b.unspin(b.state->q, load.torque - b.state->w.cross(spin)), load.torque,
                          spin};
  }
  each("rate", [&](const auto& n, const auto&) {
    const auto one = now.bodies.find(n[0]);
    if (one == now.bodies.end()) throw Damaged("an acceleration of no body of the instant");
    accelerates(body(n[0]), one->second, vector(n, 1), vector(n, 4), loads[n[0]]);
    ++told;
  });
  if (told != now.bodies.size()) throw Damaged("an acceleration is missing");
  for (const auto& [number, joint] : joints_) {
    Told s[2];
    Vector3d a[2], alpha[2];
    double scale = 0, spins = 0;
    for (int k = 0; k < 2; ++k) {
      s[k] = state(joint.body[k]);
      const auto one = now.bodies.find(joint.body[k]);
      const bool moves = one != now.bodies.end();
      a[k] = moves ? one->second.a : Vector3d::Zero();
      alpha[k] = moves ? one->second.alpha : Vector3d::Zero();
      const double spin = alpha[k].norm() + s[k].w.squaredNorm();
      spins += spin;
      scale += a[k].norm() + spin * joint.arms();
    }
    const auto [off, bad] = joint.accelerations(s, a, alpha, when_);
    const double drive = std::abs(joint.way(when_, 2));
    expect("joint's acceleration", off, kInstant * (scale + drive) + 1e-6, joint.name);
    expect("joint's angular acceleration", bad, kInstant * (spins + drive) + 1e-6, joint.name);
  }
  if (!past_.empty() && past_.back().events != now.events) past_.clear();
  past_.push_back(std::move(now));
  if (past_.size() > 4) past_.pop_front();
  if (past_.size() < 4) return;
  for (const auto& [number, one] : past_[1].bodies)
    if (past_[2].bodies.count(number) > 0) leads(number, one, past_[2].bodies.at(number));
}

// The accelerations told, which the next laws are for, are those of the forces.
void Judge::accelerates(const JudgedBody& b, Instant::One& one, const Vector3d& a,
                        const Vector3d& alpha, const Load& load) {
  expect("equations of motion", b.mass * (a - one.a).norm(),
         kEquations * (load.forces + b.mass * a.norm()), b.name);
  const Vector3d gyroscopic = one.s.w.cross(one.spin);
  const double size = load.torques + gyroscopic.norm() + b.spin(one.s.q, alpha).norm();
  expect("equations of rotation", b.spin(one.s.q, alpha - one.alpha).norm(),
         kEquations * size + kRounding * (b.inertia.norm() + load.forces), b.name);
  one.a = a, one.alpha = alpha;
}

// From the second to the third of four instants.
void Judge::leads(double number, const Instant::One& from, const Instant::One& to) {
  const double h = past_[2].time - past_[1].time;
  const JudgedBody& b = body(number);
  if (!(h > 0)) return expect("time goes on", 1, 0, b.name);
  std::array<const Instant::One*, 4> one{};
  for (std::size_t i = 0; i < 4; ++i) {
    const auto found = past_[i].bodies.find(number);
    if (found == past_[i].bodies.end()) throw Damaged(b.name + " is not in every instant");
    one[i] = &found->second;
  }
  const auto lead = [&](const char* law, double tiny, const auto& value, const auto& rate) {
    const Vector3d before = value(*one[1]), after = value(*one[2]);
    std::array<Vector3d, 4> f;
    for (std::size_t i = 0; i < 4; ++i) f[i] = rate(*one[i]);
    const Vector3d g0 = (f[2] - f[0]) / (past_[2].time - past_[0].time);
    const Vector3d g1 = (f[3] - f[1]) / (past_[3].time - past_[1].time);
    const Vector3d off = after - before - h / 2 * (f[1] + f[2]) - h * h / 12 * (g0 - g1);
    expect(law, off.norm(),
           kLeads * (before.norm() + after.norm() + tiny) + h * h / 20 * (g0.norm() + g1.norm()) +
               h / 5 * (f[3] - 3 * f[2] + 3 * f[1] - f[0]).norm(),
           b.name);
  };
  using One = Instant::One;
  lead(
      "momentum between instants", 0.1, [](const One& o) { return o.s.v; },
      [](const One& o) { return o.a; });
  lead(
      "angular momentum between instants", 0.1 * b.inertia.trace(),
      [](const One& o) { return o.spin; }, [](const One& o) { return o.torque; });
  lead(
      "places between instants", 0.1, [](const One& o) { return o.s.x; },
      [](const One& o) { return o.s.v; });
  const Vector3d way = h / 2 * (from.s.w + to.s.w) + h * h / 12 * (from.alpha - to.alpha);
  const double bent =
      h * h / 6 * from.s.w.cross(to.s.w).norm() + h * h / 60 * (from.alpha - to.alpha).norm();
  expect("orientation between instants", apart(rotation(way) * from.s.q, to.s.q), kLeads + bent,
         b.name);
}

}  // namespace tether::scene::certificate

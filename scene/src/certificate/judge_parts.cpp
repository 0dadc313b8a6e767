// Tether: the laws of a sub-step, by impulses. SPDX-License-Identifier: BSD-3-Clause
#include "judging.hpp"

#include <cmath>

namespace tether::scene::certificate {

void Judge::part(const States& to) {
  const double dt = block_->numbers[1];
  if (!(dt >= 0)) throw Damaged("a part of negative length");
  Loads loads, late;
  for (const auto& [number, end] : to) {
    state(number);
    loads[number], late[number];
    expect("time goes on", std::abs(body(number).time - when_), kRounding * (1 + std::abs(when_)),
           body(number).name);
  }
  push(dt, to, loads);
  pull(to, loads, late);
  each("law", [&](const auto& n, const auto&) {
    for (std::size_t i = 10; i + 6 < n.size(); i += 7)
      if (to.count(n[i]) > 0) loads[n[i]].add(n[9] * vector(n, i + 1), n[9] * vector(n, i + 4));
  });
  const States came = told_states();
  const auto moved = [&] {
    States out = came;
    for (const auto& [number, load] : loads) out[number] = body(number).struck(load);
    return out;
  };
  const States free = moved();
  push_by_contacts(loads);
  const States mid = moved();
  contacts(dt, came, free, mid);
  each("law", [&](const auto& n, const auto&) { law_of_joint(n, dt, came, mid); });
  States placed;
  each("placed", [&](const auto& n, const auto&) {
    body(n[0]);
    placed[n[0]].x = vector(n, 1), placed[n[0]].q = quaternion(n, 4);
  });
  for (const auto& [number, end] : to) {
    const JudgedBody& b = body(number);
    const auto found = placed.find(number);
    moves(b, dt, loads[number], late[number], found == placed.end() ? *b.state : found->second,
          end);
  }
}

void Judge::contacts(double dt, const States& came, const States& free, const States& mid) {
  const double claimed = block_->numbers[3];
  double worst = 0, speed = 0;
  std::string name = "contacts";
  each("contact", [&](const auto& n, const auto&) {
    const JudgedContact c(n);
    const double off = contact(c, dt, came, free, mid, speed);
    if (off > worst) worst = off, name = name_of(c);
  });
  expect("residual as claimed", std::abs(claimed - worst), 1e-4 * worst + kRounding * speed, name);
  if (block_->numbers[2] == 0)
    expect("law of contact", worst, std::max(kLaw, 1e2 * claimed_) * speed, name);
}

// A limit (0), or what is bounded (1) or sprung (2): its impulse is within bounds, and at one
// where its speed is not as wanted.
void Judge::law_of_joint(const std::vector<double>& n, double dt, const States& came,
                         const States& mid) {
  const auto joint = joints_.find(n[0]);
  if (joint == joints_.end()) throw Damaged("a law of a joint that is not told");
  const double kind = n[1], gap = n[2], rate = n[4], x = n[9], bound = dt > 0 ? n[5] * dt : 0;
  double speed = 0, before = 0, inverse = 0;
  for (std::size_t i = 10; i + 6 < n.size(); i += 7) {
    const JudgedBody& b = body(n[i]);
    const Vector3d f = vector(n, i + 1), m = vector(n, i + 4);
    speed += f.dot(mid.at(n[i]).v) + m.dot(mid.at(n[i]).w);
    before += f.dot(came.at(n[i]).v) + m.dot(came.at(n[i]).w);
    if (b.mass > 0) inverse += f.squaredNorm() / b.mass + m.dot(b.unspin(b.state->q, m));
  }
  const double open = dt > 0 ? gap / dt : 0, slip = speed - rate;
  std::vector<double> wanted = {rate};
  if (kind == 0) wanted = {std::min(-open, 0.0), 0, -n[3] * before};
  double off = INFINITY;
  for (const double each : wanted) {
    double y = x;
    if (block_->numbers[2] == 0)
      y = kind == 2 ? -dt * (n[7] * (n[6] + dt * slip) + n[8] * slip)
                    : x - (speed - each) / std::max(inverse, 1e-300);
    y = kind == 0 ? std::max(0.0, y) : std::max(-bound, std::min(bound, y));
    off = std::min(off, std::abs(x - y) * inverse);
  }
  expect("limit, motor, friction or spring", off,
         kInstant * (std::abs(x) * inverse + std::abs(speed) + std::abs(before) + std::abs(rate) +
                     std::abs(open)),
         joint->second.name);
}

// Linear balance; places by the velocity at the end, or along the parabola of free fall.
void Judge::moves(const JudgedBody& b, double dt, const Load& load, const Load& late,
                  const Told& placed, const Told& end) {
  const Told& begin = *b.state;
  const Vector3d change = end.v - begin.v;
  expect("balance of momentum", (b.mass * change - load.force - late.force).norm(),
         kBalance * (load.forces + late.forces +
                     b.mass * (change.norm() + kRounding * (end.v.norm() + begin.v.norm()))),
         b.name);
  const Vector3d v = end.v - late.force / b.mass;
  Vector3d left = end.x - placed.x - dt * v;
  const double rounding = kRounding * (end.x.norm() + dt * v.norm());
  if (left.norm() > rounding) left += 0.5 * dt * dt * gravity_;
  expect("places move as velocities", left.norm(), rounding + 1e-6 * dt * v.norm(), b.name);
  double gaps = 0;
  each("contact", [&](const auto& n, const auto&) { gaps += std::abs(n[11]); });
  expect("corrections close gaps", (placed.x - begin.x).norm(),
         10 * gaps + 0.01 * kHolds * (1 + end.x.norm()), b.name);
  turns(b, dt, load, late, placed, end);
}

// Angular balance about the centre; a correction of the orientation turns the momentum, too.
void Judge::turns(const JudgedBody& b, double dt, const Load& load, const Load& late,
                  const Told& placed, const Told& end) {
  const Quaterniond q = b.state->q, corrected = placed.q * q.conjugate();
  const Vector3d before = b.spin(q, b.state->w), middle = corrected * (before + load.torque);
  const bool keeps = keeps_momentum_ && !b.is_round();
  const Vector3d after = b.spin(keeps ? end.q : placed.q, end.w);
  const double scale = load.torques + late.torques + (after - before).norm() +
                       1e-8 * (after.norm() + before.norm()) +
                       1e-6 * load.forces * (1 + end.x.norm());
  const double turned = late.torques > 0 ? apart(corrected, Quaterniond::Identity()) : 0;
  expect("balance of angular momentum", (after - middle - late.torque).norm(),
         kBalance * scale + turned * middle.norm(), b.name);
  Quaterniond there;
  if (keeps) {
    const Vector3d w0 = placed.q.conjugate() * b.unspin(placed.q, middle);
    const Vector3d w1 = end.q.conjugate() * b.unspin(end.q, middle);
    there = placed.q * rotation(0.5 * dt * (w0 + w1));
  } else {
    there = rotation(dt * (end.w - b.unspin(end.q, late.torque))) * placed.q;
  }
  expect("orientation moves as velocities", apart(there, end.q),
         kRounding + 1e-6 * dt * end.w.norm(), b.name);
}

// Twice the two halves less the whole sub-step; a body that no moment acts on keeps its halves.
void Judge::extrapolated(const States& to) {
  for (const auto& [number, s] : to) {
    const auto found = trial_.find(number);
    if (found == trial_.end()) throw Damaged("an extrapolation without its trial");
    const JudgedBody& b = body(number);
    const Told half = state(number), whole = found->second;
    const double bound = kRounding * (1 + half.x.norm()) + 1e-6 * apart(half, whole);
    const double spun = std::min((s.w - 2 * half.w + whole.w).norm(), (s.w - half.w).norm());
    const double turned =
        std::min(apart(half.q * whole.q.conjugate() * half.q, s.q), apart(half.q, s.q));
    for (const double off :
         {(s.x - 2 * half.x + whole.x).norm(), (s.v - 2 * half.v + whole.v).norm(), spun, turned})
      expect("extrapolation", off, bound, b.name);
  }
  trial_.clear();
}

}  // namespace tether::scene::certificate

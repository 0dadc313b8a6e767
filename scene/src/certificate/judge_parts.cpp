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
  States free;
  for (const auto& [number, b] : bodies_)
    if (b.state) free[number] = *b.state;
  const auto moved = [&](States& out) {
    for (const auto& [number, end] : to) {
      const JudgedBody& b = body(number);
      out[number].v = b.state->v + loads[number].force / b.mass;
      out[number].w = b.state->w + b.unspin(b.state->q, loads[number].torque);
    }
  };
  States mid = free;
  moved(free);
  each("contact", [&](const auto& n, const auto&) { load_contact(JudgedContact(n), loads); });
  moved(mid);
  each("via", [&](const auto& n, const auto&) {
    body(n[0]);
    mid[n[0]].v = vector(n, 1), mid[n[0]].w = vector(n, 4);
  });
  contacts(dt, free, mid);
  laws(dt, mid);
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

void Judge::contacts(double dt, const States& free, const States& mid) {
  const bool composed = block_->numbers[2] != 0;
  const double claimed = block_->numbers[3];
  double worst = 0, speed = 0;
  std::string name = "contacts";
  std::map<std::pair<double, double>, std::vector<Vector3d>> points;
  each("contact", [&](const auto& n, const auto&) {
    points[{n[0], n[1]}].push_back(vector(n, 2));
  });
  each("contact", [&](const auto& n, const auto&) {
    const JudgedContact c(n);
    double patch = 0;
    for (const Vector3d& p : points[{n[0], n[1]}]) patch = std::max(patch, (p - c.on_first).norm());
    const double off = contact(c, patch, dt, free, mid, speed);
    if (off > worst) worst = off, name = name_of(c);
  });
  expect("residual as claimed", std::abs(claimed - worst), 1e-4 * worst + kRounding * speed, name);
  if (!composed) expect("law of contact", worst, std::max(kLaw, 1e2 * claimed_) * speed, name);
}

// Returns its natural residual; `patch`: how far the other points of both bodies are; `speed`: the
// largest so far.
double Judge::contact(const JudgedContact& c, double patch, double dt, const States& free,
                      const States& mid, double& speed) {
  const std::string what = name_of(c);
  const auto [law, pair] = friction(c);
  const Told s[2] = {state(c.first), state(c.second)};
  const auto relative = [&](const Told& a, const Told& b) -> Vector3d {
    return a.v + a.w.cross(c.on_first - s[0].x) - b.v - b.w.cross(c.on_second - s[1].x);
  };
  const Vector3d came = relative(s[0], s[1]), comes = relative(free.at(c.first), free.at(c.second));
  const Told end[2] = {mid.at(c.first), mid.at(c.second)};
  const Told comes_as[2] = {free.at(c.first), free.at(c.second)};
  const double push = c.x.dot(c.n), size = c.x.norm();
  expect("points of contact", (c.on_first - c.on_second).norm(),
         std::abs(c.gap) * (1 + kLaw) + kRounding * (1 + c.on_first.norm()), what);
  expect("unit normal", std::abs(c.n.norm() - 1), kRounding, what);
  moments(c, pair, what);
  double inverse = 0, turning = 0, fast = 0, round = INFINITY, flat = 0;
  for (int k = 0; k < 2; ++k) {
    const JudgedBody& b = body(k == 0 ? c.first : c.second);
    const Vector3d from = c.on(k == 0 ? c.first : c.second) - s[k].x;
    const double arm = from.norm(), height = std::abs(from.dot(c.n));
    if (b.mass > 0) {
      inverse += 1 / b.mass;
      round = std::min(round, arm);
      flat = std::max(flat, 5 * b.inertia.trace() / b.mass / std::max(height, 1e-300));
    }
    turning += s[k].w.norm() + end[k].w.norm();
    fast += s[k].v.norm() + end[k].v.norm() + comes_as[k].v.norm() + end[k].w.norm() * arm;
  }
  const double most = std::max(came.norm(), comes.norm());
  const double tiny = kBalance * size + (inverse > 0 ? kRounding * most / inverse : 0);
  expect("contacts push", -push, tiny, what);
  expect("Coulomb's cone", (c.x - push * c.n).norm(), std::max(law.along, law.across) * push + tiny,
         what);
  speed = std::max(speed, came.norm() + comes.norm() + c.slip.norm() + std::abs(c.bias) +
                              size * inverse + gravity_.norm() * dt);
  // Laws hold in the middle of the sub-step, whose frames and points are this far from its start:
  // bodies turn, their normal does along an edge, and points move in their face, or along a curve:
  // an ellipsoid's radius is at most a^2 / height, and a^2 5/2 of trace / mass; twice that, as mass
  // may lie inside.
  const double bends = most > 0 ? dt * most * most / std::max(round, 1e-300) : 0;
  const double rolls = dt * (comes_as[0].w - comes_as[1].w).squaredNorm() * flat;
  const double middle = dt * turning * fast + (comes_as[0].w - comes_as[1].w).norm() * patch +
                        bends + rolls + kRounding * (1 + fast);
  const double approach = -came.dot(c.n), approaches = -comes.dot(c.n);
  double off = std::abs(c.bias - (dt > 0 ? std::max(c.gap, 0.0) / dt : 0));
  if (approaches * dt > c.gap || dt == 0)
    off = std::min({off, std::abs(c.bias),
                    std::abs(c.bias + pair.restitution * std::min(approach, approaches))});
  if (block_->numbers[2] == 0) expect("restitution, or gap that closes", off, middle, what);
  Vector3d belts = body(c.first).belt_at(c.on_first) - body(c.second).belt_at(c.on_second);
  belts -= belts.dot(c.n) * c.n;
  expect("surface speed", (c.slip - belts).norm(), middle, what);
  return natural_residual(law, c.n, inverse * c.x,
                          relative(end[0], end[1]) + c.slip + c.bias * c.n);
}

void Judge::laws(double dt, const States& mid) {
  const bool composed = block_->numbers[2] != 0;
  each("law", [&](const auto& n, const auto&) {
    const auto joint = joints_.find(n[0]);
    if (joint == joints_.end()) throw Damaged("a law of a joint that is not told");
    const double gap = n[2], rate = n[4], bound = dt > 0 ? n[5] * dt : 0, x = n[9];
    double speed = 0, came = 0, inverse = 0;
    for (std::size_t i = 10; i + 6 < n.size(); i += 7) {
      const JudgedBody& b = body(n[i]);
      const Vector3d f = vector(n, i + 1), m = vector(n, i + 4);
      const Told now = state(n[i]);
      speed += f.dot(mid.at(n[i]).v) + m.dot(mid.at(n[i]).w);
      came += f.dot(now.v) + m.dot(now.w);
      if (b.mass > 0) inverse += f.squaredNorm() / b.mass + m.dot(b.unspin(now.q, m));
    }
    const std::string& what = joint->second.name;
    const double scale = kInstant * (std::abs(x) * inverse + std::abs(speed) + std::abs(came) +
                                     std::abs(rate) + (dt > 0 ? std::abs(gap) / dt : 0));
    if (n[1] == 0) {
      const double open = gap > 0 && dt > 0 ? -gap / dt : 0;
      expect("limit", std::max(-x * inverse, open - speed), scale, what);
      double off = INFINITY;
      for (const double floor : {open, 0.0, -n[3] * came})
        off = std::min(off, std::abs(std::min(x * inverse, speed - floor)));
      if (!composed) expect("limit", off, scale, what);
      return;
    }
    if (bound < INFINITY) expect("bound", std::abs(x), bound * (1 + kBalance), what);
    const double wanted = speed - rate;
    const double y = n[1] == 2 ? -dt * (n[7] * (n[6] + dt * wanted) + n[8] * wanted)
                               : x - wanted / std::max(inverse, 1e-300);
    const double off = std::abs(x - std::max(-bound, std::min(bound, y))) * inverse;
    if (!composed) expect("motor, friction or spring", off, scale, what);
  });
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
    expect("extrapolation", (s.x - 2 * half.x + whole.x).norm(), bound, b.name);
    expect("extrapolation", (s.v - 2 * half.v + whole.v).norm(), bound, b.name);
    expect("extrapolation", std::min((s.w - 2 * half.w + whole.w).norm(), (s.w - half.w).norm()),
           bound, b.name);
    expect("extrapolation",
           std::min(apart(half.q * whole.q.conjugate() * half.q, s.q), apart(half.q, s.q)), bound,
           b.name);
  }
  trial_.clear();
}

}  // namespace tether::scene::certificate

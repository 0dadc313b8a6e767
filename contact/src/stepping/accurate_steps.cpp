// Tether: steps in parts that keep an accuracy. SPDX-License-Identifier: BSD-3-Clause
//
// method, section 7. Each part is taken whole and in two halves. Where contacts do the same in all
// three, 2 halves - whole is of order 2 (Deuflhard's extrapolation of the Euler step); else the
// halves are kept. Lengths by H211b (Soederlind, Digital filters in adaptive time-stepping, 2003).
#include <algorithm>
#include <cmath>
#include <limits>
#include <tether/linalg/index.hpp>

#include "stepping/stepper_parts.hpp"

namespace tether::contact {

using detail::PartState;
using Active = detail::PartControl::Active;
using Eigen::Vector3d;

namespace {

constexpr double kSafety = 0.8;      // of the wanted accuracy
constexpr double kShortest = 1e-9;   // of a step: parts that are accepted as they are
constexpr double kAtOnce = 0.1;      // of the accuracy: what an impact may come too early
constexpr int kManyImpacts = 1000;   // in a step: from then on they end it in as many parts at most
constexpr double kSlips = 1 - 1e-6;  // of the cone
constexpr double kStill = 0.01;      // of the accuracy: a slip that moves nothing in a part
constexpr double kBeforeEnd = 0.95;  // of a part: a switch that ends it
constexpr int kRolls = 4, kSpins = 6;  // Active::what of moments at their bound, else the next

Vector3d rotation_between(const linalg::Quaternion& from, const linalg::Quaternion& to) {
  linalg::Quaternion d = to * from.conjugate();
  if (d.w() < 0) d.coeffs() = -d.coeffs();
  const double sine = d.vec().norm();
  return sine > 0 ? Vector3d(2 * std::atan2(sine, d.w()) / sine * d.vec())
                  : Vector3d(Vector3d::Zero());
}

Vector3d slip_of(const std::vector<RigidBody>& motion, const PointContact& c) {
  const auto velocity = [&](int body, const Vector3d& r) -> Vector3d {
    if (body < 0) return Vector3d::Zero();
    const RigidBody& b = motion[linalg::at(body)];
    return b.velocity + b.angular_velocity.cross(r);
  };
  const Vector3d v = velocity(c.first, c.r1) - velocity(c.second, c.r2);
  return v - c.normal.dot(v) * c.normal;
}

/// The zero behind b of the line through (ta, a) and (tb, b), b behind a; infinite: there is none.
double zero_behind(double ta, double a, double tb, double b) {
  if (!(b > 0 && a > b)) return std::numeric_limits<double>::infinity();
  return tb + b * (tb - ta) / (a - b);
}

}  // namespace

void Stepper::Implementation::remember_part(PartState& p) const {
  p.position = bodies.position;
  p.orientation = bodies.orientation;
  p.motion = bodies.motion;
  p.spin = motion.spins();
}

void Stepper::Implementation::restore_part(const PartState& p) {
  bodies.position = p.position;
  bodies.orientation = p.orientation;
  bodies.motion = p.motion;
  motion.spins() = p.spin;
}

// With impulses of the last part as far as they go with its length.
void Stepper::Implementation::advance_part(double time, double length) {
  if (solver && parts.control.length > 0)
    solver->scale_warm_start(std::min(2.0, length / parts.control.length));
  parts.control.length = length;
  advance(whole(time, length));
}

// Lists what contacts have done in the part just taken.
void Stepper::Implementation::list_active(double length, std::vector<Active>& list) const {
  list.clear();
  if (joints) list_laws(length, list);
  if (!near) return;
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    const PointContact& c = contacts.points[k];
    const Vector3d& x = contacts.impulses[k];
    if (x.isZero(0)) continue;
    const double normal = c.normal.dot(x);
    const Vector3d tangent = x - normal * c.normal;
    const bool slips = c.mu > 0 && !(tangent.norm() < kSlips * c.mu * normal);
    list.push_back({c.id, slips ? 2 : 1, slips ? tangent : Vector3d::Zero()});
    Active& a = list.back();
    a.force = normal / length;
    a.margin = (c.mu * normal - tangent.norm()) / length;
    for (const int body : {c.first, c.second})
      if (body >= 0) a.size = std::max(a.size, parts.radius[at(body)]);
    a.came = slip_of(parts.before.motion, c);
    a.speed = slip_of(bodies.motion, c).norm();
  }
  if (rolling) list_moments(list);
  for (const detail::Impact& i : impacts->list())
    if (moment(i, length).early < length)
      list.push_back({contacts.points[at(i.contact)].id, 3, Vector3d::Zero()});
  std::sort(list.begin(), list.end(), [](const Active& a, const Active& b) {
    return a.id != b.id ? a.id < b.id : a.what < b.what;
  });
}

// As contacts, behind all of them: limits that press stick, laws at their bound slip.
void Stepper::Implementation::list_laws(double length, std::vector<Active>& list) const {
  std::vector<detail::LawState> laws;
  joints->list_laws(laws);
  for (std::size_t k = 0; k < laws.size(); ++k) {
    const detail::LawState& law = laws[k];
    if (law.impulse == 0) continue;
    list.push_back({~std::uint64_t{0} - k, law.side != 0 ? 2 : 1, law.side * Vector3d::UnitX()});
    Active& a = list.back();
    a.force = std::abs(law.impulse) / length;
    a.margin = (law.bound - std::abs(law.impulse)) / length;
    a.size = law.body < 0 ? 1 : parts.radius[at(law.body)];
    a.came = law.came * Vector3d::UnitX();
    a.speed = std::abs(law.left);
  }
}

// Moments that their bound holds, and others.
void Stepper::Implementation::list_moments(std::vector<Active>& list) const {
  const std::vector<Vector3d>& moments = contacts.moments;
  for (std::size_t k = 0; k < std::min(moments.size(), contacts.points.size()); ++k) {
    const PointContact& c = contacts.points[k];
    const double normal = c.normal.dot(contacts.impulses[k]);
    if (!(normal > 0)) continue;
    const Meeting& m = near->meeting(c);
    const Vector3d spin = c.normal.dot(moments[k]) * c.normal, roll = moments[k] - spin;
    if (m.rolling > 0) {
      const bool turns = !(roll.norm() < kSlips * m.rolling * normal);
      list.push_back({c.id, turns ? kRolls : kRolls + 1, turns ? roll : Vector3d::Zero()});
    }
    if (m.torsional > 0) {
      const bool turns = !(spin.norm() < kSlips * m.torsional * normal);
      list.push_back({c.id, turns ? kSpins : kSpins + 1, turns ? spin : Vector3d::Zero()});
    }
  }
}

bool Stepper::Implementation::same(const std::vector<Active>& a, const std::vector<Active>& b) {
  return a.size() == b.size() &&
         std::equal(a.begin(), a.end(), b.begin(), [](const Active& p, const Active& q) {
           return p.id == q.id && p.what == q.what && (p.slip.isZero(0) || p.slip.dot(q.slip) > 0);
         });
}

// When an approach over this gap ends in a part of this length, and how much too early it may be
// ended, by the speed that it has then. Forces add a t to it: gap = came t + a t^2, as a part that
// ends there sees it. size: what the accuracy is relative to.
Stepper::Implementation::Moment Stepper::Implementation::moment(double gap, double came,
                                                                double comes, double size,
                                                                double length) const {
  gap = std::max(0.0, gap);
  const double a = (comes - came) / length;
  const double speed = std::sqrt(std::max(0.0, came * came + 4 * a * gap));
  return {detail::closing_time(gap, came, a),
          kAtOnce * options.accuracy * size / std::max(speed, 1e-300)};
}

Stepper::Implementation::Moment Stepper::Implementation::moment(const detail::Impact& i,
                                                                double length) const {
  const PointContact& c = contacts.points[at(i.contact)];
  return moment(contacts.gaps[at(i.contact)], i.came, i.comes, near->size(c), length);
}

// Time of the first impact that matters. 0: now, within what the accuracy allows. Infinite: there
// is none.
double Stepper::Implementation::first_impact(double length, double& at_once) const {
  double first = std::numeric_limits<double>::infinity();
  const auto take = [&](const Moment& m) {
    if (!(m.early < length)) return;  // whenever in this part
    at_once = std::min(at_once, m.early);
    first = std::min(first, m.when > m.early ? (1 - 1e-3) * m.when : 0);
  };
  if (joints)
    for (const detail::Strike& s : joints->strikes())
      take(moment(s.gap, s.came, s.comes, s.body < 0 ? 1 : parts.radius[at(s.body)], length));
  if (near)
    for (const detail::Impact& i : impacts->list()) take(moment(i, length));
  return first;
}

// When the first contact that does not do the same all over a part lifts, stops or begins to slip,
// by straight lines: slips from where the part begins or, where they end in its first half, from
// the part before it; forces from that. Infinite: none is known to.
double Stepper::Implementation::first_switch(double length) const {
  double first = std::numeric_limits<double>::infinity();
  const auto find = [](const std::vector<Active>& list, std::uint64_t id) -> const Active* {
    const auto found = std::find_if(list.begin(), list.end(),
                                    [&](const Active& a) { return a.id == id && a.what <= 2; });
    return found != list.end() ? &*found : nullptr;
  };
  for (const Active& a : parts.active[1]) {
    if (a.what > 2) continue;
    const Active* past = find(parts.past, a.id);
    // Friction stops what slips, or has turned against what it did at the start.
    const double came = a.came.norm();
    if (came * length > kStill * options.accuracy * a.size &&
        (a.what == 1 || a.slip.dot(a.came) > 0)) {
      const double way = 2 * parts.past_length;
      first = std::min(first, past != nullptr && past->what == 2
                                  ? zero_behind(-way, past->came.norm(), 0, came)
                                  : length / 4);
      continue;
    }
    const Active* then = find(parts.active[2], a.id);
    const bool turns =
        then != nullptr && a.what == 2 && then->what == 2 && !(then->slip.dot(a.slip) > 0);
    if (then != nullptr && then->what == a.what && !turns) continue;
    if (then != nullptr && a.what == 2) {
      first = std::min(first, zero_behind(0, came, length / 2, a.speed));
      continue;
    }
    if (past == nullptr || past->what != a.what) continue;
    const bool lifts = then == nullptr;
    first = std::min(first, zero_behind(-parts.past_length / 2, lifts ? past->force : past->margin,
                                        length / 4, lifts ? a.force : a.margin));
  }
  return first;
}

// Difference of the halves, in the bodies, from the whole part; 1: the accuracy. It is relative to
// the size of each body; velocities, where they are smooth, count by what they move it in the part.
double Stepper::Implementation::part_error(const PartState& whole, double length,
                                           bool smooth) const {
  double most = 0;
  for (const int k : motion.moving()) {
    const std::size_t i = at(k);
    const double R = parts.radius[i];
    most = std::max({most, (bodies.position[i] - whole.position[i]).norm() / R,
                     rotation_between(whole.orientation[i], bodies.orientation[i]).norm()});
    if (!smooth) continue;
    const RigidBody &now = bodies.motion[i], &was = whole.motion[i];
    most = std::max({most, length * (now.velocity - was.velocity).norm() / R,
                     length * (now.angular_velocity - was.angular_velocity).norm()});
  }
  return most / (kSafety * options.accuracy);
}

// 2 halves - whole. A body that no moment acts on keeps its momentum exactly, and its halves.
void Stepper::Implementation::extrapolate(const PartState& whole) {
  for (const int k : motion.moving()) {
    const std::size_t i = at(k);
    bodies.position[i] += bodies.position[i] - whole.position[i];
    bodies.motion[i].velocity += bodies.motion[i].velocity - whole.motion[i].velocity;
  }
  const auto turn = [&](int k) {
    const std::size_t i = at(k);
    const Vector3d more = rotation_between(whole.orientation[i], bodies.orientation[i]);
    if (!more.isZero(0))
      bodies.orientation[i] = (detail::exponential(more) * bodies.orientation[i]).normalized();
    Vector3d& w = bodies.motion[i].angular_velocity;
    w += w - whole.motion[i].angular_velocity;
  };
  const std::vector<detail::FreeSpin>& spins = motion.spins();
  std::size_t next = 0;
  for (const int k : motion.moving()) {
    if (next < spins.size() && motion.free_long()[next] == k) {
      const std::size_t s = next++;
      if (spins[s].L == whole.spin[s].L) continue;
    }
    turn(k);
  }
  motion.turn_inertias(bodies);
}

// One part, of at most this length. Returns the length that was taken.
double Stepper::Implementation::take_part(double time, double length, bool shortened,
                                          double shortest) {
  const detail::Judgement before = judged();
  remember_part(parts.before);
  const auto back = [&] {
    restore_part(parts.before);
    set_judged(before);
  };
  bool cut = shortened, switched = false;
  for (;;) {
    advance_part(time, length);
    if (!(length > shortest)) break;
    double at_once = length;
    const double impact = first_impact(length, at_once);
    if (impact < length) {
      back();
      ++counts.rejected;
      cut = true;
      const bool now = !(impact > 0);
      length = std::max(now ? std::min(at_once, length) : impact, shortest);
      if (!now) continue;
      advance_part(time, length);
      break;
    }
    list_active(length, parts.active[0]);
    remember_part(parts.whole);
    back();
    advance_part(time, length / 2);
    list_active(length / 2, parts.active[1]);
    advance_part(time + length / 2, length / 2);
    list_active(length / 2, parts.active[2]);
    const bool smooth =
        same(parts.active[0], parts.active[1]) && same(parts.active[1], parts.active[2]);
    const double error = std::max(part_error(parts.whole, length, smooth), 1e-4);
    const double when = smooth || switched ? length : first_switch(length);
    if (when > shortest && when < kBeforeEnd * length && error > 0.05) {
      back();
      ++counts.rejected;
      length = when;
      cut = switched = true;
      continue;
    }
    if (error > 1) {
      back();
      ++counts.rejected;
      length = std::max(length * std::clamp(0.9 / (smooth ? std::sqrt(error) : error), 0.1, 0.7),
                        shortest);
      cut = false;
      parts.control.last = 0;
      continue;
    }
    parts.past = parts.active[2];
    parts.past_length = length / 2;
    if (smooth) {
      extrapolate(parts.whole);
      if (joints) joints->begin(bodies, time + length);
    }
    double factor = std::pow(error, -0.125);
    factor *= parts.control.last > 0 ? std::pow(parts.control.error, -0.125) *
                                           std::pow(length / parts.control.last, -0.25)
                                     : factor;
    const double next = length * std::clamp(factor, 0.3, 2.0);
    parts.control.next = cut ? std::max(parts.control.next, next) : next;
    parts.control.last = length;
    parts.control.error = error;
    break;
  }
  ++counts.parts;
  return length;
}

void Stepper::Implementation::advance_accurately(double start, double length) {
  double done = 0, shortest = kShortest * length;
  parts.past.clear();  // a run that goes on from a saved state has none
  for (int taken_parts = 0; done < length; ++taken_parts) {
    if (taken_parts == kManyImpacts) shortest = length / kManyImpacts;
    const double left = length - done, least = std::min(shortest, left);
    double next = parts.control.next > 0 ? std::max(parts.control.next, least) : left;
    const bool shortened = next > 0.5 * left;
    if (shortened) next = next < left ? left / 2 : left;
    const double taken = take_part(start + done, next, shortened, least);
    done = taken < left ? done + taken : length;
  }
}

}  // namespace tether::contact

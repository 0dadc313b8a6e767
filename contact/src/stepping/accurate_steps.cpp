// Tether: sub-steps that keep an accuracy. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/accurate_steps.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

constexpr int kManyImpacts =
    1000;  // in a step: from then on they end it in as many sub-steps at most
constexpr double kSlips = 1 - 1e-6;  // of the cone

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
    const RigidBody& b = motion[at(body)];
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

// Scales the warm start by the ratio of lengths, at most 2. False: joints have halved the sub-step,
// and would halve its halves; the difference of the two tells nothing of its error.
bool AccurateSteps::advance(double time, double length) {
  const long before = halving_.halved_by_joints();
  if (stepper_.solver && control.length > 0)
    stepper_.solver->scale_warm_start(std::min(2.0, length / control.length));
  control.length = length;
  halving_.advance(halving_.whole(time, length));
  return halving_.halved_by_joints() == before;
}

// Lists what contacts have done in the sub-step just taken.
void AccurateSteps::list_active(double length, std::vector<Active>& list) const {
  list.clear();
  if (stepper_.joints) list_laws(length, list);
  if (!stepper_.near) return;
  for (std::size_t k = 0; k < stepper_.contacts.points.size(); ++k) {
    const PointContact& c = stepper_.contacts.points[k];
    const Vector3d& x = stepper_.contacts.impulses[k];
    if (x.isZero(0)) continue;
    const double normal = c.normal.dot(x);
    Vector3d tangent = x - normal * c.normal;
    if (c.mu > 0 && stepper_.near->meeting(c).is_elliptic()) {
      const std::array<Vector3d, 2> along = stepper_.near->scaled_tangents(c);
      tangent.setZero();  // in the circular cone of the scaled tangents
      for (const Vector3d& t : along)
        if (const double size = t.norm(); size > 0) tangent += t.dot(x) / (size * size * size) * t;
    }
    const bool slips = c.mu > 0 && !(tangent.norm() < kSlips * c.mu * normal);
    list.push_back(
        {c.id, slips ? Behaviour::slips : Behaviour::sticks, slips ? tangent : Vector3d::Zero()});
    Active& a = list.back();
    a.force = normal / length;
    a.margin = (c.mu * normal - tangent.norm()) / length;
    for (const int body : {c.first, c.second})
      if (body >= 0) a.size = std::max(a.size, stepper_.sizes[at(body)]);
    a.came = slip_of(before_.motion, c);
    a.speed = slip_of(stepper_.bodies.motion, c).norm();
  }
  if (stepper_.cones.near != nullptr) list_moments(list);
  for (const Impact& i : stepper_.impacts->list())
    if (moment(i, length).early < length)
      list.push_back(
          {stepper_.contacts.points[at(i.contact)].id, Behaviour::strikes, Vector3d::Zero()});
  std::sort(list.begin(), list.end(), [](const Active& a, const Active& b) {
    return a.id != b.id ? a.id < b.id : a.behaviour < b.behaviour;
  });
}

// As contacts, behind all of them: limits that press stick, laws at their bound slip.
void AccurateSteps::list_laws(double length, std::vector<Active>& list) const {
  std::vector<LawState> laws;
  stepper_.joints->list_laws(laws);
  for (std::size_t k = 0; k < laws.size(); ++k) {
    const LawState& law = laws[k];
    if (law.impulse == 0 || std::isinf(law.bound)) continue;  // springs never slip
    list.push_back({~std::uint64_t{0} - k, law.side != 0 ? Behaviour::slips : Behaviour::sticks,
                    law.side * Vector3d::UnitX()});
    Active& a = list.back();
    a.force = std::abs(law.impulse) / length;
    a.margin = (law.bound - std::abs(law.impulse)) / length;
    a.size = law.body < 0 ? 1 : stepper_.sizes[at(law.body)];
    a.came = law.came * Vector3d::UnitX();
    a.speed = std::abs(law.left);
  }
}

// Moments that their bound holds, and others.
void AccurateSteps::list_moments(std::vector<Active>& list) const {
  const std::vector<Vector3d>& moments = stepper_.contacts.moments;
  for (std::size_t k = 0; k < std::min(moments.size(), stepper_.contacts.points.size()); ++k) {
    const PointContact& c = stepper_.contacts.points[k];
    const double normal = c.normal.dot(stepper_.contacts.impulses[k]);
    if (!(normal > 0)) continue;
    const Meeting& m = stepper_.near->meeting(c);
    const Vector3d spin = c.normal.dot(moments[k]) * c.normal, roll = moments[k] - spin;
    const auto add = [&](double bound, const Vector3d& moment, Behaviour moves, Behaviour rests) {
      const bool turns = !(moment.norm() < kSlips * bound * normal);
      if (bound > 0)
        list.push_back({c.id, turns ? moves : rests, turns ? moment : Vector3d::Zero()});
    };
    add(m.rolling, roll, Behaviour::rolls, Behaviour::rolls_not);
    add(m.torsional, spin, Behaviour::spins, Behaviour::spins_not);
  }
}

bool AccurateSteps::same(const std::vector<Active>& a, const std::vector<Active>& b) {
  return a.size() == b.size() &&
         std::equal(a.begin(), a.end(), b.begin(), [](const Active& p, const Active& q) {
           return p.id == q.id && p.behaviour == q.behaviour &&
                  (p.slip.isZero(0) || p.slip.dot(q.slip) > 0);
         });
}

// Time at which an approach over this gap ends, and how much earlier the accuracy allows it to end,
// by its speed then. Forces add a t to the speed: gap = came t + a t^2 for a sub-step that ends
// there. size: length that the accuracy is relative to.
AccurateSteps::Moment AccurateSteps::moment(double gap, double came, double comes, double size,
                                            double length) const {
  gap = std::max(0.0, gap);
  const double a = (comes - came) / length;
  const double speed = std::sqrt(std::max(0.0, came * came + 4 * a * gap));
  return {closing_time(gap, came, a),
          0.1 * stepper_.options.accuracy * size / std::max(speed, 1e-300)};
}

AccurateSteps::Moment AccurateSteps::moment(const Impact& i, double length) const {
  const PointContact& c = stepper_.contacts.points[at(i.contact)];
  return moment(stepper_.contacts.gaps[at(i.contact)], i.came, i.comes, stepper_.near->size(c),
                length);
}

// Time of the first impact that matters. 0: now, within the accuracy. Infinite: there is none.
double AccurateSteps::first_impact(double length, double& at_once) const {
  double first = std::numeric_limits<double>::infinity();
  const auto take = [&](const Moment& m) {
    if (!(m.early < length)) return;  // any time within this sub-step is early enough
    at_once = std::min(at_once, m.early);
    first = std::min(first, m.when > m.early ? (1 - 1e-3) * m.when : 0);
  };
  if (stepper_.joints)
    for (const Strike& s : stepper_.joints->strikes())
      take(moment(s.gap, s.came, s.comes, s.body < 0 ? 1 : stepper_.sizes[at(s.body)], length));
  if (stepper_.near)
    for (const Impact& i : stepper_.impacts->list()) take(moment(i, length));
  return first;
}

// Time at which the first contact changes its behaviour within a sub-step: lifts, stops or slips,
// by linear interpolation. Slips start from the begin of the sub-step or, if they end in its first
// half, from the sub-step before; forces start from that one. Infinite: none is known.
double AccurateSteps::first_switch(double length) const {
  double first = std::numeric_limits<double>::infinity();
  const auto find = [](const std::vector<Active>& list, std::uint64_t id) -> const Active* {
    const auto found = std::find_if(list.begin(), list.end(), [&](const Active& a) {
      return a.id == id && a.behaviour <= Behaviour::slips;
    });
    return found != list.end() ? &*found : nullptr;
  };
  for (const Active& a : active_[1]) {
    if (a.behaviour > Behaviour::slips) continue;
    const Active* past = find(past_, a.id);
    // Friction stops what slips, or has turned against what it did at the start.
    const double came = a.came.norm();
    if (came * length > 0.01 * stepper_.options.accuracy * a.size &&
        (a.behaviour == Behaviour::sticks || a.slip.dot(a.came) > 0)) {
      const double way = 2 * past_length_;
      first = std::min(first, past != nullptr && past->behaviour == Behaviour::slips
                                  ? zero_behind(-way, past->came.norm(), 0, came)
                                  : length / 4);
      continue;
    }
    const Active* then = find(active_[2], a.id);
    const bool turns = then != nullptr && a.behaviour == Behaviour::slips &&
                       then->behaviour == Behaviour::slips && !(then->slip.dot(a.slip) > 0);
    if (then != nullptr && then->behaviour == a.behaviour && !turns) continue;
    if (then != nullptr && a.behaviour == Behaviour::slips) {
      first = std::min(first, zero_behind(0, came, length / 2, a.speed));
      continue;
    }
    if (past == nullptr || past->behaviour != a.behaviour) continue;
    const bool lifts = then == nullptr;
    first = std::min(first, zero_behind(-past_length_ / 2, lifts ? past->force : past->margin,
                                        length / 4, lifts ? a.force : a.margin));
  }
  return first;
}

// The error: difference between the halves and the whole sub-step, in units of the accuracy,
// relative to the size of each body. Smooth velocities count by the displacement that they cause.
double AccurateSteps::error(double length, bool smooth) const {
  double most = 0;
  for (const int k : stepper_.motion.moving()) {
    const std::size_t i = at(k);
    const double R = stepper_.sizes[i];
    most =
        std::max({most, (stepper_.bodies.position[i] - whole_.position[i]).norm() / R,
                  rotation_between(whole_.orientation[i], stepper_.bodies.orientation[i]).norm()});
    if (!smooth) continue;
    const RigidBody &now = stepper_.bodies.motion[i], &was = whole_.motion[i];
    most = std::max({most, length * (now.velocity - was.velocity).norm() / R,
                     length * (now.angular_velocity - was.angular_velocity).norm()});
  }
  // 0.8: on the safe side of the wanted accuracy.
  return most / (0.8 * stepper_.options.accuracy);
}

// 2 halves - whole. A body that no moment acts on keeps its momentum exactly, and its halves.
void AccurateSteps::extrapolate() {
  for (const int k : stepper_.motion.moving()) {
    const std::size_t i = at(k);
    stepper_.bodies.position[i] += stepper_.bodies.position[i] - whole_.position[i];
    stepper_.bodies.motion[i].velocity +=
        stepper_.bodies.motion[i].velocity - whole_.motion[i].velocity;
  }
  const auto turn = [&](int k) {
    const std::size_t i = at(k);
    const Vector3d more = rotation_between(whole_.orientation[i], stepper_.bodies.orientation[i]);
    if (!more.isZero(0))
      stepper_.bodies.orientation[i] =
          (exponential(more) * stepper_.bodies.orientation[i]).normalized();
    Vector3d& w = stepper_.bodies.motion[i].angular_velocity;
    w += w - whole_.motion[i].angular_velocity;
  };
  const std::vector<StepperMemory::Spin>& spins = stepper_.motion.spins();
  std::size_t next = 0;
  for (const int k : stepper_.motion.moving()) {
    if (next < spins.size() && stepper_.motion.free_long()[next] == k) {
      const std::size_t s = next++;
      if (spins[s].momentum == whole_.spin[s].momentum) continue;
    }
    turn(k);
  }
  stepper_.motion.turn_inertias(stepper_.bodies);
}

// Takes a sub-step in two halves. Returns whether contacts behave as in the whole one.
bool AccurateSteps::take_halves(double time, double length) {
  advance(time, length / 2);
  list_active(length / 2, active_[1]);
  advance(time + length / 2, length / 2);
  list_active(length / 2, active_[2]);
  return same(active_[0], active_[1]) && same(active_[1], active_[2]);
}

// Accepts a sub-step and chooses the length of the next. cut: this one was shorter than planned.
void AccurateSteps::accept(double time, double length, double error, bool smooth, bool cut) {
  past_ = active_[2];
  past_length_ = length / 2;
  if (smooth) {
    extrapolate();
    if (stepper_.joints) stepper_.joints->begin(stepper_.bodies, time + length);
  }
  double factor = std::pow(error, -0.125);
  factor *= control.last > 0
                ? std::pow(control.error, -0.125) * std::pow(length / control.last, -0.25)
                : factor;
  const double next = length * std::clamp(factor, 0.3, 2.0);
  control.next = cut ? std::max(control.next, next) : next;
  control.last = length;
  control.error = error;
}

// One sub-step, of at most this length. Returns the length that was taken.
double AccurateSteps::take_sub_step(double time, double length, bool shortened, double shortest) {
  const Tally before = stepper_.tally;
  stepper_.remember(before_);
  const auto back = [&] {
    stepper_.restore(before_);
    stepper_.tally = before;
    ++stepper_.counts.rejected;
  };
  bool cut = shortened, switched = false;
  for (;;) {
    const bool whole = advance(time, length);
    if (!(length > shortest)) break;
    if (!whole) {
      back();
      length = std::max(length / 2, shortest);
      cut = false;
      control.last = 0;
      continue;
    }
    double at_once = length;
    const double impact = first_impact(length, at_once);
    if (impact < length) {
      back();
      cut = true;
      const bool now = !(impact > 0);
      length = std::max(now ? std::min(at_once, length) : impact, shortest);
      if (!now) continue;
      advance(time, length);
      break;
    }
    list_active(length, active_[0]);
    stepper_.remember(whole_);
    stepper_.restore(before_);
    stepper_.tally = before;
    const bool smooth = take_halves(time, length);
    const double off = std::max(error(length, smooth), 1e-4);
    const double when = smooth || switched ? length : first_switch(length);
    if (when > shortest && when < 0.95 * length && off > 0.05) {
      back();
      length = when;
      cut = switched = true;
      continue;
    }
    if (off > 1) {
      back();
      length =
          std::max(length * std::clamp(0.9 / (smooth ? std::sqrt(off) : off), 0.1, 0.7), shortest);
      cut = false;
      control.last = 0;
      continue;
    }
    accept(time, length, off, smooth, cut);
    break;
  }
  ++stepper_.counts.sub_steps;
  return length;
}

void AccurateSteps::take(double start, double length) {
  double done = 0, shortest = 1e-9 * length;  // accepted as they are
  past_.clear();                              // a run that goes on from a saved state has none
  for (int taken_parts = 0; done < length; ++taken_parts) {
    if (taken_parts == kManyImpacts) shortest = length / kManyImpacts;
    const double left = length - done, least = std::min(shortest, left);
    double next = control.next > 0 ? std::max(control.next, least) : left;
    const bool shortened = next > 0.5 * left;
    if (shortened) next = next < left ? left / 2 : left;
    const double taken = take_sub_step(start + done, next, shortened, least);
    done = taken < left ? done + taken : length;
  }
}

}  // namespace tether::contact::detail

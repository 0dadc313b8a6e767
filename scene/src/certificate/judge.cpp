// Tether: asks the laws of mechanics of every block of a certificate. SPDX-License-Identifier:
// BSD-3-Clause
//
// Bounds are parts of the impulses, forces or speeds of the same body or contact. Records of smooth
// motion are compared by a formula of fourth order, whose error they bound themselves.
#include "judge.hpp"

#include <fmt/format.h>

#include <deque>
#include <utility>

#include "lists.hpp"
#include "told.hpp"

namespace tether::scene::certificate {

namespace {

/// How much it may be off: the part of the times, places, speeds, impulses or forces that it is
/// about.
struct Law {
  const char* name;
  double part;
};

namespace law {

constexpr Law solved{"contact problems solved", 0}, residual{"residual of contact problems", 1e-2},
    rest{"fixed bodies rest", 0}, unit{"unit length", 1e-9}, time{"time goes on", 1e-9},
    goes_on{"motion goes on", 1e-6}, holds{"joints hold", 1e-6},
    joint_speeds{"joints' velocities", 1e-6}, accelerations{"joints' accelerations", 1e-4},
    weight{"weight", 1e-9}, stops{"comes to rest", 1e-3},
    stops_without_work{"work of what comes to rest", 1e-6}, reaction{"reaction", 1e-9},
    reaction_moment{"moment of reaction", 1e-6},
    reaction_kind{"reaction of the joint's kind", 1e-6}, claimed{"residual as claimed", 1e-4},
    contact{"law of contact", 1e-6}, points{"points of contact", 1 + 1e-6},
    moments{"moments of friction", 1e-6}, surface{"surface speed", 1},
    closed{"contact closed", 1e-4}, contact_at_instant{"law of contact at an instant", 1e-4},
    cone{"contact pushes within its cone", 1e-6},
    restitution{"restitution or gap that closes", 1e-9}, of_joint{"law of a joint", 1e-4},
    momentum{"balance of momentum", 1e-6}, spin{"balance of angular momentum", 1e-6},
    places{"places move as velocities", 1e-6}, turns{"orientation moves as velocities", 1e-6},
    corrections{"corrections close gaps", 10}, extrapolation{"extrapolation", 1e-6},
    follows{"places follow velocities", 1e-5}, motion{"equations of motion", 1e-5},
    rotation{"equations of rotation", 1e-5},
    leads[] = {{"momentum leads on", 1e-5},
               {"angular momentum leads on", 1e-5},
               {"places lead on", 1e-5},
               {"orientation leads on", 1e-5}};

}  // namespace law

constexpr double kRounding = 1e-9;  // of places and speeds
constexpr double kTimes = 1e-15;    // of the difference of two times
constexpr std::size_t kFaultsTold = 10;

using States = std::map<double, Told>;
using Loads = std::map<double, Load>;

/// A quantity of a body at an instant, its rate, and its size where it is small.
struct Led {
  Vector3d value, rate;
  double tiny;
};

/// Bodies at an instant: momentum, angular momentum, place, turn; orientation.
struct Instant {
  struct One {
    std::array<Led, 4> led;
    Quaterniond q;
  };
  double time = 0, events = 0;
  std::map<double, One> bodies;
};

bool is_one_of(const std::string& word, std::initializer_list<const char*> words) {
  return contains(words, word);
}

class Judge {
 public:
  Verdict run(const std::string& file) {
    Reader reader(file);
    Record line;
    while (reader.next(line)) {
      const bool of_block =
          is_one_of(line.word, {"push", "contact", "pull", "law", "placed", "rate"});
      if (of_block && !block_) throw Damaged(line.word + " is of no part");
      if (of_block || line.word == "to") {
        lines_.push_back(line);
        continue;
      }
      finish();
      head(line);
    }
    if (!moved_) throw Damaged("nothing moves in it");
    return std::move(verdict_);
  }

 private:
  ToldBody& body(double number) {
    const auto found = bodies_.find(number);
    if (found == bodies_.end()) throw Damaged(fmt::format("body {} is not told", number));
    return found->second;
  }

  /// `to`: states that go before those that are reached.
  Told state(double number, const States* to = nullptr) const {
    if (number == -1) return {};
    if (to != nullptr && to->count(number) > 0) return to->at(number);
    const auto found = bodies_.find(number);
    if (found == bodies_.end() || !found->second.state)
      throw Damaged(fmt::format("body {} has no state at t = {} s", number, when_));
    return *found->second.state;
  }

  States told_states() const {
    States out;
    for (const auto& [number, b] : bodies_)
      if (b.state) out[number] = *b.state;
    return out;
  }

  template <class F>
  void each(const char* word, const F& f) {
    for (const Record& line : lines_)
      if (line.word == word) f(line.numbers, line.text);
  }

  void expect(const Law& law, double off, double size, const std::string& what, double slack = 0) {
    const double bound = law.part * size + slack;
    ++verdict_.judged;
    if (off <= bound && bound < INFINITY) return;  // a bound beyond all numbers bounds nothing
    if (++verdict_.broken > static_cast<long>(kFaultsTold)) return;
    verdict_.faults.push_back(fmt::format("step {}, t = {} s: {}: {}: {:.3g}, at most {:.3g}",
                                          step_, when_, what, law.name, off, bound));
  }

  void head(const Record& line) {
    const Numbers& n = line.numbers;
    const std::string& word = line.word;
    if (word == "body") {
      ToldBody b;
      b.mass = n[1], b.material = n[8], b.name = line.text;
      b.inertia << n[2], n[7], n[6], n[7], n[3], n[5], n[6], n[5], n[4];
      if (!(b.mass >= 0) || (b.mass > 0 && !(std::abs(b.inertia.determinant()) > 0)))
        throw Damaged("body " + b.name + " has no mass or inertia that moves");
      if (!bodies_.emplace(n[0], b).second) throw Damaged("body " + b.name + " is told twice");
    }
    if (word == "surface") {
      ToldBody& b = body(n[0]);
      b.belt = vector(n, 1), b.belt_turn = vector(n, 4), b.axis = vector(n, 7);
    }
    if (word == "pair") pairs_[{n[0], n[1]}] = n;
    if (word == "gravity") gravity_ = vector(n, 0);
    if (word == "engine") {
      joints_.clear(), reacts_.clear(), past_.clear();
      rules_ = line.text + ' ';
    }
    if (word == "joint") {
      const ToldJoint joint(line);
      for (const double b : joint.body)
        if (b != -1) body(b);
      joints_.insert_or_assign(n[0], joint);
      reacts_[n[0]] = n[0];
    }
    if (word == "coupled") {
      if (joints_.count(n[1]) == 0) throw Damaged("a coupling of a joint that is not told");
      joints_.at(n[1]).has_laws = true;
      reacts_[static_cast<double>(reacts_.size())] = n[1];
    }
    if ((word == "step" || word == "end") && until_) {  // where all have come, the next one begins
      for (const auto& [number, b] : bodies_)
        if (b.mass > 0)
          expect(law::time, std::abs(b.time - *until_), 1 + std::abs(*until_), b.name);
      if (word == "step")
        expect(law::time, std::abs(n[1] - *until_), 1 + std::abs(*until_), "step");
    }
    if (word == "step") {
      step_ = n[0], until_ = n[2], claimed_ = n[3];
      expect(law::solved, std::abs(n[4] - 1), 1, "step");
      expect(law::residual, std::abs(claimed_), 1, "step");
    }
    if (is_one_of(word, {"part", "trial", "instant", "arrives", "extrapolated", "start"}))
      block_ = line, when_ = n[0];
  }

  bool rule(const char* word) const { return rules_.find(word) != std::string::npos; }

  /// Judges the block that has been read; outside of blocks places of fixed bodies are told.
  void finish() {
    const std::string word = block_ ? block_->word : "";
    States to;
    each("to", [&](const auto& m, const auto&) {
      if ((body(m[0]).mass > 0) != block_.has_value())
        throw Damaged(body(m[0]).name + " is fixed and moves, or moves outside of parts");
      to[m[0]] = {vector(m, 1), vector(m, 8), vector(m, 11), quaternion(m, 4)};
    });
    if (word == "trial" && before_trial_.empty()) before_trial_ = bodies_;
    if (word == "part" && !before_trial_.empty()) {
      trial_ = told_states();
      bodies_ = std::exchange(before_trial_, {});
    }
    const bool moves = word == "part" || word == "trial";
    if (moves) part(to);
    if (word == "extrapolated") extrapolated(to);
    if (word == "instant" || word == "arrives") follows(to);
    if (word == "instant") instant(to);
    for (const auto& [number, s] : to) {
      ToldBody& b = body(number);
      if (!block_) expect(law::rest, s.v.norm() + s.w.norm(), 1, b.name);
      if (word == "start" && b.state) expect(law::goes_on, apart(*b.state, s), 1, b.name);
      expect(law::unit, std::abs(s.q.norm() - 1), 1, b.name);
      b.state = s;
      b.time = block_ ? block_->numbers[0] + (moves ? block_->numbers[1] : 0) : 0;
    }
    for (const auto& [number, joint] : joints_)
      if (to.count(joint.body[0]) + to.count(joint.body[1]) > 0) hold(joint);
    moved_ = moved_ || (block_ && !to.empty());
    block_.reset();
    lines_.clear();
  }

  void hold(const ToldJoint& joint) {
    const Told s[2] = {state(joint.body[0]), state(joint.body[1])};
    const double arm = 1 + joint.arms() + std::max(s[0].x.norm(), s[1].x.norm());
    double fast = 1, time = 0;
    for (int k = 0; k < 2; ++k) {
      fast = std::max(fast, 1 + s[k].v.norm() + s[k].w.norm() * arm);
      if (joint.body[k] >= 0) time = std::max(time, body(joint.body[k]).time);
    }
    const auto [off, slips, spins] = joint.errors(s, time);
    for (const double each : off) expect(law::holds, std::abs(each), arm, joint.name);
    for (const Numbers* all : {&slips, &spins})
      for (const double each : *all)
        expect(law::joint_speeds, std::abs(each), fast * arm, joint.name);
  }

  /// Impulses of effects; of an instant (dt 1) forces.
  void push(double dt, const States& to, Loads& loads) {
    std::map<double, Vector3d> weights;
    double power = 0, size = 0;
    each("push", [&](const auto& n, const auto& effect) {
      const auto found = to.find(n[0]);
      if (found == to.end()) throw Damaged("a push on a body that does not move");
      const Vector3d force = vector(n, 1), torque = vector(n, 4);
      loads[n[0]].add(force, torque);
      if (effect == "gravity") weights.try_emplace(n[0], Vector3d::Zero()).first->second += force;
      if (dt != 0) return;
      // An impact has no forces: these stop what moves too slowly to count, and do no work on what
      // is left.
      const ToldBody& b = body(n[0]);
      const Told &begin = *b.state, &end = found->second;
      const double turned = b.unspin(end.q, torque).norm();
      expect(law::stops, force.norm() / b.mass + turned * std::sqrt(b.inertia.trace() / b.mass), 1,
             b.name);
      power += force.dot(end.v) + torque.dot(end.w);
      size += force.norm() * (end.v.norm() + begin.v.norm()) +
              torque.norm() * (end.w.norm() + begin.w.norm());
    });
    const bool belts = any_of(bodies_, [](const auto& each) {
      return !each.second.belt.isZero(0) || !each.second.belt_turn.isZero(0);
    });
    if (!belts) expect(law::stops_without_work, std::abs(power), size, "impact");
    for (const auto& [number, s] : to) {
      const Vector3d weight = body(number).mass * gravity_;
      const Vector3d told = weights.try_emplace(number, Vector3d::Zero()).first->second;
      expect(law::weight, (told - dt * weight).norm(), dt * weight.norm(), body(number).name,
             kTimes * (1 + std::abs(when_)) * weight.norm());
    }
  }

  void pull(const States& to, Loads& loads, Loads& late) {
    each("pull", [&](const auto& n, const auto&) {
      const auto found = reacts_.find(n[0]);
      if (found == reacts_.end())
        throw Damaged(fmt::format("a pull of joint {}, which is not told", n[0]));
      const ToldJoint& joint = joints_.at(found->second);
      const States* at = n[1] != 0 ? &to : nullptr;
      const Told s[2] = {state(joint.body[0], at), state(joint.body[1], at)};
      for (std::size_t k = 0; k < 2; ++k)
        if (to.count(joint.body[k]) > 0)
          (at ? late : loads)[joint.body[k]].add(vector(n, 2 + 6 * k), vector(n, 5 + 6 * k));
      reaction(joint, n, joints_.count(n[0]) == 0, s);
    });
  }

  /// It is opposite on both bodies, and along directions that the joint holds, drives or, at once,
  /// has laws of.
  void reaction(const ToldJoint& joint, const Numbers& n, bool couples, const Told (&s)[2]) {
    ToldJoint::Place p = joint.place(s);
    if (couples) p.held.clear(), p.turns.clear();
    if (couples || (joint.has_laws && (block_->word == "instant" || block_->numbers[1] == 0))) {
      if (joint.kind == "ball") p.turns = {Vector3d::UnitX(), Vector3d::UnitY()};
      (joint.kind == "slider" ? p.held : p.turns)
          .push_back(joint.kind == "ball" ? Vector3d(Vector3d::UnitZ()) : p.z);
    }
    const Vector3d f[2] = {vector(n, 2), vector(n, 8)}, m[2] = {vector(n, 5), vector(n, 11)};
    const Vector3d arm[2] = {s[0].x - p.at, s[1].x - p.at}, about = m[0] + arm[0].cross(f[0]);
    const double size = f[0].norm() + f[1].norm();
    const double sized = m[0].norm() + m[1].norm() + size * (arm[0].norm() + arm[1].norm() + 1e-3);
    expect(law::reaction, (f[0] + f[1]).norm(), size, joint.name);
    expect(law::reaction_moment, (about + m[1] + arm[1].cross(f[1])).norm(), sized, joint.name);
    for (const auto& [whole, along] : {std::pair(f[0], &p.held), std::pair(about, &p.turns)}) {
      Vector3d rest = whole;
      for (const Vector3d& u : *along) rest -= rest.dot(u) / std::max(u.squaredNorm(), 1e-300) * u;
      expect(law::reaction_kind, rest.norm(), sized, joint.name, 1e-12);
    }
  }

  void push_by_contacts(Loads& loads) {
    near_.clear();
    each("contact", [&](const auto& n, const auto&) {
      const ToldContact c(n);
      near_[c.body].push_back(c.on[0]);
      for (int k = 0; k < 2; ++k) {
        const auto load = loads.find(c.body[k]);
        if (load == loads.end()) continue;
        const Vector3d x = k == 0 ? c.x : -c.x, moment = k == 0 ? c.moment : -c.moment;
        load->second.add(x, moment + (c.on[k] - state(c.body[k]).x).cross(x));
      }
    });
  }

  std::string name_of(const ToldContact& c) {
    return body(c.body[0]).name + " on " + body(c.body[1]).name;
  }

  /// Friction, and the numbers of its pair: restitution, rolling and torsional from the fifth on.
  std::pair<Friction, const Numbers&> friction(const ToldContact& c) {
    for (const auto& [first, second] :
         {std::pair(c.body[0], c.body[1]), std::pair(c.body[1], c.body[0])}) {
      const auto found = pairs_.find({body(first).material, body(second).material});
      if (found == pairs_.end()) continue;
      const Numbers& pair = found->second;
      Friction out{pair[2], pair[3], Vector3d::Zero(), rule(" maximum_dissipation ")};
      if (rule(" frictionless ")) out.along = out.across = 0;
      if (out.along != out.across) out.axis = state(first).q * body(first).axis;
      return {out, pair};
    }
    throw Damaged(name_of(c) + ": bodies of no pair touch");
  }

  /// Speeds of the first body at a contact against the second, m/s: where the sub-step begins,
  /// after all but contacts, at its end, and of the surfaces; the sum of the inverse masses.
  struct Sliding {
    Vector3d before = Vector3d::Zero(), comes = before, w = before, belts = before;
    double inverse = 0, fast = 0;  ///< fast: the sizes of all speeds
    /// A sub-step obeys its laws in its middle, which is this far from its start: bodies turn,
    /// their normal does along an edge, and points move in their face, or along a curve: an
    /// ellipsoid's radius is at most a^2 / height, and a^2 5/2 of trace / mass; twice that, as mass
    /// may lie inside.
    double middle = 0;
    double most() const { return std::max(before.norm(), comes.norm()); }
  };
  Sliding sliding(const ToldContact& c, double dt, const States& came, const States& free,
                  const States& mid) {
    Sliding out;
    double turning = 0, round = INFINITY, flat = 0, patch = 0;
    for (int k = 0; k < 2; ++k) {
      const double number = c.body[k], sign = k == 0 ? 1 : -1;
      const ToldBody& b = body(number);
      const Vector3d r = c.on[k] - state(number).x;
      const Told &start = came.at(number), &coming = free.at(number), &end = mid.at(number);
      out.before += sign * start.velocity(r), out.comes += sign * coming.velocity(r);
      out.w += sign * end.velocity(r), out.belts += sign * b.belt_at(r);
      turning += start.w.norm() + end.w.norm();
      out.fast += start.v.norm() + end.v.norm() + coming.v.norm() + end.w.norm() * r.norm();
      if (!(b.mass > 0)) continue;
      out.inverse += 1 / b.mass;
      round = std::min(round, r.norm());
      const double height = std::max(std::abs(r.dot(c.n)), 1e-300);
      flat = std::max(flat, 5 * b.inertia.trace() / b.mass / height);
    }
    for (const Vector3d& p : near_[c.body]) patch = std::max(patch, (p - c.on[0]).norm());
    const double spins = (free.at(c.body[0]).w - free.at(c.body[1]).w).norm();
    const double bends = out.most() * out.most() / std::max(round, 1e-300);
    out.middle = dt * (turning * out.fast + spins * spins * flat + bends) + spins * patch;
    return out;
  }

  /// Returns the natural residual; `speed`: the largest so far, which it is a part of. At an
  /// instant all motions are one.
  double contact(const ToldContact& c, double dt, const States& came, const States& free,
                 const States& mid, double& speed) {
    const std::string what = name_of(c);
    const auto [of, pair] = friction(c);
    const Sliding s = sliding(c, dt, came, free, mid);
    const double push = c.x.dot(c.n), spin = c.moment.dot(c.n), size = c.x.norm();
    expect(law::points, (c.on[0] - c.on[1]).norm(), std::abs(c.gap), what,
           kRounding * (1 + c.on[0].norm()));
    expect(law::unit, std::abs(c.n.norm() - 1), 1, what);
    expect(
        law::moments,
        std::max(std::abs(spin) - pair[6] * push, (c.moment - spin * c.n).norm() - pair[5] * push),
        push, what, kRounding);
    expect(law::surface, (c.slip - s.belts + s.belts.dot(c.n) * c.n).norm(), s.middle, what,
           kRounding * (1 + s.fast));
    const double off = natural_residual(of, c.n, s.inverse * c.x, s.w + c.slip + c.bias * c.n);
    if (block_->word == "instant") {
      expect(law::closed, std::abs(c.gap), 1, what);
      expect(law::contact_at_instant, off, 1 + s.fast, what, 1e-6 * size * s.inverse);
      return off;
    }
    expect(law::cone,
           std::max(-push, (c.x - push * c.n).norm() - std::max(of.along, of.across) * push), size,
           what, s.inverse > 0 ? kRounding * s.most() / s.inverse : 0);
    speed = std::max(speed, s.before.norm() + s.comes.norm() + c.slip.norm() + std::abs(c.bias) +
                                size * s.inverse + gravity_.norm() * dt);
    const double approach = -s.before.dot(c.n), approaches = -s.comes.dot(c.n);
    double wrong = std::abs(c.bias - (dt > 0 ? std::max(c.gap, 0.0) / dt : 0)) - s.middle;
    if (approaches * dt > c.gap || dt == 0)
      wrong = std::min({wrong, std::abs(c.bias) - s.middle,
                        std::abs(c.bias + pair[4] * std::min(approach, approaches))});
    if (block_->numbers[2] == 0) expect(law::restitution, wrong, 1 + s.fast, what);
    return off;
  }

  /// A sub-step, or an impact (dt 0): momenta change by the impulses, and contacts and joints obey
  /// their laws.
  void part(const States& to) {
    const double dt = block_->numbers[1], composed = block_->numbers[2], told = block_->numbers[3];
    if (!(dt >= 0)) throw Damaged("a part of negative length");
    Loads loads, late;
    for (const auto& [number, end] : to) {
      state(number);
      loads[number], late[number];
      expect(law::time, std::abs(body(number).time - when_), 1 + std::abs(when_),
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
    double worst = 0, speed = 0;
    std::string name = "contacts";
    each("contact", [&](const auto& n, const auto&) {
      const ToldContact c(n);
      const double off = contact(c, dt, came, free, mid, speed);
      if (off > worst) worst = off, name = name_of(c);
    });
    expect(law::claimed, std::abs(told - worst), worst, name, kRounding * speed);
    if (composed == 0) expect(law::contact, worst, std::max(1.0, 1e8 * claimed_) * speed, name);
    each("law", [&](const auto& n, const auto&) { law_of_joint(n, dt, composed != 0, came, mid); });
    States placed;
    each("placed", [&](const auto& n, const auto&) {
      body(n[0]);
      placed[n[0]].x = vector(n, 1), placed[n[0]].q = quaternion(n, 4);
    });
    for (const auto& [number, end] : to) {
      const auto found = placed.find(number);
      moves(body(number), dt, loads[number], late[number],
            found == placed.end() ? *body(number).state : found->second, end);
    }
  }

  /// A limit (0), or what is bounded (1) or sprung (2): its impulse is within bounds, and at one
  /// where its speed is not as wanted.
  void law_of_joint(const Numbers& n, double dt, bool composed, const States& came,
                    const States& mid) {
    const auto joint = joints_.find(n[0]);
    if (joint == joints_.end()) throw Damaged("a law of a joint that is not told");
    const double kind = n[1], gap = n[2], rate = n[4], x = n[9], bound = dt > 0 ? n[5] * dt : 0;
    double speed = 0, before = 0, inverse = 0;
    for (std::size_t i = 10; i + 6 < n.size(); i += 7) {
      const ToldBody& b = body(n[i]);
      const Vector3d f = vector(n, i + 1), m = vector(n, i + 4);
      speed += f.dot(mid.at(n[i]).v) + m.dot(mid.at(n[i]).w);
      before += f.dot(came.at(n[i]).v) + m.dot(came.at(n[i]).w);
      if (b.mass > 0) inverse += f.squaredNorm() / b.mass + m.dot(b.unspin(b.state->q, m));
    }
    const double open = dt > 0 ? gap / dt : 0, slip = speed - rate;
    Numbers wanted = {rate};
    if (kind == 0) wanted = {std::min(-open, 0.0), 0, -n[3] * before};
    double off = INFINITY;
    for (const double each : wanted) {
      double y = x;
      if (!composed)
        y = kind == 2 ? -dt * (n[7] * (n[6] + dt * slip) + n[8] * slip)
                      : x - (speed - each) / std::max(inverse, 1e-300);
      y = kind == 0 ? std::max(0.0, y) : std::max(-bound, std::min(bound, y));
      off = std::min(off, std::abs(x - y) * inverse);
    }
    expect(law::of_joint, off,
           std::abs(x) * inverse + std::abs(speed) + std::abs(before) + std::abs(rate) +
               std::abs(open),
           joint->second.name);
  }

  /// Balances of a body over a sub-step, from where corrections have placed it. A correction of the
  /// orientation turns the momentum, too.
  void moves(const ToldBody& b, double dt, const Load& load, const Load& late, const Told& placed,
             const Told& end) {
    const Told& begin = *b.state;
    const Vector3d change = end.v - begin.v, v = end.v - late.force / b.mass;
    expect(law::momentum, (b.mass * change - load.force - late.force).norm(),
           load.forces + late.forces +
               b.mass * (change.norm() + kRounding * (end.v.norm() + begin.v.norm())),
           b.name);
    // By the velocity at the end, or along the parabola of free fall.
    const Vector3d left = end.x - placed.x - dt * v, fall = left + 0.5 * dt * dt * gravity_;
    expect(law::places, std::min(left.norm(), fall.norm()), dt * v.norm(), b.name,
           kRounding * (end.x.norm() + dt * v.norm()));
    double gaps = 0;
    each("contact", [&](const auto& n, const auto&) { gaps += std::abs(n[11]); });
    expect(law::corrections, (placed.x - begin.x).norm(), gaps, b.name, 1e-8 * (1 + end.x.norm()));
    const Quaterniond corrected = placed.q * begin.q.conjugate();
    const Vector3d before = b.spin(begin.q, begin.w), middle = corrected * (before + load.torque);
    const bool keeps = rule(" momentum ") && !b.is_round();
    const Vector3d after = b.spin(keeps ? end.q : placed.q, end.w);
    expect(law::spin, (after - middle - late.torque).norm(),
           load.torques + late.torques + (after - before).norm() +
               1e-8 * (after.norm() + before.norm()) + 1e-6 * load.forces * (1 + end.x.norm()),
           b.name,
           late.torques > 0 ? apart(corrected, Quaterniond::Identity()) * middle.norm() : 0);
    Quaterniond there = rotation(dt * (end.w - b.unspin(end.q, late.torque))) * placed.q;
    if (keeps) {
      const Vector3d w0 = placed.q.conjugate() * b.unspin(placed.q, middle);
      const Vector3d w1 = end.q.conjugate() * b.unspin(end.q, middle);
      there = placed.q * rotation(0.5 * dt * (w0 + w1));
    }
    expect(law::turns, apart(there, end.q), dt * end.w.norm(), b.name, kRounding);
  }

  /// Twice the two halves less the whole sub-step; a body that no moment acts on keeps its halves.
  void extrapolated(const States& to) {
    for (const auto& [number, s] : to) {
      const auto found = trial_.find(number);
      if (found == trial_.end()) throw Damaged("an extrapolation without its trial");
      const Told half = state(number), whole = found->second;
      const double off = std::max(
          {(s.x - 2 * half.x + whole.x).norm(), (s.v - 2 * half.v + whole.v).norm(),
           std::min((s.w - 2 * half.w + whole.w).norm(), (s.w - half.w).norm()),
           std::min(apart(half.q * whole.q.conjugate() * half.q, s.q), apart(half.q, s.q))});
      expect(law::extrapolation, off, apart(half, whole), body(number).name,
             kRounding * (1 + half.x.norm()));
    }
    trial_.clear();
  }

  /// Places by the mean of the velocities, over whatever time has passed.
  void follows(const States& to) {
    for (const auto& [number, s] : to) {
      const ToldBody& b = body(number);
      if (!b.state) continue;
      const double h = when_ - b.time;
      expect(law::time, -h, 1 + std::abs(when_), b.name);
      expect(law::follows, (s.x - b.state->x - h / 2 * (s.v + b.state->v)).norm(), s.x.norm() + 0.1,
             b.name, std::abs(h) / 4 * (s.v - b.state->v).norm());
    }
  }

  /// Equations of motion: accelerations by the forces, and as the next instants tell.
  void instant(const States& to) {
    Loads loads, none;
    for (const auto& [number, s] : to) body(number).state = s, loads[number];
    push(1, to, loads);
    pull(to, loads, none);
    push_by_contacts(loads);
    const States now = told_states();
    double speed = 0;
    each("contact",
         [&](const auto& n, const auto&) { contact(ToldContact(n), 0, now, now, now, speed); });
    Instant here;
    here.time = when_, here.events = block_->numbers[1];
    std::map<double, std::array<Vector3d, 2>> rates;
    each("rate", [&](const auto& n, const auto&) { rates[n[0]] = {vector(n, 1), vector(n, 4)}; });
    for (const auto& [number, s] : to) {
      const ToldBody& b = body(number);
      if (rates.count(number) == 0) throw Damaged("an acceleration is missing");
      const auto& [a, alpha] = rates[number];
      const Load& load = loads[number];
      const Vector3d momentum = b.spin(s.q, s.w), spun = b.spin(s.q, alpha);
      const Vector3d gyroscopic = s.w.cross(momentum);
      expect(law::motion, (b.mass * a - load.force).norm(), load.forces + b.mass * a.norm(),
             b.name);
      expect(law::rotation, (spun + gyroscopic - load.torque).norm(),
             load.torques + gyroscopic.norm() + spun.norm(), b.name,
             kRounding * (b.inertia.norm() + load.forces));
      here.bodies[number] = {{Led{s.v, a, 0.1}, Led{momentum, load.torque, 0.1 * b.inertia.trace()},
                              Led{s.x, s.v, 0.1}, Led{Vector3d::Zero(), s.w, 1}},
                             s.q};
    }
    for (const auto& [number, joint] : joints_) {
      const Told s[2] = {state(joint.body[0]), state(joint.body[1])};
      std::array<Vector3d, 2> of[2];
      double scale = 0, spins = 0;
      for (int k = 0; k < 2; ++k) {
        const auto found = rates.find(joint.body[k]);
        of[k] = {Vector3d::Zero(), Vector3d::Zero()};
        if (found != rates.end()) of[k] = found->second;
        spins += of[k][1].norm() + s[k].w.squaredNorm();
        scale += of[k][0].norm();
      }
      const auto [off, bad] = joint.accelerations(s, of, when_);
      expect(law::accelerations, off, scale + spins * joint.arms(), joint.name, 1e-6);
      expect(law::accelerations, bad, spins, joint.name, 1e-6);
    }
    if (!past_.empty() && past_.back().events != here.events) past_.clear();
    past_.push_back(std::move(here));
    if (past_.size() > 4) past_.pop_front();
    for (const auto& [number, s] : to)
      if (past_.size() == 4) leads(number);
  }

  /// From the second to the third of four instants, by fourth order.
  void leads(double number) {
    const std::string& name = body(number).name;
    const double h = past_[2].time - past_[1].time;
    if (!(h > 0)) return expect(law::time, 1, 0, name);
    std::array<const Instant::One*, 4> one{};
    for (std::size_t i = 0; i < 4; ++i) {
      const auto found = past_[i].bodies.find(number);
      if (found == past_[i].bodies.end()) throw Damaged(name + " is not in every instant");
      one[i] = &found->second;
    }
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
      expect(law::leads[k], off, from.norm() + to.norm() + one[1]->led[k].tiny, name,
             h * h / 20 * (g0.norm() + g1.norm()) +
                 h / 5 * (f[3] - 3 * f[2] + 3 * f[1] - f[0]).norm() + bent);
    }
  }

  Verdict verdict_;
  std::map<double, ToldBody> bodies_, before_trial_;
  std::map<std::pair<double, double>, Numbers> pairs_;
  std::map<double, ToldJoint> joints_;
  std::map<double, double> reacts_;  // joints, and behind them those of couplings
  Vector3d gravity_ = Vector3d::Zero();
  std::string rules_;  // of the engine
  bool moved_ = false;
  double step_ = 0, when_ = 0, claimed_ = 0;
  std::optional<double> until_;
  std::optional<Record> block_;
  std::vector<Record> lines_;
  States trial_;                                                 // its end
  std::map<std::array<double, 2>, std::vector<Vector3d>> near_;  // points of two bodies
  std::deque<Instant> past_;
};

}  // namespace

Verdict judge(const std::string& file) {
  Verdict out;
  try {
    out = Judge().run(file);
  } catch (const Damaged& why) {
    out.damage = why.what();
  } catch (const std::exception& why) {  // of maps: what a line names is missing
    out.damage = std::string("a part is missing: ") + why.what();
  }
  return out;
}

}  // namespace tether::scene::certificate

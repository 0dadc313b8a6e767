// Tether: asks the laws of mechanics of every block of a certificate. SPDX-License-Identifier:
// BSD-3-Clause
#include "judge.hpp"

#include <fmt/format.h>

#include <deque>
#include <optional>
#include <utility>

#include "lists.hpp"
#include "told.hpp"

namespace tether::scene::certificate {

namespace {

constexpr double kSameTime = 1e-12;   // s
constexpr double kRounding = 1e-9;    // of places and speeds
constexpr double kAtRest = 1e-15;     // m, m/s, rad/s: round-off
constexpr double kErrorControl = 10;  // parts of the accuracy that it moves a body by
constexpr std::size_t kFaultsTold = 10;

using Loads = std::map<double, Load>;

/// A quantity of a body at an instant, its rate, and its size where it is small.
struct Led {
  const char* law;
  Eigen::Vector4d value, rate;
  double tiny;
};

struct Instant {
  double time, events;
  std::map<double, std::array<Led, 4>> bodies;
};

/// A contact as it has been judged.
struct Touch {
  std::string name;
  double off = 0;                ///< natural residual, m/s
  double cone = 0;               ///< coefficient of its cone
  double light = 0;              ///< sum of the inverse masses
  double speeds = 0, spins = 0;  ///< of both bodies, before, behind and between
  Vector3d before, comes;        ///< velocities: where the sub-step begins, after all but contacts
  double middle = 0;             ///< m/s, see Judge::middle
  double restitution = 0;
  double most() const { return std::max(before.norm(), comes.norm()); }
  double fast() const { return speeds + spins; }
};

class Judge {
 public:
  Verdict run(const std::string& file) {
    Reader reader(file);
    Record line;
    while (reader.next(line)) {
      if (contains(std::array{"to", "push", "pull", "law", "on", "contact", "placed", "rate"},
                   line.word)) {
        lines_.push_back(line);
        continue;
      }
      if (block_) finish();
      head(line);
    }
    if (to_.empty()) throw Damaged("nothing moves in it");
    return std::move(verdict_);
  }

 private:
  template <class F>
  void each(const char* word, const F& f) const {
    for (const Record& line : lines_)
      if (line.word == word) f(line);
  }

  /// A law may be off by this part of the times, places, speeds, impulses or forces that it is
  /// about, and by round-off.
  void expect(const char* law, double part, double off, double size, const std::string& what,
              double slack = 0) {
    const double bound = part * size + slack;
    ++verdict_.judged;
    if (off <= bound && bound < INFINITY) return;  // a bound beyond all numbers bounds nothing
    if (++verdict_.broken > static_cast<long>(kFaultsTold)) return;
    verdict_.faults.push_back(fmt::format("{}t = {} s: {}: {}: {:.3g}, at most {:.3g}",
                                          step_ ? fmt::format("step {}, ", (*step_)[0]) : "", when_,
                                          what, law, off, bound));
  }

  void head(const Record& line) {
    const std::string& word = line.word;
    if (step_ && contains(std::array{"step", "engine", "end"}, word)) {  // all have come to its end
      const double end = (*step_)[2];
      for (const auto& [k, b] : bodies_)
        if (b.mass > 0)
          expect("time goes on", 1e-9, std::abs(states_.at(k).time - end), 1 + std::abs(end),
                 b.name);
      joints_hold(end, false);
    }
    if (word == "body") {
      const ToldBody& b = bodies_.insert_or_assign(line[0], ToldBody(line)).first->second;
      if (b.mass == 0)
        states_[line[0]].x = line.vector(11), states_[line[0]].q = line.quaternion(14);
    } else if (word == "pair") {
      pairs_[{line[0], line[1]}] = pairs_[{line[1], line[0]}] = line;
    } else if (word == "engine") {
      gravity_ = line.vector(0), accuracy_ = line[3], rules_ = line.text + ' ';
      rows_.clear(), past_.clear(), step_.reset();
    } else if (word == "row") {
      rows_.insert_or_assign(line[0], ToldRow(line));
    } else if (word == "step") {
      step_ = line;
      expect("contact problems solved", 1e-2, std::max(std::abs(line[3]), std::abs(line[4] - 1)), 1,
             "step");
    } else if (word != "end") {
      block_ = line, when_ = line[0];
    }
  }

  bool rule(const char* word) const { return rules_.find(word) != std::string::npos; }

  /// Judges the block that has been read.
  void finish() {
    const bool moves = block_->word == "part";
    if (moves) length_ = (*block_)[1];
    to_.clear();
    each("to", [&](const Record& to) {
      const ToldBody& b = bodies_.at(to[0]);
      if (!(b.mass > 0)) throw Damaged("a fixed body moves");
      const State& s = to_[to[0]] = State(to, when_ + (moves ? length_ : 0));
      expect("unit length", 1e-9, std::abs(s.q.norm() - 1), 1, b.name);
      const auto was = states_.find(to[0]);
      if (moves && was == states_.end()) throw Damaged(b.name + " comes from nowhere");
      const double since = was == states_.end() ? 0 : when_ - was->second.time;
      expect("time goes on", 1e-9, moves ? std::abs(since) : -since, 1 + std::abs(when_), b.name);
    });
    each("rate",
         [&](const Record& n) { to_.at(n[0]).a = n.vector(1), to_.at(n[0]).alpha = n.vector(4); });
    if (moves)
      part();
    else
      reached();
    if (block_->word == "instant") instant();
    for (const auto& [k, s] : to_) states_[k] = s;
    block_.reset();
    lines_.clear();
  }

  /// In places, in speeds and, of an instant, in accelerations: by differences over a short time.
  void joints_hold(double time, bool accelerations) {
    for (const auto& [k, row] : rows_) {
      const std::array<State, 2> states{states_.at(row.first), states_.at(row.second)};
      double fast = 0, speed = 0, size = 0, far = 0;
      for (const State& s : states) {
        fast = std::max(fast, s.w.norm() + std::sqrt(s.a.norm() + s.alpha.norm()));
        far = std::max(far, s.x.norm());
        size += s.a.norm() + (s.alpha.norm() + s.w.squaredNorm()) * row.reach();
      }
      const double arm = row.reach() + far, h = 2e-4 / (1 + fast + row.frequency());
      for (const State& s : states) speed = std::max(speed, s.v.norm() + arm * s.w.norm());
      const auto off = [&, &each = row](double t) {
        return each.value(states[0].moved(t), states[1].moved(t), time + t).off;
      };
      const double before = off(-h), now = off(0), after = off(h);
      expect("joints hold", 1e-6, std::abs(now), arm, row.name);
      expect("joints' velocities", 1e-6, std::abs(after - before) / (2 * h), (1 + speed) * arm,
             row.name);
      if (accelerations)
        expect("joints' accelerations", 1e-4, std::abs(after - 2 * now + before) / (h * h), size,
               row.name, 1e-6 + kAtRest * arm / (h * h));
    }
  }

  /// Sums of all that acts on bodies, with or without contacts: impulses, of an instant (dt 1)
  /// forces.
  Loads loads(double dt, bool with_contacts) const {
    Loads out;
    for (const auto& [k, s] : to_) out[k].add(dt * bodies_.at(k).mass * gravity_, Vector3d::Zero());
    each("push", [&](const Record& n) { out[n[0]].add(n.vector(1), n.vector(4)); });
    each("pull", [&](const Record& n) {
      const ToldRow& row = rows_.at(n[0]);
      const State &a = states_.at(row.first), &b = states_.at(row.second);
      const auto [off, force, moment, at] = row.value(a, b, when_);
      out[row.first].add(n[1] * force, n[1] * (moment + (at - a.x).cross(force)));
      out[row.second].add(-n[1] * force, -n[1] * (moment + (at - b.x).cross(force)));
    });
    each("law", [&](const Record& law) {
      each("on", [&](const Record& n) {
        if (n[0] == law[0]) out[n[1]].add(law[7] * n.vector(2), law[7] * n.vector(5));
      });
    });
    if (with_contacts)
      each("contact", [&](const Record& n) {
        const ToldContact c(n);
        for (std::size_t i = 0; i < 2; ++i) {
          const double sign = i == 0 ? 1 : -1;
          const Vector3d arm = c.on[i] - states_.at(c.body[i]).x;
          out[c.body[i]].add(sign * c.x, sign * (c.moment + arm.cross(c.x)));
        }
      });
    return out;
  }

  States struck(const Loads& loads) const {
    States out = states_;
    for (const auto& [k, s] : to_) out[k] = bodies_.at(k).struck(states_.at(k), loads.at(k));
    return out;
  }

  /// A sub-step, or an impact (dt 0): momenta change by the impulses, and contacts and joints obey
  /// their laws.
  void part() {
    const double dt = length_;
    if (!(dt >= 0)) throw Damaged("a part of negative length");
    if (dt == 0) rests();
    const Loads all = loads(dt, true);
    const States free = struck(loads(dt, false)), mid = struck(all);
    const bool composed = (*block_)[2] != 0;
    double worst = 0, speed = 0;
    std::string name = "contacts";
    each("contact", [&](const Record& n) {
      const ToldContact c(n);
      const Touch t = touch(c, free, mid, dt);
      contact(t, c, dt, composed);
      speed = std::max(speed, t.before.norm() + t.comes.norm() + c.slip.norm() + std::abs(c.bias) +
                                  t.light * c.x.norm() + gravity_.norm() * dt);
      if (t.off > worst) worst = t.off, name = t.name;
    });
    expect("residual as claimed", 1e-4, std::abs((*block_)[3] - worst), worst, name,
           kRounding * speed);
    if (!composed) {
      expect("law of contact", 1e-6, worst, std::max(1.0, 1e8 * (step_ ? (*step_)[3] : 0)) * speed,
             name);
      each("law", [&](const Record& n) { law_of_joint(n, dt, mid); });
    }
    std::map<double, State> placed = states_;
    each("placed", [&](const Record& n) {
      placed.at(n[0]).x = n.vector(1), placed.at(n[0]).q = n.quaternion(4);
    });
    for (const auto& [k, end] : to_)
      moves(bodies_.at(k), dt, all.at(k), states_.at(k), placed.at(k), end);
  }

  /// An impact has no pushes but those that stop what moves too slowly to count; they do no work on
  /// what still moves.
  void rests() {
    double power = 0, size = 0;
    each("push", [&](const Record& n) {
      const ToldBody& b = bodies_.at(n[0]);
      const State &begin = states_.at(n[0]), &end = to_.at(n[0]);
      const Vector3d force = n.vector(1), moment = n.vector(4);
      expect("comes to rest", 1e-3,
             b.light * force.norm() + b.radius * b.unspin(end.q, moment).norm(), 1, b.name);
      power += force.dot(end.v) + moment.dot(end.w);
      size += force.norm() * (end.v.norm() + begin.v.norm()) +
              moment.norm() * (end.w.norm() + begin.w.norm());
    });
    const bool belts = any_of(bodies_, [](const auto& each) {
      return !each.second.surface.isZero(0) || !each.second.surface_spin.isZero(0);
    });
    if (!belts) expect("work of what comes to rest", 1e-6, std::abs(power), size, "impact");
  }

  Friction friction(const Record& pair, const ToldContact& c) const {
    Friction out{pair[2], pair[3], pair[4], Vector3d::Zero(), rule(" maximum_dissipation ")};
    if (rule(" frictionless ")) return Friction();
    const double owner = c.body[bodies_.at(c.body[0]).material == pair[0] ? 0 : 1];
    if (out.along != out.across) out.axis = states_.at(owner).q * bodies_.at(owner).axis;
    return out;
  }

  /// A sub-step obeys its laws in its middle. Until then bodies turn, with them normals, and points
  /// move in their faces, or along a curve: the radius of an ellipsoid is at most a^2 / height, and
  /// a^2 is 5/2 of trace / mass; twice that, as mass may lie inside.
  double middle(const ToldContact& c, const States& free, double dt, const Touch& t) const {
    double reach = 0, round = INFINITY, patch = 0;
    for (std::size_t i = 0; i < 2; ++i) {
      const ToldBody& b = bodies_.at(c.body[i]);
      if (!(b.mass > 0)) continue;
      const Vector3d r = c.on[i] - states_.at(c.body[i]).x;
      round = std::min(round, r.norm());
      reach = std::max(reach, 5 * b.radius * b.radius / std::max(std::abs(r.dot(c.n)), 1e-300));
    }
    each("contact", [&](const Record& n) {
      if (n[0] == c.body[0] && n[1] == c.body[1])
        patch = std::max(patch, (n.vector(2) - c.on[0]).norm());
    });
    const double bends = t.most() * t.most() / std::max(round, 1e-300);
    return dt * (t.spins * (t.speeds + t.spins * reach) + bends) +
           (free.at(c.body[0]).w - free.at(c.body[1]).w).norm() * patch;
  }

  /// Judges what all contacts obey, by the states before contacts push and behind. At an instant
  /// all are one.
  Touch touch(const ToldContact& c, const States& free, const States& mid, double dt) {
    Touch t;
    Vector3d belts = Vector3d::Zero();
    for (std::size_t i = 0; i < 2; ++i) {
      const ToldBody& b = bodies_.at(c.body[i]);
      t.name += (i == 0 ? "" : " on ") + b.name;
      t.light += b.light;
      belts += (i == 0 ? 1 : -1) * b.belt(states_.at(c.body[i]), c.on[i]);
      for (const States* each : {&std::as_const(states_), &free, &mid})
        t.speeds += each->at(c.body[i]).v.norm(), t.spins += each->at(c.body[i]).w.norm();
    }
    const auto found =
        pairs_.find({bodies_.at(c.body[0]).material, bodies_.at(c.body[1]).material});
    if (found == pairs_.end()) throw Damaged(t.name + ": bodies of no pair touch");
    const Record& pair = found->second;
    const Friction rubs = friction(pair, c);
    t.restitution = pair[5];
    t.cone = std::max(rubs.along, rubs.across);
    if (rubs.holds > rubs.along) t.cone *= rubs.holds / rubs.along;
    t.before = c.velocity(states_), t.comes = c.velocity(free);
    t.middle = middle(c, free, dt, t);
    t.off = natural_residual(rubs, c.n, t.light * c.x, c.velocity(mid) + c.slip + c.bias * c.n);
    const double push = c.x.dot(c.n), spin = c.moment.dot(c.n);
    expect("unit length", 1e-9, std::abs(c.n.norm() - 1), 1, t.name);
    expect("points of contact", 1, (c.on[0] - c.on[1]).norm(), std::abs(c.gap), t.name,
           kRounding * (1 + c.on[0].norm()));
    expect(
        "moments of friction", 1e-6,
        std::max(std::abs(spin) - pair[7] * push, (c.moment - spin * c.n).norm() - pair[6] * push),
        push, t.name, kRounding);
    expect("surface speed", 1, (c.slip - belts + belts.dot(c.n) * c.n).norm(), t.middle, t.name,
           kRounding * (1 + t.fast()));
    return t;
  }

  void contact(const Touch& t, const ToldContact& c, double dt, bool composed) {
    const double push = c.x.dot(c.n), came = t.before.dot(c.n), comes = t.comes.dot(c.n);
    expect("contact pushes within its cone", 1e-6,
           std::max(-push, (c.x - push * c.n).norm() - t.cone * push), c.x.norm(), t.name,
           t.light > 0 ? kRounding * t.most() / t.light : 0);
    if (composed) return;
    double wrong = std::abs(c.bias - (dt > 0 ? std::max(c.gap, 0.0) / dt : 0)) - t.middle;
    if (-comes * dt > c.gap || dt == 0)
      wrong = std::min({wrong, std::abs(c.bias) - t.middle,
                        std::abs(c.bias - t.restitution * std::max(came, comes))});
    expect("restitution or gap that closes", 1e-9, wrong, 1 + t.fast(), t.name);
  }

  /// The impulse of a limit (low 0), motor, friction or spring is within its bounds, and at one of
  /// them where the speed is not as wanted.
  void law_of_joint(const Record& n, double dt, const States& mid) {
    const double low = n[1], high = n[2], compliance = n[4], gap = n[5], x = n[7];
    double speed = 0, before = 0, gives = compliance;
    each("on", [&](const Record& on) {
      if (on[0] != n[0]) return;
      const ToldBody& b = bodies_.at(on[1]);
      const State &came = states_.at(on[1]), &now = mid.at(on[1]);
      const Vector3d f = on.vector(2), m = on.vector(5);
      speed += f.dot(now.v) + m.dot(now.w);
      before += f.dot(came.v) + m.dot(came.w);
      gives += b.light * f.squaredNorm() + m.dot(b.unspin(came.q, m));
    });
    const double opens = dt > 0 ? gap / dt : 0;
    Numbers wanted = {n[3]};
    if (!(low < 0)) wanted = {std::min(-opens, 0.0), 0, -n[6] * before};
    double off = INFINITY;
    for (const double each : wanted) {
      const double y = x - (speed + compliance * x - each) / std::max(gives, 1e-300);
      off = std::min(off, gives * std::abs(x - std::max(low, std::min(high, y))));
    }
    expect(
        "law of a joint", 1e-4, off,
        std::abs(x) * gives + std::abs(speed) + std::abs(before) + std::abs(n[3]) + std::abs(opens),
        n.text, kAtRest);
  }

  /// Balances of a body over a sub-step, from where corrections have placed it: one of the
  /// orientation turns its momentum, too.
  void moves(const ToldBody& b, double dt, const Load& load, const State& begin,
             const State& placed, const State& end) {
    const Vector3d change = end.v - begin.v;
    expect("balance of momentum", 1e-6, (b.mass * change - load.force).norm(),
           load.forces + b.mass * (change.norm() + kRounding * (end.v.norm() + begin.v.norm())),
           b.name, b.mass * kAtRest);
    // By the velocity at the end, or along the parabola of free fall.
    const Vector3d left = end.x - placed.x - dt * end.v, fall = left + 0.5 * dt * dt * gravity_;
    expect("places move as velocities", 1e-6, std::min(left.norm(), fall.norm()), dt * end.v.norm(),
           b.name, kRounding * (end.x.norm() + dt * end.v.norm()));
    double gaps = 0;
    each("contact", [&](const Record& n) { gaps += std::abs(n[11]); });
    expect("corrections close gaps", 10, (placed.x - begin.x).norm(), gaps, b.name,
           1e-8 * (1 + end.x.norm()));
    const bool keeps = rule(" momentum ");
    const Vector3d before = b.spin(begin.q, begin.w),
                   middle = placed.q * (begin.q.conjugate() * (before + load.moment)),
                   after = b.spin(keeps ? end.q : placed.q, end.w);
    expect("balance of angular momentum", 1e-6, (after - middle).norm(),
           load.moments + (after - before).norm() + 1e-8 * (after.norm() + before.norm()) +
               1e-6 * load.forces * (1 + end.x.norm()),
           b.name);
    Quaterniond there = rotation(dt * end.w) * placed.q;
    if (keeps) {  // by the mean of the velocities in body axes
      const auto spun = [&](const Quaterniond& q) -> Vector3d {
        return q.conjugate() * b.unspin(q, middle);
      };
      there = placed.q * rotation(dt / 2 * (spun(placed.q) + spun(end.q)));
    }
    expect("orientation moves as velocities", 1e-6, apart(there, end.q), dt * end.w.norm(), b.name,
           kRounding);
  }

  /// Places by the mean of the velocities, over whatever time has passed; an error control moves
  /// them by its accuracy.
  void reached() {
    for (const auto& [k, s] : to_) {
      const ToldBody& b = bodies_.at(k);
      const auto found = states_.find(k);
      if (found == states_.end()) continue;
      const State& was = found->second;
      const double h = when_ - was.time, controlled = kErrorControl * accuracy_;
      const double span = accuracy_ > 0 ? length_ : 1, per_metre = accuracy_ > 0 ? 1 / b.radius : 1;
      const Vector3d dv = s.v - was.v;
      expect("places follow velocities", 1e-5, (s.x - was.x - h / 2 * (s.v + was.v)).norm(),
             s.x.norm() + 0.1, b.name, std::abs(h) / 4 * dv.norm() + controlled * b.radius);
      // Joints that attach may strike before an instant.
      if (std::abs(h) > kSameTime || block_->word == "instant") continue;
      expect(
          "motion goes on", 1e-6,
          std::max({apart(s.q, was.q), span * (s.w - was.w).norm(), span * per_metre * dv.norm()}),
          1, b.name, controlled);
    }
  }

  /// Equations of motion: accelerations by the forces, and as the next instants tell.
  void instant() {
    for (const auto& [k, s] : to_) states_[k] = s;
    const Loads acting = loads(1, true);
    each("contact", [&](const Record& n) {
      const ToldContact c(n);
      const Touch t = touch(c, states_, states_, 0);
      expect("contact closed", 1e-4, std::abs(c.gap), 1, t.name);
      expect("law of contact at an instant", 1e-4, t.off, 1 + t.fast(), t.name,
             1e-6 * c.x.norm() * t.light);
    });
    Instant here{when_, (*block_)[1], {}};
    for (const auto& [k, s] : to_) {
      const ToldBody& b = bodies_.at(k);
      const Load& load = acting.at(k);
      const Vector3d momentum = b.spin(s.q, s.w), spun = b.spin(s.q, s.alpha),
                     gyroscopic = s.w.cross(momentum);
      expect("equations of motion", 1e-5, (b.mass * s.a - load.force).norm(),
             load.forces + b.mass * s.a.norm(), b.name);
      expect("equations of rotation", 1e-5, (spun + gyroscopic - load.moment).norm(),
             load.moments + gyroscopic.norm() + spun.norm(), b.name,
             kRounding * (b.inertia.norm() + load.forces));
      const auto led = [](const Vector3d& v) { return Eigen::Vector4d(v.x(), v.y(), v.z(), 0); };
      Eigen::Vector4d q = s.q.coeffs();
      if (!past_.empty() && q.dot(past_.back().bodies.at(k)[3].value) < 0) q = -q;
      here.bodies[k] = {
          Led{"velocity leads on", led(s.v), led(s.a), 0.1},
          Led{"angular momentum leads on", led(momentum), led(load.moment),
              0.1 * b.inertia.trace()},
          Led{"places lead on", led(s.x), led(s.v), 0.1},
          Led{"orientation leads on", q,
              0.5 * (Quaterniond(0, s.w.x(), s.w.y(), s.w.z()) * Quaterniond(q)).coeffs(), 0}};
    }
    joints_hold(when_, true);
    if (!past_.empty() && past_.back().events != here.events) past_.clear();
    past_.push_back(std::move(here));
    if (past_.size() > 4) past_.pop_front();
    if (past_.size() == 4) leads();
  }

  /// From the second to the third of four instants, by fourth order; its error is judged by the
  /// second.
  void leads() {
    const auto& [i0, i1, i2, i3] = std::tie(past_[0], past_[1], past_[2], past_[3]);
    const double h = i2.time - i1.time;
    for (const auto& [number, s] : to_)
      for (std::size_t k = 0; k < 4; ++k) {
        const Led &from = i1.bodies.at(number)[k], &to = i2.bodies.at(number)[k];
        const Eigen::Vector4d &f0 = i0.bodies.at(number)[k].rate, &f1 = from.rate, &f2 = to.rate,
                              &f3 = i3.bodies.at(number)[k].rate;
        const Eigen::Vector4d g1 = (f2 - f0) / (i2.time - i0.time),
                              g2 = (f3 - f1) / (i3.time - i1.time),
                              way = h / 2 * (f1 + f2) + h * h / 12 * (g1 - g2);
        expect(from.law, from.tiny > 0 ? 1e-5 : 2.5e-6, (to.value - from.value - way).norm(),
               from.value.norm() + to.value.norm() + from.tiny, bodies_.at(number).name,
               h * h / 20 * (g1.norm() + g2.norm()) + h / 5 * (f3 - 3 * f2 + 3 * f1 - f0).norm());
      }
  }

  Verdict verdict_;
  std::map<double, ToldBody> bodies_;
  std::map<std::pair<double, double>, Record> pairs_;  // of materials, both ways
  std::map<double, ToldRow> rows_;                     // of joints
  Vector3d gravity_ = Vector3d::Zero();
  double accuracy_ = 0;  // of the engine's error control
  std::string rules_;    // of the engine
  States states_, to_;   // to_: where the block leads
  std::optional<Record> step_, block_;
  std::vector<Record> lines_;  // of the block
  double when_ = 0, length_ = 0;
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

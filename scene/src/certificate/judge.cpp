// Tether: reads a certificate and asks the laws that hold of every line. SPDX-License-Identifier:
// BSD-3-Clause
#include "judging.hpp"

#include <fmt/format.h>

#include <cmath>

namespace tether::scene::certificate {

namespace {

bool is_one_of(const std::string& word, std::initializer_list<const char*> words) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

}  // namespace

Verdict Judge::run(const std::string& file) {
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

JudgedBody& Judge::body(double number) {
  const auto found = bodies_.find(number);
  if (found == bodies_.end()) throw Damaged(fmt::format("body {} is not told", number));
  return found->second;
}

Told Judge::state(double number, const States* to) const {
  if (number == -1) return {};
  if (to != nullptr && to->count(number) > 0) return to->at(number);
  const auto found = bodies_.find(number);
  if (found == bodies_.end() || !found->second.state)
    throw Damaged(fmt::format("body {} has no state at t = {} s", number, when_));
  return *found->second.state;
}

void Judge::expect(const char* law, double amount, double bound, const std::string& what) {
  ++verdict_.judged;
  if (amount <= bound && bound < INFINITY) return;  // a bound beyond all numbers bounds nothing
  if (++verdict_.broken > static_cast<long>(kTold)) return;
  verdict_.faults.push_back(fmt::format("step {}, t = {} s: {}: {}: {:.3g}, at most {:.3g}", step_,
                                        when_, what, law, amount, bound));
}

void Judge::head(const Record& line) {
  const std::vector<double>& n = line.numbers;
  const std::string& word = line.word;
  if (word == "body") {
    JudgedBody b;
    b.mass = n[1];
    b.inertia << n[2], n[7], n[6], n[7], n[3], n[5], n[6], n[5], n[4];
    b.material = n[8];
    b.name = line.text;
    if (!(b.mass >= 0) || (b.mass > 0 && !(std::abs(b.inertia.determinant()) > 0)))
      throw Damaged("body " + b.name + " has no mass or inertia that moves");
    if (!bodies_.emplace(n[0], b).second) throw Damaged("body " + b.name + " is told twice");
  }
  if (word == "surface") {
    JudgedBody& b = body(n[0]);
    b.belt = vector(n, 1), b.belt_turn = vector(n, 4), b.axis = vector(n, 7);
  }
  if (word == "pair") pairs_[{n[0], n[1]}] = {n[2], n[3], n[4], n[5], n[6]};
  if (word == "gravity") gravity_ = vector(n, 0);
  if (word == "engine") {
    joints_.clear(), reacts_.clear(), past_.clear();
    keeps_momentum_ = line.text.find(" momentum ") != std::string::npos;
    associated_ = line.text.find(" maximum_dissipation") != std::string::npos;
    frictionless_ = line.text.find(" frictionless") != std::string::npos;
  }
  if (word == "joint") {
    const JudgedJoint joint(line);
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
  if (word == "step" || word == "end")
    end_of_step(word == "step" ? std::optional(n[1]) : std::nullopt);
  if (word == "step") {
    step_ = n[0], claimed_ = n[3], until_ = n[2];
    expect("contact problems solved", std::abs(n[4] - 1), 0, "step");
    expect("residual of contact problems", std::abs(claimed_), kUseful, "step");
  }
  if (is_one_of(word, {"part", "trial", "instant", "arrives", "extrapolated", "start"}))
    block_ = line, when_ = n[0];
}

// All bodies have reached the end of the step, where the next one begins.
void Judge::end_of_step(std::optional<double> start) {
  if (!until_) return;
  const double slack = kRounding * (1 + std::abs(*until_));
  for (const auto& [number, b] : bodies_)
    if (b.mass > 0) expect("time goes on", std::abs(b.time - *until_), slack, b.name);
  if (start) expect("time goes on", std::abs(*start - *until_), slack, "step");
}

// Judges the block that has been read; outside of blocks places of fixed bodies are told.
void Judge::finish() {
  const std::string word = block_ ? block_->word : "";
  States to;
  each("to", [&](const auto& m, const auto&) {
    if ((body(m[0]).mass > 0) != block_.has_value())
      throw Damaged(body(m[0]).name + " is fixed and moves, or moves outside of parts");
    Told& s = to[m[0]];
    s.x = vector(m, 1), s.q = quaternion(m, 4), s.v = vector(m, 8), s.w = vector(m, 11);
  });
  if (word == "trial" && before_trial_.empty())
    for (const auto& [number, b] : bodies_) before_trial_[number] = {b.state, b.time};
  if (word == "part" && !before_trial_.empty()) {
    trial_ = told_states();
    for (auto& [number, b] : bodies_) std::tie(b.state, b.time) = before_trial_[number];
    before_trial_.clear();
  }
  const bool moves = word == "part" || word == "trial";
  if (moves) part(to);
  if (word == "extrapolated") extrapolated(to);
  if (word == "instant" || word == "arrives") follows(to);
  if (word == "instant") instant(to);
  for (const auto& [number, s] : to) {
    JudgedBody& b = body(number);
    if (!block_) expect("fixed bodies rest", s.v.norm() + s.w.norm(), 0, b.name);
    if (word == "start" && b.state) expect("motion goes on", apart(*b.state, s), 1e-6, b.name);
    expect("unit orientation", std::abs(s.q.norm() - 1), kRounding, b.name);
    b.state = s;
    b.time = block_ ? block_->numbers[0] + (moves ? block_->numbers[1] : 0) : 0;
  }
  hold(to);
  moved_ = moved_ || (block_ && !to.empty());
  block_.reset();
  lines_.clear();
}

Judge::States Judge::told_states() const {
  States out;
  for (const auto& [number, b] : bodies_)
    if (b.state) out[number] = *b.state;
  return out;
}

void Judge::hold(const States& to) {
  for (const auto& [number, joint] : joints_) {
    if (to.count(joint.body[0]) + to.count(joint.body[1]) == 0) continue;
    const Told s[2] = {state(joint.body[0]), state(joint.body[1])};
    double arm = 1 + joint.arms() + std::max(s[0].x.norm(), s[1].x.norm()), fast = 1, time = 0;
    for (int k = 0; k < 2; ++k) {
      fast = std::max(fast, 1 + s[k].v.norm() + s[k].w.norm() * arm);
      if (joint.body[k] >= 0) time = std::max(time, body(joint.body[k]).time);
    }
    const JudgedJoint::Errors e = joint.errors(s, time);
    for (const double off : e.off) expect("joints hold", std::abs(off), kHolds * arm, joint.name);
    for (const std::vector<double>* all : {&e.slips, &e.spins})
      for (const double slip : *all)
        expect("joints' velocities", std::abs(slip), kHolds * fast * arm, joint.name);
  }
}

// Impulses of effects; of an instant (factor 1) forces.
void Judge::push(double factor, const States& to, Loads& loads) {
  std::map<double, int> weights;
  double power = 0, size = 0;
  each("push", [&](const auto& n, const auto& effect) {
    const auto found = to.find(n[0]);
    if (found == to.end()) throw Damaged("a push on a body that does not move");
    const Vector3d force = vector(n, 1), torque = vector(n, 4);
    loads[n[0]].add(force, torque);
    // An impact has no forces: these stop what moves too slowly to count, and do no work on what
    // is left.
    if (factor == 0) {
      const JudgedBody& b = body(n[0]);
      const Told &begin = *b.state, &end = found->second;
      expect("comes to rest",
             force.norm() / b.mass +
                 b.unspin(end.q, torque).norm() * std::sqrt(b.inertia.trace() / b.mass),
             kSlow, b.name);
      power += force.dot(end.v) + torque.dot(end.w);
      size += force.norm() * (end.v.norm() + begin.v.norm()) +
              torque.norm() * (end.w.norm() + begin.w.norm());
    }
    if (effect != "gravity") return;
    ++weights[n[0]];
    const Vector3d weight = factor * body(n[0]).mass * gravity_;
    // The time of a short part is the difference of two.
    const double rounding = kTimes * (1 + std::abs(when_)) * body(n[0]).mass * gravity_.norm();
    expect("weight", (vector(n, 1) - weight).norm(), kRounding * weight.norm() + rounding,
           body(n[0]).name);
  });
  const bool belts = std::any_of(bodies_.begin(), bodies_.end(), [](const auto& each) {
    return !each.second.belt.isZero(0) || !each.second.belt_turn.isZero(0);
  });
  if (!belts) expect("work of what comes to rest", std::abs(power), kBalance * size, "impact");
  if (!gravity_.isZero(0) && factor > 0)
    for (const auto& [number, s] : to)
      expect("weight acts", std::abs(1.0 - weights[number]), 0, body(number).name);
}

void Judge::pull(const States& to, Loads& loads, Loads& late) {
  each("pull", [&](const auto& n, const auto&) {
    const auto found = reacts_.find(n[0]);
    if (found == reacts_.end())
      throw Damaged(fmt::format("a pull of joint {}, which is not told", n[0]));
    const JudgedJoint& joint = joints_.at(found->second);
    const States* at = n[1] != 0 ? &to : nullptr;
    const Told s[2] = {state(joint.body[0], at), state(joint.body[1], at)};
    for (std::size_t k = 0; k < 2; ++k)
      if (to.count(joint.body[k]) > 0)
        (n[1] != 0 ? late : loads)[joint.body[k]].add(vector(n, 2 + 6 * k), vector(n, 5 + 6 * k));
    pull_of(joint, n, joints_.count(n[0]) == 0, s);
  });
}

// A reaction is opposite on both bodies, and along directions that the joint holds, drives or, at
// once, has laws of.
void Judge::pull_of(const JudgedJoint& joint, const std::vector<double>& n, bool couples,
                    const Told (&s)[2]) {
  JudgedJoint::Place p = joint.place(s);
  if (couples) p.held.clear(), p.turns.clear();
  if (couples || (joint.has_laws && (block_->word == "instant" || block_->numbers[1] == 0))) {
    if (joint.kind == "ball") p.turns = {Vector3d::UnitX(), Vector3d::UnitY()};
    (joint.kind == "slider" ? p.held : p.turns)
        .push_back(joint.kind == "ball" ? Vector3d(Vector3d::UnitZ()) : p.z);
  }
  const Vector3d f[2] = {vector(n, 2), vector(n, 8)}, m[2] = {vector(n, 5), vector(n, 11)};
  const Vector3d arm[2] = {s[0].x - p.at, s[1].x - p.at};
  const Vector3d about = m[0] + arm[0].cross(f[0]);
  const double size = f[0].norm() + f[1].norm();
  const double bound =
      kHolds * (m[0].norm() + m[1].norm() + size * (arm[0].norm() + arm[1].norm() + 1e-3));
  expect("reaction", (f[0] + f[1]).norm(), kRounding * size, joint.name);
  expect("moment of reaction", (about + m[1] + arm[1].cross(f[1])).norm(), bound, joint.name);
  const auto rest = [](Vector3d total, const std::vector<Vector3d>& along) {
    for (const Vector3d& u : along) total -= total.dot(u) / std::max(u.squaredNorm(), 1e-300) * u;
    return total.norm();
  };
  expect("force of the joint's kind", rest(f[0], p.held), bound + 1e-12, joint.name);
  expect("moment of the joint's kind", rest(about, p.turns), bound + 1e-12, joint.name);
}

void Judge::push_by_contacts(Loads& loads) {
  near_.clear();
  each("contact", [&](const auto& n, const auto&) {
    const JudgedContact c(n);
    near_[{c.body[0], c.body[1]}].push_back(c.on[0]);
    for (int k = 0; k < 2; ++k) {
      const auto load = loads.find(c.body[k]);
      if (load == loads.end()) continue;
      const Vector3d x = k == 0 ? c.x : -c.x, moment = k == 0 ? c.moment : -c.moment;
      load->second.add(x, moment + (c.on[k] - state(c.body[k]).x).cross(x));
    }
  });
}

// Returns the natural residual; `speed`: the largest so far, which it is a part of. At an instant
// all motions are one. A sub-step obeys its laws in its middle, which is this far from its start:
// bodies turn, their normal does along an edge, and points move in their face, or along a curve:
// an ellipsoid's radius is at most a^2 / height, and a^2 5/2 of trace / mass; twice that, as mass
// may lie inside.
double Judge::contact(const JudgedContact& c, double dt, const States& came, const States& free,
                      const States& mid, double& speed) {
  const std::string what = name_of(c);
  const auto [law, pair] = friction(c);
  double inverse = 0, turning = 0, fast = 0, round = INFINITY, flat = 0, patch = 0;
  Vector3d before = Vector3d::Zero(), comes = before, w = before, belts = before;
  for (int k = 0; k < 2; ++k) {
    const double number = c.body[k], sign = k == 0 ? 1 : -1;
    const JudgedBody& b = body(number);
    const Vector3d r = c.on[k] - state(number).x;
    const Told &start = came.at(number), &coming = free.at(number), &end = mid.at(number);
    const auto add = [&](Vector3d& out, const Told& s) { out += sign * (s.v + s.w.cross(r)); };
    add(before, start), add(comes, coming), add(w, end);
    belts += sign * b.belt_at(r);
    turning += start.w.norm() + end.w.norm();
    fast += start.v.norm() + end.v.norm() + coming.v.norm() + end.w.norm() * r.norm();
    if (!(b.mass > 0)) continue;
    inverse += 1 / b.mass;
    round = std::min(round, r.norm());
    flat = std::max(flat, 5 * b.inertia.trace() / b.mass / std::max(std::abs(r.dot(c.n)), 1e-300));
  }
  for (const Vector3d& p : near_[{c.body[0], c.body[1]}])
    patch = std::max(patch, (p - c.on[0]).norm());
  const double spins = (free.at(c.body[0]).w - free.at(c.body[1]).w).norm();
  const double most = std::max(before.norm(), comes.norm());
  const double middle =
      dt * (turning * fast + spins * spins * flat + most * most / std::max(round, 1e-300)) +
      spins * patch;
  const double push = c.x.dot(c.n), spin = c.moment.dot(c.n), size = c.x.norm();
  expect("points of contact", (c.on[0] - c.on[1]).norm(),
         std::abs(c.gap) * (1 + kLaw) + kRounding * (1 + c.on[0].norm()), what);
  expect("unit normal", std::abs(c.n.norm() - 1), kRounding, what);
  expect("moments of friction",
         std::max(std::abs(spin) - pair.torsional * push,
                  (c.moment - spin * c.n).norm() - pair.rolling * push),
         kBalance * push + kRounding, what);
  const double rounding = kRounding * (1 + fast);
  expect("surface speed", (c.slip - belts + belts.dot(c.n) * c.n).norm(), middle + rounding, what);
  const double off = natural_residual(law, c.n, inverse * c.x, w + c.slip + c.bias * c.n);
  if (block_->word == "instant") {
    expect("contact closed", std::abs(c.gap), kInstant, what);
    expect("law of contact", off, kInstant * (1 + fast) + kBalance * size * inverse, what);
    return off;
  }
  const double tiny = kBalance * size + (inverse > 0 ? kRounding * most / inverse : 0);
  expect("contacts push", -push, tiny, what);
  expect("Coulomb's cone", (c.x - push * c.n).norm(), std::max(law.along, law.across) * push + tiny,
         what);
  speed = std::max(speed, before.norm() + comes.norm() + c.slip.norm() + std::abs(c.bias) +
                              size * inverse + gravity_.norm() * dt);
  const double approach = -before.dot(c.n), approaches = -comes.dot(c.n);
  double wrong = std::abs(c.bias - (dt > 0 ? std::max(c.gap, 0.0) / dt : 0)) - middle;
  if (approaches * dt > c.gap || dt == 0)
    wrong = std::min({wrong, std::abs(c.bias) - middle,
                      std::abs(c.bias + pair.restitution * std::min(approach, approaches))});
  if (block_->numbers[2] == 0) expect("restitution, or gap that closes", wrong, rounding, what);
  return off;
}

std::pair<Friction, JudgedPair> Judge::friction(const JudgedContact& c) {
  for (const auto& [first, second] :
       {std::pair(c.body[0], c.body[1]), std::pair(c.body[1], c.body[0])}) {
    const auto found = pairs_.find({body(first).material, body(second).material});
    if (found == pairs_.end()) continue;
    const JudgedPair& pair = found->second;
    Friction out{pair.along, pair.across, Vector3d::Zero(), associated_};
    if (frictionless_) out.along = out.across = 0;
    if (out.along != out.across) out.axis = state(first).q * body(first).axis;
    return {out, pair};
  }
  throw Damaged(name_of(c) + ": bodies of no pair touch");
}

Verdict judge(const std::string& file) {
  try {
    return Judge().run(file);
  } catch (const Damaged& why) {
    Verdict out;
    out.damage = why.what();
    return out;
  } catch (const std::exception& why) {  // of maps: what a line names is missing
    Verdict out;
    out.damage = std::string("a part is missing: ") + why.what();
    return out;
  }
}

}  // namespace tether::scene::certificate

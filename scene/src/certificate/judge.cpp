// Tether: reads a certificate and asks the laws that hold of every line. SPDX-License-Identifier:
// BSD-3-Clause
#include "judging.hpp"

#include <fmt/format.h>

#include <cmath>

namespace tether::scene::certificate {

namespace {

bool is_in_block(const std::string& word) {
  for (const char* each : {"push", "contact", "pull", "law", "via", "placed", "rate"})
    if (word == each) return true;
  return false;
}

}  // namespace

Verdict Judge::run(const std::string& file) {
  Reader reader(file);
  Record line;
  while (reader.next(line)) {
    if (is_in_block(line.word) && !block_) throw Damaged(line.word + " is of no part");
    if (line.word == "to") body(line.numbers[0]);
    if (is_in_block(line.word) || line.word == "to") {
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

void Judge::head_of_bodies(const Record& line) {
  const std::vector<double>& n = line.numbers;
  if (line.word == "body") {
    JudgedBody b;
    b.mass = n[1];
    b.inertia << n[2], n[7], n[6], n[7], n[3], n[5], n[6], n[5], n[4];
    b.material = n[8] >= 0 && n[8] < 1e9 ? static_cast<int>(n[8]) : -1;
    b.name = line.text;
    if (!(b.mass >= 0) || (b.mass > 0 && !(std::abs(b.inertia.determinant()) > 0)))
      throw Damaged("body " + b.name + " has no mass or inertia that moves");
    bodies_[n[0]] = std::move(b);
  } else if (line.word == "surface") {
    JudgedBody& b = body(n[0]);
    b.belt = vector(n, 1), b.belt_turn = vector(n, 4), b.axis = vector(n, 7);
  } else if (line.word == "pair") {
    if (!(std::abs(n[0]) < 1e9 && std::abs(n[1]) < 1e9)) throw Damaged("a pair of no materials");
    pairs_[{static_cast<int>(n[0]), static_cast<int>(n[1])}] = {n[2], n[3], n[4], n[5], n[6]};
  }
}

void Judge::head(const Record& line) {
  const std::vector<double>& n = line.numbers;
  const std::string& word = line.word;
  head_of_bodies(line);
  if (word == "gravity") gravity_ = vector(n, 0);
  if (word == "engine") {
    joints_.clear(), coupled_.clear(), past_.clear();
    keeps_momentum_ = line.text.find(" momentum ") != std::string::npos;
    associated_ = line.text.find(" maximum_dissipation") != std::string::npos;
    frictionless_ = line.text.find(" frictionless") != std::string::npos;
  }
  if (word == "joint") {
    const JudgedJoint joint(line);
    for (const double b : joint.body)
      if (b != -1) body(b);
    joints_.insert_or_assign(n[0], joint);
  }
  if (word == "coupled") {
    if (joints_.count(n[1]) == 0) throw Damaged("a coupling of a joint that is not told");
    coupled_.emplace_back(n[0], n[1]);
  }
  if (word == "step" || word == "end")
    end_of_step(word == "step" ? std::optional(n[1]) : std::nullopt);
  if (word == "step") {
    step_ = n[0], claimed_ = n[3], until_ = n[2];
    expect("contact problems solved", std::abs(n[4] - 1), 0, "step");
    expect("residual of contact problems", std::abs(claimed_), kUseful, "step");
  }
  for (const char* each : {"part", "trial", "instant", "arrives", "extrapolated", "start"})
    if (word == each) block_ = line, when_ = n[0];
}

// All bodies have reached the end of the step, where the next one begins.
void Judge::end_of_step(std::optional<double> start) {
  if (!until_) return;
  const double slack = kRounding * (1 + std::abs(*until_));
  for (const auto& [number, b] : bodies_)
    if (b.mass > 0) expect("time goes on", std::abs(b.time - *until_), slack, b.name);
  if (start) expect("time goes on", std::abs(*start - *until_), slack, "step");
}

void Judge::finish() {
  if (!block_)
    for (const Record& line : lines_) rests(body(line.numbers[0]), told(line.numbers, 1));
  else
    judge_block();
  block_.reset();
  lines_.clear();
}

// Outside of blocks places of fixed bodies are told.
void Judge::rests(JudgedBody& b, const Told& s) {
  expect("unit orientation", std::abs(s.q.norm() - 1), kRounding, b.name);
  expect("fixed bodies rest", s.v.norm() + s.w.norm(), 0, b.name);
  b.state = s;
}

void Judge::judge_block() {
  const std::string& word = block_->word;
  const std::vector<double>& n = block_->numbers;
  States to;
  each("to", [&](const auto& m, const auto&) { to[m[0]] = told(m, 1); });
  for (const auto& [number, s] : to)
    if (!(body(number).mass > 0)) throw Damaged(body(number).name + " is fixed and moves");
  if (word == "trial" && before_trial_.empty())
    for (const auto& [number, b] : bodies_) before_trial_[number] = {b.state, b.time};
  if (word == "part" && !before_trial_.empty()) {
    trial_.clear();
    for (auto& [number, b] : bodies_) {
      if (b.state) trial_[number] = *b.state;
      std::tie(b.state, b.time) = before_trial_[number];
    }
    before_trial_.clear();
  }
  if (word == "part" || word == "trial") part(to);
  if (word == "extrapolated") extrapolated(to);
  if (word == "instant" || word == "arrives") follows(to);
  if (word == "instant") instant(to);
  moved_ = moved_ || !to.empty();
  for (const auto& [number, s] : to) {
    JudgedBody& b = body(number);
    if (word == "start" && b.state) expect("motion goes on", apart(*b.state, s), 1e-6, b.name);
    b.state = s;
    b.time = n[0] + (word == "part" || word == "trial" ? n[1] : 0);
    expect("unit orientation", std::abs(s.q.norm() - 1), kRounding, b.name);
  }
  hold(to);
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
    const auto [off, slips] = joint.errors(s, time);
    expect("joints hold", off, kHolds * arm, joint.name);
    expect("joints' velocities", slips, kHolds * fast * arm, joint.name);
  }
}

// Impulses of effects; of an instant (factor 1) forces.
void Judge::push(double factor, const States& to, Loads& loads) {
  std::map<double, int> weights;
  each("push", [&](const auto& n, const auto& effect) {
    if (to.count(n[0]) > 0) loads[n[0]].add(vector(n, 1), vector(n, 4));
    if (effect != "gravity") return;
    ++weights[n[0]];
    const Vector3d weight = factor * body(n[0]).mass * gravity_;
    // The time of a short part is the difference of two.
    const double rounding = kTimes * (1 + std::abs(when_)) * body(n[0]).mass * gravity_.norm();
    expect("weight", (vector(n, 1) - weight).norm(), kRounding * weight.norm() + rounding,
           body(n[0]).name);
  });
  if (!gravity_.isZero(0) && factor > 0)
    for (const auto& [number, s] : to)
      expect("weight acts", std::abs(1.0 - weights[number]), 0, body(number).name);
}

void Judge::pull(const States& to, Loads& loads, Loads& late) {
  each("pull", [&](const auto& n, const auto&) {
    const auto count = static_cast<double>(joints_.size());
    const double part = n[0] - count;
    const bool couples = part >= 0;
    if (n[0] != std::floor(n[0]) || part >= static_cast<double>(coupled_.size()) ||
        (!couples && joints_.count(n[0]) == 0))
      throw Damaged(fmt::format("a pull of joint {}, which is not told", n[0]));
    const JudgedJoint& joint =
        joints_.at(couples ? coupled_[static_cast<std::size_t>(part)].second : n[0]);
    const States* at = n[1] != 0 ? &to : nullptr;
    const Told s[2] = {state(joint.body[0], at), state(joint.body[1], at)};
    for (int k = 0; k < 2; ++k) {
      const std::size_t from = k == 0 ? 2 : 8;
      if (to.count(joint.body[k]) == 0) continue;
      (n[1] != 0 ? late : loads)[joint.body[k]].add(vector(n, from), vector(n, from + 3));
    }
    pull_of(joint, n, couples, s);
  });
}

// A reaction is opposite on both bodies, and along directions that the joint holds or drives.
void Judge::pull_of(const JudgedJoint& joint, const std::vector<double>& n, bool couples,
                    const Told (&s)[2]) {
  JudgedJoint::Place p = joint.place(s);
  const bool slides = joint.kind == "slider";
  bool drives = joint.driven;
  if (block_->word == "instant" || block_->numbers[1] == 0) {
    drives = drives || joint.has_laws;
    for (const auto& [coupling, number] : coupled_) drives = drives || number == n[0];
  }
  if (couples) p.held.clear(), p.turns.clear();
  if (couples || drives) (slides ? p.held : p.turns).push_back(p.z);
  if (drives && joint.kind == "ball")
    p.turns = {Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()};
  const Vector3d f[2] = {vector(n, 2), vector(n, 8)}, m[2] = {vector(n, 5), vector(n, 11)};
  Vector3d about[2];
  double arm = 0;
  for (int k = 0; k < 2; ++k) {
    about[k] = m[k] + (s[k].x - p.at[0]).cross(f[k]);
    arm += (s[k].x - p.at[0]).norm();
  }
  const double size = f[0].norm() + f[1].norm();
  const double bound = kHolds * (m[0].norm() + m[1].norm() + size * (arm + 1e-3));
  expect("reaction", (f[0] + f[1]).norm(), kRounding * size, joint.name);
  expect("moment of reaction", (about[0] + about[1]).norm(), bound, joint.name);
  const auto rest = [](Vector3d total, const std::vector<Vector3d>& along) {
    for (const Vector3d& u : along) total -= total.dot(u) / std::max(u.squaredNorm(), 1e-300) * u;
    return total.norm();
  };
  expect("force of the joint's kind", rest(f[0], p.held), bound + 1e-12, joint.name);
  expect("moment of the joint's kind", rest(about[0], p.turns), bound + 1e-12, joint.name);
}

void Judge::load_contact(const JudgedContact& c, Loads& loads) {
  for (const auto& [number, sign] : {std::pair(c.first, 1.0), std::pair(c.second, -1.0)}) {
    const auto load = loads.find(number);
    if (load == loads.end()) continue;
    const Vector3d arm = c.on(number) - state(number).x;
    load->second.add(sign * c.x, sign * (c.moment + arm.cross(c.x)));
  }
}

std::pair<Friction, JudgedPair> Judge::friction(const JudgedContact& c) {
  for (const auto& [first, second] : {std::pair(c.first, c.second), std::pair(c.second, c.first)}) {
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

void Judge::moments(const JudgedContact& c, const JudgedPair& pair, const std::string& what) {
  const double push = c.x.dot(c.n), spin = c.moment.dot(c.n);
  expect("moments of friction",
         std::max(std::abs(spin) - pair.torsional * push,
                  (c.moment - spin * c.n).norm() - pair.rolling * push),
         kBalance * push + kRounding, what);
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

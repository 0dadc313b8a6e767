// Tether: judges a certificate by the laws of mechanics. SPDX-License-Identifier: BSD-3-Clause
//
// Bounds are parts of the impulses, forces or speeds of the same body or contact. Records of smooth
// motion are compared by a formula of fourth order, whose error they bound themselves.
#include "judge.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <array>
#include <deque>
#include <optional>

#include "judged_joint.hpp"
#include "natural_map.hpp"

namespace tether::scene::certificate {

namespace {

using Eigen::Matrix3d;

constexpr double kBalance = 1e-6;    // of the impulses or forces on a body
constexpr double kLaw = 1e-6;        // of the speeds at contacts
constexpr double kUseful = 1e-2;     // residual of a problem whose solution a step may use
constexpr double kHolds = 1e-6;      // of the arms and speeds of a joint
constexpr double kTimes = 1e-15;     // of times: their rounding
constexpr double kRounding = 1e-9;   // of places, times and frames
constexpr double kEquations = 1e-5;  // of the forces at an instant
constexpr double kInstant = 1e-4;    // of accelerations and speeds of smooth motion
constexpr double kLeads = 1e-5;      // of momenta and places from one instant to the next
constexpr std::size_t kTold = 10;    // faults

Vector3d vector(const std::vector<double>& n, std::size_t k) { return {n[k], n[k + 1], n[k + 2]}; }
Quaterniond quaternion(const std::vector<double>& n, std::size_t k) {
  return {n[k], n[k + 1], n[k + 2], n[k + 3]};
}
Quaterniond rotation(const Vector3d& v) {
  const double a = v.norm(), s = a > 0 ? std::sin(a / 2) / a : 0.5;
  return {std::cos(a / 2), s * v.x(), s * v.y(), s * v.z()};
}
double apart(const Quaterniond& p, const Quaterniond& q) {
  return 2 * std::min((p.coeffs() - q.coeffs()).norm(), (p.coeffs() + q.coeffs()).norm());
}
double apart(const Told& a, const Told& b) {
  return (a.x - b.x).norm() + (a.v - b.v).norm() + (a.w - b.w).norm() + apart(a.q, b.q);
}
Told told(const std::vector<double>& n, std::size_t k) {
  Told s;
  s.x = vector(n, k), s.q = quaternion(n, k + 3), s.v = vector(n, k + 7), s.w = vector(n, k + 10);
  return s;
}

/// Impulse, or force, and its moment about the centre; the sums of their sizes.
struct Load {
  Vector3d force = Vector3d::Zero(), torque = Vector3d::Zero();
  double forces = 0, torques = 0;
  void add(const Vector3d& f, const Vector3d& m) {
    force += f, torque += m;
    forces += f.norm(), torques += m.norm();
  }
};

struct JudgedBody {
  double mass = 0;
  int material = -1;
  Matrix3d inertia = Matrix3d::Zero();
  std::string name;
  std::optional<Told> state;
  double time = 0;
  Vector3d belt = Vector3d::Zero(), belt_turn = Vector3d::Zero(), axis = Vector3d::Zero();

  bool is_round() const {
    return (inertia - inertia(0, 0) * Matrix3d::Identity()).cwiseAbs().maxCoeff() <=
           1e-13 * inertia(0, 0);
  }
  Vector3d spin(const Quaterniond& q, const Vector3d& w) const {
    return q * (inertia * (q.conjugate() * w));
  }
  Vector3d unspin(const Quaterniond& q, const Vector3d& momentum) const {
    return q * (inertia.inverse() * (q.conjugate() * momentum));
  }
  /// Velocity of the surface against the body at a point.
  Vector3d belt_at(const Vector3d& p) const {
    return state->q * (belt + belt_turn.cross(state->q.conjugate() * (p - state->x)));
  }
};

struct JudgedPair {
  double along = 0, across = 0, restitution = 0, rolling = 0, torsional = 0;
};

struct JudgedContact {
  explicit JudgedContact(const std::vector<double>& m)
      : first(m[0]),
        second(m[1]),
        on_first(vector(m, 2)),
        on_second(vector(m, 5)),
        n(vector(m, 8)),
        gap(m[11]),
        bias(m[12]),
        slip(vector(m, 13)),
        x(vector(m, 16)),
        moment(vector(m, 19)) {}
  const Vector3d& on(double body) const { return body == first ? on_first : on_second; }
  double first, second;
  Vector3d on_first, on_second, n;
  double gap, bias;
  Vector3d slip, x, moment;
};

/// Bodies at an instant with their accelerations, moments of forces and angular momenta.
struct Instant {
  struct One {
    Told s;
    Vector3d a, alpha, torque, spin;
  };
  double time = 0, events = 0;
  std::map<double, One> bodies;
};

class Judge {
 public:
  Verdict run(const std::string& file);

 private:
  using States = std::map<double, Told>;
  using Loads = std::map<double, Load>;

  void head(const Record& line);
  void head_of_bodies(const Record& line);
  void finish();
  void end_of_step(std::optional<double> start);
  void expect(const char* law, double amount, double bound, const std::string& what);
  JudgedBody& body(double number);
  Told state(double number, const States* to = nullptr) const;
  template <class F>
  void each(const char* word, const F& f) {
    for (const Record& line : lines_)
      if (line.word == word) f(line.numbers, line.text);
  }

  void rests(JudgedBody& b, const Told& s);
  void judge_block();
  void part(const States& to);
  void push(double factor, const States& to, Loads& loads);
  void pull(const States& to, Loads& loads, Loads& late);
  void pull_of(const JudgedJoint& joint, const std::vector<double>& n, bool couples,
               const Told (&s)[2]);
  void load_contact(const JudgedContact& c, Loads& loads);
  void contacts(double dt, const States& free, const States& mid);
  double contact(const JudgedContact& c, double patch, double dt, const States& free,
                 const States& mid, double& speed);
  void moments(const JudgedContact& c, const JudgedPair& pair, const std::string& what);
  std::pair<Friction, JudgedPair> friction(const JudgedContact& c);
  std::string name_of(const JudgedContact& c) {
    return body(c.first).name + " on " + body(c.second).name;
  }
  void laws(double dt, const States& mid);
  void moves(const JudgedBody& b, double dt, const Load& load, const Load& late, const Told& placed,
             const Told& end);
  void turns(const JudgedBody& b, double dt, const Load& load, const Load& late, const Told& placed,
             const Told& end);
  void extrapolated(const States& to);
  void hold(const States& to);
  void follows(const States& to);
  void instant(const States& to);
  void touch(const JudgedContact& c);
  void accelerates(const JudgedBody& b, Instant::One& one, const Vector3d& a, const Vector3d& alpha,
                   const Load& load);
  void leads(double number, const Instant::One& from, const Instant::One& to);

  Verdict verdict_;
  std::map<double, JudgedBody> bodies_;
  std::map<std::pair<int, int>, JudgedPair> pairs_;
  std::map<double, JudgedJoint> joints_;
  std::vector<std::pair<double, double>> coupled_;  // coupling, joint
  Vector3d gravity_ = Vector3d::Zero();
  bool keeps_momentum_ = true, associated_ = false, frictionless_ = false, moved_ = false;
  double step_ = 0, when_ = 0, claimed_ = 0;
  std::optional<double> until_;
  std::optional<Record> block_;
  std::vector<Record> lines_;
  std::map<double, std::pair<std::optional<Told>, double>> before_trial_;
  std::map<double, Told> trial_;  // its end
  std::deque<Instant> past_;
};

bool is_in_block(const std::string& word) {
  for (const char* each : {"push", "contact", "pull", "law", "via", "placed", "rate"})
    if (word == each) return true;
  return false;
}

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

}  // namespace

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

// Tether: what a scene asks for. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <ostream>
#include <set>
#include <stdexcept>
#include <tether/scene/plan.hpp>
#include <tether/scene/words.hpp>

namespace tether::scene {

namespace {

template <class Items, class Predicate>
int count(const Items& items, Predicate predicate) {
  return static_cast<int>(std::count_if(items.begin(), items.end(), predicate));
}

std::string number(int n, const char* one) {
  return fmt::format("{} {}{}", n, one, n == 1 ? "" : "s");
}

std::string vector(const Eigen::Vector3d& v) {
  return fmt::format("[{}, {}, {}]", v.x(), v.y(), v.z());
}

// A sphere's axis of rotation stays by itself.
bool precesses(const Body& body) {
  const double scale = body.inertia.cwiseAbs().maxCoeff();
  const double mean = body.inertia.trace() / 3;
  return !body.fixed && !(body.inertia - mean * Eigen::Matrix3d::Identity()).isZero(1e-14 * scale);
}

bool rubs(const Pair& pair) { return pair.friction > 0; }
bool bounces(const Pair& pair) { return pair.restitution > 0; }
bool damps(const Spring& spring) { return spring.damping > 0; }
bool pulls(const Spring& spring) { return spring.stiffness > 0 || !damps(spring); }
bool is_driven(const Joint& joint) { return joint.motion.has_value(); }

// Pairs of bodies, at least one of them moving, whose materials meet.
long contact_pairs(const Scene& scene) {
  struct Bodies {
    long all = 0, moving = 0;
  };
  std::map<std::string, Bodies> of;
  for (const Body& body : scene.bodies) {
    if (body.material.empty()) continue;
    ++of[body.material].all;
    of[body.material].moving += !body.fixed;
  }
  long sum = 0;
  for (const Pair& pair : scene.pairs) {
    const Bodies a = of[pair.first], b = of[pair.second];
    const auto fixed = [](const Bodies& x) { return x.all - x.moving; };
    if (pair.first == pair.second)
      sum += a.all * (a.all - 1) / 2 - fixed(a) * (fixed(a) - 1) / 2;
    else
      sum += a.all * b.all - fixed(a) * fixed(b);
  }
  return sum;
}

std::string kinds(const std::vector<Joint>& joints) {
  std::string text;
  for (const auto& [name, kind] : Words<JointKind>::list) {
    const int n = count(joints, [k = kind](const Joint& j) { return j.kind == k; });
    if (n > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", n, name);
  }
  return text;
}

template <class Value>
std::string range(const std::vector<Pair>& pairs, Value value) {
  double low = value(pairs.front()), high = low;
  for (const Pair& pair : pairs) {
    low = std::min(low, value(pair));
    high = std::max(high, value(pair));
  }
  return low == high ? fmt::format("{}", low) : fmt::format("{} to {}", low, high);
}

std::vector<Effect> effects(const Scene& s, EngineKind engine) {
  const SteppingOptions stepping = s.stepping.value_or(SteppingOptions{});
  std::vector<Effect> on;
  const auto add = [&](bool named, const char* name, const std::string& detail) {
    if (named) on.push_back({name, detail});
  };
  const bool steps = engine == EngineKind::stepping;

  if (s.gravity) add(true, "gravity", vector(*s.gravity) + " m/s^2");
  if (!s.pairs.empty()) {
    const bool friction = stepping.law != ContactLaw::frictionless &&
                          std::any_of(s.pairs.begin(), s.pairs.end(), rubs);
    const bool restitution = std::any_of(s.pairs.begin(), s.pairs.end(), bounces);
    add(true, "contact", number(static_cast<int>(s.pairs.size()), "pair") + " of materials");
    add(friction, "friction",
        fmt::format("{}, law {}", range(s.pairs, [](const Pair& p) { return p.friction; }),
                    word(stepping.law)));
    add(restitution, "restitution", range(s.pairs, [](const Pair& p) { return p.restitution; }));
  }
  const bool gyroscopic = std::any_of(s.bodies.begin(), s.bodies.end(), precesses);
  add(gyroscopic && !(steps && stepping.gyroscopic == Gyroscopic::none), "gyroscopic term",
      steps ? std::string(word(stepping.gyroscopic)) : "in the equations of motion");
  add(!s.joints.empty(), "joints", kinds(s.joints));
  const int driven = count(s.joints, is_driven);
  add(driven > 0, "prescribed motion", number(driven, "joint"));
  const int springs = count(s.springs, pulls), dampers = count(s.springs, damps);
  add(springs > 0, "springs", number(springs, "spring"));
  add(dampers > 0, "dampers", number(dampers, "damper"));
  const int dragged = count(s.bodies, [](const Body& b) { return b.drag.has_value(); });
  add(dragged > 0, "drag", fmt::format("{} {}", dragged, dragged == 1 ? "body" : "bodies"));
  add(!s.loads.empty(), "loads", number(static_cast<int>(s.loads.size()), "load"));
  std::string invariants;
  for (const Invariant& each : s.invariants)
    invariants += fmt::format("{}{}{}", invariants.empty() ? "" : ", ", word(each.kind),
                              each.project ? "" : " (recorded)");
  add(!s.invariants.empty(), "invariants", invariants);
  return on;
}

// Of IDA: position, quaternion and velocities of each body, the work of forces if energy is kept in
// spite of them, and multipliers as the formulation has them.
int smooth_unknowns(const Scene& s, const Plan& plan) {
  const bool keeps_energy = std::any_of(
      s.invariants.begin(), s.invariants.end(),
      [](const Invariant& each) { return each.project && each.kind == InvariantKind::energy; });
  const bool works = std::any_of(s.springs.begin(), s.springs.end(), damps) ||
                     std::any_of(s.joints.begin(), s.joints.end(), is_driven) ||
                     std::any_of(s.bodies.begin(), s.bodies.end(),
                                 [](const Body& b) { return b.drag.has_value(); }) ||
                     !s.loads.empty();
  const Formulation form = s.smooth.value_or(SmoothOptions{}).formulation;
  const int multipliers = form == Formulation::index0 ? 0 : form == Formulation::index1 ? 1 : 2;
  return 13 * plan.moving + (keeps_energy && works ? 1 : 0) + multipliers * plan.rows;
}

EngineKind choose(const Scene& s, std::string& why) {
  std::string refusal;
  const auto refuse = [&](bool wrong, const std::string& text) {
    if (wrong) refusal += (refusal.empty() ? "" : "\n") + text;
  };
  const bool contact = !s.pairs.empty(), joints = !s.joints.empty();
  const bool projected = std::any_of(s.invariants.begin(), s.invariants.end(),
                                     [](const Invariant& each) { return each.project; });
  refuse(s.smooth && s.stepping, "the scene has options for both engines, [smooth] and [stepping]");
  refuse(contact && joints,
         "the scene has contacts ([[pair]]) and joints: no engine has both yet; leave out one of "
         "them");
  refuse(contact && s.smooth,
         "the smooth engine ([smooth]) has no contacts ([[pair]]): use [stepping]");
  refuse(s.stepping && joints, "the stepping engine ([stepping]) has no joints yet: use [smooth]");
  refuse((contact || s.stepping) && projected,
         "the stepping engine projects no invariants: give them project = false, or, without "
         "contacts, use [smooth]");
  if (!refusal.empty()) throw std::invalid_argument(refusal);

  if (contact) {
    why = "bodies touch";
    return EngineKind::stepping;
  }
  why = s.stepping ? "the scene asks for it"
        : s.smooth ? "nothing touches, and the scene asks for it"
                   : "nothing touches";
  return s.stepping ? EngineKind::stepping : EngineKind::smooth;
}

}  // namespace

int joint_rows(const Joint& joint) {
  const int motion = joint.motion && joint.kind != JointKind::distance ? 1 : 0;
  switch (joint.kind) {
    case JointKind::distance:
      return 1;
    case JointKind::ball:
      return 3;
    case JointKind::hinge:
    case JointKind::slider:
      return 5 + motion;
    case JointKind::fixed:
      return 6;
  }
  return 0;
}

Plan make_plan(const Scene& scene) {
  Plan plan;
  plan.engine = choose(scene, plan.why);
  plan.effects = effects(scene, plan.engine);
  for (const Body& body : scene.bodies) {
    ++plan.bodies;
    plan.moving += !body.fixed;
    plan.shapes += static_cast<int>(body.shapes.size());
  }
  for (const Joint& joint : scene.joints) plan.rows += joint_rows(joint);
  for (const Invariant& each : scene.invariants)
    if (each.project) plan.invariants += each.kind == InvariantKind::energy ? 1 : 3;
  plan.unknowns =
      plan.engine == EngineKind::stepping ? 6 * plan.moving : smooth_unknowns(scene, plan);
  plan.pairs = contact_pairs(scene);
  return plan;
}

std::ostream& operator<<(std::ostream& out, const Plan& plan) {
  const bool smooth = plan.engine == EngineKind::smooth;
  out << fmt::format("engine    {} ({})\n", smooth ? "smooth" : "stepping", plan.why);
  out << fmt::format("bodies    {}, {} of them moving; {}\n", plan.bodies, plan.moving,
                     number(plan.shapes, "shape"));
  if (smooth)
    out << fmt::format("unknowns  {}{}, with {} and {}\n", plan.rows > 0 ? "up to " : "",
                       plan.unknowns, number(plan.rows, "row") + " of joints",
                       number(plan.invariants, "invariant") + " kept");
  else
    out << fmt::format("unknowns  {} velocities; {} of bodies can touch\n", plan.unknowns,
                       plan.pairs == 1 ? "1 pair" : fmt::format("{} pairs", plan.pairs));
  out << "effects   " << (plan.effects.empty() ? "none: bodies move freely\n" : "");
  const char* indent = "";
  for (const Effect& each : plan.effects) {
    out << fmt::format("{}{:<18}{}\n", indent, each.name, each.detail);
    indent = "          ";
  }
  return out;
}

}  // namespace tether::scene

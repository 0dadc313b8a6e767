// Tether: what a scene asks for. SPDX-License-Identifier: BSD-3-Clause

#include <ostream>
#include <tether/scene/run.hpp>
#include <tether/scene/words.hpp>

#include "effects/list.hpp"
#include "effects/numbers.hpp"
#include "engine_type.hpp"
#include "joints/joint_type.hpp"
#include "smooth/rows/moving_bodies.hpp"

namespace tether::scene {

bool goes_on_in_steps(const Scene& scene) {
  return scene.event.value_or(EventOptions{}).otherwise == Otherwise::stepping;
}

namespace {

using mechanics::counted;

constexpr const char* kNothingTouches = "nothing touches";

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
    if (!pair.touch) continue;
    const Bodies a = of[pair.first], b = of[pair.second];
    const auto fixed = [](const Bodies& x) { return x.all - x.moving; };
    if (pair.first == pair.second)
      sum += a.all * (a.all - 1) / 2 - fixed(a) * (fixed(a) - 1) / 2;
    else
      sum += a.all * b.all - fixed(a) * fixed(b);
  }
  return sum;
}

// Which of the smooth engine's matrices have entries only where they are not zero.
std::string smooth_matrices(const Plan& plan) {
#ifdef TETHER_SCENE_KLU
  const bool jacobian = plan.unknowns >= smooth::kManyUnknowns;
#else
  const bool jacobian = false;
#endif
  std::string text = jacobian ? "sparse Jacobian (KLU)" : "dense Jacobian";
  if (plan.rows == 0) return text;
  return text + (smooth::by_entries(plan.rows, plan.moving) ? ", sparse rows" : ", dense rows") +
         " of joints";
}

// The engines that a scene asks for, and what it has that not all of them move.
struct Asked {
  bool smooth, event, then_steps, stepping, contact, laws, projected;
  bool other;  // one that has no table of options

  explicit Asked(const Scene& s)
      : smooth(s.engine == EngineKind::smooth || s.smooth),
        event(s.engine == EngineKind::event || s.event),
        then_steps(event && goes_on_in_steps(s)),
        stepping(s.engine == EngineKind::stepping || (s.stepping && !then_steps)),
        contact(!s.pairs.empty()),
        laws(effects::has_joint_laws(s)),
        projected(any_of(s.invariants, [](const Invariant& each) { return each.project; })),
        other(!smooth && !event && !stepping && s.engine != EngineKind::automatic) {}
  bool takes_steps() const { return !event && (stepping || contact || laws); }
};

/// Lines of what no engine has; empty: nothing.
std::string refusals(const Scene& s, const Asked& a, const std::string& no_event) {
  std::string text;
  const auto refuse = [&](bool wrong, const std::string& line) {
    if (wrong) text += (text.empty() ? "" : "\n") + line;
  };
  const auto resolves = [&](const auto& motion, const char* of) {
    if (motion)
      refuse(!effects::is_resolved(motion->frequency, s.end),
             fmt::format("the frequency of {}, {} Hz, {}", of, motion->frequency,
                         effects::unresolved(s.end)));
  };
  for (const Load& load : s.loads) resolves(load.history, "a load");
  for (const Joint& joint : s.joints) resolves(joint.motion, "the motion of a joint");
  refuse(a.smooth + a.stepping + a.event > 1,
         a.smooth && a.stepping && !a.event
             ? "the scene has options for both engines, [smooth] and [stepping]"
             : "the scene asks for more than one engine: by engine, [smooth], [stepping] or "
               "[event]");
  refuse(a.contact && a.smooth,
         "the smooth engine ([smooth]) has no contacts ([[pair]]): use [stepping] or [event]");
  refuse(a.laws && a.smooth,
         "the joints of the scene have limits, motors or friction, or cables rub, which the smooth "
         "engine does not have: use [stepping] or [event]");
  refuse(a.takes_steps() && a.projected,
         "the stepping engine projects no invariants: give them project = false, or, without "
         "contacts, use [smooth]");
  refuse(a.event && !a.then_steps && !no_event.empty(), no_event);
  refuse(a.then_steps && a.projected,
         "[event] otherwise = \"stepping\": the stepping engine projects no invariants: give them "
         "project = false");
  // Engines whose steps resolve a load.
  if (a.stepping || a.then_steps || (!a.event && !a.smooth && (a.contact || a.laws))) return text;
  for (const Load& load : s.loads) {
    if (!effects::pushes(load)) continue;
    const double steps = effects::kStepsOfPeriod * load.history->frequency * s.end;
    refuse(!(steps <= kMostSteps),
           fmt::format("a load of {:g} Hz takes {:.3g} steps until the end in the engines smooth "
                       "and event, {:g} at most are taken: use [stepping], which takes means",
                       load.history->frequency, steps, kMostSteps));
  }
  return text;
}

EngineKind choose(const Scene& s, std::string& why, std::string& no_event) {
  const Asked asked(s);
  no_event = asked.contact || asked.laws || asked.event ? event_engine_refusal(s)
                                                        : std::string(kNothingTouches);
  if (const std::string refused = refusals(s, asked, no_event); !refused.empty())
    throw std::invalid_argument(refused);
  if (asked.other) {
    why = "the scene asks for it";
    return s.engine;
  }
  if (asked.then_steps && !no_event.empty()) {
    why = "[event] otherwise: " + no_event;
    return EngineKind::stepping;
  }
  if (asked.event) {
    why = asked.contact ? "bodies touch, and the scene asks for it"
          : asked.laws
              ? "joints have limits, motors or friction, or cables rub, and the scene asks for it"
              : "the scene asks for it";
    return EngineKind::event;
  }
  if (asked.contact)
    why = s.joints.empty() ? "bodies touch" : "bodies touch; it has joints, too";
  else if (asked.laws && !asked.stepping)
    why = "joints have limits, motors or friction, or cables rub";
  else
    why = asked.stepping ? "the scene asks for it"
          : asked.smooth ? "nothing touches, and the scene asks for it"
                         : "nothing touches";
  return asked.takes_steps() ? EngineKind::stepping : EngineKind::smooth;
}

// Which engines could move the scene, too, or why not.
std::string others(const Plan& plan) {
  const bool free = plan.invariants == 0;  // only the smooth engine keeps some
  if (plan.engine == EngineKind::event && plan.then_steps > 0)
    return fmt::format(
        "          where it cannot go on, [stepping] takes over, at steps of {:g} s, and gives "
        "back\n",
        plan.then_steps);
  if (plan.engine == EngineKind::event)
    return "          [stepping] could move it, too, at fixed steps or within an accuracy\n";
  if (plan.engine == EngineKind::smooth)
    return free ? "          [stepping] and engine = \"event\" could move it, too\n" : "";
  if (plan.pairs == 0 && plan.no_event == kNothingTouches)
    return free ? "          [smooth] could move it, too\n" : "";
  return plan.no_event.empty() ? "          engine = \"event\" could move it, too\n"
                               : "          " + plan.no_event + "\n";
}

}  // namespace

std::string simultaneous_impacts_text(const Scene& scene) {
  return scene.simultaneous_impacts == contact::SimultaneousImpacts::together
             ? "those at one instant together: Newton's law for all that touch, in one problem"
             : "those at one instant in turn: what approaches, then what this makes approach";
}

int joint_rows(const Joint& joint) { return joints::row_count(joint); }

Plan make_plan(const Scene& scene) {
  Plan plan;
  plan.engine = choose(scene, plan.why, plan.no_event);
  const SteppingOptions stepping = scene.stepping.value_or(SteppingOptions{});
  if (plan.engine == EngineKind::stepping && stepping.accuracy > 0)
    plan.why += fmt::format("; sub-steps within an accuracy of {:g}", stepping.accuracy);
  if (plan.engine == EngineKind::event && goes_on_in_steps(scene)) plan.then_steps = stepping.step;
  for (const effects::Effect* each : effects::all()) each->plan(scene, plan.engine, plan.effects);
  for (const Body& body : scene.bodies) {
    ++plan.bodies;
    plan.moving += !body.fixed;
    plan.shapes += static_cast<int>(body.shapes.size());
  }
  for (const Joint& joint : scene.joints) plan.rows += joint_rows(joint);
  plan.rows += static_cast<int>(scene.couplings.size());
  for (const Invariant& each : scene.invariants)
    if (each.project) plan.invariants += each.kind == InvariantKind::energy ? 1 : 3;
  plan.unknowns = engine_type(plan.engine).unknowns(scene, plan);
  plan.pairs = contact_pairs(scene);
  return plan;
}

std::ostream& operator<<(std::ostream& out, const Plan& plan) {
  const bool smooth = plan.engine == EngineKind::smooth;
  const bool event = plan.engine == EngineKind::event;
  out << fmt::format("engine    {} ({})\n", word(plan.engine), plan.why);
  out << others(plan);
  out << fmt::format("bodies    {}, {} of them moving; {}\n", plan.bodies, plan.moving,
                     counted(plan.shapes, "shape"));
  if (smooth)
    out << fmt::format("unknowns  {}{}, with {} and {}\n", plan.rows > 0 ? "up to " : "",
                       plan.unknowns, counted(plan.rows, "row") + " of joints",
                       counted(plan.invariants, "invariant") + " kept")
        << "matrices  " << smooth_matrices(plan) << "\n";
  else
    out << fmt::format("unknowns  {}{}{}; {} of bodies can touch\n", plan.unknowns,
                       event ? "" : " velocities",
                       plan.rows > 0 ? ", with " + counted(plan.rows, "row") + " of joints" : "",
                       counted(plan.pairs, "pair"));
  out << "effects   " << (plan.effects.empty() ? "none: bodies move freely\n" : "");
  const char* indent = "";
  for (const Effect& each : plan.effects) {
    out << fmt::format("{}{:<18}{}\n", indent, each.name, each.detail);
    indent = "          ";
  }
  return out;
}

}  // namespace tether::scene

// Tether: options of steps. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "problem/refuse.hpp"
#include "stepping/step_settings.hpp"

namespace tether::contact {
namespace detail {

namespace {

// Enumerators are numbers, of which others can be made.
template <class List, class E>
void demand_one_of(const List& list, const char* option, E value, const char* what) {
  if (std::find(list.begin(), list.end(), value) == list.end())
    refuse(std::string("stepping: ") + option, static_cast<double>(value), what);
}

}  // namespace

void check(const SteppingOptions& o) {
  const auto demand = [](bool holds, const char* option, double value, const char* what) {
    if (!holds) refuse(std::string("stepping: ") + option, value, what);
  };
  demand(o.step > 0 && std::isfinite(o.step), "step", o.step, "must be > 0 and finite");
  demand(o.accuracy >= 0 && o.accuracy <= 0.1, "accuracy", o.accuracy, "must lie in 0 .. 0.1");
  if (o.gravity) require_finite("gravity", *o.gravity, "stepping: ");
  demand(o.tolerance > 0, "tolerance", o.tolerance, "must be > 0");
  demand(o.error_reduction >= 0 && o.error_reduction <= 1, "error_reduction", o.error_reduction,
         "must lie in 0 .. 1");
  demand(o.max_depenetration_speed >= 0, "max_depenetration_speed", o.max_depenetration_speed,
         "must be >= 0");
  demand(o.restitution_threshold >= 0, "restitution_threshold", o.restitution_threshold,
         "must be >= 0");
  demand(o.impact_threshold >= 0, "impact_threshold", o.impact_threshold, "must be >= 0");
  demand(o.acceptance >= 1, "acceptance", o.acceptance, "must be >= 1");
  demand(o.max_halvings >= 0 && o.max_halvings <= 30, "max_halvings", o.max_halvings,
         "must lie in 0 .. 30");
  demand(o.sleep >= 0 && std::isfinite(o.sleep), "sleep", o.sleep, "must be >= 0 and finite");
  demand(o.near_part >= 0, "near_part", o.near_part, "must be >= 0");
  demand_one_of(laws(), "law", o.law, "is none of those of tether::contact::Law");
  demand_one_of(kGyroscopics, "gyroscopic", o.gyroscopic,
                "is none of those of tether::contact::Gyroscopic");
  demand_one_of(kRestitutionLaws, "restitution_law", o.restitution_law,
                "is none of those of tether::contact::RestitutionLaw");
  demand_one_of(kSimultaneousImpacts, "simultaneous_impacts", o.simultaneous_impacts,
                "is none of those of tether::contact::SimultaneousImpacts");
  const auto together = [](bool go, const char* what) {
    if (!go) throw std::invalid_argument(std::string("stepping: ") + what);
  };
  together(!(o.sleep > 0) || (o.gravity && o.gravity->norm() > 0), "sleep needs gravity");
  together(!(o.sleep > 0) || o.accuracy == 0, "sleep does not go with an accuracy");
  together(o.simultaneous_impacts == SimultaneousImpacts::together ||
               (o.cut_at_impacts && o.accuracy == 0),
           "simultaneous_impacts = in_turn needs cut_at_impacts and no accuracy");
}

BodyOptions contact_options(const SteppingOptions& o) {
  BodyOptions b;
  b.law = o.law;
  b.tolerance = o.tolerance;
  b.min_sweeps = o.min_sweeps;
  b.max_sweeps = o.max_sweeps;
  b.max_assembled = o.max_assembled;
  b.max_work = o.max_work;
  if (o.acceptance > 1) {
    b.enough = std::min(accepted_residual(o), std::max(kEnough, o.tolerance));
  }
  b.threads = o.threads;
  b.team = o.team;
  return b;
}

double threshold_speed(double threshold, const SteppingOptions& o) {
  return o.gravity ? threshold * std::sqrt(o.gravity->norm()) : 0;
}

BodyOptions patient_options(const SteppingOptions& o) {
  BodyOptions b = contact_options(o);
  b.max_work = 5 * o.max_work;
  b.enough = std::max(kGood, o.tolerance);
  return b;
}

// A penetration need not vanish in one step, so a rough solution suffices: the next step reduces
// what is left.
BodyOptions correction_options(const SteppingOptions& o) {
  BodyOptions b = contact_options(o);
  b.law = Law::frictionless;
  b.tolerance = 1e-2;
  b.min_sweeps = 0;
  b.max_sweeps = 10;
  b.max_assembled = 0;
  return b;
}

double negligible_depth(const SteppingOptions& o, double dt) {
  return o.gravity ? o.tolerance * o.gravity->norm() * dt * dt : 0;
}

// Closing gaps changes positions only, and the next step corrects an error as a gap or a
// penetration. A few sweeps therefore suffice. Small islands are solved, which is cheap, so that
// the result for a landing stack does not depend on the order of its boxes.
BodyOptions closing_options(const SteppingOptions& o) {
  BodyOptions b = contact_options(o);
  b.min_sweeps = 0;
  b.max_sweeps = std::min(60, o.max_sweeps);
  b.max_assembled = std::min(128, o.max_assembled);
  return b;
}

}  // namespace detail

const char* name(Gyroscopic gyroscopic) {
  return detail::text(gyroscopic, {"none", "explicit", "implicit", "momentum"});
}
const char* name(RestitutionLaw law) { return detail::text(law, {"newton", "poisson"}); }
const char* name(SimultaneousImpacts impacts) {
  return detail::text(impacts, {"together", "in_turn"});
}

double accepted_residual(const SteppingOptions& o) {
  return std::max(o.tolerance, std::min(o.acceptance * o.tolerance, detail::kUseful));
}

}  // namespace tether::contact

// Tether: options of steps. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "stepping/step_settings.hpp"

namespace tether::contact {
namespace detail {

void check(const SteppingOptions& o) {
  const auto demand = [](bool holds, const char* what) {
    if (!holds) throw std::invalid_argument(std::string("stepping: ") + what);
  };
  demand(o.step > 0 && std::isfinite(o.step), "step must be > 0 and finite");
  demand(o.accuracy >= 0 && o.accuracy <= 0.1, "accuracy must lie in 0 .. 0.1");
  demand(!o.gravity || o.gravity->allFinite(), "gravity must be finite");
  demand(o.tolerance > 0, "tolerance must be > 0");
  demand(o.error_reduction >= 0 && o.error_reduction <= 1, "error_reduction must lie in 0 .. 1");
  demand(o.max_depenetration_speed >= 0, "max_depenetration_speed must be >= 0");
  demand(o.restitution_threshold >= 0, "restitution_threshold must be >= 0");
  demand(o.impact_threshold >= 0, "impact_threshold must be >= 0");
  demand(o.acceptance >= 1, "acceptance must be >= 1");
  demand(o.max_halvings >= 0 && o.max_halvings <= 30, "max_halvings must lie in 0 .. 30");
  demand(o.sleep >= 0 && std::isfinite(o.sleep), "sleep must be >= 0 and finite");
  demand(!(o.sleep > 0) || (o.gravity && o.gravity->norm() > 0), "sleep needs gravity");
  demand(!(o.sleep > 0) || o.accuracy == 0, "sleep does not go with an accuracy");
  demand(o.simultaneous_impacts == SimultaneousImpacts::together ||
             (o.cut_at_impacts && o.accuracy == 0),
         "simultaneous_impacts = in_turn needs cut_at_impacts and no accuracy");
  demand(o.near_part >= 0, "near_part must be >= 0");
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
  switch (gyroscopic) {
    case Gyroscopic::none:
      return "none";
    case Gyroscopic::explicit_step:
      return "explicit";
    case Gyroscopic::implicit_step:
      return "implicit";
    case Gyroscopic::momentum:
      return "momentum";
  }
  return "?";
}

const char* name(RestitutionLaw law) {
  return law == RestitutionLaw::newton ? "newton" : "poisson";
}

const char* name(SimultaneousImpacts impacts) {
  return impacts == SimultaneousImpacts::together ? "together" : "in_turn";
}

double accepted_residual(const SteppingOptions& o) {
  return std::max(o.tolerance, std::min(o.acceptance * o.tolerance, detail::kUseful));
}

}  // namespace tether::contact

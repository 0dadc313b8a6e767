// Tether: parts of the scene reader. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <istream>

#include "bounds.hpp"
#include "toml/document.hpp"
#include "toml/form.hpp"

namespace tether::scene::files {

/// The fields of [scene], of a [[body]], of [output]; [[pair]] and the lists of effects;
/// [[expect]].
void scene_fields(const Form& form, Scene& scene);
void body_fields(const Form& form, Body& body);
void output_fields(const Form& form, Output& output);
void list_fields(const Form& root, Scene& scene);
void expect_fields(const Form& root, Scene& scene);
/// The scene of a whole document. Throws SceneError.
Scene read(Value document, const std::string& name);
/// Checks across fields: names, pairs of materials, bodies that cannot move, times.
void check(const Scene& scene, Report& report);

constexpr std::size_t kMostCopied =
    3000000;  // values of TOML in repetitions, some hundred bytes each
constexpr std::size_t kBytesOfValue = 100;  // of texts that count as one value more

/// Replaces each [[body]], [[joint]], [[spring]] and [[load]] that has `repeat` by its copies.
/// Throws SceneError where a repetition is wrong or makes too many.
void repeat_elements(Value& document, const std::string& file);

constexpr int kMostCounted = 2000000000;

inline void each_field(SmoothOptions& o, const Form& io) {
  io.number("tolerance", o.tolerance, {1e-14, 1e-1, "a number from 1e-14 to 0.1"},
            "relative, and absolute in SI");
  io.word("formulation", o.formulation);
  io.flag("projection", o.projection);
  io.number("max_step", o.max_step, kNotNegative, "s; 0: free");
  io.count("max_steps", o.max_steps, 1, kMostCounted);
}

inline void each_field(EventOptions& o, const Form& io) {
  io.number("tolerance", o.tolerance, {1e-13, 1e-1, "a number from 1e-13 to 0.1"},
            "relative, and absolute in SI");
  io.number("max_step", o.max_step, kNotNegative, "s; 0: free");
  io.count("max_events", o.max_events, 1, kMostCounted);
  io.count("max_steps", o.max_steps, 1, kMostCounted);
  io.word("otherwise", o.otherwise);
}

inline void each_field(SteppingOptions& o, const Form& io) {
  constexpr const char* kOfSpeed = "of sqrt(gravity * size)";
  io.number("step", o.step, kPositive, "s");
  io.number("accuracy", o.accuracy, {0, 0.1, "a number from 0 to 0.1"},
            "of the size of each body; 0: none, steps are taken whole");
  io.word("law", o.law);
  io.number("tolerance", o.tolerance, kPositivePart, "relative residual");
  io.word("gyroscopic", o.gyroscopic);
  io.number("error_reduction", o.error_reduction, kPart, "");
  io.number("max_depenetration_speed", o.max_depenetration_speed, kNotNegative, "m/s");
  io.word("restitution_law", o.restitution_law);
  io.number("restitution_threshold", o.restitution_threshold, kNotNegative, kOfSpeed);
  io.number("impact_threshold", o.impact_threshold, kNotNegative, kOfSpeed);
  io.flag("cut_at_impacts", o.cut_at_impacts);
  io.number("sleep", o.sleep, kNotNegative, "of sqrt(gravity * size); 0: none sleeps");
  io.number("acceptance", o.acceptance, {1, 1e12, "a number from 1 to 1e12"}, "of the tolerance");
  io.count("max_halvings", o.max_halvings, 0, 30);
  io.count("max_sweeps", o.max_sweeps, 1, 1000000000);
  io.word("on_failure", o.on_failure);
  io.count("threads", o.threads, 1, 256);
}

}  // namespace tether::scene::files

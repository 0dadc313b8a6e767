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

}  // namespace tether::scene::files

// Tether: parts of the scene reader. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <istream>

#include "bounds.hpp"
#include "toml/document.hpp"
#include "toml/form.hpp"

namespace tether::scene::files {

/// The fields of a [[body]].
void body_fields(const Form& form, Body& body);
/// The scene of a whole document. Throws SceneError.
Scene read(Value document, const std::string& name);

constexpr std::size_t kMostCopied =
    3000000;  // values of TOML in repetitions, some hundred bytes each
constexpr std::size_t kBytesOfValue = 100;  // of texts that count as one value more

/// Replaces each [[body]], [[joint]], [[spring]] and [[load]] that has `repeat` by its copies.
/// Throws SceneError where a repetition is wrong or makes too many.
void repeat_elements(Value& document, const std::string& file);

}  // namespace tether::scene::files

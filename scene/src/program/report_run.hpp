// Tether: prints what a run gave. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/run.hpp>

namespace tether::scene {

// Names of files are those of whoever made the folder: *.toml may hold what a terminal obeys.

/// Lines without what a terminal obeys (files::printable).
std::string on_terminal(std::string_view text);

/// A field of CSV: quoted where it has to be; control characters become blanks.
std::string table_field(std::string_view text);

/// Energies, errors and work.
void print_summary(const Scene& scene, const RunResult& result);
/// Warnings of what the scene begins with that its author may not have meant.
void print_start(const Scene& scene);
/// Times of the engine and of the whole program: `wall` seconds, reading and output included.
void print_times(const RunResult& result, double wall);
/// Each [[expect]] with the value found.
void print_judgements(const Scene& scene, const RunResult& result);
/// Time spent on each effect.
void print_costs(const RunResult& result);
/// Files that were written, and remarks on those that were not.
void print_files(const RunResult& result);
/// kGood, kNotMet or kFailed.
int exit_code(const RunResult& result);

}  // namespace tether::scene

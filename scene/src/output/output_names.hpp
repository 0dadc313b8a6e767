// Tether: what a run writes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/scene/scene.hpp>
#include <vector>

namespace tether::scene {

/// The tables of events and of contacts beside a table of records.
std::string event_file(const std::string& csv);
std::string contact_file(const std::string& csv);
/// The list of frames and the folder of a film.
std::string film_file(const std::string& vtk);
std::string film_folder(const std::string& vtk);

/// The same for all spellings of a path, and for second names of a file; links are followed as far
/// as they exist.
std::string identity(const std::string& file);
/// Something there that is neither a file nor a folder.
bool is_device(const std::string& file);

/// The scene and what was read with it.
std::vector<std::string> inputs_of(const Scene& scene);

/// Throws std::invalid_argument if two outputs have a name in common, or one that of an input.
void check_names(const Output& output, const std::vector<std::string>& inputs);

/// Throws std::invalid_argument if a page is to be written over one of the others, which may be
/// empty.
void check_page_name(const std::string& html, const std::vector<std::string>& others);

/// One name for each requested output; its lock covers all files of that output.
std::vector<std::string> names(const Output& output);
/// Those, the other tables and the folder of frames, whether the run will write them or not.
std::vector<std::string> all_names(const Output& output);

/// check_replaceable() of all of these and of the frames that are there.
void check_replaceable(const Output& output);

}  // namespace tether::scene

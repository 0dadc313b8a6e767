// Tether: the formats in which a run is recorded. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <optional>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>

namespace tether::scene {

/// Start of a run, with a time where it is continued: recorders keep their output up to then and
/// drop later parts.
struct Resume {
  std::optional<double> time;  // s, of the last record that a run in one piece has, too
  std::uint64_t events = 0;    // found until the state was saved
};

class Recorder {
 public:
  virtual ~Recorder() = default;
  virtual void record(const Engine& engine, const Diagnostics& diagnostics) = 0;
  /// With a saved state: what was recorded outlasts a crash, so that a run that goes on from the
  /// state leaves the files of an undisturbed one.
  virtual void keep(const Engine&) {}
  /// The run is over; says which files there are and what went wrong.
  virtual void finish(std::vector<std::string>& written, std::vector<std::string>& remarks) = 0;
};

}  // namespace tether::scene

TETHER_EXPORT_BEGIN

namespace tether::scene::formats {

/// The present of a run whose recorders begin.
struct Beginning {
  const Scene& scene;
  const Plan& plan;
  const Resume& resume;
  const Processes& among;
  double start_energy, now;  // J, s
};

using Recorders = std::vector<std::unique_ptr<Recorder>>;

/// One key of [output] and one option of `tether run`: a name `given`, and the files made of it.
struct Format {
  const char *name, *extension, *help;
  /// May throw std::runtime_error where the file cannot be written. Null: the run itself writes it.
  void (*add_recorders)(const std::string& given, const Beginning&, Recorders&) = nullptr;
  /// Files and folders besides the main one. `forces`: Output::forces.
  std::vector<std::string> (*beside)(const std::string& given, bool forces) = nullptr;
  /// Names of a film, of which each process writes its share: the main file, the ending of a frame
  /// in a folder beside it.
  std::string (*film)(const std::string& given) = nullptr;
  bool (*is_frame)(const std::string& path) = nullptr;

  std::string main_file(const Output& o) const { return film ? film(o[name]) : o[name]; }
  std::vector<std::string> others(const Output& o, bool forces) const {
    return beside && !o[name].empty() ? beside(o[name], forces) : std::vector<std::string>();
  }
};

/// Adds a recorder of this kind.
template <class Kind>
void add_recorder(const std::string& given, const Beginning& run, Recorders& out) {
  out.push_back(std::make_unique<Kind>(given, run));
}

/// Defines <name>_format(), which the list of formats asks for.
#define TETHER_FORMAT(name, ...)                       \
  const Format& name##_format() {                      \
    static const Format format = {#name, __VA_ARGS__}; \
    return format;                                     \
  }

/// Every format, in the order of CMakeLists.txt beside this file.
const std::vector<const Format*>& all();

/// Throws std::invalid_argument if two outputs have a name in common, or one that of an input.
void check_names(const Output& output, const std::vector<std::string>& inputs);
/// One name for each requested output; its lock covers all files of that output.
std::vector<std::string> names(const Output& output);
/// Those and what is beside them, whether the run will write them or not.
std::vector<std::string> all_names(const Output& output);
/// check_replaceable() of all of these and of the frames that are there.
void check_replaceable(const Output& output);

}  // namespace tether::scene::formats

TETHER_EXPORT_END

namespace tether::scene {

/// The number that begins at a place of a line, the same in every locale; NaN: there is none.
inline double number_at(const std::string& line, std::size_t place) {
  double value = std::numeric_limits<double>::quiet_NaN();
  if (place < line.size()) std::from_chars(line.data() + place, line.data() + line.size(), value);
  return value;
}

}  // namespace tether::scene

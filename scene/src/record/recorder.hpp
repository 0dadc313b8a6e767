// Tether: something that records a run. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <tether/scene/run.hpp>
#include <vector>

namespace tether::scene {

/// Start of a continued run: recorders keep their output up to then and drop later parts.
struct Resume {
  bool restarted = false;
  double time = 0;           // s, of the last record that a run in one piece has, too
  std::uint64_t events = 0;  // found until the state was saved
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

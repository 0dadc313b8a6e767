// Tether: runs a scene, records it, and judges it by its expectations. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <tether/export.hpp>
#include <tether/scene/engine.hpp>
#include <tether/scene/scene.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {
class SolverTeam;
}
namespace tether::scene {

/// The outcome of an [[expect]].
enum class Verdict : std::uint8_t {
  open,    ///< the run did not reach its time
  beyond,  ///< its time lies after the end (--end): it does not count
  met,     ///< it holds
  missed   ///< it does not
};

/// Result of an [[expect]]; for one that holds `throughout`, at its worst instant.
struct Judgement {
  Verdict verdict = Verdict::open;  ///< whether it holds
  double time = 0;                  ///< s
  std::vector<double> value;        ///< what was found
  double error = 0;                 ///< largest difference to the value expected, 0 without one
};

/// Over all records.
struct Summary {
  double start_energy = 0, end_energy = 0;          ///< J
  double lowest_change = 0, largest_change = 0;     ///< J, of the energy since the start
  double drift = 0, penetration = 0, residual = 0;  ///< the largest; see Diagnostics
  int contacts = 0;                                 ///< the most
};

/// Which of the processes that make the same run this is. Each writes its piece of a film.
struct Processes {
  int rank = 0, ranks = 1;     ///< number of this one, from 0, and of all
  std::function<void()> meet;  ///< waits until all have called it
};

/// Start, observers and processes of a run.
struct RunOptions {
  std::string restart;  ///< a saved state to go on from; empty: from t = 0
  /// The state may be of another scene or version, and files that Tether did not write are
  /// replaced.
  bool force = false;
  std::function<void(double time)> progress;  ///< called at each record
  std::vector<double> stops;                  ///< further times at which `record` is called, s
  std::function<void(const Engine&)> record;  ///< called at each record and stop
  /// Called after every step; if it returns true, the run ends there, with all its files complete.
  std::function<bool()> interrupted;
  /// Processes that make the same run, of the stepping engine, and share its contact problems; all
  /// but the first without names in Scene::output besides `vtk`, and `interrupted` says the same to
  /// each.
  contact::SolverTeam* team = nullptr;
  Processes among;  ///< with a team
};

/// Outcome of a run.
struct RunResult {
  std::string engine;                        ///< Engine::name()
  double time = 0;                           ///< s, reached
  double seconds = 0;                        ///< processor time of the engine, all threads
  double wall = 0;                           ///< s on the clock, of the engine
  double whole_wall = 0, whole_seconds = 0;  ///< of the whole run, with what it records
  std::string failure;                       ///< why the run could not go on; empty: it could
  bool interrupted = false;                  ///< RunOptions::interrupted ended it
  std::vector<HandOver> hand_overs;  ///< from events to steps, and back; see Engine::hand_overs()
  std::vector<ContactEvent> joint_events;  ///< joints that attach, detach and break
  Counts counts_of_events;                 ///< with hand-overs; `counts` has those of steps then
  Summary summary;                         ///< over all records
  Counts counts;                           ///< of the engine
  std::vector<EffectCost> costs;           ///< of each effect
  std::vector<Judgement> judgements;       ///< one for each Scene::expect
  std::vector<std::string> written;        ///< files
  std::vector<std::string> remarks;        ///< data that the files do not contain
  std::vector<std::string>
      warnings;  ///< why the motion is not to be trusted, or the start was not meant

  long count(Verdict verdict) const;  ///< judgements that are so
  bool met() const;                   ///< every expectation that counts was judged and holds
};

constexpr double kMostSteps = 1e9;    ///< of the stepping engine in a run: end / step
constexpr double kMostRecords = 1e7;  ///< end / every, end / checkpoint

/// Runs the scene to its end and writes what Scene::output names. Throws std::invalid_argument for
/// times out of range, names that collide, files that Tether did not write and a scene that no
/// engine has. Throws std::runtime_error for files, also those that another run writes at the time.
/// A run that cannot go on is a result.
///
/// With its state saved, a run is continued bit by bit: RunOptions::restart leaves the rows, frames
/// and states that a run in one piece would have left.
RunResult run(const Scene& scene, const RunOptions& options = {});

/// The value now of the quantity that is expected; `start_energy`: at t = 0, J.
std::vector<double> measure(const Scene& scene, const Expect& expect, const Engine& engine,
                            double start_energy);

}  // namespace tether::scene
TETHER_EXPORT_END

// Tether: what accuracy costs in time. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <tether/export.hpp>
#include <tether/scene/run.hpp>
#include <tether/scene/scene.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::scene {

/// An engine and what is set of it: the tolerance of [smooth] or [event], or `step` (s) or
/// `accuracy` of [stepping].
enum class CostMethod : std::uint8_t { smooth, events, steps, accuracy };
const char* name(CostMethod method);          ///< its word in tables, such as "events"
const char* setting_name(CostMethod method);  ///< of its setting, such as "tolerance"

/// One setting of a scene.
struct CostRow {
  CostMethod method = CostMethod::smooth;  ///< engine
  double setting = 0;                      ///< its tolerance, step or accuracy
  /// Bound on the error: the largest distance of a body's centre (m) and angle of its orientation
  /// (rad) from the reference, over the times below and all bodies. It includes what the reference
  /// may be off.
  double error = 0;
  double seconds = 0;                 ///< processor time of the engine, the least of several runs
  double drift = 0, penetration = 0;  ///< see Summary
  long steps = 0, contact_problems = 0;  ///< see Counts
  int met = 0;                           ///< expectations
  std::string failure;                   ///< empty: it reached the end
};

/// Settings of a comparison; empty ones have defaults.
struct CostOptions {
  /// Settings of each method. All empty: a range for each method that can run the scene; with
  /// contact: events, where that engine has the scene, steps, and steps with an accuracy.
  std::vector<double> tolerances, steps, accuracies;
  /// Tolerance or step of the reference; default 1e-12 (smooth), 1e-11 (events), the finest step
  /// / 4.
  std::optional<double> reference;
  /// Equal times. With contacts also where the scene's own steps end, and steps where they end
  /// themselves; of more than 50 000 / bodies such times each second, third, ...
  int samples = 400;
  /// Before each part of the work: its name, and how many of all parts are done.
  std::function<void(const std::string& what, int done, int all)> progress;
  /// Asked as `RunOptions::interrupted` is: true ends the comparison with the rows that are done.
  std::function<bool()> interrupted;
};

/// Error and time of each setting.
struct CostTable {
  bool smooth = true;  ///< the plan's engine takes tolerances
  std::string
      no_events;  ///< why the event engine is not compared; empty: it is, or nothing touches
  std::string reference;  ///< what the errors are measured against
  /// Estimated error of the reference: its change from the next looser setting (smooth, events), or
  /// the distance between the limits extrapolated from pairs of steps (stepping).
  double reference_error = 0;
  /// `CostOptions::reference` with which one row alone has the same reference; none: its default.
  std::optional<double> reference_setting;
  bool interrupted = false;   ///< rows are missing
  std::vector<CostRow> rows;  ///< by method, in the order of the settings, loosest first
  /// The cheapest row with an error of at most `wanted`; null: there is none.
  const CostRow* cheapest(double wanted) const;
};

/// Runs the scene at each setting. Throws std::invalid_argument for a scene that no engine has, and
/// std::runtime_error if there is no reference.
CostTable cost(const Scene& scene, const CostOptions& options = {});

/// A page of HTML that needs nothing but a browser: error against time, and for each setting the
/// command that repeats it. `wanted`: an error that is drawn as a line.
std::string cost_page(const Scene& scene, const CostTable& table,
                      std::optional<double> wanted = {});

/// Its picture alone (SVG).
std::string cost_picture(const Scene& scene, const CostTable& table,
                         std::optional<double> wanted = {});

}  // namespace tether::scene
TETHER_EXPORT_END

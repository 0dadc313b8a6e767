// Tether: what accuracy costs in time. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <tether/export.hpp>
#include <tether/scene/run.hpp>
#include <tether/scene/scene.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::scene {

/// One setting of a scene.
struct CostRow {
  double setting = 0;  ///< tolerance (smooth) or time step, s (stepping)
  /// Bound on the error: the largest distance of a body's centre (m) and angle of its orientation
  /// (rad) from the reference, whichever is larger, over `CostOptions::samples` equal times and all
  /// bodies, and what the reference may be off.
  double error = 0;
  double seconds = 0;  ///< processor time of the engine, the least of several runs
  double drift = 0, penetration = 0;
  long steps = 0;
  int met = 0;          ///< expectations
  std::string failure;  ///< empty: it reached the end
};

struct CostOptions {
  std::vector<double> settings;     ///< empty: a range around that of the scene
  std::optional<double> reference;  ///< its tolerance or step; default 1e-12, or the finest / 4
  int samples = 100;
  /// Before each part of the work: its name, and how many of all parts are done.
  std::function<void(const std::string& what, int done, int all)> progress;
};

struct CostTable {
  bool smooth = true;
  std::string reference;  ///< what the errors are measured against
  /// Estimated error of the reference: its change from the next looser setting (smooth), or the
  /// distance between the limits extrapolated from pairs of steps (stepping).
  double reference_error = 0;
  std::vector<CostRow> rows;  ///< in the order of the settings, loosest first
  /// The cheapest row with an error of at most `wanted`; null: there is none.
  const CostRow* cheapest(double wanted) const;
};

/// Runs the scene at each setting. Throws std::invalid_argument for a scene that no engine has, and
/// std::runtime_error if there is no reference.
CostTable cost(const Scene& scene, const CostOptions& options = {});

}  // namespace tether::scene
TETHER_EXPORT_END

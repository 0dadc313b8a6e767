// Tether: a page that plays a run in a browser. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <tether/export.hpp>
#include <tether/scene/engine.hpp>
#include <tether/scene/scene.hpp>

TETHER_EXPORT_BEGIN
namespace tether::scene {

/// Collects the motion of a run, and writes it as one page of HTML that needs nothing but a
/// browser:
///
///     Player player(scene, "run.html");
///     RunOptions options;
///     options.record = [&](const Engine& engine) { player.record(engine); };
///     run(scene, options);
///     player.write();
///
/// At most 2001 frames and 12 MB of poses and contacts are kept; of longer runs every second,
/// fourth, ... record, with the largest errors between them.
class Player {
 public:
  /// The scene must outlive the player. Throws std::invalid_argument if `file` is an output or the
  /// file of the scene, std::runtime_error if it cannot be written or another run writes it now.
  Player(const Scene& scene, const std::string& file);
  ~Player();

  /// Adds a frame at Engine::time().
  void record(const Engine& engine);
  /// Replaces the file, whole or not at all. Throws std::runtime_error.
  void write();

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tether::scene
TETHER_EXPORT_END

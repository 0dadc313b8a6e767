// Tether: what a scene asks for, and which engine moves it. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <iosfwd>
#include <memory>
#include <string>
#include <tether/export.hpp>
#include <tether/scene/engine.hpp>
#include <tether/scene/scene.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::scene {

/// An effect that the scene names.
struct Effect {
  std::string name;    ///< e.g. "gravity"
  std::string detail;  ///< e.g. "[0, 0, -9.81] m/s^2"
};

/// Exactly what the scene names is on. Sizes that do not apply are zero.
struct Plan {
  EngineKind engine = EngineKind::smooth;  ///< that moves the scene
  std::string why;                         ///< the reason for this engine
  std::string no_event;                    ///< why the event engine cannot move it; empty: it can
  double then_steps = 0;        ///< s; > 0: of the steps that take over where events cannot go on
  std::vector<Effect> effects;  ///< all that act

  int bodies = 0, moving = 0, shapes = 0;  ///< bodies, those that are not fixed, shapes of all
  int rows = 0;                            ///< constraints of joints on positions
  int unknowns = 0;    ///< smooth: of IDA, at most (rows that others imply are left out there);
                       ///< stepping: velocities; event: coordinates, velocities and work
  int invariants = 0;  ///< rows that the projection keeps beside those of the joints
  long pairs = 0;      ///< of bodies whose materials meet
};

/// Chooses the engine and lists what acts. Throws std::invalid_argument, naming what no engine has.
Plan make_plan(const Scene& scene);
/// Writes the text of `tether plan`.
std::ostream& operator<<(std::ostream& out, const Plan& plan);

/// The engine that the plan names. Throws std::invalid_argument.
std::unique_ptr<Engine> make_engine(const Scene& scene);
/// The same, by the plan of the scene.
std::unique_ptr<Engine> make_engine(const Scene& scene, const Plan& plan);

/// Bodies that begin inside each other by more than a hundredth of the smaller one's size, the
/// deepest first, one line each.
std::vector<std::string> overlaps_at_start(const Scene& scene);
/// Names of bodies with shapes that no other body can touch, though the scene has contacts.
std::vector<std::string> bodies_out_of_touch(const Scene& scene);
/// Says what contacts that touch do in impacts of others, in words of the plan.
std::string simultaneous_impacts_text(const Scene& scene);

/// Rows of a joint on positions and orientations.
int joint_rows(const Joint& joint);

}  // namespace tether::scene
TETHER_EXPORT_END

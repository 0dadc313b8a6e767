// Tether: the file of a saved state. SPDX-License-Identifier: BSD-3-Clause
//
//   tether state 5 <version of Tether>\n
//   scene, u64       hash of all that moves it
//   length, u64      of the content
//   content
//   check, u32       CRC-32 of all bytes before
//
// Numbers in the order of bytes of the machine: a state is for going on, not for exchange.
#pragma once

#include <tether/scene/plan.hpp>

namespace tether::scene {

/// Hash of bodies, effects and options; not of the scene's name, end, output and expectations, nor
/// of what only says when to give up.
std::uint64_t hash_of_motion(const Scene& scene, const Plan& plan);

/// Whole, and lasting after a loss of power. Throws std::runtime_error.
void write_state(const std::string& file, std::uint64_t scene, const std::string& content);

struct SavedState {
  std::string content;
  Engine::Restore how;  ///< exact: of the same scene and version
};

/// Throws std::runtime_error, naming the fault, on anything that write_state did not write, and on
/// a state of another scene or version unless `any_scene`; Interrupted where the file is a pipe and
/// `interrupted` says so before its writer has ended.
SavedState read_state(const std::string& file, std::uint64_t scene, bool any_scene,
                      const std::function<bool()>& interrupted = {});

}  // namespace tether::scene

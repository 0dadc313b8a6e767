// Fuzz target of the scene reader. SPDX-License-Identifier: BSD-3-Clause
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>

#include "driver.hpp"

// Whatever comes in: a scene that reads the same when written, or an error with a place.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tether::scene;
  try {
    const Scene scene =
        parse_scene(std::string_view(reinterpret_cast<const char*>(data), size), "fuzz.toml");
    try {
      make_plan(scene);
    } catch (const std::invalid_argument&) {
    }
    const std::string once = write_scene(scene);
    if (write_scene(parse_scene(once, "again.toml")) != once) std::abort();
  } catch (const SceneError& e) {
    for (const Problem& problem : e.problems())
      if (problem.place.line < 1 || problem.place.file != "fuzz.toml") std::abort();
  }
  return 0;
}

std::vector<std::string> own_corpus() { return {}; }

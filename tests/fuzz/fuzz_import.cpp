// Fuzz target of the importer of robots. SPDX-License-Identifier: BSD-3-Clause
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <tether/scene/plan.hpp>

#include "driver.hpp"
#include "import/import.hpp"

// Whatever comes in: a scene that some engine has, or an error with a place in the file.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tether::scene;
  import::ImportOptions options;
  options.mend = size % 2 == 0;
  options.base = size % 3 == 0 ? import::Base::free : import::Base::as_file;
  if (size % 5 == 0) options.ground = 0;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try {
    const import::Imported made = import::import_robot(text, "fuzz.xml", options);
    make_plan(parse_scene(made.toml, "made.toml"));
  } catch (const SceneError& e) {
    for (const Problem& problem : e.problems())
      if (problem.place.line < 1 || problem.place.file != "fuzz.xml") std::abort();
  }
  return 0;
}

std::vector<std::string> own_corpus() { return {}; }

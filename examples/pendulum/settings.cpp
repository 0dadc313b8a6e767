// Tether: command line of the main job. SPDX-License-Identifier: BSD-3-Clause
#include "settings.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <functional>

namespace pendulum {

std::optional<int> parse(int argc, char** argv, Settings& settings) {
  CLI::App app(
      "A pendulum on its constraints: what accuracy costs in time, with and without projection");
  const CLI::Option* given = app.add_option("--tolerances", settings.tolerances,
                                            "Tolerances (rtol = atol) between 1e-12 and 0.1; "
                                            "default 1e-3 to 1e-10, in long runs 1e-4 to 1e-8")
                                 ->type_name("NUMBER");
  const CLI::Option* long_given =
      app.add_flag("--long,!--no-long", settings.long_runs, "Runs of 1000 s as well; the default");
  app.add_flag("--quick", settings.quick,
               "Takes a second: 1e-4, 1e-6 and 1e-8, timed once, no long runs");
  app.add_option("--output", settings.output, "Folder of the CSV and SVG files; default: output");
  try {
    app.parse(argc, argv);
    for (const double tolerance : settings.tolerances)
      if (!(tolerance >= 1e-12 && tolerance <= 0.1))
        throw CLI::ValidationError("--tolerances",
                                   fmt::format("{:g} is not between 1e-12 and 0.1", tolerance));
  } catch (const CLI::ParseError& e) {
    return app.exit(e);
  }

  if (settings.quick && given->empty()) settings.tolerances = {1e-4, 1e-6, 1e-8};
  if (settings.quick && long_given->empty()) settings.long_runs = false;
  if (!given->empty()) settings.long_tolerances = settings.tolerances;
  for (std::vector<double>* list : {&settings.tolerances, &settings.long_tolerances}) {
    std::sort(list->begin(), list->end(), std::greater<>());
    list->erase(std::unique(list->begin(), list->end()), list->end());
  }
  return std::nullopt;
}

}  // namespace pendulum

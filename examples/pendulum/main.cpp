// Tether: the main job, what accuracy on the constraints costs in time.
// SPDX-License-Identifier: BSD-3-Clause
//
// The experiment of Hanson and Krogh: a pendulum in Cartesian coordinates, with its differential
// equations reduced to index 1 and to index 0, kept on its constraints by projection or not.
#include <fmt/core.h>

#include <cstdio>
#include <exception>
#include <filesystem>
#include <vector>

#include "compare.hpp"
#include "csv.hpp"
#include "experiment.hpp"
#include "figures.hpp"
#include "measure.hpp"
#include "progress.hpp"
#include "settings.hpp"
#include "table.hpp"

namespace {

void run(const pendulum::Settings& settings) {
  std::filesystem::create_directories(settings.output);
  const std::vector<pendulum::Experiment> experiments = pendulum::plan(settings);
  tether::Progress progress(pendulum::expected_work(experiments));

  pendulum::print_explanation();
  std::vector<pendulum::Results> all;
  for (const pendulum::Experiment& experiment : experiments) {
    pendulum::Results results = pendulum::measure(experiment, progress);
    pendulum::compare_with_plain(results);
    progress.hide();
    pendulum::print_runs(results);
    all.push_back(std::move(results));
  }

  pendulum::print_costs(all);

  pendulum::Files files = pendulum::write_csv(settings.output, all);
  pendulum::draw(settings.output, all, files);
  pendulum::print_names(files);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    pendulum::Settings settings;
    if (const auto exit_code = pendulum::parse(argc, argv, settings)) return *exit_code;
    run(settings);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "pendulum: {}\n", e.what());
    return 1;
  }
}

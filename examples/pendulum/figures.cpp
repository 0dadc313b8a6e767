// Tether: pictures of the main job, by gnuplot over its CSV files.
// SPDX-License-Identifier: BSD-3-Clause
#include "figures.hpp"

#include <fmt/core.h>
#include <spawn.h>
#include <sys/wait.h>

#include <string>
#include <vector>

extern char** environ;

namespace pendulum {

namespace {

/// Runs gnuplot -c script arguments...; true if it ended well.
bool gnuplot(const std::string& script, const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {"gnuplot", "-c", PENDULUM_FIGURE_SCRIPTS "/" + script};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  pid_t child;
  if (posix_spawnp(&child, "gnuplot", nullptr, nullptr, argv.data(), environ) != 0) return false;
  int status = 0;
  return waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

/// The longest watch of the pendulum on earth.
const Experiment& longest(const std::vector<Results>& all) {
  const Experiment* best = &all.front().experiment;
  for (const Results& results : all)
    if (results.experiment.pendulum == best->pendulum) best = &results.experiment;
  return *best;
}

std::string text(double x) { return fmt::format("{:g}", x); }

}  // namespace

void draw(const std::filesystem::path& folder, const std::vector<Results>& all, Files& files) {
  const std::string runs = files[0].string(), drift = files[1].string();
  const std::string error_svg = (folder / "pendulum_error.svg").string();
  const std::string drift_svg = (folder / "pendulum_drift.svg").string();
  const Experiment& first = all.front().experiment;
  const Experiment& drifting = longest(all);
  const Experiment& other = &drifting == &first ? all.back().experiment : drifting;

  if (gnuplot("error.gp", {runs, error_svg, first.pendulum, text(first.duration), other.pendulum,
                           text(other.duration)}) &&
      gnuplot("drift.gp", {drift, drift_svg, drifting.pendulum, text(drifting.duration),
                           text(drifting.drift_tolerance)})) {
    files.push_back(error_svg);
    files.push_back(drift_svg);
  } else {
    fmt::print(stderr,
               "pendulum: gnuplot is missing or failed, so there are no pictures; the CSV files "
               "are complete\n");
  }
}

}  // namespace pendulum

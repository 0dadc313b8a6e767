// Tether: what the main job runs. SPDX-License-Identifier: BSD-3-Clause
#include "experiment.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

namespace pendulum {

namespace {

constexpr double kShownDrift = 1e-6;  // whose drift over time is drawn, or the nearest to it
constexpr double kLong = 500.0;       // s
const std::vector<double> kBeyond = {1e-9, 1e-10, 1e-11, 1e-12, 1e-13};  // plain IDA only

double nearest(const std::vector<double>& tolerances, double wanted) {
  return *std::min_element(tolerances.begin(), tolerances.end(), [=](double a, double b) {
    return std::abs(std::log(a / wanted)) < std::abs(std::log(b / wanted));
  });
}

std::vector<Case> all_cases(const std::vector<double>& tolerances, double tightest_plain) {
  std::vector<Case> cases;
  for (const std::string& form : forms())
    for (const Invariants set :
         {Invariants::none, Invariants::without_energy, Invariants::with_energy}) {
      for (const double tolerance : tolerances) cases.push_back({form, set, tolerance});
      if (set != Invariants::none) continue;
      for (const double tolerance : kBeyond)
        if (tolerance < tolerances.back() && tolerance >= tightest_plain)
          cases.push_back({form, set, tolerance});
    }
  return cases;
}

}  // namespace

const std::vector<std::string>& forms() {
  static const std::vector<std::string> names = {"index 1", "index 0"};
  return names;
}

std::vector<std::string> Case::rows() const {
  std::vector<std::string> names;
  if (plain()) return names;
  names = {"position", "velocity"};
  if (form == "index 0") names.push_back("acceleration");
  if (invariants == Invariants::with_energy) names.push_back("energy");
  return names;
}

std::string Case::constraints(const char* separator) const {
  std::vector<std::string> names = rows();
  std::replace(names.begin(), names.end(), std::string("position"), std::string("length"));
  std::replace(names.begin(), names.end(), std::string("acceleration"), std::string("tension"));
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, separator));
}

std::vector<Experiment> plan(const Settings& settings) {
  const auto experiment = [&](const char* pendulum, double L, double g, double duration,
                              int repeats) {
    Experiment e;
    e.pendulum = pendulum;
    e.length = L;
    e.gravity = g;
    e.duration = duration;
    e.repeats = settings.quick ? 1 : repeats;
    const bool is_long = duration > kLong;
    const auto& tolerances = is_long ? settings.long_tolerances : settings.tolerances;
    e.drift_tolerance = nearest(tolerances, kShownDrift);
    e.cases = all_cases(tolerances, is_long ? 1e-12 : 1e-13);
    return e;
  };
  std::vector<Experiment> experiments = {experiment("earth", 1.1, 9.80665, 10.0, 9),
                                         experiment("unit", 1.0, 1.0, 100.0, 7)};
  if (settings.long_runs) {
    experiments.push_back(experiment("earth", 1.1, 9.80665, 1000.0, 1));
    experiments.push_back(experiment("unit", 1.0, 1.0, 1000.0, 2));
  }
  return experiments;
}

double expected_work(const Experiment& experiment, const Case& what) {
  return experiment.duration * std::sqrt(experiment.gravity / experiment.length) *
         std::pow(what.tolerance, -1.0 / 6.0);
}

double expected_work(const std::vector<Experiment>& experiments) {
  double work = 0.0;
  for (const Experiment& experiment : experiments)
    for (const Case& what : experiment.cases)
      work += (1 + experiment.repeats) * expected_work(experiment, what);
  return work;
}

}  // namespace pendulum

// Tether: the hard cases as one runnable list. SPDX-License-Identifier: BSD-3-Clause
//
//   hard_cases [page.md]
//
// Exit code 1 when one of ours is wrong or fails without being expected to.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <problems/akzo_nobel.hpp>
#include <problems/andrews.hpp>
#include <problems/car_axis.hpp>
#include <problems/kepler.hpp>
#include <problems/lotka_volterra.hpp>
#include <problems/pendulum.hpp>
#include <problems/pinned_rods.hpp>
#include <problems/rigid_body.hpp>
#include <problems/robertson.hpp>
#include <problems/slider_crank.hpp>
#include <problems/slider_crank_equal.hpp>
#include <problems/transistor_amplifier.hpp>

#include "accuracy/page.hpp"
#include "hard_case.hpp"
#include "projection/run.hpp"

using namespace tether::hard_cases;
using namespace tether::problems;
using tether::bench::integrate;
using tether::bench::Run;
using tether::bench::Settings;

namespace {

std::string describe(const Run& run) {
  if (run.failed) return "fails: " + run.message;
  return fmt::format("error {:.1e}, {} steps", run.error, run.steps);
}

// IDA's better setting of its error test counts as what plain IDA does.
Run plain(const Problem& problem, double tolerance) {
  Settings settings;
  settings.limits = {1000000, 3.0};
  const Run tested = integrate(problem, tolerance, settings);
  if (std::count(problem.id.begin(), problem.id.end(), 0.0) == 0) return tested;
  settings.suppress = true;
  const Run suppressed = integrate(problem, tolerance, settings);
  if (suppressed.failed || !(suppressed.error == suppressed.error)) return tested;
  return tested.failed || !(tested.error < suppressed.error) ? suppressed : tested;
}

HardCase motion(const std::string& name, const std::string& regime, const std::string& oracle,
                const Problem& problem, double allowed) {
  return {name + ", " + problem.form, regime, oracle, [=] {
            const double tolerance = 1e-8;
            Settings settings;
            settings.limits = {1000000, 10.0};
            settings.constraints = problem.recommended_constraints();
            settings.options.print_fatal = false;
            const Run ours = integrate(problem, tolerance, settings);
            return Outcome{describe(plain(problem, tolerance)), describe(ours),
                           !ours.failed && ours.error <= allowed};
          }};
}

std::vector<HardCase> motions() {
  const double g = 9.81, third_turn = 2.09439510239319549231;
  return {
      motion("A01 pendulum, t = 100", "phase error adds up", "elliptic functions",
             pendulum(1, g, 100, "index 1"), 1e-5),
      motion("A01 pendulum, t = 1000", "422 swings", "elliptic functions",
             pendulum(1, g, 1000, "index 0"), 1e-4),
      motion("A02 four-bar, N = 2, t = 10", "rank drops twice a turn", "one angle, long double",
             n_four_bar(2, 10, "index 1"), 1e-4),
      motion("A02 four-bar, N = 10, t = 2", "rank drops by 10", "one angle, long double",
             n_four_bar(10, 2, "index 0"), 1e-4),
      motion("A03 Andrews", "large accelerations", "quadruple precision", andrews("index 1"), 1e-6),
      motion("slider crank, equal lengths", "dead points: rank 2 to 1, two branches",
             "one angle, long double", slider_crank_equal(kSliderCrankSlow, 10, "index 1"), 1e-3),
      motion("slider crank, equal lengths, swinging", "turns back after a dead point",
             "one angle, long double", slider_crank_equal(kSliderCrankSwing, 10, "index 1"), 1e-3),
      motion("parallelogram", "one row redundant throughout", "one angle, long double",
             parallelogram(third_turn / 2, 0, 10, "index 1"), 1e-4),
      motion("parallelogram, turning", "two rows redundant when flat", "one angle, long double",
             parallelogram(0, 8, 10, "index 1"), 1e-4),
      motion("car axis", "moving constraints, stiff map to the multipliers",
             "GAMD in quadruple precision", car_axis("index 1 w"), 1e-4),
      motion("flexible slider crank", "undamped fast modes", "BIMD, MEBDFI at 1e-11",
             slider_crank("index 1"), 1e-6),
      motion("five-link chain, t = 2", "chaotic", "absolute angles, long double",
             five_link_chain(2, "index 1"), 1e-4),
      motion("ten-link chain, t = 0.5", "chaotic, many links", "absolute angles, long double",
             ten_link_chain(0.5, "index 1"), 1e-4),
      motion("Dzhanibekov, t = 100", "leaves an unstable axis", "elliptic functions",
             rigid_body("dzhanibekov", 100), 1e-4),
      motion("Kepler, e = 0.6, t = 100", "four invariants of rank three", "Kepler's equation",
             kepler(0.6, 100), 1e-4),
      motion("Kepler, e = 0.9, t = 100", "steps change 100-fold", "Kepler's equation",
             kepler(0.9, 100), 1e-4),
      motion("Lotka-Volterra, t = 100", "invariant that is no polynomial", "long double",
             lotka_volterra(2, 0.5, 100), 1e-5),
      motion("Robertson, t = 4e5", "stiff", "published digits", robertson(4e5), 1e-6),
      motion("transistor amplifier", "singular mass matrix, rows are equations of F", "PSIDE 1e-14",
             transistor_amplifier(), 1e-6),
      motion("Akzo Nobel", "equilibrium as an equation", "PSIDE 1e-14", akzo_nobel(), 1e-6),
  };
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<HardCase> all = motions();
  for (HardCase& refusal : refusals()) all.push_back(std::move(refusal));
  tether::bench::Table table;
  table.head = {"case", "regime", "oracle", "plain IDA", "Tether", "verdict"};
  int wrong = 0;
  for (const HardCase& each : all) {
    const Outcome outcome = each.run();
    if (!outcome.right) ++wrong;
    table.rows.push_back({each.name, each.regime, each.oracle, outcome.plain, outcome.ours,
                          outcome.right ? "right" : "WRONG"});
  }
  tether::bench::Table shown{{"case", "plain IDA", "Tether", "verdict"}, {}};
  for (const auto& row : table.rows)
    shown.rows.push_back({row[0], row[3].substr(0, 40), row[4].substr(0, 60), row[5]});
  fmt::print("{}{} of {} right\n", shown.text(), all.size() - static_cast<std::size_t>(wrong),
             all.size());
  if (argc > 1) {
    std::string page =
        "# Hard cases\n\nGenerated by tests/hard_cases. Tolerance 1e-8 (relative and absolute), "
        "default "
        "options, recommended rows; plain IDA in its better setting of the error test. Error: "
        "largest "
        "|y - reference| / (1 + |reference|).\n\n";
    const auto line = [&](const std::vector<std::string>& row) {
      page += "|";
      for (std::string cell : row) {
        std::replace(cell.begin(), cell.end(), '|', '/');
        std::replace(cell.begin(), cell.end(), '\n', ' ');
        page += " " + cell + " |";
      }
      page += "\n";
    };
    line(table.head);
    page += "|---|---|---|---|---|---|\n";
    for (const auto& row : table.rows) line(row);
    try {
      tether::bench::write_file(argv[1], page);
    } catch (const std::exception& error) {
      fmt::print(stderr, "hard_cases: {}\n", error.what());
      return 2;
    }
  }
  return wrong == 0 ? 0 : 1;
}

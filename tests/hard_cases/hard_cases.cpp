// Tether: the hard cases as one runnable list. SPDX-License-Identifier: BSD-3-Clause
//
//   hard_cases [page.md] [--html F] [--peers]
//
// Exit code 1 when one of ours is wrong or fails without being expected to. Plain IDA runs for a
// page.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <problems/akzo_nobel.hpp>
#include <problems/andrews.hpp>
#include <problems/bricard.hpp>
#include <problems/car_axis.hpp>
#include <problems/governor.hpp>
#include <problems/kepler.hpp>
#include <problems/link_chain.hpp>
#include <problems/lotka_volterra.hpp>
#include <problems/pendulum.hpp>
#include <problems/pinned_rods.hpp>
#include <problems/rigid_body.hpp>
#include <problems/robertson.hpp>
#include <problems/slider_crank.hpp>
#include <problems/slider_crank_equal.hpp>
#include <problems/transistor_amplifier.hpp>

#include "accuracy/measure.hpp"
#include "accuracy/page.hpp"
#include "hard_case.hpp"
#include "projection/run.hpp"

using namespace tether::hard_cases;
using namespace tether::problems;
using tether::bench::Codes;
using tether::bench::integrate;
using tether::bench::Run;
using tether::bench::Settings;
using tether::bench::Table;
using tether::bench::write_file;

namespace {

std::string describe(const Run& run) {
  if (run.failed) return "fails: " + run.message;
  return fmt::format("error {:.1e}, {} steps", run.error, run.steps);
}

bool better(const Run& a, const Run& b) {
  if (a.failed != b.failed) return b.failed;
  return a.error < b.error || !(b.error == b.error);
}

// IDA's better setting of its error test counts as what plain IDA does.
Run plain(const Problem& problem, double tolerance) {
  Settings settings;
  settings.limits = {1000000, 3.0};
  const Run tested = integrate(problem, tolerance, settings);
  if (std::count(problem.id.begin(), problem.id.end(), 0.0) == 0) return tested;
  settings.suppress = true;
  const Run suppressed = integrate(problem, tolerance, settings);
  return better(suppressed, tested) ? suppressed : tested;
}

// Others run when they are asked for.
bool with_plain = false, with_peers = false;

const Codes& peer_codes() {
  static const Codes codes = [] {
    Codes found;
    for (auto& code : tether::bench::all_codes())
      if (tether::bench::is_peer(code->name())) found.push_back(std::move(code));
    return found;
  }();
  return codes;
}

std::vector<std::string> peer_names() {
  std::vector<std::string> names;
  for (const auto& code : peer_codes()) {
    const std::string base = tether::bench::base_name(code->name());
    if (std::find(names.begin(), names.end(), base) == names.end()) names.push_back(base);
  }
  return names;
}

// Each peer by its best variant on its best form: the smallest end error.
std::vector<std::string> peers(const std::vector<Problem>& forms, double tolerance) {
  std::vector<std::string> texts;
  if (!with_peers) return texts;
  for (const std::string& name : peer_names()) {
    Run best;
    best.failed = true;
    std::string form, refusal;
    for (const auto& code : peer_codes()) {
      if (tether::bench::base_name(code->name()) != name) continue;
      for (const Problem& problem : forms) {
        const std::string why =
            code->missing().empty() ? code->refuses(problem) : std::string("not installed");
        if (!why.empty()) {
          if (refusal.empty()) refusal = why;
          continue;
        }
        const Run run = code->run(problem, tolerance, {300000, 1.0}, {});
        if (form.empty() || better(run, best)) best = run, form = problem.form;
      }
    }
    texts.push_back(form.empty() ? "none: " + refusal : describe(best) + " (" + form + ")");
  }
  return texts;
}

// Ours takes the first form, with defaults and the recommended rows.
HardCase motion(const std::string& name, const std::string& regime, const std::string& oracle,
                const std::vector<Problem>& forms, double allowed, double tolerance = 1e-8) {
  return {name + ", " + forms.front().form, regime, oracle, [=] {
            const Problem& problem = forms.front();
            Settings settings;
            settings.limits = {1000000, 10.0};
            settings.constraints = problem.recommended_constraints();
            settings.options.print = false;
            settings.give_id = !problem.sparse.starts.empty();
            const Run ours = integrate(problem, tolerance, settings);
            return Outcome{with_plain ? describe(plain(problem, tolerance)) : "not run",
                           describe(ours), peers(forms, tolerance),
                           !ours.failed && ours.error <= allowed};
          }};
}

// The form that ours takes, then the others.
template <class Make>
std::vector<Problem> forms(const std::string& first, std::vector<std::string> names, Make make) {
  std::vector<Problem> all = {make(first)};
  for (const std::string& name : names)
    if (name != first) all.push_back(make(name));
  return all;
}

std::vector<HardCase> motions() {
  const double g = 9.81, third_turn = 2.09439510239319549231;
  return {
      motion(
          "A01 pendulum, t = 100", "phase error adds up", "elliptic functions",
          forms("index 1", pendulum_forms(), [=](auto& form) { return pendulum(1, g, 100, form); }),
          1e-5),
      motion("A01 pendulum, t = 1000", "422 swings", "elliptic functions",
             forms("index 0", {"index 1", "GGL"},
                   [=](auto& form) { return pendulum(1, g, 1000, form); }),
             1e-4),
      motion(
          "A02 four-bar, N = 2, t = 10", "rank drops twice a turn", "one angle, long double",
          forms("index 1", pinned_rods_forms(), [](auto& form) { return n_four_bar(2, 10, form); }),
          1e-4, 1e-7),
      motion(
          "A02 four-bar, N = 10, t = 2", "rank drops by 10", "one angle, long double",
          forms("index 0", pinned_rods_forms(), [](auto& form) { return n_four_bar(10, 2, form); }),
          1e-4),
      motion("A03 Andrews", "large accelerations", "quadruple precision",
             forms("index 1", andrews_forms(), [](auto& form) { return andrews(form); }), 1e-6),
      motion("A04 Bricard, t = 5", "one row redundant throughout, but off the set only nearly",
             "quadrature of one angle",
             forms("index 1", bricard_forms(), [](auto& form) { return bricard(5, form); }), 1e-6),
      motion("A05 governor, t = 1", "stiff dampers, energy not kept", "two freedoms, long double",
             forms("index 1", governor_forms(), [](auto& form) { return governor(1, form); }),
             1e-6),
      motion("falling chain of 100 links, t = 0.5", "sparse factors, 401 rows",
             "block-tridiagonal forces, long double", {link_chain(100, 0.5)}, 1e-5, 1e-7),
      motion("slider crank, equal lengths", "dead points: rank 2 to 1, two branches",
             "one angle, long double",
             forms("index 1", slider_crank_equal_forms(),
                   [](auto& form) { return slider_crank_equal(kSliderCrankSlow, 10, form); }),
             1e-3),
      motion("slider crank, equal lengths, swinging", "turns back after a dead point",
             "one angle, long double",
             forms("index 1", slider_crank_equal_forms(),
                   [](auto& form) { return slider_crank_equal(kSliderCrankSwing, 10, form); }),
             1e-3),
      motion("parallelogram", "one row redundant throughout", "one angle, long double",
             forms("index 1", pinned_rods_forms(),
                   [=](auto& form) { return parallelogram(third_turn / 2, 0, 10, form); }),
             1e-4),
      motion("parallelogram, turning", "two rows redundant when flat", "one angle, long double",
             forms("index 1", pinned_rods_forms(),
                   [](auto& form) { return parallelogram(0, 8, 10, form); }),
             1e-4),
      motion("car axis", "moving constraints, stiff map to the multipliers",
             "GAMD in quadruple precision",
             forms("index 1 w", car_axis_forms(), [](auto& form) { return car_axis(form); }), 1e-4),
      motion("flexible slider crank", "undamped fast modes", "BIMD, MEBDFI at 1e-11",
             forms("index 1", slider_crank_forms(), [](auto& form) { return slider_crank(form); }),
             1e-6),
      motion("five-link chain, t = 2", "chaotic", "absolute angles, long double",
             forms("index 1", pinned_rods_forms(),
                   [](auto& form) { return five_link_chain(2, form); }),
             1e-4),
      motion("ten-link chain, t = 0.5", "chaotic, many links", "absolute angles, long double",
             forms("index 1", pinned_rods_forms(),
                   [](auto& form) { return ten_link_chain(0.5, form); }),
             1e-4),
      motion("Dzhanibekov, t = 100", "leaves an unstable axis", "elliptic functions",
             {rigid_body("dzhanibekov", 100)}, 1e-4),
      motion("Kepler, e = 0.6, t = 100", "four invariants of rank three", "Kepler's equation",
             {kepler(0.6, 100)}, 1e-4),
      motion("Kepler, e = 0.9, t = 100", "steps change 100-fold", "Kepler's equation",
             {kepler(0.9, 100)}, 1e-4),
      motion("Lotka-Volterra, t = 100", "invariant that is no polynomial", "long double",
             {lotka_volterra(2, 0.5, 100)}, 1e-5),
      motion("Robertson, t = 4e5", "stiff", "published digits",
             forms("index 1", robertson_forms(), [](auto& form) { return robertson(4e5, form); }),
             1e-6),
      motion("transistor amplifier, 1e-6", "singular mass matrix, rows are equations of F",
             "PSIDE 1e-14", {transistor_amplifier()}, 1e-4, 1e-6),
      motion("transistor amplifier, 1e-7", "the same", "PSIDE 1e-14", {transistor_amplifier()},
             1e-5, 1e-7),
      motion("transistor amplifier, 1e-8", "the same", "PSIDE 1e-14", {transistor_amplifier()},
             1e-6),
      motion("Akzo Nobel", "equilibrium as an equation", "PSIDE 1e-14", {akzo_nobel()}, 1e-6),
  };
}

std::string page(const Table& table) {
  std::string text =
      "# Hard cases\n\nGenerated by tests/hard_cases. Tolerance 1e-8 (relative and absolute) "
      "unless "
      "the name says another, default options, recommended rows; plain IDA in its better setting "
      "of "
      "the error test, each peer on its best form. Error: largest |y - reference| / (1 + "
      "|reference|).\n\n";
  const auto line = [&](const std::vector<std::string>& row) {
    text += "|";
    for (std::string cell : row) {
      std::replace(cell.begin(), cell.end(), '|', '/');
      std::replace(cell.begin(), cell.end(), '\n', ' ');
      text += " " + cell + " |";
    }
    text += "\n";
  };
  line(table.head);
  line(std::vector<std::string>(table.head.size(), "---"));
  for (const auto& row : table.rows) line(row);
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  std::string page_file, html_file;
  CLI::App app("Hard cases: what is right, what plain IDA and the peers do, and what we do");
  app.add_option("page", page_file, "Markdown page");
  app.add_option("--html", html_file, "The same as a piece of a page");
  app.add_flag("--peers", with_peers, "Run the peers that are installed, too");
  CLI11_PARSE(app, argc, argv);
  with_plain = !page_file.empty() || !html_file.empty();

  std::vector<HardCase> all = motions();
  for (HardCase& refusal : refusals()) all.push_back(std::move(refusal));
  Table table;
  table.head = {"case", "regime", "oracle", "plain IDA", "Tether", "verdict"};
  if (with_peers)
    for (const std::string& name : peer_names()) table.head.push_back(name);
  int wrong = 0;
  for (const HardCase& each : all) {
    Outcome outcome = each.run();
    if (!outcome.right) ++wrong;
    table.rows.push_back({each.name, each.regime, each.oracle, outcome.plain, outcome.ours,
                          outcome.right ? "right" : "WRONG"});
    outcome.peers.resize(table.head.size() - table.rows.back().size(), "takes no rows");
    for (const std::string& text : outcome.peers) table.rows.back().push_back(text);
  }
  Table shown{{"case", "plain IDA", "Tether", "verdict"}, {}};
  for (const auto& row : table.rows)
    shown.rows.push_back({row[0], row[3].substr(0, 40), row[4].substr(0, 60), row[5]});
  fmt::print("{}{} of {} right\n", shown.text(), all.size() - static_cast<std::size_t>(wrong),
             all.size());
  try {
    if (!page_file.empty()) write_file(page_file, page(table));
    if (!html_file.empty()) write_file(html_file, "<h2>Hard cases</h2>\n" + table.html());
  } catch (const std::exception& error) {
    fmt::print(stderr, "hard_cases: {}\n", error.what());
    return 2;
  }
  return wrong == 0 ? 0 : 1;
}

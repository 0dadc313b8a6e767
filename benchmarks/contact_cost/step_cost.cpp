// Tether: error against time of the stepping scheme. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "accuracy/page.hpp"
#include "report.hpp"

#ifdef TETHER_SCENE_COST
#include <tether/scene/cost.hpp>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#endif

namespace tether::bench {

#ifndef TETHER_SCENE_COST

Report step_cost(const std::vector<std::string>& scenes) {
  Report report;
  if (!scenes.empty()) report.text = "scenes left out: built without the scene library\n";
  return report;
}

#else

namespace {

// Slope of log error over log step, least squares: 1 for a scheme of first order. Errors close to
// those of the reference itself say nothing.
double order(const scene::CostTable& table) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (const scene::CostRow& row : table.rows) {
    if (!row.failure.empty() || !(row.error > 2 * table.reference_error)) continue;
    const double x = std::log(row.setting), y = std::log(row.error);
    n += 1, sx += x, sy += y, sxx += x * x, sxy += x * y;
  }
  return n < 3 ? NAN : (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

// A scene that cannot be run at the fine step of a reference is measured at coarser steps.
scene::CostTable measure(const scene::Scene& scene, std::string& note) {
  scene::CostOptions options;
  const double step = scene.stepping.value_or(scene::SteppingOptions{}).step;
  for (const double finest : {step / 4, step, 4 * step}) {
    options.steps.clear();
    for (double s = finest; s < 40 * finest; s *= 2) options.steps.push_back(s);
    try {
      return scene::cost(scene, options);
    } catch (const std::runtime_error& e) {
      note += fmt::format("{}; ", e.what());
    }
  }
  throw std::runtime_error(note);
}

void add(Report& report, const std::string& name, const scene::CostTable& table,
         const std::string& note) {
  const double slope = order(table);
  Table out;
  out.head = {name, "error", "ms", "steps", "us per step", "depth / m"};
  Line line{"time step", "", {}, {}};
  for (const scene::CostRow& row : table.rows) {
    const bool failed = !row.failure.empty();
    out.rows.push_back(
        {fmt::format("step {:g} s", row.setting),
         failed ? "failed" : fmt::format("{:.2e}", row.error),
         fmt::format("{:.4g}", 1e3 * row.seconds), fmt::format("{}", row.steps),
         fmt::format("{:.3g}", 1e6 * row.seconds / static_cast<double>(std::max(row.steps, 1L))),
         fmt::format("{:.1e}", row.penetration)});
    report.csv +=
        fmt::format("{},{:g},{:.4e},{:.4e},{},{:.3e},{}\n", name, row.setting, row.error,
                    1e3 * row.seconds, row.steps, row.penetration, failed ? "failed" : "ok");
    report.json.push_back({{"scene", name},
                           {"step", row.setting},
                           {"error", failed ? Json() : Json(row.error)},
                           {"ms", 1e3 * row.seconds},
                           {"steps", row.steps},
                           {"depth", row.penetration},
                           {"failure", row.failure}});
    if (failed) continue;
    line.x.push_back(1e3 * row.seconds);
    line.y.push_back(std::max(row.error, 1e-17));
  }
  const std::string facts = fmt::format(
      "errors against {} (uncertain by {:.1e}){}", table.reference, table.reference_error,
      std::isfinite(slope) ? fmt::format("; error ~ step^{:.2f}", slope) : "");
  report.text += out.text() + "  " + facts + "\n" + (note.empty() ? "" : "  " + note + "\n");
  report.html +=
      out.html() + "<p>" + html_escape(facts + (note.empty() ? "" : ". " + note)) + "</p>\n";
  report.pictures.emplace_back(
      name, svg(name + ": time step", "CPU / ms", "largest error / m, rad", {line}));
}

}  // namespace

Report step_cost(const std::vector<std::string>& scenes) {
  Report report;
  report.csv = "scene,step_s,error,ms,steps,depth_m,status\n";
  for (const std::string& file : scenes) {
    const scene::Scene scene = scene::read_scene(file);
    const std::string name = scene.name.empty() ? file : scene.name;
    if (scene::make_plan(scene).engine != scene::EngineKind::stepping) {
      report.text += fmt::format("{} left out: it runs on the smooth engine\n", name);
      continue;
    }
    std::string note;
    try {
      const scene::CostTable table = measure(scene, note);
      add(report, name, table, note);
    } catch (const std::runtime_error& e) {
      report.text += fmt::format("{} left out: {}\n", name, e.what());
    }
  }
  return report;
}

#endif

}  // namespace tether::bench

// Tether: runs of all codes on one problem. SPDX-License-Identifier: BSD-3-Clause
#include "measure.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace tether::bench {

namespace {

double significant_digits(const problems::Problem& problem, const std::vector<double>& y) {
  double worst = 0.0;
  for (int i = 0; i < problem.error_components; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double expected = problem.reference[k];
    if (expected == 0.0) continue;
    const double relative = std::abs((y[k] - expected) / expected);
    if (!std::isfinite(relative)) return std::nan("");
    worst = std::max(worst, relative);
  }
  return worst > 0.0 ? -std::log10(worst) : 17.0;
}

// Follows the rows and the orders of a run; at the end `last` holds the drift that remained.
class Recorder {
 public:
  Recorder(const problems::Problem& problem, Point& point) : problem_(problem), point_(point) {
    for (const problems::Rows& rows : problem.rows) point.drift.emplace_back(rows.name, 0.0);
  }

  void operator()(double t, const double* y, int order) {
    ++point_.orders[static_cast<std::size_t>(std::clamp(order, 0, 12))];
    for (std::size_t k = 0; k < problem_.rows.size(); ++k) {
      const auto& rows = problem_.rows[k].constraints;
      g_.assign(static_cast<std::size_t>(rows.count), 0.0);
      rows.value(t, ida_projection::ConstVector(y, problem_.size),
                 ida_projection::Vector(g_.data(), rows.count));
      for (const double entry : g_)
        point_.drift[k].second = std::max(point_.drift[k].second, std::abs(entry));
    }
  }

 private:
  const problems::Problem& problem_;
  Point& point_;
  std::vector<double> g_;
};

std::string why_marked(const Point& point) {
  if (point.run.failed) return "failed: " + point.run.message;
  if (!(point.run.error == point.run.error)) return "failed: end state not finite";
  if (point.run.error <= 100.0 * point.tolerance) return {};
  // A run that left its constraints or lost an invariant did not solve the problem; otherwise the
  // local errors, each within its tolerance, have added up or been amplified.
  std::string why = fmt::format("error {:.0f} tolerances", point.run.error / point.tolerance);
  for (const auto& [name, drift] : point.drift) {
    if (name == "acceleration" || drift < point.run.error / 100.0 || drift < 10.0 * point.tolerance)
      continue;
    why += fmt::format("; {} off by {:.0e}", name, drift);
  }
  return why + fmt::format("; {:.2g} tolerances a step", point.run.error / point.tolerance /
                                                             static_cast<double>(point.run.steps));
}

}  // namespace

std::vector<Point> measure(const Case& which, const Codes& codes, const Plan& plan) {
  struct Job {
    const Code* code;
    const problems::Problem* problem;
  };
  std::vector<Job> jobs;
  for (const auto& code : codes)
    for (const problems::Problem& problem : which.forms)
      if (code->missing().empty() && code->refuses(problem).empty())
        jobs.push_back({code.get(), &problem});

  const Limits limits{plan.steps, plan.run_seconds};
  std::vector<Point> points;
  std::vector<int> stuck(jobs.size(), 0);
  for (const double tolerance : plan.tolerances) {
    const std::size_t first = points.size();
    std::vector<std::vector<double>> cpu(jobs.size());
    for (int repeat = 0; repeat < std::max(1, plan.repeats); ++repeat) {
      for (std::size_t j = 0; j < jobs.size(); ++j) {
        if (repeat > 0 && (points[first + j].run.failed || cpu[j].front() > 100.0)) continue;
        Run run;
        if (stuck[j] < 2) {
          run = jobs[j].code->run(*jobs[j].problem, tolerance, limits);
        } else {
          run.failed = true;
          run.message = "not run: it hit the limits at two looser tolerances";
        }
        cpu[j].push_back(run.cpu_ms);
        if (repeat > 0) continue;
        if (run.failed && (run.steps >= limits.steps || run.cpu_ms > 999.0 * limits.cpu_seconds))
          ++stuck[j];
        Point point;
        point.problem = which.name;
        point.form = jobs[j].problem->form;
        point.code = jobs[j].code->name();
        point.tolerance = tolerance;
        point.run = std::move(run);
        points.push_back(std::move(point));
      }
    }
    for (std::size_t j = 0; j < jobs.size(); ++j) {
      Point& point = points[first + j];
      point.run.cpu_ms = median(cpu[j]);
      if (!point.run.failed) {
        point.scd = significant_digits(*jobs[j].problem, point.run.y);
        if (plan.watch) {
          Recorder recorder(*jobs[j].problem, point);
          jobs[j].code->run(*jobs[j].problem, tolerance, limits, std::ref(recorder));
        }
      }
      point.mark = why_marked(point);
    }
  }
  return points;
}

std::vector<Family> families(const std::vector<Point>& points) {
  std::vector<Family> all;
  for (const Point& point : points) {
    auto family =
        std::find_if(all.begin(), all.end(), [&](const Family& f) { return f.code == point.code; });
    if (family == all.end()) family = all.insert(all.end(), Family{point.code, {}});
    auto curve = std::find_if(family->forms.begin(), family->forms.end(),
                              [&](const Curve& c) { return c.title == point.form; });
    if (curve == family->forms.end())
      curve = family->forms.insert(family->forms.end(), Curve{point.form, {}, {}});
    curve->add(!point.usable(), point.run.error, point.run.cpu_ms);
  }
  return all;
}

}  // namespace tether::bench

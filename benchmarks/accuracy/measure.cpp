// Tether: runs of all codes on one problem. SPDX-License-Identifier: BSD-3-Clause
#include "measure.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "conditioning.hpp"

namespace tether::bench {

double significant_digits(const problems::Problem& problem, const std::vector<double>& y) {
  double worst = 0.0, largest = 0.0;
  for (int i = 0; i < problem.error_components; ++i)
    largest = std::fmax(largest, std::abs(problem.reference[static_cast<std::size_t>(i)]));
  for (int i = 0; i < problem.error_components; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double expected = problem.reference[k];
    // Unknown, or zero but for round-off.
    if (!(std::abs(expected) > 1e-12 * largest)) continue;
    const double relative = std::abs((y[k] - expected) / expected);
    if (!std::isfinite(relative)) return std::nan("");
    worst = std::max(worst, relative);
  }
  return worst > 0.0 ? -std::log10(worst) : 17.0;
}

namespace {

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

// Within 100 tolerances, or why not. What each step may lose is one tolerance, and the problem may
// multiply that by its amplification; a run that lost more has missed its tolerance.
std::string status_of(const Point& point, double amplification) {
  if (point.run.failed) return "failed: " + point.run.message;
  if (!(point.run.error == point.run.error)) return "failed: end state not finite";
  const double tolerances = point.run.error / point.tolerance;
  if (tolerances <= 100.0) return "met";
  const double each = tolerances / static_cast<double>(std::max(1L, point.run.steps));
  const double allowed = std::fmax(1.0, amplification);
  std::string why =
      fmt::format("{}: {:.0f} tolerances in {} steps, {:.2g} a step",
                  each <= allowed ? "adds up" : "missed", tolerances, point.run.steps, each);
  if (amplification > 1.0) why += fmt::format("; the problem multiplies by {:.2g}", amplification);
  for (const auto& [name, drift] : point.drift)
    if (name != "acceleration" && drift >= point.run.error / 100.0 &&
        drift >= 10.0 * point.tolerance)
      why += fmt::format("; {} off by {:.0e}", name, drift);
  return why;
}

struct Job {
  const Code* code;
  const problems::Problem* problem;
  int stuck = 0;  // runs that hit the limits
};

class Session {
 public:
  Session(const Case& which, const Codes& codes, const Plan& plan)
      : which_(which), plan_(plan), limits_{plan.steps, plan.run_seconds} {
    for (const auto& code : codes)
      for (const problems::Problem& problem : which.forms)
        if (code->missing().empty() && code->refuses(problem).empty())
          jobs_.push_back({code.get(), &problem});
  }

  std::size_t size() const { return jobs_.size(); }
  std::vector<Point> take() { return std::move(points_); }

  // First runs bind functions of libraries and touch their memory, which would distort short runs.
  void warm_up(double tolerance) const {
    const Limits brief{plan_.steps, std::min(0.05, plan_.run_seconds)};
    for (const Job& job : jobs_) job.code->run(*job.problem, tolerance, brief, {});
  }

  // All wanted jobs at one tolerance; last[j]: the point of job j.
  void round(double tolerance, const std::vector<bool>& wanted, std::vector<Point>& last) {
    std::vector<std::vector<double>> cpu(jobs_.size());
    for (int repeat = 0; repeat < std::max(1, plan_.repeats); ++repeat) {
      for (std::size_t j = 0; j < jobs_.size(); ++j) {
        if (!wanted[j]) continue;
        if (repeat > 0 && (last[j].run.failed || cpu[j].front() > 100.0)) continue;
        Run run = once(jobs_[j], tolerance);
        cpu[j].push_back(run.cpu_ms);
        if (repeat == 0) last[j] = point(jobs_[j], tolerance, std::move(run));
      }
    }
    for (std::size_t j = 0; j < jobs_.size(); ++j) {
      if (!wanted[j]) continue;
      last[j].run.cpu_ms = median(cpu[j]);
      if (!last[j].run.failed) follow(jobs_[j], last[j]);
      points_.push_back(last[j]);
    }
  }

 private:
  Run once(Job& job, double tolerance) {
    Run run;
    if (job.stuck >= 2) {
      run.failed = true;
      run.message = "not run: it hit the limits at two looser tolerances";
      return run;
    }
    run = job.code->run(*job.problem, tolerance, limits_);
    if (run.failed && (run.steps >= limits_.steps || run.cpu_ms > 999.0 * limits_.cpu_seconds))
      ++job.stuck;
    return run;
  }

  Point point(const Job& job, double tolerance, Run run) const {
    Point made;
    made.problem = which_.name;
    made.form = job.problem->form;
    made.code = job.code->name();
    made.tolerance = tolerance;
    made.run = std::move(run);
    return made;
  }

  void follow(const Job& job, Point& made) const {
    made.scd = significant_digits(*job.problem, made.run.y);
    if (!plan_.watch || is_fast(made.code)) return;  // the fast one takes the same steps
    Recorder recorder(*job.problem, made);
    job.code->run(*job.problem, made.tolerance, limits_, std::ref(recorder));
  }

  const Case& which_;
  const Plan& plan_;
  Limits limits_;
  std::vector<Job> jobs_;
  std::vector<Point> points_;
};

// On in one direction, as long as a job's errors have not come as far as `enough` says.
template <class Enough>
void extend(Session& session, double tolerance, double factor, double end, std::vector<Point> last,
            Enough enough) {
  for (tolerance *= factor; factor < 1.0 ? tolerance > end : tolerance < end; tolerance *= factor) {
    std::vector<bool> wanted(session.size());
    for (std::size_t j = 0; j < wanted.size(); ++j)
      wanted[j] = last[j].usable() && !enough(last[j].run.error);
    if (std::count(wanted.begin(), wanted.end(), true) == 0) return;
    session.round(tolerance, wanted, last);
    for (std::size_t j = 0; j < wanted.size(); ++j)
      if (!wanted[j]) last[j].run.failed = true;
  }
}

// A failure of ours that plain IDA shares, with and without algebraic variables in its error test,
// is one of the form and tolerance and not of the projection.
void name_shared_failures(std::vector<Point>& points) {
  for (Point& point : points) {
    if (!is_ours(point.code) || !point.run.failed) continue;
    int runs = 0, fails = 0;
    for (const Point& other : points) {
      if (base_name(other.code) != "IDA" || other.form != point.form ||
          other.tolerance != point.tolerance)
        continue;
      ++runs;
      fails += other.run.failed;
    }
    if (runs > 0)
      point.status += fails == runs ? "; plain IDA fails here, too" : "; plain IDA does not";
  }
}

void set_ratios(std::vector<Point>& points) {
  const std::vector<Family> all = families(points);
  std::vector<std::string> peers;
  for (const Family& family : all)
    if (is_peer(family.code)) peers.push_back(base_name(family.code));
  for (Point& point : points) {
    if (!point.usable()) continue;
    double best = std::nan("");
    for (const std::string& peer : peers)
      best = std::fmin(best, best_of(all, peer, point.run.error).cpu);
    point.to_peers = point.run.cpu_ms / best;
    point.to_plain = point.run.cpu_ms / best_of(all, "IDA", point.run.error).cpu;
  }
}

}  // namespace

std::vector<Point> measure(const Case& which, const Codes& codes, const Plan& plan) {
  Session session(which, codes, plan);
  const std::vector<bool> everybody(session.size(), true);
  std::vector<Point> last(session.size()), first;
  if (!plan.tolerances.empty()) session.warm_up(plan.tolerances.front());
  for (const double tolerance : plan.tolerances) {
    session.round(tolerance, everybody, last);
    if (first.empty()) first = last;
  }
  if (plan.reach) {
    const double loose = plan.tolerances.front(), tight = plan.tolerances.back();
    const auto gaps = static_cast<double>(std::max<std::size_t>(plan.tolerances.size(), 2) - 1);
    const double step = std::clamp(std::pow(tight / loose, 1.0 / gaps), 0.1, 0.5);
    extend(session, loose, 1.0 / step, 0.11, first, [](double error) { return error > 1e-3; });
    extend(session, tight, step, 0.9e-13, last, [](double error) { return error < 1e-9; });
  }
  std::vector<Point> points = session.take();
  std::stable_sort(points.begin(), points.end(),
                   [](const Point& a, const Point& b) { return a.tolerance > b.tolerance; });
  const double growth = amplification(which);
  for (Point& point : points) point.status = status_of(point, growth);
  name_shared_failures(points);
  set_ratios(points);
  return points;
}

Best best_of(const std::vector<Family>& all, const std::string& base, double error) {
  constexpr double kLineWidth = 1.5;  // decades; see Curve::cpu_at
  Best found{std::nan(""), "-"};
  for (const Family& family : all) {
    if (base_name(family.code) != base) continue;
    const Best one = best(family.forms, error, kLineWidth);
    if (std::isnan(one.cpu) || one.cpu >= found.cpu) continue;
    found = {one.cpu,
             one.title + (family.code.find(" suppressed") == std::string::npos ? "" : " s")};
  }
  return found;
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

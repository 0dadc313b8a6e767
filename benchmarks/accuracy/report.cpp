// Tether: what measured runs say, as tables, lines and pictures. SPDX-License-Identifier:
// BSD-3-Clause
#include "report.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace tether::bench {

namespace {

constexpr int kLoosest = 3, kTightest = 9;  // decades of error that are compared

std::string number(double value, const char* format = "{:.3g}") {
  return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : "-";
}

// "position 1e-9, velocity 2e-8"
template <class Format>
std::string join(const Point& point, const char* separator, Format format) {
  std::string out;
  for (const auto& [name, value] : point.drift)
    out += (out.empty() ? "" : separator) + format(name, value);
  return out;
}

template <class Format>
std::string orders(const Point& point, const char* separator, Format format) {
  std::string out;
  for (std::size_t k = 0; k < point.orders.size(); ++k)
    if (point.orders[k] > 0) out += (out.empty() ? "" : separator) + format(k, point.orders[k]);
  return out;
}

std::string first_word(const std::string& status) { return status.substr(0, status.find(':')); }

}  // namespace

Comparison::Comparison(std::vector<std::string> peers) : peers_(std::move(peers)) {}

std::string Comparison::note(const Pair& pair, const std::string& problem, int decade,
                             double ratio) {
  const std::string at = fmt::format("1e-{:02}", decade);
  Standing& standing = standings_[pair];
  standing.points.add(ratio);
  if (ratio > 1.0) ++standing.ahead;
  if (ratio > standing.worst) {
    standing.worst = ratio;
    standing.worst_at = problem + " at " + at;
  }
  json_.push_back({{"problem", problem},
                   {"ours", pair.first},
                   {"code", pair.second},
                   {"error", std::pow(10.0, -decade)},
                   {"ratio", ratio}});
  return number(ratio, "{:.2f}");
}

Table Comparison::add(const std::string& problem, const std::vector<Point>& points) {
  const std::vector<Family> all = families(points);
  // Ours, and whom they are divided by. "fast": with fast vectors and factors.
  const std::vector<std::string> ours = {"Tether fast", "Tether"};
  std::vector<std::string> others = {"IDA", "IDA fast"};
  others.insert(others.end(), peers_.begin(), peers_.end());
  Table table;
  table.head = {"error"};
  for (const std::string& code : ours) table.head.insert(table.head.end(), {code + " ms", "form"});
  for (const std::string& code : others)
    table.head.insert(table.head.end(), {code + " ms", "form", "fast /", "/"});
  std::map<Pair, GeometricMean> here;
  std::map<Pair, std::vector<std::string>> cells;
  for (int decade = kLoosest; decade <= kTightest; ++decade) {
    const double error = std::pow(10.0, -decade);
    std::vector<std::string> row = {fmt::format("{:.0e}", error)};
    const auto show = [&](const Best& best) {
      row.insert(row.end(), {number(best.cpu), best.title});
    };
    std::vector<Best> mine;
    for (const std::string& code : ours) show(mine.emplace_back(best_of(all, code, error)));
    for (const std::string& code : others) {
      const Best other = best_of(all, code, error);
      show(other);
      for (std::size_t k = 0; k < ours.size(); ++k) {
        const Pair pair{ours[k], code};
        const double ratio = mine[k].cpu / other.cpu;
        here[pair].add(ratio);
        row.push_back(note(pair, problem, decade, ratio));
        cells[pair].push_back(row.back());
      }
    }
    table.rows.push_back(std::move(row));
  }
  for (auto& [pair, row] : cells) {
    row.insert(row.begin(), problem);
    lines_[pair].push_back(row);
  }
  for (const auto& [pair, mean] : here) standings_[pair].problems.add(mean.value());
  return table;
}

Table Comparison::summary() const {
  Table table;
  table.head = {"best form of", "/ best form of", "mean of points", "mean of problems",
                "worst point",  "where",          "it leads at",    "points"};
  for (const auto& [pair, standing] : standings_)
    table.rows.push_back({pair.first, pair.second, number(standing.points.value(), "{:.2f}"),
                          number(standing.problems.value(), "{:.2f}"),
                          number(standing.worst > 0.0 ? standing.worst : std::nan(""), "{:.2f}"),
                          standing.worst_at, fmt::format("{}", standing.ahead),
                          fmt::format("{}", standing.points.count())});
  return table;
}

Table Comparison::point_by_point(const Pair& pair) const {
  Table table;
  table.head = {pair.first + " / " + pair.second};
  for (int decade = kLoosest; decade <= kTightest; ++decade)
    table.head.push_back(fmt::format("1e-{:02}", decade));
  if (const auto found = lines_.find(pair); found != lines_.end()) table.rows = found->second;
  return table;
}

Table standing_of_ours(const std::vector<Point>& points) {
  Table table;
  table.head = {"code, form", "runs", "met", "adds up", "missed", "failed"};
  std::map<std::string, std::map<std::string, int>> counts;
  std::vector<std::string> order;
  for (const Point& point : points) {
    if (!is_ours(point.code) || is_fast(point.code)) continue;
    const std::string name = point.code + ", " + point.form;
    if (counts.find(name) == counts.end()) order.push_back(name);
    ++counts[name][first_word(point.status)];
    ++counts[name]["runs"];
  }
  for (const std::string& name : order) {
    std::vector<std::string> row = {name};
    for (const char* what : {"runs", "met", "adds up", "missed", "failed"})
      row.push_back(fmt::format("{}", counts[name][what]));
    table.rows.push_back(row);
  }
  return table;
}

Table unmet(const std::vector<Point>& points, const std::string& only) {
  Table table;
  table.head = {"code, form", "tolerance", "status"};
  for (const Point& point : points)
    if (is_ours(point.code) && !is_fast(point.code) && !point.met() &&
        point.status.compare(0, only.size(), only) == 0)
      table.rows.push_back(
          {point.code + ", " + point.form, fmt::format("{:.1e}", point.tolerance), point.status});
  return table;
}

Table work_at(const std::vector<Point>& points, double tolerance) {
  Table table;
  table.head = {"code, form", "error",  "scd",    "steps",       "F",     "J",     "LU",
                "proj.",      "failed", "CPU ms", "/ best peer", "drift", "orders"};
  double nearest = 0.0;
  for (const Point& point : points)
    if (std::abs(std::log(point.tolerance / tolerance)) < std::abs(std::log(nearest / tolerance)))
      nearest = point.tolerance;
  for (const Point& p : points) {
    if (p.tolerance != nearest) continue;
    const bool failed = p.run.failed;
    const std::string drift = join(p, ", ", [](const std::string& name, double value) {
      return fmt::format("{} {:.0e}", name, value);
    });
    table.rows.push_back(
        {p.code + ", " + p.form, failed ? "-" : fmt::format("{:.1e}", p.run.error),
         failed ? "-" : fmt::format("{:.1f}", p.scd), fmt::format("{}", p.run.steps),
         fmt::format("{}", p.run.residuals), fmt::format("{}", p.run.jacobians),
         fmt::format("{}", p.run.factorizations), fmt::format("{}", p.run.projections),
         fmt::format("{}", p.run.error_failures + p.run.solver_failures),
         fmt::format("{:.3g}", p.run.cpu_ms), number(p.to_peers, "{:.2f}"),
         failed ? p.run.message : drift,
         orders(p, " ", [](std::size_t k, long n) { return fmt::format("{}:{}", k, n); })});
  }
  return table;
}

std::string picture(const Case& which, const std::vector<Point>& points, const std::string& error) {
  static const std::vector<std::string> codes = {
      "IDA suppressed", "DASPK suppressed", "IDA",        "DASPK",
      "Tether",         "RADAU5",           "CVODE+proj", "CPodes"};
  std::vector<Line> lines;
  for (const Point& point : points) {
    if (!point.usable() || point.run.error > 1.0) continue;
    auto line = std::find_if(lines.begin(), lines.end(), [&](const Line& l) {
      return l.name == point.code && l.form == point.form;
    });
    if (line == lines.end()) line = lines.insert(lines.end(), Line{point.code, point.form, {}, {}});
    line->x.push_back(std::max(point.run.error, 1e-16));
    line->y.push_back(point.run.cpu_ms);
  }
  return svg(which.name + ": " + which.text, error, "processor time, ms", lines, codes);
}

std::string csv_head() {
  return "problem,code,form,tolerance,error,scd,cpu_ms,steps,F,J,factorizations,projections,"
         "error_failures,solver_failures,to_best_peer,to_plain_ida,drift,orders,status\n";
}

std::string csv_line(const Point& p) {
  const std::string drift = join(p, ";", [](const std::string& name, double value) {
    return fmt::format("{}={:.3e}", name, value);
  });
  std::string status = p.status;
  std::replace(status.begin(), status.end(), '"', '\'');
  return fmt::format(
      "{},{},{},{:.4e},{:.4e},{:.2f},{:.5g},{},{},{},{},{},{},{},{:.3g},{:.3g},{},{},\"{}\"\n",
      p.problem, p.code, p.form, p.tolerance, p.run.error, p.scd, p.run.cpu_ms, p.run.steps,
      p.run.residuals, p.run.jacobians, p.run.factorizations, p.run.projections,
      p.run.error_failures, p.run.solver_failures, p.to_peers, p.to_plain, drift,
      orders(p, ";", [](std::size_t k, long n) { return fmt::format("{}:{}", k, n); }), status);
}

Json json_point(const Point& p) {
  Json drift = Json::object(), orders = Json::object();
  for (const auto& [name, value] : p.drift) drift[name] = value;
  for (std::size_t k = 0; k < p.orders.size(); ++k)
    if (p.orders[k] > 0) orders[std::to_string(k)] = p.orders[k];
  return {{"problem", p.problem},
          {"code", p.code},
          {"form", p.form},
          {"tolerance", p.tolerance},
          {"error", p.run.failed ? Json() : Json(p.run.error)},
          {"scd", p.scd},
          {"cpu_ms", p.run.cpu_ms},
          {"steps", p.run.steps},
          {"F", p.run.residuals},
          {"J", p.run.jacobians},
          {"factorizations", p.run.factorizations},
          {"projections", p.run.projections},
          {"error_failures", p.run.error_failures},
          {"solver_failures", p.run.solver_failures},
          {"to_best_peer", p.to_peers},
          {"to_plain_ida", p.to_plain},
          {"drift", drift},
          {"orders", orders},
          {"status", p.status}};
}

}  // namespace tether::bench

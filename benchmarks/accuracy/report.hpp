// Tether: what measured runs say, as tables, lines and pictures. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "measure.hpp"
#include "page.hpp"

namespace tether::bench {

/// Ours / another code's best form at equal error, over problems and decades.
struct Standing {
  GeometricMean points, problems;
  double worst = 0.0;
  std::string worst_at;  ///< "kepler at 1e-05"
  int ahead = 0;         ///< points at which the other one is faster
};

class Comparison {
 public:
  explicit Comparison(std::vector<std::string> peers);

  /// Takes a problem in and returns its table: CPU at equal error, a line for each decade.
  Table add(const std::string& problem, const std::vector<Point>& points);

  /// Ours and whom they are divided by: "Tether fast", "IDA".
  using Pair = std::pair<std::string, std::string>;

  Table summary() const;
  /// Ratio of two codes: a line for each problem, a column for each decade.
  Table point_by_point(const Pair& pair) const;
  const std::map<Pair, Standing>& standings() const { return standings_; }
  /// An array of {problem, ours, code, error, ratio}.
  const Json& json() const { return json_; }

 private:
  // Takes a ratio in and returns it as text.
  std::string note(const Pair& pair, const std::string& problem, int decade, double ratio);

  std::vector<std::string> peers_;  // without plain IDA
  std::map<Pair, Standing> standings_;
  std::map<Pair, std::vector<std::vector<std::string>>> lines_;
  Json json_ = Json::array();
};

/// Our runs: how many met 100 tolerances and how many did not, for each code and form. (Fast ones
/// take the same steps and are left out.)
Table standing_of_ours(const std::vector<Point>& points);
/// Our runs that did not, each with its status; `only`: those whose status begins so.
Table unmet(const std::vector<Point>& points, const std::string& only = "");
/// Every code and form at the tolerance nearest to this one.
Table work_at(const std::vector<Point>& points, double tolerance);

std::string picture(
    const Case& which, const std::vector<Point>& points,
    const std::string& error = "error at the end, |y - reference| / (1 + |reference|)");
std::string csv_head();
std::string csv_line(const Point& point);
Json json_point(const Point& point);

}  // namespace tether::bench

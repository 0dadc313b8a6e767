// Tether: runs of all codes on one problem. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "catalogue.hpp"
#include "code.hpp"
#include "projection/curve.hpp"

namespace tether::bench {

/// One code on one form at one tolerance.
struct Point {
  std::string problem, form, code;
  double tolerance = 0.0;
  Run run;           ///< CPU: median of the repeats
  double scd = 0.0;  ///< -log10 of the largest relative error of a compared component
  /// Largest |g| over all steps, for every group of rows; empty when not watched.
  std::vector<std::pair<std::string, double>> drift;
  std::array<long, 13> orders{};  ///< steps taken with each order; all 0 when not watched
  /// "met": error within 100 tolerances; "adds up", "missed" or "failed" and why.
  std::string status;
  /// CPU / that of the best form of any peer, of plain IDA, at the same error; NaN where none is
  /// read.
  double to_peers = std::nan(""), to_plain = std::nan("");

  bool met() const { return status == "met"; }

  bool usable() const { return !run.failed && run.error == run.error; }
};

/// Digits of the worst compared component: -log10 of its relative error; NaN: not finite.
double significant_digits(const problems::Problem& problem, const std::vector<double>& y);

struct Plan {
  std::vector<double> tolerances;
  int repeats = 3;
  bool watch = true;         ///< second, untimed run: drift and orders
  double run_seconds = 2.0;  ///< CPU limit of one run
  long steps = 300000;
  /// Go on beyond the tolerances until a code's end errors cover 1e-3 to 1e-9, at most from 1e-1 to
  /// 1e-13: codes whose errors are far from their tolerances are compared at equal error all the
  /// same.
  bool reach = true;
};

/// Timed runs are interleaved: every repeat goes once through all codes and forms, so that what
/// else happens on the machine meets all of them. Runs longer than 0.1 s are not repeated.
std::vector<Point> measure(const Case& which, const Codes& codes, const Plan& plan);

/// One curve for each code and form.
struct Family {
  std::string code;
  std::vector<Curve> forms;
};
std::vector<Family> families(const std::vector<Point>& points);

/// The cheapest form of a code at an error, its variants ("IDA suppressed": "s" after the form)
/// included; CPU NaN when none reaches it.
Best best_of(const std::vector<Family>& all, const std::string& base, double error);

inline bool is_peer(const std::string& code) { return !is_plain(code) && !is_ours(code); }

}  // namespace tether::bench

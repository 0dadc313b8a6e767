// Tether: CPU time against plain IDA's. SPDX-License-Identifier: BSD-3-Clause
#include "compare.hpp"

#include <algorithm>
#include <cmath>

namespace pendulum {

namespace {

Ratio divided_by_plain(const Result& run, const Ratio& plain_ms) {
  if (run.failed()) return {};
  if (plain_ms.kind != Ratio::Kind::value) return plain_ms;
  return {Ratio::Kind::value, run.outcome.cpu_ms / plain_ms.value};
}

Ratio plain_at_tolerance(const Results& results, const Case& what) {
  for (const Result& run : results.runs)
    if (run.what.plain() && run.what.form == what.form && run.what.tolerance == what.tolerance)
      return run.failed() ? Ratio{Ratio::Kind::never, 0.0}
                          : Ratio{Ratio::Kind::value, run.outcome.cpu_ms};
  return {};
}

/// The faster of the plain forms.
Ratio plain_at_error(const std::vector<Curve>& all, double error) {
  Ratio best{Ratio::Kind::never, 0.0};
  for (const Curve& curve : all) {
    if (curve.invariants != Invariants::none) continue;
    const Ratio ms = time_for(curve, error);
    const bool better = best.kind != Ratio::Kind::value || ms.value < best.value;
    if (ms.kind == Ratio::Kind::value ? better : best.kind == Ratio::Kind::never) best = ms;
  }
  return best;
}

}  // namespace

std::vector<Curve> curves(const Results& results) {
  std::vector<Curve> all;
  for (const Result& run : results.runs) {
    const bool same = !all.empty() && all.back().form == run.what.form &&
                      all.back().invariants == run.what.invariants;
    if (!same) all.push_back({run.what.form, run.what.invariants, {}});
    if (!run.failed()) all.back().points.push_back(&run);
  }
  return all;
}

Ratio time_for(const Curve& curve, double error) {
  Ratio best{Ratio::Kind::never, 0.0};
  bool larger = false;
  for (std::size_t i = 0; i < curve.points.size(); ++i) {
    const Outcome& tight = curve.points[i]->outcome;
    larger = larger || tight.error > error;
    if (i == 0) continue;
    const Outcome& loose = curve.points[i - 1]->outcome;
    if ((loose.error - error) * (tight.error - error) > 0.0) continue;  // not between them
    const double share = loose.error == tight.error
                             ? 0.0
                             : std::log(error / loose.error) / std::log(tight.error / loose.error);
    const double ms = loose.cpu_ms * std::pow(tight.cpu_ms / loose.cpu_ms, share);
    if (best.kind != Ratio::Kind::value || ms < best.value) best = {Ratio::Kind::value, ms};
  }
  if (best.kind != Ratio::Kind::value && !larger && !curve.points.empty())
    best.kind = Ratio::Kind::unknown;
  return best;
}

void compare_with_plain(Results& results) {
  const std::vector<Curve> all = curves(results);
  for (Result& run : results.runs) {
    run.same_tolerance = divided_by_plain(run, plain_at_tolerance(results, run.what));
    run.same_error = divided_by_plain(run, plain_at_error(all, run.outcome.error));
  }
}

}  // namespace pendulum

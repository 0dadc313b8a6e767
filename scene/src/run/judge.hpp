// Tether: holds a run against the expectations of its scene. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <tether/scene/run.hpp>

#include "output/binary.hpp"

namespace tether::scene {

/// One time, for one or several reasons.
struct Event {
  /// On the grid of Output::every, of an [[expect]], on the grid of Output::checkpoint, of
  /// RunOptions::stops, the end.
  enum Reason : unsigned { record = 1, expect = 2, checkpoint = 4, stop = 8, end = 16 };
  double time = 0;  // s
  unsigned reasons = 0;
  bool is(unsigned any) const { return (reasons & any) != 0; }
};

/// Relative: nearer times are one, as 3 * 0.1 and 0.3.
constexpr double kTimeRounding = 1e-12;
inline bool same_time(double a, double b) {
  return std::abs(a - b) <= kTimeRounding * std::fmax(std::abs(a), std::abs(b));
}

/// In order, after t = 0. Times that are the same but for rounding are one event, with the digits
/// of the grid of records: so it has them in a run that goes on behind this end, too.
std::vector<Event> schedule(const Scene& scene, const std::vector<double>& stops);

class Judge {
 public:
  explicit Judge(const Scene& scene);
  /// At a time at which the run stops: `event` as planned, at or before engine.time(); `record`: it
  /// is one of those at which all that holds throughout is judged.
  void judge(double event, bool record, const Engine& engine, double start_energy);
  const std::vector<Judgement>& judgements() const { return judgements_; }
  /// Reads judgements of a state, or writes them. A scene that has gained or lost expectations
  /// begins anew.
  void exchange(binary::Archive io);

 private:
  const Scene& scene_;
  std::vector<Judgement> judgements_;
  // By how much the worst moment missed its bound; <= 0: met, never nan.
  std::vector<double> excess_;
};

}  // namespace tether::scene

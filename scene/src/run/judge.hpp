// Tether: holds a run against the expectations of its scene. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <tether/scene/run.hpp>

namespace tether::scene {

/// One time, for one or several reasons.
struct Event {
  double time = 0;          // s
  bool record = false;      // on the grid of Output::every
  bool expect = false;      // of an [[expect]]
  bool checkpoint = false;  // on the grid of Output::checkpoint
  bool stop = false;        // of RunOptions::stops
  bool end = false;
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
  void save(std::ostream& out) const;
  void restore(std::istream& in);

 private:
  const Scene& scene_;
  std::vector<Judgement> judgements_;
  std::vector<double>
      excess_;  // by how much the worst moment missed its bound; <= 0: met, never nan
};

}  // namespace tether::scene

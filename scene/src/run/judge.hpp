// Tether: holds a run against the expectations of its scene. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <iosfwd>
#include <tether/scene/run.hpp>
#include <vector>

namespace tether::scene {

class Judge {
 public:
  explicit Judge(const Scene& scene);
  /// At a time at which the run stops: `event` as planned, at or before engine.time(); `record`: it
  /// is one of those at which everything is looked at that holds throughout.
  void look(double event, bool record, const Engine& engine, double start_energy);
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

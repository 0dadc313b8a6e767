// Runs of the smooth engine and what tests ask of them. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <tether/scene/words.hpp>

#include "mechanisms.hpp"
#include "support/catch.hpp"

namespace mechanisms {

using namespace tether::scene;

inline double energy(const Engine& engine) {
  const Diagnostics d = engine.diagnostics();
  return d.kinetic_energy + d.potential_energy;
}

struct Outcome {
  double error = 0, drift = 0, energy_change = 0;
  Counts counts;
};

inline Outcome run(const Scene& scene, double end,
                   const std::function<double(const Engine&)>& error) {
  const auto engine = make_smooth_engine(scene);
  Outcome out;
  const double before = energy(*engine);
  const int stops = std::max(1, static_cast<int>(std::ceil(2 * end)));
  for (int k = 1; k <= stops; ++k) {
    engine->advance(end * k / stops);
    out.drift = std::max(out.drift, engine->diagnostics().drift);
  }
  out.energy_change = energy(*engine) - before;
  out.error = error(*engine);
  out.counts = engine->counts();
  return out;
}

inline Vector3d end_of(const Engine& engine, int rod) {
  const BodyState& b = engine.bodies()[static_cast<std::size_t>(rod)];
  return b.position + b.orientation * Vector3d(0.5, 0, 0);
}

inline double in_plane(const Vector3d& p, double x, double y) {
  return std::hypot(p.x() - x, p.y() - y);
}

inline constexpr Formulation kForms[] = {Formulation::index1, Formulation::index0};

// Every form and tolerance: error below ten times the tolerance, constraints kept, steps bounded.
inline void meets(const char* what, const std::function<Scene(double)>& make, double end,
                  const std::function<double(const Engine&)>& error, long steps) {
  for (const Formulation form : kForms)
    for (const double tolerance : {1e-4, 1e-6, 1e-9}) {
      Scene scene = make(tolerance);
      scene.smooth->formulation = form;
      const Outcome out = run(scene, end, error);
      INFO(what << ", " << word(form) << ", tolerance " << tolerance << ", steps "
                << out.counts.steps << ", error in tolerances " << out.error / tolerance);
      CHECK(out.error < 10 * tolerance);
      CHECK(out.drift < 2e-9);
      CHECK(std::abs(out.energy_change) < 1e-9);
      CHECK(out.counts.steps < steps);
    }
}

}  // namespace mechanisms

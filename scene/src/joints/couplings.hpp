// Tether: couplings of joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/scene.hpp>
#include <vector>

namespace tether::scene::couplings {

/// The polynomial of each of its joints, from degree 1 on, whose sum vanishes. Ratios of angles
/// that are fractions of small numbers, but for rounding, are these. Throws std::invalid_argument.
std::vector<std::vector<double>> polynomials(const Scene& scene, const Coupling& coupling);

/// The sum grows by multiples of this where an angle grows by a full turn; 0: nothing is known.
double turn(const Scene& scene, const Coupling& coupling,
            const std::vector<std::vector<double>>& polynomials);

}  // namespace tether::scene::couplings

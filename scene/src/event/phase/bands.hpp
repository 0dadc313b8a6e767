// Tether: how near to zero counts as zero. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "event/model/model.hpp"

namespace tether::scene::event {

/// Bands of each contact, in the units of the model.
struct Bands {
  double part = 0;  ///< the tolerance; of the largest force, and of sizes
  std::vector<double> gaps, approaches, slips;

  double of_accelerations() const { return 0.1 * part; }  ///< of the largest
  double gap(int contact) const { return gaps[static_cast<std::size_t>(contact)]; }
  double approach(int contact) const { return approaches[static_cast<std::size_t>(contact)]; }
  double slip(int contact) const { return slips[static_cast<std::size_t>(contact)]; }
};

/// Least band of approach, in the units of the model: slower bounces are as high as rounding.
constexpr double kLeastSpeed = 1e-7;

/// In bands of its gap: how far beyond the border of its face a contact may be by the error of the
/// motion.
constexpr double kBesideBorder = 30;

/// At most 1; a power of 2, so that rounding does not show in it.
inline double part_of(double length) {
  return length > 0 ? std::min(1.0, std::exp2(std::round(std::log2(length)))) : 1.0;
}

/// Changes of gaps and contact velocities that the tolerance of coordinates and velocities amounts
/// to at the state that is set (method, eq. 4); at most the tolerance itself. (A sleeve with a play
/// of half a millimetre turns on its pole: a tolerance of its angle is far less of its gap.)
inline Bands bands_of(Model& model, double tolerance) {
  Bands out;
  out.part = tolerance;
  const VectorXd sizes = model.sizes();
  const int nq = model.coordinates(), nu = model.velocities();
  VectorXd gradient(nq);
  ContactLook look;
  for (int i = 0; i < model.contacts(); ++i) {
    model.look(i, look);
    gradient.setZero();
    model.to_coordinates(look.normal.data(), gradient.data());
    const auto speeds = sizes.segment(nq, nu).array();
    const double gap = (gradient.array() * sizes.head(nq).array()).matrix().norm();
    const double approach = (look.normal.transpose().array() * speeds).matrix().norm();
    double slip = 0;
    for (int k = 0; k < look.tangents.rows(); ++k)
      slip = std::max(slip, (look.tangents.row(k).transpose().array() * speeds).matrix().norm());
    out.gaps.push_back(tolerance * part_of(gap));
    out.approaches.push_back(std::max(tolerance, kLeastSpeed) * part_of(approach));
    out.slips.push_back(tolerance * part_of(slip));
  }
  return out;
}

}  // namespace tether::scene::event

// Tether: units in which the numbers of a scene are near 1. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

namespace tether::scene::mechanics {

/// SI for scenes of 1 mm to 1 km and of times of 1 ms to 1000 s; beyond, powers of 2 near the
/// scene's own length, time and mass, so that conversions are exact. Tolerances are absolute in
/// them.
struct Units {
  double length = 1, time = 1, mass = 1;  // m, s, kg

  double speed() const { return length / time; }
  double acceleration() const { return speed() / time; }
  double force() const { return mass * length / time / time; }
  double energy() const { return force() * length; }
  double stiffness() const { return force() / length; }
  double inertia() const { return mass * length * length; }
  double momentum() const { return mass * speed(); }
  double angular_momentum() const { return momentum() * length; }
};

/// The largest of finite values; 0 without any.
class Largest {
 public:
  void take(double value) {
    if (std::isfinite(value)) value_ = std::max(value_, value);
  }
  double value() const { return value_; }

 private:
  double value_ = 0;
};

}  // namespace tether::scene::mechanics

// Tether: units of fields, and units in which the numbers of a scene are near 1.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <string_view>

namespace tether::scene {

/// The unit of a field: its words in files and messages, its powers of kg, m and s.
struct Unit {
  std::string_view words = {};
  int mass = 0, length = 0, time = 0;
};

constexpr Unit kMetres{"m", 0, 1, 0}, kSpeed{"m/s", 0, 1, -1}, kTurning{"rad/s", 0, 0, -1},
    kAcceleration{"m/s^2", 0, 1, -2}, kForce{"N", 1, 1, -2}, kMoment{"N m", 1, 2, -2},
    kStiffness{"N/m", 1, 0, -2}, kDamping{"N s/m", 1, 0, -1}, kHertz{"Hz", 0, 0, -1};

/// SI for scenes of 1 mm to 1 km and of times of 1 ms to 1000 s; beyond, powers of 2 near the
/// scene's own length, time and mass, so that conversions are exact. Tolerances are absolute in
/// them.
struct Units {
  double length = 1, time = 1, mass = 1;  // m, s, kg

  double of(const Unit& unit) const {
    double out = 1;
    for (const auto& [base, power] :
         {std::pair(mass, unit.mass), std::pair(length, unit.length), std::pair(time, unit.time)})
      for (int k = 0; k < std::abs(power); ++k) out = power > 0 ? out * base : out / base;
    return out;
  }
  double speed() const { return length / time; }
  double force() const { return mass * length / time / time; }
  double energy() const { return force() * length; }
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

}  // namespace tether::scene

// Tether: the slip of a cable over a ring at which it rubs. SPDX-License-Identifier: BSD-3-Clause
//
// With the lengths L_1 before and L_2 behind the ring, the tensions T_1 and T_2 there, their mean
// T, the wrap angle beta and a pulley of radius r that turns with w about its axis u:
//
//   slip y' = L_2' - L_1' + winch - 2 r u.w       the cable feeds from its first end
//   x = (T_1 - T_2) / 2,  |x| <= T tanh(mu beta / 2),  x opposes y', and is the bound where it
//   slips
//
// which is e^(-mu beta) <= T_2 / T_1 <= e^(mu beta). T L' + x y' is the power of both tensions.
#pragma once

#include <map>

#include "cable_item.hpp"

namespace tether::scene::effects {

class CapstanSlip {
 public:
  /// `bodies`: at t = 0.
  CapstanSlip(const Spring& spring, std::size_t number, const Bodies& bodies);

  int cable() const { return static_cast<int>(item_.index); }  ///< of the scene's springs
  /// y' is rate() less this.
  double wanted() const { return -item_.winch; }
  double bound(const Bodies& bodies) const;
  double rate(const Bodies& bodies) const;
  /// The rate of rate() without accelerations of the bodies.
  double rest(const Bodies& bodies) const;
  /// The loads of x = 1: f(body, wrench) once for each body that moves.
  template <class F>
  void each_load(const Bodies& bodies, const F& f) const {
    std::map<int, Wrench<double>> loads;
    item_.each_wrench(
        bodies, [this](std::size_t k) { return sign(k); },
        [&](int body, const Wrench<double>& wrench) {
          Wrench<double>& sum = loads.try_emplace(body, no_wrench<double>()).first->second;
          sum.force += wrench.force;
          sum.torque += wrench.torque;
        });
    loads.at(ring().body).torque -=
        2 * law_.radius * (item_.frame(bodies, at(law_.ring)).R * axis_);
    for (const auto& [body, wrench] : loads)
      if (bodies.moves(body)) f(body, wrench);
  }

 private:
  const CablePoint& ring() const { return item_.points[at(law_.ring)]; }
  /// Sign of a piece: 1 before the ring, -1 behind it.
  double sign(std::size_t piece) const { return piece < at(law_.ring) ? 1 : -1; }

  CableItem item_;
  Capstan law_;
  Vector3d axis_;  // of the pulley, in axes of the ring's body
};

}  // namespace tether::scene::effects

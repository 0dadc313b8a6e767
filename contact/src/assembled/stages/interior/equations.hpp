// Tether: the equations that interior points solve. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "assembled/search/system.hpp"

namespace tether::contact::detail {

/// A point x, u or a step, in the frame where the cone is its own dual: (mu x_n, x_t) and
/// (u_n / mu, u_t), each with its gap from the cone.
struct ConePair {
  void resize(int contacts) {
    x.resize(at(contacts));
    u.resize(at(contacts));
  }
  Packed x, u;
};

/// to += step along, gaps without cancellation.
void advance(ConePair& to, const ConePair& along, double step);

/// A x - b = w(u), w = u - s(u) (mu, gamma), for x in K and u in K* (method, eq. 21); of the
/// proximal problem A + tau D, b + tau D anchor where tau > 0.
class InteriorEquations {
 public:
  void reset(int contacts);
  void find_flat(const System& system);
  /// mu = 0: x_n and u_n alone.
  bool flat(int i) const { return flat_[at(i)] != 0; }
  const std::vector<char>& flat() const { return flat_; }

  void set_anchor(const PackedVector* x) { std::copy(x, x + n_, anchor_.begin()); }
  const Packed& anchor() const { return anchor_; }
  /// 0: the problem itself.
  void set_tau(double tau) { tau_ = tau; }
  double tau() const { return tau_; }
  /// Velocities by long sums.
  void set_exact(bool exact) { exact_ = exact; }

  /// The residual r of a point, its impulses z and their velocities.
  void evaluate(const System& system, const ConePair& point);
  const Packed& residual() const { return r_; }
  const Packed& impulses() const { return z_; }
  /// Residual of the (proximal) problem at the impulses of the last evaluate().
  double natural_map(const System& system) const;
  /// The same at other impulses, which take their place.
  double natural_map(const System& system, const PackedVector* impulses);
  /// x.u / contacts, which falls to 0 on the way.
  double complementarity(const ConePair& point) const;

 private:
  void velocities(const System& system);

  int n_ = 0;
  double tau_ = 0;
  bool exact_ = false;
  std::vector<char> flat_;
  Packed anchor_, r_, z_, w_;
};

/// Slip variable: s = |u_t| wherever u lies on the cone, that is, for sliding contacts. Inside of
/// it only w_n > 0 matters, which holds for every 0 <= c < 1; c > 0 makes s smooth at u_t = 0.
constexpr double kSmooth = 0.5;
inline double slip_of(const double* u) {
  return std::sqrt(kSmooth * u[0] * u[0] + (1 - kSmooth) * (u[1] * u[1] + u[2] * u[2]));
}

/// w += f D x, D the diagonal block.
inline void add_block(const LocalBlock& L, double f, const double* x, double* w) {
  w[0] += f * (L.a * x[0] + L.c[0] * x[1] + L.c[1] * x[2]);
  w[1] += f * (L.c[0] * x[0] + L.T[0] * x[1] + L.T[1] * x[2]);
  w[2] += f * (L.c[1] * x[0] + L.T[1] * x[1] + L.T[2] * x[2]);
}

}  // namespace tether::contact::detail

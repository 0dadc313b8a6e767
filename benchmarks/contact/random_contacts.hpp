// Tether: random one-contact problems and an independent reference. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace tether::contact::random {

struct Contact {
  Eigen::Matrix3d A;
  Eigen::Vector3d b;
  double mu = 0;
};

inline const std::vector<std::string>& classes() {
  static const std::vector<std::string> names = {
      "condition_1e1", "condition_1e4", "condition_1e8", "condition_1e10", "boxes",   "rods",
      "hyperbolic",    "bn_to_zero",    "mu_zero",       "mu_1000",        "singular"};
  return names;
}

class Generator {
 public:
  explicit Generator(std::uint64_t seed) : engine_(seed) {}

  double uniform(double lo, double hi) { return lo + (hi - lo) * (engine_() >> 11) * 0x1p-53; }
  double normal() {
    return std::sqrt(-2 * std::log(1 - uniform(0, 1))) *
           std::cos(6.283185307179586 * uniform(0, 1));
  }
  Eigen::Vector3d vector() { return {normal(), normal(), normal()}; }
  Eigen::Matrix3d rotation();
  Eigen::Matrix3d spectrum(double condition);
  // One body with half sizes h, mass m, touched at a random point of its surface.
  Eigen::Matrix3d body(const Eigen::Vector3d& h, double m);

  Contact operator()(const std::string& kind);

 private:
  std::mt19937_64 engine_;
};

// The problem reduced to the plane w_n = 0: energy 1/2 y'By - h.y on the disc |y| <= mu (b_n - c.y)
// / a. Dense scan of the boundary with local refinement, and the interior minimum; shares nothing
// with the library. Energies are compared in long double: at condition 1e10 y'By cancels ten
// digits.
struct Reduced {
  using Wide = long double;
  using Matrix2 = Eigen::Matrix<Wide, 2, 2>;
  using Vector2 = Eigen::Matrix<Wide, 2, 1>;
  Matrix2 wide_B;
  Vector2 wide_h;
  Eigen::Matrix2d B;
  Eigen::Vector2d h, c;
  double a, bn, mu;
  explicit Reduced(const Contact& p);
  double energy(const Eigen::Vector2d& y) const;
  // Energies that are at stake: of y, and of the normal impulse.
  double scale(const Eigen::Vector2d& y) const;
  bool boundary(double angle, Eigen::Vector2d& y) const;
  double value(double angle) const;
  // Least energy of the admissible set, b_n > 0.
  double reference(int points) const;
};

// Condition that an answer of maximum_dissipation fails, or nullptr.
const char* failure(const Contact& p, const Eigen::Vector3d& x, int points);

}  // namespace tether::contact::random

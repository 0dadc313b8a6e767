// Tether: which momenta of a scene nothing outside changes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/scene.hpp>

namespace tether::scene::mechanics {

using Eigen::Vector3d;

/// Directions u through the origin about which nothing outside exerts a torque.
class FreeAxes {
 public:
  /// Only the direction u is left, if it was there.
  void only(const Vector3d& u, const std::string& because) {
    // A product with no columns at all reads from a null pointer, by an offset.
    if (basis_.cols() > 0) {
      const Vector3d inside = basis_ * (basis_.transpose() * u);
      if ((inside - u).norm() < 1e-9 * u.norm())
        basis_ = u.normalized();
      else
        none(because);
    }
    if (reason_.empty()) reason_ = because;
  }
  void none(const std::string& because) {
    if (basis_.cols() > 0) reason_ = because;
    basis_.resize(3, 0);
  }
  const Eigen::Matrix<double, 3, Eigen::Dynamic>& basis() const { return basis_; }  ///< 3 x k
  const std::string& reason() const { return reason_; }

 private:
  Eigen::Matrix<double, 3, Eigen::Dynamic> basis_ = Eigen::Matrix3d::Identity();
  std::string reason_;
};

/// The change that an effect causes in momentum and in angular momentum about the origin.
struct Momenta {
  explicit Momenta(const Scene& of) : scene(of) {}

  const Scene& scene;
  FreeAxes axes;
  Vector3d steady_force = Vector3d::Zero();  ///< momentum grows by it, N
  std::string pushed_by;                     ///< the first other force from outside; empty: none

  /// -1, the world, and fixed bodies.
  bool is_outside(int body) const { return !scene.moves(body); }
  bool holds_outside(int first, int second) const {
    return is_outside(first) || is_outside(second);
  }
  void push(const std::string& what) {
    if (pushed_by.empty()) pushed_by = what;
  }
  /// A force through the point p leaves the axis from the origin to it, or all if p is the origin.
  void force_through(const Vector3d& p, double origin, const std::string& because) {
    if (p.norm() > origin) axes.only(p.normalized(), because);
  }
};

}  // namespace tether::scene::mechanics

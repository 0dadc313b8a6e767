// Tether: one contact with rolling and torsional friction. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/bodies.hpp>
#include <tether/contact/one_contact.hpp>

namespace tether::contact::detail {

/// Rows: normal and two tangents of the velocity, then the same of the angular velocity times a
/// length by which both halves of A have the same size.
struct RollingBlock {
  Matrix6d A = Matrix6d::Zero();
  LocalBlock forces;
  double mu = 0, spin = 0, roll = 0;  // bounds over x_n; of moments over that length

  RollingBlock() = default;
  RollingBlock(const Matrix6d& matrix, double friction, double torsional, double rolling);

  /// How far x is from the law where its velocity is w: by parts, as a velocity.
  double residual(const Vector6d& x, const Vector6d& w) const;
  /// Improves x until the law holds to round-off for w = A x - b. Returns the residual.
  double solve(const Vector6d& b, Vector6d& x) const;

 private:
  void sweep(const Vector6d& b, Vector6d& x) const;
  bool newton_step(const Vector6d& b, Vector6d& x) const;
};

/// min 1/2 y.B y - h.y over |y| <= r.
Eigen::Vector2d in_disc(const Eigen::Matrix2d& B, const Eigen::Vector2d& h, double r);

}  // namespace tether::contact::detail

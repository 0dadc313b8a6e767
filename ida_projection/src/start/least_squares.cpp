// Tether: y' and algebraic variables consistent with F. SPDX-License-Identifier: BSD-3-Clause
#include "start/least_squares.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <tether/linalg/least_squares.hpp>

#include "host/owned_vector.hpp"

namespace tether::ida_projection {

Status consistent_derivative(IDAResFn residual, void* user_data, double t, N_Vector y, N_Vector yp,
                             N_Vector id, N_Vector weights, int maximum_iterations) {
  const auto n = static_cast<Eigen::Index>(N_VGetLength(y));
  OwnedVector y_new(y), yp_new(yp), F(y), F_shifted(y);
  N_VScale(1.0, y, y_new);
  N_VScale(1.0, yp, yp_new);
  double* values = N_VGetArrayPointer(y_new);
  double* slopes = N_VGetArrayPointer(yp_new);
  const double* mask = static_cast<N_Vector>(id) != nullptr ? N_VGetArrayPointer(id) : nullptr;
  const double* w = N_VGetArrayPointer(weights);
  const auto unknown = [&](Eigen::Index j) -> double& {
    return mask != nullptr && mask[j] == 0.0 ? values[j] : slopes[j];
  };
  Status failure = Status::not_converged;
  const auto evaluate = [&](N_Vector into) {
    const int flag = residual(t, y_new, yp_new, into, user_data);
    if (flag < 0) failure = Status::callback_fatal;
    return flag == 0;
  };
  const auto as_vector = [&](N_Vector v) {
    return Eigen::Map<Eigen::VectorXd>(N_VGetArrayPointer(v), n);
  };

  if (!evaluate(F)) return failure;
  Eigen::MatrixXd J(n, n);
  double previous = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < maximum_iterations; ++iteration) {
    Eigen::VectorXd scale(n);
    for (Eigen::Index j = 0; j < n; ++j) {
      double& z = unknown(j);
      scale[j] = std::max({std::abs(z), w[j] > 0.0 ? 1.0 / w[j] : 0.0, 1e-12});
      const double kept = z;
      z = kept + std::sqrt(std::numeric_limits<double>::epsilon()) * scale[j];
      const double increment = z - kept;
      if (!evaluate(F_shifted)) return failure;
      J.col(j) = (as_vector(F_shifted) - as_vector(F)) / increment * scale[j];
      z = kept;
    }
    // Rows of F have their own units: each is scaled by its largest entry.
    Eigen::VectorXd rows = J.rowwise().lpNorm<Eigen::Infinity>();
    for (Eigen::Index i = 0; i < n; ++i) rows[i] = rows[i] > 0.0 ? 1.0 / rows[i] : 1.0;
    linalg::LeastSquares factors(1e-7);  // differences carry about half the digits
    factors.factor(rows.asDiagonal() * J);
    const Eigen::VectorXd dz = factors.solve(rows.cwiseProduct(as_vector(F)));
    if (!dz.allFinite()) return failure;
    for (Eigen::Index j = 0; j < n; ++j) unknown(j) -= scale[j] * dz[j];
    if (!evaluate(F)) return failure;
    const double left = rows.cwiseProduct(as_vector(F)).lpNorm<Eigen::Infinity>();
    // dz is relative to the size of the unknowns: stop when it is rounding, or no longer shrinks.
    const double change = dz.lpNorm<Eigen::Infinity>();
    const bool small = change <= 1e-12 || (change <= 1e-7 && change >= 0.3 * previous);
    if (small) {
      if (!(left <= 1e-6)) return failure;  // F = 0 has no solution near
      N_VScale(1.0, y_new, y);
      N_VScale(1.0, yp_new, yp);
      return Status::success;
    }
    previous = change;
  }
  return failure;
}

}  // namespace tether::ida_projection

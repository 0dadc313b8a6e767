// Tether: rows and their gradients at a point, for the peers' own projections.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Dense>
#include <problems/problem.hpp>

namespace tether::bench {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// g and C = dg/dy of rows that were joined with `+`; all of them with dense Jacobians.
inline void evaluate_rows(const ida_projection::Constraints& rows, double t,
                          const Eigen::VectorXd& y, Eigen::VectorXd& g, RowMajor& C) {
  g.resize(rows.total_count());
  C.setZero(rows.total_count(), y.size());
  Eigen::Index first = 0;
  const auto one = [&](const ida_projection::Constraints& part) {
    part.value(t, ida_projection::ConstVector(y.data(), y.size()),
               ida_projection::Vector(g.data() + first, part.count));
    std::get<ida_projection::DenseJacobian>(part.jacobian)
        .fill(t, ida_projection::ConstVector(y.data(), y.size()),
              ida_projection::Matrix(C.data() + first * y.size(), part.count, y.size()));
    first += part.count;
  };
  one(rows);
  for (const auto& part : rows.joined) one(part);
}

}  // namespace tether::bench

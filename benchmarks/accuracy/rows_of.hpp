// Tether: rows and their gradients at a point, for the peers' own projections.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Dense>
#include <problems/dual.hpp>

namespace tether::bench {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// f(rows, index of their first row) for each of the sets that were joined with `+`.
template <class F>
void each_part(const ida_projection::Constraints& rows, F f) {
  Eigen::Index first = 0;
  f(rows, first);
  first += rows.count;
  for (const auto& part : rows.joined) {
    f(part, first);
    first += part.count;
  }
}

/// g of joined rows; g has their total count.
inline void evaluate_values(const ida_projection::Constraints& rows, double t,
                            const Eigen::VectorXd& y, Eigen::VectorXd& g) {
  each_part(rows, [&](const ida_projection::Constraints& part, Eigen::Index first) {
    part.value(t, ida_projection::ConstVector(y.data(), y.size()),
               ida_projection::Vector(g.data() + first, part.count));
  });
}

/// g and C = dg/dy; C is total count x N.
inline void evaluate_rows(const ida_projection::Constraints& rows, double t,
                          const Eigen::VectorXd& y, Eigen::VectorXd& g, RowMajor& C) {
  evaluate_values(rows, t, y, g);
  C.setZero();
  each_part(rows, [&](const ida_projection::Constraints& part, Eigen::Index first) {
    problems::write_jacobian(part, t, ida_projection::ConstVector(y.data(), y.size()),
                             C.data() + first * y.size());
  });
}

}  // namespace tether::bench

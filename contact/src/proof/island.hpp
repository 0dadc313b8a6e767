// Tether: an island of a contact problem in units near 1. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <stdexcept>
#include <string>
#include <tether/contact/problem.hpp>
#include <tether/linalg/index.hpp>
#include <vector>

#include "proof/interval.hpp"

namespace tether::contact::detail {

using linalg::at;

/// Contact i has x_i 2^-impulse[i] for its impulses and w_i 2^-velocity[i] for its velocities: A's
/// diagonal and the largest impulse are near 1, and powers of two change no digit.
struct ProofIsland {
  int dimension = 3;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> A;
  Eigen::VectorXd b, mu, x;
  std::vector<int> impulse, velocity;

  int contacts() const { return static_cast<int>(mu.size()); }
};

/// A number of this contact would leave the range of doubles.
struct OutOfRange : std::range_error {
  OutOfRange(int of, const std::string& what) : std::range_error(what), contact(of) {}
  int contact;
};

/// Throws OutOfRange.
ProofIsland proof_island(const Problem& problem, const linalg::VectorView& impulses);

/// All points within `radius` of x, component by component.
struct Box {
  Eigen::VectorXd x, radius;

  Interval operator[](Eigen::Index row) const { return Interval::around(x[row], radius[row]); }
};

/// w = A x - b over a box.
struct Velocities {
  Velocities(const ProofIsland& island, const Box& box);

  std::vector<Interval> w;
  double size = 0;  ///< the largest |A| |x| + |b| of a row
};

/// |x_t| of a contact whose components begin at `x`.
Interval tangent_length(const Interval* x, int dimension);

}  // namespace tether::contact::detail

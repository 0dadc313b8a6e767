// Tether: the rows of a block of a problem over cones. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/bodies.hpp>
#include <tether/contact/cones.hpp>

namespace tether::contact::detail {

// A velocity below this part of the terms whose difference it is counts as zero.
constexpr double kSlip = 1e-12;

/// Places of the rows of a contact, counted from its normal; -1: it has no such row.
struct ConeParts {
  int tangents = 0;             ///< rows 1 .. tangents
  int spin = -1, rolling = -1;  ///< moment about the normal; first of two across it
};

constexpr bool is_contact(Cone::Kind kind) {
  return kind == Cone::Kind::nonnegative || kind >= Cone::Kind::planar;
}

constexpr ConeParts parts_of(Cone::Kind kind) {
  switch (kind) {
    case Cone::Kind::planar:
      return {1, -1, -1};
    case Cone::Kind::friction:
      return {2, -1, -1};
    case Cone::Kind::torsional:
      return {2, 3, -1};
    case Cone::Kind::rolling:
      return {2, -1, 3};
    case Cone::Kind::rolling_torsional:
      return {2, 3, 4};
    case Cone::Kind::free:
    case Cone::Kind::nonnegative:
    case Cone::Kind::bounded:
      break;
  }
  return {};
}

/// Calls f(first row, number of rows) for each part of a cone whose length is bounded: friction,
/// moments, a motor.
template <class F>
void each_part(Cone::Kind kind, const F& f) {
  const ConeParts parts = parts_of(kind);
  if (kind == Cone::Kind::bounded) f(0, 1);
  if (parts.tangents > 0) f(1, parts.tangents);
  if (parts.spin >= 0) f(parts.spin, 1);
  if (parts.rolling >= 0) f(parts.rolling, 2);
}

/// Bound of the part that begins at row `from`, at a normal impulse.
inline double bound_of(const Cone& cone, int from, double normal) {
  const ConeParts parts = parts_of(cone.kind);
  return from == 0               ? cone.bound
         : from == parts.spin    ? cone.torsional * normal
         : from == parts.rolling ? cone.rolling * normal
                                 : cone.mu * normal;
}

/// Throws std::invalid_argument on entries outside of a matrix and on those that are not finite.
void check_entries(const char* matrix, const std::vector<MatrixEntry>& entries, Eigen::Index rows,
                   Eigen::Index columns);
/// Diagonal block of A: `size` rows from `row`; the rest of the result is zero.
Matrix6d diagonal_block(const ConeProblem& problem, int row, int size);

/// For each block the first block of its island. Nonzero entries of A connect blocks.
std::vector<int> islands(const ConeProblem& problem);

/// Velocity scale of a block (method, section 3): the change of velocity that its b demands, times
/// row_scale().
double needed_change(const ConeProblem& problem, int block);

/// Throws std::invalid_argument unless `law` is defined for every cone of the problem.
void require_law(const ConeProblem& problem, Law law);

}  // namespace tether::contact::detail

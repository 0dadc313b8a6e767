// Tether: the rows of a block of a problem over cones. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/bodies.hpp>
#include <tether/contact/cones.hpp>

namespace tether::contact::detail {

/// Rows of a cone of contact, counted from its first: -1 where it has none.
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
    default:
      return {};
  }
}

/// A of `size` rows from `row`, the rest zero.
Matrix6d diagonal_block(const ConeProblem& problem, int row, int size);

/// Velocity that a block has to change on its own, times row_scale()
/// (method, section 8).
double needed_change(const ConeProblem& problem, int block);

/// Throws std::invalid_argument unless `law` says something of every cone.
void require_law(const ConeProblem& problem, Law law);

}  // namespace tether::contact::detail

// Tether: rows of joints on velocities. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/bodies.hpp>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// Bilateral constraints on velocities, whose impulse x may have either sign,
///
///     sum over bodies of G v  =  rate,
///
/// G (1 x 6) the row on the velocity (linear, angular about the centre, world axes) of one body.
/// The impulse acts on that body as G' x. Keeps its storage when it is filled anew.
class JointRows {
 public:
  /// The part of one body in a row.
  struct Term {
    int body;    ///< index, >= 0
    Vector6d G;  ///< on its velocity: linear, then angular
  };

  void clear();  ///< removes all rows
  /// Starts a row of joint number `joint` (used in messages). rate: velocity of a prescribed
  /// motion. Throws std::invalid_argument unless it is finite.
  void add(int joint, double rate = 0);
  /// Adds the term G v of one more body to the row added last; body -1, the world, is ignored.
  void on(int body, const Vector6d& G);

  int count() const { return static_cast<int>(rate_.size()); }  ///< number of rows
  /// Number of the joint that a row belongs to.
  int joint(int row) const { return joint_[static_cast<std::size_t>(row)]; }
  /// Right-hand side of a row, m/s or rad/s.
  double rate(int row) const { return rate_[static_cast<std::size_t>(row)]; }
  /// The terms of a row: begin(row) .. end(row) - 1.
  const Term* begin(int row) const { return terms_.data() + start_[static_cast<std::size_t>(row)]; }
  /// Behind the last of them.
  const Term* end(int row) const {
    return terms_.data() + start_[static_cast<std::size_t>(row) + 1];
  }

 private:
  std::vector<int> start_{0}, joint_;
  std::vector<double> rate_;
  std::vector<Term> terms_;
};

}  // namespace tether::contact
TETHER_EXPORT_END

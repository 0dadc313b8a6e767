// Tether: rolling and torsional friction of contacts on mechanisms. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/contact/bodies.hpp>
#include <tether/contact/body_solver.hpp>
#include <vector>

#include "joints/mechanisms.hpp"

namespace tether::contact::detail {

/// A moment is a contact (own, row, row) of mu = its length, whose normal impulse is that of the
/// contact that holds it (README, section 21): |moment| <= length x_n.
class MomentRows {
 public:
  void clear() { rows_.clear(); }
  int count() const { return static_cast<int>(rows_.size()); }

  /// The moments of contact number `main` of `rows`, as further rows, with their own mobilities and
  /// the impulses that they start from. last: moment on `first`, world axes, N m s.
  void add(const PointContact& contact, double rolling, double torsional, int main,
           const Mechanisms& mechanisms, std::vector<ContactRows>& rows);
  /// Contact whose normal impulse moment k has.
  int main(int k) const { return rows_[at(k)].main; }
  Eigen::Vector3d own(int k) const { return {0, 0, rows_[at(k)].unused}; }
  Eigen::Vector3d start(int k, double normal, const Eigen::Vector3d& moment) const;
  /// On `first`, in world axes, of its impulse in the contact frame.
  Eigen::Vector3d moment(int k, const Eigen::Vector3d& x) const;

 private:
  struct Row {
    int main;
    double length, unused;             // m; mobility of the direction that no body moves in
    Eigen::Matrix<double, 2, 3> axes;  // of the two tangents
  };
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  std::vector<Row> rows_;
};

}  // namespace tether::contact::detail

// Tether: rolling and torsional friction of contacts on mechanisms. SPDX-License-Identifier:
// BSD-3-Clause
#include "joints/moment_rows.hpp"

#include <cmath>

namespace tether::contact::detail {

using Eigen::Vector3d;

void MomentRows::add(const PointContact& contact, double rolling, double torsional, int main,
                     const Mechanisms& mechanisms, std::vector<ContactRows>& rows) {
  if (!(rolling > 0 || torsional > 0)) return;
  const ContactRows of = rows[at(main)];
  double moved = 0, turned = 0;
  const auto add = [&](int body, const Matrix36d& J) {
    if (body < 0 || !mechanisms.moves(body)) return;
    moved += (J * mechanisms.root(body)).squaredNorm();
    turned += mechanisms.root(body).bottomRows<3>().squaredNorm();
  };
  add(of.first, of.J1);
  add(of.second, of.J2);
  if (!(turned > 0)) return;
  const Eigen::Matrix3d frame = tangent_frame(contact.normal);
  // At which moments move as much as forces do.
  const double length = std::sqrt(moved / turned);
  const auto put = [&](double bound, const Vector3d& first, const Vector3d& second) {
    ContactRows row;
    row.first = of.first;
    row.second = of.second;
    row.mu = bound / length;
    Row each{main, length, second.isZero(0) ? moved : 0, {}};
    each.axes.row(0) = first.transpose();
    each.axes.row(1) = second.transpose();
    row.J1.bottomRightCorner<2, 3>() = length * each.axes;
    row.J2.bottomRightCorner<2, 3>() = -length * each.axes;
    rows.push_back(row);
    rows_.push_back(each);
  };
  if (rolling > 0) put(rolling, frame.row(1).transpose(), frame.row(2).transpose());
  if (torsional > 0) put(torsional, frame.row(0).transpose(), Vector3d::Zero());
}

Vector3d MomentRows::start(int k, double normal, const Vector3d& moment) const {
  const Eigen::Vector2d x = rows_[at(k)].axes * moment / rows_[at(k)].length;
  return {normal, x[0], x[1]};
}

Vector3d MomentRows::moment(int k, const Vector3d& x) const {
  return rows_[at(k)].length * (rows_[at(k)].axes.transpose() * x.tail<2>());
}

}  // namespace tether::contact::detail

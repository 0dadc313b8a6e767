// Tether: limits, motors and friction of joints as contacts of the event engine.
// SPDX-License-Identifier: BSD-3-Clause
#include "law_contacts.hpp"

namespace tether::scene::event {

LawContacts::LawContacts(const Scene& scene, const mechanics::Bodies& bodies)
    : laws_(scene, bodies) {
  contact::JointLaws all;
  laws_.add(bodies, all);
  for (int law = 0; law < all.count(); ++law) {
    const contact::JointLaws::Law& from = all[law];
    if (from.is_sprung() || (!from.limit && from.bound == 0)) continue;
    Entry each{law, {}, 0, 0};
    if (from.limit) {
      each.of.restitution = from.restitution;
      each.gap_at_zero = from.gap - laws_.sign(law) * laws_.value(law, bodies);
    } else {
      each.of.friction = 1;
      each.of.bound = from.bound;
      each.wanted = from.rate;
    }
    list_.push_back(each);
  }
}

double LawContacts::gap(int k, const mechanics::Bodies& bodies, double& rate) const {
  const Entry& each = at_place(k);
  rate = 0;
  if (each.of.is_bounded()) return 0;
  const double sign = laws_.sign(each.law);
  rate = sign * laws_.coordinate(each.law).rate(bodies);
  return each.gap_at_zero + sign * laws_.value(each.law, bodies);
}

void LawContacts::look(int k, const mechanics::Bodies& bodies, ContactLook& out) const {
  const Entry& each = at_place(k);
  const joints::Coordinate& s = laws_.coordinate(each.law);
  const double sign = laws_.sign(each.law);
  const int velocities = 6 * bodies.moving;
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(velocities);
  mechanics::Wrench<double> on[2];
  s.gradient(bodies, on[0], on[1]);
  const int body[2] = {s.first(), s.second()};
  for (int side = 0; side < 2; ++side) {
    const int slot = bodies.inertia[mechanics::at(body[side])].slot;
    if (slot < 0) continue;
    const Eigen::Matrix3d& R = bodies.frames[mechanics::at(body[side])].R;
    row.segment<3>(6 * slot) += sign * on[side].force.transpose();
    row.segment<3>(6 * slot + 3) += sign * (R.transpose() * on[side].torque).transpose();
  }
  out.gap = gap(k, bodies, out.normal_rate);
  out.normal.setZero(velocities);
  out.tangents.setZero(2, velocities);
  out.slip_rate.setZero(2);
  out.slip_rest.setZero(2);
  out.normal_rate = out.normal_rest = 0;
  if (each.of.is_bounded()) {
    out.tangents.row(0) = row;
    out.slip_rate[0] = -each.wanted;
    out.slip_rest[0] = sign * s.rest(bodies);
  } else {
    out.normal = row;
    out.normal_rest = sign * s.rest(bodies);
  }
}

Eigen::Vector3d LawContacts::direction(int k, const mechanics::Bodies& bodies) const {
  const int law = at_place(k).law;
  return laws_.sign(law) * laws_.coordinate(law).direction(bodies);
}

}  // namespace tether::scene::event

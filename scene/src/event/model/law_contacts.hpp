// Tether: laws of joints and cables as contacts of the event engine. SPDX-License-Identifier:
// BSD-3-Clause
//
// A limit is a contact without friction: its gap is the way to it. A motor or the friction of a
// joint is one without a gap that slides where its speed is not the wanted one, against the bound,
// and sticks where it is, with any force up to the bound. In the parts of a contact (normal,
// tangents) a limit has the first alone, a bounded law the second.
#pragma once

#include "contact_law.hpp"
#include "joints/coordinate.hpp"

namespace tether::scene::event {

class LawContacts {
 public:
  /// `bodies`: at t = 0. Laws with a bound of 0 are none.
  LawContacts(const Scene& scene, const mechanics::Bodies& bodies) : laws_(scene, bodies) {
    contact::JointLaws all;
    laws_.add(bodies, all);
    for (int law = 0; law < all.count(); ++law) {
      const contact::JointLaws::Law& from = all[law];
      const bool rubs = laws_.slip(law) != nullptr;
      if (from.is_sprung() || (!from.is_limit() && !rubs && from.bound == 0)) continue;
      Entry each{law, {}, 0, 0};
      if (from.is_limit()) {
        each.of.restitution = from.restitution;
        each.gap_at_zero = from.gap - laws_.sign(law) * laws_.value(law, bodies);
      } else {
        each.of.friction = 1;
        each.of.kind = ContactLaw::Kind::bounded;
        each.of.bound = from.bound;
        each.wanted = from.rate;
      }
      list_.push_back(each);
    }
  }

  int count() const { return static_cast<int>(list_.size()); }
  const joints::JointLaws& all() const { return laws_; }
  int place(int k) const { return at_place(k).law; }  ///< in all()
  /// Cables rub by their tension.
  ContactLaw law(int k, const mechanics::Bodies& bodies) const {
    ContactLaw of = at_place(k).of;
    if (const auto* slip = laws_.slip(place(k))) of.bound = slip->grip(bodies).bound();
    return of;
  }
  double gap(int k, const mechanics::Bodies& bodies, double& rate) const {
    const Entry& each = at_place(k);
    rate = 0;
    if (each.of.is_bounded()) return 0;
    const double sign = laws_.sign(each.law);
    rate = sign * laws_.coordinate(each.law).rate(bodies);
    return each.gap_at_zero + sign * laws_.value(each.law, bodies);
  }
  void evaluate_contact(int k, const mechanics::Bodies& bodies, ContactKinematics& out) const {
    const Entry& each = at_place(k);
    const int velocities = 6 * bodies.moving;
    Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(velocities);
    laws_.each_load(each.law, bodies, [&](int body, const mechanics::Wrench<double>& on) {
      const int slot = bodies.inertia[mechanics::at(body)].slot;
      const Eigen::Matrix3d& R = bodies.frames[mechanics::at(body)].R;
      row.segment<3>(6 * slot) += on.force.transpose();
      row.segment<3>(6 * slot + 3) += on.torque.transpose() * R;
    });
    const effects::CapstanSlip* slip = laws_.slip(each.law);
    const double rest =
        slip ? slip->rest(bodies) : laws_.sign(each.law) * laws_.coordinate(each.law).rest(bodies);
    out.gap = gap(k, bodies, out.normal_rate);
    out.normal.setZero(velocities);
    out.tangents.setZero(2, velocities);
    out.slip_rate.setZero(2);
    out.slip_rest.setZero(2);
    out.normal_rate = out.normal_rest = 0;
    if (each.of.is_bounded()) {
      out.tangents.row(0) = row;
      out.slip_rate[0] = -each.wanted;
      out.slip_rest[0] = rest;
    } else {
      out.normal = row;
      out.normal_rest = rest;
    }
  }
  /// Zero of a cable.
  Eigen::Vector3d direction(int k, const mechanics::Bodies& bodies) const {
    const int law = at_place(k).law;
    if (laws_.slip(law)) return Eigen::Vector3d::Zero();
    return laws_.sign(law) * laws_.coordinate(law).direction(bodies);
  }

 private:
  struct Entry {
    int law;
    ContactLaw of;
    double gap_at_zero, wanted;  // of the coordinate; a speed
  };
  const Entry& at_place(int k) const { return list_[static_cast<std::size_t>(k)]; }

  joints::JointLaws laws_;
  std::vector<Entry> list_;
};

}  // namespace tether::scene::event

// Tether: laws of joints and cables as contacts of the event engine. SPDX-License-Identifier:
// BSD-3-Clause
//
// A limit is a contact without friction: its gap is the way to it. A motor or the friction of a
// joint is one without a gap that slides where its speed is not the wanted one, against the bound,
// and sticks where it is, with any force up to the bound. In the parts of a contact (normal,
// tangents) a limit has the first alone, a bounded law the second.
#pragma once

#include "joints/coordinate.hpp"
#include "model.hpp"

namespace tether::scene::event {

class LawContacts {
 public:
  /// `bodies`: at t = 0. Laws with a bound of 0 are none.
  LawContacts(const Scene& scene, const mechanics::Bodies& bodies);

  int count() const { return static_cast<int>(list_.size()); }
  const joints::JointLaws& all() const { return laws_; }
  int place(int k) const { return at_place(k).law; }  ///< in all()
  /// Cables rub by their tension.
  ContactLaw law(int k, const mechanics::Bodies& bodies) const {
    ContactLaw of = at_place(k).of;
    if (const auto* slip = laws_.slip(place(k))) of.bound = slip->grip(bodies).bound();
    return of;
  }
  double gap(int k, const mechanics::Bodies& bodies, double& rate) const;
  void evaluate_contact(int k, const mechanics::Bodies& bodies, ContactKinematics& out) const;
  /// Zero of a cable.
  Eigen::Vector3d direction(int k, const mechanics::Bodies& bodies) const;

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

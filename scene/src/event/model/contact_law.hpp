// Tether: a contact as the event engine sees it. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <tether/linalg/index.hpp>

namespace tether::scene::event {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using linalg::at;

constexpr int kTangents = 2;  // of a contact

/// One potential contact at the state that the model is set to. `u`: the velocities of the model.
struct ContactKinematics {
  double gap = 0;                           ///< m; < 0: penetration
  Eigen::RowVectorXd normal;                ///< gap' = normal u + normal_rate
  double normal_rate = 0, normal_rest = 0;  ///< gap'' = normal u' + normal_rest
  MatrixXd tangents;                        ///< slip = tangents u + slip_rate
  VectorXd slip_rate, slip_rest;            ///< slip' = tangents u' + slip_rest
};

/// Newton's restitution and Coulomb's friction of one contact.
struct ContactLaw {
  double friction = 0, restitution = 0;
  enum class Kind : unsigned char {
    contact,
    conveying,  ///< one of its surfaces moves on its body
    bounded,    ///< without a gap: a motor or the friction of a joint, along the first tangent
    rolling,    ///< a moment without a gap, across the normal of `held_by`, along both tangents
    spinning    ///< the same about that normal, along the first tangent
  } kind = Kind::contact;
  double bound = 0;  ///< of a bounded one: always its normal force; friction is 1 then
  int held_by = -1;  ///< of a moment: the contact whose normal force it has; friction is a length

  bool is_bounded() const { return kind == Kind::bounded; }
  bool is_moment() const { return kind >= Kind::rolling; }
  bool has_normal() const { return kind < Kind::bounded; }
  bool is_line() const { return is_bounded() || kind == Kind::spinning; }  ///< one tangent only
};

/// The force of a bounded law that sticks, or the sign of that of one that slides; else 0.
struct LawForce {
  double held = 0, slides = 0;
};

}  // namespace tether::scene::event

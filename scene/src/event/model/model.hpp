// Tether: a mechanical system with contacts, as the event engine sees it. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <tether/linalg/index.hpp>
#include <vector>

#include "bounds.hpp"

namespace tether::scene::event {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using linalg::at;

/// One potential contact at the state that is set. `u`: the velocities of the model.
struct ContactKinematics {
  double gap = 0;                           ///< m; < 0: penetration
  Eigen::RowVectorXd normal;                ///< gap' = normal u + normal_rate
  double normal_rate = 0, normal_rest = 0;  ///< gap'' = normal u' + normal_rest
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>
      tangents;                   ///< slip = tangents u + slip_rate
  VectorXd slip_rate, slip_rest;  ///< slip' = tangents u' + slip_rest
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

/// q' = N(q) u, M(q) u' = h(t, q, u) + joints + contacts. Everything is asked of the state that was
/// set last. One call treats the whole system.
class Model {
 public:
  virtual ~Model() = default;

  virtual int coordinates() const = 0;
  virtual int velocities() const = 0;
  /// Velocities of each body. Bodies that no row connects are solved apart.
  virtual int velocity_block() const { return velocities(); }
  virtual int coordinate_block() const { return coordinates(); }
  virtual int joint_rows() const = 0;
  virtual int contacts() const = 0;
  virtual int tangents() const = 0;  ///< of a contact: 1 in the plane, 2 in space
  virtual ContactLaw law(int contact) const = 0;
  /// The coefficient of friction without slip: that of the law, or a larger one.
  virtual double holding(int contact) const { return law(contact).friction; }
  /// Whether the bound of a law depends on the forces of others, which also have such bounds.
  virtual bool shares_bound(int /*contact*/) const { return false; }
  /// The bounds of those, by contact, which are affine in the forces that are held. `loaded`: 1; 0:
  /// the part of these forces.
  virtual void share_bounds(double /*loaded*/, const std::vector<LawForce>& /*forces*/,
                            std::vector<double>& /*bounds*/) const {}
  /// Sizes of coordinates, velocities and energy: tolerances are relative to them where values are
  /// smaller. 1 in units in which these are near 1.
  virtual VectorXd sizes() const { return VectorXd::Ones(coordinates() + velocities() + 1); }

  virtual double time_unit() const { return 1; }    ///< s, for what users read
  virtual double length_unit() const { return 1; }  ///< m, likewise

  /// y: q, then u.
  virtual void set(double t, const double* y) = 0;
  /// The first time after t at which forces have a kink or jump; infinite: there is none.
  virtual double next_kink(double /*t*/) const { return kInfinity; }
  /// Motion begins anew at t: forces that jump then have jumped.
  virtual void begin_anew(double /*t*/) {}
  /// A smooth phase begins at the state that is set: tangents turn smoothly from here on.
  virtual void settle() {}
  /// The coordinate axis, 0 to 2, from which the tangents of a contact are chosen. It depends on
  /// earlier phases, so saved states contain it.
  virtual int axis(int /*contact*/) const { return 0; }
  virtual void set_axis(int /*contact*/, int /*axis*/) {}
  virtual void rates(double* q_rate) const = 0;
  /// X <- M^-1 X, `velocities()` rows.
  virtual void divide_by_mass(Eigen::Ref<MatrixXd> X) const = 0;
  /// Forces without joints and contacts, gyroscopic ones included.
  virtual void forces(VectorXd& h) = 0;
  /// g, and with W: g' = W u + rate, g'' = W u' + rest.
  virtual void joints(VectorXd& g, MatrixXd& W, VectorXd& rate, VectorXd& rest) = 0;
  virtual std::string joint_name(int /*row*/) const { return "a joint"; }
  virtual std::string contact_name(int /*contact*/) const { return "a contact"; }
  virtual void evaluate_contact(int contact, ContactKinematics& out) = 0;
  virtual double gap(int contact, double& rate) = 0;  ///< and its rate

  /// Whether the bodies are surely further apart than `by`: spheres around them do not meet. The
  /// gap of such a contact is not needed.
  virtual bool is_apart(int /*contact*/, double /*by*/) { return false; }

  /// Rate, 1/s, at which the bodies pass each other: relative speed over the sum of their reaches.
  /// 0: one of them is unbounded.
  virtual double passes(int /*contact*/) { return 0; }

  /// How far the contact is inside the border of its features, m; infinite: they have none.
  virtual double margin(int /*contact*/) { return kInfinity; }

  /// Why the contact cannot be decided about at the state that is set; empty: it can.
  virtual std::string undecided(int /*contact*/) { return {}; }

  /// Whether both contacts are of one point of the same two bodies, with other normals: on the edge
  /// or at the corner of a face, within `distance`, m.
  virtual bool are_at_one_edge(int /*contact*/, int /*other*/, double /*distance*/) {
    return false;
  }

  /// Whether both are the same contact by two pairs of features: of one point, within `distance`,
  /// m, of the same two bodies, with one normal. (Corners of equal boxes that stand on each other.)
  virtual bool are_one(int contact, int other, double /*distance*/) { return contact == other; }

  /// A vector of a contact by its normal and tangents, in world axes.
  virtual Eigen::Vector3d in_space(int /*contact*/, const VectorXd& /*parts*/) {
    return Eigen::Vector3d::Zero();
  }

  /// The gradient by the coordinates of what has the velocity gradient `row`.
  virtual void to_coordinates(const double* row, double* gradient) const = 0;
  /// Rows that the coordinates obey by themselves, such as the length of a quaternion.
  virtual int own_rows() const { return 0; }
  virtual void own_values(double*) const {}
  virtual void own_gradient(int /*row*/, double* /*q_gradient*/) const {}

  virtual double energy() const = 0;  ///< kinetic and potential, J
  /// Gradients of the energy: by velocities, and of the potential by coordinates.
  virtual void energy_gradient(double* by_q, double* by_u) const = 0;
  /// Whether forces without potential or driven joints may do work.
  virtual bool does_work() const { return false; }
  /// Power of forces without potential, W.
  virtual double power() const { return 0; }
};

}  // namespace tether::scene::event

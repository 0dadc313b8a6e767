// Tether: the bodies, joints, forces and contacts of a scene as a model of the event engine.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "effects/list.hpp"
#include "features.hpp"
#include "joints/joint_rows.hpp"
#include "law_contacts.hpp"
#include "mechanics/force.hpp"
#include "smooth/rows/moving_bodies.hpp"

namespace tether::scene::event {

/// q' = N(q) u, M(q) u' = h(t, q, u) + joints + contacts. Coordinates q: x and the quaternion
/// (wxyz) of each moving body, by slot. Velocities u: v in world axes and w in body axes.
/// Everything is asked of the state that was set last. One call treats the whole system.
class Model {
 public:
  /// Throws std::invalid_argument, naming what the engine does not have; see potential_contacts.
  /// `time_unit`, `length_unit`: of the scene, s, m.
  explicit Model(const Scene& scene, double time_unit = 1, double length_unit = 1);

  double time_unit() const { return time_unit_; }      ///< s, for what users read
  double length_unit() const { return length_unit_; }  ///< m, likewise
  int coordinates() const { return 7 * bodies_.count(); }
  int velocities() const { return 6 * bodies_.count(); }
  int joint_rows() const { return rows_.count(); }
  /// Pairs of features, then the laws of joints, then moments of pairs.
  int contacts() const { return first_moment() + static_cast<int>(moments_.size()); }
  int pairs() const { return static_cast<int>(pairs_.size()); }
  ContactLaw law(int contact) const {
    if (is_law(contact)) return laws_.law(contact - pairs(), bodies_.all());
    if (is_moment(contact)) return moment(contact);
    const FeaturePair& p = pair(contact);
    const bool conveying = conveys(p.first) || conveys(p.second);
    return {p.friction, p.restitution,
            conveying ? ContactLaw::Kind::conveying : ContactLaw::Kind::contact};
  }

  /// The coefficient of friction without slip: that of the law, or a larger one.
  double holding(int contact) const {
    return holding_.empty() || !is_pair(contact) ? law(contact).friction : holding_[at(contact)];
  }

  /// Whether the bound of a law depends on the forces of others, which also have such bounds.
  bool shares_bound(int contact) const {
    return is_law(contact) && joint_laws().shares_tension(joint_law(contact));
  }
  /// The bounds of those, by contact, which are affine in the forces that are held. `loaded`: 1; 0:
  /// the part of these forces. The slips of cables are the last laws.
  void share_bounds(double loaded, const std::vector<LawForce>& forces,
                    std::vector<double>& bounds) const {
    joint_laws().grip(bodies_.all(), rings_);
    const std::size_t first = at(first_moment()) - rings_.size();
    bounds.resize(forces.size());
    effects::share_tensions(
        rings_, loaded, [&](std::size_t ring) { return forces[first + ring]; },
        [&](std::size_t ring, double bound) { bounds[first + ring] = bound; });
  }

  /// y: q, then u.
  void set(double t, const double* y);
  /// The first time after t at which forces have a kink or jump; infinite: there is none.
  double next_kink(double t) const { return effects::next_kink(kinks_, t); }
  /// Motion begins anew at t: forces that jump then have jumped.
  void begin_anew(double t) { bodies_.begin_anew(t); }
  /// A smooth phase begins at the state that is set: tangents turn smoothly from here on.
  void settle();
  /// The coordinate axis, 0 to 2, from which the tangents of a contact are chosen. It depends on
  /// earlier phases, so saved states contain it.
  int axis(int contact) const {
    if (!is_pair(contact)) return 0;
    Eigen::Index k = 0;
    axes_[at(contact)].maxCoeff(&k);
    return static_cast<int>(k);
  }
  void set_axis(int contact, int axis) {
    if (is_pair(contact)) axes_[at(contact)] = Vector3d::Unit(axis);
  }
  void rates(double* q_rate) const {
    for (int k = 0; k < bodies_.count(); ++k) {
      const double* s = y_.data() + kBody * k;
      std::copy_n(s + kVelocity, 3, q_rate + 7 * k);
      Eigen::Map<Eigen::Vector4d>(q_rate + 7 * k + 3) =
          quaternion_rate(s + kQuaternion, Eigen::Map<const Vector3d>(s + kSpin));
    }
  }
  /// X <- M^-1 X, `velocities()` rows.
  void divide_by_mass(Eigen::Ref<MatrixXd> X) const { bodies_.divide_by_mass(X); }
  /// Forces without joints and contacts, gyroscopic ones included.
  void forces(VectorXd& h);
  /// g, or its rate, of the rows of joints.
  template <int order>
  VectorXd joint_values() const {
    VectorXd out(rows_.count());
    rows_.values<order>(bodies_.all(), out.data());
    return out;
  }
  /// With W: g' = W u + rate, g'' = W u' + rest.
  void joints(MatrixXd& W, VectorXd& rate, VectorXd& rest) const;
  std::string joint_name(int row) const { return "joint \"" + rows_.joint_of(row) + "\""; }
  std::string contact_name(int contact) const {
    if (is_moment(contact)) contact = moment(contact).held_by;
    if (const auto* slip = slip_law(contact))
      return "the cable \"" + spring_names_[at(slip->cable())] + "\"";
    if (is_law(contact))
      return "the limit of joint \"" + joint_names_[at(laws_.all().joint(joint_law(contact)))] +
             "\"";
    const FeaturePair& p = pair(contact);
    return "\"" + body_names_[at(p.first)] + "\" and \"" + body_names_[at(p.second)] + "\"";
  }
  void evaluate_contact(int contact, ContactKinematics& out);
  double gap(int contact, double& rate) {  ///< and its rate
    if (is_law(contact)) return laws_.gap(contact - pairs(), bodies_.all(), rate);
    if (is_moment(contact)) return rate = 0;
    const Touch touch = pair(contact).touch(bodies_.all());
    rate = touch.rate;
    return touch.gap;
  }

  /// Whether the bodies are surely further apart than `by`: spheres around them do not meet. The
  /// gap of such a contact is not needed.
  bool is_apart(int contact, double by) {
    return is_pair(contact) && pair(contact).is_apart(bodies_.all(), by);
  }
  /// Rate, 1/s, at which the bodies pass each other: relative speed over the sum of their reaches.
  /// 0: one of them is unbounded.
  double passes(int contact) { return is_pair(contact) ? pair(contact).passes(bodies_.all()) : 0; }
  /// How far the contact is inside the border of its features, m; infinite: they have none.
  double margin(int contact) {
    return is_pair(contact) ? pair(contact).margin(bodies_.all()) : kInfinity;
  }

  /// Why the contact cannot be decided about at the state that is set; empty: it can.
  std::string undecided(int contact) {
    return is_pair(contact) && pair(contact).is_flush(bodies_.all())
               ? "a cylinder lies on its flat end, whose contact the event engine does not have"
               : "";
  }

  /// Whether both contacts are of one point of the same two bodies, with other normals: on the edge
  /// or at the corner of a face, within `distance`, m.
  bool are_at_one_edge(int contact, int other, double distance);
  /// Whether both are the same contact by two pairs of features: of one point, within `distance`,
  /// m, of the same two bodies, with one normal. (Corners of equal boxes that stand on each other.)
  bool are_one(int contact, int other, double distance);

  /// A vector of a contact by its normal and tangents, in world axes.
  Vector3d in_space(int contact, const VectorXd& parts);
  /// Relative velocity of a pair at its point without the normal part, world axes.
  Vector3d slip_of(int contact) const {
    const FeaturePair& p = pair(contact);
    const Touch touch = p.touch(bodies_.all());
    Vector3d slip = relative_velocity(p, touch);
    if (!surface_.empty())
      slip += surface_velocity(p.first, touch).x - surface_velocity(p.second, touch).x;
    return slip - touch.normal.dot(slip) * touch.normal;
  }

  /// The gradient by the coordinates of what has the velocity gradient `row`.
  void to_coordinates(const double* row, double* gradient) const {
    for (int k = 0; k < bodies_.count(); ++k) {
      const double* q = y_.data() + kBody * k + kQuaternion;
      std::copy_n(row + 6 * k, 3, gradient + 7 * k);
      Eigen::Map<Eigen::RowVector4d>(gradient + 7 * k + 3) =
          Eigen::Map<const Eigen::RowVector3d>(row + 6 * k + 3) * turn_of_quaternion(q);
    }
  }
  /// Rows that the coordinates obey by themselves: the lengths of the quaternions.
  int own_rows() const { return bodies_.count(); }
  void own_values(double* values) const {
    for (int k = 0; k < bodies_.count(); ++k)
      values[k] =
          0.5 *
          (Eigen::Map<const Eigen::Vector4d>(y_.data() + kBody * k + kQuaternion).squaredNorm() -
           1);
  }
  void own_gradient(int row, double* gradient) const {
    std::copy_n(y_.data() + kBody * row + kQuaternion, 4, gradient + 7 * row + 3);
  }

  /// Kinetic and potential, J.
  double energy() const { return bodies_.kinetic_energy() + potential(); }
  /// Gradients of the energy: by velocities, and of the potential by coordinates.
  void energy_gradient(double* by_q, double* by_u) const;
  /// Whether forces without potential or driven joints may do work.
  bool does_work() const {
    return rows_.has_motion() ||
           any_of(forces_, [](const auto& force) { return force->has_power(); });
  }
  /// Power of forces without potential, W.
  double power() const {
    double sum = 0;
    for (const auto& force : forces_)
      if (force->has_power()) sum += force->power(bodies_.all());
    return sum;
  }

  /// q, then u, at t = 0.
  VectorXd start() const {
    const std::vector<double>& y = bodies_.start();
    VectorXd out(coordinates() + velocities());
    for (int k = 0; k < bodies_.count(); ++k) {
      std::copy_n(y.data() + kBody * k, 7, out.data() + 7 * k);
      std::copy_n(y.data() + kBody * k + kVelocity, 6, out.data() + coordinates() + 6 * k);
    }
    return out;
  }
  bool is_pair(int contact) const { return contact < pairs(); }
  bool is_law(int contact) const { return contact >= pairs() && contact < first_moment(); }
  bool is_moment(int contact) const { return contact >= first_moment(); }
  const FeaturePair& pair(int contact) const { return pairs_[at(contact)]; }
  /// Laws of joints, some of which are contacts.
  const joints::JointLaws& joint_laws() const { return laws_.all(); }
  int joint_law(int contact) const { return laws_.place(contact - pairs()); }
  const effects::CapstanSlip* slip_law(int contact) const {
    return is_law(contact) ? joint_laws().slip(joint_law(contact)) : nullptr;
  }
  /// The direction of its force or moment on the first body, world axes.
  Vector3d law_direction(int contact) const {
    return laws_.direction(contact - pairs(), bodies_.all());
  }
  const smooth::MovingBodies& bodies() const { return bodies_; }
  const double* bodies_state() const { return y_.data(); }  ///< as MovingBodies has it
  double potential() const {
    double sum = 0;
    for (const auto& force : forces_) sum += force->potential(bodies_.all());
    return sum;
  }
  /// Adds the force of a closed contact that is a law of a joint or cable to the force of that.
  void add_law_force(int contact, const VectorXd& parts, Forces& out) const {
    joint_laws().add_force(joint_law(contact), bodies_.all(),
                           law(contact).is_bounded() ? parts[1] : parts[0], out);
  }
  /// Forces of joints, by the multipliers of their rows, and of springs, at the state that is set.
  Forces forces_of(const joints::Reactions& reactions, const VectorXd& multipliers) const {
    Forces out;
    out.joints = reactions.find(rows_, bodies_.all(), multipliers.data());
    for (const auto& force : forces_) force->report(bodies_.all(), out);
    return out;
  }

 private:
  int first_moment() const { return pairs() + laws_.count(); }
  /// Rolling or torsional friction of a pair.
  const ContactLaw& moment(int contact) const { return moments_[at(contact - first_moment())]; }
  void add_moments() {
    for (int k = 0; k < pairs(); ++k) {
      using Kind = ContactLaw::Kind;
      if (pair(k).rolling > 0) moments_.push_back({pair(k).rolling, 0, Kind::rolling, 0, k});
      if (pair(k).torsional > 0) moments_.push_back({pair(k).torsional, 0, Kind::spinning, 0, k});
    }
  }
  void find_holding(const Scene& scene);
  bool conveys(int body) const { return !surface_.empty() && surface_[at(body)].has_value(); }
  Vector3d relative_velocity(const FeaturePair& pair, const Touch& touch) const;
  /// Velocity of the surface of a body at a point, and its rate where the point moves.
  Jet<double> surface_velocity(int body, const Touch& touch) const;
  void evaluate_moment(const ContactLaw& moment, ContactKinematics& out);
  // Square of the sine between the normals of two contacts at one point; -1: at two points.
  double square_between(int contact, int other, double distance) {
    if (!is_pair(contact) || !is_pair(other)) return -1;
    const FeaturePair &p = pair(contact), &q = pair(other);
    if (std::minmax(p.first, p.second) != std::minmax(q.first, q.second)) return -1;
    const Touch a = p.touch(bodies_.all()), b = q.touch(bodies_.all());
    if ((a.point - b.point).norm() > distance) return -1;
    return a.normal.cross(b.normal).squaredNorm();
  }
  std::array<Vector3d, 2> tangents_of(int contact, const Vector3d& normal) const {
    const Vector3d t1 = normal.cross(axes_[at(contact)]).normalized();
    return {t1, normal.cross(t1)};
  }
  /// Tangents with their rates, each as long as its coefficient of friction over the larger one.
  std::array<Jet<double>, 2> scaled_tangents(const FeaturePair& pair, const Touch& touch) const;

  double time_unit_, length_unit_;
  smooth::MovingBodies bodies_;
  joints::JointRows rows_;
  std::vector<std::unique_ptr<Force>> forces_;
  std::vector<double> kinks_;  // of forces, by time
  std::vector<FeaturePair> pairs_;
  std::vector<double> holding_;                       // by pair; empty: as friction
  std::vector<std::optional<SurfaceSpeed>> surface_;  // by body, of Bodies; empty: none
  std::vector<std::string> body_names_, joint_names_, spring_names_;
  LawContacts laws_;
  mutable std::vector<effects::Grip> rings_;  // workspace
  std::vector<ContactLaw> moments_;
  std::vector<Vector3d> axes_;  // next to which the tangents of each contact are chosen
  std::vector<double> y_;       // of MovingBodies
  std::vector<Load6> loads_;
};

/// The pairs of features of a scene that may touch. Throws std::invalid_argument, naming shapes
/// whose contact the engine does not have.
std::vector<FeaturePair> potential_contacts(const Scene& scene);

}  // namespace tether::scene::event

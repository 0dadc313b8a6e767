// Tether: the rows of all joints of a scene. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/engine.hpp>
#include <type_traits>

#include "coordinate.hpp"
#include "mechanics/force.hpp"
#include "rows.hpp"

namespace tether::scene::couplings {

/// The polynomial of each of its joints, from degree 1 on, whose sum vanishes. Ratios of angles
/// that are fractions of small numbers, but for rounding, are these. Throws std::invalid_argument.
std::vector<std::vector<double>> polynomials(const Scene& scene, const Coupling& coupling);

/// The sum grows by multiples of this where an angle grows by a full turn; 0: nothing is known.
double turn(const Scene& scene, const Coupling& coupling,
            const std::vector<std::vector<double>>& polynomials);

}  // namespace tether::scene::couplings

namespace tether::scene::joints {

class RowBuilder;

class JointRows {
 public:
  JointRows() = default;
  /// `bodies`: at t = 0. Throws std::invalid_argument, naming the joint and the fault.
  JointRows(const Scene& scene, const Bodies& bodies);
  JointRows(const JointRows&) = delete;  // rows keep pointers to the motions
  JointRows& operator=(const JointRows&) = delete;

  int count() const { return count_; }
  bool has_motion() const { return !motions_.empty(); }
  bool has_couplings() const { return !turns_.empty(); }
  const std::vector<Relation>& couplings() const { return std::get<std::vector<Relation>>(rows_); }
  std::size_t joint_count() const { return names_.size(); }
  const std::string& name(int joint) const { return names_[at(joint)]; }
  const std::string& joint_of(int row) const {
    int joint = 0;
    each([&](const auto& kind) {
      if (kind.row <= row && row < kind.row + kind.count) joint = kind.joint;
    });
    return name(joint);
  }

  /// Sets the prescribed motions.
  void set_time(double t) {
    for (std::size_t i = 0; i < motions_.size(); ++i) now_[i] = evaluate(motions_[i], t);
  }
  /// The values of the motions stay, their rates are 0.
  void hold_motions() {
    for (Now& each : now_) each.s1 = each.s2 = 0.0;
  }

  /// Calls f with every row, kind by kind.
  template <class F>
  void each(const F& f) const {
    std::apply([&](const auto&... kinds) { (each_of(kinds, f), ...); }, rows_);
  }
  /// The order-th time derivative of every g.
  template <int order>
  void values(const Bodies& bodies, double* g) const {
    for (const Turn& each : turns_) g[each.row] = 0;
    each([&](const auto& row) {
      const Frame<double>&A = bodies.frames[at(row.first)], &B = bodies.frames[at(row.second)];
      if constexpr (std::is_same_v<std::decay_t<decltype(row)>, Relation>) {
        double part = 0;
        row.template rows<order>(A, B, &part);
        g[row.row] += part;
      } else {
        row.template rows<order>(A, B, g + row.row);
      }
    });
    if constexpr (order == 0)
      for (const Turn& each : turns_)
        if (each.change > 0) g[each.row] = std::remainder(g[each.row], each.change);
  }
  /// G: 6 columns for each moving body, by slot, of its velocity and angular velocity in body axes.
  void gradient(const Bodies& bodies, Eigen::MatrixXd& G) const;
  /// Calls f(i, the loads on its first and second body) for the multiplier i of `row` being 1, the
  /// others 0.
  template <class Row, class F>
  static void each_unit_pull(const Row& row, const Bodies& bodies, const F& f) {
    double unit[3] = {0, 0, 0};
    for (int i = 0; i < row.count; ++i) {
      unit[i] = 1.0;
      Wrench<double> a = no_wrench<double>(), b = no_wrench<double>();
      row.pull(bodies.frames[at(row.first)], bodies.frames[at(row.second)], unit, a, b);
      unit[i] = 0.0;
      f(i, a, b);
    }
  }
  /// The same by f(i, body, force, torque in body axes) for each moving body that it acts on.
  template <class Row, class F>
  static void each_unit_load(const Row& row, const Bodies& bodies, const F& f) {
    each_unit_pull(row, bodies, [&](int i, const Wrench<double>& a, const Wrench<double>& b) {
      for (const auto& [body, on] : {std::pair(row.first, &a), {row.second, &b}})
        if (bodies.moves(body))
          f(i, body, on->force, Vector3d(bodies.frames[at(body)].R.transpose() * on->torque));
    });
  }

 private:
  friend class RowBuilder;
  template <class Rows, class F>
  static void each_of(const Rows& rows, const F& f) {
    for (const auto& row : rows) f(row);
  }

  void couple(const Scene& scene, const Bodies& bodies);
  void place_bodies(const Bodies& bodies);

  /// Angles once around change the g of a coupling by a multiple of this, 0: they do not.
  struct Turn {
    int row;
    double change;
  };

  int count_ = 0;
  AllRows rows_;
  std::vector<Turn> turns_;         // of the couplings
  std::vector<std::string> names_;  // of the joints
  std::vector<Motion> motions_;
  std::vector<Now> now_;
};

/// Adds the rows of one joint in terms of points and directions in world axes at t = 0.
class RowBuilder {
 public:
  RowBuilder(JointRows& rows, const Joint& joint, const Row& bodies, const Frame<double>& A,
             const Frame<double>& B, const Now* now);

  const Joint& joint() const { return joint_; }
  const Now* now() const { return now_; }  ///< null: no prescribed motion
  /// Right-handed directions; z along the axis of the joint.
  const Vector3d& x() const { return x_; }
  const Vector3d& y() const { return y_; }
  const Vector3d& z() const { return z_; }

  /// Both bodies keep the point joint.at in common: 3 rows.
  void coincide() {
    Coincidence row;
    row.at_first = point_in(A_, joint_.at);
    row.at_second = point_in(B_, joint_.at);
    place(row);
  }
  /// Direction u of the first body stays at right angles to v of the second: 1 row.
  void right_angle(const Vector3d& u, const Vector3d& v) {
    RightAngle row;
    row.of_first = direction_in(A_, u);
    row.of_second = direction_in(B_, v);
    place(row);
  }
  /// 3 rows.
  void same_attitude() {
    right_angle(x_, y_);
    right_angle(y_, z_);
    right_angle(z_, x_);
  }
  /// The first body turns about z of the second by the prescribed angle: 1 row.
  void prescribed_angle() {
    Angle row;
    row.of_first = direction_in(A_, x_);
    row.zero = direction_in(B_, x_);
    row.ahead = direction_in(B_, y_);
    row.now = now_;
    place(row);
  }
  /// The point joint.at of the first body stays in the plane of the second with this normal; with a
  /// motion, at that distance from it: 1 row.
  void plane(const Vector3d& normal, const Now* motion) {
    Plane row;
    row.at_first = point_in(A_, joint_.at);
    row.at_second = point_in(B_, joint_.at);
    row.normal = direction_in(B_, normal);
    row.now = motion;
    place(row);
  }
  /// joint.at of the first and joint.at_second of the second body keep their distance: 1 row.
  void distance(double length) {
    Distance row;
    row.at_first = point_in(A_, joint_.at);
    row.at_second = point_in(B_, joint_.at_second);
    row.length = length;
    row.now = now_;
    place(row);
  }

 private:
  template <class Kind>
  void place(Kind row) {
    static_cast<Row&>(row) = bodies_;
    row.row = rows_.count_;
    rows_.count_ += row.count;
    std::get<std::vector<Kind>>(rows_.rows_).push_back(row);
  }

  JointRows& rows_;
  const Joint& joint_;
  Row bodies_;
  const Frame<double> A_, B_;
  const Now* now_;
  Vector3d z_, x_, y_;
};

/// The reactions that the multipliers of the rows make, N and N m, for each joint of the scene.
class Reactions {
 public:
  /// `bodies`: at t = 0.
  Reactions(const Scene& scene, const Bodies& bodies) {
    for (const Joint& joint : scene.joints) joints_.emplace_back(joint, bodies);
  }

  /// Multipliers by row, N or N m, at the places that the rows and bodies are set to.
  std::vector<JointForce> find(const JointRows& rows, const Bodies& bodies,
                               const double* multipliers) const;

 private:
  std::vector<Coordinate> joints_;
};

}  // namespace tether::scene::joints

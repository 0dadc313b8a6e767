// Tether: the equations of motion of a smooth scene. SPDX-License-Identifier: BSD-3-Clause
//
// Unknowns: for each moving body x, q (wxyz, body to world), v, w (body axes); then the work of
// forces without potential if energy is kept with them; then the multipliers lambda and, in the
// stabilised form, eta.
//
//   index 1        x' = v, q' = q (0, w) / 2, M (v', w') = f + G^T lambda, g'' = 0
//   index 0        the same with lambda eliminated: G M^-1 G^T lambda = -(gamma + G M^-1 f)
//   stabilised 2   x', q' with (v, w) + M^-1 G^T eta, G v + g_t = 0, g = 0
//
// Rows may depend on each other, everywhere (planar linkages of 3-D hinges, Bricard's) or at a dead
// point. So index 1 and 2 give multipliers to as many rows as are independent along the motion, and
// hold the others at 0; see redundant.cpp. A diagonal term eps lambda in their place acts through
// eps / pivot^2: at tight tolerances it bends the motion at a dead point, and IDA does not get
// through. Index 0 has it (eps = 1e-11 of the diagonal, refined three times, so to the third
// power).
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <memory>
#include <string>
#include <tether/ida_projection.hpp>
#include <tether/scene/engine.hpp>
#include <tether/scene/scene.hpp>
#include <vector>

#include "effects.hpp"
#include "rows.hpp"
#include "stopwatch.hpp"
#include "units.hpp"

namespace tether::scene::smooth {

class System {
 public:
  /// `scene` is in these units already; they are for figures that are told to others.
  explicit System(const Scene& scene, const Units& units = {});
  const Units& units() const { return units_; }

  int size() const { return size_; }
  int rows() const { return m_; }
  int moving() const { return bodies_.moving; }
  /// 1 differential, 0 algebraic.
  double id(int i) const { return i < first_multiplier() ? 1.0 : 0.0; }
  double absolute_tolerance(int i, double tolerance) const;

  /// y and y' at t = 0 from the scene.
  Eigen::VectorXd start_state() const;
  /// y' and the multipliers from the rest of y.
  void complete(double t, Eigen::VectorXd& y, Eigen::VectorXd& yp);
  /// The values of the invariants that are kept are those of this state from now on.
  void keep_invariants_of(double t, const Eigen::VectorXd& y);
  std::vector<double>& kept() { return kept_; }

  void residual(double t, const double* y, const double* yp, double* r, Stopwatch* watch);
  /// Adds dF/dy + cj dF/dy'.
  void jacobian(double t, double cj, const double* y, const double* yp, Entries& entries);

  ida_projection::Constraints constraints();
  /// Chooses the rows of the joints that the projection uses from here on, see redundant.cpp.
  void choose_rows(double t, const double* y, double tolerance);
  void look_at_rows();  ///< after a step
  /// How far the rows in use are from depending on each other: the length of what the last one adds
  /// to the others, rows of unit length; 0 at a dead point, 1 without joints.
  double weakest_pivot() const { return weakest_; }
  /// Grows when other rows carry multipliers: the matrix has other zeros then.
  int multiplier_choices() const { return multiplier_choices_; }
  int constraint_count() const;
  void constraint_values(double t, const double* y, double* g);
  using Rows = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  void constraint_jacobian(double t, const double* y, Rows C);
  std::vector<std::string> constraint_names() const;
  /// Position and velocity of every row of the joints, 2 rows().
  void joint_values(double t, const double* y, double* g);
  std::string joint_of_row(int row) const;

  void bodies(const double* y, std::vector<BodyState>& out) const;
  Diagnostics diagnostics(double t, const double* y);  ///< drift in SI, the rest in units()
  std::vector<std::string> effect_names() const;

 private:
  int first_work() const { return kBody * moving(); }
  int first_multiplier() const { return first_work() + (has_work_ ? 1 : 0); }
  int first_eta() const { return first_multiplier() + m_; }

  class JointRows;  // joints.cpp
  void add_joints(const Scene& scene);
  void count_independent_rows();
  void choose_rows();
  void choose_multipliers();
  void add_invariants(const Scene& scene);
  template <class F>
  void each_row(F f) const;
  /// Calls f(i, body, force, torque about the body's axes) for the multiplier i of the row being 1,
  /// all others 0, and each moving body that it acts on.
  template <class Row, class F>
  void each_unit_load(const Row& row, const F& f) const;
  void update(double t, const double* y);  // frames, without accelerations
  void update_accelerations(const double* yp);
  void add_multipliers(const double* lambda, std::vector<Load6>& loads) const;
  void sum_forces(Stopwatch* watch);
  void torques_to_body_axes(std::vector<Load6>& loads) const;
  void form_gradient();      // G_, GM_, S_
  void solve_multipliers();  // lambda_, a_ of forces_ at the present state
  void add_motion_jacobian(JacobianBlocks& J, const double* lambda, int first_lambda);
  template <int order>
  void add_row_jacobian(JacobianBlocks& J, int first_row, bool carried_only, bool accelerations,
                        double cj);
  void add_eta_jacobian(JacobianBlocks& J, const double* y) const;
  void pin_multipliers(const double* multipliers, double* rows) const;
  void index0_jacobian(double cj, const double* y, Entries& entries);
  void accelerations_from_multipliers();
  void form_left();  // left_: -d(f + G^T lambda)/dy over dg''/dy, a and lambda fixed
  Eigen::MatrixXd acceleration_jacobian();  // da/dy, and dlambda/dy in dense_
  void index0_work_jacobian(double cj, JacobianBlocks& J);
  double power(const double* lambda) const;
  double energy() const;
  Vector3d momentum() const;
  Vector3d angular_momentum() const;
  void invariant_values(double t, const double* y, double* g) const;
  void invariant_jacobian(Rows C, int row) const;

  double drift(double t, const double* y);

  Formulation form_;
  Units units_;
  std::vector<std::string> joint_names_;
  std::vector<int> body_of_slot_;
  Bodies bodies_;
  std::vector<double> start_;  // of the moving bodies
  std::vector<std::unique_ptr<Effect>> effects_;

  int m_ = 0, size_ = 0;
  double weak_ = 0;                 // pivot below which a row is not used
  int p_ = 0;                       // rows that the projection uses
  std::vector<int> used_;           // these, now
  std::vector<int> place_of_used_;  // of each row the first place in used_, or -1
  std::vector<char> carries_;       // of each row: it has a multiplier
  double weakest_ = 1;
  int multiplier_choices_ = 0;
  int wait_ = 0;  // steps until they are looked at again
  std::vector<Coincidence> coincidences_;
  std::vector<RightAngle> right_angles_;
  std::vector<Angle> angles_;
  std::vector<Plane> planes_;
  std::vector<Distance> distances_;
  std::vector<Motion> motions_;
  std::vector<Now> now_;  // of the motions; rows point into it

  bool has_work_ = false, has_motion_ = false;
  bool keeps_energy_ = false, keeps_momentum_ = false;
  Eigen::Matrix<double, Eigen::Dynamic, 3> kept_axes_;  // of angular momentum about the origin
  Vector3d steady_force_ = Vector3d::Zero();            // momentum grows by it
  std::vector<double> kept_;

  // Workspace.
  std::vector<Load6> loads_, pulls_;
  Eigen::VectorXd size_of_row_, epsilon_, lambda_, a_, gamma_, free_, right_, values_, scratch_;
  Eigen::MatrixXd G_, GM_, S_, regular_, left_, dense_, carried_gradient_;
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> row_choice_, carried_rows_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  Entries dense_entries_;
  bool dense_recorded_ = false;
};

template <class F>
void System::each_row(F f) const {
  for (const Coincidence& each : coincidences_) f(each);
  for (const RightAngle& each : right_angles_) f(each);
  for (const Angle& each : angles_) f(each);
  for (const Plane& each : planes_) f(each);
  for (const Distance& each : distances_) f(each);
}

template <class Row, class F>
void System::each_unit_load(const Row& row, const F& f) const {
  const auto index = [](int i) { return static_cast<std::size_t>(i); };
  const Frame<double>&A = bodies_.frames[index(row.first)], &B = bodies_.frames[index(row.second)];
  double unit[3] = {0, 0, 0};
  for (int i = 0; i < row.count; ++i) {
    unit[i] = 1.0;
    Wrench<double> a = no_wrench<double>(), b = no_wrench<double>();
    row.pull(A, B, unit, a, b);
    unit[i] = 0.0;
    if (bodies_.inertia[index(row.first)].slot >= 0)
      f(i, row.first, a.force, Vector3d(A.R.transpose() * a.torque));
    if (bodies_.inertia[index(row.second)].slot >= 0)
      f(i, row.second, b.force, Vector3d(B.R.transpose() * b.torque));
  }
}

}  // namespace tether::scene::smooth

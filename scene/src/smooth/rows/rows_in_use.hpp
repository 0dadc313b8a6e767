// Tether: which rows of the joints are used. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/pivoted_qr.hpp>
#include <tether/linalg/sparse_minimum_norm.hpp>

#include "joints/joint_rows.hpp"
#include "moving_bodies.hpp"

namespace tether::scene::smooth {

using joints::JointRows;

/// G (rows x 6 velocities of each moving body, angular ones in body axes), G M^-1 and G M^-1 G^T.
struct JointGradient {
  Eigen::MatrixXd G, GM, S;

  void form(const JointRows& rows, const MovingBodies& bodies);
};

/// C = G M^-1/2 with G as in JointGradient, by its entries: six for each row and body.
class SparseJointGradient {
 public:
  SparseJointGradient(const JointRows& rows, const MovingBodies& bodies);

  /// At the state that is set. Rows that are not wanted count as zero; `dependent`: how short what
  /// others leave of a row of unit length, in the metric of M, is if it is to depend on them.
  void factor() { factor(nullptr, 1e-6); }
  // A factor of the tolerance that SparseMinimumNorm calls a row dependent at.
  void factor(const std::vector<char>& wanted, double dependent) {
    factor(wanted.data(), 0.25 * dependent);
  }
  /// After factor(): 1 for each row that is wanted and depends on none of the others; their number.
  int independent(std::vector<char>& rows) const {
    rows.assign(at(rows_.count()), 1);
    for (int k = factors_.rank(); k < rows_.count(); ++k) rows[at(factors_.pivot(k))] = 0;
    return factors_.rank();
  }
  /// After factor(): what rows before row i in the order of elimination leave of it, 0 to 1.
  double independent_part(int i) const { return factors_.independent_part(i); }
  /// After factor(): a row that depends on others, and those that matter in it; none: empty.
  std::vector<int> dependent() const {
    if (factors_.dropped() == 0) return {};
    const int k = factors_.rank();
    const std::vector<double> shares = factors_.dependence(k);
    std::vector<int> rows = {factors_.pivot(k)};
    double largest = 0;
    const auto share = [&](int i) {
      return std::abs(shares[at(i)]) * factors_.row_norm(factors_.pivot(i));
    };
    for (int i = 0; i < k; ++i) largest = std::max(largest, share(i));
    for (int i = 0; i < k; ++i)
      if (share(i) > 0.1 * largest) rows.push_back(factors_.pivot(i));
    return rows;
  }
  /// Finds a with G a = right of least kinetic energy a^T M a / 2, and lambda with M a = G^T
  /// lambda.
  void solve(const Eigen::VectorXd& right, Eigen::VectorXd& a, Eigen::VectorXd& lambda) {
    factors_.solve(right.data(), least_.data());
    factors_.multipliers(least_.data(), lambda.data());
    a.setZero();
    add_least(1.0, a);
  }
  /// Takes from velocities v what the factored rows forbid.
  void release(Eigen::VectorXd& v) {
    multiply(v, rates_);
    factors_.solve(rates_.data(), least_.data());
    add_least(-1.0, v);
  }
  /// Product of G with each moving body's velocities.
  void multiply(const Eigen::VectorXd& a, Eigen::VectorXd& rates) const {
    rates.setZero();
    each_entry([&](int row, int, int slot, const Vector3d& force, const Vector3d& torque) {
      rates[row] += force.dot(a.segment<3>(6 * slot)) + torque.dot(a.segment<3>(6 * slot + 3));
    });
  }
  /// Diagonal of G M^-1 G^T; after factor().
  Eigen::VectorXd size_of_rows() const {
    Eigen::VectorXd size(rows_.count());
    for (int i = 0; i < rows_.count(); ++i) size[i] = std::pow(factors_.row_norm(i), 2);
    return size;
  }

 private:
  void factor(const char* wanted, double rank_tolerance);
  /// share times the last solution
  void add_least(double share, Eigen::VectorXd& a) const {
    for (int k = 0; k < bodies_.count(); ++k) {
      a.segment<3>(6 * k) += share / std::sqrt(bodies_.inertia(k).mass) * least_.segment<3>(6 * k);
      a.segment<3>(6 * k + 3) += share * (roots_[at(k)] * least_.segment<3>(6 * k + 3));
    }
  }
  // put(row, where its entries of this body begin within the row, body's slot, force, torque)
  template <class Put>
  void each_entry(const Put& put) const {
    const Bodies& bodies = bodies_.all();
    rows_.each([&](const auto& row) {
      JointRows::each_unit_load(
          row, bodies, [&](int i, int body, const Vector3d& force, const Vector3d& torque) {
            const int place = body == row.first ? row.place_first : row.place_second;
            put(row.row + i, 6 * place, bodies.inertia[at(body)].slot, force, torque);
          });
    });
  }

  const JointRows& rows_;
  const MovingBodies& bodies_;
  std::vector<Eigen::Matrix3d> roots_;  // L of each moving body's inverse inertia L L^T
  std::vector<int> starts_;
  linalg::SparseMinimumNorm factors_;
  Eigen::VectorXd least_, rates_;
};

/// Rows whose weakest pivot is less than this part of another set's are much worse.
constexpr double kMuchWorse = 0.1;

/// A set of rows, one entry each, and how far its rows are from depending on each other: the least
/// that those before it leave of one, in the metric of M; 1 without rows, 0 where some do.
struct RowSet {
  std::vector<char> has;
  int count = 0;
  double weakest = 1;
};

/// Rows of joints chosen by the entries of their gradient: those that the projection keeps and
/// those that carry multipliers. What RowsInUse says of them, for scenes with many closed loops.
class SparseRowChoice {
 public:
  /// Finds out, near the start of the scene, how many rows are independent where it moves; leaves
  /// `bodies` in some other state.
  SparseRowChoice(JointRows& rows, MovingBodies& bodies);

  /// At the state that is set; rows of which others leave less than `weak` are not kept. True:
  /// other rows carry multipliers now.
  bool choose(double weak);
  bool keeps(int row) const { return kept_.has[at(row)] != 0; }
  const RowSet& carriers() const { return carriers_; }
  /// From which weakest pivot of the carriers on nothing is to be feared for some steps.
  double good() const { return std::min(0.03, 0.3 * usual_); }

 private:
  RowSet independent_among(const std::vector<char>& wanted, double dependent) {
    gradient_.factor(wanted, dependent);
    RowSet found;
    found.count = gradient_.independent(found.has);
    for (int i = 0; i < rows_.count(); ++i)
      if (found.has[at(i)]) found.weakest = std::min(found.weakest, gradient_.independent_part(i));
    return found;
  }
  void add_thin(RowSet& set);
  // The set of `count` rows that is furthest from depending on each other, to a factor of 10; at
  // least to within `weak`. Fewer rows where there are not so many.
  RowSet best(int count, double weak) {
    for (double stands_out = 0.1; stands_out > weak; stands_out *= 0.1) {
      RowSet found = independent_among(all_, stands_out);
      if (found.count >= count) return found;
    }
    return independent_among(all_, weak);
  }
  double reach() const;
  // v: velocities of each body as in JointGradient.
  void move(std::vector<double>& y, const Eigen::VectorXd& v) const {
    for (int k = 0; k < bodies_.count(); ++k) {
      double* s = y.data() + kBody * k;
      Eigen::Map<Vector3d>(s + kPosition) += v.segment<3>(6 * k);
      Eigen::Map<Eigen::Vector4d> q(s + kQuaternion);
      q += quaternion_rate(s + kQuaternion, v.segment<3>(6 * k + 3));
      q.normalize();
    }
  }
  void move_freely(std::vector<double>& y);
  void close(std::vector<double>& y);

  JointRows& rows_;
  MovingBodies& bodies_;
  SparseJointGradient gradient_;
  std::vector<char> all_;
  RowSet kept_, carriers_;
  int seen_ = 0;              // of the carriers, those that the factors tell from dependent ones
  double usual_ = 1;          // the largest that their weakest pivot was so far
  double weakest_found_ = 0;  // of the carriers at the last search for better ones
  int steps_to_search_ = 0;   // until the next one
};

/// The rows that the projection keeps, and those that carry multipliers, chosen along the motion
/// where rows depend on each other; see rows_in_use.cpp.
class RowsInUse {
 public:
  /// Counts independent rows at the start of the scene; leaves `bodies` in some other state.
  RowsInUse(JointRows& rows, MovingBodies& bodies);

  /// Rows that the projection keeps, in `used()`, one of them in several places near a singular
  /// position.
  int count() const { return count_; }
  const std::vector<int>& used() const { return used_; }
  int place_of(int row) const { return place_of_used_[at(row)]; }  ///< first in used(), or -1
  bool carries_multiplier(int row) const {
    return (sparse_ ? sparse_->carriers().has[at(row)] : carries_[at(row)]) != 0;
  }
  /// Many rows, each in its own place for the whole run; one that is not kept now counts as zero.
  bool in_place() const { return by_entries(rows_.count(), bodies_.count()); }
  bool keeps(int row) const { return sparse_ ? sparse_->keeps(row) : place_of(row) >= 0; }
  /// Grows when other rows carry multipliers: the matrix has other zeros then.
  int multiplier_choices() const { return multiplier_choices_; }
  /// How far the rows in use are from depending on each other: the length of what the last one adds
  /// to the others, rows of unit length; 0 at a singular position, 1 without joints.
  double weakest_pivot() const { return weakest_; }

  /// Chooses at the state that is set, for this local tolerance from now on.
  void choose(double tolerance);
  /// After a step, at the state that is set. True: used() has other rows than before.
  void choose_after_step() {
    if (--wait_ <= 0) choose();
  }
  void choose_now() { choose(); }

 private:
  bool independent_by_structure() const;
  int count_needed_beyond(const Eigen::VectorXd& length, const linalg::PivotedQr& qr);
  bool choose();
  void choose_sparse();
  void choose_multipliers();

  JointRows& rows_;
  MovingBodies& bodies_;
  double weak_ = 0;                          // pivot below which a row is not used
  std::unique_ptr<SparseRowChoice> sparse_;  // in place, with closed loops
  int count_ = 0;
  std::vector<int> used_, before_, place_of_used_;
  std::vector<char> carries_;
  double weakest_ = 1;
  int multiplier_choices_ = 0;
  int wait_ = 0;  // steps until the next choice
  JointGradient gradient_;
  Eigen::MatrixXd carried_gradient_;
  linalg::PivotedQr row_choice_, carried_rows_;
};

}  // namespace tether::scene::smooth

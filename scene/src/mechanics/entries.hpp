// Tether: entries of a Jacobian, written in a fixed order. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <utility>
#include <vector>

#include "frames.hpp"

namespace tether::scene::mechanics {

/// The assembly makes the same calls of add() in the same order every time. So it runs once to
/// record places; afterwards an entry goes to the slot of the same call, in any storage.
class Entries {
 public:
  std::vector<std::pair<int, int>> places;  ///< row, column of each call

  void record() {
    places.clear();
    recording_ = true;
  }
  void finish(std::vector<int> slots) {
    slots_ = std::move(slots);
    recording_ = false;
  }
  const std::vector<int>& slots() const { return slots_; }
  /// `values`: zero on entry.
  void begin(double* values) {
    values_ = values;
    next_ = 0;
  }
  void add(int row, int column, double value) {
    if (recording_)
      places.emplace_back(row, column);
    else
      values_[slots_[next_++]] += value;
  }

 private:
  bool recording_ = false;
  std::vector<int> slots_;
  std::size_t next_ = 0;
  double* values_ = nullptr;
};

/// 3 x 4: the turn in body axes that a change of the quaternion (wxyz) means, for R(q / |q|).
inline Eigen::Matrix<double, 3, 4> turn_of_quaternion(const double* q) {
  Eigen::Matrix<double, 3, 4> L;
  L << -q[1], q[0], q[3], -q[2],  //
      -q[2], -q[3], q[0], q[1],   //
      -q[3], q[2], -q[1], q[0];
  return L * (2.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]));
}

/// Unknowns of one body.
constexpr int kBody = 13, kPosition = 0, kQuaternion = 3, kVelocity = 7, kSpin = 10;

/// Writes derivatives into rows of a matrix whose columns are the unknowns.
class JacobianBlocks {
 public:
  JacobianBlocks(Entries& entries, const std::vector<Eigen::Matrix<double, 3, 4>>& turns,
                 int stride, int offset, int row_of_work)
      : work_row(row_of_work), entries_(entries), turns_(turns), stride_(stride), offset_(offset) {}

  const int work_row;

  /// Row of component i = 0 .. 5 of the equations of motion of a moving body.
  int motion_row(int slot, int i) const { return stride_ * slot + offset_ + i; }
  void add(int row, int column, double value) { entries_.add(row, column, value); }

  /// factor * d, the 12 directions of a moving body from `first` on.
  void add_directions(int row, int slot, const Derivatives& d, int first, double factor) {
    const int column = kBody * slot;
    for (int k = 0; k < 3; ++k) add(row, column + kPosition + k, factor * d[first + k]);
    const Eigen::RowVector4d quaternion =
        factor * d.segment<3>(first + 3).transpose() * turns_[static_cast<std::size_t>(slot)];
    for (int k = 0; k < 4; ++k) add(row, column + kQuaternion + k, quaternion[k]);
    for (int k = 0; k < 6; ++k) add(row, column + kVelocity + k, factor * d[first + 6 + k]);
  }
  /// A 3 x 3 block of derivatives to the turn of a body.
  void add_turn(int row, int slot, const Matrix3d& block) {
    const Eigen::Matrix<double, 3, 4> d = block * turns_[static_cast<std::size_t>(slot)];
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 4; ++k) add(row + i, kBody * slot + kQuaternion + k, d(i, k));
  }
  void add_block(int row, int column, const Matrix3d& block) {
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) add(row + i, column + k, block(i, k));
  }

 private:
  Entries& entries_;
  const std::vector<Eigen::Matrix<double, 3, 4>>& turns_;
  int stride_, offset_;
};

}  // namespace tether::scene::mechanics

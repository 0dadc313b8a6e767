// Tether: the constraints that the projection keeps. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "system.hpp"

namespace tether::scene::smooth {

int System::constraint_count() const {
  return 2 * in_use_.count() + moving() + invariants_.count();
}

void System::joint_values(double t, const double* y, double* g) {
  update(t, y);
  const Bodies& bodies = bodies_.all();
  rows_.each([&](const auto& row) {
    const Frame<double>&A = bodies.frames[at(row.first)], &B = bodies.frames[at(row.second)];
    row.template rows<0>(A, B, g + row.row);
    row.template rows<1>(A, B, g + rows() + row.row);
  });
}

void System::constraint_values(double t, const double* y, double* g) {
  joint_values(t, y, joint_values_.data());
  const int p = in_use_.count();
  for (int k = 0; k < p; ++k) {
    g[k] = joint_values_[in_use_.used()[at(k)]];
    g[p + k] = joint_values_[rows() + in_use_.used()[at(k)]];
  }
  double* norms = g + 2 * p;
  for (int k = 0; k < moving(); ++k)
    norms[k] =
        0.5 * (Eigen::Map<const Eigen::Vector4d>(y + kBody * k + kQuaternion).squaredNorm() - 1.0);
  if (invariants_.count() > 0) invariants_.values(t, y, norms + moving());
}

void System::constraint_jacobian(double t, const double* y, ConstraintRows C) {
  update(t, y);
  bodies_.set_turns(y);
  const Bodies& bodies = bodies_.all();
  const int p = in_use_.count();
  const auto put = [&](int row, const Inertia& inertia, const Derivatives& d, int first) {
    if (inertia.slot < 0) return;
    const int column = kBody * inertia.slot;
    C.row(row).segment<3>(column + kPosition) += d.segment<3>(first);
    C.row(row).segment<4>(column + kQuaternion) +=
        d.segment<3>(first + 3).transpose() * bodies.turns[at(inertia.slot)];
    C.row(row).segment<6>(column + kVelocity) += d.segment<6>(first + 6);
  };
  rows_.each([&](const auto& row) {
    const Inertia &ia = bodies.inertia[at(row.first)], &ib = bodies.inertia[at(row.second)];
    const Frame<Dual> A = seed(bodies.frames[at(row.first)], ia.slot >= 0, 0);
    const Frame<Dual> B = seed(bodies.frames[at(row.second)], ib.slot >= 0, kBodyDirections);
    Dual g[3], rate[3];
    row.template rows<0>(A, B, g);
    row.template rows<1>(A, B, rate);
    for (int i = 0; i < row.count; ++i) {
      const int place = in_use_.place_of(row.row + i);
      if (place < 0) continue;
      put(place, ia, g[i].derivatives(), 0);
      put(place, ib, g[i].derivatives(), kBodyDirections);
      put(p + place, ia, rate[i].derivatives(), 0);
      put(p + place, ib, rate[i].derivatives(), kBodyDirections);
    }
  });
  for (int k = 0; k < p; ++k) {
    const int place = in_use_.place_of(in_use_.used()[at(k)]);
    if (place == k) continue;
    C.row(k) = C.row(place);
    C.row(p + k) = C.row(p + place);
  }
  for (int k = 0; k < moving(); ++k)
    C.row(2 * p + k).segment<4>(kBody * k + kQuaternion) =
        Eigen::Map<const Eigen::RowVector4d>(y + kBody * k + kQuaternion);
  if (invariants_.count() > 0) invariants_.jacobian(C, 2 * p + moving());
}

std::vector<std::string> System::constraint_names() const {
  const int p = in_use_.count();
  std::vector<std::string> names(at(2 * p));
  rows_.each([&](const auto& row) {
    for (int i = 0; i < row.count; ++i) {
      const int place = in_use_.place_of(row.row + i);
      if (place < 0) continue;
      names[at(place)] = "position of joint \"" + rows_.name(row.joint) + "\"";
      names[at(p + place)] = "velocity of joint \"" + rows_.name(row.joint) + "\"";
    }
  });
  for (int k = 0; k < moving(); ++k) names.emplace_back("quaternion norm");
  invariants_.add_names(names);
  return names;
}

ida_projection::Constraints System::constraints() {
  ida_projection::Constraints all;
  all.count = constraint_count();
  all.names = constraint_names();
  all.value = [this](double t, ida_projection::ConstVector y, ida_projection::Vector g) {
    constraint_values(t, y.data(), g.data());
  };
  all.jacobian = ida_projection::DenseJacobian(
      [this](double t, ida_projection::ConstVector y, ida_projection::Matrix C) {
        constraint_jacobian(t, y.data(), ConstraintRows(C.data(), C.rows(), C.cols()));
      });
  return all;
}

// Of rows with different units, in SI.
double System::drift(double t, const double* y) {
  Eigen::VectorXd g(constraint_count());
  constraint_values(t, y, g.data());
  double largest = 0;
  const auto take = [&](double value, double unit) {
    largest = std::max(largest, std::abs(value) * unit);
  };
  rows_.each([&](const auto& row) {
    const double length = row.has_length ? units_.length : 1;
    for (int i = 0; i < row.count; ++i) {
      take(joint_values_[row.row + i], length);
      take(joint_values_[rows() + row.row + i], length / units_.time);
    }
  });
  int k = 2 * in_use_.count();
  for (const int end = k + moving(); k < end; ++k) take(g[k], 1);
  for (const double unit : invariants_.units(units_)) take(g[k++], unit);
  return largest;
}

}  // namespace tether::scene::smooth

// Tether: unknowns, state and equations of a smooth scene. SPDX-License-Identifier: BSD-3-Clause
#include "system.hpp"

#include "effects/list.hpp"
#include "mechanics/pair_forces.hpp"

namespace tether::scene::smooth {

System::System(const Scene& scene, const Units& units)
    : form_(scene.smooth.value_or(SmoothOptions{}).formulation),
      units_(units),
      bodies_(scene),
      rows_(scene, bodies_.all()),
      forces_(effects::make_forces(scene, bodies_.all())),
      in_use_(rows_, bodies_),
      invariants_(scene, bodies_, forces_, first_work()),
      dynamics_(rows_, bodies_, form_ == Formulation::index0),
      terms_{bodies_, rows_, forces_} {
  kinks_ = effects::kinks_of(scene);
  size_ = first_multiplier();
  if (form_ == Formulation::index1) size_ += rows();
  loads_.resize(at(moving()));
  joint_values_.setZero(2 * rows());
  if (form_ == Formulation::index0)
    acceleration_jacobian_ = std::make_unique<AccelerationJacobian>(terms_, dynamics_);
}

std::vector<std::string> System::dependent_joints(double t, const double* y) {
  constexpr double kNear = 1e-3;  // of rows of unit length
  std::vector<std::string> names;
  if (rows() == 0) return names;
  update(t, y);
  in_use_.choose_now();
  if (in_use_.weakest_pivot() > kNear) return names;
  SparseJointGradient gradient(rows_, bodies_);
  gradient.factor(std::vector<char>(at(rows()), 1), kNear);
  for (const int row : gradient.dependent()) {
    const std::string name = rows_.joint_of(row);
    if (!contains(names, name)) names.push_back(name);
  }
  return names;
}

void System::complete(double t, Eigen::VectorXd& y, Eigen::VectorXd& yp) {
  update(t, y.data());
  sum_forces(nullptr);
  torques_to_body_axes();
  dynamics_.solve(loads_);
  yp.setZero(size_);
  for (int k = 0; k < moving(); ++k) {
    const double* s = y.data() + kBody * k;
    double* p = yp.data() + kBody * k;
    Eigen::Map<Vector3d>(p + kPosition) = Eigen::Map<const Vector3d>(s + kVelocity);
    Eigen::Map<Eigen::Vector4d>(p + kQuaternion) =
        quaternion_rate(s + kQuaternion, Eigen::Map<const Vector3d>(s + kSpin));
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(p + kVelocity) =
        dynamics_.accelerations().segment<6>(6 * k);
  }
  const Eigen::VectorXd& lambda = dynamics_.multipliers();
  if (invariants_.has_work()) yp[first_work()] = power(lambda.data());
  if (form_ != Formulation::index0) y.segment(first_multiplier(), rows()) = lambda;
}

// Forces follow from the state: those among the unknowns are held to no tolerance.
scene::Forces System::forces(double t, const double* y, const joints::Reactions& reactions) {
  update(t, y);
  sum_forces(nullptr);
  torques_to_body_axes();
  dynamics_.solve(loads_);
  scene::Forces out;
  out.joints = reactions.find(rows_, bodies_.all(), dynamics_.multipliers().data());
  for (const auto& force : forces_) force->report(bodies_.all(), out);
  return out;
}

// Rows of joints on positions, on velocities, and norms of quaternions.
void System::row_values(double t, const double* y, double* g) {
  joint_values(t, y, joint_values_.data());
  const int p = in_use_.count();
  for (int k = 0; k < p; ++k) {
    const int row = in_use_.used()[at(k)];
    const bool kept = in_use_.keeps(row);
    g[k] = kept ? joint_values_[row] : 0.0;
    g[p + k] = kept ? joint_values_[rows() + row] : 0.0;
  }
  double* norms = g + 2 * p;
  for (int k = 0; k < moving(); ++k)
    norms[k] =
        0.5 * (Eigen::Map<const Eigen::Vector4d>(y + kBody * k + kQuaternion).squaredNorm() - 1.0);
}

// `entries(row, slot, place)`: where the derivatives by the coordinates of body `slot` begin, from
// its position on; `place`: among the moving bodies of the row.
template <class Place>
void System::row_jacobian(double t, const double* y, const Place& entries) {
  update(t, y);
  bodies_.set_turns(y);
  const Bodies& bodies = bodies_.all();
  const int p = in_use_.count();
  const auto put = [&](int row, const Inertia& inertia, int place, const Derivatives& d,
                       int first) {
    if (inertia.slot < 0) return;
    double* to = entries(row, inertia.slot, place);
    Eigen::Map<Eigen::RowVector3d>(to + kPosition) += d.segment<3>(first);
    Eigen::Map<Eigen::RowVector4d>(to + kQuaternion) +=
        d.segment<3>(first + 3).transpose() * bodies.turns[at(inertia.slot)];
    if (row < p) return;  // no velocities in rows on positions
    Eigen::Map<Eigen::Matrix<double, 1, 6>>(to + kVelocity) += d.segment<6>(first + 6);
  };
  rows_.each([&](const auto& row) {
    const Inertia &ia = bodies.inertia[at(row.first)], &ib = bodies.inertia[at(row.second)];
    const auto [A, B] = seed_pair(bodies, row.first, row.second);
    Dual g[3], rate[3];
    row.template rows<0>(A, B, g);
    row.template rows<1>(A, B, rate);
    for (int i = 0; i < row.count; ++i) {
      const int place = in_use_.place_of(row.row + i);
      if (!in_use_.keeps(row.row + i)) continue;
      put(place, ia, row.place_first, g[i].derivatives(), 0);
      put(place, ib, row.place_second, g[i].derivatives(), kBodyDirections);
      put(p + place, ia, row.place_first, rate[i].derivatives(), 0);
      put(p + place, ib, row.place_second, rate[i].derivatives(), kBodyDirections);
    }
  });
  for (int k = 0; k < moving(); ++k)
    Eigen::Map<Eigen::RowVector4d>(entries(2 * p + k, k, 0) + kQuaternion) =
        Eigen::Map<const Eigen::RowVector4d>(y + kBody * k + kQuaternion);
}

void System::constraint_jacobian(double t, const double* y, ConstraintRows C) {
  row_jacobian(t, y, [&](int row, int slot, int) { return &C(row, kBody * slot); });
  const int p = in_use_.count();
  for (int k = 0; k < p; ++k) {
    const int place = in_use_.place_of(in_use_.used()[at(k)]);
    if (place == k) continue;
    C.row(k) = C.row(place);
    C.row(p + k) = C.row(p + place);
  }
  if (invariants_.count() > 0) invariants_.jacobian(C, first_invariant());
}

// The same rows with their entries only. A row on positions has a body's position and quaternion,
// one on velocities its velocity, too, which come one after the other in y.
ida_projection::SparseJacobian System::sparse_row_jacobian() {
  const int p = in_use_.count();
  std::vector<std::vector<int>> slots(at(first_invariant()));
  rows_.each([&](const auto& row) {
    for (int i = 0; i < row.count; ++i)
      for (const int body : {row.first, row.second}) {
        const int slot = bodies_.all().inertia[at(body)].slot;
        if (slot < 0) continue;
        slots[at(row.row + i)].push_back(slot);
        slots[at(p + row.row + i)].push_back(slot);
      }
  });
  for (int k = 0; k < moving(); ++k) slots[at(2 * p + k)] = {k};
  const auto width = [p](int row) { return row < p || row >= 2 * p ? int{kVelocity} : int{kBody}; };
  ida_projection::SparseJacobian jacobian;
  jacobian.starts.push_back(0);
  for (int row = 0; row < first_invariant(); ++row) {
    sort_unique(slots[at(row)]);
    for (const int slot : slots[at(row)])
      for (int j = 0; j < width(row); ++j) jacobian.columns.push_back(kBody * slot + j);
    jacobian.starts.push_back(static_cast<int>(jacobian.columns.size()));
  }
  jacobian.fill = [this, width, starts = jacobian.starts](double t, ida_projection::ConstVector y,
                                                          ida_projection::Vector entries) {
    row_jacobian(t, y.data(), [&](int row, int, int place) {
      return entries.data() + starts[at(row)] + place * width(row);
    });
  };
  return jacobian;
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

ida_projection::Constraints System::dense_constraints() {
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

// Invariants are full rows, joined to the others.
ida_projection::Constraints System::sparse_constraints() {
  const std::vector<std::string> names = constraint_names();
  const auto invariant = names.begin() + first_invariant();
  ida_projection::Constraints joints;
  joints.count = first_invariant();
  joints.names.assign(names.begin(), invariant);
  joints.value = [this](double t, ida_projection::ConstVector y, ida_projection::Vector g) {
    row_values(t, y.data(), g.data());
  };
  joints.jacobian = sparse_row_jacobian();
  if (invariants_.count() == 0) return joints;
  ida_projection::Constraints kept;
  kept.count = invariants_.count();
  kept.names.assign(invariant, names.end());
  kept.value = [this](double t, ida_projection::ConstVector y, ida_projection::Vector g) {
    update(t, y.data());
    invariants_.values(t, y.data(), g.data());
  };
  kept.jacobian = ida_projection::DenseJacobian(
      [this](double t, ida_projection::ConstVector y, ida_projection::Matrix C) {
        update(t, y.data());
        bodies_.set_turns(y.data());
        invariants_.jacobian(ConstraintRows(C.data(), C.rows(), C.cols()), 0);
      });
  return joints + kept;
}

// Largest drift of rows with different units, in SI.
double System::drift(double t, const double* y) {
  Eigen::VectorXd g(constraint_count());
  constraint_values(t, y, g.data());
  double largest = 0;
  const auto take = [&](double value, double unit) {
    largest = std::max(largest, std::abs(value) * unit);
  };
  rows_.each([&](const auto& row) {
    const double length = row.measures == joints::MotionOf::length ? units_.length : 1;
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

// The residual of the equations of motion and its Jacobian.

void System::add_multipliers(const double* lambda) {
  const Bodies& bodies = bodies_.all();
  rows_.each([&](const auto& row) {
    const Frame<double>&A = bodies.frames[at(row.first)], &B = bodies.frames[at(row.second)];
    Wrench<double> a = no_wrench<double>(), b = no_wrench<double>();
    row.pull(A, B, lambda + row.row, a, b);
    put_wrench(bodies, row.first, a, loads_);
    put_wrench(bodies, row.second, b, loads_);
  });
}

double System::power(const double* lambda) const {
  double sum = 0;
  for (const auto& force : forces_)
    if (force->has_power()) sum += force->power(bodies_.all());
  if (rows_.has_motion())
    rows_.each([&](const auto& row) {
      double g_t[3];
      row.rate_by_time(g_t);
      for (int i = 0; i < row.count; ++i) sum -= lambda[row.row + i] * g_t[i];
    });
  return sum;
}

// x' - v, q' - q (0, w) / 2 and M (v', w') - f of every body.
void System::add_motion_residual(const double* y, const double* yp, double* r) const {
  using Map3 = Eigen::Map<const Vector3d>;
  using Map6 = Eigen::Map<const Eigen::Matrix<double, 6, 1>>;
  for (int k = 0; k < moving(); ++k) {
    const Inertia& inertia = bodies_.inertia(k);
    const double *s = y + kBody * k, *p = yp + kBody * k;
    double* out = r + kBody * k;
    Eigen::Map<Vector3d>(out + kPosition) = Map3(p + kPosition) - Map3(s + kVelocity);
    Eigen::Map<Eigen::Vector4d>(out + kQuaternion) =
        Eigen::Map<const Eigen::Vector4d>(p + kQuaternion) -
        quaternion_rate(s + kQuaternion, Map3(s + kSpin));
    if (form_ == Formulation::index0) {
      Eigen::Map<Eigen::Matrix<double, 6, 1>>(out + kVelocity) =
          Map6(p + kVelocity) - dynamics_.accelerations().segment<6>(6 * k);
    } else {
      Eigen::Map<Vector3d>(out + kVelocity) =
          inertia.mass * Map3(p + kVelocity) - loads_[at(k)].force;
      Eigen::Map<Vector3d>(out + kSpin) =
          inertia.inertia * Map3(p + kSpin) - loads_[at(k)].torque_body;
    }
  }
}

void System::residual(double t, const double* y, const double* yp, double* r, Stopwatch* watch) {
  const std::size_t joints = forces_.size(), bodies = joints + 1;
  const double* lambda = y + first_multiplier();
  if (watch) watch->start();
  update(t, y);
  if (watch) watch->lap(bodies);
  sum_forces(watch);

  const bool index0 = form_ == Formulation::index0;
  if (index0) {
    torques_to_body_axes();
    if (watch) watch->lap(bodies);
    dynamics_.solve(loads_);
    lambda = dynamics_.multipliers().data();
    if (watch) watch->lap(joints);
  } else {
    if (rows() > 0) add_multipliers(lambda);
    torques_to_body_axes();
    if (watch) watch->lap(joints);
  }
  add_motion_residual(y, yp, r);
  if (invariants_.has_work()) r[first_work()] = yp[first_work()] - power(lambda);
  if (watch) watch->lap(bodies);
  if (index0 || rows() == 0) return;
  add_row_residual(y, yp, r);
  if (watch) watch->lap(joints);
}

namespace {

// x' - v and q' - q (0, w) / 2 of the body whose unknowns are from `first` on.
void add_kinematic_jacobian(JacobianBlocks& J, int first, double cj, const double* q,
                            const Vector3d& w) {
  for (int i = 0; i < 3; ++i) {
    J.add(first + i, first + i, cj);
    J.add(first + i, first + kVelocity + i, -1.0);
  }
  const Eigen::Matrix4d Q = cj * Eigen::Matrix4d::Identity() - rate_by_quaternion(w);
  const Eigen::Matrix<double, 4, 3> W = -rate_by_spin(q);
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) J.add(first + kQuaternion + i, first + kQuaternion + j, Q(i, j));
    for (int j = 0; j < 3; ++j) J.add(first + kQuaternion + i, first + kSpin + j, W(i, j));
  }
}

}  // namespace

void System::jacobian(double t, double cj, const double* y, const double* yp, Entries& entries) {
  update(t, y);
  bodies_.set_turns(y);
  if (form_ == Formulation::index0) {
    index0_jacobian(cj, y, entries);
    return;
  }
  bodies_.set_accelerations(yp);
  JacobianBlocks J(entries, bodies_.all().turns, kBody, kVelocity, first_work());
  for (int k = 0; k < moving(); ++k) {
    const Inertia& inertia = bodies_.inertia(k);
    const int first = kBody * k;
    add_kinematic_jacobian(J, first, cj, y + first + kQuaternion, bodies_.spin(k));
    for (int i = 0; i < 3; ++i)
      J.add(first + kVelocity + i, first + kVelocity + i, cj * inertia.mass);
    J.add_block(first + kSpin, first + kSpin, cj * inertia.inertia);
  }
  terms_.add_motion(J, y + first_multiplier(), first_multiplier());
  if (invariants_.has_work()) {
    J.add(first_work(), first_work(), cj);
    terms_.add_power(J);
    if (rows_.has_motion())
      rows_.each([&](const auto& row) {
        double g_t[3];
        row.rate_by_time(g_t);
        for (int i = 0; i < row.count; ++i)
          J.add(first_work(), first_multiplier() + row.row + i, g_t[i]);
      });
  }
  for (int i = 0; i < rows(); ++i)
    J.add(first_multiplier() + i, first_multiplier() + i,
          in_use_.carries_multiplier(i) ? 0.0 : dynamics_.size_of_row()[i]);
  terms_.add_rows(J, first_multiplier(), &in_use_, cj);
}

void System::index0_jacobian(double cj, const double* y, Entries& entries) {
  sum_forces(nullptr);
  torques_to_body_axes();
  dynamics_.solve(loads_);
  dynamics_.set_accelerations();
  acceleration_jacobian_->form();
  const Eigen::MatrixXd& da = acceleration_jacobian_->accelerations();
  const int columns = kBody * moving();
  JacobianBlocks J(entries, bodies_.all().turns, kBody, kVelocity, first_work());
  for (int k = 0; k < moving(); ++k) {
    const int first = kBody * k;
    add_kinematic_jacobian(J, first, cj, y + first + kQuaternion, bodies_.spin(k));
    for (int i = 0; i < 6; ++i) {
      for (int column = 0; column < columns; ++column)
        J.add(first + kVelocity + i, column,
              (column == first + kVelocity + i ? cj : 0.0) - da(6 * k + i, column));
    }
  }
  if (!invariants_.has_work()) return;
  J.add(first_work(), first_work(), cj);
  terms_.add_power(J);
  if (!rows_.has_motion()) return;
  const Eigen::MatrixXd& dlambda = acceleration_jacobian_->multipliers();
  Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(columns);
  rows_.each([&](const auto& row) {
    double g_t[3];
    row.rate_by_time(g_t);
    for (int i = 0; i < row.count; ++i) sum += g_t[i] * dlambda.row(row.row + i);
  });
  for (int column = 0; column < columns; ++column) J.add(first_work(), column, sum[column]);
}

}  // namespace tether::scene::smooth

// Tether: the equations of motion of a smooth scene. SPDX-License-Identifier: BSD-3-Clause
#include "system.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tether/scene/words.hpp>

namespace tether::scene::smooth {

namespace {

constexpr double kTurn = 6.283185307179586;

// Index 0: of the diagonal of G M^-1 G^T.
constexpr double kEpsilon = 1e-11;

std::size_t at(int index) { return static_cast<std::size_t>(index); }

Now evaluate(const Motion& motion, double t) {
  const double speed = kTurn * motion.frequency, angle = speed * t + motion.phase;
  Now now;
  now.s = motion.rate * t + motion.amplitude * (std::sin(angle) - std::sin(motion.phase));
  now.s1 = motion.rate + motion.amplitude * speed * std::cos(angle);
  now.s2 = -motion.amplitude * speed * speed * std::sin(angle);
  return now;
}

Matrix3d rotation(const double* q) {
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
}

// q' = q (0, w) / 2
Eigen::Vector4d quaternion_rate(const double* q, const Vector3d& w) {
  return 0.5 * Eigen::Vector4d(-q[1] * w[0] - q[2] * w[1] - q[3] * w[2],
                               q[0] * w[0] + q[2] * w[2] - q[3] * w[1],
                               q[0] * w[1] + q[3] * w[0] - q[1] * w[2],
                               q[0] * w[2] + q[1] * w[1] - q[2] * w[0]);
}
// Its derivatives: q' = A(w) q = B(q) w.
Eigen::Matrix4d rate_by_quaternion(const Vector3d& w) {
  Eigen::Matrix4d A;
  A << 0, -w[0], -w[1], -w[2],  //
      w[0], 0, w[2], -w[1],     //
      w[1], -w[2], 0, w[0],     //
      w[2], w[1], -w[0], 0;
  return 0.5 * A;
}
Eigen::Matrix<double, 4, 3> rate_by_spin(const double* q) {
  Eigen::Matrix<double, 4, 3> B;
  B << -q[1], -q[2], -q[3],  //
      q[0], -q[3], q[2],     //
      q[3], q[0], -q[1],     //
      -q[2], q[1], q[0];
  return 0.5 * B;
}

Vector3d perpendicular(const Vector3d& axis) { return axis.unitOrthogonal(); }

}  // namespace

System::System(const Scene& scene) : form_(scene.smooth.value_or(SmoothOptions{}).formulation) {
  const std::size_t count = scene.bodies.size();
  bodies_.inertia.resize(count + 1);
  bodies_.frames.resize(count + 1);
  bodies_.w.assign(count + 1, Vector3d::Zero());
  for (std::size_t b = 0; b <= count; ++b) {
    Frame<double>& f = bodies_.frames[b];
    f.x = f.v = f.W = f.a = f.alpha = Vector3d::Zero();
    f.R = Matrix3d::Identity();
    if (b == count) continue;  // the world
    const Body& body = scene.bodies[b];
    f.x = body.position;
    f.R = body.orientation.normalized().toRotationMatrix();
    if (body.fixed) {
      if (!body.velocity.isZero(0.0) || !body.angular_velocity.isZero(0.0))
        throw std::invalid_argument("body \"" + body.name +
                                    "\" is fixed but has a velocity: a fixed body stands still");
      continue;
    }
    Inertia& inertia = bodies_.inertia[b];
    const Eigen::SelfAdjointEigenSolver<Matrix3d> moments(body.inertia, Eigen::EigenvaluesOnly);
    if (!(body.mass > 0) || !(moments.eigenvalues()[0] > 0))
      throw std::invalid_argument(
          "body \"" + body.name +
          "\" moves, so the smooth engine needs its mass and all three moments of inertia > 0 "
          "(a point mass: give it a small sphere)");
    inertia.slot = bodies_.moving++;
    inertia.mass = body.mass;
    inertia.inertia = body.inertia;
    inertia.inverse = body.inertia.inverse();
    body_of_slot_.push_back(static_cast<int>(b));
    const Eigen::Quaterniond q = body.orientation.normalized();
    const Vector3d w = f.R.transpose() * body.angular_velocity;
    for (int k = 0; k < 3; ++k) start_.push_back(body.position[k]);
    start_.insert(start_.end(), {q.w(), q.x(), q.y(), q.z()});
    for (int k = 0; k < 3; ++k) start_.push_back(body.velocity[k]);
    for (int k = 0; k < 3; ++k) start_.push_back(w[k]);
  }
  if (bodies_.moving == 0) throw std::invalid_argument("the scene has no body that can move");
  bodies_.turns.resize(at(bodies_.moving));

  add_joints(scene);
  count_independent_rows();
  effects_ = make_effects(scene, bodies_);
  add_invariants(scene);
  size_ = first_multiplier();
  if (form_ == Formulation::index1) size_ += m_;
  if (form_ == Formulation::stabilised_index2) size_ += 2 * m_;

  const int n = 6 * moving();
  loads_.resize(at(moving()));
  pulls_.resize(at(moving()));
  update(0.0, start_.data());
  form_gradient();
  lambda_.setZero(m_);
  gamma_.setZero(m_);
  right_.setZero(m_);
  scratch_.setZero(m_);
  a_.setZero(n);
  free_.setZero(n);
  factor_ = Eigen::LLT<Eigen::MatrixXd>(m_);
  size_of_row_ = S_.diagonal();
  epsilon_ = kEpsilon * size_of_row_;
  if (form_ == Formulation::index0) left_.setZero(n + m_, kBody * moving());
}

void System::add_joints(const Scene& scene) {
  const int world = static_cast<int>(scene.bodies.size());
  motions_.reserve(scene.joints.size());
  now_.resize(scene.joints.size());  // fixed now: rows keep pointers
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const Joint& joint = scene.joints[j];
    const std::string name =
        joint.name.empty() ? std::string(word(joint.kind)) + " " + std::to_string(j) : joint.name;
    joint_names_.push_back(name);
    Row row;
    row.first = joint.first < 0 ? world : joint.first;
    row.second = joint.second < 0 ? world : joint.second;
    row.joint = static_cast<int>(j);
    if (row.first == row.second || (!bodies_.moves(row.first) && !bodies_.moves(row.second)))
      throw std::invalid_argument("joint \"" + name +
                                  "\" joins nothing that can move against each other");
    const Frame<double>&A = bodies_.frames[at(row.first)], &B = bodies_.frames[at(row.second)];
    const auto point_of = [](const Frame<double>& f, const Vector3d& p) {
      return Vector3d(f.R.transpose() * (p - f.x));
    };
    const auto direction_of = [](const Frame<double>& f, const Vector3d& u) {
      return Vector3d(f.R.transpose() * u);
    };
    const Now* now = nullptr;
    if (joint.motion) {
      if (joint.kind == JointKind::ball || joint.kind == JointKind::fixed)
        throw std::invalid_argument("joint \"" + name + "\": a " + std::string(word(joint.kind)) +
                                    " joint has no motion to prescribe");
      now = &now_[motions_.size()];
      motions_.push_back(*joint.motion);
      has_motion_ = true;
    }
    if ((joint.kind == JointKind::hinge || joint.kind == JointKind::slider) &&
        !(joint.axis.norm() > 0))
      throw std::invalid_argument("joint \"" + name + "\": its axis has no length");

    const Vector3d z =
        joint.axis.norm() > 0 ? Vector3d(joint.axis.normalized()) : Vector3d(Vector3d::UnitZ());
    const Vector3d x = perpendicular(z), y = z.cross(x);
    const auto place = [&](auto each) {
      static_cast<Row&>(each) = row;
      each.row = m_;
      m_ += each.count;
      return each;
    };
    const auto coincide = [&] {
      Coincidence each;
      each.at_first = point_of(A, joint.at);
      each.at_second = point_of(B, joint.at);
      coincidences_.push_back(place(each));
    };
    const auto right_angle = [&](const Vector3d& u, const Vector3d& v) {
      RightAngle each;
      each.of_first = direction_of(A, u);
      each.of_second = direction_of(B, v);
      right_angles_.push_back(place(each));
    };
    const auto plane = [&](const Vector3d& normal, const Now* moves) {
      Plane each;
      each.at_first = point_of(A, joint.at);
      each.at_second = point_of(B, joint.at);
      each.normal = direction_of(B, normal);
      each.now = moves;
      planes_.push_back(place(each));
    };
    const auto same_attitude = [&] {
      right_angle(x, y);
      right_angle(y, z);
      right_angle(z, x);
    };
    switch (joint.kind) {
      case JointKind::ball:
        coincide();
        break;
      case JointKind::hinge:
        coincide();
        right_angle(z, x);
        right_angle(z, y);
        if (now) {
          Angle each;
          each.of_first = direction_of(A, x);
          each.zero = direction_of(B, x);
          each.ahead = direction_of(B, y);
          each.now = now;
          angles_.push_back(place(each));
        }
        break;
      case JointKind::slider:
        same_attitude();
        plane(x, nullptr);
        plane(y, nullptr);
        if (now) plane(z, now);
        break;
      case JointKind::fixed:
        coincide();
        same_attitude();
        break;
      case JointKind::distance: {
        Distance each;
        each.at_first = point_of(A, joint.at);
        each.at_second = point_of(B, joint.at_second);
        each.length = joint.length ? *joint.length : (joint.at_second - joint.at).norm();
        each.now = now;
        if (!(each.length > 0))
          throw std::invalid_argument("joint \"" + name +
                                      "\": a distance must be > 0; two points in one place are a "
                                      "ball joint");
        distances_.push_back(place(each));
        break;
      }
    }
  }
}

double System::absolute_tolerance(int i, double tolerance) const {
  // Multipliers follow the state; where rows depend on each other they are known to round-off / eps
  // only, and at a dead point they have a pole. Newton's test is left to the state.
  return i < first_multiplier() ? tolerance : 1e10 * tolerance;
}

Eigen::VectorXd System::start_state() const {
  Eigen::VectorXd y = Eigen::VectorXd::Zero(size_);
  std::copy(start_.begin(), start_.end(), y.data());
  return y;
}

void System::update(double t, const double* y) {
  for (std::size_t i = 0; i < motions_.size(); ++i) now_[i] = evaluate(motions_[i], t);
  for (int k = 0; k < moving(); ++k) {
    const int b = body_of_slot_[at(k)];
    Frame<double>& f = bodies_.frames[at(b)];
    const double* s = y + kBody * k;
    f.x = Eigen::Map<const Vector3d>(s + kPosition);
    f.R = rotation(s + kQuaternion);
    f.v = Eigen::Map<const Vector3d>(s + kVelocity);
    bodies_.w[at(b)] = Eigen::Map<const Vector3d>(s + kSpin);
    f.W = f.R * bodies_.w[at(b)];
  }
}

void System::update_accelerations(const double* yp) {
  for (int k = 0; k < moving(); ++k) {
    Frame<double>& f = bodies_.frames[at(body_of_slot_[at(k)])];
    f.a = Eigen::Map<const Vector3d>(yp + kBody * k + kVelocity);
    f.alpha = f.R * Eigen::Map<const Vector3d>(yp + kBody * k + kSpin);
  }
}

void System::add_multipliers(const double* lambda, std::vector<Load6>& loads) const {
  each_row([&](const auto& row) {
    const Frame<double>&A = bodies_.frames[at(row.first)], &B = bodies_.frames[at(row.second)];
    Wrench<double> a = no_wrench<double>(), b = no_wrench<double>();
    row.pull(A, B, lambda + row.row, a, b);
    const auto put = [&](int body, const Wrench<double>& wrench) {
      const int slot = bodies_.inertia[at(body)].slot;
      if (slot < 0) return;
      loads[at(slot)].force += wrench.force;
      loads[at(slot)].torque_world += wrench.torque;
    };
    put(row.first, a);
    put(row.second, b);
  });
}

void System::torques_to_body_axes(std::vector<Load6>& loads) const {
  for (int k = 0; k < moving(); ++k) {
    Load6& load = loads[at(k)];
    load.torque_body += bodies_.frames[at(body_of_slot_[at(k)])].R.transpose() * load.torque_world;
  }
}

void System::sum_forces(Stopwatch* watch) {
  for (Load6& load : loads_) load.force = load.torque_body = load.torque_world = Vector3d::Zero();
  for (std::size_t i = 0; i < effects_.size(); ++i) {
    effects_[i]->add(bodies_, loads_);
    if (watch) watch->lap(i);
  }
}

void System::form_gradient() {
  G_.setZero(m_, 6 * moving());
  GM_.resize(m_, 6 * moving());
  each_row([&](const auto& row) {
    const Frame<double>&A = bodies_.frames[at(row.first)], &B = bodies_.frames[at(row.second)];
    double unit[3] = {0, 0, 0};
    for (int i = 0; i < row.count; ++i) {
      unit[i] = 1.0;
      Wrench<double> a = no_wrench<double>(), b = no_wrench<double>();
      row.pull(A, B, unit, a, b);
      unit[i] = 0.0;
      const auto put = [&](int body, const Frame<double>& f, const Wrench<double>& wrench) {
        const int slot = bodies_.inertia[at(body)].slot;
        if (slot < 0) return;
        G_.block<1, 3>(row.row + i, 6 * slot) += wrench.force.transpose();
        G_.block<1, 3>(row.row + i, 6 * slot + 3) += (f.R.transpose() * wrench.torque).transpose();
      };
      put(row.first, A, a);
      put(row.second, B, b);
    }
  });
  for (int k = 0; k < moving(); ++k) {
    const Inertia& inertia = bodies_.inertia[at(body_of_slot_[at(k)])];
    GM_.middleCols<3>(6 * k) = G_.middleCols<3>(6 * k) / inertia.mass;
    GM_.middleCols<3>(6 * k + 3).noalias() = G_.middleCols<3>(6 * k + 3) * inertia.inverse;
  }
  S_.noalias() = GM_ * G_.transpose();
}

void System::solve_multipliers() {
  for (int k = 0; k < moving(); ++k) {
    const int b = body_of_slot_[at(k)];
    const Inertia& inertia = bodies_.inertia[at(b)];
    free_.segment<3>(6 * k) = loads_[at(k)].force / inertia.mass;
    free_.segment<3>(6 * k + 3) = inertia.inverse * loads_[at(k)].torque_body;
    bodies_.frames[at(b)].a.setZero();
    bodies_.frames[at(b)].alpha.setZero();
  }
  a_ = free_;
  if (m_ == 0) return;
  form_gradient();
  each_row([&](const auto& row) {
    row.template rows<2>(bodies_.frames[at(row.first)], bodies_.frames[at(row.second)],
                         gamma_.data() + row.row);
  });
  right_ = -gamma_;
  right_.noalias() -= G_ * free_;
  regular_ = S_;
  regular_.diagonal() += epsilon_;
  factor_.compute(regular_);
  // Refined, so that eps decides only where the rows do not.
  lambda_.setZero();
  for (int pass = 0; pass < 3; ++pass) {
    scratch_ = right_;
    scratch_.noalias() -= S_ * lambda_;
    factor_.solveInPlace(scratch_);
    lambda_ += scratch_;
  }
  a_.noalias() += GM_.transpose() * lambda_;
}

double System::power(const double* lambda) const {
  double sum = 0;
  for (const auto& effect : effects_)
    if (effect->has_power()) sum += effect->power(bodies_);
  if (has_motion_)
    each_row([&](const auto& row) {
      double g_t[3];
      row.rate_by_time(g_t);
      for (int i = 0; i < row.count; ++i) sum -= lambda[row.row + i] * g_t[i];
    });
  return sum;
}

void System::complete(double t, Eigen::VectorXd& y, Eigen::VectorXd& yp) {
  update(t, y.data());
  sum_forces(nullptr);
  torques_to_body_axes(loads_);
  solve_multipliers();
  yp.setZero(size_);
  for (int k = 0; k < moving(); ++k) {
    const double* s = y.data() + kBody * k;
    double* p = yp.data() + kBody * k;
    Eigen::Map<Vector3d>(p + kPosition) = Eigen::Map<const Vector3d>(s + kVelocity);
    Eigen::Map<Eigen::Vector4d>(p + kQuaternion) =
        quaternion_rate(s + kQuaternion, Eigen::Map<const Vector3d>(s + kSpin));
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(p + kVelocity) = a_.segment<6>(6 * k);
  }
  if (has_work_) yp[first_work()] = power(lambda_.data());
  if (form_ != Formulation::index0) y.segment(first_multiplier(), m_) = lambda_;
  if (form_ == Formulation::stabilised_index2) y.segment(first_eta(), m_).setZero();
}

// In the place of a row that depends on others: its multiplier is 0.
void System::pin_multipliers(const double* multipliers, double* rows) const {
  for (int i = 0; i < m_; ++i)
    if (!carries_[at(i)]) rows[i] = size_of_row_[i] * multipliers[i];
}

void System::residual(double t, const double* y, const double* yp, double* r, Stopwatch* watch) {
  const std::size_t joints = effects_.size(), bodies = joints + 1;
  const double* lambda = y + first_multiplier();
  if (watch) watch->start();
  update(t, y);
  if (watch) watch->lap(bodies);
  sum_forces(watch);

  const bool index0 = form_ == Formulation::index0;
  const bool index2 = form_ == Formulation::stabilised_index2;
  if (index0) {
    torques_to_body_axes(loads_);
    if (watch) watch->lap(bodies);
    solve_multipliers();
    lambda = lambda_.data();
    if (watch) watch->lap(joints);
  } else {
    if (m_ > 0) add_multipliers(lambda, loads_);
    torques_to_body_axes(loads_);
    if (index2) {
      for (Load6& pull : pulls_)
        pull.force = pull.torque_body = pull.torque_world = Vector3d::Zero();
      add_multipliers(y + first_eta(), pulls_);
      torques_to_body_axes(pulls_);
    }
    if (watch) watch->lap(joints);
  }

  for (int k = 0; k < moving(); ++k) {
    const Inertia& inertia = bodies_.inertia[at(body_of_slot_[at(k)])];
    const double *s = y + kBody * k, *p = yp + kBody * k;
    double* out = r + kBody * k;
    using Map3 = Eigen::Map<const Vector3d>;
    Vector3d v = Map3(s + kVelocity), w = Map3(s + kSpin);
    if (index2) {
      v += pulls_[at(k)].force / inertia.mass;
      w += inertia.inverse * pulls_[at(k)].torque_body;
    }
    Eigen::Map<Vector3d>(out + kPosition) = Map3(p + kPosition) - v;
    Eigen::Map<Eigen::Vector4d>(out + kQuaternion) =
        Eigen::Map<const Eigen::Vector4d>(p + kQuaternion) - quaternion_rate(s + kQuaternion, w);
    if (index0) {
      Eigen::Map<Eigen::Matrix<double, 6, 1>>(out + kVelocity) =
          Eigen::Map<const Eigen::Matrix<double, 6, 1>>(p + kVelocity) - a_.segment<6>(6 * k);
    } else {
      Eigen::Map<Vector3d>(out + kVelocity) =
          inertia.mass * Map3(p + kVelocity) - loads_[at(k)].force;
      Eigen::Map<Vector3d>(out + kSpin) =
          inertia.inertia * Map3(p + kSpin) - loads_[at(k)].torque_body;
    }
  }
  if (has_work_) r[first_work()] = yp[first_work()] - power(lambda);
  if (watch) watch->lap(bodies);
  if (index0 || m_ == 0) return;

  double* out = r + first_multiplier();
  if (index2) {
    double* positions = r + first_eta();
    each_row([&](const auto& row) {
      const Frame<double>&A = bodies_.frames[at(row.first)], &B = bodies_.frames[at(row.second)];
      row.template rows<1>(A, B, out + row.row);
      row.template rows<0>(A, B, positions + row.row);
    });
    pin_multipliers(y + first_eta(), positions);
  } else {
    update_accelerations(yp);
    each_row([&](const auto& row) {
      row.template rows<2>(bodies_.frames[at(row.first)], bodies_.frames[at(row.second)],
                           out + row.row);
    });
  }
  pin_multipliers(lambda, out);
  if (watch) watch->lap(joints);
}

// Derivatives of the equations of motion (and of the work) to y and lambda, y' fixed.
void System::add_motion_jacobian(JacobianBlocks& J, const double* lambda, int first_lambda) {
  for (const auto& effect : effects_) effect->add_jacobian(bodies_, J);
  each_row([&](const auto& row) {
    const Inertia &ia = bodies_.inertia[at(row.first)], &ib = bodies_.inertia[at(row.second)];
    const Frame<Dual> A = seed(bodies_.frames[at(row.first)], ia.slot >= 0, 0);
    const Frame<Dual> B = seed(bodies_.frames[at(row.second)], ib.slot >= 0, kBodyDirections);
    Wrench<Dual> a = no_wrench<Dual>(), b = no_wrench<Dual>();
    row.pull(A, B, lambda + row.row, a, b);
    const auto put = [&](const Inertia& inertia, const Frame<Dual>& f, const Wrench<Dual>& wrench) {
      if (inertia.slot < 0) return;
      const Vector3<Dual> torque = transposed_times(f.R, wrench.torque);
      for (int i = 0; i < 6; ++i) {
        const Derivatives& d = (i < 3 ? wrench.force[i] : torque[i - 3]).derivatives();
        const int r = J.motion_row(inertia.slot, i);
        if (ia.slot >= 0) J.add_directions(r, ia.slot, d, 0, -1.0);
        if (ib.slot >= 0) J.add_directions(r, ib.slot, d, kBodyDirections, -1.0);
      }
    };
    put(ia, A, a);
    put(ib, B, b);
    if (first_lambda < 0) return;
    // -G^T
    double unit[3] = {0, 0, 0};
    for (int i = 0; i < row.count; ++i) {
      unit[i] = 1.0;
      Wrench<double> on_a = no_wrench<double>(), on_b = no_wrench<double>();
      row.pull(bodies_.frames[at(row.first)], bodies_.frames[at(row.second)], unit, on_a, on_b);
      unit[i] = 0.0;
      const auto column = [&](int body, const Wrench<double>& wrench) {
        const int slot = bodies_.inertia[at(body)].slot;
        if (slot < 0) return;
        const Vector3d torque = bodies_.frames[at(body)].R.transpose() * wrench.torque;
        for (int k = 0; k < 3; ++k) {
          J.add(J.motion_row(slot, k), first_lambda + row.row + i, -wrench.force[k]);
          J.add(J.motion_row(slot, 3 + k), first_lambda + row.row + i, -torque[k]);
        }
      };
      column(row.first, on_a);
      column(row.second, on_b);
    }
  });
}

// Derivatives of the order-th rate of g to y, and with cj to the accelerations.
template <int order>
void System::add_row_jacobian(JacobianBlocks& J, int first_row, bool carried_only,
                              bool accelerations, double cj) {
  each_row([&](const auto& row) {
    const Inertia &ia = bodies_.inertia[at(row.first)], &ib = bodies_.inertia[at(row.second)];
    const Frame<Dual> A = seed(bodies_.frames[at(row.first)], ia.slot >= 0, 0);
    const Frame<Dual> B = seed(bodies_.frames[at(row.second)], ib.slot >= 0, kBodyDirections);
    Dual g[3], rate[3];
    row.template rows<order>(A, B, g);
    if (accelerations) row.template rows<1>(A, B, rate);
    for (int i = 0; i < row.count; ++i) {
      Derivatives d = g[i].derivatives();
      // g'' depends on accelerations as g' does on velocities.
      if (accelerations) {
        d.segment<6>(6) += cj * rate[i].derivatives().template segment<6>(6);
        d.segment<6>(18) += cj * rate[i].derivatives().template segment<6>(18);
      }
      const double factor = carried_only && !carries_[at(row.row + i)] ? 0.0 : 1.0;
      if (ia.slot >= 0) J.add_directions(first_row + row.row + i, ia.slot, d, 0, factor);
      if (ib.slot >= 0)
        J.add_directions(first_row + row.row + i, ib.slot, d, kBodyDirections, factor);
    }
  });
}

void System::jacobian(double t, double cj, const double* y, const double* yp, Entries& entries) {
  update(t, y);
  for (int k = 0; k < moving(); ++k)
    bodies_.turns[at(k)] = turn_of_quaternion(y + kBody * k + kQuaternion);
  if (form_ == Formulation::index0) {
    index0_jacobian(cj, y, yp, entries);
    return;
  }
  update_accelerations(yp);
  const bool index2 = form_ == Formulation::stabilised_index2;
  const double* lambda = y + first_multiplier();
  JacobianBlocks J(entries, bodies_.turns, kBody, kVelocity, first_work());
  for (int k = 0; k < moving(); ++k) {
    const Inertia& inertia = bodies_.inertia[at(body_of_slot_[at(k)])];
    const int first = kBody * k;
    const double* q = y + first + kQuaternion;
    for (int i = 0; i < 3; ++i) {
      J.add(first + i, first + i, cj);
      J.add(first + i, first + kVelocity + i, -1.0);
      J.add(first + kVelocity + i, first + kVelocity + i, cj * inertia.mass);
    }
    Vector3d w = bodies_.w[at(body_of_slot_[at(k)])];
    if (index2) w += inertia.inverse * pulls_[at(k)].torque_body;
    const Eigen::Matrix4d Q = cj * Eigen::Matrix4d::Identity() - rate_by_quaternion(w);
    const Eigen::Matrix<double, 4, 3> W = -rate_by_spin(q);
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) J.add(first + kQuaternion + i, first + kQuaternion + j, Q(i, j));
      for (int j = 0; j < 3; ++j) J.add(first + kQuaternion + i, first + kSpin + j, W(i, j));
    }
    J.add_block(first + kSpin, first + kSpin, cj * inertia.inertia);
  }
  add_motion_jacobian(J, lambda, first_multiplier());
  if (has_work_) {
    J.add(first_work(), first_work(), cj);
    for (const auto& effect : effects_)
      if (effect->has_power()) effect->add_power_jacobian(bodies_, J);
    if (has_motion_)
      each_row([&](const auto& row) {
        double g_t[3];
        row.rate_by_time(g_t);
        for (int i = 0; i < row.count; ++i)
          J.add(first_work(), first_multiplier() + row.row + i, g_t[i]);
      });
  }
  const auto pin = [&](int first) {
    for (int i = 0; i < m_; ++i)
      J.add(first + i, first + i, carries_[at(i)] ? 0.0 : size_of_row_[i]);
  };
  pin(first_multiplier());
  if (!index2) {
    add_row_jacobian<2>(J, first_multiplier(), true, true, cj);
    return;
  }
  add_row_jacobian<1>(J, first_multiplier(), true, false, 0.0);
  add_row_jacobian<0>(J, first_eta(), true, false, 0.0);
  pin(first_eta());
  // eta moves x and q; its own size is that of the drift, so that d(G^T)/dq eta is left out.
  each_row([&](const auto& row) {
    double unit[3] = {0, 0, 0};
    for (int i = 0; i < row.count; ++i) {
      unit[i] = 1.0;
      Wrench<double> on_a = no_wrench<double>(), on_b = no_wrench<double>();
      row.pull(bodies_.frames[at(row.first)], bodies_.frames[at(row.second)], unit, on_a, on_b);
      unit[i] = 0.0;
      const auto column = [&](int body, const Wrench<double>& wrench) {
        const Inertia& inertia = bodies_.inertia[at(body)];
        if (inertia.slot < 0) return;
        const int first = kBody * inertia.slot;
        const Vector3d spin =
            inertia.inverse * (bodies_.frames[at(body)].R.transpose() * wrench.torque);
        const Eigen::Vector4d turn = quaternion_rate(y + first + kQuaternion, spin);
        for (int k = 0; k < 3; ++k)
          J.add(first + k, first_eta() + row.row + i, -wrench.force[k] / inertia.mass);
        for (int k = 0; k < 4; ++k)
          J.add(first + kQuaternion + k, first_eta() + row.row + i, -turn[k]);
      };
      column(row.first, on_a);
      column(row.second, on_b);
    }
  });
}

// With D = -d(f + G^T lambda)/dy and A = dg''/dy at fixed a and lambda:
// M da = G^T dlambda - D dy, G da = -A dy.
void System::index0_jacobian(double cj, const double* y, const double*, Entries& entries) {
  const int n = 6 * moving(), columns = kBody * moving();
  sum_forces(nullptr);
  torques_to_body_axes(loads_);
  solve_multipliers();
  for (int k = 0; k < moving(); ++k) {
    Frame<double>& f = bodies_.frames[at(body_of_slot_[at(k)])];
    f.a = a_.segment<3>(6 * k);
    f.alpha = f.R * a_.segment<3>(6 * k + 3);
  }
  const int pitch = n + m_;
  const auto partials = [&] {
    JacobianBlocks D(dense_entries_, bodies_.turns, 6, 0, 0);
    add_motion_jacobian(D, lambda_.data(), -1);
    add_row_jacobian<2>(D, n, false, false, 0.0);
  };
  if (!dense_recorded_) {
    dense_entries_.record();
    partials();
    std::vector<int> slots;
    for (const auto& [row, column] : dense_entries_.places) slots.push_back(row + pitch * column);
    dense_entries_.finish(std::move(slots));
    dense_recorded_ = true;
  }
  left_.setZero();
  dense_entries_.begin(left_.data());
  partials();

  Eigen::MatrixXd da = -left_.topRows(n);  // M^-1 (-D)
  for (int k = 0; k < moving(); ++k) {
    const Inertia& inertia = bodies_.inertia[at(body_of_slot_[at(k)])];
    da.middleRows<3>(6 * k) /= inertia.mass;
    da.middleRows<3>(6 * k + 3) = (inertia.inverse * da.middleRows<3>(6 * k + 3)).eval();
  }
  if (m_ > 0) {
    const Eigen::MatrixXd dlambda = factor_.solve(-left_.bottomRows(m_) - G_ * da);
    da += GM_.transpose() * dlambda;
    dense_ = dlambda;
  }

  JacobianBlocks J(entries, bodies_.turns, kBody, kVelocity, first_work());
  for (int k = 0; k < moving(); ++k) {
    const int first = kBody * k;
    const double* q = y + first + kQuaternion;
    for (int i = 0; i < 3; ++i) {
      J.add(first + i, first + i, cj);
      J.add(first + i, first + kVelocity + i, -1.0);
    }
    const Eigen::Matrix4d Q =
        cj * Eigen::Matrix4d::Identity() - rate_by_quaternion(bodies_.w[at(body_of_slot_[at(k)])]);
    const Eigen::Matrix<double, 4, 3> W = -rate_by_spin(q);
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) J.add(first + kQuaternion + i, first + kQuaternion + j, Q(i, j));
      for (int j = 0; j < 3; ++j) J.add(first + kQuaternion + i, first + kSpin + j, W(i, j));
    }
    for (int i = 0; i < 6; ++i) {
      for (int column = 0; column < columns; ++column)
        J.add(first + kVelocity + i, column,
              (column == first + kVelocity + i ? cj : 0.0) - da(6 * k + i, column));
    }
  }
  if (!has_work_) return;
  J.add(first_work(), first_work(), cj);
  for (const auto& effect : effects_)
    if (effect->has_power()) effect->add_power_jacobian(bodies_, J);
  if (has_motion_) {
    Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(columns);
    each_row([&](const auto& row) {
      double g_t[3];
      row.rate_by_time(g_t);
      for (int i = 0; i < row.count; ++i) sum += g_t[i] * dense_.row(row.row + i);
    });
    for (int column = 0; column < columns; ++column) J.add(first_work(), column, sum[column]);
  }
}

void System::bodies(const double* y, std::vector<BodyState>& out) const {
  for (int k = 0; k < moving(); ++k) {
    const double* s = y + kBody * k;
    BodyState& body = out[at(body_of_slot_[at(k)])];
    body.position = Eigen::Map<const Vector3d>(s + kPosition);
    body.orientation = Eigen::Quaterniond(s[3], s[4], s[5], s[6]).normalized();
    body.velocity = Eigen::Map<const Vector3d>(s + kVelocity);
    body.angular_velocity = body.orientation * Vector3d(Eigen::Map<const Vector3d>(s + kSpin));
  }
}

std::vector<std::string> System::effect_names() const {
  std::vector<std::string> names;
  for (const auto& effect : effects_) names.emplace_back(effect->name());
  names.emplace_back("joints");
  names.emplace_back("equations of motion");
  return names;
}

}  // namespace tether::scene::smooth

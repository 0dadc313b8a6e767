// Tether: what the projection keeps. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tether/scene/words.hpp>
#include <type_traits>

#include "system.hpp"

namespace tether::scene::smooth {

namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

// Directions u through the origin about which nothing outside exerts a torque: u (3 x k).
class FreeAxes {
 public:
  // Only the direction u is left, if it is there.
  void only(const Vector3d& u, const std::string& because) {
    const Vector3d inside = basis_ * (basis_.transpose() * u);
    if (basis_.cols() > 0 && (inside - u).norm() < 1e-9 * u.norm())
      basis_ = u.normalized();
    else
      none(because);
    if (reason_.empty()) reason_ = because;
  }
  void none(const std::string& because) {
    if (basis_.cols() > 0) reason_ = because;
    basis_.resize(3, 0);
  }
  const Eigen::Matrix<double, 3, Eigen::Dynamic>& basis() const { return basis_; }
  const std::string& reason() const { return reason_; }

 private:
  Eigen::Matrix<double, 3, Eigen::Dynamic> basis_ = Matrix3d::Identity();
  std::string reason_;
};

}  // namespace

void System::add_invariants(const Scene& scene) {
  const int world = static_cast<int>(scene.bodies.size());
  const auto outside = [&](int body) { return !bodies_.moves(body < 0 ? world : body); };
  const auto is_held = [&](int first, int second) { return outside(first) || outside(second); };
  bool angular = false;
  for (const Invariant& each : scene.invariants) {
    if (!each.project) continue;
    keeps_energy_ = keeps_energy_ || each.kind == InvariantKind::energy;
    keeps_momentum_ = keeps_momentum_ || each.kind == InvariantKind::momentum;
    angular = angular || each.kind == InvariantKind::angular_momentum;
  }
  if (keeps_energy_) {
    has_work_ = has_motion_;
    for (const auto& effect : effects_) has_work_ = has_work_ || effect->has_power();
  }
  if (keeps_momentum_) {
    const auto refuse = [](const std::string& what) {
      throw std::invalid_argument("momentum is not invariant here: " + what +
                                  " pushes from outside; give it project = false");
    };
    for (std::size_t j = 0; j < scene.joints.size(); ++j)
      if (is_held(scene.joints[j].first, scene.joints[j].second))
        refuse("joint \"" + joint_names_[j] + "\"");
    for (const Spring& spring : scene.springs)
      if (is_held(spring.first, spring.second)) refuse("spring \"" + spring.name + "\"");
    for (const Body& body : scene.bodies) {
      if (body.drag && !body.fixed) refuse("the drag of body \"" + body.name + "\"");
      if (!body.fixed && scene.gravity) steady_force_ += body.mass * *scene.gravity;
    }
    for (const Load& load : scene.loads)
      if (!outside(load.body)) steady_force_ += load.force;
  }
  kept_axes_.resize(0, 3);
  if (angular) {
    FreeAxes axes;
    if (scene.gravity && scene.gravity->norm() > 0)
      axes.only(scene.gravity->normalized(), "gravity leaves the direction of its own only");
    for (std::size_t j = 0; j < scene.joints.size(); ++j) {
      const Joint& joint = scene.joints[j];
      if (!is_held(joint.first, joint.second)) continue;
      const std::string because = "joint \"" + joint_names_[j] + "\" holds from outside";
      const Vector3d at_outside =
          joint.kind == JointKind::distance && outside(joint.second) ? joint.at_second : joint.at;
      const bool at_origin = at_outside.norm() < 1e-12;
      if (joint.kind == JointKind::ball || joint.kind == JointKind::distance) {
        if (!at_origin) axes.only(at_outside.normalized(), because);
      } else if (joint.kind == JointKind::hinge && !joint.motion &&
                 joint.at.cross(joint.axis).norm() < 1e-12 * joint.axis.norm()) {
        axes.only(joint.axis.normalized(), because);
      } else {
        axes.none(because);
      }
    }
    for (const Spring& spring : scene.springs)
      if (is_held(spring.first, spring.second)) {
        const Vector3d p = outside(spring.second) ? spring.at_second : spring.at;
        const std::string because = "spring \"" + spring.name + "\" holds from outside";
        if (p.norm() > 1e-12) axes.only(p.normalized(), because);
      }
    for (const Body& body : scene.bodies)
      if (body.drag && !body.fixed) axes.none("the drag of body \"" + body.name + "\"");
    if (!scene.loads.empty()) axes.none("a load");
    if (axes.basis().cols() == 0)
      throw std::invalid_argument(
          "angular momentum about the origin is not invariant here in any direction: " +
          axes.reason() + "; give it project = false");
    kept_axes_ = axes.basis().transpose();
  }
  kept_.assign(at((keeps_energy_ ? 1 : 0) + (keeps_momentum_ ? 3 : 0)) +
                   at(static_cast<int>(kept_axes_.rows())),
               0.0);
}

double System::energy() const {
  double sum = 0;
  for (int k = 0; k < moving(); ++k) {
    const int b = body_of_slot_[at(k)];
    const Inertia& inertia = bodies_.inertia[at(b)];
    const Vector3d& w = bodies_.w[at(b)];
    sum +=
        0.5 * (inertia.mass * bodies_.frames[at(b)].v.squaredNorm() + w.dot(inertia.inertia * w));
  }
  for (const auto& effect : effects_) sum += effect->potential(bodies_);
  return sum;
}

Vector3d System::momentum() const {
  Vector3d sum = Vector3d::Zero();
  for (const int b : body_of_slot_) sum += bodies_.inertia[at(b)].mass * bodies_.frames[at(b)].v;
  return sum;
}

Vector3d System::angular_momentum() const {
  Vector3d sum = Vector3d::Zero();
  for (const int b : body_of_slot_) {
    const Frame<double>& f = bodies_.frames[at(b)];
    const Inertia& inertia = bodies_.inertia[at(b)];
    sum += inertia.mass * f.x.cross(f.v) + f.R * (inertia.inertia * bodies_.w[at(b)]);
  }
  return sum;
}

void System::keep_invariants_of(double t, const Eigen::VectorXd& y) {
  update(t, y.data());
  std::fill(kept_.begin(), kept_.end(), 0.0);
  if (kept_.empty()) return;
  std::vector<double> values(kept_.size());
  invariant_values(t, y.data(), values.data());
  kept_ = values;
}

void System::invariant_values(double t, const double* y, double* g) const {
  int row = 0;
  if (keeps_energy_) {
    g[row] = energy() - kept_[at(row)];
    if (has_work_) g[row] -= y[first_work()];
    ++row;
  }
  if (keeps_momentum_) {
    const Vector3d P = momentum() - t * steady_force_;
    for (int k = 0; k < 3; ++k, ++row) g[row] = P[k] - kept_[at(row)];
  }
  if (kept_axes_.rows() > 0) {
    const Vector3d L = angular_momentum();
    for (int k = 0; k < kept_axes_.rows(); ++k, ++row)
      g[row] = kept_axes_.row(k).dot(L) - kept_[at(row)];
  }
}

void System::invariant_jacobian(Rows C, int row) const {
  if (keeps_energy_) {
    for (int k = 0; k < moving(); ++k) {
      const int b = body_of_slot_[at(k)];
      const Inertia& inertia = bodies_.inertia[at(b)];
      C.row(row).segment<3>(kBody * k + kVelocity) += inertia.mass * bodies_.frames[at(b)].v;
      C.row(row).segment<3>(kBody * k + kSpin) += inertia.inertia * bodies_.w[at(b)];
    }
    for (const auto& effect : effects_) effect->add_potential_gradient(bodies_, C.row(row).data());
    if (has_work_) C(row, first_work()) -= 1.0;
    ++row;
  }
  if (keeps_momentum_) {
    for (int k = 0; k < moving(); ++k) {
      const double mass = bodies_.inertia[at(body_of_slot_[at(k)])].mass;
      for (int i = 0; i < 3; ++i) C(row + i, kBody * k + kVelocity + i) += mass;
    }
    row += 3;
  }
  // u . (x x m v + R I w)
  for (int i = 0; i < kept_axes_.rows(); ++i, ++row) {
    const Vector3d u = kept_axes_.row(i).transpose();
    for (int k = 0; k < moving(); ++k) {
      const int b = body_of_slot_[at(k)];
      const Inertia& inertia = bodies_.inertia[at(b)];
      const Frame<double>& f = bodies_.frames[at(b)];
      const int first = kBody * k;
      const Vector3d u_body = f.R.transpose() * u, spin = inertia.inertia * bodies_.w[at(b)];
      C.row(row).segment<3>(first + kPosition) += inertia.mass * f.v.cross(u);
      C.row(row).segment<3>(first + kVelocity) += inertia.mass * u.cross(f.x);
      C.row(row).segment<4>(first + kQuaternion) +=
          spin.cross(u_body).transpose() * bodies_.turns[at(k)];
      C.row(row).segment<3>(first + kSpin) += inertia.inertia * u_body;
    }
  }
}

int System::constraint_count() const { return 2 * p_ + moving() + static_cast<int>(kept_.size()); }

void System::joint_values(double t, const double* y, double* g) {
  update(t, y);
  each_row([&](const auto& row) {
    const Frame<double>&A = bodies_.frames[at(row.first)], &B = bodies_.frames[at(row.second)];
    row.template rows<0>(A, B, g + row.row);
    row.template rows<1>(A, B, g + m_ + row.row);
  });
}

std::string System::joint_of_row(int row) const {
  std::string name;
  each_row([&](const auto& each) {
    if (each.row <= row && row < each.row + each.count) name = joint_names_[at(each.joint)];
  });
  return name;
}

void System::constraint_values(double t, const double* y, double* g) {
  joint_values(t, y, values_.data());
  for (int k = 0; k < p_; ++k) {
    g[k] = values_[used_[at(k)]];
    g[p_ + k] = values_[m_ + used_[at(k)]];
  }
  double* norms = g + 2 * p_;
  for (int k = 0; k < moving(); ++k)
    norms[k] =
        0.5 * (Eigen::Map<const Eigen::Vector4d>(y + kBody * k + kQuaternion).squaredNorm() - 1.0);
  if (!kept_.empty()) invariant_values(t, y, norms + moving());
}

void System::constraint_jacobian(double t, const double* y, Rows C) {
  update(t, y);
  for (int k = 0; k < moving(); ++k)
    bodies_.turns[at(k)] = turn_of_quaternion(y + kBody * k + kQuaternion);
  const auto put = [&](int row, const Inertia& inertia, const Derivatives& d, int first) {
    if (inertia.slot < 0) return;
    const int column = kBody * inertia.slot;
    C.row(row).segment<3>(column + kPosition) += d.segment<3>(first);
    C.row(row).segment<4>(column + kQuaternion) +=
        d.segment<3>(first + 3).transpose() * bodies_.turns[at(inertia.slot)];
    C.row(row).segment<6>(column + kVelocity) += d.segment<6>(first + 6);
  };
  each_row([&](const auto& row) {
    const Inertia &ia = bodies_.inertia[at(row.first)], &ib = bodies_.inertia[at(row.second)];
    const Frame<Dual> A = seed(bodies_.frames[at(row.first)], ia.slot >= 0, 0);
    const Frame<Dual> B = seed(bodies_.frames[at(row.second)], ib.slot >= 0, kBodyDirections);
    Dual g[3], rate[3];
    row.template rows<0>(A, B, g);
    row.template rows<1>(A, B, rate);
    for (int i = 0; i < row.count; ++i) {
      const int place = place_of_used_[at(row.row + i)];
      if (place < 0) continue;
      put(place, ia, g[i].derivatives(), 0);
      put(place, ib, g[i].derivatives(), kBodyDirections);
      put(p_ + place, ia, rate[i].derivatives(), 0);
      put(p_ + place, ib, rate[i].derivatives(), kBodyDirections);
    }
  });
  for (int k = 0; k < p_; ++k) {
    const int place = place_of_used_[at(used_[at(k)])];
    if (place == k) continue;
    C.row(k) = C.row(place);
    C.row(p_ + k) = C.row(p_ + place);
  }
  for (int k = 0; k < moving(); ++k)
    C.row(2 * p_ + k).segment<4>(kBody * k + kQuaternion) =
        Eigen::Map<const Eigen::RowVector4d>(y + kBody * k + kQuaternion);
  if (!kept_.empty()) invariant_jacobian(C, 2 * p_ + moving());
}

std::vector<std::string> System::constraint_names() const {
  std::vector<std::string> names(at(2 * p_));
  each_row([&](const auto& row) {
    for (int i = 0; i < row.count; ++i) {
      const int place = place_of_used_[at(row.row + i)];
      if (place < 0) continue;
      names[at(place)] = "position of joint \"" + joint_names_[at(row.joint)] + "\"";
      names[at(p_ + place)] = "velocity of joint \"" + joint_names_[at(row.joint)] + "\"";
    }
  });
  for (int k = 0; k < moving(); ++k) names.emplace_back("quaternion norm");
  if (keeps_energy_) names.emplace_back("energy");
  if (keeps_momentum_) names.insert(names.end(), 3, "momentum");
  names.insert(names.end(), at(static_cast<int>(kept_axes_.rows())), "angular momentum");
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
        constraint_jacobian(t, y.data(), Rows(C.data(), C.rows(), C.cols()));
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
  each_row([&](const auto& row) {
    using Kind = std::decay_t<decltype(row)>;
    constexpr bool angle = std::is_same_v<Kind, RightAngle> || std::is_same_v<Kind, Angle>;
    for (int i = 0; i < row.count; ++i) {
      take(values_[row.row + i], angle ? 1 : units_.length);
      take(values_[m_ + row.row + i], angle ? 1 / units_.time : units_.speed());
    }
  });
  int k = 2 * p_;
  for (const int end = k + moving(); k < end; ++k) take(g[k], 1);
  if (!kept_.empty() && keeps_energy_) take(g[k++], units_.energy());
  if (!kept_.empty() && keeps_momentum_)
    for (const int end = k + 3; k < end; ++k) take(g[k], units_.momentum());
  for (; k < g.size(); ++k) take(g[k], units_.angular_momentum());
  return largest;
}

Diagnostics System::diagnostics(double t, const double* y) {
  Diagnostics d;
  d.drift = drift(t, y);
  for (const auto& effect : effects_) d.potential_energy += effect->potential(bodies_);
  d.kinetic_energy = energy() - d.potential_energy;
  d.momentum = momentum();
  d.angular_momentum = angular_momentum();
  return d;
}

}  // namespace tether::scene::smooth

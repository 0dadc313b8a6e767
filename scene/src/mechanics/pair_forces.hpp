// Tether: forces between two bodies each. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "force.hpp"

namespace tether::scene::mechanics {

/// The frames of a pair with their derivatives, those of the first body in front.
inline std::pair<Frame<Dual>, Frame<Dual>> seed_pair(const Bodies& bodies, int first, int second) {
  return {seed(bodies.frames[at(first)], bodies.moves(first), 0),
          seed(bodies.frames[at(second)], bodies.moves(second), kBodyDirections)};
}

/// Adds the wrench on a body to the loads.
inline void put_wrench(const Bodies& bodies, int body, const Wrench<double>& wrench,
                       std::vector<Load6>& loads) {
  const int slot = bodies.inertia[at(body)].slot;
  if (slot < 0) return;
  loads[at(slot)].force += wrench.force;
  loads[at(slot)].torque_world += wrench.torque;
}
/// Adds minus the derivatives of the wrench on a body of the pair `first`, `second`.
inline void put_wrench(const Bodies& bodies, int first, int second, int body,
                       const Frame<Dual>& frame, const Wrench<Dual>& wrench, JacobianBlocks& J) {
  const int slot = bodies.inertia[at(body)].slot;
  if (slot < 0) return;
  const Vector3<Dual> torque = transposed_times(frame.R, wrench.torque);
  for (int i = 0; i < 6; ++i) {
    const Derivatives& d = (i < 3 ? wrench.force[i] : torque[i - 3]).derivatives();
    const int row = J.motion_row(slot, i);
    J.add_body(row, bodies, first, d, 0, -1.0);
    J.add_body(row, bodies, second, d, kBodyDirections, -1.0);
  }
}
/// Adds the gradient of the potential of the wrench on a body to a row of y.
inline void put_gradient(const Bodies& bodies, int body, const Wrench<double>& wrench,
                         double* row) {
  const int slot = bodies.inertia[at(body)].slot;
  if (slot < 0) return;
  const Frame<double>& f = bodies.frames[at(body)];
  for (int k = 0; k < 3; ++k) row[kBody * slot + k] -= wrench.force[k];
  const Eigen::RowVector4d q =
      (f.R.transpose() * wrench.torque).transpose() * bodies.turns[at(slot)];
  for (int k = 0; k < 4; ++k) row[kBody * slot + kQuaternion + k] -= q[k];
}

/// Values and derivatives of the forces of items from one formula. An Item has
///
///   first, second                   indices of its bodies in Bodies
///   pull<S>(now, A, B, all, a, b)   adds to the wrenches of both bodies; not `all`: the part that
///                                   has a potential. `now`: all bodies, for their time
///   potential(now, A, B)            of that part, J
///   works()                         whether there is another part
///   power<S>(now, A, B)             of the other part, W
template <class Item>
class PairForces : public Force {
 public:
  void add(const Bodies& bodies, std::vector<Load6>& loads) const override {
    for (const Item& each : items_) {
      const auto [a, b] = pair_of<double>(bodies, each, frame_pair(bodies, each), true);
      put_wrench(bodies, each.first, a, loads);
      put_wrench(bodies, each.second, b, loads);
    }
  }
  void add_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Item& each : items_) {
      const auto frames = seed_pair(bodies, each.first, each.second);
      const auto [a, b] = pair_of<Dual>(bodies, each, frames, true);
      put_wrench(bodies, each.first, each.second, each.first, frames.first, a, J);
      put_wrench(bodies, each.first, each.second, each.second, frames.second, b, J);
    }
  }
  double potential(const Bodies& bodies) const override {
    double sum = 0;
    for (const Item& each : items_)
      sum += each.potential(bodies, bodies.frames[at(each.first)], bodies.frames[at(each.second)]);
    return sum;
  }
  void add_potential_gradient(const Bodies& bodies, double* row) const override {
    for (const Item& each : items_) {
      const auto [a, b] = pair_of<double>(bodies, each, frame_pair(bodies, each), false);
      put_gradient(bodies, each.first, a, row);
      put_gradient(bodies, each.second, b, row);
    }
  }
  bool has_power() const override {
    return any_of(items_, [](const Item& each) { return each.works(); });
  }
  double power(const Bodies& bodies) const override {
    double sum = 0;
    for (const Item& each : items_)
      if (each.works())
        sum += each.template power<double>(bodies, bodies.frames[at(each.first)],
                                           bodies.frames[at(each.second)]);
    return sum;
  }
  void add_power_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Item& each : items_) {
      const auto [A, B] = seed_pair(bodies, each.first, each.second);
      const Dual P = each.works() ? each.template power<Dual>(bodies, A, B) : Dual(0.0);
      J.add_body(J.work_row, bodies, each.first, P.derivatives(), 0, -1.0);
      J.add_body(J.work_row, bodies, each.second, P.derivatives(), kBodyDirections, -1.0);
    }
  }

 protected:
  void push_back(Item item) { items_.push_back(std::move(item)); }
  const std::vector<Item>& items() const { return items_; }

  template <class S>
  using FramePair = std::pair<const Frame<S>&, const Frame<S>&>;
  static FramePair<double> frame_pair(const Bodies& bodies, const Item& each) {
    return {bodies.frames[at(each.first)], bodies.frames[at(each.second)]};
  }
  template <class S>
  static std::pair<Wrench<S>, Wrench<S>> pair_of(const Bodies& bodies, const Item& each,
                                                 const FramePair<S>& frames, bool all) {
    std::pair<Wrench<S>, Wrench<S>> wrenches{no_wrench<S>(), no_wrench<S>()};
    each.pull(bodies, frames.first, frames.second, all, wrenches.first, wrenches.second);
    return wrenches;
  }

 private:
  std::vector<Item> items_;
};

}  // namespace tether::scene::mechanics

// Tether: the bodies that impulses move, as the kernels see them. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <tether/contact/body_solver.hpp>
#include <vector>

#include "kernels/body_contacts.hpp"
#include "problem/contact_side.hpp"

namespace tether::contact::detail {

// x <- x + beta (x - previous), previous <- x, for n numbers each.
template <int n>
TETHER_INLINE void extrapolate(double beta, double* x, double* previous) {
  double now[n], next[n];  // neither overlaps, which the compiler cannot know of the arguments
  for (int c = 0; c < n; ++c) now[c] = x[c];
  for (int c = 0; c < n; ++c) next[c] = now[c] + beta * (now[c] - previous[c]);
  for (int c = 0; c < n; ++c) x[c] = next[c];
  for (int c = 0; c < n; ++c) previous[c] = now[c];
}

// In the order of the slots of a ContactGraph.
class MovingBodies {
 public:
  void resize(std::size_t slots) {
    state_.resize(slots);
    inertia_.resize(slots);
    previous_.resize(6 * slots);
  }
  // As before all impulses.
  void load(int slot, const RigidBody& b) {
    const Matrix3d& I = b.inverse_inertia;
    BodyState& s = state_[linalg::at(slot)];
    store(b.velocity, s.v);
    store(b.angular_velocity, s.w);
    s.m = b.inverse_mass;
    s.i = I(0, 0);
    inertia_[linalg::at(slot)] = {I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2), I(2, 2), {0, 0}};
  }
  void push(int slot, const Vector3d& p, const Vector3d& angular) {
    detail::push(state_[linalg::at(slot)], inertia_[linalg::at(slot)], p.data(), angular.data());
  }
  Vector3d velocity(int slot) const { return detail::load(state_[linalg::at(slot)].v); }
  Vector3d angular_velocity(int slot) const { return detail::load(state_[linalg::at(slot)].w); }
  void set_velocity(int slot, const Vector3d& v, const Vector3d& w) {
    store(v, state_[linalg::at(slot)].v);
    store(w, state_[linalg::at(slot)].w);
  }
  // Six numbers: velocity, angular velocity.
  void get(int slot, double* six) const {
    const BodyState& s = state_[linalg::at(slot)];
    std::copy(s.v, s.v + 3, six);
    std::copy(s.w, s.w + 3, six + 3);
  }
  void set(int slot, const double* six) {
    BodyState& s = state_[linalg::at(slot)];
    std::copy(six, six + 3, s.v);
    std::copy(six + 3, six + 6, s.w);
  }
  void extrapolate(int begin, int end, double beta) {
    for (int i = begin; i < end; ++i) {
      double* previous = previous_.data() + 6 * linalg::at(i);
      BodyState& s = state_[linalg::at(i)];
      detail::extrapolate<3>(beta, s.v, previous);
      detail::extrapolate<3>(beta, s.w, previous + 3);
    }
  }

  // nowhere: see BodyArrays.
  BodyArrays arrays(const BodyState* fixed, BodyState* nowhere) {
    static constexpr BodyInertia kNoInertia = {};
    return {state_.data(), inertia_.data(), fixed, nowhere, &kNoInertia};
  }

 private:
  std::vector<BodyState> state_;
  std::vector<BodyInertia> inertia_;
  std::vector<double> previous_;  // velocities at the last extrapolation
};

}  // namespace tether::contact::detail

// Tether: bodies and contacts as the kernels want them. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <tether/contact/body_solver.hpp>
#include <vector>

#include "graph/contact_graph.hpp"
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

// One list for each kind. A contact is found by its kind and its place among the contacts of that
// kind (Chunk::begin).
class PackedContacts {
 public:
  // end: the chunk behind the last.
  void resize(const Chunk& end, std::size_t contacts);

  // The block of a contact between the bodies a and b of the kernels, impulse zero. Returns T/a of
  // the tangents that friction moves, 0 without friction. Throws std::invalid_argument if the
  // bodies cannot move along the normal.
  double pack(Kind k, int place, const Side& side, const PointContact& c, int a, int b);

  // World axes, on the body `a`.
  Vector3d impulse(Kind k, int place) const;
  void set_impulse(Kind k, int place, const Vector3d& p);
  // All that a sweep changes of a contact, as the kernels have it: for another process.
  Eigen::Vector4d state(Kind k, int place) const;
  void set_state(Kind k, int place, const Eigen::Vector4d& s);
  // Momentum of the contacts of chunks from .. to.
  void extrapolate(const Chunk& from, const Chunk& to, double beta);

  // operation(begin, end, width): the contacts of a kind, `width` in each entry, for the kinds that
  // a chunk has, in their order.
  template <class Operation>
  void for_kinds(const Chunk& from, const Chunk& to, const Operation& operation) {
    const auto kind_range = [&](auto& list, Kind k, int width) {
      const int begin = from.begin[static_cast<int>(k)] / width;
      const int end = to.begin[static_cast<int>(k)] / width;
      if (begin < end) operation(list.data() + begin, list.data() + end, width);
    };
    kind_range(general4_, Kind::general4, 4);
    kind_range(spheres4_, Kind::sphere4, 4);
    kind_range(general_, Kind::general, 1);
    kind_range(spheres_, Kind::sphere, 1);
    kind_range(smooth_, Kind::smooth, 1);
  }

  bool has_general() const { return !(general_.empty() && general4_.empty()); }

 private:
  void put(const GeneralContact& c, Kind k, int place);
  void put(const SphereContact& c, Kind k, int place);
  void put(const SmoothContact& c, Kind, int place) { smooth_[linalg::at(place)] = c; }
  template <class F>
  auto read(Kind k, int place, const F& f) const;
  template <class F>
  void change(Kind k, int place, const F& f);

  std::vector<GeneralGroup> general4_;
  std::vector<SphereGroup> spheres4_;
  std::vector<GeneralContact> general_;
  std::vector<SphereContact> spheres_;
  std::vector<SmoothContact> smooth_;
  std::vector<double> previous_;  // impulses at the last extrapolation, three for each place
};

}  // namespace tether::contact::detail

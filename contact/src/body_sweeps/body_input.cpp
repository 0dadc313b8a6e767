// Tether: bodies and contacts as given: checked and sorted into kinds. SPDX-License-Identifier:
// BSD-3-Clause
#include <cmath>
#include <stdexcept>

#include "body_sweeps/body_parts.hpp"
#include "law/law.hpp"
#include "problem/contact_side.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {

using detail::store;
using Eigen::Matrix3d;
using Eigen::Vector3d;

void BodySolver::Implementation::read_bodies() {
  body_kind.resize(bodies->size());
  fixed_slot.assign(bodies->size(), 0);
  fixed.assign(1, {});
  for (std::size_t k = 0; k < bodies->size(); ++k) {
    const RigidBody& b = (*bodies)[k];
    detail::check(k, b);
    const Matrix3d& I = b.inverse_inertia;
    const bool isotropic = I(0, 1) == 0 && I(0, 2) == 0 && I(1, 2) == 0 && I(1, 0) == 0 &&
                           I(2, 0) == 0 && I(2, 1) == 0 && I(0, 0) == I(1, 1) && I(0, 0) == I(2, 2);
    if (!detail::moves(b) && !(b.velocity.isZero(0) && b.angular_velocity.isZero(0))) {
      fixed_slot[k] = static_cast<int>(fixed.size());
      fixed.push_back({});
      store(b.velocity, fixed.back().v);
      store(b.angular_velocity, fixed.back().w);
    }
    body_kind[k] = static_cast<char>((detail::moves(b) ? 1 : 0) + (isotropic ? 2 : 0));
  }
}

void BodySolver::Implementation::read_contacts() {
  const std::size_t n = contacts->size();
  const int m = static_cast<int>(bodies->size());
  first.resize(n);
  second.resize(n);
  kind.resize(n);
  turned.resize(n);
  // The closed form needs arms along the normal.
  const auto round = [&](int b, const Vector3d& r, const Vector3d& normal) {
    if (b < 0 || !(body_kind[at(b)] & 2)) return b < 0;
    const RigidBody& body = (*bodies)[at(b)];
    // A body that cannot turn has no arm to speak of.
    if (body.inverse_inertia(0, 0) == 0 && body.angular_velocity.isZero(0)) return true;
    const double s = normal.dot(r);
    return (r - s * normal).squaredNorm() <= 1e-28 * r.squaredNorm();
  };
  for (std::size_t i = 0; i < n; ++i) {
    const PointContact& c = (*contacts)[i];
    detail::check(i, c, m);
    const bool a = body_kind[at(c.first)] & 1, b = c.second >= 0 && body_kind[at(c.second)] & 1;
    if (!a && !b) detail::refuse_fixed(i);
    turned[i] = !a;
    first[i] = a ? c.first : c.second;
    second[i] = a && b ? c.second : -1;
    kind[i] = !detail::traits(options.law).friction || c.mu == 0                  ? Kind::smooth
              : round(c.first, c.r1, c.normal) && round(c.second, c.r2, c.normal) ? Kind::sphere
                                                                                  : Kind::general;
  }
}

void BodySolver::Implementation::find_starts() {
  out->warm_started = 0;
  if (!options.warm_start || memory.empty()) return start.clear();
  start.resize(contacts->size());  // cleared before, it would grow without reserve
  memory.rewind();
  for (std::size_t i = 0; i < contacts->size(); ++i) {
    start[i] = memory.find((*contacts)[i].id);
    out->warm_started += start[i] != nullptr;
  }
}

void BodySolver::Implementation::load_body(int slot) {
  const RigidBody& b = (*bodies)[at(graph.body[at(slot)])];
  const Matrix3d& I = b.inverse_inertia;
  BodyState& s = state[at(slot)];
  store(b.velocity, s.v);
  store(b.angular_velocity, s.w);
  s.m = b.inverse_mass;
  s.i = I(0, 0);
  inertia[at(slot)] = {I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2), I(2, 2), {0, 0}};
}

}  // namespace tether::contact

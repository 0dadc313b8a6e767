// Tether: bodies and contacts as given: checked and sorted into kinds. SPDX-License-Identifier:
// BSD-3-Clause
#include "body_passes/given_problem.hpp"

#include "law/interface/law.hpp"
#include "problem/refuse.hpp"

namespace tether::contact::detail {
namespace {

constexpr char kMoves = 1, kIsotropic = 2;

bool isotropic(const Matrix3d& I) {
  return I(0, 1) == 0 && I(0, 2) == 0 && I(1, 2) == 0 && I(1, 0) == 0 && I(2, 0) == 0 &&
         I(2, 1) == 0 && I(0, 0) == I(1, 1) && I(0, 0) == I(2, 2);
}

}  // namespace

void GivenProblem::read(const std::vector<RigidBody>& bodies,
                        const std::vector<PointContact>& contacts, Law law) {
  bodies_ = &bodies;
  contacts_ = &contacts;
  read_bodies();
  read_contacts(law);
}

void GivenProblem::read_bodies() {
  body_kind_.resize(bodies_->size());
  fixed_slot_.assign(bodies_->size(), 0);
  fixed_.assign(1, {});
  for (std::size_t k = 0; k < bodies_->size(); ++k) {
    const RigidBody& b = (*bodies_)[k];
    check(k, b);
    const bool moving = b.moves();
    if (!moving && !(b.velocity.isZero(0) && b.angular_velocity.isZero(0))) {
      fixed_slot_[k] = static_cast<int>(fixed_.size());
      fixed_.push_back({});
      store(b.velocity, fixed_.back().v);
      store(b.angular_velocity, fixed_.back().w);
    }
    body_kind_[k] =
        static_cast<char>((moving ? kMoves : 0) + (isotropic(b.inverse_inertia) ? kIsotropic : 0));
  }
}

// The closed form of spheres needs arms along the normal.
bool GivenProblem::arm_is_normal(int body, const Vector3d& r, const Vector3d& normal) const {
  if (body < 0 || !(body_kind_[linalg::at(body)] & kIsotropic)) return body < 0;
  const RigidBody& b = (*bodies_)[linalg::at(body)];
  // A body that cannot turn has no arm to speak of.
  if (b.inverse_inertia(0, 0) == 0 && b.angular_velocity.isZero(0)) return true;
  const double s = normal.dot(r);
  return (r - s * normal).squaredNorm() <= 1e-28 * r.squaredNorm();
}

void GivenProblem::read_contacts(Law law) {
  const std::size_t n = contacts_->size();
  const int m = static_cast<int>(bodies_->size());
  const bool friction = traits(law).friction;
  first_.resize(n);
  second_.resize(n);
  kind_.resize(n);
  exchanged_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const PointContact& c = (*contacts_)[i];
    check(i, c, m);
    const bool a = body_kind_[linalg::at(c.first)] & kMoves;
    const bool b = c.second >= 0 && body_kind_[linalg::at(c.second)] & kMoves;
    if (!a && !b) refuse_fixed(i);
    exchanged_[i] = !a;
    first_[i] = a ? c.first : c.second;
    second_[i] = a && b ? c.second : -1;
    kind_[i] = !friction || c.mu == 0 ? Kind::smooth
               : arm_is_normal(c.first, c.r1, c.normal) && arm_is_normal(c.second, c.r2, c.normal)
                   ? Kind::sphere
                   : Kind::general;
  }
}

std::size_t GivenProblem::contact_bytes() const {
  return sizeof(int) * (first_.capacity() + second_.capacity()) + sizeof(Kind) * kind_.capacity() +
         exchanged_.capacity();
}
std::size_t GivenProblem::body_bytes() const {
  return body_kind_.capacity() + sizeof(int) * fixed_slot_.capacity() +
         sizeof(BodyState) * fixed_.capacity();
}

}  // namespace tether::contact::detail

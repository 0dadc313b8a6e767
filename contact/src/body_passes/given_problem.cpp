// Tether: bodies and contacts as given: checked and sorted into kinds. SPDX-License-Identifier:
// BSD-3-Clause
#include "body_passes/given_problem.hpp"

#include "law/interface/law.hpp"
#include "problem/refuse.hpp"

namespace tether::contact::detail {
namespace {

bool is_isotropic(const Matrix3d& I) {
  return I(0, 1) == 0 && I(0, 2) == 0 && I(1, 2) == 0 && I(1, 0) == 0 && I(2, 0) == 0 &&
         I(2, 1) == 0 && I(0, 0) == I(1, 1) && I(0, 0) == I(2, 2);
}

// The closed form of spheres needs arms along the normal.
bool arm_is_normal(int body, std::uint8_t traits, const Vector3d& r, const Vector3d& normal) {
  if (body < 0 || !(traits & isotropic)) return body < 0;
  if (traits & never_turns) return true;  // no arm to speak of
  const double s = normal.dot(r);
  return (r - s * normal).squaredNorm() <= 1e-28 * r.squaredNorm();
}

}  // namespace

std::uint8_t body_traits(const RigidBody& b) {
  const bool still = b.inverse_inertia(0, 0) == 0 && b.angular_velocity.isZero(0);
  return static_cast<std::uint8_t>((b.moves() ? can_move : 0) +
                                   (is_isotropic(b.inverse_inertia) ? isotropic : 0) +
                                   (still ? never_turns : 0));
}

MovingPair moving_pair(const PointContact& c, const std::vector<std::uint8_t>& traits,
                       bool friction) {
  const std::uint8_t one = traits[linalg::at(c.first)];
  const std::uint8_t other = c.second >= 0 ? traits[linalg::at(c.second)] : std::uint8_t{0};
  const bool a = one & can_move, b = other & can_move;
  const Kind kind = !friction || c.mu == 0 ? Kind::smooth
                    : arm_is_normal(c.first, one, c.r1, c.normal) &&
                            arm_is_normal(c.second, other, c.r2, c.normal)
                        ? Kind::sphere
                        : Kind::general;
  return {a ? c.first : b ? c.second : -1, a && b ? c.second : -1, !a, kind};
}

void GivenProblem::read(const std::vector<RigidBody>& bodies,
                        const std::vector<PointContact>& contacts, Law law) {
  bodies_ = &bodies;
  contacts_ = &contacts;
  read_bodies();
  read_contacts(law);
}

void GivenProblem::read_bodies() {
  traits_.resize(bodies_->size());
  fixed_slot_.assign(bodies_->size(), 0);
  fixed_.assign(1, {});
  for (std::size_t k = 0; k < bodies_->size(); ++k) {
    const RigidBody& b = (*bodies_)[k];
    check(k, b);
    traits_[k] = body_traits(b);
    if (!(traits_[k] & can_move) && !(b.velocity.isZero(0) && b.angular_velocity.isZero(0))) {
      fixed_slot_[k] = static_cast<int>(fixed_.size());
      fixed_.push_back({});
      store(b.velocity, fixed_.back().v);
      store(b.angular_velocity, fixed_.back().w);
    }
  }
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
    const MovingPair pair = moving_pair(c, traits_, friction);
    if (pair.first < 0) refuse_fixed(i);
    exchanged_[i] = pair.exchanged;
    first_[i] = pair.first;
    second_[i] = pair.second;
    kind_[i] = pair.kind;
  }
}

}  // namespace tether::contact::detail

// Tether: contacts as the kernels want them, and back. SPDX-License-Identifier: BSD-3-Clause
#include "body_passes/packed_contacts.hpp"

#include <cstring>
#include <stdexcept>

namespace tether::contact::detail {

using linalg::at;

namespace {

// A contact is two ints and doubles, a group four times the same side by side.
template <class Contact, class Group>
void to_lane(const Contact& c, Group& g, int lane) {
  g.first[lane] = c.first;
  g.second[lane] = c.second;
  const char* from = reinterpret_cast<const char*>(&c) + 8;
  char* to = reinterpret_cast<char*>(&g) + 32 + 8 * lane;
  for (std::size_t k = 8; k < sizeof(Contact); k += 8)
    std::memcpy(to + 4 * (k - 8), from + k - 8, 8);
}
template <class Contact, class Group>
Contact from_lane(const Group& g, int lane) {
  Contact c;
  c.first = g.first[lane];
  c.second = g.second[lane];
  const char* from = reinterpret_cast<const char*>(&g) + 32 + 8 * lane;
  char* to = reinterpret_cast<char*>(&c) + 8;
  for (std::size_t k = 8; k < sizeof(Contact); k += 8)
    std::memcpy(to + k - 8, from + 4 * (k - 8), 8);
  return c;
}

// The blocks; what is not set is zero.
SphereContact packed_sphere(const Side& s, const PointContact& c, double& slip) {
  const double mass = s.first->inverse_mass + (s.second ? s.second->inverse_mass : 0);
  const double s1 = s.n.dot(s.r1), s2 = s.n.dot(s.r2);
  double t = mass + s1 * s1 * s.first->inverse_inertia(0, 0);
  if (s.second) t += s2 * s2 * s.second->inverse_inertia(0, 0);
  if (!(mass > 0)) throw std::invalid_argument("the bodies cannot move along the normal");
  slip = t / mass;
  SphereContact p = {};
  store(s.n, p.n);
  p.s1 = s1;
  p.s2 = s2;
  p.inv_a = 1 / mass;
  p.inv_t = 1 / t;
  p.mu = c.mu;
  store(s.sign * c.slip, p.slip);
  return p;
}

SmoothContact packed_smooth(const Side& s) {
  const Vector3d q1 = s.r1.cross(s.n), q2 = s.r2.cross(s.n);
  const Vector3d column = diagonal_block(s) * s.n;
  const double D = column.dot(s.n);
  if (!(D > 0)) throw std::invalid_argument("the bodies cannot move along the normal");
  SmoothContact p = {};
  store(s.n, p.n);
  store(q1, p.q1);
  store(q2, p.q2);
  p.inv_a = 1 / D;
  p.weight = column.norm();
  return p;
}

GeneralContact packed_general(const Side& s, const PointContact& c, double& slip) {
  const Matrix3d F = tangent_frame(s.n);
  const LocalBlock L(F * diagonal_block(s) * F.transpose(), c.mu);
  // Tangents turned by V, in which the tangential block is diagonal.
  const Vector3d t = L.cosine * F.row(1) + L.sine * F.row(2);
  slip = 0.5 * (L.T[0] + L.T[2]) * L.inv_a;
  GeneralContact p = {};
  store(s.n, p.n);
  store(t, p.t);
  store(s.r1, p.r1);
  store(s.r2, p.r2);
  p.a = L.a;
  p.inv_a = L.inv_a;
  p.mu = L.mu;
  p.c[0] = L.cosine * L.c[0] + L.sine * L.c[1];
  p.c[1] = L.cosine * L.c[1] - L.sine * L.c[0];
  p.beta[0] = L.beta[0];
  p.beta[1] = L.beta[1];
  p.slip[0] = s.sign * c.slip.dot(t);
  p.slip[1] = s.sign * c.slip.dot(s.n.cross(t));
  p.lambda = -1;
  return p;
}

// The impulses of an entry of a list: numbers one after the other.
auto& impulses(GeneralGroup& g) { return g.x; }
auto& impulses(SphereGroup& g) { return g.p; }
auto& impulses(GeneralContact& c) { return c.x; }
auto& impulses(SphereContact& c) { return c.p; }
auto& impulses(SmoothContact& c) { return c.x; }

// The impulse in world axes.
Vector3d world_impulse(const SmoothContact& c) { return c.x * load(c.n); }
Vector3d world_impulse(const SphereContact& c) { return load(c.p); }
Vector3d world_impulse(const GeneralContact& c) {
  const Vector3d n = load(c.n), t = load(c.t);
  return c.x[0] * n + c.x[1] * t + c.x[2] * n.cross(t);
}
void set_world_impulse(SmoothContact& c, const Vector3d& p) { c.x = p.dot(load(c.n)); }
void set_world_impulse(SphereContact& c, const Vector3d& p) { store(p, c.p); }
void set_world_impulse(GeneralContact& c, const Vector3d& p) {
  const Vector3d n = load(c.n), t = load(c.t);
  store({p.dot(n), p.dot(t), p.dot(n.cross(t))}, c.x);
}

// All that a sweep changes.
Eigen::Vector4d state_of(const SmoothContact& c) { return {c.x, 0, 0, 0}; }
Eigen::Vector4d state_of(const SphereContact& c) { return load(c.p).homogeneous(); }
Eigen::Vector4d state_of(const GeneralContact& c) { return {c.x[0], c.x[1], c.x[2], c.lambda}; }
void set_state_of(SmoothContact& c, const Eigen::Vector4d& s) { c.x = s[0]; }
void set_state_of(SphereContact& c, const Eigen::Vector4d& s) { store(s.head<3>(), c.p); }
void set_state_of(GeneralContact& c, const Eigen::Vector4d& s) {
  store(s.head<3>(), c.x);
  c.lambda = s[3];
}

}  // namespace

void PackedContacts::resize(const Chunk& end, std::size_t contacts) {
  const auto total = [&](Kind k) { return at(end.begin[static_cast<int>(k)]); };
  general4_.resize(total(Kind::general4) / 4);
  spheres4_.resize(total(Kind::sphere4) / 4);
  general_.resize(total(Kind::general));
  spheres_.resize(total(Kind::sphere));
  smooth_.resize(total(Kind::smooth));
  previous_.resize(3 * contacts);
}

double PackedContacts::pack(Kind k, int place, const Side& side, const PointContact& c, int a,
                            int b) {
  double slip = 0;
  const auto between = [&](auto&& p) -> auto& {
    p.first = a;
    p.second = b;
    p.bias = c.bias;
    return p;
  };
  switch (k) {
    case Kind::sphere:
    case Kind::sphere4:
      put(between(packed_sphere(side, c, slip)), k, place);
      break;
    case Kind::smooth:
      put(between(packed_smooth(side)), k, place);
      break;
    case Kind::general:
    case Kind::general4:
      put(between(packed_general(side, c, slip)), k, place);
      break;
  }
  return slip;
}

void PackedContacts::put(const GeneralContact& c, Kind k, int place) {
  if (k == Kind::general)
    general_[at(place)] = c;
  else
    to_lane(c, general4_[at(place / 4)], place % 4);
}
void PackedContacts::put(const SphereContact& c, Kind k, int place) {
  if (k == Kind::sphere)
    spheres_[at(place)] = c;
  else
    to_lane(c, spheres4_[at(place / 4)], place % 4);
}

// f(contact), taken out of its group.
template <class F>
auto PackedContacts::read(Kind k, int place, const F& f) const {
  switch (k) {
    case Kind::general4:
      return f(from_lane<GeneralContact>(general4_[at(place / 4)], place % 4));
    case Kind::sphere4:
      return f(from_lane<SphereContact>(spheres4_[at(place / 4)], place % 4));
    case Kind::general:
      return f(general_[at(place)]);
    case Kind::sphere:
      return f(spheres_[at(place)]);
    case Kind::smooth:
      break;
  }
  return f(smooth_[at(place)]);
}

// The same for a contact that f changes, in place or in its group.
template <class F>
void PackedContacts::change(Kind k, int place, const F& f) {
  switch (k) {
    case Kind::general:
      return f(general_[at(place)]);
    case Kind::sphere:
      return f(spheres_[at(place)]);
    case Kind::smooth:
      return f(smooth_[at(place)]);
    case Kind::general4:
    case Kind::sphere4:
      break;
  }
  read(k, place, [&](auto contact) {
    f(contact);
    put(contact, k, place);
  });
}

Vector3d PackedContacts::impulse(Kind k, int place) const {
  return read(k, place, [](const auto& c) { return world_impulse(c); });
}
void PackedContacts::set_impulse(Kind k, int place, const Vector3d& p) {
  change(k, place, [&](auto& c) { set_world_impulse(c, p); });
}
Eigen::Vector4d PackedContacts::state(Kind k, int place) const {
  return read(k, place, [](const auto& c) { return state_of(c); });
}
void PackedContacts::set_state(Kind k, int place, const Eigen::Vector4d& s) {
  change(k, place, [&](auto& c) { set_state_of(c, s); });
}

void PackedContacts::extrapolate(const Chunk& from, const Chunk& to, double beta) {
  double* previous = previous_.data() + 3 * at(from.place);
  for_kinds(from, to, [&](auto* begin, auto* end, int) {
    for (auto* entry = begin; entry < end; ++entry) {
      constexpr int n = sizeof(impulses(*entry)) / sizeof(double);
      detail::extrapolate<n>(beta, reinterpret_cast<double*>(&impulses(*entry)), previous);
      previous += n;
    }
  });
}

}  // namespace tether::contact::detail

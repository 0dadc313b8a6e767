// Tether: contacts as the kernels want them, and back. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "body_sweeps/body_parts.hpp"
#include "problem/contact_side.hpp"

namespace tether::contact {

using detail::load;
using detail::store;
using Eigen::Matrix3d;
using Eigen::Vector3d;

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

// An impulse on the friction cone of its contact, normal part kept.
Vector3d on_cone(const Vector3d& p, const Vector3d& n, double mu) {
  const double xn = p.dot(n);
  if (!(xn > 0)) return Vector3d::Zero();
  Vector3d t = p - xn * n;
  const double most = mu * xn, length = t.norm();
  if (length > most) t *= most / length;
  return xn * n + t;
}

}  // namespace

// Returns |b|^2, the needed change and the speeds of which b is the difference.
detail::PassResult BodySolver::Implementation::pack_contact(int contact, Kind k, int place) {
  const PointContact& c = (*contacts)[at(contact)];
  const detail::Side s = detail::side(*bodies, c, turned[at(contact)] != 0);
  const int a = graph.slot[at(first[at(contact)])];
  const int partner = turned[at(contact)] ? c.first : c.second;
  const int b = second[at(contact)] >= 0 ? graph.slot[at(second[at(contact)])]
                : partner < 0            ? -1
                                         : -1 - fixed_slot[at(partner)];
  const Vector3d before = detail::velocity_before(s, c.bias);
  double slip = 0;  // T/a of the tangents that friction moves
  const double mass = s.first->inverse_mass + (s.second ? s.second->inverse_mass : 0);
  switch (k) {
    case Kind::sphere:
    case Kind::sphere4: {
      const double s1 = s.n.dot(s.r1), s2 = s.n.dot(s.r2);
      double t = mass + s1 * s1 * s.first->inverse_inertia(0, 0);
      if (s.second) t += s2 * s2 * s.second->inverse_inertia(0, 0);
      if (!(mass > 0)) throw std::invalid_argument("the bodies cannot move along the normal");
      slip = t / mass;
      SphereContact p = {};
      p.first = a;
      p.second = b;
      store(s.n, p.n);
      p.s1 = s1;
      p.s2 = s2;
      p.inv_a = 1 / mass;
      p.inv_t = 1 / t;
      p.mu = c.mu;
      p.bias = c.bias;
      put(p, k, place);
      break;
    }
    case Kind::smooth: {
      SmoothContact& p = smooth[at(place)];
      p.first = a;
      p.second = b;
      const Vector3d q1 = s.r1.cross(s.n), q2 = s.r2.cross(s.n);
      const Vector3d column = detail::diagonal_block(s) * s.n;
      const double D = column.dot(s.n);
      if (!(D > 0)) throw std::invalid_argument("the bodies cannot move along the normal");
      store(s.n, p.n);
      store(q1, p.q1);
      store(q2, p.q2);
      p.inv_a = 1 / D;
      p.weight = column.norm();
      p.bias = c.bias;
      break;
    }
    case Kind::general:
    case Kind::general4: {
      const Matrix3d F = tangent_frame(s.n);
      const LocalBlock L(F * detail::diagonal_block(s) * F.transpose(), c.mu);
      // Tangents turned by V, in which the tangential block is diagonal.
      const Vector3d t = L.cosine * F.row(1) + L.sine * F.row(2);
      slip = 0.5 * (L.T[0] + L.T[2]) * L.inv_a;
      GeneralContact p = {};
      p.first = a;
      p.second = b;
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
      p.bias = c.bias;
      p.lambda = -1;
      put(p, k, place);
      break;
    }
  }
  Vector3d p = Vector3d::Zero();
  if (!start.empty() && start[at(contact)]) {
    p = on_cone(s.sign * *start[at(contact)], s.n, k == Kind::smooth ? 0 : c.mu);
  }
  set_impulse(k, place, p);
  if (!p.isZero(0)) apply(contact, p);
  const double bn = -before.dot(s.n), bb = before.squaredNorm();
  PassResult result;
  result.sum = bb;
  result.most = detail::needed_change(bn, std::sqrt(std::max(0.0, bb - bn * bn)), c.mu, slip);
  result.speed = detail::speed_before(s, c.bias);
  return result;
}

detail::GeneralContact BodySolver::Implementation::general_contact(Kind k, int place) const {
  if (k == Kind::general) return general[at(place)];
  return from_lane<GeneralContact>(general4[at(place / 4)], place % 4);
}
detail::SphereContact BodySolver::Implementation::sphere_contact(Kind k, int place) const {
  if (k == Kind::sphere) return spheres[at(place)];
  return from_lane<SphereContact>(spheres4[at(place / 4)], place % 4);
}
void BodySolver::Implementation::put(const GeneralContact& c, Kind k, int place) {
  if (k == Kind::general) {
    general[at(place)] = c;
  } else {
    to_lane(c, general4[at(place / 4)], place % 4);
  }
}
void BodySolver::Implementation::put(const SphereContact& c, Kind k, int place) {
  if (k == Kind::sphere) {
    spheres[at(place)] = c;
  } else {
    to_lane(c, spheres4[at(place / 4)], place % 4);
  }
}

// In world axes, on the moving body `first`.
Vector3d BodySolver::Implementation::impulse(Kind k, int place) const {
  if (k == Kind::smooth) return smooth[at(place)].x * load(smooth[at(place)].n);
  if (k == Kind::sphere || k == Kind::sphere4) return load(sphere_contact(k, place).p);
  const GeneralContact c = general_contact(k, place);
  const Vector3d n = load(c.n), t = load(c.t);
  return c.x[0] * n + c.x[1] * t + c.x[2] * n.cross(t);
}

void BodySolver::Implementation::set_impulse(Kind k, int place, const Vector3d& p) {
  if (k == Kind::smooth) {
    smooth[at(place)].x = p.dot(load(smooth[at(place)].n));
  } else if (k == Kind::sphere || k == Kind::sphere4) {
    SphereContact c = sphere_contact(k, place);
    store(p, c.p);
    put(c, k, place);
  } else {
    GeneralContact c = general_contact(k, place);
    const Vector3d n = load(c.n), t = load(c.t);
    store({p.dot(n), p.dot(t), p.dot(n.cross(t))}, c.x);
    put(c, k, place);
  }
}

void BodySolver::Implementation::apply(int contact, const Vector3d& p) {
  const PointContact& c = (*contacts)[at(contact)];
  const bool t = turned[at(contact)] != 0;
  const Vector3d q = (t ? c.r2 : c.r1).cross(p);
  const int a = graph.slot[at(first[at(contact)])];
  detail::push(state[at(a)], inertia[at(a)], p.data(), q.data());
  if (second[at(contact)] < 0) return;
  const int b = graph.slot[at(second[at(contact)])];
  const Vector3d minus = -p, r = c.r2.cross(minus);
  detail::push(state[at(b)], inertia[at(b)], minus.data(), r.data());
}

detail::PassResult BodySolver::Implementation::pack(int chunk, Worker& worker) {
  PassResult sum;
  visit(chunk, [&](int contact, Kind k, int place) {
    // Other threads wait at the next barrier: a failure is reported after the run.
    try {
      sum.add(pack_contact(contact, k, place));
    } catch (const std::invalid_argument& e) {
      if (contact >= worker.bad_contact) return;
      worker.bad_contact = contact;
      worker.bad_reason = e.what();
    }
  });
  return sum;
}

void BodySolver::Implementation::unpack(int chunk) {
  visit(chunk, [&](int contact, Kind k, int place) {
    const PointContact& c = (*contacts)[at(contact)];
    const Vector3d p = impulse(k, place);
    out->impulses[at(contact)] = turned[at(contact)] ? Vector3d(-p) : p;
    const Vector3d n = turned[at(contact)] ? Vector3d(-c.normal) : c.normal;
    const double xn = p.dot(n), tt = (p - xn * n).squaredNorm();
    const double most = k == Kind::smooth ? 0 : c.mu * xn;
    out->regimes[at(contact)] = !(xn > 0)                        ? Regime::separating
                                : tt >= most * most * (1 - 1e-9) ? Regime::sliding
                                                                 : Regime::sticking;
  });
}

}  // namespace tether::contact

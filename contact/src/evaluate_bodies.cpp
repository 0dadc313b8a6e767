// Tether: residuals of impulses between bodies. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/body_solver.hpp>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "refuse.hpp"
#include "system.hpp"

namespace tether::contact {

using detail::at;

namespace {

Eigen::Matrix3d skew(const Eigen::Vector3d& r) {
  Eigen::Matrix3d X;
  X << 0, -r[2], r[1], r[2], 0, -r[0], -r[1], r[0], 0;
  return X;
}

// Diagonal block of A in world axes.
Eigen::Matrix3d local_matrix(const RigidBody& A, const RigidBody& B, const Eigen::Vector3d& r1,
                             const Eigen::Vector3d& r2) {
  const Eigen::Matrix3d X1 = skew(r1), X2 = skew(r2);
  return (A.inverse_mass + B.inverse_mass) * Eigen::Matrix3d::Identity() -
         X1 * A.inverse_inertia * X1 - X2 * B.inverse_inertia * X2;
}

}  // namespace

Residuals evaluate(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
                   Law law, const std::vector<Eigen::Vector3d>& impulses) {
  if (impulses.size() != contacts.size()) {
    throw std::invalid_argument("impulses has " + std::to_string(impulses.size()) + " entries: " +
                                std::to_string(contacts.size()) +
                                " are needed, one for each contact");
  }
  const int m = static_cast<int>(bodies.size());
  for (std::size_t k = 0; k < bodies.size(); ++k) detail::check(k, bodies[k]);
  for (std::size_t i = 0; i < contacts.size(); ++i) detail::check(i, contacts[i], m);
  // Nothing can be said of an answer that is not finite.
  for (const Eigen::Vector3d& p : impulses)
    if (!p.allFinite()) return {};
  std::vector<Eigen::Vector3d> v(bodies.size()), w(bodies.size());
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    v[k] = bodies[k].velocity;
    w[k] = bodies[k].angular_velocity;
  }
  const RigidBody none;
  const auto relative = [&](const PointContact& c) {
    Eigen::Vector3d u = v[at(c.first)] + w[at(c.first)].cross(c.r1) + c.bias * c.normal;
    if (c.second >= 0) u -= v[at(c.second)] + w[at(c.second)].cross(c.r2);
    return u;
  };
  double bb = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const PointContact& c = contacts[i];
    bb += relative(c).squaredNorm();
  }
  std::vector<Eigen::Vector3d> before;
  for (const PointContact& c : contacts) before.push_back(relative(c));
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const PointContact& c = contacts[i];
    const Eigen::Vector3d& p = impulses[i];
    v[at(c.first)] += bodies[at(c.first)].inverse_mass * p;
    w[at(c.first)] += bodies[at(c.first)].inverse_inertia * c.r1.cross(p);
    if (c.second < 0) continue;
    v[at(c.second)] -= bodies[at(c.second)].inverse_mass * p;
    w[at(c.second)] -= bodies[at(c.second)].inverse_inertia * c.r2.cross(p);
  }
  Residuals r;
  r.signorini = r.cone = r.alignment = r.dissipation = r.energy_change = 0;
  double fixed = 0, map = 0, xx = 0, ww = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const PointContact& c = contacts[i];
    const RigidBody& A = bodies[at(c.first)];
    const RigidBody& B = c.second < 0 ? none : bodies[at(c.second)];
    const Eigen::Matrix3d F = tangent_frame(c.normal);
    const LocalBlock L(F * local_matrix(A, B, c.r1, c.r2) * F.transpose(), c.mu);
    const Eigen::Vector3d x = F * impulses[i], u = F * relative(c);
    const double mu = law == Law::frictionless ? 0 : c.mu, t = x.tail<2>().norm();
    r.signorini = std::max(r.signorini, std::abs(std::min(L.a * x[0], u[0])));
    r.cone = std::max({r.cone, L.a * (t - mu * x[0]), -L.a * x[0]});
    r.dissipation += x.dot(u);
    r.energy_change += 0.5 * x.dot(u + F * before[i]);
    // Block fixed point.
    const Eigen::Matrix3d D = L.matrix();
    LocalState state;
    for (int k = 0; k < 3; ++k) state.x[k] = x[k];
    solve_local(law, L, D * x - u, state);
    fixed += (D * (x - Eigen::Vector3d(state.x[0], state.x[1], state.x[2]))).squaredNorm();
    // Natural map, and the nearest slip that the law allows.
    double gamma[2] = {0, 0};
    if (law == Law::maximum_dissipation) {
      gamma[0] = mu * L.inv_a * L.c[0];
      gamma[1] = mu * L.inv_a * L.c[1];
    }
    Eigen::Vector3d z = x - u;
    if (law == Law::frictionless) {
      z << std::max(z[0], 0.0), 0, 0;
    } else {
      const double slip = detail::slip(u[1], u[2], gamma[0], gamma[1]);
      z -= slip * Eigen::Vector3d(mu, gamma[0], gamma[1]);
      detail::project_cone(mu, z.data());
    }
    map += (x - z).squaredNorm();
    xx += x.squaredNorm();
    ww += u.squaredNorm();
    if (mu == 0 || !(x[0] > 0)) continue;
    double misfit = u.tail<2>().norm();
    if (t > 0 && t >= mu * x[0] * (1 - 1e-9)) {
      const Eigen::Vector2d d = -(x.tail<2>() / t + Eigen::Vector2d(gamma[0], gamma[1]));
      const double dd = d.squaredNorm();
      const double s = dd > 0 ? std::max(0.0, u.tail<2>().dot(d) / dd) : 0;
      misfit = (u.tail<2>() - s * d).norm();
    }
    r.alignment = std::max(r.alignment, misfit);
  }
  const auto over = [](double p, double q) { return q > 0 ? p / q : p; };
  r.fixed_point = over(std::sqrt(fixed), std::sqrt(bb));
  r.natural_map = over(std::sqrt(map), std::sqrt(std::max({bb, xx, ww})));
  r.natural_map_data = over(std::sqrt(map), std::sqrt(bb));
  return r;
}

}  // namespace tether::contact

// Tether: packed bodies in contact. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/body_solver.hpp>

#include "random_contacts.hpp"

namespace tether::contact::random {

struct Packing {
  std::vector<RigidBody> bodies;
  std::vector<PointContact> contacts;
};

// Jittered cubic lattice of side^3 bodies on the ground, neighbours in contact: about 3 side^3
// contacts. Spheres, or ellipsoid-like bodies whose normals miss the centres. shuffle: bodies and
// contacts in random order, as after long mixing.
inline Packing packing(int side, bool spheres, std::uint64_t seed = 1, bool shuffle = false) {
  Generator g(seed);
  Packing out;
  std::vector<Eigen::Vector3d> centre;
  for (int z = 0; z < side; ++z)
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x) {
        centre.emplace_back(x + g.uniform(-0.1, 0.1), y + g.uniform(-0.1, 0.1),
                            z + g.uniform(-0.1, 0.1));
        RigidBody b;
        b.inverse_mass = 1 / g.uniform(0.5, 2);
        b.inverse_inertia = 10 * b.inverse_mass * Eigen::Matrix3d::Identity();
        if (!spheres) {
          const Eigen::Matrix3d R = g.rotation();
          b.inverse_inertia =
              R * (b.inverse_mass * Eigen::Vector3d(6, 10, 16)).asDiagonal() * R.transpose();
          b.inverse_inertia = (0.5 * (b.inverse_inertia + b.inverse_inertia.transpose())).eval();
        }
        b.velocity = 0.3 * g.vector() - 0.1 * Eigen::Vector3d::UnitZ();
        b.angular_velocity = 0.3 * g.vector();
        out.bodies.push_back(b);
      }
  const auto index = [side](int x, int y, int z) { return (z * side + y) * side + x; };
  const auto touch = [&](int i, int j) {
    PointContact c;
    c.first = i;
    c.second = j;
    c.mu = 0.4;
    c.normal = (j < 0 ? Eigen::Vector3d::UnitZ()
                      : Eigen::Vector3d(centre[static_cast<std::size_t>(i)] -
                                        centre[static_cast<std::size_t>(j)]))
                   .normalized();
    c.r1 = -0.5 * c.normal;
    c.r2 = 0.5 * c.normal;
    if (!spheres) {
      const Eigen::Vector3d off = 0.1 * g.vector();
      c.r1 += off;
      c.r2 += off;
    }
    out.contacts.push_back(c);
  };
  for (int z = 0; z < side; ++z)
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x) {
        const int i = index(x, y, z);
        if (z == 0) touch(i, -1);
        if (z > 0) touch(i, index(x, y, z - 1));
        if (y > 0) touch(i, index(x, y - 1, z));
        if (x > 0) touch(i, index(x - 1, y, z));
      }
  if (!shuffle) return out;
  const auto below = [&g](std::size_t n) {
    return static_cast<std::size_t>(g.uniform(0, static_cast<double>(n)));
  };
  std::vector<int> to(out.bodies.size());
  for (std::size_t k = 0; k < to.size(); ++k) to[k] = static_cast<int>(k);
  for (std::size_t k = to.size(); k-- > 1;) std::swap(to[k], to[below(k + 1)]);
  std::vector<RigidBody> bodies(out.bodies.size());
  for (std::size_t k = 0; k < to.size(); ++k)
    bodies[static_cast<std::size_t>(to[k])] = out.bodies[k];
  out.bodies.swap(bodies);
  for (PointContact& c : out.contacts) {
    c.first = to[static_cast<std::size_t>(c.first)];
    if (c.second >= 0) c.second = to[static_cast<std::size_t>(c.second)];
  }
  for (std::size_t k = out.contacts.size(); k-- > 1;)
    std::swap(out.contacts[k], out.contacts[below(k + 1)]);
  return out;
}

// A jittered face-centred lattice, neighbours nearer than `reach` in contact: two and a half
// contacts a body, or four with a reach of 1.08 and a jitter of 0.05. mixed: radii from 0.45 to
// 0.6, three and a half contacts a body.
inline Packing close_packing(int cells, bool spheres, double mu, std::uint64_t seed,
                             double jitter = 0.03, double reach = 1, bool mixed = false) {
  Packing out = packing(1, spheres, seed);
  out.contacts.clear();
  Generator g(seed);
  std::vector<Eigen::Vector3d> centre;
  std::vector<double> radius;
  const RigidBody pattern = out.bodies[0];
  out.bodies.clear();
  for (int k = 0; k < 4 * cells * cells * cells; ++k) {
    const int cell = k / 4, corner = k % 4;
    const Eigen::Vector3d origin(cell % cells, cell / cells % cells, cell / (cells * cells));
    const Eigen::Vector3d offset(corner % 3 == 0 ? 0 : 0.5, corner == 1 || corner == 3 ? 0.5 : 0,
                                 corner >= 2 ? 0.5 : 0);
    centre.push_back(std::sqrt(2.0) * (origin + offset) + jitter * g.vector());
    radius.push_back(mixed ? 0.5 * g.uniform(0.9, 1.2) : 0.5);
    RigidBody body = pattern;
    const double mass = std::pow(4, g.uniform(-0.5, 0.5)) * std::pow(2 * radius.back(), 3);
    body.inverse_inertia *= 1 / (mass * body.inverse_mass);
    body.inverse_mass = 1 / mass;
    body.velocity = 0.3 * g.vector() - 0.1 * Eigen::Vector3d::UnitZ();
    body.angular_velocity = 0.3 * g.vector();
    out.bodies.push_back(body);
  }
  const auto touch = [&](int i, int j, const Eigen::Vector3d& normal) {
    PointContact c;
    c.first = i;
    c.second = j;
    c.mu = mu;
    c.normal = normal;
    const Eigen::Vector3d off =
        spheres ? Eigen::Vector3d::Zero() : Eigen::Vector3d(0.1 * g.vector());
    c.r1 = -radius[static_cast<std::size_t>(i)] * normal + off;
    c.r2 = (j < 0 ? 0.5 : radius[static_cast<std::size_t>(j)]) * normal + off;
    out.contacts.push_back(c);
  };
  for (int i = 0; i < static_cast<int>(centre.size()); ++i) {
    const Eigen::Vector3d& p = centre[static_cast<std::size_t>(i)];
    if (p.z() < 0.2) touch(i, -1, Eigen::Vector3d::UnitZ());
    for (int j = 0; j < i; ++j) {
      const Eigen::Vector3d d = p - centre[static_cast<std::size_t>(j)];
      const double sum = radius[static_cast<std::size_t>(i)] + radius[static_cast<std::size_t>(j)];
      if (d.norm() < reach * sum) touch(i, j, d.normalized());
    }
  }
  return out;
}

}  // namespace tether::contact::random

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

}  // namespace tether::contact::random

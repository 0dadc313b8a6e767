// Tether: small assemblies of bodies in contact. SPDX-License-Identifier: BSD-3-Clause
#include "assemblies.hpp"

#include <cmath>
#include <utility>

namespace tether::contact::random {

RigidBody box(double mass, const Eigen::Vector3d& half) {
  RigidBody body;
  const Eigen::Vector3d s = half.cwiseProduct(half) * (mass / 3);
  body.inverse_mass = 1 / mass;
  body.inverse_inertia.diagonal() << 1 / (s[1] + s[2]), 1 / (s[0] + s[2]), 1 / (s[0] + s[1]);
  return body;
}

RigidBody sphere(double mass, double radius) {
  RigidBody body;
  body.inverse_mass = 1 / mass;
  body.inverse_inertia.diagonal().setConstant(1 / (0.4 * mass * radius * radius));
  return body;
}

Assembly stack(int n, double ratio, double mu) {
  Assembly out;
  for (int k = 0; k < n; ++k) {
    RigidBody body = box(k == n - 1 ? ratio : 1, {0.5, 0.5, 0.5});
    body.velocity << 0.001, 0.002, -0.0981;
    out.bodies.push_back(body);
    for (double x : {-0.5, 0.5})
      for (double y : {-0.5, 0.5})
        out.contacts.push_back(
            ContactRows::at_point(k, k - 1, {x, y, -0.5}, {x, y, 0.5}, {0, 0, 1}, mu));
  }
  return out;
}

void RigidAssembly::touch(int first, int second, const Eigen::Vector3d& r1,
                          const Eigen::Vector3d& r2, const Eigen::Vector3d& normal, double mu) {
  PointContact c;
  c.first = first;
  c.second = second;
  c.r1 = r1;
  c.r2 = r2;
  c.normal = normal.normalized();
  c.mu = mu;
  contacts.push_back(c);
}

void RigidAssembly::add(const RigidAssembly& other) {
  const int b = static_cast<int>(bodies.size());
  const std::uint64_t ids = contacts.size();
  bodies.insert(bodies.end(), other.bodies.begin(), other.bodies.end());
  for (PointContact c : other.contacts) {
    c.first += b;
    if (c.second >= 0) c.second += b;
    if (c.id != PointContact::kNoId) c.id += ids;
    contacts.push_back(c);
  }
}

RigidAssembly rigid_stack(int n, double ratio, double mu) {
  RigidAssembly out;
  out.bodies = stack(n, ratio, mu).bodies;
  for (int k = 0; k < n; ++k)
    for (double x : {-0.5, 0.5})
      for (double y : {-0.5, 0.5}) {
        PointContact c;
        c.first = k;
        c.second = k - 1;
        c.r1 << x, y, -0.5;
        c.r2 << x, y, 0.5;
        c.mu = mu;
        c.id = out.contacts.size();
        out.contacts.push_back(c);
      }
  return out;
}

RigidAssembly moving_stack(int n, int heavy, Generator& g) {
  RigidAssembly out;
  const Eigen::Vector3d h(g.uniform(0.15, 1), g.uniform(0.3, 1), g.uniform(0.2, 0.6));
  const double speed = std::pow(10, g.uniform(-4, -1.5)), mu = g.uniform(0.2, 0.9);
  const Eigen::Vector3d square = h.cwiseProduct(h);
  for (int k = 0; k < n; ++k) {
    RigidBody b;
    b.inverse_mass = (k + heavy) % 2 ? 1e-6 : 1;
    const Eigen::Vector3d inverse(3 / (square.y() + square.z()), 3 / (square.x() + square.z()),
                                  3 / (square.x() + square.y()));
    b.inverse_inertia = (b.inverse_mass * inverse).asDiagonal();
    b.velocity = speed * g.vector() - 9.81e-3 * Eigen::Vector3d::UnitZ();
    b.angular_velocity = speed * g.vector();
    out.bodies.push_back(b);
    const double aside_x = g.uniform(-0.1, 0.1), aside_y = g.uniform(-0.1, 0.1);
    for (double x : {-0.9, 0.9})
      for (double y : {-0.9, 0.9})
        out.touch(k, k - 1, {x * h.x(), y * h.y(), -h.z()},
                  {(x + aside_x) * h.x(), (y + aside_y) * h.y(), k > 0 ? h.z() : 0}, {0, 0, 1}, mu);
  }
  return out;
}

Assembly cluster(Generator& g, double mu, int bodies, int contacts) {
  Assembly out;
  for (int k = 0; k < bodies; ++k) {
    RigidBody body =
        box(std::exp(g.uniform(-1, 1)), {g.uniform(0.2, 1), g.uniform(0.2, 1), g.uniform(0.2, 1)});
    const Eigen::Matrix3d R = g.rotation();
    body.inverse_inertia = (R * body.inverse_inertia * R.transpose()).eval();
    Vector6d v;
    v << g.vector(), g.vector();
    body.set_velocities(v);
    out.bodies.push_back(body);
  }
  for (int k = 0; k < contacts; ++k) {
    const int first = static_cast<int>(g.uniform(0, bodies));
    int second = static_cast<int>(g.uniform(-1, bodies));
    if (second >= first) second = second == first ? -1 : second;
    Eigen::Vector3d normal = g.vector().normalized();
    const Eigen::Vector3d r1(g.uniform(-1, 1), g.uniform(-1, 1), g.uniform(-1, 1));
    const Eigen::Vector3d r2(g.uniform(-1, 1), g.uniform(-1, 1), g.uniform(-1, 1));
    out.contacts.push_back(ContactRows::at_point(first, second, r1, r2, normal, mu));
  }
  return out;
}

Problem shuffled(const Problem& p, Generator& g, std::vector<int>* order) {
  const int n = p.contacts(), d = p.dimension();
  std::vector<int> to(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) to[static_cast<std::size_t>(i)] = i;
  for (int i = n - 1; i > 0; --i)
    std::swap(to[static_cast<std::size_t>(i)],
              to[static_cast<std::size_t>(static_cast<int>(g.uniform(0, i + 1)))]);
  std::vector<Eigen::Matrix3d> R;
  for (int i = 0; i < n; ++i) {
    Eigen::Matrix3d r = Eigen::Matrix3d::Identity();
    const double a = d == 3 ? g.uniform(0, 6.283185307179586) : 0;
    r.bottomRightCorner<2, 2>() << std::cos(a), -std::sin(a), std::sin(a), std::cos(a);
    R.push_back(r);
  }
  std::vector<MatrixBlock> blocks;
  Eigen::VectorXd b(d * n), mu(n);
  for (int i = 0; i < n; ++i) {
    const std::size_t si = static_cast<std::size_t>(i);
    for (int k = p.row_start()[si]; k < p.row_start()[si + 1]; ++k) {
      const std::size_t j = static_cast<std::size_t>(p.columns()[static_cast<std::size_t>(k)]);
      Eigen::Matrix3d value;
      for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r)
          value(r, c) = p.blocks()[static_cast<std::size_t>(k)].column[4 * c + r];
      blocks.push_back({to[si], to[j], R[si] * value * R[j].transpose()});
    }
    b.segment(d * to[si], d) = R[si].topLeftCorner(d, d) * p.b().segment(d * i, d);
    mu[to[si]] = p.mu(i);
  }
  if (order) *order = to;
  return Problem::sparse(d, std::move(blocks), b, mu);
}

}  // namespace tether::contact::random

// Tether: contacts with rolling friction as a product of cones. SPDX-License-Identifier:
// BSD-3-Clause
#include "rolling/rolling_cones.hpp"

#include <algorithm>
#include <tether/linalg/index.hpp>

#include "cones/cone_rows.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, 6, 0, 6, 6>;

Cone cone_of(const RollingContact& c) {
  const double mu = c.point.mu;
  if (c.rolling > 0 && c.torsional > 0) return Cone::with_rolling(mu, c.rolling, c.torsional);
  if (c.rolling > 0) return Cone::with_rolling(mu, c.rolling);
  return c.torsional > 0 ? Cone::with_torsional(mu, c.torsional) : Cone::friction(mu);
}

// Axes of the rows: forces in the first three, then moments.
Rows axes_of(const RollingContact& c, const Cone& cone) {
  const Eigen::Matrix3d frame = tangent_frame(c.point.normal);
  const ConeParts parts = parts_of(cone.kind);
  Rows out = Rows::Zero(cone.rows, 6);
  out.topLeftCorner<3, 3>() = frame;
  if (parts.spin >= 0) out.block<1, 3>(parts.spin, 3) = frame.row(0);
  if (parts.rolling >= 0) out.block<2, 3>(parts.rolling, 3) = frame.bottomRows<2>();
  return out;
}

// On the velocities of a body that the contact touches at r.
Rows rows_at(const Rows& axes, const Vector3d& r, double sign) {
  Rows out = sign * axes;
  for (int k = 0; k < 3; ++k)
    out.block<1, 3>(k, 3) = sign * r.cross(Vector3d(axes.block<1, 3>(k, 0))).transpose();
  return out;
}

struct Side {
  int body, row;  // row: the first of the contact
  Rows J;
};

}  // namespace

ConeProblem rolling_problem(const std::vector<RigidBody>& bodies,
                            const std::vector<RollingContact>& contacts) {
  std::vector<Cone> cones;
  std::vector<Side> sides;
  int rows = 0;
  std::vector<double> b;
  for (const RollingContact& c : contacts) {
    const PointContact& p = c.point;
    cones.push_back(cone_of(c));
    const Rows axes = axes_of(c, cones.back());
    Eigen::VectorXd w = axes.leftCols<3>() * p.slip;
    w[0] += p.bias;
    const auto add = [&](int body, const Vector3d& r, double sign) {
      if (body < 0) return;
      const Rows J = rows_at(axes, r, sign);
      w += J * bodies[at(body)].velocities();
      if (bodies[at(body)].moves()) sides.push_back({body, rows, J});
    };
    add(p.first, p.r1, 1);
    add(p.second, p.r2, -1);
    for (const double v : w) b.push_back(-v);
    rows += cones.back().rows;
  }
  std::stable_sort(sides.begin(), sides.end(),
                   [](const Side& i, const Side& j) { return i.body < j.body; });
  std::vector<MatrixEntry> A;
  for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    const Matrix6d inverse_mass = bodies[at(sides[begin].body)].inverse_mass_matrix();
    while (end < sides.size() && sides[end].body == sides[begin].body) ++end;
    for (std::size_t i = begin; i < end; ++i) {
      const Rows moved = sides[i].J * inverse_mass;
      for (std::size_t j = begin; j < end; ++j)
        for (Eigen::Index r = 0; r < moved.rows(); ++r)
          for (Eigen::Index c = 0; c < sides[j].J.rows(); ++c)
            A.push_back({sides[i].row + static_cast<int>(r), sides[j].row + static_cast<int>(c),
                         moved.row(r).dot(sides[j].J.row(c))});
    }
  }
  return ConeProblem::sparse(A, Eigen::Map<const Eigen::VectorXd>(b.data(), rows),
                             std::move(cones));
}

ConeSolution solve_rolling(const std::vector<RigidBody>& bodies, const Options& options,
                           std::vector<RollingContact>& contacts) {
  const ConeProblem problem = rolling_problem(bodies, contacts);
  Eigen::VectorXd start(problem.rows());
  const auto rows_of = [&](std::size_t k) {
    return std::pair<int, Rows>(problem.first_row(static_cast<int>(k)),
                                axes_of(contacts[k], problem.cones()[k]));
  };
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const auto [row, axes] = rows_of(k);
    Vector6d x;
    x << contacts[k].impulse, contacts[k].moment;
    start.segment(row, axes.rows()) = axes * x;
  }
  ConeSolution out = ConeSolver(options).solve(problem, start);
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const auto [row, axes] = rows_of(k);
    const Vector6d x = axes.transpose() * out.impulses.segment(row, axes.rows());
    contacts[k].impulse = x.head<3>();
    contacts[k].moment = x.tail<3>();
  }
  return out;
}

}  // namespace tether::contact::detail

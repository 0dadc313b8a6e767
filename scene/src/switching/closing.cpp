// Tether: the impulse of joints that close. SPDX-License-Identifier: BSD-3-Clause
//
// With the rows G u + g_t = 0 of the joints, the masses M and the velocities u before:
//
//   min (u+ - u)' M (u+ - u) / 2   so that   G u+ = -g_t
//
// which is M (u+ - u) = G' x, the law of a plastic impact. Where no row moves (g_t = 0) it takes
// the energy (u+ - u)' M (u+ - u) / 2 (Carnot).
#include <tether/linalg/disjoint_sets.hpp>
#include <tether/linalg/least_squares.hpp>

#include "bounds.hpp"
#include "joints/joint_type.hpp"
#include "switching.hpp"

namespace tether::scene::switching {

using namespace mechanics;

namespace {

/// At t = 0 without velocities, and in the states.
struct Placed {
  Bodies start, now;
};

Placed place(const Scene& scene, const std::vector<BodyState>& states) {
  Placed out{weighed_bodies(scene), {}};
  out.now = out.start;
  for (const std::size_t b : scene.moving()) out.now.put(static_cast<int>(b), states[b]);
  return out;
}

/// The joints that moving bodies and couplings connect to these, themselves included.
std::vector<bool> connected(const Scene& scene, const std::vector<int>& joints) {
  const int count = static_cast<int>(scene.joints.size());
  linalg::DisjointSets sets(count + static_cast<int>(scene.bodies.size()));  // joints, then bodies
  for (int j = 0; j < count; ++j)
    for (const int body : {scene.joints[at(j)].first, scene.joints[at(j)].second})
      if (scene.moves(body)) sets.join(j, count + body);
  for (const Coupling& each : scene.couplings)
    for (const int j : each.joints) sets.join(j, each.joints.front());
  std::vector<bool> out;
  for (int j = 0; j < count; ++j)
    out.push_back(any_of(joints, [&](int each) { return sets.root(each) == sets.root(j); }));
  return out;
}

/// The rows in terms of the velocities of the bodies that they act on.
struct Rows {
  Eigen::MatrixXd G;                // 6 columns a body: velocity, angular velocity in its axes
  Eigen::VectorXd defect;           // G u + g_t
  std::vector<std::size_t> bodies;  // by block of columns
  std::vector<int> joints;          // by row
};

Rows rows_of(const Scene& scene, double time, const std::vector<bool>& used, const Placed& placed) {
  const Bodies& bodies = placed.now;
  joints::JointRows all(scene, placed.start);
  all.set_time(time);
  Eigen::VectorXd rates(all.count());
  all.values<1>(bodies, rates.data());
  std::vector<int> place_of_row(at(all.count()), -1), block_of_body(bodies.frames.size(), -1);
  Rows out;
  all.each([&](const auto& row) {
    if (!used[at(row.joint)]) return;
    for (int i = 0; i < row.count; ++i) {
      int& place = place_of_row[at(row.row + i)];
      if (place >= 0) continue;  // a part of a coupling has given it
      place = static_cast<int>(out.joints.size());
      out.joints.push_back(row.joint);
    }
    for (const int body : {row.first, row.second}) {
      if (!bodies.moves(body) || block_of_body[at(body)] >= 0) continue;
      block_of_body[at(body)] = static_cast<int>(out.bodies.size());
      out.bodies.push_back(at(body));
    }
  });
  out.G.setZero(static_cast<Eigen::Index>(out.joints.size()),
                6 * static_cast<Eigen::Index>(out.bodies.size()));
  out.defect.resize(out.G.rows());
  all.each([&](const auto& row) {
    if (!used[at(row.joint)]) return;
    joints::JointRows::each_unit_load(
        row, bodies, [&](int i, int body, const Vector3d& force, const Vector3d& torque) {
          const int place = place_of_row[at(row.row + i)], column = 6 * block_of_body[at(body)];
          out.G.block<1, 3>(place, column) += force.transpose();
          out.G.block<1, 3>(place, column + 3) += torque.transpose();
        });
  });
  for (int k = 0; k < all.count(); ++k)
    if (place_of_row[at(k)] >= 0) out.defect[place_of_row[at(k)]] = rates[k];
  return out;
}

}  // namespace

void take_places(const Scene& scene, double time, const std::vector<BodyState>& bodies,
                 Joint& joint) {
  const auto pose = [&](int b) {
    return b < 0 ? Pose{} : Pose{bodies[at(b)].position, bodies[at(b)].orientation};
  };
  const auto at_start = [&](int b) {
    if (b < 0) return Pose{};
    const Body& body = scene.bodies[at(b)];
    return Pose{body.position, body.orientation.normalized()};
  };
  const Pose first = pose(joint.first), second = pose(joint.second), start = at_start(joint.first);
  if (joint.kind == JointKind::distance) {
    const auto now = [](const Pose& from, const Pose& to, const Eigen::Vector3d& point) {
      return Eigen::Vector3d(
          to.position + to.orientation * (from.orientation.conjugate() * (point - from.position)));
    };
    joint.length =
        (now(start, first, joint.at) - now(at_start(joint.second), second, joint.at_second)).norm();
    return;
  }
  const linalg::Quaternion turn = start.orientation * first.orientation.conjugate();
  joint.closed = Pose{start.position + turn * (second.position - first.position),
                      (turn * second.orientation).normalized()};
  if (joint.motor) joint.motor->target -= joint.motor->rate * time;  // its clock begins here
}

double close(const Scene& scene, double time, const std::vector<int>& closing,
             std::vector<BodyState>& states) {
  const Placed placed = place(scene, states);
  const Bodies& bodies = placed.now;
  Rows rows = rows_of(scene, time, connected(scene, closing), placed);
  // G M^-1/2, rows of length 1: z = M^1/2 (u+ - u) is the shortest that meets them.
  const Eigen::Index blocks = static_cast<Eigen::Index>(rows.bodies.size());
  Eigen::MatrixXd to_change = Eigen::MatrixXd::Zero(6 * blocks, 6);  // M^-1/2, block by block
  Eigen::VectorXd before(6 * blocks);
  for (Eigen::Index k = 0; k < blocks; ++k) {
    const std::size_t b = rows.bodies[static_cast<std::size_t>(k)];
    const Inertia& inertia = bodies.inertia[b];
    auto block = to_change.block<6, 6>(6 * k, 0);
    block.topLeftCorner<3, 3>() = Matrix3d::Identity() / std::sqrt(inertia.mass);
    block.bottomRightCorner<3, 3>() =
        Matrix3d(inertia.inertia.llt().matrixL()).inverse().transpose();
    before.segment<3>(6 * k) = bodies.frames[b].v;
    before.segment<3>(6 * k + 3) = bodies.w[b];
    rows.G.middleCols(6 * k, 6) = (rows.G.middleCols(6 * k, 6) * block).eval();
  }
  for (Eigen::Index i = 0; i < rows.G.rows(); ++i) {
    const double length = rows.G.row(i).norm();
    if (!(length > 0)) continue;
    rows.G.row(i) /= length;
    rows.defect[i] /= length;
  }
  linalg::LeastSquares factor(kDependentRow);
  factor.factor(rows.G);
  const Eigen::VectorXd z = factor.solve(Eigen::VectorXd(-rows.defect));
  const Eigen::VectorXd left = rows.G * z + rows.defect;
  double gained = 0, size = z.norm();
  Eigen::VectorXd root(6);  // M^1/2 u of a body
  for (Eigen::Index k = 0; k < blocks; ++k) {
    const std::size_t b = rows.bodies[static_cast<std::size_t>(k)];
    const auto block = to_change.block<6, 6>(6 * k, 0);
    const Eigen::VectorXd by = z.segment<6>(6 * k), change = block * by;
    root = block.triangularView<Eigen::Upper>().solve(before.segment<6>(6 * k));
    gained += root.dot(by) + 0.5 * by.squaredNorm();
    size = std::max(size, root.norm());
    states[b].velocity += change.head<3>();
    states[b].angular_velocity += bodies.frames[b].R * change.tail<3>();
  }
  Eigen::Index worst = 0;
  if (left.size() > 0 && left.cwiseAbs().maxCoeff(&worst) > 1e-8 * size)
    throw SimulationError(fmt::format(
        "t = {:g} s: joint \"{}\" cannot close: joints ask for different velocities", time,
        joints::name_of(scene.joints[at(rows.joints[static_cast<std::size_t>(worst)])],
                        at(rows.joints[static_cast<std::size_t>(worst)]))));
  return -gained;
}

}  // namespace tether::scene::switching

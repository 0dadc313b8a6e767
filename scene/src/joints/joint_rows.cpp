// Tether: the rows of all joints of a scene. SPDX-License-Identifier: BSD-3-Clause
#include "joint_rows.hpp"

#include "joint_type.hpp"

namespace tether::scene::joints {

JointRows::JointRows(const Scene& scene, const Bodies& bodies) {
  motions_.reserve(scene.joints.size());
  now_.resize(scene.joints.size());  // fixed from here on: rows keep pointers
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const Joint& joint = scene.joints[j];
    const std::string name = name_of(joint, j);
    names_.push_back(name);
    Row row;
    row.first = bodies.index(joint.first);
    row.second = bodies.index(joint.second);
    row.joint = static_cast<int>(j);
    if (row.first == row.second || (!bodies.moves(row.first) && !bodies.moves(row.second)))
      throw std::invalid_argument("joint \"" + name +
                                  "\" joins nothing that can move against each other");
    if (joint.window)
      throw std::invalid_argument("joint \"" + name +
                                  "\" attaches, detaches or breaks: make_engine() has that");
    const JointType& kind = type(joint.kind);
    if (joint.motion && kind.motion() == JointType::MotionOf::nothing)
      throw std::invalid_argument("joint \"" + name + "\": a " + std::string(word(joint.kind)) +
                                  " joint has no motion to prescribe");
    kind.check(joint, name);
    const Now* now = nullptr;
    if (joint.motion) {
      now = &now_[motions_.size()];
      motions_.push_back(*joint.motion);
    }
    RowBuilder builder(*this, joint, row, bodies.frames[at(row.first)],
                       second_at_closing(joint, bodies.frames[at(row.second)]), now);
    kind.add_rows(builder);
  }
  couple(scene, bodies);
  place_bodies(bodies);
}

void JointRows::couple(const Scene& scene, const Bodies& bodies) {
  for (const Coupling& coupling : scene.couplings) {
    const std::vector<std::vector<double>> parts = couplings::polynomials(scene, coupling);
    turns_.push_back({count_, couplings::turn(scene, coupling, parts)});
    const bool turns = is_angle(scene.joints[at(coupling.joints[0])]);
    for (std::size_t k = 0; k < parts.size(); ++k) {
      const int j = coupling.joints[k];
      Relation part(Coordinate(scene.joints[at(j)], bodies));
      part.first = part.coordinate.first();
      part.second = part.coordinate.second();
      part.joint = j;
      part.row = count_;
      part.measures = turns ? MotionOf::angle : MotionOf::length;
      part.polynomial = parts[k];
      std::get<std::vector<Relation>>(rows_).push_back(std::move(part));
    }
    ++count_;
  }
}

void JointRows::place_bodies(const Bodies& bodies) {
  std::vector<std::vector<int>> slots(at(count_));
  const auto slot = [&](int body) { return bodies.inertia[at(body)].slot; };
  each([&](const auto& row) {
    for (const int body : {row.first, row.second})
      if (slot(body) >= 0) slots[at(row.row)].push_back(slot(body));
  });
  for (std::vector<int>& each : slots) {
    sort_unique(each);
  }
  const auto place = [&](auto& kind) {
    for (auto& row : kind) {
      const std::vector<int>& of = slots[at(row.row)];
      const auto before = [&](int body) {
        return static_cast<int>(std::lower_bound(of.begin(), of.end(), slot(body)) - of.begin());
      };
      row.place_first = before(row.first);
      row.place_second = before(row.second);
    }
  };
  std::apply([&](auto&... kinds) { (place(kinds), ...); }, rows_);
}

void JointRows::gradient(const Bodies& bodies, Eigen::MatrixXd& G) const {
  G.setZero(count_, 6 * bodies.moving);
  each([&](const auto& row) {
    each_unit_load(row, bodies,
                   [&](int i, int body, const Vector3d& force, const Vector3d& torque) {
                     const int slot = bodies.inertia[at(body)].slot;
                     G.block<1, 3>(row.row + i, 6 * slot) += force.transpose();
                     G.block<1, 3>(row.row + i, 6 * slot + 3) += torque.transpose();
                   });
  });
}

RowBuilder::RowBuilder(JointRows& rows, const Joint& joint, const Row& bodies,
                       const Frame<double>& A, const Frame<double>& B, const Now* now)
    : rows_(rows),
      joint_(joint),
      bodies_(bodies),
      A_(A),
      B_(B),
      now_(now),
      z_(joint.axis.norm() > 0 ? Vector3d(joint.axis.normalized()) : Vector3d(Vector3d::UnitZ())),
      x_(z_.unitOrthogonal()),
      y_(z_.cross(x_)) {}

std::vector<JointForce> Reactions::find(const JointRows& rows, const Bodies& bodies,
                                        const double* multipliers) const {
  std::vector<JointForce> out(joints_.size());
  rows.each([&](const auto& row) {
    Wrench<double> a = no_wrench<double>(), b = no_wrench<double>();
    row.pull(bodies.frames[at(row.first)], bodies.frames[at(row.second)], multipliers + row.row, a,
             b);
    out[at(row.joint)].force += a.force;
    out[at(row.joint)].moment += a.torque;  // about the centre so far
  });
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const Coordinate& joint = joints_[j];
    JointForce& each = out[j];
    each.at = joint.place(bodies);
    each.moment -= (each.at - bodies.frames[at(joint.first())].x).cross(each.force);
    if (joint.what() == MotionOf::nothing) continue;
    each.drive =
        joint.direction(bodies).dot(joint.what() == MotionOf::angle ? each.moment : each.force);
  }
  return out;
}

}  // namespace tether::scene::joints

// Tether: the rows of joints as a certificate tells them. SPDX-License-Identifier: BSD-3-Clause
#include "joint_lines.hpp"

#include <tether/linalg/least_squares.hpp>

#include "joints/joint_type.hpp"
#include "sheet.hpp"

namespace tether::scene::certificate {

namespace {

using namespace joints;

struct RowLine {
  Vector3d on = Vector3d::Zero(), on_second = on, axis = on;
  double length = 0;
  const char* kind = "point";
  bool moves = false;
};

RowLine line_of(const Coincidence& row, int i) {
  return {row.at_first, row.at_second, Vector3d::Unit(i), 0, "point"};
}
RowLine line_of(const RightAngle& row, int) {
  return {row.of_first, row.of_second, Vector3d::Zero(), 0, "angle"};
}
RowLine line_of(const Angle& row, int) {
  return {row.of_first, row.ahead, row.zero.cross(row.ahead), 0, "angle", row.now != nullptr};
}
RowLine line_of(const Plane& row, int) {
  return {row.at_first, row.at_second, row.normal, 0, "plane", row.now != nullptr};
}
RowLine line_of(const Distance& row, int) {
  return {row.at_first, row.at_second, Vector3d::Zero(),
          row.length,   "distance",    row.now != nullptr};
}

void put_row(std::string& out, int number, std::array<int, 2> body, const RowLine& row,
             const Scene& scene, int joint) {
  const Joint& of = scene.joints[at(joint)];
  const Motion motion = row.moves ? of.motion.value_or(Motion{}) : Motion{};
  for (int& each : body)
    if (each == static_cast<int>(scene.bodies.size())) each = -1;  // the world
  Line(out, "row") << number << body[0] << body[1] << row.on << row.on_second << row.axis
                   << row.length << (row.moves ? motion.rate : 0)
                   << (row.moves ? motion.amplitude : 0) << (row.moves ? motion.frequency : 0)
                   << (row.moves ? motion.phase : 0) << row.kind << joints::name_of(of, at(joint));
}

template <class Row>
constexpr bool is_coupling = std::is_same_v<std::decay_t<Row>, Relation>;

}  // namespace

JointLines::JointLines(const Scene& scene)
    : rows_(scene, mechanics::weighed_bodies(scene)),
      reactions_(scene, mechanics::weighed_bodies(scene)) {
  const mechanics::Bodies bodies = mechanics::weighed_bodies(scene);
  std::vector<char> coupled(scene.joints.size(), 0);
  for (const Coupling& coupling : scene.couplings)
    for (const int joint : coupling.joints) coupled[at(joint)] = 1;
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const Joint& joint = scene.joints[j];
    std::vector<Coordinate> along;
    if (joint.limits || joint.motor || joint.spring || joint.friction != 0)
      along = coordinates_of(joint, j, bodies);
    else if (coupled[j] != 0)
      along = {Coordinate(joint, bodies)};
    for (std::size_t k = 0; k < along.size(); ++k)
      free_.push_back(
          {static_cast<int>(j), along[k], along[k].is_component() ? static_cast<int>(k) : -1});
  }
}

void JointLines::put_rows(const Scene& scene, std::string& out) const {
  rows_.each([&](const auto& row) {
    if constexpr (!is_coupling<decltype(row)>)
      for (int i = 0; i < row.count; ++i)
        put_row(out, row.row + i, {row.first, row.second}, line_of(row, i), scene, row.joint);
  });
  const mechanics::Bodies bodies = mechanics::weighed_bodies(scene);
  int number = rows_.count();
  for (const auto& [joint, along, component] : free_) {
    const auto &A = bodies.frames[at(along.first())], &B = bodies.frames[at(along.second())];
    RowLine row;
    row.kind = along.what() == MotionOf::angle ? "turn" : "way";
    row.on = mechanics::point_in(A, along.place(bodies));
    row.axis = component < 0 ? mechanics::direction_in(B, along.direction(bodies))
                             : Vector3d(Vector3d::Unit(component));
    put_row(out, number++, {along.first(), along.second()}, row, scene, joint);
  }
}

std::vector<JointLines::Unit> JointLines::units(const mechanics::Bodies& bodies, double time) {
  std::vector<Unit> out;
  const auto none = mechanics::no_wrench<double>();
  rows_.set_time(time);
  rows_.each([&](const auto& row) {
    if constexpr (!is_coupling<decltype(row)>)
      JointRows::each_unit_pull(row, bodies, [&](int i, const auto& a, const auto& b) {
        out.push_back({row.row + i, row.joint, {row.first, row.second}, {a, b}});
      });
  });
  int number = rows_.count();
  for (const auto& [joint, along, component] : free_) {
    Unit& unit =
        out.emplace_back(Unit{number++, joint, {along.first(), along.second()}, {none, none}});
    if (component < 0) {
      along.gradient(bodies, unit.on[0], unit.on[1]);
    } else {  // about an axis of the second body
      const Vector3d axis = bodies.frames[at(along.second())].R.col(component);
      unit.on[0].torque = axis, unit.on[1].torque = -axis;
    }
  }
  return out;
}

void JointLines::put_pulls(const mechanics::Bodies& bodies, double time,
                           const std::vector<JointForce>& forces, std::string& out) {
  std::vector<std::vector<Unit>> of(forces.size());
  for (const Unit& unit : units(bodies, time)) of[at(unit.joint)].push_back(unit);
  for (std::size_t j = 0; j < forces.size(); ++j) {
    if (of[j].empty()) continue;
    Eigen::MatrixXd G(6, of[j].size());
    for (std::size_t k = 0; k < of[j].size(); ++k)
      G.col(static_cast<int>(k)) << of[j][k].on[0].force, of[j][k].on[0].torque;
    const JointForce& f = forces[j];
    Eigen::Matrix<double, 6, 1> load;
    load << f.force, f.moment + (f.at - bodies.frames[at(of[j][0].body[0])].x).cross(f.force);
    linalg::LeastSquares factors;
    factors.factor(G);
    const Eigen::VectorXd x = factors.solve(load);
    for (std::size_t k = 0; k < of[j].size(); ++k)
      if (x[static_cast<int>(k)] != 0)
        Line(out, "pull") << of[j][k].number << x[static_cast<int>(k)];
  }
}

}  // namespace tether::scene::certificate

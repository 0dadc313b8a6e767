// Tether: the rows that the joints of a scene become. SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>
#include <tether/scene/words.hpp>

#include "system.hpp"

namespace tether::scene::smooth {

namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

Vector3d perpendicular(const Vector3d& axis) { return axis.unitOrthogonal(); }

}  // namespace

void System::add_joints(const Scene& scene) {
  const int world = static_cast<int>(scene.bodies.size());
  motions_.reserve(scene.joints.size());
  now_.resize(scene.joints.size());  // fixed now: rows keep pointers
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const Joint& joint = scene.joints[j];
    const std::string name =
        joint.name.empty() ? std::string(word(joint.kind)) + " " + std::to_string(j) : joint.name;
    joint_names_.push_back(name);
    Row row;
    row.first = joint.first < 0 ? world : joint.first;
    row.second = joint.second < 0 ? world : joint.second;
    row.joint = static_cast<int>(j);
    if (row.first == row.second || (!bodies_.moves(row.first) && !bodies_.moves(row.second)))
      throw std::invalid_argument("joint \"" + name +
                                  "\" joins nothing that can move against each other");
    const Frame<double>&A = bodies_.frames[at(row.first)], &B = bodies_.frames[at(row.second)];
    const auto point_of = [](const Frame<double>& f, const Vector3d& p) {
      return Vector3d(f.R.transpose() * (p - f.x));
    };
    const auto direction_of = [](const Frame<double>& f, const Vector3d& u) {
      return Vector3d(f.R.transpose() * u);
    };
    const Now* now = nullptr;
    if (joint.motion) {
      if (joint.kind == JointKind::ball || joint.kind == JointKind::fixed)
        throw std::invalid_argument("joint \"" + name + "\": a " + std::string(word(joint.kind)) +
                                    " joint has no motion to prescribe");
      now = &now_[motions_.size()];
      motions_.push_back(*joint.motion);
      has_motion_ = true;
    }
    if ((joint.kind == JointKind::hinge || joint.kind == JointKind::slider) &&
        !(joint.axis.norm() > 0))
      throw std::invalid_argument("joint \"" + name + "\": its axis has no length");

    const Vector3d z =
        joint.axis.norm() > 0 ? Vector3d(joint.axis.normalized()) : Vector3d(Vector3d::UnitZ());
    const Vector3d x = perpendicular(z), y = z.cross(x);
    const auto place = [&](auto each) {
      static_cast<Row&>(each) = row;
      each.row = m_;
      m_ += each.count;
      return each;
    };
    const auto coincide = [&] {
      Coincidence each;
      each.at_first = point_of(A, joint.at);
      each.at_second = point_of(B, joint.at);
      coincidences_.push_back(place(each));
    };
    const auto right_angle = [&](const Vector3d& u, const Vector3d& v) {
      RightAngle each;
      each.of_first = direction_of(A, u);
      each.of_second = direction_of(B, v);
      right_angles_.push_back(place(each));
    };
    const auto plane = [&](const Vector3d& normal, const Now* moves) {
      Plane each;
      each.at_first = point_of(A, joint.at);
      each.at_second = point_of(B, joint.at);
      each.normal = direction_of(B, normal);
      each.now = moves;
      planes_.push_back(place(each));
    };
    const auto same_attitude = [&] {
      right_angle(x, y);
      right_angle(y, z);
      right_angle(z, x);
    };
    switch (joint.kind) {
      case JointKind::ball:
        coincide();
        break;
      case JointKind::hinge:
        coincide();
        right_angle(z, x);
        right_angle(z, y);
        if (now) {
          Angle each;
          each.of_first = direction_of(A, x);
          each.zero = direction_of(B, x);
          each.ahead = direction_of(B, y);
          each.now = now;
          angles_.push_back(place(each));
        }
        break;
      case JointKind::slider:
        same_attitude();
        plane(x, nullptr);
        plane(y, nullptr);
        if (now) plane(z, now);
        break;
      case JointKind::fixed:
        coincide();
        same_attitude();
        break;
      case JointKind::distance: {
        Distance each;
        each.at_first = point_of(A, joint.at);
        each.at_second = point_of(B, joint.at_second);
        each.length = joint.length ? *joint.length : (joint.at_second - joint.at).norm();
        each.now = now;
        if (!(each.length > 0))
          throw std::invalid_argument("joint \"" + name +
                                      "\": a distance must be > 0; two points in one place are a "
                                      "ball joint");
        distances_.push_back(place(each));
        break;
      }
    }
  }
}

}  // namespace tether::scene::smooth

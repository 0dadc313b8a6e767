// Tether: the rows that the joints of a scene become. SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>
#include <tether/scene/words.hpp>

#include "system.hpp"

namespace tether::scene::smooth {

namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

bool has_axis(JointKind kind) { return kind == JointKind::hinge || kind == JointKind::slider; }

void check(const Joint& joint, const std::string& name) {
  if (joint.motion && (joint.kind == JointKind::ball || joint.kind == JointKind::fixed))
    throw std::invalid_argument("joint \"" + name + "\": a " + std::string(word(joint.kind)) +
                                " joint has no motion to prescribe");
  if (has_axis(joint.kind) && !(joint.axis.norm() > 0))
    throw std::invalid_argument("joint \"" + name + "\": its axis has no length");
}

Vector3d point_in(const Frame<double>& f, const Vector3d& p) { return f.R.transpose() * (p - f.x); }
Vector3d direction_in(const Frame<double>& f, const Vector3d& u) { return f.R.transpose() * u; }

}  // namespace

// Rows of one joint: what holds its bodies together, in the axes x, y, z at t = 0, z along the
// joint.
class System::JointRows {
 public:
  JointRows(System& system, const Joint& joint, const Row& row)
      : system_(system),
        joint_(joint),
        row_(row),
        A_(system.bodies_.frames[at(row.first)]),
        B_(system.bodies_.frames[at(row.second)]),
        z_(joint.axis.norm() > 0 ? Vector3d(joint.axis.normalized()) : Vector3d(Vector3d::UnitZ())),
        x_(z_.unitOrthogonal()),
        y_(z_.cross(x_)) {}

  void add(const Now* now, const std::string& name) {
    switch (joint_.kind) {
      case JointKind::ball:
        coincide();
        break;
      case JointKind::hinge:
        coincide();
        right_angle(z_, x_);
        right_angle(z_, y_);
        if (now) turn(now);
        break;
      case JointKind::slider:
        same_attitude();
        plane(x_, nullptr);
        plane(y_, nullptr);
        if (now) plane(z_, now);
        break;
      case JointKind::fixed:
        coincide();
        same_attitude();
        break;
      case JointKind::distance:
        distance(now, name);
        break;
    }
  }

 private:
  template <class Rows>
  void place(Rows each, std::vector<Rows>& among) {
    static_cast<Row&>(each) = row_;
    each.row = system_.m_;
    system_.m_ += each.count;
    among.push_back(each);
  }
  void coincide() {
    Coincidence each;
    each.at_first = point_in(A_, joint_.at);
    each.at_second = point_in(B_, joint_.at);
    place(each, system_.coincidences_);
  }
  void right_angle(const Vector3d& u, const Vector3d& v) {
    RightAngle each;
    each.of_first = direction_in(A_, u);
    each.of_second = direction_in(B_, v);
    place(each, system_.right_angles_);
  }
  void same_attitude() {
    right_angle(x_, y_);
    right_angle(y_, z_);
    right_angle(z_, x_);
  }
  void turn(const Now* now) {
    Angle each;
    each.of_first = direction_in(A_, x_);
    each.zero = direction_in(B_, x_);
    each.ahead = direction_in(B_, y_);
    each.now = now;
    place(each, system_.angles_);
  }
  void plane(const Vector3d& normal, const Now* now) {
    Plane each;
    each.at_first = point_in(A_, joint_.at);
    each.at_second = point_in(B_, joint_.at);
    each.normal = direction_in(B_, normal);
    each.now = now;
    place(each, system_.planes_);
  }
  void distance(const Now* now, const std::string& name) {
    Distance each;
    each.at_first = point_in(A_, joint_.at);
    each.at_second = point_in(B_, joint_.at_second);
    each.length = joint_.length ? *joint_.length : (joint_.at_second - joint_.at).norm();
    each.now = now;
    if (!(each.length > 0))
      throw std::invalid_argument("joint \"" + name +
                                  "\": a distance must be > 0; two points in one place are a "
                                  "ball joint");
    place(each, system_.distances_);
  }

  System& system_;
  const Joint& joint_;
  const Row& row_;
  const Frame<double>&A_, &B_;
  Vector3d z_, x_, y_;
};

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
    check(joint, name);
    const Now* now = nullptr;
    if (joint.motion) {
      now = &now_[motions_.size()];
      motions_.push_back(*joint.motion);
      has_motion_ = true;
    }
    JointRows(*this, joint, row).add(now, name);
  }
}

}  // namespace tether::scene::smooth

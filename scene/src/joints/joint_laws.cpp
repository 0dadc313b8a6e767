// Tether: laws along the free coordinates of joints. SPDX-License-Identifier: BSD-3-Clause
#include "coordinate.hpp"

#include <tether/linalg/pi.hpp>

#include "effects/list.hpp"
#include "joint_type.hpp"

namespace tether::scene::joints {

Coordinate::Coordinate(const Joint& joint, const Bodies& bodies, int component)
    : what_(component < 0 ? type(joint.kind).motion() : MotionOf::angle),
      component_(component),
      first_(bodies.index(joint.first)),
      second_(bodies.index(joint.second)),
      at_first_(point_in(A(bodies), joint.at)) {
  const Frame<double> B = second_at_closing(joint, this->B(bodies));
  at_second_ = point_in(B, type(joint.kind).point_on_second(joint));
  const Vector3d z = joint.axis.norm() > 0 ? Vector3d(joint.axis.normalized()) : Vector3d::UnitZ();
  const Vector3d x = z.unitOrthogonal(), y = z.cross(x);
  of_first_ = direction_in(A(bodies), x);
  zero_ = direction_in(B, x);
  ahead_ = direction_in(B, y);
  if (joint.kind != JointKind::distance) axis_ = direction_in(B, z);
  start_ = A(bodies).R.transpose() * B.R;
}

Frame<double> second_at_closing(const Joint& joint, const Frame<double>& at_start) {
  if (!joint.closed) return at_start;
  return frame_at(joint.closed->position, joint.closed->orientation.toRotationMatrix());
}

double Coordinate::rest(const Bodies& bodies) const {
  if (what_ == MotionOf::angle)
    return B(bodies).W.cross(direction(bodies)).dot(A(bodies).W - B(bodies).W);
  const auto [d, d1, d2] = between<2>(A(bodies), at_first_, B(bodies), at_second_);
  if (axis_) {
    const Jet<double> u = mechanics::direction<2>(B(bodies), *axis_);
    return d2.dot(u.x) + 2 * d1.dot(u.x1) + d.dot(u.x2);
  }
  const double length = d.norm(), along = d.dot(d1) / length;
  return (d1.squaredNorm() - along * along + d.dot(d2)) / length;
}

namespace {

bool has_laws(const Joint& joint) { return joint.limits || joint.motor || joint.friction != 0; }
bool is_free(const Joint& joint) { return type(joint.kind).is_free() && !joint.motion; }

}  // namespace

std::vector<Coordinate> coordinates_of(const Joint& joint, std::size_t number,
                                       const Bodies& bodies) {
  if (is_free(joint)) return {Coordinate(joint, bodies)};
  if (!type(joint.kind).turns_freely())
    throw std::invalid_argument("joint \"" + name_of(joint, number) +
                                "\": a spring acts on balls, and on hinges and sliders that no "
                                "motion drives");
  std::vector<Coordinate> out;
  for (int k = 0; k < 3; ++k) out.emplace_back(joint, bodies, k);
  return out;
}

JointLaws::JointLaws(const Scene& scene, const Bodies& bodies) {
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const Joint& joint = scene.joints[j];
    if (!has_laws(joint) && !joint.spring) continue;
    const std::string name = "joint \"" + name_of(joint, j) + "\": ";
    if (has_laws(joint) && !is_free(joint))
      throw std::invalid_argument(name +
                                  "limits, a motor and friction act on hinges and sliders that no "
                                  "motion drives");
    for (Coordinate& each : coordinates_of(joint, j, bodies))
      joints_.push_back({static_cast<int>(j), joint, std::move(each)});
    if (joint.limits && (joint.limits->lower > kSameFigure || joint.limits->upper < -kSameFigure))
      throw std::invalid_argument(name + "it is at 0 at t = 0, which must be between its limits");
  }
  for (std::size_t i = 0; i < scene.springs.size(); ++i)
    if (const auto& cable = scene.springs[i].cable)
      for (const Capstan& each : cable->capstans)
        slips_.emplace_back(scene.springs[i], i, each, bodies);
}

// Its components stand one after the other.
void JointLaws::measure_ball(std::size_t component, const Bodies& bodies,
                             mechanics::JointLawList& out) const {
  const int ball = joints_[component].joint;
  while (component > 0 && joints_[component - 1].joint == ball) --component;
  out.turn_squared = out.spin_squared = 0;
  for (; component < joints_.size() && joints_[component].joint == ball; ++component) {
    const Item& item = joints_[component];
    out.turn_squared += std::pow(item.coordinate.value(bodies), 2);
    if (!item.law.spring->damping_table.empty())
      out.spin_squared += std::pow(item.coordinate.rate(bodies), 2);
  }
}

void JointLaws::add(const Bodies& bodies, contact::JointLaws& out) {
  placed_.clear();
  mechanics::JointLawList list{out, bodies.time, nullptr};
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const Item& item = joints_[k];
    const double at_now = value(item, bodies);
    list.on = [&](double sign) { place(static_cast<int>(k), sign, bodies, out); };
    if (item.law.spring && item.coordinate.is_component()) measure_ball(k, bodies, list);
    for (const effects::Effect* each : effects::all())
      each->add_laws(item.law, item.joint, at_now, list);
  }
  grip(bodies, grips_);
  for (std::size_t k = 0; k < slips_.size(); ++k) {
    out.add_bounded(-1, slips_[k].wanted(), grips_[k].bound());
    place(static_cast<int>(joints_.size() + k), 1, bodies, out);
  }
}

bool JointLaws::change_bounds(const std::vector<double>& impulses, double dt,
                              contact::JointLaws& laws) const {
  const int first = count() - static_cast<int>(slips_.size());
  double change = 0, largest = 0;
  const auto force = [&](std::size_t ring) {
    const double x = impulses[at(first) + ring] / dt;
    const double bound = laws[first + static_cast<int>(ring)].bound;
    const bool holds = x == 0 || std::abs(x) < (1 - kSameFigure) * bound;
    return holds ? std::pair(x, 0.0) : std::pair(0.0, x > 0 ? 1.0 : -1.0);
  };
  effects::share_tensions(grips_, 1, force, [&](std::size_t ring, double bound) {
    const int law = first + static_cast<int>(ring);
    bound = std::max(0.0, bound);
    change = std::max(change, std::abs(bound - laws[law].bound));
    largest = std::max(largest, bound);
    laws.set_bound(law, bound);
  });
  return change > kSameFigure * largest;
}

void JointLaws::add_force(int law, const Bodies& bodies, double force, Forces& out) const {
  if (const effects::CapstanSlip* of = slip(law)) {
    out.springs[at(of->cable())].tension += force;
    out.springs[at(of->cable())].tension_second -= force;
    return;
  }
  const double x = sign(law) * force;
  JointForce& on = out.joints[at(joint(law))];
  const bool angle = coordinate(law).what() == MotionOf::angle;
  (angle ? on.moment : on.force) += x * coordinate(law).direction(bodies);
  on.drive += x;
}

}  // namespace tether::scene::joints

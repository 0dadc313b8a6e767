// Tether: moves of a step that are no velocities. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/position_correction.hpp"

#include <algorithm>
#include <tether/linalg/index.hpp>

#include "stepping/motion/rotation.hpp"
#include "stepping/step_settings.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;

namespace {

using linalg::at;

// Moves a body by velocities that are not added to its own.
void shift(BodySet& bodies, int body, double dt, const Vector3d& v, const Vector3d& w) {
  bodies.position[at(body)] += dt * v;
  if (!w.isZero(0))
    turn_with_velocity(dt * w, bodies.orientation[at(body)],
                       bodies.motion[at(body)].angular_velocity);
}

}  // namespace

PositionCorrection::PositionCorrection(const SteppingOptions& options, ConeSources& sources)
    : error_reduction_(options.error_reduction),
      max_speed_(options.max_depenetration_speed),
      islands_(sources.links),
      closing_solver_(closing_options(options), sources, LawUse::closing),
      solver_(correction_options(options), sources, LawUse::limits) {}

// Largest speed at which a contact may close; negative: least speed at which it has to open.
double PositionCorrection::bias(double gap, double dt) const {
  return gap > 0 ? gap / dt : std::max(error_reduction_ * gap / dt, -max_speed_);
}

// Marks islands without restitution in which an impact leaves its gap open. False: there are none.
bool PositionCorrection::find_closing(const Impacts& impacts, const StepContacts& contacts,
                                      const BodySet& bodies) {
  closing_.clear();
  closed_.clear();
  for (const Impact& i : impacts.list())
    if (i.restitution == 0 && contacts.gaps[at(i.contact)] > 0) closing_.push_back(i);
  if (closing_.empty()) return false;
  islands_.join(bodies, contacts);
  closing_body_.assign(bodies.motion.size(), 0);
  const auto mark = [&](int contact) -> char& {
    return closing_body_[at(islands_.root(bodies, contacts.points[at(contact)]))];
  };
  for (const Impact& i : closing_) mark(i.contact) = 1;
  for (const Impact& i : impacts.list())
    if (i.restitution > 0) mark(i.contact) = 0;
  closed_.resize(contacts.points.size());
  for (std::size_t k = 0; k < closed_.size(); ++k) closed_[k] = mark(static_cast<int>(k));
  for (std::size_t i = 0; i < closing_body_.size(); ++i)
    if (bodies.mass[i] > 0)
      closing_body_[i] = closing_body_[at(islands_.root(static_cast<int>(i)))];
  return true;
}

// Impulses start from those of the velocity solve; where a gap is left, from the part of them that
// remains after the gap has taken its share of the approach.
void PositionCorrection::solve_closing(const std::vector<RigidBody>& free, double dt,
                                       const StepContacts& contacts) {
  part_.assign(contacts.points.size(), 1);
  for (const Impact& i : closing_)
    part_[at(i.contact)] = std::max(0.0, 1 - contacts.gaps[at(i.contact)] / (dt * i.comes));
  points_.clear();
  start_.ids.clear();
  start_.impulses.clear();
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    if (closed_[k] == 0) continue;
    points_.push_back(contacts.points[k]);
    points_.back().bias = bias(contacts.gaps[k], dt);
    start_.ids.push_back(points_.back().id);
    start_.impulses.push_back(part_[k] * contacts.impulses[k]);
  }
  closing_solver_.set_warm_start(start_);
  closing_solver_.solve(free, points_, solution_);
}

void PositionCorrection::close_gaps(const Impacts& impacts, const std::vector<RigidBody>& free,
                                    double dt, const StepContacts& contacts,
                                    const std::vector<int>& moving, BodySet& bodies) {
  if (!find_closing(impacts, contacts, bodies)) return;
  solve_closing(free, dt, contacts);
  for (const int i : moving)
    if (closing_body_[at(i)] != 0)
      shift(bodies, i, dt, solution_.velocities[at(i)] - bodies.motion[at(i)].velocity,
            solution_.angular_velocities[at(i)] - bodies.motion[at(i)].angular_velocity);
}

void PositionCorrection::take_back(double deepest, double negligible, double dt,
                                   const StepContacts& contacts, const std::vector<int>& moving,
                                   BodySet& bodies) {
  if (!(deepest > negligible)) return;
  points_.clear();
  bool corrects = false;
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    if (!closed_.empty() && closed_[k] != 0) continue;
    points_.push_back(contacts.points[k]);
    points_.back().bias = bias(contacts.gaps[k], dt);
    corrects = corrects || contacts.gaps[k] < 0;
  }
  if (!corrects) return;
  at_rest_ = bodies.motion;
  for (RigidBody& b : at_rest_) b.set_velocities(Vector6d::Zero());
  solver_.solve(at_rest_, points_, solution_);
  for (const int i : moving)
    shift(bodies, i, dt, solution_.velocities[at(i)], solution_.angular_velocities[at(i)]);
}

}  // namespace tether::contact::detail

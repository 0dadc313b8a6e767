// Tether: impacts that a step is cut at. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/impacts/step_cuts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tether/linalg/index.hpp>

#include "stepping/impacts/restitution.hpp"
#include "stepping/sub_step.hpp"

namespace tether::contact::detail {

namespace {

using linalg::at;

constexpr double kTouches = 1e-10;  // of the size, of the time: a gap that rounding makes of none

double speed(const RigidBody& b, const Eigen::Vector3d& r) {
  return b.velocity.norm() + b.angular_velocity.norm() * r.norm();
}

bool has(const std::vector<std::uint64_t>& sorted, std::uint64_t id) {
  return std::binary_search(sorted.begin(), sorted.end(), id);
}

}  // namespace

double closing_time(double gap, double came, double more) {
  if (came < 0) return (std::sqrt(came * came + 4 * more * std::max(gap, 0.0)) - came) / (2 * more);
  if (!(gap > 0)) return 0;
  return 2 * gap / (came + std::sqrt(std::max(0.0, came * came + 4 * more * gap)));
}

StepCuts::StepCuts(const BodyOptions& options, ConeSources& sources)
    : islands_(sources.links), solver_(cold(options), sources, LawUse::none) {}

void StepCuts::remember(const WarmStart& solved) {
  pressing_.clear();
  for (std::size_t k = 0; k < solved.ids.size(); ++k)
    if (!solved.impulses[k].isZero(0)) pressing_.push_back(solved.ids[k]);
  std::sort(pressing_.begin(), pressing_.end());
}

void StepCuts::find_islands(const NearContacts& near, const BodySet& bodies,
                            const StepContacts& contacts) {
  islands_.join(bodies, contacts);
  whole_.assign(bodies.motion.size(), 0);
  if (left_whole_ != nullptr) islands_.mark(*left_whole_, whole_);
  size_.assign(bodies.motion.size(), 0);
  const bool rolling = near.any_rolling();
  for (const PointContact& c : contacts.points) {
    const std::size_t root = at(islands_.root(bodies, c));
    ++size_[root];
    if (rolling && near.meeting(c).rolls()) whole_[root] = 1;
  }
}

bool StepCuts::choose(const std::vector<Approach>& impacts, double dt, const NearContacts& near,
                      const BodySet& bodies, const StepContacts& contacts) {
  striking_.clear();
  if (impacts.empty()) return false;
  const bool many = contacts.points.size() > kMostContacts;
  find_islands(near, bodies, contacts);
  time_.clear();
  time_.reserve(impacts.capacity());
  striking_.reserve(impacts.capacity());
  for (const Approach& i : impacts) {
    const PointContact& c = contacts.points[at(i.contact)];
    const double speeds =
        speed(bodies.motion[at(c.first)], c.r1) + speed(bodies.motion[at(c.second)], c.r2);
    const double gap = contacts.gaps[at(i.contact)], then = i.speed(gap, dt);
    const std::size_t root = at(islands_.root(bodies, c));
    // An approach is none below parts of what forces add to it, and of the speeds of both points,
    // which decide where the least speed of an impact is 0.
    const bool cuts = then > 1e-3 * (i.comes - i.came) && then > 1e-6 * speeds &&
                      whole_[root] == 0 && (!many || size_[root] <= kMostContacts);
    time_.push_back(cuts ? i.time(gap, dt) : std::numeric_limits<double>::infinity());
  }
  when_ = std::numeric_limits<double>::infinity();
  for (const double t : time_) when_ = std::min(when_, t);
  if (!std::isfinite(when_)) return false;
  if (when_ < kTouches * dt) when_ = 0;
  when_ = when_ > (1 - kTouches) * dt ? dt : when_;
  // Those soon after the first strike with it: the corners of an edge that rounding has turned
  // would else be struck one by one, and turn it.
  const double last = when_ < dt ? when_ + 1e-3 * dt : std::numeric_limits<double>::max();
  for (std::size_t k = 0; k < time_.size(); ++k)
    if (time_[k] <= last) striking_.push_back(contacts.points[at(impacts[k].contact)].id);
  std::sort(striking_.begin(), striking_.end());
  if (many) kept_ -= kPrice;
  return true;
}

// Forces and joints may act from body to body: what they act upon is one island.
bool StepCuts::find_striking(const BodySet& bodies, const StepContacts& contacts,
                             const std::vector<int>& moving, const std::vector<char>& falls,
                             const SubStep& now, std::vector<char>& striking) {
  islands_.join(bodies, contacts);
  marked_.assign(bodies.motion.size(), 0);
  const auto mark = [&](int body) -> char& { return marked_[at(islands_.root(body))]; };
  for (const PointContact& c : contacts.points)
    if (strikes(c)) marked_[at(islands_.root(bodies, c))] = 1;
  const bool bound = std::any_of(moving.begin(), moving.end(),
                                 [&](int i) { return falls[at(i)] == 0 && mark(i) != 0; });
  for (const int i : moving)
    if (bound && falls[at(i)] == 0) mark(i) = 1;
  bool others = false;
  striking.assign(bodies.motion.size(), 0);
  for (const int i : moving) {
    if (!now.has(i)) continue;
    striking[at(i)] = mark(i);
    others = others || mark(i) == 0;
  }
  return others;
}

bool StepCuts::strikes(const PointContact& c) const { return has(striking_, c.id); }

double StepCuts::left(NearContacts& near, const BodySet& bodies, double dt) {
  near.find(bodies, dt, found_);
  double first = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < found_.points.size(); ++k) {
    const PointContact& c = found_.points[k];
    const double comes = strikes(c) ? -normal_velocity(bodies.motion, c) : 0, gap = found_.gaps[k];
    if (comes > 0)
      first = std::min(first, std::abs(gap) > kTouches * near.size(c) ? gap / comes : 0);
  }
  return std::isfinite(first) ? first : 0;
}

bool StepCuts::gather(const NearContacts& near, const BodySet& bodies, double step,
                      Impacts& impacts, StepContacts& contacts) {
  find_islands(near, bodies, contacts);
  keep_contacts(contacts, [&](std::size_t k) {
    PointContact& c = contacts.points[k];
    c.bias = 0;
    const double touches = std::max(step * impacts.least_speed(near, c), kTouches * near.size(c));
    return whole_[at(islands_.root(bodies, c))] == 0 &&
           (contacts.gaps[k] <= touches || has(pressing_, c.id) || has(striking_, c.id));
  });
  impacts.remember(bodies);
  impacts.choose(near, bodies, step, contacts);
  return !impacts.list().empty();
}

}  // namespace tether::contact::detail

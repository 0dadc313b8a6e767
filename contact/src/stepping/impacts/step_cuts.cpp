// Tether: impacts that a step is cut at. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/impacts/step_cuts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tether/linalg/index.hpp>

#include "stepping/impacts/restitution.hpp"

namespace tether::contact::detail {

namespace {

using linalg::at;

constexpr double kSameTime = 1e-10;  // of a part

bool has(const std::vector<std::uint64_t>& sorted, std::uint64_t id) {
  return std::binary_search(sorted.begin(), sorted.end(), id);
}

}  // namespace

double closing_time(double gap, double came, double more) {
  if (!(gap > 0)) return 0;
  return 2 * gap / (came + std::sqrt(std::max(0.0, came * came + 4 * more * gap)));
}

StepCuts::StepCuts(const BodyOptions& options) : solver_(cold(options)) {}

void StepCuts::remember(const WarmStart& solved) {
  pressing_.clear();
  for (std::size_t k = 0; k < solved.ids.size(); ++k)
    if (!solved.impulses[k].isZero(0)) pressing_.push_back(solved.ids[k]);
  std::sort(pressing_.begin(), pressing_.end());
}

bool StepCuts::choose(const Impacts& impacts, double dt, const StepContacts& contacts,
                      const std::vector<double>& falls) {
  striking_.clear();
  if (contacts.points.size() > kMostContacts) return false;
  time_.clear();
  for (std::size_t k = 0; k < impacts.list().size(); ++k) {
    const Impact& i = impacts.list()[k];
    // One that the forces of the step make is none of speeds: it is as well taken at its start.
    const double more = (i.comes - i.came) / dt - 0.5 * falls[k];
    time_.push_back(i.comes < 2 * i.came ? closing_time(contacts.gaps[at(i.contact)], i.came, more)
                                         : std::numeric_limits<double>::infinity());
  }
  when_ = std::numeric_limits<double>::infinity();
  for (const double t : time_) when_ = std::min(when_, t);
  if (!std::isfinite(when_)) return false;
  if (when_ < kSameTime * dt) when_ = 0;
  when_ = when_ > (1 - kSameTime) * dt ? dt : when_;
  const double last = when_ < dt ? when_ + kSameTime * dt : std::numeric_limits<double>::max();
  for (std::size_t k = 0; k < time_.size(); ++k)
    if (time_[k] <= last) striking_.push_back(contacts.points[at(impacts.list()[k].contact)].id);
  std::sort(striking_.begin(), striking_.end());
  return true;
}

void StepCuts::add(const StepContacts& contacts) {
  for (std::size_t k = 0; k < contacts.impulses.size(); ++k) {
    if (contacts.impulses[k].isZero(0)) continue;
    std::size_t j = 0;
    while (j < sum_.points.size() && sum_.points[j].id != contacts.points[k].id) ++j;
    if (j == sum_.points.size()) {
      sum_.points.push_back(contacts.points[k]);
      sum_.gaps.push_back(contacts.gaps[k]);
      sum_.impulses.push_back(contacts.impulses[k]);
    } else {
      sum_.impulses[j] += contacts.impulses[k];
    }
  }
}

void StepCuts::add_sum_to(StepContacts& contacts) const {
  for (std::size_t j = 0; j < sum_.points.size(); ++j) {
    std::size_t k = 0;
    while (k < contacts.points.size() && contacts.points[k].id != sum_.points[j].id) ++k;
    if (k < contacts.points.size()) {
      contacts.impulses[k] += sum_.impulses[j];
      continue;
    }
    contacts.points.push_back(sum_.points[j]);
    contacts.gaps.push_back(sum_.gaps[j]);
    contacts.impulses.push_back(sum_.impulses[j]);
  }
}

bool StepCuts::strikes(const PointContact& c) const { return has(striking_, c.id); }

bool StepCuts::gather(const NearContacts& near, const BodySet& bodies, double step,
                      Impacts& impacts, StepContacts& contacts) const {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < contacts.points.size(); ++k) {
    PointContact c = contacts.points[k];
    if (contacts.gaps[k] > step * impacts.least_speed(near, c) && !has(pressing_, c.id) &&
        !has(striking_, c.id))
      continue;
    c.bias = 0;
    contacts.points[kept] = c;
    contacts.gaps[kept++] = contacts.gaps[k];
  }
  contacts.points.resize(kept);
  contacts.gaps.resize(kept);
  impacts.remember(bodies);
  impacts.choose(near, bodies, step, contacts);
  return !impacts.list().empty();
}

}  // namespace tether::contact::detail

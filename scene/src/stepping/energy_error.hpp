// Tether: what steps leave of the energy. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/stepping.hpp>
#include <utility>
#include <vector>

namespace tether::scene::stepping {

/// Sums what those steps change of the energy in which nothing strikes or slips, where nothing but
/// weight and what holds bodies acts on them. It is an error: contacts that hold do no work.
class EnergyError {
 public:
  /// dt: length of a step, s. `joined`: by body, whether joints hold it.
  EnergyError(const Eigen::Vector3d& gravity, double dt, std::vector<char> joined,
              const contact::BodySet& bodies)
      : gravity_(gravity), dt_(dt), joined_(std::move(joined)) {
    begin_at(bodies);
  }

  /// Goes on from other states.
  void begin_at(const contact::BodySet& bodies);
  /// After each step.
  void add(const contact::BodySet& bodies, const contact::StepContacts& contacts);
  /// J.
  double sum() const { return sum_; }

 private:
  double before(std::uint64_t id);
  bool note(const contact::StepContacts& contacts);
  double energy(const contact::BodySet& bodies) const;
  double power(const contact::BodySet& bodies) const;

  Eigen::Vector3d gravity_;
  double dt_;
  std::vector<char> joined_;
  double energy_ = 0, power_ = 0, sum_ = 0;                   // after the last step
  std::vector<std::pair<std::uint64_t, double>> last_, now_;  // contacts and normal impulses
  std::size_t next_ = 0;                                      // of `last_`: where before() begins
};

}  // namespace tether::scene::stepping

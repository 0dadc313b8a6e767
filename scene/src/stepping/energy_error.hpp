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
  /// `joined`: by body, whether joints hold it. dt: length of a step, s.
  EnergyError(const Eigen::Vector3d& gravity, double dt, std::vector<char> joined,
              const contact::BodySet& bodies);

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

  Eigen::Vector3d gravity_;
  double dt_;
  std::vector<char> joined_, held_;  // by body; held_: by contacts, too
  double energy_, sum_ = 0;
  std::vector<std::pair<std::uint64_t, double>> last_, now_;  // contacts and normal impulses
  std::size_t next_ = 0;                                      // of `last_`: where before() begins
};

}  // namespace tether::scene::stepping

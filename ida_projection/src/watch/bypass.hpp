// Tether: another nonlinear solver in the plugin's place is noticed.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

#include "host/ida.hpp"
#include "host/ida_lifetime.hpp"
#include "watch/report.hpp"

namespace tether::ida_projection {

/// Compares IDA's count of steps with the attempts that the plugin has seen.
class BypassWatch {
 public:
  explicit BypassWatch(const Ida& ida) : ida_(ida) {}

  /// At attachment; `at_end` is called once more before IDA is freed.
  void begin(std::function<void()> at_end);
  /// `last_steps`: accepted before the last attempt; none seen: -1. Status and text once a step
  /// went by; said once.
  void look(long last_steps, bool initialized, Report& report);
  long steps() const { return steps_unseen_; }

 private:
  long steps_without_plugin(long last_steps, bool initialized) const;

  const Ida& ida_;
  IdaLifetime lifetime_;
  bool watching_ = false;
  long steps_at_attach_ = 0, steps_unseen_ = 0;
  bool said_ = false;
};

}  // namespace tether::ida_projection

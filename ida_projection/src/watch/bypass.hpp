// Tether: another nonlinear solver in the plugin's place is noticed.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "host/ida.hpp"
#include "host/ida_lifetime.hpp"
#include "watch/report.hpp"

namespace tether::ida_projection {

/// Compares IDA's count of steps with the attempts that the plugin has seen.
class BypassWatch {
 public:
  BypassWatch(const Ida& ida, const IdaLifetime& lifetime) : ida_(ida), lifetime_(lifetime) {}

  void begin();  ///< at attachment
  /// `last_steps`: accepted before the last attempt; none seen: -1. Said once.
  void check(long last_steps, bool initialized, const Report& report);
  long steps() const { return steps_unseen_; }
  /// Advice, once a step went by; it then stays as it is.
  const std::string& text() const { return text_; }

 private:
  long steps_without_plugin(long last_steps, bool initialized) const;

  const Ida& ida_;
  const IdaLifetime& lifetime_;
  bool watching_ = false;
  long steps_at_attach_ = 0, steps_unseen_ = 0;
  std::string text_;
};

}  // namespace tether::ida_projection

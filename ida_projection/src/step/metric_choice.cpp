// Tether: which metric moves are made in. SPDX-License-Identifier: BSD-3-Clause
#include "step/metric_choice.hpp"

namespace tether::ida_projection {

namespace {

constexpr int kPause = 8;
constexpr double kPart = 0.1;    // of a move: a smaller response needs no stiff components
constexpr double kHarm = 1e-4;   // tolerances: a shorter response does no harm
constexpr double kBetter = 0.5;  // of move and response: the other metric is taken below it

}  // namespace

bool MetricChoice::due() {
  if (pause_ > 0) --pause_;
  return pause_ == 0;
}

bool MetricChoice::stiff(const MoveAndResponse& at) const {
  return at.response > kPart * at.move && at.response > kHarm;
}

bool MetricChoice::doubts(const MoveAndResponse& at) {
  if (stiff(at)) return may_try();
  pause();
  calm_ = true;
  return false;
}

void MetricChoice::pause() {
  calm_ = false;
  pause_ = kPause;
}

bool MetricChoice::prefers(const MoveAndResponse& other, const MoveAndResponse& present) {
  if (other.move + other.response <= kBetter * (present.move + present.response)) {
    by_levels_ = !by_levels_;
    return true;
  }
  found_none();
  return false;
}

void MetricChoice::found_none() {
  wait_ = next_wait_;
  next_wait_ *= 2;
}

}  // namespace tether::ida_projection

// Tether: interior points with a shift that bounds their steps. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "assembled/stages/interior/interior_point.hpp"

namespace tether::contact::detail {
namespace {

// Added to A, relative to it: as much as keeps steps from being blocked. A step that is blocked at
// once moves u, whose slips the equations hold, far along a direction that leaves A x as it is; it
// is not taken.
class StepShift {
 public:
  double value() const { return value_; }
  // After a direction that may be followed for so long; false: it is not to be taken.
  bool admits(double longest) {
    if (longest < kShort) value_ = std::min(kMost, std::max(kFirst, kMore * value_));
    if (longest > kLong) value_ = std::max(kLeast, kLess * value_);
    refused_ = longest < kBlocked && refused_ < kRefusals ? refused_ + 1 : 0;
    return refused_ == 0;
  }

 private:
  static constexpr double kLeast = 1e-13, kFirst = 1e-8, kMost = 1, kMore = 10, kLess = 0.3;
  static constexpr double kShort = 0.3, kLong = 0.9, kBlocked = 0.1;
  static constexpr int kRefusals = 4;

  double value_ = kLeast;
  int refused_ = 0;
};

}  // namespace

// A step with the shift tau is one of the proximal problem around the point where it starts, but of
// a matrix for each step, not of a path for each problem (README, section 9).
void InteriorPoint::run_shifted(Search& search, const PackedVector* x, int most) {
  constexpr int kPatience = 100;
  constexpr double kNear = 1, kGain = 0.97, kReduction = 0.5;
  const System& system = search.system;
  equations_.set_tau(0);
  if (!start_near(search, x, kNear)) return;
  const double speed = system.norm_b() / std::sqrt(n_);
  StepShift shift;
  double last = 1, reference = search.best_error;
  for (int step = 0, gain = 0; step < most && step - gain < kPatience; ++step) {
    newton_.set_shift(shift.value());
    const double mean = equations_.complementarity(point_);
    if (!newton_.factor(search, equations_, point_)) return;
    // What a shift leaves of the residual becomes x.u later: these must not fall faster.
    last = aim(system, mean, last, std::min(kReduction * mean, equations_.left_over(point_)));
    if (!(last > 0)) return;
    if (!shift.admits(last)) {
      if (search.exhausted()) return;
      continue;
    }
    const double fraction = last > 1     ? std::max(0.9, 1 - mean / (speed * speed))
                            : last > 0.9 ? 0.9
                                         : 0.8;
    advance(point_, newton_.change(), std::min(1.0, fraction * last));
    equations_.set_exact(search.near_round_off());
    equations_.evaluate(system, point_);
    test_point(search);
    if (search.solved() || search.exhausted()) return;
    if (search.best_error < kGain * reference) {
      reference = search.best_error;
      gain = step;
    }
  }
}

}  // namespace tether::contact::detail

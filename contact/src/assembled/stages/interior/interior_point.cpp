// Tether: interior points for the exact cones. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/stages/interior/interior_point.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::contact::detail {
namespace {

constexpr double kLeastCentre = 1e-3, kCentreAfterBlocked = 0.2;

}  // namespace

void InteriorPoint::reset(int contacts) {
  n_ = contacts;
  equations_.reset(contacts);
  newton_.reset(contacts);
  sticking_.reset(contacts);
  point_.resize(contacts);
  swept_.resize(at(n_));
}

// Predictor and corrector (Mehrotra) at the point whose matrix is factored; last: the length that
// the step before could have had. The one that this step can have.
double InteriorPoint::aim(const System& system, double mean, double last) {
  newton_.direction(system, equations_, 0, false);
  const double affine = std::min(1.0, newton_.longest_step(equations_));
  newton_.keep_predictor();
  // A blocked step leaves products x.u of different size behind.
  const double centre = last < 0.5 ? kCentreAfterBlocked : kLeastCentre;
  const double nu = std::max(centre, std::pow(1 - affine, 3)) * mean;
  newton_.direction(system, equations_, nu, true);
  return newton_.longest_step(equations_);
}

// The impulses of the last evaluation, and what a sweep makes of them.
double InteriorPoint::test_point(Search& search) {
  const double error = search.test(equations_.impulses().data(), Method::interior_point);
  swept_ = equations_.impulses();
  search.system.sweep(swept_.data());
  search.count_sweep();
  return std::min(error, search.test(swept_.data(), Method::interior_point));
}

double InteriorPoint::follow(Search& search, int most, double target) {
  System& system = search.system;
  const double speed = system.norm_b() / std::sqrt(n_);
  double least = std::numeric_limits<double>::infinity(), least_mean = least, last = 1;
  int idle = 0;
  newton_.reset_shift();
  for (int iteration = 0; iteration < most; ++iteration) {
    const double mean = equations_.complementarity(point_);
    if (!newton_.factor(search, equations_, point_)) break;
    const double longest = last = aim(system, mean, last);
    if (!(longest > 1e-8)) break;
    newton_.adapt_shift(longest);
    // Close to the cone only with nearly full steps: blocked ones would spoil the centring.
    const double fraction = longest > 0.9 ? std::max(0.9, 1 - mean / (speed * speed)) : 0.8;
    advance(point_, newton_.change(), std::min(1.0, fraction * longest));
    equations_.set_exact(search.near_round_off());
    equations_.evaluate(system, point_);
    double error;
    if (equations_.tau() > 0) {
      error = equations_.natural_map(system);
      if (error <= target) return error;
    } else {
      error = test_point(search);
      if (search.solved()) return error;
    }
    if (search.exhausted()) return error;
    if (error < 0.9 * least || mean < 0.8 * least_mean) {
      least = std::min(least, error);
      least_mean = std::min(least_mean, mean);
      idle = 0;
    } else if (++idle >= 6) {
      break;
    }
  }
  return least;
}

void InteriorPoint::run(Search& search, int most) {
  equations_.set_tau(0);
  if (start(search)) follow(search, most, 0);
}

void InteriorPoint::run_near(Search& search, const PackedVector* x, int most) {
  equations_.set_tau(0);
  if (start_near(search, x, 1e-3)) follow(search, most, 0);
}

}  // namespace tether::contact::detail

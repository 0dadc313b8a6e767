// Tether: impacts that accumulate (method, eq. 10). SPDX-License-Identifier: BSD-3-Clause
//
// Impacts k of one contact at times t_k with approach speeds w_k: where the ratios r of intervals
// and of speeds agree and stay below 1, the last of them is over at
//
//   t_k + (t_k - t_k-1) r / (1 - r).
//
// From an impact on whose bounces nobody can see, it is completed without restitution: what the
// normal impulses of all later ones amount to is what the closed contact carries until then.
#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>
#include <tether/linalg/least_squares.hpp>

#include "driver.hpp"

namespace tether::scene::event {

namespace {

constexpr double kAgree = 0.05;         // of ratios
constexpr double kUnresolved = 1e-5;    // m/s in the units of the model: heights near round-off
constexpr double kLeastHeight = 5e-12;  // of a flight, of the largest coordinate: the same

using linalg::at;

}  // namespace

void Driver::remember(int contact, double approach) {
  Bounces& b = bounces_[at(contact)];
  if (b.count > 0 && b.time[0] == event_time_) return;
  for (int k = 2; k > 0; --k) {
    b.time[k] = b.time[k - 1];
    b.speed[k] = b.speed[k - 1];
  }
  b.time[0] = event_time_;
  b.speed[0] = approach;
  b.count = std::min(b.count + 1, 3);
}

bool Driver::has_accumulated(int contact, double approach, double& rest) const {
  const Bounces& b = bounces_[at(contact)];
  if (b.count < 3) return false;
  const double dt = event_time_ - b.time[0], last = b.time[0] - b.time[1];
  // Numbers of thousands, as of scenes in millimetres, lose heights at higher speeds.
  const double largest = y_.head(motion_.coordinates()).cwiseAbs().maxCoeff();
  const bool unseen = approach * dt / 4 <= kLeastHeight * largest;
  if (approach * approach > b.speed[0] * std::max(options_.tolerance, kUnresolved) && !unseen)
    return false;
  const double r = approach / b.speed[0], previous = b.speed[0] / b.speed[1];
  if (!(r < 1 && std::abs(r - previous) < kAgree * (1 - previous) && dt > 0 &&
        std::abs(dt / last - r) < kAgree))
    return false;
  rest = dt * r / (1 - r);
  return true;
}

// The contacts that touch and move apart no faster than `speed` stay together, and those that slip
// no faster stick: impulses in both directions. Returns the energy that is lost.
double Driver::come_to_rest(const std::vector<int>& touching, double speed) {
  ContactRows rows(model_, touching);
  const int block = rows.size();
  const VectorXd w = rows.velocities(y_.segment(motion_.coordinates(), motion_.velocities()));
  std::vector<int> slow;
  for (int k = 0; k < static_cast<int>(touching.size()); ++k) {
    if (model_.law(touching[at(k)]).is_moment() || std::abs(w[block * k]) > speed) continue;
    slow.push_back(block * k);
    if (!(model_.law(touching[at(k)]).friction > 0)) continue;
    for (int j = 1; j < block; ++j)
      if (std::abs(w[block * k + j]) <= speed) slow.push_back(block * k + j);
  }
  const int n = static_cast<int>(slow.size());
  if (n == 0) return 0;
  const SomeRows part(rows.A(), -w, slow);
  linalg::LeastSquares factor;
  factor.factor(part.A);
  const VectorXd forces = factor.solve(part.b);
  VectorXd x = VectorXd::Zero(w.size());
  for (int i = 0; i < n; ++i) x[slow[at(i)]] = forces[i];
  return change_velocities(rows.change(x));
}

}  // namespace tether::scene::event

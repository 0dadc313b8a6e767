// Tether: how the phases between events begin. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>

#include "driver.hpp"
#include "local_tolerance.hpp"
#include "sundials/ida_session.hpp"

namespace tether::scene::event {

namespace {

// The first steps of a bounce are of order 1: some ten times (h / T)^2 is their error in its length
// T. A way of less than kLeastWay (m in the units of the model) is lost in rounding.
constexpr double kFlightError = 0.003, kLeastWay = 1e-15;
constexpr double kAtGaps = 0.01;  // of their bands: gaps that are no rounding

using linalg::at;

/// Until a gap that falls with the acceleration `back` is zero, s; 0: never.
double flight_time(double gap, double rate, double back) {
  const double square = rate * rate + 2 * back * gap;
  if (square < 0) return 0;
  const double root = std::sqrt(square);
  return rate > 0 ? (back > 0 ? (rate + root) / back : 0) : 2 * gap / (root - rate);
}

}  // namespace

void Driver::begin_phase() {
  settle_velocities();
  motion_.keep_energy_of(event_time_, y_);
  const VectorXd before = y_;
  if (!move_onto_constraints(motion_, local_, event_time_, y_)) {
    y_ = before;
    model_.set(event_time_, y_.data(), y_.data() + motion_.coordinates());
    fail(contradiction());
  }
  start_phase();
}

std::string Driver::contradiction() const {
  double gap = 0, band = 0, rate = 0;
  for (const int i : motion_.closed()) {
    gap = std::max(gap, std::abs(model_.gap(i, rate)));
    band = std::max(band, bands().gap(i));
  }
  const double unit = model_.length_unit();
  std::string text = "the state cannot be moved onto joints and closed contacts";
  // Both sides of a clearance, say.
  if (gap > kAtGaps * band)
    text += fmt::format(
        ": at this tolerance gaps of up to {:.3g} m count as closed, and of the {} contacts that "
        "do so "
        "one has {:.3g} m. A smaller tolerance tells them apart",
        unit * band, motion_.closed().size(), unit * gap);
  return text;
}

// Removes the normal velocities, less than their bands, that contacts have when they close.
void Driver::settle_velocities() {
  const double energy = model_.energy();
  motion_.settle_velocities(event_time_, y_);
  const double lost = energy - model_.energy();
  if (!events_.empty() && events_.back().time == event_time_) events_.back().lost += lost;
}

// Everything from (event_time_, y_), the modes and the energy that is kept: whoever has these goes
// on with the same bits.
void Driver::start_phase(double most) {
  modes_ = motion_.modes();
  rows_are_weak_ = false;
  model_.begin_anew(event_time_);
  motion_.choose(event_time_, y_, modes_);
  model_.set(event_time_, y_.data(), y_.data() + motion_.coordinates());
  std::vector<bool> leaving(at(model_.contacts()), false);
  double local = std::min(local_, most);
  for (int i = 0; i < model_.contacts(); ++i) {
    if (model_.is_apart(i, bands().gap(i))) continue;
    double rate = 0;
    const double gap = model_.gap(i, rate);
    leaving[at(i)] = motion_.modes()[at(i)].mode == Mode::open && std::abs(gap) <= bands().gap(i) &&
                     rate > bands().approach(i);
    if (leaving[at(i)]) local = std::min(local, flight_tolerance(options_.tolerance, rate));
  }
  local = std::min(local, turn_tolerance(options_.tolerance, slowest_turn()));
  if (phase_) add_work(counts_, phase_->counts());
  phase_.reset();
  const double first = longest_first_step(leaving);
  kink_ = model_.next_kink(event_time_);
  phase_ = std::make_unique<Phase>(motion_, local, options_.max_step, event_time_, y_, first,
                                   kink_ - event_time_);
  watcher_.begin(event_time_, y_, leaving);
  next_.reset();
}

// The least acceleration of a slip that begins at rest. What is left of a swing with friction may
// be small, and an error of its slip is one of the time at which it ends, over that acceleration.
double Driver::slowest_turn() {
  double least = 1;
  VectorXd rate;
  for (std::size_t k = 0; k < motion_.closed().size(); ++k) {
    const int i = motion_.closed()[k], at_once = static_cast<int>(k);
    if (motion_.modes()[at(i)].mode != Mode::slide || model_.law(i).friction == 0) continue;
    if (rate.size() == 0) {
      rate.resize(motion_.size());
      motion_.rate(event_time_, y_.data(), rate.data());
    }
    if (motion_.slip(at_once).norm() > bands().slip(i)) continue;
    const double turns = motion_.slip_rate(at_once).norm();
    if (turns > 0) least = std::min(least, turns);
  }
  return least;
}

// A flight that is shorter than the tolerance's first step must be resolved all the same: bounces,
// and the ways of contacts that are about to close.
double Driver::longest_first_step(const std::vector<bool>& leaving) {
  VectorXd rate(motion_.size());
  motion_.rate(event_time_, y_.data(), rate.data());
  const VectorXd a = motion_.acceleration();
  const double part = std::min(1e-3, std::sqrt(kFlightError * options_.tolerance));
  double longest = 0;
  ContactLook look;
  for (int i = 0; i < model_.contacts(); ++i) {
    if (motion_.modes()[at(i)].mode != Mode::open) continue;
    if (model_.is_apart(i, bands().gap(i))) continue;
    double speed = 0;
    const double gap = leaving[at(i)] ? 0 : model_.gap(i, speed);
    if (leaving[at(i)]) model_.gap(i, speed);
    const bool closing = gap > 0 && gap <= bands().gap(i) && speed < -bands().approach(i);
    if (!leaving[at(i)] && !closing) continue;
    model_.look(i, look);
    const double flight = flight_time(gap, speed, -(look.normal.dot(a) + look.normal_rest));
    if (!(flight > 0)) continue;
    const double first = std::max(part * flight, kLeastWay / std::abs(speed));
    longest = longest > 0 ? std::min(longest, first) : first;
  }
  return longest;
}

}  // namespace tether::scene::event

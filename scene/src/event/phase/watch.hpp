// Tether: the functions of the state whose zeros are events (method, section 4).
// SPDX-License-Identifier: BSD-3-Clause
//
//   open     gap
//   closed   normal force; mu times it less |friction| where it sticks; slip along its direction
//            where it slides; its distance from the border of its face
//   support  closed contacts that share their forces in more than one way: single forces mean
//            nothing there; what counts is whether Coulomb's law has any that leave them at rest
//
// Event functions that start at zero are ignored until they have left their band (method, section
// 4); falling below minus the band is an event, too. A gap that starts negative within its band
// counts from that value: other contacts pressed it in.
#pragma once

#include "motion.hpp"
#include "phase.hpp"

namespace tether::scene::event {

enum class Watch : unsigned char { gap, normal_force, cone, slip, border, support };

/// Gaps when their phase begins: beyond their band; within it, as between two bounces; and those of
/// bodies that move apart though their gap is zero.
enum class Start : unsigned char { apart, near, leaving };

/// The first zero in a step.
struct Zero {
  Watch what = Watch::gap;
  int contact = -1;
  double time = 0;  ///< since the start of the phase
  VectorXd y;       ///< there, on the constraints
  Start start = Start::apart;
  double lag = 0;  ///< how much earlier the function was zero that is told by its band only, s
};

class Watcher {
 public:
  explicit Watcher(Motion& motion) : motion_(motion) {}

  /// A phase begins at (t, y). `leaving`: contacts that are Start::leaving.
  void begin(double t, const VectorXd& y, const std::vector<bool>& leaving);
  /// Returns the first event in the last step of the phase, if there is one.
  std::optional<Zero> first_zero(Phase& phase);
  /// Returns the tolerance at which a phase would decide whether gaps that turned in the last step,
  /// before its event, were zero there; infinite if the present phase decides it.
  double deciding_tolerance() const { return undecided_.tolerance; }

 private:
  struct Function {
    Watch what;
    int contact, closed;  // closed: place among the closed contacts
    Start start;
    /// far: a gap of bodies that are far apart, not evaluated; beside: a gap that is negative
    /// beside its feature, no contact; waiting: to leave its band.
    enum class State { far, beside, waiting, armed } state = State::waiting;
    double value = 0, before = 0;
    double slope = 0, slope_before = 0;    // of a gap, m/s, or of a slip, m/s^2
    double level = 0;                      // from which a gap or a border counts, m
    double passes = 0, passes_before = 0;  // of a gap, see Model::passes

    bool is(State other) const { return state == other; }
  };
  using State = Function::State;
  void arm(Function& f);
  void wake(Phase& phase, const VectorXd& at_end, double by);
  void evaluate(double t, const VectorXd& y, double by);
  double way(Phase& phase, const VectorXd& at_end);
  double value(Function& f, double t, const VectorXd& y) {
    if (f.what == Watch::gap)
      motion_.model().set(t, y.data());
    else
      motion_.rate(t, y.data(), rate_.data());
    return of_state(f);
  }
  double of_state(Function& f);
  double support();
  double band(const Function& f) const;
  double lag(Phase& phase, Function f, double time);
  // Whether a function has a zero within the interval that is searched.
  bool is_hit(Phase& phase, const Function& f) {
    bool hit = f.value < (f.is(State::armed) ? 0 : -band(f));
    // Else it is on its way out; its first gaps are lost in rounding.
    const bool from_zero =
        !f.is(State::armed) || (f.start == Start::leaving && f.value > -bands().gap(f.contact));
    if (f.what == Watch::gap && from_zero) hit = hit && f.slope < 0;
    if (hit || !may_dip(f)) return hit;
    return dips(phase, f);
  }
  bool is_hit_between(Phase& phase, Function& f);
  Zero locate(Phase& phase, Function f);
  // Whether a gap or slip that is positive at both ends of a step, and falls, then rises, can reach
  // zero.
  bool may_dip(const Function& f) const {
    return (f.what == Watch::gap || f.what == Watch::slip) && f.is(State::armed) &&
           f.slope_before < 0 && f.slope > 0 && f.before > 0 &&
           std::min(f.before, f.value) < (end_ - begin_) * std::max(-f.slope_before, f.slope);
  }
  bool dips(Phase& phase, const Function& f);
  double turn(Phase& phase, Function f, double& when);

  const Bands& bands() const { return motion_.bands(); }

  Motion& motion_;
  std::vector<Function> functions_;
  double begin_ = 0, end_ = 0;  // the part of the last step that is searched
  VectorXd rate_, y_;
  std::vector<std::size_t> waking_;
  double force_ = 0;         // the largest so far
  double support_band_ = 0;  // of accelerations
  struct {
    double time, tolerance;
  } undecided_ = {};
};

}  // namespace tether::scene::event

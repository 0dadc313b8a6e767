// Tether: event-driven motion of a model with contacts (method, section 3).
// SPDX-License-Identifier: BSD-3-Clause
//
//   while t < end:  step of IDA;  the first zero of a watched function in it?
//   at a zero:      impacts of closing contacts through joints and closed contacts
//                   modes of those that stay closed, by Coulomb's law for accelerations; the mode
//                   that was left is not taken again
//                   the state onto the new constraints, a new phase
#pragma once

#include <fmt/format.h>

#include "event/phase/friction_solve.hpp"
#include "event/phase/motion.hpp"
#include "event/phase/phase.hpp"
#include "event/phase/watch.hpp"

namespace tether::scene::event {

using EventKind = ContactEvent::Kind;

/// Event of one contact. Several contacts may have events of one time.
struct EventRecord {
  double time = 0;
  EventKind kind = EventKind::impact;
  int contact = -1;
  double before = 0, after = 0;  ///< normal velocities
  double lost = 0;               ///< energy of all contacts of this instant, in its first record
  Eigen::Vector3d impulse = Eigen::Vector3d::Zero();  ///< on the first body, world axes
};

struct DriverOptions {
  double tolerance = 1e-6;  ///< of the motion, in the units of the model
  double max_step = 0;      ///< s; 0: free
  contact::SimultaneousImpacts simultaneous = contact::SimultaneousImpacts::together;
  long max_events = 1000000;
  long max_steps = 100000000;  ///< of IDA
  double end = 0;              ///< of the run, s; 0: unknown, and storms are not bounded
  /// Work, in operations, after which events may be a storm, see check_storm.
  double storm = 2e11;
};

/// How exact the state is that a driver begins with.
struct StartState {
  /// Contacts with gaps and normal speeds up to these are closed there, and moved to be so: of
  /// steps. 0: those that are within their bands.
  double gap = 0, speed = 0;
  Counts so_far;
};

/// Contacts that are closed at the state that is set: see StartState. Nothing: others overlap.
std::optional<std::vector<int>> closed_contacts(Model& model, const StartState& state);

/// The last impacts of one contact, the latest first.
struct Bounces {
  double time[3] = {0, 0, 0}, speed[3] = {0, 0, 0};
  int count = 0;
};

class Driver {
 public:
  /// `y`: q, then u. Moves it onto joints and closed contacts. Throws std::invalid_argument where
  /// bodies overlap.
  Driver(Model& model, const DriverOptions& options, double t, const VectorXd& y,
         const StartState& start = {});

  /// The start of a phase: all that it depends on. IDA's history is not in it: a phase is repeated
  /// from its start.
  struct Memory {
    double time = 0, kept_energy = 0;
    VectorXd y;                      ///< q, u, work of forces without potential
    std::vector<ContactMode> modes;  ///< there; directions of slip turn since
    std::vector<double> levels;      ///< gaps of closed contacts
    std::vector<Bounces> bounces;
    std::vector<int> axes;     ///< of the tangents of each contact
    std::vector<bool> lifted;  ///< contacts whose forces have vanished at this time
    long at_one_time = 0, events = 0, impacts = 0;

    /// Numbers are finite, counts are counts.
    bool is_sound() const;
  };
  /// Goes on with the bits of the driver that made the memory.
  Driver(Model& model, const DriverOptions& options, const Memory& memory);
  const Memory& memory() const { return start_; }  ///< of the present phase

  /// Told of each impact: its contacts, their impulses by row, those that end accumulating impacts
  /// (or none), and the velocities before. `exact`: its velocities obey the law of impacts.
  using Struck = std::function<void(const ContactRows& rows, const VectorXd& x,
                                    const VectorXd& rest, const VectorXd& before, bool exact)>;
  void observe(Struck struck) { struck_ = std::move(struck); }

  /// To time t; early where `interrupted`, and where `excess` is above 0 first, a function of the
  /// state that the motion has the accelerations and forces of. Throws SimulationError.
  void advance(double t, const std::function<bool()>& interrupted = {},
               const std::function<double()>& excess = {});
  /// From the start of the present phase to a time in it; false: it is not in it, or too far.
  // No event lies in between, and no more steps than a phase has: what says otherwise never was a
  // state.
  bool arrive(double t) {
    const long events = counts_.events;
    const auto is_over = [&] {
      return counts_.events > events || phase_->counts().steps >= kAnchor;
    };
    advance(t, is_over);
    return time_ == t && counts_.events == events;
  }
  double time() const { return time_; }
  /// The state there: q, u, work of forces without potential.
  VectorXd state() {
    VectorXd y = start_.y;
    // A run that gives up within an event has no phase there yet.
    const double since = time_ - start_.time;
    if (since > 0 && phase_->step_end() > 0)
      phase_->projected_at(std::min(std::max(since, phase_->step_begin()), phase_->step_end()), y);
    model_.set(time_, y.data());
    return y;
  }
  const std::vector<EventRecord>& events() const { return events_; }
  Counts counts() const {
    Counts all = counts_;
    if (phase_) all += phase_->counts();
    return all;
  }
  const Motion& motion() const { return motion_; }
  Motion& motion() { return motion_; }

 private:
  const Bands& bands() const { return motion_.bands(); }
  auto u() { return start_.y.segment(motion_.coordinates(), motion_.velocities()); }
  void set_model() { model_.set(start_.time, start_.y.data()); }  // to the state of start_
  void check_start() const;
  void close_contacts(const StartState& start);
  void begin_phase();
  std::string contradiction() const;
  // Removes the normal velocities, less than their bands, that contacts have when they close.
  void settle_velocities() {
    const double energy = model_.energy();
    motion_.settle_velocities(start_.time, start_.y);
    const double lost = energy - model_.energy();
    if (!events_.empty() && events_.back().time == start_.time) events_.back().lost += lost;
  }
  void start_phase(double most = 1);  // tolerance of IDA
  bool repeat_phase();
  void find_excess(const std::function<double()>& excess);
  void handle(const Zero& zero);
  void anchor();
  // Fails if the steps since the last event are too short for the time that is left: steps that
  // cover 1e-12 of it come to no end, at a microsecond each in some thousand years.
  void check_pace(double t) const {
    const long steps = paced_.steps + phase_->counts().steps;
    const double way = paced_.way + phase_->step_end();
    if (steps < 100000 || !(way < 1e-12 * (t - time_))) return;
    fail(
        fmt::format("the last {} steps are {:.3g} s together, and {:.3g} s are left: a motion too "
                    "fast for its length of time",
                    steps, way * model_.time_unit(), (t - time_) * model_.time_unit()));
  }
  void check_storm();
  void collide(const std::vector<int>& near, EventKind otherwise, int contact);
  std::vector<int> struck(const std::vector<int>& near, int first);
  void strike(const std::vector<int>& set, bool plastic);
  struct Impact;
  void refuse_blocked(const ContactRows& rows, const Impact& impact);
  Impact expect(const ContactRows& rows, const VectorXd& before, bool plastic);
  // Returns the energy that is lost.
  double change_velocities(const VectorXd& change) {
    const double energy = model_.energy();
    u() += change;
    set_model();
    return energy - model_.energy();
  }
  void record_impacts(const ContactRows& rows, const Impact& impact, const VectorXd& before,
                      const VectorXd& after, const VectorXd& x, double lost);
  bool has_accumulated(int contact, double approach, double& rest) const;
  double come_to_rest(const std::vector<int>& touching, double speed, VectorXd& x);
  void remember(int contact, double approach);
  /// The mode of a contact that an event has ended, by the function that was zero.
  struct Left {
    int contact = -1;
    std::optional<Watch> by;
  };
  std::vector<ContactMode> decide(const std::vector<int>& touching, const Left& left,
                                  bool may_jam = true);
  std::vector<int> staying(const std::vector<int>& touching, const Left& left);
  std::vector<VectorXd> slides_of(const ContactRows& rows, const VectorXd& velocities,
                                  const Left& left);
  bool lifts(const ContactRows& rows, int k, const AccelerationSolution& answer) const;
  ContactMode begins(const ContactRows& rows, int k, const AccelerationSolution& answer,
                     const Left& left) const;
  // It is at the border of its face or edge, and on its way out; another contact takes its place.
  bool leaves_its_feature(int contact) {
    const double band = bands().gap(contact);
    return model_.margin(contact) <= band &&
           motion_.margin_rate(start_.time, start_.y, contact) < -bands().approach(contact);
  }
  void jam(const ContactRows& rows, const VectorXd& velocities);
  std::vector<int> touching(int always) const;
  bool are_one(int contact, int other) const {
    return model_.are_one(contact, other, kBesideBorder * bands().gap(contact));
  }
  std::vector<int> without_doubles(const std::vector<int>& contacts) const;
  /// Contacts, and the moments that they hold, behind them.
  std::vector<int> with_moments(std::vector<int> contacts) const;
  double slowest_turn();
  double longest_first_step(const std::vector<bool>& leaving);
  // The direction in which a contact slides, for the instant when its slip vanishes.
  void turn_slips() {
    for (std::size_t k = 0; k < motion_.closed().size(); ++k) {
      const int i = motion_.closed()[k];
      if (motion_.modes()[at(i)].mode != Mode::slide) continue;
      const VectorXd s = motion_.slip(static_cast<int>(k));
      // The direction of less is that of errors.
      if (s.norm() > 10 * bands().slip(i)) motion_.turn(i, s.normalized());
    }
  }
  EventKind slip_of(int contact, bool begins) const {
    if (model_.law(contact).is_moment()) return begins ? EventKind::roll : EventKind::roll_stop;
    return begins ? EventKind::slip : EventKind::stop;
  }
  void record(EventKind kind, int contact, double before = 0, double after = 0, double lost = 0) {
    events_.push_back({start_.time, kind, contact, before, after, lost});
  }
  void record_changes(const std::vector<ContactMode>& before, const std::vector<ContactMode>& after,
                      double lag);
  [[noreturn]] void fail(const std::string& what) const;

  Model& model_;
  DriverOptions options_;
  double local_;  // tolerance of IDA
  Motion motion_;
  Watcher watcher_;
  double time_;
  double kink_ = 0;  // the next one of forces
  Memory start_;     // of the phase; within an event its time and state
  std::unique_ptr<Phase> phase_;
  std::optional<Zero> next_;
  double above_from_ = kInfinity;  // since the start of the phase
  std::vector<EventRecord> events_;
  Counts counts_;
  struct {
    long steps = 0;
    double way = 0;  // s
  } paced_;          // of the phases before this one since the last event
  struct {
    double work = 0, time = 0;
    long events = 0;
  } storm_;        // where the work was checked last
  Struck struck_;  // empty: nobody asks
};

/// An impact of contacts that touch: the right hand side of its problem w = A x - b.
struct Driver::Impact {
  VectorXd b;
  std::vector<bool> hits;  ///< they close, and fast enough to count
  VectorXd rest;           ///< > 0: the contact's impacts are over after this time, s
  double fastest = 0;      ///< of those that are over: speed of approach
};

}  // namespace tether::scene::event

// Tether: event-driven motion of a model with contacts. SPDX-License-Identifier: BSD-3-Clause
#include "driver.hpp"

#include <fmt/format.h>

#include "mechanics/roots.hpp"
#include "output/binary.hpp"
#include "sundials/ida_session.hpp"

namespace tether::scene::event {

namespace {

constexpr double kLeastLocal = 1e-13, kLeastInFlight = 2e-13;  // of IDA: more is rounding

// Method, eq. 12: IDA bounds the error of a step. What it adds up to over tens of events, and tens
// of periods between them, is to be within ten tolerances (a mass that rubs to rest in thirteen
// turns).
double wanted_tolerance(double tolerance) {
  return std::min(1.0, std::pow(tolerance / 1e-4, 0.066)) * 0.025 * tolerance;
}

double local_tolerance(double tolerance) {
  return std::max(wanted_tolerance(tolerance), kLeastLocal);
}

// A part of it, at most the whole.
double part_of_tolerance(double tolerance, double part) {
  return std::max(kLeastInFlight, wanted_tolerance(tolerance) * std::min(1.0, part));
}

// From a bounce on: an error of the height is one of the time of the next impact, over its speed.
double flight_tolerance(double tolerance, double speed) {
  const bool tight = wanted_tolerance(tolerance) < 1e-11;  // others stay as they are
  return tight ? part_of_tolerance(tolerance, speed) : kInfinity;
}

// To an impact with this speed that does not end a bounce. Errors of gaps are those of its time,
// over the speed; what the phase before has left is a part of the tolerance. From 0.04 on, in the
// units of the model, the tolerance itself serves.
double graze_tolerance(double tolerance, double speed) {
  return part_of_tolerance(tolerance, speed / 0.04);
}

constexpr long kMostAtOneTime = 300;

// The first steps of a bounce are of order 1: some ten times (h / T)^2 is their error in its length
// T. A way of less than kLeastWay (m in the units of the model) is lost in rounding.
constexpr double kFlightError = 0.003, kLeastWay = 1e-15;

/// Until a gap that falls with the acceleration `back` is zero, s; 0: never.
double flight_time(double gap, double rate, double back) {
  const double square = rate * rate + 2 * back * gap;
  if (square < 0) return 0;
  const double root = std::sqrt(square);
  return rate > 0 ? (back > 0 ? (rate + root) / back : 0) : 2 * gap / (root - rate);
}

}  // namespace

Driver::Driver(Model& model, const DriverOptions& options, double t, const VectorXd& y,
               const StartState& start)
    : model_(model),
      options_(options),
      local_(local_tolerance(options.tolerance)),
      motion_(model, options.tolerance, t, y),
      watcher_(motion_),
      time_(t) {
  start_.time = t;
  start_.bounces.resize(at(model.contacts()));
  start_.lifted.resize(at(model.contacts()));
  start_.y.setZero(motion_.size());
  start_.y.head(motion_.work()) = y;
  counts_ = start.so_far;
  set_model();
  model_.settle();
  if (start.gap > 0) close_contacts(start);
  check_start();
  const std::vector<int> close = touching(-1);
  collide(close, EventKind::impact, -1);
  if (!events_.empty()) ++counts_.events;
  // Figures of a scene are rounded: its energy is that of the start which joints allow.
  const std::vector<ContactMode> modes = decide(touching(-1), {});
  motion_.choose(t, start_.y, modes);
  motion_.set_levels(std::vector<double>(at(model_.contacts()), 0.0));
  motion_.leave_energy_free();
  if (!move_onto_constraints(motion_, local_, t, start_.y))
    throw std::invalid_argument("the start of the scene contradicts its joints or contacts");
  set_model();
  motion_.choose(t, start_.y, modes);
  begin_phase();
}

void Driver::check_start() const {
  const VectorXd g = model_.joint_values<0>(), speeds = model_.joint_values<1>();
  const VectorXd u = start_.y.segment(motion_.coordinates(), motion_.velocities());
  const double size = std::max(1.0, start_.y.head(motion_.coordinates()).cwiseAbs().maxCoeff());
  const double speed = u.size() > 0 ? std::max(1.0, u.cwiseAbs().maxCoeff()) : 1;
  for (int i = 0; i < g.size(); ++i)
    if (std::abs(g[i]) > kStartTolerance * size || std::abs(speeds[i]) > kStartTolerance * speed)
      throw std::invalid_argument(fmt::format(
          "the start of the scene contradicts {}: off by {:.3g} in position, {:.3g} in velocity "
          "(at most {:g} is taken for rounding); give both bodies places, velocities and angular "
          "velocities that the joint allows, and those of a prescribed motion",
          model_.joint_name(i), g[i], speeds[i], kStartTolerance));
  double slope = 0;
  for (int i = 0; i < model_.contacts(); ++i) {
    if (model_.is_apart(i, 0)) continue;
    const double gap = model_.gap(i, slope);
    if (std::isinf(model_.margin(i)) && gap < -kStartTolerance * size)
      throw std::invalid_argument(fmt::format(
          "bodies overlap at the start by {:.3g} (contact {}): give them places apart", -gap, i));
  }
}

// Contacts with no gap, closed ones among them, and those that come in over a border.
std::vector<int> Driver::touching(int always) const {
  std::vector<int> out;
  for (int i = 0; i < model_.contacts(); ++i) {
    double rate = 0;
    if (model_.law(i).is_moment()) continue;  // see with_moments
    const bool closed = motion_.modes()[at(i)].mode != Mode::open;
    if (!closed && i != always && model_.is_apart(i, bands().gap(i))) continue;
    const bool near = std::abs(model_.gap(i, rate)) <= bands().gap(i) &&
                      model_.margin(i) >= -kBesideBorder * bands().gap(i);
    if (i == always || closed || near) out.push_back(i);
  }
  return out;
}

// Features of faces, edges and corners that lie on each other: one of those that are one contact,
// the closed one, which so changes only where it ends.
std::vector<int> Driver::without_doubles(const std::vector<int>& contacts) const {
  std::vector<int> out;
  for (const int i : contacts) {
    const auto twin = std::find_if(out.begin(), out.end(), [&](int k) { return are_one(k, i); });
    if (twin == out.end())
      out.push_back(i);
    else if (motion_.modes()[at(*twin)].mode == Mode::open)
      *twin = motion_.modes()[at(i)].mode == Mode::open ? *twin : i;
  }
  return out;
}

std::vector<int> Driver::with_moments(std::vector<int> contacts) const {
  const auto end = static_cast<std::ptrdiff_t>(contacts.size());
  for (int i = 0; i < model_.contacts(); ++i) {
    const int by = model_.law(i).held_by;
    if (by >= 0 &&
        std::find(contacts.begin(), contacts.begin() + end, by) != contacts.begin() + end)
      contacts.push_back(i);
  }
  return contacts;
}

void Driver::advance(double t, const std::function<bool()>& interrupted,
                     const std::function<double()>& excess) {
  while (time_ < t) {
    const bool above = std::isfinite(above_from_);
    const double end = above ? above_from_ : next_ ? next_->time : phase_->step_end();
    // An event of a phase that was taken again may lie before a time that was told already.
    const double reached =
        next_ || above ? std::max(time_, phase_->start() + end) : phase_->start() + end;
    if (reached > time_ || ((next_ || above) && reached >= time_)) {
      if (reached > t) {
        time_ = t;
        return;
      }
      time_ = reached;
      if (above) return;
      if (next_) {
        const Zero zero = *next_;
        handle(zero);
      }
      if (interrupted && interrupted()) return;
      continue;
    }
    if (phase_->counts().steps >= kAnchor || phase_->is_at_end() ||
        (phase_->step_end() > 0 && phase_->has_weak_rows())) {
      anchor();
      continue;
    }
    phase_->step();
    if (counts_.steps + phase_->counts().steps > options_.max_steps)
      fail(fmt::format("max_steps = {} steps are taken", options_.max_steps));
    check_pace(t);
    next_ = watcher_.first_zero(*phase_);
    if (repeat_phase()) continue;
    if (!next_) turn_slips();
    if (excess) find_excess(excess);
  }
}

void Driver::find_excess(const std::function<double()>& excess) {
  VectorXd y, rate(motion_.size());
  const auto at = [&](double time) {
    phase_->at(time, y);
    motion_.rate(phase_->start() + time, y.data(), rate.data());
    return excess();
  };
  above_from_ =
      mechanics::first_above(at, phase_->step_begin(), next_ ? next_->time : phase_->step_end());
}

// Repeats the phase from its start where a gap is zero with hardly any speed, at the tolerance that
// decides whether it is an impact. Returns whether it does.
bool Driver::repeat_phase() {
  double tolerance = std::max(watcher_.deciding_tolerance(), kLeastInFlight);
  if (next_ && next_->what == Watch::gap && next_->start == Start::apart) {
    double rate = 0;
    model_.set(phase_->start() + next_->time, next_->y.data());
    model_.gap(next_->contact, rate);
    tolerance = std::min(tolerance, graze_tolerance(options_.tolerance, std::abs(rate)));
  }
  if (!(tolerance < 0.5 * phase_->tolerance())) return false;
  motion_.choose(start_.time, start_.y, start_.modes);
  start_phase(tolerance);
  return true;
}

bool Driver::Memory::is_sound() const {
  bool sound = y.allFinite() && time >= 0;
  for (const double x : {time, kept_energy}) sound = sound && std::isfinite(x);
  for (const ContactMode& each : modes) sound = sound && each.direction.allFinite();
  for (const double level : levels) sound = sound && std::isfinite(level);
  for (const int axis : axes) sound = sound && axis >= 0 && axis <= 2;
  for (const Bounces& each : bounces) {
    sound = sound && each.count >= 0 && each.count <= 3;
    for (int k = 0; k < 3; ++k)
      sound = sound && std::isfinite(each.time[k]) && std::isfinite(each.speed[k]);
  }
  for (const long count : {at_one_time, events, impacts})
    sound = sound && count >= 0 && count <= binary::kMostCounted;
  return sound;
}

// Bodies that rattle without end cost all of their rows at each event. Two minutes of work, and at
// this pace an hour for the rest of the run: no accumulation of single contacts costs as much.
void Driver::check_storm() {
  const double work = motion_.work_done();
  if (!(options_.end > 0) || work - storm_.work < options_.storm) return;
  const double way = start_.time - storm_.time, left = options_.end - start_.time;
  const long events = counts_.events - storm_.events;
  // As much work again for the rest of the run, 25 times.
  if (events >= 100 && way * 25 < left)
    fail(fmt::format("a storm of events: the last {} took {:.3g} s together, and {:.3g} s are left",
                     events, way * model_.time_unit(), left * model_.time_unit()));
  storm_ = {work, start_.time, counts_.events};
}

// A phase without events may be long; a saved state is arrived at again from its start. Where
// forces have a kink motion begins anew, with the step at which a state before it has ended.
void Driver::anchor() {
  paced_.steps += phase_->counts().steps;
  paced_.way += phase_->step_end();
  start_.time = phase_->is_at_end() ? kink_ : phase_->start() + phase_->step_end();
  phase_->projected_at(phase_->step_end(), start_.y);
  // Rows that were not in use are met by what the others leave of them only.
  motion_.choose(start_.time, start_.y, start_.modes);
  const VectorXd before = start_.y;
  if (!move_onto_constraints(motion_, local_, start_.time, start_.y)) start_.y = before;
  start_phase();
}

Driver::Driver(Model& model, const DriverOptions& options, const Memory& memory)
    : model_(model),
      options_(options),
      local_(local_tolerance(options.tolerance)),
      motion_(model, options.tolerance, memory.time, memory.y),
      watcher_(motion_),
      time_(memory.time),
      start_(memory) {
  counts_.events = memory.events;
  counts_.impacts = memory.impacts;
  for (std::size_t i = 0; i < memory.axes.size(); ++i)
    model_.set_axis(static_cast<int>(i), memory.axes[i]);
  set_model();
  model_.settle();
  motion_.keep_energy(memory.kept_energy);
  motion_.choose(time_, start_.y, memory.modes);
  motion_.set_levels(memory.levels);
  start_phase();
}

void Driver::handle(const Zero& zero) {
  paced_ = {};
  const double now = phase_->start() + zero.time;
  start_.at_one_time = now > start_.time ? 0 : start_.at_one_time + 1;
  if (start_.at_one_time == 0) start_.lifted.assign(start_.lifted.size(), false);
  if (zero.what == Watch::normal_force) start_.lifted[at(zero.contact)] = true;
  if (start_.at_one_time > kMostAtOneTime)
    fail(fmt::format("more than {} events at one time", kMostAtOneTime));
  if (++counts_.events > options_.max_events)
    fail(fmt::format("max_events = {} events are over", options_.max_events));
  start_.time = now;
  check_storm();
  start_.y = zero.y;
  set_model();
  model_.settle();
  const bool closing = zero.what == Watch::gap;
  const std::vector<int> close = touching(zero.contact);
  const std::vector<ContactMode> modes_before = motion_.modes();
  if (closing)
    collide(close, EventKind::touch, zero.contact);
  else if (zero.what != Watch::support)
    record(zero.what == Watch::normal_force ? EventKind::lift
           : zero.what == Watch::border     ? EventKind::border
                                            : slip_of(zero.contact, zero.what == Watch::cone),
           zero.contact);
  std::vector<ContactMode> modes = decide(close, closing ? Left() : Left{zero.contact, zero.what});
  if (zero.what == Watch::support) record_changes(modes_before, modes, zero.lag);
  motion_.choose(start_.time, start_.y, std::move(modes));
  begin_phase();
}

// Records the changes of mode of contacts that share their forces.
void Driver::record_changes(const std::vector<ContactMode>& before,
                            const std::vector<ContactMode>& after, double lag) {
  for (std::size_t i = 0; i < after.size(); ++i) {
    if (before[i].mode == after[i].mode) continue;
    const int contact = static_cast<int>(i);
    const bool lifts = after[i].mode == Mode::open;
    if (lifts && model_.law(contact).is_moment()) continue;
    record(lifts ? EventKind::lift : slip_of(contact, after[i].mode == Mode::slide), contact);
    events_.back().time -= lag;
  }
}

void Driver::fail(const std::string& what) const {
  throw SimulationError(
      fmt::format("t = {:.12g} s: {}. Try another [event] tolerance, or the stepping engine",
                  model_.time_unit() * time_, what));
}

void Driver::begin_phase() {
  settle_velocities();
  motion_.keep_energy_of(start_.time, start_.y);
  const VectorXd before = start_.y;
  if (!move_onto_constraints(motion_, local_, start_.time, start_.y)) {
    start_.y = before;
    set_model();
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
  // Both sides of a clearance, say; a hundredth of a band is more than rounding.
  if (gap > 0.01 * band)
    text += fmt::format(
        ": at this tolerance gaps of up to {:.3g} m count as closed, and of the {} contacts that "
        "do so "
        "one has {:.3g} m. A smaller tolerance tells them apart",
        unit * band, motion_.closed().size(), unit * gap);
  return text;
}

// Everything from (start_.time, start_.y), the modes and the energy that is kept: whoever has these
// goes on with the same bits.
void Driver::start_phase(double most) {
  start_.modes = motion_.modes();
  start_.axes.resize(start_.modes.size());
  model_.begin_anew(start_.time);
  motion_.choose(start_.time, start_.y, start_.modes);
  set_model();
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
  local = std::min(local, part_of_tolerance(options_.tolerance, slowest_turn()));
  if (phase_) counts_ += phase_->counts();
  phase_.reset();
  const double first = longest_first_step(leaving);
  kink_ = model_.next_kink(start_.time);
  start_.levels = motion_.levels();
  start_.kept_energy = motion_.kept_energy();
  start_.events = counts_.events;
  start_.impacts = counts_.impacts;
  for (int i = 0; i < model_.contacts(); ++i) start_.axes[at(i)] = model_.axis(i);
  phase_ = std::make_unique<Phase>(motion_, local, options_.max_step, start_.time, start_.y, first,
                                   kink_ - start_.time);
  watcher_.begin(start_.time, start_.y, leaving);
  next_.reset();
  above_from_ = kInfinity;
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
      motion_.rate(start_.time, start_.y.data(), rate.data());
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
  motion_.rate(start_.time, start_.y.data(), rate.data());
  const VectorXd a = motion_.acceleration();
  const double part = std::min(1e-3, std::sqrt(kFlightError * options_.tolerance));
  double longest = 0;
  ContactKinematics kinematics;
  for (int i = 0; i < model_.contacts(); ++i) {
    if (motion_.modes()[at(i)].mode != Mode::open) continue;
    if (model_.is_apart(i, bands().gap(i))) continue;
    double speed = 0;
    const double gap = leaving[at(i)] ? 0 : model_.gap(i, speed);
    if (leaving[at(i)]) model_.gap(i, speed);
    const bool closing = gap > 0 && gap <= bands().gap(i) && speed < -bands().approach(i);
    if (!leaving[at(i)] && !closing) continue;
    model_.evaluate_contact(i, kinematics);
    const double flight =
        flight_time(gap, speed, -(kinematics.normal.dot(a) + kinematics.normal_rest));
    if (!(flight > 0)) continue;
    const double first = std::max(part * flight, kLeastWay / std::abs(speed));
    longest = longest > 0 ? std::min(longest, first) : first;
  }
  return longest;
}

// After a step a contact that is closed has a gap and a normal speed of the step's order. Its
// bodies are moved until it has none, as the driver of events keeps it from there on: velocities by
// impulses, places by the least move.

std::optional<std::vector<int>> closed_contacts(Model& model, const StartState& state) {
  std::vector<int> out;
  for (int i = 0; i < model.contacts(); ++i) {
    if (!model.law(i).has_normal()) continue;
    if (model.is_apart(i, state.gap)) continue;
    double rate = 0;
    const double gap = model.gap(i, rate), margin = model.margin(i);
    if (gap > state.gap || margin < -state.gap) continue;
    if (gap >= -state.gap && std::abs(rate) <= state.speed)
      out.push_back(i);
    else if (gap < 0 && (gap >= -state.gap || std::isinf(margin)))
      return {};  // what lies deep behind a face with a border may be beside it
  }
  return out;
}

void Driver::close_contacts(const StartState& start) {
  const std::optional<std::vector<int>> closed = closed_contacts(model_, start);
  if (!closed) throw std::invalid_argument("bodies overlap");
  if (closed->empty()) return;
  // Frictionless: what slips slips on.
  std::vector<ContactMode> modes(at(model_.contacts()));
  for (const int i : without_doubles(*closed)) {
    modes[at(i)].mode = Mode::slide;
    modes[at(i)].direction = VectorXd::Unit(kTangents, 0);
  }
  motion_.choose(time_, start_.y, std::move(modes));
  motion_.settle_velocities(time_, start_.y);
  motion_.set_levels(std::vector<double>(at(model_.contacts()), 0.0));
  motion_.leave_energy_free();
  if (!move_onto_constraints(motion_, local_, time_, start_.y))
    throw SimulationError("contacts of a step cannot be closed together");
  motion_.choose(time_, start_.y, std::vector<ContactMode>(at(model_.contacts())));
  set_model();
  model_.settle();
}

}  // namespace tether::scene::event

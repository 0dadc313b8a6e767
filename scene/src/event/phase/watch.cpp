// Tether: the functions of the state whose zeros are events. SPDX-License-Identifier: BSD-3-Clause
#include "watch.hpp"

#include "bounds.hpp"
#include "event/model/features.hpp"
#include "friction_solve.hpp"
#include "mechanics/roots.hpp"

namespace tether::scene::event {

namespace {

constexpr double kFewOfBand = 0.02;  // the part of a band at which a zero counts as located
constexpr int kParts = 32;           // of a step in which bodies may pass each other
constexpr double kFasterWithin = 2;  // a step, than at its ends
constexpr double kKnown = 5;         // errors of gaps, in the tolerance of the phase
// Errors of accelerations: by the contact library's tolerance, and by the large slip S.
constexpr double kNoise = 3e-8, kSlidingNoise = 1e-6;

/// A zero of f between a and b, where it has other signs.
template <class F>
double zero_between(const F& f, double a, double fa, double b, double fb, double resolution) {
  const mechanics::Bracket at = mechanics::narrowed(f, {a, fa, b, fb}, resolution);
  return std::abs(at.fa) < std::abs(at.fb) ? at.a : at.b;
}

/// The first time from which on f is negative, between a and b where it is; up to there it is flat,
/// as what contacts can bear is. Straight lines of its negative side aim at a value of -`near`.
template <class F>
double kink_between(const F& f, double a, double b, double fb, double near, double resolution) {
  double m = 0.5 * (a + b);
  for (int k = 0; k < mechanics::kMostIterations && b - a > resolution && fb < -2 * near; ++k) {
    const double fm = f(m);
    if (fm >= 0) {
      a = m;
      m = 0.5 * (a + b);
      continue;
    }
    const double slope = (fb - fm) / (b - m);
    b = m;
    fb = fm;
    m = b - (fb + near) / slope;
    if (!(slope < 0 && m > a)) m = 0.5 * (a + b);
  }
  return b;
}

}  // namespace

void Watcher::begin(double t, const VectorXd& y, const std::vector<bool>& leaving) {
  functions_.clear();
  force_ = 0;
  const auto add = [&](Watch what, int contact, int closed, Start start = Start::apart) {
    functions_.push_back({what, contact, closed, start});
  };
  const std::vector<int>& closed = motion_.closed();
  for (int i = 0; i < motion_.model().contacts(); ++i)
    if (motion_.modes()[static_cast<std::size_t>(i)].mode == Mode::open &&
        motion_.model().law(i).has_normal())
      add(Watch::gap, i, -1, leaving[static_cast<std::size_t>(i)] ? Start::leaving : Start::apart);
  for (std::size_t k = 0; k < closed.size(); ++k) {
    const int i = closed[k], place = static_cast<int>(k);
    const bool single = !motion_.is_hyperstatic();
    if (single && motion_.model().law(i).has_normal()) add(Watch::normal_force, i, place);
    const bool stuck = motion_.modes()[static_cast<std::size_t>(i)].mode == Mode::stick;
    if (stuck && single) add(Watch::cone, i, place);
    if (std::isfinite(motion_.model().margin(i))) add(Watch::border, i, place);
    if (!stuck && motion_.model().holding(i) > 0) add(Watch::slip, i, place);
  }
  if (motion_.is_hyperstatic()) add(Watch::support, -1, -1);
  evaluate(t, y, 0);
  for (Function& f : functions_) arm(f);
}

void Watcher::arm(Function& f) {
  const bool gap = f.what == Watch::gap;
  if (f.is(State::far)) return;
  f.state = gap && f.value < -bands().gap(f.contact) ? State::beside : State::waiting;
  if (gap && f.start != Start::leaving)
    f.start = std::abs(f.value) <= bands().gap(f.contact) ? Start::near : Start::apart;
  // A border is come in over.
  if ((gap || f.what == Watch::border) && f.value < 0 && f.is(State::waiting)) {
    f.level = f.value;
    f.value = 0;
  }
  const bool closing = gap && f.value > 0 && f.slope < -bands().approach(f.contact);
  if (closing || f.value > band(f)) f.state = State::armed;
}

double Watcher::band(const Function& f) const {
  switch (f.what) {
    case Watch::gap:
      return f.start == Start::leaving ? 0 : bands().gap(f.contact);
    case Watch::border:
      return bands().gap(f.contact);
    case Watch::support:
      return 0;
    case Watch::slip:
      return bands().slip(f.contact);
    default: {
      const ContactLaw law = motion_.model().law(f.contact);
      const double size = law.is_moment() ? law.friction : 1;
      return bands().part * (law.is_bounded() ? law.bound : size * force_);
    }
  }
}

double Watcher::of_state(Function& f) {
  switch (f.what) {
    case Watch::gap:
      return motion_.model().gap(f.contact, f.slope) - f.level;
    case Watch::normal_force:
      return motion_.normal_force(f.closed);
    case Watch::cone:
      return motion_.model().holding(f.contact) * motion_.normal_force(f.closed) -
             motion_.friction_force(f.closed).norm();
    case Watch::border:
      return motion_.model().margin(f.contact) - f.level;
    case Watch::support:
      return support();
    case Watch::slip: {
      const VectorXd& d = motion_.modes()[static_cast<std::size_t>(f.contact)].direction;
      f.slope = motion_.slip_rate(f.closed).dot(d);
      return motion_.slip(f.closed).dot(d);
    }
  }
  return 0;
}

// The band of accelerations less the largest acceleration of contacts at rest (method, eq. 9).
double Watcher::support() {
  if (motion_.forces_are_lawful()) return support_band_ > 0 ? support_band_ : kNoise;
  ContactRows rows(motion_.model(), motion_.closed());
  const std::vector<VectorXd> slides = motion_.slides();
  const bool sliding = any_of(slides, [](const VectorXd& each) { return each.size() > 0; });
  const AccelerationSolution answer = solve_accelerations(rows, slides, bands().of_accelerations());
  if (!answer.contacts.solved) return -answer.scale;
  double largest = 0;
  for (std::size_t k = 0; k < slides.size(); ++k) {
    const ConePart& p = rows.parts()[k];
    if (p.has_normal()) largest = std::max(largest, std::abs(answer.contacts.w[p.first]));
    if (slides[k].size() == 0) largest = std::max(largest, p.slip_of(answer.contacts.w).norm());
  }
  // The library's error is a part of its velocities; w may be off by a multiple of it.
  const double noise = std::max(sliding ? kSlidingNoise : kNoise, 100 * answer.contacts.error);
  support_band_ = std::max(bands().of_accelerations(), noise) * answer.scale;
  return support_band_ - largest;
}

// Bodies that were apart, and no longer surely were so in all of the last step: their gaps count
// from its start.
void Watcher::wake(Phase& phase, const VectorXd& at_end, double by) {
  Model& model = motion_.model();
  model.set(phase.start() + phase.step_end(), at_end.data());
  waking_.clear();
  for (std::size_t k = 0; k < functions_.size(); ++k)
    if (functions_[k].is(State::far) && !model.is_apart(functions_[k].contact, by))
      waking_.push_back(k);
  if (waking_.empty()) return;
  phase.at(phase.step_begin(), y_);
  model.set(phase.start() + phase.step_begin(), y_.data());
  for (const std::size_t k : waking_) {
    Function& f = functions_[k];
    f.state = State::waiting;
    f.level = 0;
    f.value = of_state(f);
    f.passes = model.passes(f.contact);
    arm(f);
  }
}

void Watcher::evaluate(double t, const VectorXd& y, double by) {
  rate_.resize(motion_.size());
  if (motion_.closed().empty())
    motion_.model().set(t, y.data());
  else
    motion_.rate(t, y.data(), rate_.data());
  for (std::size_t k = 0; k < motion_.closed().size(); ++k)
    if (motion_.model().law(motion_.closed()[k]).has_normal())
      force_ = std::max(force_, std::abs(motion_.normal_force(static_cast<int>(k))));
  for (Function& f : functions_) {
    if (f.what == Watch::gap && motion_.model().is_apart(f.contact, by)) {
      f.state = State::far;
      continue;
    }
    f.before = f.value;
    f.slope_before = f.slope;
    f.passes_before = f.passes;
    f.value = of_state(f);
    if (f.what == Watch::gap) f.passes = motion_.model().passes(f.contact);
  }
}

// The least or largest value of a gap or slip that turns in the last step.
double Watcher::turn(Phase& phase, Function f, double& when) {
  const double a = begin_, b = end_, before = f.slope_before, after = f.slope;
  const auto slope_at = [&](double time) {
    phase.at(time, y_);
    value(f, phase.start() + time, y_);
    return f.slope;
  };
  // A gap is flat where it turns: the time need not be exact to rounding.
  when = zero_between(slope_at, a, before, b, after, 1e-9 * (b - a));
  phase.at(when, y_);
  return value(f, phase.start() + when, y_);
}

Zero Watcher::locate(Phase& phase, Function f) {
  double a = begin_, b = end_;
  double fa = f.before, fb = f.value;
  const double slope_before = f.slope_before, slope_after = f.slope;
  const auto at = [&](double time) {
    phase.at(time, y_);
    return value(f, phase.start() + time, y_);
  };
  if (fb >= 0) fb = turn(phase, f, b);
  if (fa <= 0 && f.what == Watch::gap && slope_before > 0 && slope_after < 0)
    fa = turn(phase, f, a);
  Zero zero{f.what, f.contact, a, {}};
  const double resolution = 4e-16 * b;  // rounding of times
  if (f.what == Watch::support) {
    zero.time = fa > 0 ? kink_between(at, a, b, fb, kFewOfBand * support_band_, resolution) : a;
    phase.projected_at(zero.time, zero.y);
    return zero;
  }
  if (fa > 0) zero.time = zero_between(at, a, fa, b, fb, resolution);
  // Newton in time, on the constraints: a move in space would not be the motion.
  const double slope = fa > 0 && b > a ? (fb - fa) / (b - a) : 0;
  phase.projected_at(zero.time, zero.y);
  if (slope == 0) return zero;
  double local = slope, last = value(f, phase.start() + zero.time, zero.y), last_time = zero.time;
  for (int k = 0; k < 3; ++k) {
    const double next = std::clamp(last_time - last / local, phase.step_begin(), phase.step_end());
    if (std::abs(next - last_time) <= resolution) break;
    VectorXd there;
    phase.projected_at(next, there);
    const double now = value(f, phase.start() + next, there);
    zero.y = there;
    // The slope of two values that differ by rounding would lead anywhere.
    if (now != last && std::abs(next - last_time) > 1e4 * resolution)
      local = (now - last) / (next - last_time);
    last = now;
    last_time = zero.time = next;
    if (local == 0) break;
  }
  return zero;
}

// Accelerations of contacts that can no longer rest begin at zero and grow; by their rate where
// they leave the band. They jump where friction falls as contacts slip, which is when it happens.
double Watcher::lag(Phase& phase, Function f, double time) {
  const double later = time + 0.01 * (phase.step_end() - time);  // for a difference quotient
  if (!(later > time)) return 0;
  VectorXd y;
  phase.projected_at(time, y);
  const double here = value(f, phase.start() + time, y);
  if (here < -2 * kFewOfBand * support_band_) return 0;
  phase.projected_at(later, y);
  const double growth = (here - value(f, phase.start() + later, y)) / (later - time);
  return growth > 0 ? std::min((support_band_ - here) / growth, phase.start() + time) : 0;
}

// More than two bodies can come nearer to each other in the last step, by the fastest speed at its
// ends: at the one a body may be at the top of its flight.
double Watcher::way(Phase& phase, const VectorXd& at_end) {
  const auto fastest = [&](const VectorXd& y) {
    return y.segment(motion_.coordinates(), motion_.velocities()).norm();
  };
  phase.at(phase.step_begin(), y_);
  return kFasterWithin * 2 * std::max(fastest(y_), fastest(at_end)) *
         (phase.step_end() - phase.step_begin());
}

// Else it only touches. An impact that is not seen at a depth of d changes velocities by
// 2 (2 a d)^1/2: how exactly gaps are known decides, not the tolerance.
bool Watcher::dips(Phase& phase, const Function& f) {
  double when = 0;
  const double least = turn(phase, f, when);
  if (f.what != Watch::gap) return least < -band(f);
  const double part = bands().gap(f.contact) / bands().part;
  const double known = kKnown * part * phase.tolerance();
  if (least < -known || least > known) return least < 0;
  const double turns = (f.slope - f.slope_before) / (end_ - begin_);
  // Approaches of five bands are told from none.
  const double tells = 0.5 * std::pow(5 * bands().approach(f.contact), 2) / turns;
  const double tolerance = tells / (kKnown * part);
  if (tolerance < undecided_.tolerance) undecided_ = {when, tolerance};
  return false;
}

// Bodies may pass each other's whole size in a step, as on a long flight. The ends of the step do
// not tell how often a gap has turned, so parts of the step are searched; f becomes the function in
// the part that has the zero.
bool Watcher::is_hit_between(Phase& phase, Function& f) {
  const double begin = phase.step_begin(), length = phase.step_end() - begin;
  // A quarter of both bodies' size is passed in a step.
  if (f.what != Watch::gap ||
      !(std::max(f.passes_before, f.passes) * kFasterWithin * length > 0.25))
    return false;
  Function part = f;
  part.value = f.before;
  part.slope = f.slope_before;
  end_ = begin;
  for (int k = 1; k <= kParts; ++k) {
    begin_ = end_;
    end_ = begin + length * k / kParts;
    part.before = part.value;
    part.slope_before = part.slope;
    phase.at(end_, y_);
    part.value = value(part, phase.start() + end_, y_);
    if (part.value == kNowhere) return false;
    if (is_hit(phase, part)) {
      f = part;
      return true;
    }
    if (part.value > band(part)) part.state = State::armed;
  }
  return false;
}

std::optional<Zero> Watcher::first_zero(Phase& phase) {
  phase.at(phase.step_end(), y_);
  const VectorXd at_end = y_;
  const double by = way(phase, at_end);
  wake(phase, at_end, by);
  evaluate(phase.start() + phase.step_end(), at_end, by);
  std::optional<Zero> first;
  undecided_ = {0, kInfinity};
  for (Function& f : functions_) {
    if (!f.is(State::far) && f.value == kNowhere) f.state = State::beside;
    if (f.is(State::far) || f.is(State::beside)) continue;
    Function part = f;
    if (!is_hit_between(phase, part)) {
      begin_ = phase.step_begin();
      end_ = phase.step_end();
      if (!is_hit(phase, part)) continue;
    }
    Zero zero = locate(phase, part);
    if (f.what == Watch::support) zero.lag = lag(phase, f, zero.time);
    zero.start = f.start;
    if (f.what == Watch::gap &&
        motion_.passes_border(phase.start() + zero.time, zero.y, f.contact)) {
      f.state = State::beside;
      continue;
    }
    if (!first || zero.time < first->time) first = std::move(zero);
  }
  if (first && first->time < undecided_.time) undecided_.tolerance = kInfinity;
  if (!first)
    for (Function& f : functions_)
      if (!f.is(State::far) && f.value > band(f)) f.state = State::armed;
  return first;
}

}  // namespace tether::scene::event

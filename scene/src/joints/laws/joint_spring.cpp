// Tether: springs and dampers of joints, and the forces of motors with gains.
// SPDX-License-Identifier: BSD-3-Clause
//
// Along the angle or way s of a hinge or slider, and each component of the turn of a ball:
//
//   spring   -k (s - rest) - c s',   potential k (s - rest)^2 / 2,   power -c s'^2
//   motor    -k (s - target - rate t) - c (s' - rate), within its bound
//
// A table is a sum of bounded springs or dampers, two for each of its pieces (one for the first):
//
//   between s_a and s_b, with the rise F    -F/2 ... F/2 around (s_a + s_b) / 2, and around minus
//   that
//
// An angle is the one of its turns that is nearest to its rest or target. Steps take the stretch
// and the speed of their end (contact::JointLaws), which is stable for all gains.
#include <tether/linalg/pi.hpp>

#include "bounds.hpp"
#include "joints/coordinate.hpp"
#include "joints/laws/joint_law_effect.hpp"
#include "mechanics/pair_forces.hpp"

namespace tether::scene::effects {

namespace {

/// A spring, or a motor with gains.
struct Gains {
  double stiffness, damping, rest;
  double rate = 0, bound = kInfinity;
  double offset = 0;    // of the stretch
  bool drives = false;  // its force has no potential

  Gains() : stiffness(0), damping(0), rest(0) {}
  explicit Gains(const JointSpring& s) : stiffness(s.stiffness), damping(s.damping), rest(s.rest) {}
  explicit Gains(const JointMotor& m)
      : stiffness(m.stiffness),
        damping(m.damping),
        rest(m.target),
        rate(m.rate),
        bound(m.bound),
        drives(true) {}
};

bool has_spring(const Joint& joint) { return joint.spring.has_value(); }

// f(slope, middle, bound) of each part.
template <class F>
void each_part(const ForceTable& table, const F& f) {
  each_piece(table, [&f](const auto& from, const auto& to) {
    const double rise = to[1] - from[1], middle = (to[0] + from[0]) / 2;
    if (rise > 0 && from[0] > 0) {
      f(slope(from, to), middle, rise / 2);
      f(slope(from, to), -middle, rise / 2);
    } else if (rise > 0) {
      f(slope(from, to), 0.0, rise);
    }
  });
}

// f(gains)
template <class F>
void each_of(const JointSpring& spring, bool turns, const F& f) {
  if (spring.stiffness > 0 || spring.damping > 0) f(Gains(spring));
  if (turns) return;  // the turn of a ball has tables as a whole
  each_part(spring.stiffness_table, [&](double slope, double middle, double bound) {
    Gains part;
    part.stiffness = slope;
    part.rest = spring.rest;
    part.offset = middle;
    part.bound = bound;
    f(part);
  });
  each_part(spring.damping_table, [&](double slope, double middle, double bound) {
    Gains part;
    part.damping = slope;
    part.rate = middle;
    part.bound = bound;
    f(part);
  });
}

// f(joint, its number, gains)
template <class F>
void each_gains(const Scene& scene, const F& f) {
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const Joint& joint = scene.joints[j];
    if (joint.spring)
      each_of(*joint.spring, joints::type(joint.kind).turns_freely(),
              [&](const Gains& gains) { f(joint, j, gains); });
    if (joint.motor && joint.motor->has_gains()) f(joint, j, Gains(*joint.motor));
  }
}

double nearest_turn(double angle) { return std::remainder(angle, 2 * linalg::kPi) - angle; }

/// Gains along one coordinate.
struct Sprung : Gains {
  int first, second;
  std::size_t joint;
  bool turns;  // once around is where it was
  joints::Coordinate coordinate;

  Sprung(const Gains& gains, std::size_t number, bool around, const joints::Coordinate& along)
      : Gains(gains),
        first(along.first()),
        second(along.second()),
        joint(number),
        turns(around),
        coordinate(along) {}

  template <class S>
  S stretch(double t, const Frame<S>& A, const Frame<S>& B) const {
    S out = S(coordinate.value(A, B) - (rest + rate * t));
    if (turns) out += nearest_turn(value_of(out));
    out -= offset;
    return out;
  }
  template <class S>
  S force(double t, const Frame<S>& A, const Frame<S>& B, bool with_damping) const {
    S out(0.0);
    if (stiffness > 0) out -= stiffness * stretch(t, A, B);
    if (with_damping && damping > 0) out -= damping * (coordinate.rate(A, B) - rate);
    if (value_of(out) > bound) return S(bound);
    if (value_of(out) < -bound) return S(-bound);
    return out;
  }

  template <class S>
  void pull(const Bodies& now, const Frame<S>& A, const Frame<S>& B, bool all, Wrench<S>& on_first,
            Wrench<S>& on_second) const {
    if (all || !drives) coordinate.pull(A, B, force(now.time, A, B, all), on_first, on_second);
  }
  double potential(const Bodies& now, const Frame<double>& A, const Frame<double>& B) const {
    if (drives || !(stiffness > 0)) return 0;
    return stored(stretch(now.time, A, B)) - stored(offset);
  }
  double stored(double s) const {
    const double x = std::abs(s), most = bound / stiffness;
    return x < most ? 0.5 * stiffness * x * x : bound * (x - most / 2);
  }
  bool works() const { return drives || damping > 0; }
  template <class S>
  S power(const Bodies& now, const Frame<S>& A, const Frame<S>& B) const {
    const S speed = coordinate.rate(A, B);
    if (drives || !(stiffness > 0)) return S(force(now.time, A, B, true) * speed);
    return S(-damping * speed * speed);
  }
};

struct JointSprings : PairForces<Sprung> {
  JointSprings(const Scene& scene, const Bodies& bodies) {
    each_gains(scene, [&](const Joint& joint, std::size_t number, const Gains& gains) {
      for (const joints::Coordinate& each : joints::coordinates_of(joint, number, bodies))
        push_back(Sprung(gains, number, joints::is_angle(joint), each));
    });
  }
  const char* name() const override { return "joint springs"; }
  // As contact::JointLaws.
  Stepping stepping() const override { return Stepping::by_contact; }
  void report(const Bodies& bodies, Forces& forces) const override {
    for (const Sprung& each : items()) {
      const auto frames = frame_pair(bodies, each);
      const double x = each.force(bodies.time, frames.first, frames.second, true);
      JointForce& force = forces.joints[each.joint];
      const bool angle = each.coordinate.what() == joints::MotionOf::angle;
      (angle ? force.moment : force.force) += x * each.coordinate.direction(bodies);
      if (!each.coordinate.is_component()) force.drive += x;
    }
  }
};

constexpr std::size_t kMostRows = 100;

// Rows of numbers above 0 that grow, and forces that do not fall, the last above 0.
bool is_table(const ForceTable& table) {
  std::array<double, 2> last{0, 0};
  for (const std::array<double, 2>& row : table) {
    if (!(row[0] > last[0] && row[1] >= last[1])) return false;
    last = row;
  }
  return last[1] > 0;
}

void table_fields(const Form& form, const char* gain, const Unit& number, const Unit& force,
                  ForceTable& table) {
  const std::string key = std::string(gain) + "_table";
  form.rows(key, table, kMostRows, number, force);
  Fields* in = form.in();
  if (!in || !in->has(key)) return;
  if (in->has(gain))
    in->wrong(key, fmt::format("give {} or {}, not both", gain, key));
  else if (!is_table(table))
    in->wrong(key, fmt::format("must be an array of up to {} [number above 0, force], numbers that "
                               "grow, forces that do not fall, the last above 0",
                               kMostRows));
}

struct JointSpringEffect : JointLawEffect {
  JointSpringEffect() : JointLawEffect("joint springs", has_spring) {}
  bool has_joint_laws(const Scene&) const override { return false; }
  ActsOn acts_on() const override { return ActsOn::turns; }

  void joint_fields(const Form& form, bool angle, Joint& joint) const override {
    const bool is_free = joints::type(joint.kind).is_free();
    const Unit force = angle ? kMoment : kForce;
    form.table("spring", joint.spring, [&](const Form& in, JointSpring& spring) {
      if (in.in() || spring.stiffness_table.empty()) stiffness(in, angle, spring.stiffness);
      if (in.in() || spring.damping_table.empty()) damping(in, angle, spring.damping);
      table_fields(in, "stiffness", angle ? Unit{} : kMetres, force, spring.stiffness_table);
      table_fields(in, "damping", angle ? kTurning : kSpeed, force, spring.damping_table);
      if (Fields* read = in.in(); read && !(spring.stiffness > 0 || spring.damping > 0) &&
                                  !read->has("stiffness_table") && !read->has("damping_table"))
        read->missing("stiffness", angle ? "give stiffness (N m/rad), damping (N m s/rad) or both"
                                         : "give stiffness (N/m), damping (N s/m) or both");
      if (is_free) in.along(angle, "rest", spring.rest, kMetres);
    });
  }
  void take_lengths(const Scene& scene, Largest& length) const override {
    each_gains(scene, [&](const Joint& joint, std::size_t, const Gains& gains) {
      if (joint.kind == JointKind::slider) length.take(std::abs(gains.rest));
    });
  }
  void take_rates(const Scene& scene, double length, double mass, Largest& rate) const override {
    each_gains(scene, [&](const Joint& joint, std::size_t, const Gains& gains) {
      const double of = joint.kind == JointKind::slider ? mass : mass * length * length;
      rate.take(std::sqrt(gains.stiffness / of));
    });
  }
  void limit_momenta(Momenta& momenta) const override {
    each_gains(momenta.scene, [&](const Joint& joint, std::size_t number, const Gains&) {
      if (momenta.holds_outside(joint.first, joint.second))
        momenta.axes.none("a spring or motor of joint \"" + joints::name_of(joint, number) +
                          "\" holds from outside");
    });
  }
  bool does_work(const Scene& scene) const override {
    bool works = false;
    each_gains(scene, [&](const Joint&, std::size_t, const Gains& gains) {
      works = works || gains.drives || gains.damping > 0;
    });
    return works;
  }
  std::unique_ptr<Force> make_force(const Scene& scene, const Bodies& bodies) const override {
    bool any = false;
    each_gains(scene, [&](const Joint&, std::size_t, const Gains&) { any = true; });
    return any ? std::make_unique<JointSprings>(scene, bodies) : nullptr;
  }
  void add_laws(const Joint& joint, int number, double value, JointLawList& out) const override {
    const auto add = [&](const Gains& gains) {
      double stretch = value - gains.rest - gains.rate * out.time;
      if (joints::is_angle(joint)) stretch += nearest_turn(stretch);
      stretch -= gains.offset;
      out.sprung(number, stretch, gains.stiffness, gains.damping, gains.rate, gains.bound);
    };
    if (joint.spring) each_of(*joint.spring, joints::type(joint.kind).turns_freely(), add);
    if (joint.motor && joint.motor->has_gains()) add(Gains(*joint.motor));
  }
};

}  // namespace

TETHER_EFFECT(joint_spring, JointSpringEffect)

}  // namespace tether::scene::effects

// Tether: springs and dampers of joints, and the forces of motors with gains.
// SPDX-License-Identifier: BSD-3-Clause
//
// Along the angle or way s of a hinge or slider, and each component of the turn of a ball:
//
//   spring   -k (s - rest) - c s',   potential k (s - rest)^2 / 2,   power -c s'^2
//   motor    -k (s - target - rate t) - c (s' - rate), within its bound
//
// An angle is the one of its turns that is nearest to its rest or target. Steps take the stretch
// and the speed of their end (contact::JointLaws), which is stable for all gains.
#include <cmath>
#include <limits>
#include <tether/linalg/pi.hpp>

#include "joints/laws/coordinate.hpp"
#include "joints/laws/joint_law_effect.hpp"
#include "joints/laws/joint_laws.hpp"
#include "mechanics/pair_forces.hpp"

namespace tether::scene::effects {

using namespace mechanics;

namespace {

/// A spring, or a motor with gains.
struct Gains {
  double stiffness, damping, rest;
  double rate = 0, bound = std::numeric_limits<double>::infinity();
  bool drives = false;  // its force has no potential

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

// f(joint, its number, gains)
template <class F>
void each_gains(const Scene& scene, const F& f) {
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const Joint& joint = scene.joints[j];
    if (joint.spring) f(joint, j, Gains(*joint.spring));
    if (joint.motor && joint.motor->has_gains()) f(joint, j, Gains(*joint.motor));
  }
}

double nearest_turn(double angle) { return std::remainder(angle, 2 * linalg::kPi) - angle; }
double number_of(double x) { return x; }
double number_of(const Dual& x) { return x.value(); }

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
    if (turns) out += nearest_turn(number_of(out));
    return out;
  }
  template <class S>
  S force(double t, const Frame<S>& A, const Frame<S>& B, bool with_damping) const {
    S out(0.0);
    if (stiffness > 0) out -= stiffness * stretch(t, A, B);
    if (with_damping && damping > 0) out -= damping * (coordinate.rate(A, B) - rate);
    if (number_of(out) > bound) return S(bound);
    if (number_of(out) < -bound) return S(-bound);
    return out;
  }

  template <class S>
  void pull(double t, const Frame<S>& A, const Frame<S>& B, bool all, Wrench<S>& on_first,
            Wrench<S>& on_second) const {
    if (all || !drives) coordinate.pull(A, B, force(t, A, B, all), on_first, on_second);
  }
  double potential(double t, const Frame<double>& A, const Frame<double>& B) const {
    if (drives || !(stiffness > 0)) return 0;
    const double s = stretch(t, A, B);
    return 0.5 * stiffness * s * s;
  }
  bool works() const { return drives || damping > 0; }
  template <class S>
  S power(double t, const Frame<S>& A, const Frame<S>& B) const {
    const S speed = coordinate.rate(A, B);
    if (drives) return S(force(t, A, B, true) * speed);
    return S(-damping * speed * speed);
  }
};

class JointSprings : public PairForces<Sprung> {
 public:
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

class JointSpringEffect : public JointLawEffect {
 public:
  JointSpringEffect() : JointLawEffect("joint springs", has_spring) {}
  bool has_joint_laws(const Scene&) const override { return false; }
  bool acts_on_turns() const override { return true; }

  void read_joint(files::Fields& in, files::Reader& r, bool angle, Joint& joint) const override {
    const files::Value* table = in.table("spring");
    if (table == nullptr) return;
    files::Fields fields = r.fields(table, in.path() + ": spring");
    JointSpring& spring = joint.spring.emplace();
    read_gains(fields, angle, spring.stiffness, spring.damping);
    if (!(spring.stiffness > 0 || spring.damping > 0))
      fields.missing("stiffness", angle ? "give stiffness (N m/rad), damping (N m s/rad) or both"
                                        : "give stiffness (N/m), damping (N s/m) or both");
    if (joints::type(joint.kind).is_free())
      spring.rest = angle ? fields.angle("rest_", 0) : fields.number("rest", 0, files::kAny, "m");
    fields.finish();
  }
  void write_joint(const Joint& joint, bool angle, files::Writer& out) const override {
    if (!joint.spring) return;
    const JointSpring& s = *joint.spring;
    std::string text = fmt::format("{{ stiffness = {}, damping = {}", files::toml(s.stiffness),
                                   files::toml(s.damping));
    if (joints::type(joint.kind).is_free())
      text += fmt::format(", rest{} = {}", angle ? "_rad" : "", files::toml(s.rest));
    out.raw("spring", text + " }");
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
  void convert(Scene& scene, const Units& units) const override {
    for (Joint& joint : scene.joints) {
      if (!joint.spring) continue;
      const bool slides = joint.kind == JointKind::slider;
      const double stiffness = slides ? units.stiffness() : units.energy();
      joint.spring->stiffness /= stiffness;
      joint.spring->damping /= stiffness * units.time;
      if (slides) joint.spring->rest /= units.length;
    }
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
      out.sprung(number, stretch, gains.stiffness, gains.damping, gains.rate, gains.bound);
    };
    if (joint.spring) add(Gains(*joint.spring));
    if (joint.motor && joint.motor->has_gains()) add(Gains(*joint.motor));
  }
};

}  // namespace

const Effect& joint_spring_effect() {
  static const JointSpringEffect effect;
  return effect;
}

}  // namespace tether::scene::effects

// Tether: springs and dampers between two points. SPDX-License-Identifier: BSD-3-Clause
//
// With d from a point of the first to one of the second body:
//
//   tension k (|d| - rest) + c d|d|/dt along d,   potential k (|d| - rest)^2 / 2,
//   power of the damper -c (d|d|/dt)^2
#include "cable.hpp"

namespace tether::scene::effects {

namespace {

/// A spring in the axes of its bodies.
struct Item {
  std::size_t index;  // of the scene's springs
  int first, second;
  Vector3d at_first, at_second;
  double stiffness, damping, rest;

  template <class S>
  void pull(const Bodies&, const Frame<S>& A, const Frame<S>& B, bool with_damping,
            Wrench<S>& on_first, Wrench<S>& on_second) const;
  double potential(const Bodies&, const Frame<double>& A, const Frame<double>& B) const {
    const double stretch = (point<0>(B, at_second).x - point<0>(A, at_first).x).norm() - rest;
    return 0.5 * stiffness * stretch * stretch;
  }
  bool works() const { return damping > 0; }
  template <class S>
  S power(const Bodies&, const Frame<S>& A, const Frame<S>& B) const;
};

/// Vector from the first to the second point, and its rate.
template <class S>
struct Span {
  Jet<S> a, b;
  Vector3<S> d;

  Span(const Item& each, const Frame<S>& A, const Frame<S>& B)
      : a(point<1>(A, each.at_first)), b(point<1>(B, each.at_second)), d(b.x - a.x) {}
  Vector3<S> rate() const { return b.x1 - a.x1; }
};

template <class S>
void Item::pull(const Bodies&, const Frame<S>& A, const Frame<S>& B, bool with_damping,
                Wrench<S>& on_first, Wrench<S>& on_second) const {
  using std::sqrt;
  const Span<S> span(*this, A, B);
  // Per length of d; a spring without rest length has no direction at d = 0 and needs none.
  S factor(stiffness);
  const bool damps = with_damping && damping > 0;
  if (rest > 0 || damps) {
    const S square = dot(span.d, span.d);
    if (rest > 0) factor -= stiffness * rest / sqrt(square);
    if (damps) factor += damping * dot(span.d, span.rate()) / square;
  }
  Vector3<S> force;
  for (int i = 0; i < 3; ++i) force[i] = factor * span.d[i];
  on_first.add(A, span.a.x, force);
  on_second.add(B, span.b.x, Vector3<S>(-force));
}

template <class S>
S Item::power(const Bodies&, const Frame<S>& A, const Frame<S>& B) const {
  const Span<S> span(*this, A, B);
  const S along = dot(span.d, span.rate());
  return S(-damping * along * along / dot(span.d, span.d));
}

struct SpringForces : PairForces<Item> {
  SpringForces(const std::vector<Spring>& springs, const Bodies& bodies) {
    for (std::size_t i = 0; i < springs.size(); ++i) {
      const Spring& each = springs[i];
      if (each.cable) continue;
      Item item;
      item.index = i;
      item.first = bodies.index(each.first);
      item.second = bodies.index(each.second);
      item.at_first = point_in(bodies.frames[at(item.first)], each.at);
      item.at_second = point_in(bodies.frames[at(item.second)], each.at_second);
      item.stiffness = each.stiffness;
      item.damping = each.damping;
      item.rest = each.rest ? *each.rest : (each.at_second - each.at).norm();
      push_back(item);
    }
  }
  const char* name() const override { return "springs"; }

  void report(const Bodies& bodies, Forces& forces) const override {
    for (const Item& each : items()) {
      const Span<double> span(each, bodies.frames[at(each.first)], bodies.frames[at(each.second)]);
      const double length = span.d.norm();
      const double rate = length > 0 ? span.d.dot(span.rate()) / length : 0;
      report_tension(
          each.index,
          {each.stiffness * (length - each.rest) + each.damping * rate, span.a.x, span.b.x},
          forces);
    }
  }
  void check_step(const Scene& scene, const Bodies& bodies, double dt) const override {
    for (const Item& s : items())
      check_tension_step(
          scene, scene.springs[s.index],
          softness(bodies, s.first, s.at_first) + softness(bodies, s.second, s.at_second), dt);
  }
  // A damper sees the velocities at the end of the last step, which vanish at rest, whatever holds
  // the body; what the forces of this step add, contacts and joints may take away. One after the
  // other: each sees what the other dampers leave.
  void step(SteppedBodies& stepped, double dt) const override {
    const Bodies& bodies = stepped.before_forces();
    for (const Item& each : items()) {
      const Frame<double>&A = bodies.frames[at(each.first)], &B = bodies.frames[at(each.second)];
      if (!(Span<double>(each, A, B).d.squaredNorm() > 0)) continue;  // no direction
      const auto [a, b] = pair_of<double>(bodies, each, {A, B}, false);
      const auto [with_a, with_b] = pair_of<double>(bodies, each, {A, B}, true);
      stepped.push(each.first, dt, a.force, a.torque);
      stepped.push(each.second, dt, b.force, b.torque);
      stepped.damp(each.first, dt, with_a.force - a.force, with_a.torque - a.torque);
      stepped.damp(each.second, dt, with_b.force - b.force, with_b.torque - b.torque);
    }
  }
};

bool damps(const Spring& spring) { return spring.damping > 0; }
bool pulls(const Spring& spring) { return spring.stiffness > 0 || !damps(spring); }

struct SpringEffect : Effect {
  void fields(const Form& root, Scene& scene) const override {
    root.each(
        "spring", scene.springs,
        [](const Form& form, Spring& spring) {
          form.name("spring", spring.name);
          form.bodies(spring.first, spring.second);
          form.points(spring.at, spring.at_second);
          form.number("stiffness", spring.stiffness, kNotNegative, kStiffness);
          form.number("damping", spring.damping, kNotNegative, kDamping);
          form.number("rest", spring.rest, kNotNegative, kMetres);
          form.require_one("stiffness", "damping", "give stiffness (N/m), damping (N s/m) or both");
          return true;
        },
        [](const Spring& each) { return !is_cable(each); });
  }
  void check(const Scene& scene, Report& report) const override {
    std::vector<Spring> springs;
    for (const Spring& each : scene.springs)
      if (!each.cable) springs.push_back(each);
    check_connections(scene, springs, "spring", report);
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    int springs = 0, dampers = 0;
    for (const Spring& each : scene.springs) {
      if (each.cable) continue;
      springs += pulls(each);
      dampers += damps(each);
    }
    add_count(lines, "springs", springs, "spring");
    add_count(lines, "dampers", dampers, "damper");
  }
  void add_columns(const Scene& scene, std::vector<Column>& columns) const override {
    if (!scene.output.forces) return;
    for (std::size_t i = 0; i < scene.springs.size(); ++i)
      columns.push_back(
          {scene.springs[i].name + ".tension_N",
           [i](const Diagnostics&, const Forces& f) { return f.springs[i].tension; }});
  }
  void take_lengths(const Scene& scene, Largest& length) const override {
    for (const Spring& spring : scene.springs) {
      take_arm(scene, spring.first, spring.at, length);
      take_arm(scene, spring.second, spring.at_second, length);
      length.take((spring.at - spring.at_second).norm());
    }
  }
  void take_rates(const Scene& scene, double, double mass, Largest& rate) const override {
    for (const Spring& spring : scene.springs) rate.take(std::sqrt(spring.stiffness / mass));
  }
  void limit_momenta(Momenta& momenta) const override {
    for (const Spring& spring : momenta.scene.springs) {
      if (spring.cable || !momenta.holds_outside(spring.first, spring.second)) continue;
      const std::string what = "spring \"" + spring.name + "\"";
      momenta.push(what);
      const bool second = momenta.is_outside(spring.second);
      momenta.force_through(second ? spring.at_second : spring.at, 1e-12,
                            what + " holds from outside");
    }
  }
  bool does_work(const Scene& scene) const override { return any_of(scene.springs, damps); }
  std::unique_ptr<Force> make_force(const Scene& scene, const Bodies& bodies) const override {
    return all_of(scene.springs, is_cable) ? nullptr
                                           : std::make_unique<SpringForces>(scene.springs, bodies);
  }
};

}  // namespace

TETHER_EFFECT(springs, SpringEffect)

}  // namespace tether::scene::effects

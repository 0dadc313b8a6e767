// Tether: drag. SPDX-License-Identifier: BSD-3-Clause
//
//   force -(linear + quadratic |v|) v at the centre of mass,   torque -rotational w
//
// v: the velocity against the wind.
//
// The stepping engine takes it implicitly, so that any strength is stable.
#include <Eigen/LU>

#include "mechanics/effect.hpp"
#include "mechanics/pair_forces.hpp"

namespace tether::scene::effects {

namespace {

bool has_drag(const Body& body) { return body.drag.has_value(); }

/// The drag of a body, which the world exerts.
struct Dragged {
  int first, second;
  Drag drag;
  Vector3d wind;

  template <class S>
  Vector3<S> against_wind(const Frame<S>& B) const {
    Vector3<S> v = B.v;
    for (int i = 0; i < 3; ++i) v[i] -= wind[i];
    return v;
  }
  /// Force by speed, N s/m.
  template <class S>
  S resistance(const Vector3<S>& v) const {
    using std::sqrt;
    const S square = dot(v, v);
    S out(drag.linear);
    if (square > 0.0) out += drag.quadratic * sqrt(square);
    return out;
  }
  template <class S>
  void pull(const Bodies&, const Frame<S>&, const Frame<S>& B, bool all, Wrench<S>&,
            Wrench<S>& on_second) const {
    if (!all) return;
    const Vector3<S> v = against_wind(B);
    const S slows = resistance(v);
    for (int i = 0; i < 3; ++i) {
      on_second.force[i] -= slows * v[i];
      on_second.torque[i] -= drag.rotational * B.W[i];
    }
  }
  double potential(const Bodies&, const Frame<double>&, const Frame<double>&) const { return 0; }
  bool works() const { return true; }
  template <class S>
  S power(const Bodies&, const Frame<S>&, const Frame<S>& B) const {
    const Vector3<S> v = against_wind(B);
    return S(-resistance(v) * dot(v, B.v) - drag.rotational * dot(B.W, B.W));
  }
};

struct DragForce : PairForces<Dragged> {
  DragForce(const Scene& scene, const Bodies& bodies) {
    for (int b = 0; b < bodies.world(); ++b)
      if (const Body& body = scene.bodies[at(b)]; body.drag && bodies.moves(b))
        push_back({bodies.world(), b, *body.drag, scene.wind.value_or(Vector3d::Zero())});
  }
  const char* name() const override { return "drag"; }
  Stepping stepping() const override { return Stepping::implicit; }

  // (m + dt resistance) v+ = m v against the wind,   (I + dt rotational) w+ = I w in body axes.
  void step(SteppedBodies& stepped, double dt) const override {
    const Bodies& bodies = stepped.bodies();
    for (const Dragged& each : items()) {
      const contact::RigidBody& motion = stepped.motion(each.second);
      const Vector3d before = motion.velocity - each.wind;
      const Vector3d v =
          each.wind + before / (1 + dt * motion.inverse_mass * each.resistance(before));
      Vector3d w = motion.angular_velocity;
      if (each.drag.rotational != 0) {
        const Matrix3d& I = bodies.inertia[at(each.second)].inertia;
        const Matrix3d slowed = I + dt * each.drag.rotational * Matrix3d::Identity();
        w = bodies.frames[at(each.second)].R * (slowed.inverse() * (I * bodies.w[at(each.second)]));
      }
      stepped.set_velocity(each.second, v, w);
    }
  }
};

struct DragEffect : Effect {
  void scene_fields(const Form& form, Scene& scene) const override {
    form.vector("wind", scene.wind, kSpeed);
  }
  void check(const Scene& scene, Report& report) const override {
    if (scene.wind && !does_work(scene))
      report.add({scene.file, 1, 1}, "scene: wind", "", "has no meaning: no body has drag");
  }
  void take_rates(const Scene& scene, double length, double, Largest& rate) const override {
    if (scene.wind) rate.take(scene.wind->norm() / length);
  }
  void body_fields(const Form& form, Body& body) const override {
    form.table("drag", body.drag, [](const Form& in, Drag& drag) {
      in.number("linear", drag.linear, kNotNegative, kDamping);
      in.number("quadratic", drag.quadratic, kNotNegative, {"N s^2/m^2", 1, -1, 0});
      in.number("rotational", drag.rotational, kNotNegative, {"N m s", 1, 2, -1});
    });
  }
  void check_body(const Body& body, Report& report) const override {
    if (body.fixed && body.drag)
      report.add(body.place, fmt::format("body \"{}\": drag", body.name), "",
                 "has no meaning: the body is fixed");
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    add_count(lines, "drag", count_if(scene.bodies, has_drag), "body",
              scene.wind ? ", in a wind" : "");
  }
  void limit_momenta(Momenta& momenta) const override {
    for (const Body& body : momenta.scene.bodies) {
      if (!body.drag || body.fixed) continue;
      const std::string what = "the drag of body \"" + body.name + "\"";
      momenta.push(what);
      momenta.axes.none(what);
    }
  }
  bool does_work(const Scene& scene) const override { return any_of(scene.bodies, has_drag); }
  std::unique_ptr<Force> make_force(const Scene& scene, const Bodies& bodies) const override {
    return does_work(scene) ? std::make_unique<DragForce>(scene, bodies) : nullptr;
  }
};

}  // namespace

TETHER_EFFECT(drag, DragEffect)

}  // namespace tether::scene::effects

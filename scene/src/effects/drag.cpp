// Tether: drag. SPDX-License-Identifier: BSD-3-Clause
//
//   force -(linear + quadratic |v|) v at the centre of mass,   torque -rotational w
//
// v: the velocity against the wind.
//
// The stepping engine takes it implicitly, so that any strength is stable.
#include <Eigen/LU>

#include "mechanics/effect.hpp"

namespace tether::scene::effects {

namespace {

struct Dragged {
  int body;
  Drag drag;
};

bool has_drag(const Body& body) { return body.drag.has_value(); }

/// Force by speed, N s/m.
double resistance(const Drag& drag, double speed) { return drag.linear + drag.quadratic * speed; }

struct DragForce : Force {
  DragForce(std::vector<Dragged> bodies, const Vector3d& wind)
      : bodies_(std::move(bodies)), wind_(wind) {}
  const char* name() const override { return "drag"; }
  Stepping stepping() const override { return Stepping::implicit; }

  void add(const Bodies& bodies, std::vector<Load6>& loads) const override {
    for (const Dragged& each : bodies_) {
      Load6& load = loads[at(bodies.inertia[at(each.body)].slot)];
      const Vector3d v = bodies.frames[at(each.body)].v - wind_;
      load.force -= resistance(each.drag, v.norm()) * v;
      load.torque_body -= each.drag.rotational * bodies.w[at(each.body)];
    }
  }
  void add_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Dragged& each : bodies_) {
      const int slot = bodies.inertia[at(each.body)].slot;
      const Matrix3d D = slope(each.drag, bodies.frames[at(each.body)].v - wind_);
      J.add_block(J.motion_row(slot, 0), kBody * slot + kVelocity, D);
      J.add_block(J.motion_row(slot, 3), kBody * slot + kSpin,
                  each.drag.rotational * Matrix3d::Identity());
    }
  }
  bool has_power() const override { return true; }
  double power(const Bodies& bodies) const override {
    double sum = 0;
    for (const Dragged& each : bodies_) {
      const Vector3d& v = bodies.frames[at(each.body)].v;
      const Vector3d against = v - wind_;
      sum -= resistance(each.drag, against.norm()) * against.dot(v) +
             each.drag.rotational * bodies.w[at(each.body)].squaredNorm();
    }
    return sum;
  }
  void add_power_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Dragged& each : bodies_) {
      const int column = kBody * bodies.inertia[at(each.body)].slot;
      const Vector3d& v = bodies.frames[at(each.body)].v;
      const Vector3d against = v - wind_;
      const Vector3d by_v =
          resistance(each.drag, against.norm()) * against + slope(each.drag, against) * v;
      for (int k = 0; k < 3; ++k) {
        J.add(J.work_row, column + kVelocity + k, by_v[k]);
        J.add(J.work_row, column + kSpin + k,
              2 * each.drag.rotational * bodies.w[at(each.body)][k]);
      }
    }
  }
  // (m + dt resistance) v+ = m v against the wind,   (I + dt rotational) w+ = I w in body axes.
  void step(SteppedBodies& stepped, double dt) const override {
    const Bodies& bodies = stepped.bodies();
    for (const Dragged& each : bodies_) {
      const contact::RigidBody& motion = stepped.motion(each.body);
      const Vector3d before = motion.velocity - wind_;
      const double force = resistance(each.drag, before.norm());
      const Vector3d v = wind_ + before / (1 + dt * motion.inverse_mass * force);
      Vector3d w = motion.angular_velocity;
      if (each.drag.rotational != 0) {
        const Matrix3d& I = bodies.inertia[at(each.body)].inertia;
        const Matrix3d slowed = I + dt * each.drag.rotational * Matrix3d::Identity();
        w = bodies.frames[at(each.body)].R * (slowed.inverse() * (I * bodies.w[at(each.body)]));
      }
      stepped.set_velocity(each.body, v, w);
    }
  }

 private:
  // d(resistance v) / dv
  static Matrix3d slope(const Drag& drag, const Vector3d& v) {
    const double speed = v.norm();
    Matrix3d D = resistance(drag, speed) * Matrix3d::Identity();
    if (speed > 0) D += drag.quadratic / speed * v * v.transpose();
    return D;
  }

  std::vector<Dragged> bodies_;
  Vector3d wind_;
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
    for (const Dragged& each : dragged(momenta.scene)) {
      const std::string what =
          "the drag of body \"" + momenta.scene.bodies[at(each.body)].name + "\"";
      momenta.push(what);
      momenta.axes.none(what);
    }
  }
  bool does_work(const Scene& scene) const override { return any_of(scene.bodies, has_drag); }
  std::unique_ptr<Force> make_force(const Scene& scene, const Bodies&) const override {
    std::vector<Dragged> bodies = dragged(scene);
    return bodies.empty() ? nullptr
                          : std::make_unique<DragForce>(std::move(bodies),
                                                        scene.wind.value_or(Vector3d::Zero()));
  }

 private:
  static std::vector<Dragged> dragged(const Scene& scene) {
    std::vector<Dragged> all;
    for (std::size_t b = 0; b < scene.bodies.size(); ++b)
      if (const Body& body = scene.bodies[b]; body.drag && !body.fixed)
        all.push_back({static_cast<int>(b), *body.drag});
    return all;
  }
};

}  // namespace

TETHER_EFFECT(drag, DragEffect)

}  // namespace tether::scene::effects

// Tether: uniform gravity. SPDX-License-Identifier: BSD-3-Clause
//
//   force m g at the centre of mass,   potential -m g . x
#include "mechanics/effect.hpp"

namespace tether::scene::effects {

namespace {

struct GravityForce : Force {
  GravityForce(const Vector3d& g, const Bodies& bodies) : g_(g) {
    for (int b = 0; b < bodies.world(); ++b)
      if (bodies.moves(b)) bodies_.push_back(b);
  }
  const char* name() const override { return "gravity"; }
  Stepping stepping() const override { return Stepping::by_contact; }

  void add(const Bodies& bodies, std::vector<Load6>& loads) const override {
    for (const int b : bodies_) {
      const Inertia& inertia = bodies.inertia[at(b)];
      loads[at(inertia.slot)].force += inertia.mass * g_;
    }
  }
  double potential(const Bodies& bodies) const override {
    double sum = 0;
    for (const int b : bodies_) sum -= bodies.inertia[at(b)].mass * g_.dot(bodies.frames[at(b)].x);
    return sum;
  }
  void add_potential_gradient(const Bodies& bodies, double* row) const override {
    for (const int b : bodies_) {
      const Inertia& inertia = bodies.inertia[at(b)];
      for (int k = 0; k < 3; ++k) row[kBody * inertia.slot + k] -= inertia.mass * g_[k];
    }
  }

 private:
  Vector3d g_;
  std::vector<int> bodies_;  // those that move
};

struct Gravity : Effect {
  void scene_fields(const Form& form, Scene& scene) const override {
    form.vector("gravity", scene.gravity, kAcceleration);
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    if (!scene.gravity) return;
    const Vector3d& g = *scene.gravity;
    lines.push_back({"gravity", fmt::format("[{}, {}, {}] m/s^2", g.x(), g.y(), g.z())});
  }
  void take_rates(const Scene& scene, double length, double, Largest& rate) const override {
    if (scene.gravity) rate.take(std::sqrt(scene.gravity->norm() / length));
  }
  void limit_momenta(Momenta& momenta) const override {
    const Scene& scene = momenta.scene;
    if (!scene.gravity) return;
    for (const Body& body : scene.bodies)
      if (!body.fixed) momenta.steady_force += body.mass * *scene.gravity;
    if (scene.gravity->norm() > 0)
      momenta.axes.only(scene.gravity->normalized(),
                        "gravity leaves the direction of its own only");
  }
  std::unique_ptr<Force> make_force(const Scene& scene, const Bodies& bodies) const override {
    return scene.gravity ? std::make_unique<GravityForce>(*scene.gravity, bodies) : nullptr;
  }
  void configure(const Scene& scene, contact::SteppingOptions& options) const override {
    options.gravity = scene.gravity;
  }
};

}  // namespace

TETHER_EFFECT(gravity, Gravity)

}  // namespace tether::scene::effects

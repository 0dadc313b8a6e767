// Tether: attraction by points at rest. SPDX-License-Identifier: BSD-3-Clause
//
// With r from the point to the centre of mass and the gravitational parameter GM:
//
//   force -GM m r / |r|^3 at the centre of mass,   potential -GM m / |r|
//
// A body is attracted as if all of its mass were at its centre; gravity_gradient.cpp has what its
// extent adds.
#include "mechanics/effect.hpp"

namespace tether::scene::effects {

namespace {

struct CentralGravityForce : Force {
  CentralGravityForce(std::vector<CentralGravity> centres, const Bodies& bodies)
      : centres_(std::move(centres)) {
    for (int b = 0; b < bodies.world(); ++b)
      if (bodies.moves(b)) bodies_.push_back(b);
  }
  const char* name() const override { return "central gravity"; }

  void add(const Bodies& bodies, std::vector<Load6>& loads) const override {
    each(bodies, [&](const Inertia& inertia, const Vector3d& r, double strength) {
      const double distance = r.norm();
      loads[at(inertia.slot)].force -= strength / (distance * distance * distance) * r;
    });
  }
  void add_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    each(bodies, [&](const Inertia& inertia, const Vector3d& r, double strength) {
      const double distance = r.norm();
      const Vector3d u = r / distance;
      J.add_block(J.motion_row(inertia.slot, 0), kBody * inertia.slot + kPosition,
                  strength / (distance * distance * distance) *
                      (Matrix3d::Identity() - 3.0 * u * u.transpose()));
    });
  }
  double potential(const Bodies& bodies) const override {
    double sum = 0;
    each(bodies,
         [&](const Inertia&, const Vector3d& r, double strength) { sum -= strength / r.norm(); });
    return sum;
  }
  void add_potential_gradient(const Bodies& bodies, double* row) const override {
    each(bodies, [&](const Inertia& inertia, const Vector3d& r, double strength) {
      const double distance = r.norm();
      const Vector3d gradient = strength / (distance * distance * distance) * r;
      for (int k = 0; k < 3; ++k) row[kBody * inertia.slot + kPosition + k] += gradient[k];
    });
  }

 private:
  // f(inertia, r, GM m)
  template <class F>
  void each(const Bodies& bodies, const F& f) const {
    for (const CentralGravity& centre : centres_)
      for (const int b : bodies_) {
        const Inertia& inertia = bodies.inertia[at(b)];
        f(inertia, Vector3d(bodies.frames[at(b)].x - centre.at),
          centre.gravitational_parameter * inertia.mass);
      }
  }

  std::vector<CentralGravity> centres_;
  std::vector<int> bodies_;  // those that move
};

struct CentralGravityEffect : Effect {
  void fields(const Form& root, Scene& scene) const override {
    root.each("central_gravity", scene.central_gravity,
              [](const Form& form, CentralGravity& centre) {
                form.vector("at", centre.at, kMetres);
                form.require("gravitational_parameter", "G times the mass of the centre, m^3/s^2");
                form.number("gravitational_parameter", centre.gravitational_parameter, kNotNegative,
                            {"m^3/s^2", 0, 3, -2});
                form.flag("gradient", centre.gradient);
                return true;
              });
  }
  void check(const Scene& scene, Report& report) const override {
    for (const CentralGravity& centre : scene.central_gravity)
      for (const Body& body : scene.bodies)
        if (!body.fixed && body.position == centre.at)
          report.add(centre.place, "central_gravity: at",
                     fmt::format("[{}, {}, {}]", centre.at.x(), centre.at.y(), centre.at.z()),
                     fmt::format("must not be the centre of body \"{}\", which moves: the "
                                 "attraction is infinite there",
                                 body.name));
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    add_count(lines, "central gravity", scene.central_gravity.size(), "centre");
  }
  void take_lengths(const Scene& scene, Largest& length) const override {
    each(scene, [&](double distance, double) { length.take(distance); });
  }
  void take_rates(const Scene& scene, double, double, Largest& rate) const override {
    each(scene, [&](double distance, double parameter) {
      rate.take(std::sqrt(parameter / (distance * distance * distance)));
    });
  }
  void limit_momenta(Momenta& momenta) const override {
    for (const CentralGravity& centre : momenta.scene.central_gravity) {
      momenta.push("central gravity");
      momenta.force_through(centre.at, 0.0, "central gravity is not about the origin");
    }
  }
  std::unique_ptr<Force> make_force(const Scene& scene, const Bodies& bodies) const override {
    if (scene.central_gravity.empty()) return nullptr;
    return std::make_unique<CentralGravityForce>(scene.central_gravity, bodies);
  }

 private:
  // f(distance of a moving body at t = 0, GM)
  template <class F>
  static void each(const Scene& scene, const F& f) {
    for (const CentralGravity& centre : scene.central_gravity)
      for (const Body& body : scene.bodies)
        if (!body.fixed) f((body.position - centre.at).norm(), centre.gravitational_parameter);
  }
};

}  // namespace

TETHER_EFFECT(central_gravity, CentralGravityEffect)

}  // namespace tether::scene::effects

// Tether: attraction by points at rest. SPDX-License-Identifier: BSD-3-Clause
//
// With r from the point to the centre of mass and the gravitational parameter GM:
//
//   force -GM m r / |r|^3 at the centre of mass,   potential -GM m / |r|
//
// A body is attracted as if all of its mass were at its centre. With `gradient` MacCullagh's term
// adds what its extent does, u = r / |r|, the inertia I about the centre of mass:
//
//   potential -GM (tr I - 3 u.I u) / (2 |r|^3),   torque 3 GM u x I u / |r|^3,
//   force -(3 GM / |r|^4) ((tr I - 5 u.I u) u / 2 + I u)
//
// Terms that are left out are of the order of (size of the body / |r|)^3 of the attraction.
#include <cmath>

#include "mechanics/effect.hpp"
#include "mechanics/pair_forces.hpp"

namespace tether::scene::effects {

namespace {

/// A centre, which the world carries, and a body.
struct Attraction {
  int first, second;
  CentralGravity centre;
  Inertia of;

  template <class S>
  void pull(const Bodies&, const Frame<S>&, const Frame<S>& B, bool, Wrench<S>&,
            Wrench<S>& on_second) const {
    using std::sqrt;
    Vector3<S> u = B.x;
    for (int i = 0; i < 3; ++i) u[i] -= centre.at[i];
    const S square = dot(u, u);
    const S distance = sqrt(square);
    const S strength = S(centre.gravitational_parameter * of.mass / (distance * square));
    for (int i = 0; i < 3; ++i) {
      on_second.force[i] -= strength * u[i];
      u[i] /= distance;
    }
    if (!centre.gradient) return;
    const Vector3<S> local = transposed_times(B.R, u), Iu = times(B.R, inertia_times(local));
    const S torque = S(3 * centre.gravitational_parameter / (distance * square));
    const S force = S(torque / distance);
    const S radial = S(0.5 * (of.inertia.trace() - 5.0 * dot(u, Iu)));
    const Vector3<S> turn = cross(u, Iu);
    for (int i = 0; i < 3; ++i) {
      on_second.force[i] -= force * (radial * u[i] + Iu[i]);
      on_second.torque[i] += torque * turn[i];
    }
  }
  double potential(const Bodies&, const Frame<double>&, const Frame<double>& B) const {
    const Vector3d r = B.x - centre.at;
    const double distance = r.norm();
    double masses = of.mass;
    if (centre.gradient) {
      const Vector3d u = B.R.transpose() * r / distance;
      masses += (of.inertia.trace() - 3 * u.dot(of.inertia * u)) / (2 * distance * distance);
    }
    return -centre.gravitational_parameter * masses / distance;
  }
  bool works() const { return false; }
  template <class S>
  S power(const Bodies&, const Frame<S>&, const Frame<S>&) const {
    return S(0.0);
  }

 private:
  template <class S>
  Vector3<S> inertia_times(const Vector3<S>& u) const {
    Vector3<S> out;
    for (int i = 0; i < 3; ++i)
      out[i] = u[0] * of.inertia(i, 0) + u[1] * of.inertia(i, 1) + u[2] * of.inertia(i, 2);
    return out;
  }
};

struct CentralGravityForce : PairForces<Attraction> {
  CentralGravityForce(const Scene& scene, const Bodies& bodies) {
    for (const CentralGravity& centre : scene.central_gravity)
      for (int b = 0; b < bodies.world(); ++b)
        if (bodies.moves(b)) push_back({bodies.world(), b, centre, bodies.inertia[at(b)]});
  }
  const char* name() const override { return "central gravity"; }
};

bool has_gradient(const CentralGravity& centre) { return centre.gradient; }

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
    add_count(lines, "gravity gradient", count_if(scene.central_gravity, has_gradient), "centre");
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
    return std::make_unique<CentralGravityForce>(scene, bodies);
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

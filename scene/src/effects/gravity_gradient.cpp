// Tether: what the extent of bodies adds to central gravity. SPDX-License-Identifier:
// BSD-3-Clause
//
// MacCullagh's term. With r from the point, u = r / |r|, the inertia I about the centre of mass:
//
//   potential -GM (tr I - 3 u.I u) / (2 |r|^3),   torque 3 GM u x I u / |r|^3,
//   force -(3 GM / |r|^4) ((tr I - 5 u.I u) u / 2 + I u)
//
// Terms that are left out are of the order of (size of the body / |r|)^3 of central gravity.
#include <algorithm>
#include <cmath>

#include "mechanics/effect.hpp"
#include "mechanics/pair_forces.hpp"

namespace tether::scene::effects {

namespace {

/// A centre, which the world carries, and a body.
struct GradientItem {
  int first, second;
  Vector3d centre;
  double parameter, trace;
  Matrix3d inertia;

  template <class S>
  void pull(double, const Frame<S>&, const Frame<S>& B, bool, Wrench<S>&,
            Wrench<S>& on_second) const {
    using std::sqrt;
    Vector3<S> u = B.x;
    for (int i = 0; i < 3; ++i) u[i] -= centre[i];
    const S square = dot(u, u);
    const S distance = sqrt(square);
    for (int i = 0; i < 3; ++i) u[i] /= distance;
    const Vector3<S> local = transposed_times(B.R, u);
    Vector3<S> Iu = local;
    for (int i = 0; i < 3; ++i)
      Iu[i] = local[0] * inertia(i, 0) + local[1] * inertia(i, 1) + local[2] * inertia(i, 2);
    Iu = times(B.R, Iu);
    const S torque = S(3 * parameter / (distance * square));
    const S force = S(torque / distance);
    const S radial = S(0.5 * (trace - 5.0 * dot(u, Iu)));
    const Vector3<S> turn = cross(u, Iu);
    for (int i = 0; i < 3; ++i) {
      on_second.force[i] -= force * (radial * u[i] + Iu[i]);
      on_second.torque[i] += torque * turn[i];
    }
  }
  double potential(double, const Frame<double>&, const Frame<double>& B) const {
    const Vector3d r = B.x - centre;
    const double distance = r.norm();
    const Vector3d u = B.R.transpose() * r / distance;
    return -parameter * (trace - 3 * u.dot(inertia * u)) / (2 * distance * distance * distance);
  }
  bool works() const { return false; }
  template <class S>
  S power(double, const Frame<S>&, const Frame<S>&) const {
    return S(0.0);
  }
};

struct GradientForces : PairForces<GradientItem> {
  GradientForces(const Scene& scene, const Bodies& bodies) {
    for (const CentralGravity& centre : scene.central_gravity)
      for (int b = 0; centre.gradient && b < bodies.world(); ++b) {
        const Inertia& inertia = bodies.inertia[at(b)];
        if (bodies.moves(b))
          push_back({bodies.world(), b, centre.at, centre.gravitational_parameter,
                     inertia.inertia.trace(), inertia.inertia});
      }
  }
  const char* name() const override { return "gravity gradient"; }
};

bool has_gradient(const CentralGravity& centre) { return centre.gradient; }

struct GravityGradientEffect : Effect {
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    add_count(lines, "gravity gradient", count_if(scene.central_gravity, has_gradient), "centre");
  }
  std::unique_ptr<Force> make_force(const Scene& scene, const Bodies& bodies) const override {
    return any_of(scene.central_gravity, has_gradient)
               ? std::make_unique<GradientForces>(scene, bodies)
               : nullptr;
  }
};

}  // namespace

TETHER_EFFECT(gravity_gradient, GravityGradientEffect)

}  // namespace tether::scene::effects

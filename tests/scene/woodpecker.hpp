// Glocker's woodpecker toy as a scene. SPDX-License-Identifier: BSD-3-Clause
//
// C. Glocker, "Set-valued force laws" (2001), section 13: the height y of a sleeve with play on a
// pole, its angle phi_M and that of the bird on its spring, phi_S. Ways and heights are linear in
// the small angles: couplings say so. The points that touch have masses; the others are what is
// left of his mass matrix.
#pragma once

#include "event/driver.hpp"
#include "event/model/model.hpp"
#include "event_runs.hpp"
#include "smooth/units.hpp"

namespace woodpecker {

using event_runs::number;
using tether::scene::BodyState;
using tether::scene::Scene;

constexpr double mS = 4.5e-3, JS = 7e-7, mM = 3e-4, JM = 5e-9;
constexpr double r0 = 0.0025, rM = 0.0031, hM = 0.0058, lM = 0.010, lG = 0.015, hS = 0.02,
                 lS = 0.0201, c = 0.0056;
constexpr double kSleeveAngle = -.0006 / .0058, kBirdAngle = -.2788;  // at the start
constexpr double kSpeed = -.3411, kBirdSpin = -7.4583;

inline std::string vector(double x, double y, double z) {
  return "[" + number(x) + ", " + number(y) + ", " + number(z) + "]";
}

inline std::string body(const std::string& name, double mass, double inertia, double x, double vx,
                        double vz, double spin = 0) {
  return "[[body]]\nname = \"" + name + "\"\nmass = " + number(mass) +
         "\ninertia = " + vector(inertia, inertia, inertia) + "\nposition = " + vector(x, 0, 0) +
         "\nvelocity = " + vector(vx, 0, vz) + "\nangular_velocity = " + vector(0, spin, 0) + "\n";
}

inline std::string point(const std::string& material) {
  return "shape = \"points\"\npoints = [[0, 0, 0]]\nmaterial = \"" + material + "\"\n";
}

inline std::string wall(const std::string& name, double x, double normal) {
  return "[[body]]\nname = \"" + name + "\"\nshape = \"plane\"\nfixed = true\nmaterial = \"" +
         name + "\"\nposition = " + vector(x, 0, 0) + "\nnormal = " + vector(normal, 0, 0) + "\n";
}

inline std::string joint(const std::string& first, const std::string& second,
                         const std::string& kind, const std::string& axis) {
  return "[[joint]]\nname = \"" + first + "\"\nkind = \"" + kind + "\"\nbodies = [\"" + first +
         "\", \"" + second + "\"]\nat = [0, 0, 0]\naxis = " + axis + "\n";
}

/// Its way is this sum of both angles. The bird's turn is relative to the sleeve.
inline std::string slider(const std::string& first, const std::string& second,
                          const std::string& axis, double of_sleeve, double of_bird) {
  std::string joints = "\"" + first + "\", \"sleeve\"";
  std::string weights = "-1, " + number(of_sleeve + of_bird);
  if (of_bird != 0) joints += ", \"bird\"", weights += ", " + number(of_bird);
  return joint(first, second, "slider", axis) + "[[coupling]]\njoints = [" + joints +
         "]\nweights = [" + weights + "]\n";
}

inline Scene scene() {
  constexpr double small = 3e-5, edge = 1e-4, beak = 2e-4, turning = 1e-9;
  constexpr double weight = mS - edge * rM / lM - beak, lW = (mS * lG - beak * (lG - lS)) / weight;
  constexpr double sleeve = JM + edge * rM * (lM - rM) - (small + edge) * hM * hM;
  constexpr double bird = JS + mS * lG * lG - beak * (lG - lS) * (lG - lS) - weight * lW * lW -
                          (small + beak) * hS * hS;
  constexpr double guide = mM - edge * (1 - rM / lM) - 4 * small;
  const std::string x = "[1, 0, 0]", y = "[0, 1, 0]", z = "[0, 0, 1]";
  const double at_edge = hM * kSleeveAngle, at_beak = lM + lG - lS - rM - hS * kBirdAngle;
  return tether::scene::parse_scene(
      "[scene]\ngravity = [0, 0, -9.81]\nengine = \"event\"\n" + wall("pole", r0 - rM, 1) +
          wall("back", rM - r0, -1) + body("guide", guide, turning, 0, 0, kSpeed) +
          joint("guide", "world", "slider", z) + body("sleeve", small, sleeve, 0, 0, kSpeed) +
          joint("sleeve", "guide", "hinge", y) +
          body("bird", small, bird, 0, 0, kSpeed, kBirdSpin) + joint("bird", "sleeve", "hinge", y) +
          "spring = { stiffness = " + number(c) +
          ", rest_rad = " + number(kSleeveAngle - kBirdAngle) + " }\n" +
          body("weight", weight, turning, 0, 0, kSpeed + lW * kBirdSpin) +
          slider("weight", "guide", z, lM, lW) +
          body("edge rod", small, turning, at_edge, 0, kSpeed) +
          slider("edge rod", "guide", x, hM, 0) + body("edge", edge, turning, at_edge, 0, kSpeed) +
          point("edge") + slider("edge", "edge rod", z, rM, 0) +
          body("beak rod", small, turning, at_beak, -hS * kBirdSpin, kSpeed) +
          slider("beak rod", "guide", x, 0, -hS) +
          body("beak", beak, turning, at_beak, -hS * kBirdSpin, kSpeed + (lG - lS) * kBirdSpin) +
          point("beak") + slider("beak", "beak rod", z, lM, lG - lS) + R"(
[[pair]]
between = ["edge", "pole"]
friction = 0.3
[[pair]]
between = ["edge", "back"]
friction = 0.3
[[pair]]
between = ["beak", "pole"]
friction = 0.3
restitution = 0.5
[[pair]]
between = ["beak", "back"]
touch = false
[[pair]]
between = ["beak", "edge"]
touch = false
)",
      "woodpecker");
}

/// It in motion, in its units.
struct Woodpecker {
  Scene given = scene();
  tether::scene::Units units = tether::scene::event::units_of(given);
  Scene in_units = tether::scene::event::scaled(given, units);
  tether::scene::event::Model model{in_units, units.time, units.length};
  double first_energy = model.energy();
  tether::scene::event::Driver driver;

  explicit Woodpecker(double tolerance) : driver(model, options(tolerance), 0, model.start()) {}
  static tether::scene::event::DriverOptions options(double tolerance) {
    tether::scene::event::DriverOptions out;
    out.tolerance = tolerance;
    return out;
  }
  /// y, phi_M and phi_S at t.
  Eigen::Vector3d advanced_to(double t) {
    driver.advance(t / units.time);
    driver.state();
    std::vector<BodyState> bodies(given.bodies.size());
    model.bodies().read(model.bodies_state(), bodies);
    const auto turn = [&](std::size_t b) { return 2 * std::asin(bodies[b].orientation.y()); };
    return {units.length * bodies[2].position.z(), kSleeveAngle + turn(3), kBirdAngle + turn(4)};
  }
};

}  // namespace woodpecker

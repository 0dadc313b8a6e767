// Frictionless spheres, for counts of instructions. SPDX-License-Identifier: BSD-3-Clause
//
//   spheres_... [settle | zero | free]
//
// settle: 64 spheres fall onto a plane and onto each other, 200 steps. zero: the same, with every
// effect that can be named without strength. free: no materials meet. Prints the positions' sum,
// all digits.
#include <cstdio>
#include <string>
#include <tether/contact/stepping.hpp>
#include <utility>

namespace tc = tether::contact;
using Eigen::Vector3d;

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "settle";
  tc::BodySet bodies;
  std::vector<tc::Surface> surfaces;
  surfaces.push_back({bodies.add_fixed(Vector3d::Zero()), tc::Shape::plane({0, 0, 1}), 1});
  for (int k = 0; k < 64; ++k) {
    const Vector3d at(0.21 * (k % 4) + 0.003 * (k % 7), 0.21 * (k / 4 % 4) - 0.002 * (k % 5),
                      0.11 + 0.22 * (k / 16));
    const int ball = bodies.add(1, 0.004 * Eigen::Matrix3d::Identity(), at);
    surfaces.push_back({ball, tc::Shape::sphere(0.1), 0});
  }
  tc::SteppingOptions options;
  options.step = 5e-3;
  options.gravity = Vector3d(0, 0, -9.81);
  options.tolerance = 1e-3;
  std::vector<tc::Meeting> meetings = {{0, 0, 0, 0}, {0, 1, 0, 0}};
  if (what == "free") meetings.clear();
  tc::Stepper stepper(std::move(bodies), std::move(surfaces), std::move(meetings), options);
  // A force of no strength.
  if (what == "zero")
    stepper.add_force("load", [](tc::BodySet& b, double, double dt) {
      for (tc::RigidBody& body : b.motion)
        body.velocity += dt * body.inverse_mass * Vector3d::Zero();
    });
  for (int k = 0; k < 200; ++k) stepper.step();
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& x : stepper.bodies().position) sum += x;
  std::printf("%.17g %.17g %.17g contacts %zu unsolved %ld\n", sum[0], sum[1], sum[2],
              stepper.contacts().points.size(), stepper.counts().unsolved);
  return stepper.counts().unsolved == 0 ? 0 : 1;
}

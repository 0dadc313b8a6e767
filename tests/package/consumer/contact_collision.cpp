// Smallest user of tether::contact_collision: a box comes to rest on a box.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdio>
#include <tether/contact/polyhedra.hpp>
#include <tether/contact/stepping.hpp>

bool use_contact_collision() {
  namespace tc = tether::contact;
  tc::BodySet bodies;
  const Eigen::Matrix3d inertia = Eigen::Vector3d::Constant(1.0 / 6).asDiagonal();
  bodies.add_fixed(Eigen::Vector3d(0, 0, -0.5));
  bodies.add(1.0, inertia, Eigen::Vector3d(0, 0, 0.52));
  tc::Surface box;
  box.shape = tc::Shape::box(Eigen::Vector3d::Ones());
  std::vector<tc::Surface> surfaces(2, box);
  surfaces[1].body = 1;
  tc::SteppingOptions options;
  options.gravity = Eigen::Vector3d(0, 0, -9.81);
  tc::Meeting meeting;
  meeting.friction = 0.5;
  tc::Stepper stepper(bodies, surfaces, {meeting}, options, tc::make_polyhedra());
  for (int k = 0; k < 300; ++k) stepper.step();
  std::printf("%zu contacts, height %.9f\n", stepper.contacts().points.size(),
              stepper.bodies().position[1].z());
  return stepper.contacts().points.size() == 4 &&
         std::fabs(stepper.bodies().position[1].z() - 0.5) < 1e-6;
}

// The equations of motion of jointed scenes against differences. SPDX-License-Identifier:
// BSD-3-Clause
#include <cmath>
#include <smooth/system.hpp>
#include <tether/scene/words.hpp>

#include "mechanisms.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using namespace mechanisms;
using smooth::Entries;
using smooth::System;

namespace {

// Everything in one scene: all joints, drives, springs, drag, loads, invariants.
Scene everything() {
  Scene s = scene(1e-6);
  s.gravity = Vector3d(0.3, -1, -9);
  for (int i = 0; i < 7; ++i) {
    Body body = rod("body " + std::to_string(i), {0.1 * i, 0.3 * i, 0}, {1 + 0.2 * i, 0, 0.5});
    body.inertia << 2, 0.1, 0.2, 0.1, 3, 0.3, 0.2, 0.3, 4;
    s.bodies.push_back(body);
  }
  Motion motion;
  motion.rate = 0.2;
  motion.amplitude = 0.3;
  motion.frequency = 0.4;
  s.joints.push_back(hinge(0, kWorld, {0, 0.2, 0}, {1, 2, 3}));
  s.joints.back().motion = motion;
  s.joints.push_back(hinge(1, 0, {0.5, 0.2, 1}, {1, -2, 0.5}));
  s.joints.push_back(joint(JointKind::slider, 2, 1, {1, 1, 0}));
  s.joints.back().axis = {1, 1, 0};
  s.joints.push_back(joint(JointKind::slider, 3, 2, {1, 0, 0}));
  s.joints.back().motion = motion;
  s.joints.push_back(joint(JointKind::ball, 4, 3, {1, 0.4, 0}));
  s.joints.push_back(joint(JointKind::distance, 4, 5, {1, 0.7, 0}, {2, 0, 0.3}));
  s.joints.back().motion = motion;
  s.joints.push_back(joint(JointKind::fixed, 5, 6, {1, 0.1, 0}));
  s.joints.push_back(joint(JointKind::universal, 6, 0, {0.3, 0.1, 0.2}));
  s.joints.back().axis = {1, 2, -1};
  s.joints.back().axis_second = {1, 0, 1};
  Spring spring;
  spring.first = 1;
  spring.second = 5;
  spring.at = {0.1, 0.2, 0.3};
  spring.at_second = {1, 1, 1};
  spring.stiffness = 3;
  spring.damping = 0.5;
  s.springs.push_back(spring);
  spring.second = kWorld;
  spring.rest = 0;
  spring.damping = 0;
  s.springs.push_back(spring);
  // Twice on one body, and twice through the world.
  spring.second = 4;
  spring.rest = 0.5;
  spring.stiffness = 2;
  spring.damping = 0.4;
  spring.cable = Cable{{{2, Vector3d(0.3, 1, 0.2)},
                        {kWorld, Vector3d(2, 1, -1)},
                        {6, Vector3d(1, 2, 0.7)},
                        {6, Vector3d(0.2, 1.5, 0.4)},
                        {2, Vector3d(1, 0.5, 0.1)},
                        {kWorld, Vector3d(-1, 1, -2)}},
                       -0.3};
  s.springs.push_back(spring);
  s.bodies[2].drag.emplace();
  s.bodies[2].drag->linear = 0.3;
  s.bodies[2].drag->quadratic = 0.2;
  s.bodies[2].drag->rotational = 0.1;
  s.central_gravity.push_back({Vector3d(-1, 2, 3), 1.5, {}, true});
  s.wind = Vector3d(0.4, -0.3, 0.2);
  s.loads.push_back({3, Vector3d(1, 2, 3), Vector3d(3, -2, 1), {}});
  s.loads.push_back({1, Vector3d(2, -1, 1), Vector3d(1, 2, -1), {}, {}, true});
  keep_energy(s);
  return s;
}

// A point off the constraints, so that every term counts.
Eigen::VectorXd somewhere(const System& system, double seed) {
  Eigen::VectorXd y = system.start_state();
  for (int i = 0; i < y.size(); ++i) y[i] += 0.2 * std::sin(seed + 1.7 * i * i);
  return y;
}

}  // namespace

TEST_CASE("Jacobian of the residual against central differences", "[smooth]") {
  for (const Formulation form : {Formulation::index1, Formulation::index0}) {
    Scene s = everything();
    s.smooth->formulation = form;
    System system(s);
    const int N = system.size();
    Eigen::VectorXd y = somewhere(system, 0.3);
    Eigen::VectorXd yp = somewhere(system, 1.1);
    const double t = 0.7, cj = 2.5;

    Entries entries;
    entries.record();
    system.jacobian(t, cj, y.data(), yp.data(), entries);
    std::vector<int> slots;
    for (const auto& [row, column] : entries.places) slots.push_back(row + N * column);
    entries.finish(slots);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(N, N);
    entries.begin(J.data());
    system.jacobian(t, cj, y.data(), yp.data(), entries);

    Eigen::VectorXd high(N), low(N);
    for (int j = 0; j < N; ++j) {
      const double h = 1e-5;
      Eigen::VectorXd a = y, b = y, ap = yp, bp = yp;
      a[j] += h;
      b[j] -= h;
      ap[j] += cj * h;
      bp[j] -= cj * h;
      system.residual(t, a.data(), ap.data(), high.data(), nullptr);
      system.residual(t, b.data(), bp.data(), low.data(), nullptr);
      const Eigen::VectorXd difference = (high - low) / (2 * h);
      int worst = 0;
      const double error = (difference - J.col(j)).cwiseAbs().maxCoeff(&worst);
      INFO(word(form) << ", row " << worst << ", column " << j << ": " << J(worst, j) << ", not "
                      << difference[worst]);
      CHECK(error < 1e-6 * (10 + difference.cwiseAbs().maxCoeff()));
    }
  }
}

TEST_CASE("Jacobian of the projected rows against differences", "[smooth]") {
  for (int kind = 0; kind < 2; ++kind) {
    Scene s = kind == 0 ? everything() : top({1, 2, 3}, 1e-6);
    if (kind == 1) {
      s.bodies.push_back(s.bodies[0]);
      s.bodies[1].position = {1, 2, 3};
      s.invariants.push_back({InvariantKind::momentum, true, {}});
    }
    System system(s);
    const Eigen::VectorXd y = somewhere(system, 0.3);
    const auto report = tether::ida_projection::check_jacobian(
        system.constraints(), 0.7, std::vector<double>(y.data(), y.data() + y.size()));
    INFO(report.message);
    CHECK(report.correct);
  }
}

TEST_CASE("rates of the rows are their time derivatives", "[smooth]") {
  // Along x' = v, q' = q (0, w) / 2 with constant velocities: d(position)/dt is the velocity row.
  Scene s = everything();
  System system(s);
  const Eigen::VectorXd y = somewhere(system, 0.3);
  Eigen::VectorXd yp = Eigen::VectorXd::Zero(y.size());
  Eigen::VectorXd r(y.size());
  system.residual(0.7, y.data(), yp.data(), r.data(), nullptr);
  for (int k = 0; k < system.moving(); ++k) yp.segment<7>(13 * k) = -r.segment<7>(13 * k);
  const int m = system.rows();
  const double h = 1e-5;
  Eigen::VectorXd now(2 * m), high(2 * m), low(2 * m);
  const Eigen::VectorXd a = y + h * yp, b = y - h * yp;
  system.joint_values(0.7 + h, a.data(), high.data());
  system.joint_values(0.7 - h, b.data(), low.data());
  system.joint_values(0.7, y.data(), now.data());
  CHECK(((high - low).head(m) / (2 * h) - now.tail(m)).cwiseAbs().maxCoeff() < 1e-8);

  // And the acceleration row (with w' = 0, v' = 0) is the derivative of the velocity row.
  system.residual(0.7, y.data(), yp.data(), r.data(), nullptr);
  Eigen::VectorXd without = y;
  without.tail(m).setZero();  // multipliers add eps lambda
  system.residual(0.7, without.data(), yp.data(), r.data(), nullptr);
  CHECK(((high - low).tail(m) / (2 * h) - r.tail(m)).cwiseAbs().maxCoeff() < 1e-7);
}

// A program that owns, copies and frees what tether::contact made, and uses Eigen by itself. It is
// compiled with other flags than the library, without optimisation, so that Eigen's functions are
// symbols which the linker could mix. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdio>
#include <tether/contact.hpp>
#include <vector>

namespace tc = tether::contact;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// Storage that grows, products and fixed sizes, as a library holds them, too.
bool eigen_of_its_own() {
  VectorXd x = VectorXd::Ones(7);
  for (int n = 8; n < 200; n += 13) x.conservativeResize(n);
  MatrixXd A = MatrixXd::Identity(40, 40) * 3;
  A.resize(60, 60);
  A.setConstant(0.5);
  const VectorXd b = A * VectorXd::Ones(60);
  std::vector<Eigen::Quaterniond> turns(9, Eigen::Quaterniond::Identity());
  return x[3] == 1 && b[59] == 30 && std::abs((turns[3] * turns[4]).norm() - 1) < 1e-15;
}

bool problem_and_solution() {
  const int n = 5;
  const MatrixXd A = MatrixXd::Identity(3 * n, 3 * n);
  VectorXd b(3 * n);
  for (int i = 0; i < n; ++i) b.segment<3>(3 * i) = Vector3d(1, -0.1, 0);
  tc::Problem problem = tc::Problem::dense(A, b, VectorXd::Constant(n, 0.5));
  const tc::Problem copy = problem;
  problem = copy;
  tc::Solver solver;
  tc::Solution solution = solver.solve(problem, VectorXd::Zero(3 * n));
  solver.solve(copy, solution);
  const tc::Solution kept = solution;
  const VectorXd impulses = kept.impulses;
  return kept.status == tc::Status::solved && kept.velocities.norm() < 1e-8 &&
         (problem.dense_matrix() - A).norm() == 0 && (problem.b() - b).norm() == 0 &&
         tc::evaluate(problem, tc::Law::coulomb, 1.0 * impulses).cone < 1e-8;
}

bool bodies() {
  std::vector<tc::RigidBody> bodies(3);
  for (tc::RigidBody& body : bodies) {
    body.inverse_mass = 1;
    body.inverse_inertia.setIdentity();
    body.velocity << 0, 0, -1;
  }
  const std::vector<tc::ContactRows> contacts(
      3, tc::ContactRows::at_point(1, -1, {0, 0, -1}, {0, 0, 0}, {0, 0, 1}, 0.3));
  const tc::Solution s = tc::Solver().solve(tc::delassus(bodies, contacts));
  const std::vector<tc::Vector6d> v = tc::velocities_after(bodies, contacts, s.impulses);
  return std::abs(v[1][2]) < 1e-8 && v[0][2] == -1;
}

// Balls rest on a plane: shapes and bodies by value, in vectors that grow.
bool stepper() {
  tc::BodySet set;
  const int ground = set.add_fixed(Vector3d::Zero(), Eigen::Quaterniond::Identity());
  std::vector<tc::Surface> surfaces{{ground, tc::Shape::plane(Vector3d::UnitZ()), 0}};
  for (int i = 0; i < 10; ++i) {
    const int ball = set.add(1.0, 0.004 * Eigen::Matrix3d::Identity(), Vector3d(i, 0, 0.1));
    tc::Surface surface{ball, tc::Shape::sphere(0.1), 0};
    surface.shape.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Vector3d::UnitX()));
    surfaces.push_back(surface);
  }
  tc::SteppingOptions options;
  options.gravity = Vector3d(0, 0, -9.81);
  tc::Stepper stepper(set, surfaces, {{0, 0, 0.5, 0.0}}, options);
  for (int i = 0; i < 20; ++i) stepper.step();
  const Eigen::Quaterniond q = stepper.bodies().orientation[3];
  return stepper.contacts().points.size() == 10 &&
         std::abs(stepper.bodies().position[3].z() - 0.1) < 1e-6 && std::abs(q.norm() - 1) < 1e-12;
}

}  // namespace

bool use_contact() {
  const bool right[] = {eigen_of_its_own(), problem_and_solution(), bodies(), stepper(),
                        eigen_of_its_own()};
  for (bool each : right) std::printf("%d ", each);
  return right[0] && right[1] && right[2] && right[3] && right[4];
}

// A program that uses Eigen a lot by itself and owns, copies and frees what Tether's libraries
// made, compiled with other flags than they. Without optimisation, so that Eigen's functions are
// symbols which the linker could mix. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Dense>
#include <cstdio>
#include <tether/linalg.hpp>
#include <vector>
#ifdef WITH_CONTACT
#include <tether/contact.hpp>
#endif

namespace {

int failures = 0;
void expect(bool holds, const char* what) {
  if (holds) return;
  std::printf("wrong: %s\n", what);
  ++failures;
}

// What a library may hold as well: storage that grows, products, factors, fixed sizes.
void eigen_of_its_own() {
  Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(7, 1, 7);
  for (int n = 8; n < 200; n += 13) x.conservativeResize(n);
  x.setOnes();
  Eigen::MatrixXd A = Eigen::MatrixXd::Identity(40, 40) * 3;
  A.resize(60, 60);
  A = Eigen::MatrixXd::Identity(60, 60) * 3 + Eigen::MatrixXd::Constant(60, 60, 0.01);
  const Eigen::VectorXd b = A * Eigen::VectorXd::Ones(60);
  expect((Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(A).solve(b).array() - 1).abs().maxCoeff() <
             1e-12,
         "QR");
  std::vector<Eigen::Quaterniond> turns(9, Eigen::Quaterniond::Identity());
  expect(std::abs((turns[3] * turns[4]).norm() - 1) < 1e-15, "quaternions");
}

// Rows beyond the small sizes: Eigen's QR inside the library.
void minimum_norm() {
  const int m = 20, n = 50;
  tether::linalg::MinimumNorm solver(m, n), other;
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < n; ++j) solver.row(i)[j] = i == j ? 2.0 : 0.0;
  const std::vector<double> metric(n, 1.0), g(m, 1.0);
  std::vector<double> dy(n);
  expect(solver.factor(metric.data()), "factor");
  other = std::move(solver);
  other.solve(g.data(), dy.data());
  expect(std::abs(dy[0] - 0.5) < 1e-14 && std::abs(dy[n - 1]) < 1e-14, "minimum norm");
}

#ifdef WITH_CONTACT
namespace tc = tether::contact;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

void problem_and_solution() {
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
  expect(kept.status == tc::Status::solved && kept.velocities.norm() < 1e-8, "solution");
  expect((problem.dense_matrix() - A).norm() == 0 && (problem.b() - b).norm() == 0, "problem");
  expect(tc::evaluate(problem, tc::Law::coulomb, 1.0 * impulses).cone < 1e-8, "residuals");
  const Eigen::Matrix2d planar = Eigen::Matrix2d::Identity();
  expect(tc::solve_planar(tc::Law::coulomb, planar, Eigen::Vector2d(1, 0), 0.5).impulse[0] > 0.5,
         "planar contact");
}

void bodies() {
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
  expect(std::abs(v[1][2]) < 1e-8 && v[0][2] == -1, "velocities after");
}

// A ball falls on a plane: shapes and bodies by value, in vectors that grow.
void stepper() {
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
  expect(std::abs(stepper.bodies().position[3].z() - 0.1) < 1e-6 && std::abs(q.norm() - 1) < 1e-12,
         "balls at rest");
  expect(stepper.contacts().points.size() == 10, "contacts");
}
#endif

}  // namespace

int main() {
  eigen_of_its_own();
  minimum_norm();
#ifdef WITH_CONTACT
  problem_and_solution();
  bodies();
  stepper();
#endif
  eigen_of_its_own();
  if (failures == 0) std::puts("all right");
  return failures;
}

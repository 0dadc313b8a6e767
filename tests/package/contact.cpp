// Smallest user of tether::contact: a unit mass comes down at speed 1 and slides slowly enough to
// stick, so that its velocity after the impulse is zero. SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <tether/contact.hpp>

int main() {
  namespace tc = tether::contact;
  const Eigen::MatrixXd A = Eigen::MatrixXd::Identity(3, 3);
  const Eigen::VectorXd b = Eigen::Vector3d(1.0, -0.1, 0.0);  // minus the velocity before
  const Eigen::VectorXd mu = Eigen::VectorXd::Constant(1, 0.5);

  const tc::Solution solution = tc::Solver().solve(tc::Problem::dense(A, b, mu));
  std::printf("%s, |w| = %.1e\n", tc::name(solution.status), solution.velocities.norm());
  return solution.status == tc::Status::solved && solution.velocities.norm() < 1e-8 ? 0 : 1;
}

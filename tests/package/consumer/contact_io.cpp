// Smallest user of tether::contact_io: a problem written and read again.
// SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <tether/contact/files.hpp>
#include <tether/contact/solver.hpp>

bool use_contact_io() {
  namespace tc = tether::contact;
  const Eigen::MatrixXd A = 2 * Eigen::MatrixXd::Identity(3, 3);
  const tc::Problem problem =
      tc::Problem::dense(A, Eigen::Vector3d(1, 0.1, 0), Eigen::VectorXd::Constant(1, 0.5));
  const char* const file = "tether_contact_io_test.dat";
  tc::write_dat(problem, file);
  const tc::Solution solution = tc::Solver().solve(tc::read_problem(file));
  std::remove(file);
  std::printf("%s; fclib: %s\n", tc::name(solution.status), tc::has_fclib() ? "yes" : "no");
  return solution.status == tc::Status::solved;
}

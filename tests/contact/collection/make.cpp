// Tether: writes the small contact problems in this folder: make_contact_collection FOLDER. All of
// them come from the project's own generators. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdio>
#include <string>
#include <tether/contact/files.hpp>

#include "assemblies.hpp"

using namespace tether::contact;

namespace {

// Normal, one tangent: a plane cut through a cluster.
Problem plane(random::Generator& g) {
  const int n = 5;
  Eigen::MatrixXd J(2 * n, 6);
  for (int r = 0; r < J.rows(); ++r)
    for (int c = 0; c < J.cols(); ++c) J(r, c) = g.normal();
  Eigen::VectorXd b(2 * n);
  for (int r = 0; r < b.size(); ++r) b[r] = g.normal();
  const Eigen::MatrixXd A = J * J.transpose() + 0.1 * Eigen::MatrixXd::Identity(2 * n, 2 * n);
  return Problem::dense(A, b, Eigen::VectorXd::Constant(n, 0.4));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "make_contact_collection FOLDER\n");
    return 2;
  }
  const std::string folder = std::string(argv[1]) + "/";
  random::Generator g(20261122);
  const auto cluster = [&](double mu, int bodies, int contacts) {
    return random::cluster(g, mu, bodies, contacts).problem();
  };
  write_dat(cluster(0.3, 4, 7), folder + "cluster_low_friction.dat", DatStorage::blocks);
  write_dat(cluster(1.0, 4, 7), folder + "cluster_high_friction.dat", DatStorage::blocks);
  write_dat(cluster(0.0, 3, 6), folder + "cluster_no_friction.dat", DatStorage::dense);
  write_dat(random::stack(2, 1).problem(), folder + "stack.dat", DatStorage::blocks);
  write_dat(random::stack(2, 1e4).problem(), folder + "stack_heavy_above.dat", DatStorage::blocks);
  write_dat(plane(g), folder + "plane.dat", DatStorage::dense);
  if (has_fclib()) write_fclib(cluster(0.5, 3, 4), folder + "cluster.hdf5");
}

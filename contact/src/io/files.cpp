// Tether: problems from what files say. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/files.hpp>

#include <filesystem>
#include <fstream>
#include <tether/linalg/index.hpp>

#include "io/file_problem.hpp"

namespace tether::contact {

namespace {

using linalg::at;

bool is_hdf5(const std::string& path) {
  // A pipe can be opened and read once only; HDF5 does not come through one.
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return false;
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(path + ": cannot be opened");
  char head[4] = {};
  file.read(head, 4);
  return file && head[0] == '\x89' && head[1] == 'H' && head[2] == 'D' && head[3] == 'F';
}

Problem problem_of(const detail::FileProblem& file) {
  if (file.joints > 0) throw std::invalid_argument("has rows of joints, which read_cones() reads");
  if (!file.is_local() || file.dimension > 3)
    throw std::invalid_argument(
        "is global or has rolling friction: read_cones() reads it, not read_problem()");
  const int d = file.dimension;
  std::vector<MatrixBlock> blocks;
  // Neighbouring entries mostly belong to the block that was made last in their row.
  std::vector<int> last(at(file.contacts()), -1);
  for (const MatrixEntry& e : file.A.entries) {
    int& block = last[at(e.row / d)];
    if (block < 0 || blocks[at(block)].column != e.column / d) {
      block = static_cast<int>(blocks.size());
      blocks.push_back({e.row / d, e.column / d, Eigen::Matrix3d::Zero()});
    }
    blocks[at(block)].value(e.row % d, e.column % d) += e.value;
  }
  return Problem::sparse(d, std::move(blocks), -file.q, file.mu);
}

ConeProblem cones_of(const detail::FileProblem& file) {
  std::vector<Cone> cones;
  for (int k = 0; k < file.contacts(); ++k)
    cones.push_back(file.dimension == 2   ? Cone::planar(file.mu[k])
                    : file.dimension == 3 ? Cone::friction(file.mu[k])
                                          : Cone::with_rolling(file.mu[k], file.rolling[k]));
  if (file.joints > 0) cones.push_back(Cone::free(file.joints));
  if (file.is_local()) return ConeProblem::sparse(file.A.entries, -file.q, std::move(cones));
  return ConeProblem::saddle(file.A.entries, file.J->entries, file.f, file.q, std::move(cones));
}

template <class F>
auto read(const std::string& path, const F& make) {
  const detail::FileProblem file =
      is_hdf5(path) ? detail::read_fclib(path) : detail::read_dat(path);
  try {
    return make(file);
  } catch (const std::invalid_argument& e) {
    throw std::runtime_error(path + ": " + e.what());
  }
}

}  // namespace

Problem read_problem(const std::string& path) { return read(path, problem_of); }
ConeProblem read_cones(const std::string& path) { return read(path, cones_of); }

}  // namespace tether::contact

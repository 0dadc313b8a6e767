// Tether: problems over cones in the fclib HDF5 format. SPDX-License-Identifier: BSD-3-Clause
//
//   fclib_local:          w = W x + V y + q, V'x + R y + s = 0
//   fclib_global:         M v = H x + G y + f, w = H'v + w_0, G'v + b = 0
//   fclib_global_rolling: the same, five rows a contact
#ifdef TETHER_HAVE_HDF5

#include <limits>
#include <tether/contact/files.hpp>

#include "io/hdf5_file.hpp"

namespace tether::contact {

namespace {

using detail::has;
using detail::read;
using detail::read_integer;

struct Hdf5Matrix {
  int rows = 0, columns = 0;
  std::vector<MatrixEntry> entries;
};

Hdf5Matrix read_matrix(hid_t file, const std::string& path, const std::string& name) {
  const auto fail = [&](const std::string& what) {
    throw std::runtime_error(path + ": /" + name + " " + what);
  };
  Hdf5Matrix out;
  out.rows = read_integer(file, path, name + "/m");
  out.columns = read_integer(file, path, name + "/n");
  const int nz = read_integer(file, path, name + "/nz");
  const std::vector<int> p = read<int>(file, path, name + "/p"),
                         i = read<int>(file, path, name + "/i");
  const std::vector<double> x = read<double>(file, path, name + "/x");
  if (out.rows < 0 || out.columns < 0 || nz < -2) fail("has sizes that cannot be");
  const auto put = [&](int row, int column, double value) {
    if (row < 0 || row >= out.rows || column < 0 || column >= out.columns)
      fail("has an index outside of the matrix");
    out.entries.push_back({row, column, value});
  };
  const std::size_t most = std::min(i.size(), x.size());
  if (nz >= 0) {
    if (static_cast<std::size_t>(nz) > std::min(most, p.size())) fail("has fewer than nz entries");
    for (std::size_t k = 0; k < static_cast<std::size_t>(nz); ++k) put(i[k], p[k], x[k]);
    return out;
  }
  const std::size_t lines = static_cast<std::size_t>(nz == -1 ? out.columns : out.rows);
  if (p.size() < lines + 1) fail("has too few pointers");
  for (std::size_t k = 0; k < lines; ++k) {
    if (p[k] < 0 || p[k] > p[k + 1] || static_cast<std::size_t>(p[k + 1]) > most)
      fail("has pointers that do not ascend from 0 to the number of entries");
    for (int e = p[k]; e < p[k + 1]; ++e) {
      const int other = i[static_cast<std::size_t>(e)], self = static_cast<int>(k);
      const double value = x[static_cast<std::size_t>(e)];
      nz == -1 ? put(other, self, value) : put(self, other, value);
    }
  }
  return out;
}

Eigen::VectorXd read_vector(hid_t file, const std::string& path, const std::string& name,
                            std::size_t size) {
  const std::vector<double> v = read<double>(file, path, name);
  if (v.size() != size)
    throw std::runtime_error(path + ": /" + name + " has " + std::to_string(v.size()) +
                             " entries, " + std::to_string(size) + " are expected");
  return Eigen::Map<const Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(size));
}

}  // namespace

ConeProblem read_cones_fclib(const std::string& path) {
  detail::Quiet quiet;
  detail::Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (file < 0) throw std::runtime_error(path + ": not an HDF5 file, or truncated");
  const bool rolling = has(file, "fclib_global_rolling");
  const bool local = !rolling && has(file, "fclib_local");
  const std::string group = rolling ? "fclib_global_rolling/"
                            : local ? "fclib_local/"
                                    : "fclib_global/";
  const auto fail = [&](const std::string& what) {
    throw std::runtime_error(path + ": /" + group + what);
  };
  const int d = read_integer(file, path, group + "spacedim");
  if (rolling ? d != 5 : d != 2 && d != 3) fail("spacedim is " + std::to_string(d));
  const std::vector<double> mu = read<double>(file, path, group + "vectors/mu");
  const std::vector<double> mu_r =
      rolling ? read<double>(file, path, group + "vectors/mu_r") : std::vector<double>(mu.size());
  if (mu_r.size() != mu.size()) fail("vectors/mu_r has another size than mu");
  const std::size_t size = mu.size() * static_cast<std::size_t>(d);
  if (size > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    fail("vectors/mu is too long");
  const int rows = static_cast<int>(size);
  std::vector<Cone> cones;
  for (std::size_t k = 0; k < mu.size(); ++k)
    cones.push_back(d == 2   ? Cone::planar(mu[k])
                    : d == 3 ? Cone::friction(mu[k])
                             : Cone::with_rolling(mu[k], mu_r[k]));
  const auto need = [&](const char* name, const Hdf5Matrix& A, int m, int n) {
    if (A.rows != m || A.columns != n)
      fail(std::string(name) + " is " + std::to_string(A.rows) + " x " + std::to_string(A.columns) +
           ", " + std::to_string(m) + " x " + std::to_string(n) + " is expected");
  };
  // Rows of joints follow those of the contacts. Their number may be claimed by few bytes.
  const auto add_joints = [&](int joints) {
    if (joints > std::numeric_limits<int>::max() - rows)
      fail("has " + std::to_string(joints) + " rows of joints, more than there can be");
    if (joints > 0) cones.push_back(Cone::free(joints));
  };
  try {
    if (local) {
      const Hdf5Matrix W = read_matrix(file, path, group + "W");
      need("W", W, rows, rows);
      std::vector<MatrixEntry> A = W.entries;
      Eigen::VectorXd b = -read_vector(file, path, group + "vectors/q", size);
      if (has(file, group + "V")) {
        const Hdf5Matrix V = read_matrix(file, path, group + "V"),
                         R = read_matrix(file, path, group + "R");
        need("V", V, rows, R.rows);
        need("R", R, R.rows, R.rows);
        add_joints(R.rows);
        for (const MatrixEntry& e : V.entries) {
          A.push_back({e.row, rows + e.column, e.value});
          A.push_back({rows + e.column, e.row, e.value});
        }
        for (const MatrixEntry& e : R.entries)
          A.push_back({rows + e.row, rows + e.column, e.value});
        const Eigen::VectorXd s =
            read_vector(file, path, group + "vectors/s", static_cast<std::size_t>(R.rows));
        b.conservativeResize(rows + R.rows);
        b.tail(R.rows) = -s;
      }
      return ConeProblem::sparse(A, b, std::move(cones));
    }
    const Hdf5Matrix M = read_matrix(file, path, group + "M"),
                     H = read_matrix(file, path, group + "H");
    need("M", M, M.rows, M.rows);
    need("H", H, M.rows, rows);
    const Eigen::VectorXd f =
        read_vector(file, path, group + "vectors/f", static_cast<std::size_t>(M.rows));
    Eigen::VectorXd bias = read_vector(file, path, group + "vectors/w", size);
    std::vector<MatrixEntry> J;
    for (const MatrixEntry& e : H.entries) J.push_back({e.column, e.row, e.value});
    if (has(file, group + "G")) {
      const Hdf5Matrix G = read_matrix(file, path, group + "G");
      need("G", G, M.rows, G.columns);
      add_joints(G.columns);
      for (const MatrixEntry& e : G.entries) J.push_back({rows + e.column, e.row, e.value});
      bias.conservativeResize(rows + G.columns);
      bias.tail(G.columns) =
          read_vector(file, path, group + "vectors/b", static_cast<std::size_t>(G.columns));
    }
    return ConeProblem::saddle(M.entries, J, f, bias, std::move(cones));
  } catch (const std::invalid_argument& e) {
    throw std::runtime_error(path + ": " + e.what());
  }
}

}  // namespace tether::contact

#endif

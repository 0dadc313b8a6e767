// Tether: the fclib HDF5 format. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/files.hpp>

#include <filesystem>
#include <fstream>
#include <stdexcept>

#ifdef TETHER_HAVE_HDF5
#include "io/hdf5_file.hpp"
#endif

namespace tether::contact {

namespace {

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

}  // namespace

Problem read_problem(const std::string& path) {
  return is_hdf5(path) ? read_fclib(path) : read_dat(path);
}

ConeProblem read_cones(const std::string& path) {
  return is_hdf5(path) ? read_cones_fclib(path) : read_cones_dat(path);
}

#ifndef TETHER_HAVE_HDF5

bool has_fclib() { return false; }
Problem read_fclib(const std::string& path) {
  throw std::runtime_error(path + ": built without HDF5 (install libhdf5-dev)");
}
ConeProblem read_cones_fclib(const std::string& path) {
  throw std::runtime_error(path + ": built without HDF5 (install libhdf5-dev)");
}
void write_fclib(const Problem&, const std::string& path) {
  throw std::runtime_error(path + ": built without HDF5 (install libhdf5-dev)");
}

#else

bool has_fclib() { return true; }

using detail::Handle;
using detail::Native;
using detail::Quiet;
using detail::read;
using detail::read_integer;

namespace {

template <class T>
void write(hid_t file, const std::string& path, const std::string& name, const T* data,
           std::size_t count) {
  const hsize_t size = count;
  Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose);
  Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
  H5Pset_create_intermediate_group(links, 1);
  Handle set(H5Dcreate2(file, ("/fclib_local/" + name).c_str(), Native<T>::type(), space, links,
                        H5P_DEFAULT, H5P_DEFAULT),
             H5Dclose);
  if (set < 0 || H5Dwrite(set, Native<T>::type(), H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0) {
    throw std::runtime_error(path + ": " + name + " cannot be written");
  }
}

}  // namespace

Problem read_fclib(const std::string& path) {
  Quiet quiet;
  Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (file < 0) throw std::runtime_error(path + ": not an HDF5 file, or truncated");
  const auto fail = [&](const std::string& what) { throw std::runtime_error(path + ": " + what); };
  const int d = read_integer(file, path, "fclib_local/spacedim");
  if (d != 2 && d != 3) fail("spacedim is " + std::to_string(d));
  if (detail::has(file, "fclib_local/V"))
    fail("/fclib_local/V: has rows of joints, which read_cones() reads");
  const std::vector<double> q = read<double>(file, path, "fclib_local/vectors/q");
  const std::vector<double> mu = read<double>(file, path, "fclib_local/vectors/mu");
  const int m = read_integer(file, path, "fclib_local/W/m"),
            n = read_integer(file, path, "fclib_local/W/n");
  const int nz = read_integer(file, path, "fclib_local/W/nz");
  const std::vector<int> p = read<int>(file, path, "fclib_local/W/p"),
                         i = read<int>(file, path, "fclib_local/W/i");
  const std::vector<double> x = read<double>(file, path, "fclib_local/W/x");
  const std::size_t size = mu.size() * static_cast<std::size_t>(d);
  if (q.size() != size)
    fail("q has " + std::to_string(q.size()) + " entries, " + std::to_string(size) +
         " are expected");
  if (m < 0 || static_cast<std::size_t>(m) != size || m != n) {
    fail("W is " + std::to_string(m) + " x " + std::to_string(n) + ", " + std::to_string(size) +
         " are expected");
  }
  if (nz < -2) fail("W/nz is " + std::to_string(nz));

  std::vector<MatrixBlock> blocks;
  std::vector<int> last(mu.size() * 1, -1);
  const auto put = [&](int r, int c, double value) {
    if (r < 0 || r >= m || c < 0 || c >= n) fail("W has an index outside of the matrix");
    // Neighbouring entries mostly belong to the block that was made last.
    const int br = r / d, bc = c / d;
    if (last[static_cast<std::size_t>(br)] < 0 ||
        blocks[static_cast<std::size_t>(last[static_cast<std::size_t>(br)])].column != bc) {
      last[static_cast<std::size_t>(br)] = static_cast<int>(blocks.size());
      blocks.push_back({br, bc, Eigen::Matrix3d::Zero()});
    }
    blocks[static_cast<std::size_t>(last[static_cast<std::size_t>(br)])].value(r % d, c % d) +=
        value;
  };
  if (nz >= 0) {
    const std::size_t count = static_cast<std::size_t>(nz);
    if (x.size() < count || p.size() < count || i.size() < count)
      fail("truncated: W has fewer than nz entries");
    for (std::size_t k = 0; k < count; ++k) put(i[k], p[k], x[k]);
  } else {
    if (p.size() < size + 1) fail("truncated: W/p is too short");
    const std::size_t count = p[size] < 0 ? 0 : static_cast<std::size_t>(p[size]);
    if (p[size] < 0 || x.size() < count || i.size() < count)
      fail("truncated: W has fewer entries than W/p says");
    for (std::size_t k = 0; k < size; ++k) {
      if (p[k] < 0 || p[k] > p[k + 1] || static_cast<std::size_t>(p[k + 1]) > count) {
        fail("W/p must ascend from 0 to the number of entries");
      }
      for (int e = p[k]; e < p[k + 1]; ++e) {
        const int other = i[static_cast<std::size_t>(e)], self = static_cast<int>(k);
        const double value = x[static_cast<std::size_t>(e)];
        nz == -1 ? put(other, self, value) : put(self, other, value);
      }
    }
  }
  const Eigen::VectorXd b =
      -Eigen::Map<const Eigen::VectorXd>(q.data(), static_cast<Eigen::Index>(q.size()));
  const Eigen::VectorXd friction =
      Eigen::Map<const Eigen::VectorXd>(mu.data(), static_cast<Eigen::Index>(mu.size()));
  try {
    return Problem::sparse(d, std::move(blocks), b, friction);
  } catch (const std::invalid_argument& e) {
    throw std::runtime_error(path + ": " + e.what());
  }
}

void write_fclib(const Problem& problem, const std::string& path) {
  Quiet quiet;
  Handle file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose);
  if (file < 0) throw std::runtime_error(path + ": cannot be written");
  const int d = problem.dimension(), size = d * problem.contacts();
  std::vector<int> rows, columns;
  std::vector<double> values;
  for (int i = 0; i < problem.contacts(); ++i) {
    for (int k = problem.row_start()[static_cast<std::size_t>(i)];
         k < problem.row_start()[static_cast<std::size_t>(i + 1)]; ++k) {
      const double* v = problem.blocks()[static_cast<std::size_t>(k)].column;
      for (int c = 0; c < d; ++c)
        for (int r = 0; r < d; ++r) {
          if (v[4 * c + r] == 0) continue;
          rows.push_back(d * i + r);
          columns.push_back(d * problem.columns()[static_cast<std::size_t>(k)] + c);
          values.push_back(v[4 * c + r]);
        }
    }
  }
  const int count = static_cast<int>(values.size());
  write(file, path, "spacedim", &d, 1);
  write(file, path, "W/m", &size, 1);
  write(file, path, "W/n", &size, 1);
  write(file, path, "W/nz", &count, 1);
  write(file, path, "W/nzmax", &count, 1);
  write(file, path, "W/i", rows.data(), rows.size());
  write(file, path, "W/p", columns.data(), columns.size());
  write(file, path, "W/x", values.data(), values.size());
  std::vector<double> q, mu;
  for (int i = 0; i < size; ++i) q.push_back(-problem.b()[i]);
  for (int i = 0; i < problem.contacts(); ++i) mu.push_back(problem.mu(i));
  write(file, path, "vectors/q", q.data(), q.size());
  write(file, path, "vectors/mu", mu.data(), mu.size());
}

#endif

}  // namespace tether::contact

// Tether: the fclib HDF5 format. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/files.hpp>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <stdexcept>

#ifdef TETHER_HAVE_HDF5
#include <hdf5.h>
#endif

namespace tether::contact {

Problem read_problem(const std::string& path) {
  // A pipe can be opened and read once only; HDF5 does not come through one.
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return read_dat(path);
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(path + ": cannot be opened");
  char head[4] = {};
  file.read(head, 4);
  const bool hdf5 = file && head[0] == '\x89' && head[1] == 'H' && head[2] == 'D' && head[3] == 'F';
  return hdf5 ? read_fclib(path) : read_dat(path);
}

#ifndef TETHER_HAVE_HDF5

bool has_fclib() { return false; }
Problem read_fclib(const std::string& path) {
  throw std::runtime_error(path + ": built without HDF5 (install libhdf5-dev)");
}
void write_fclib(const Problem&, const std::string& path) {
  throw std::runtime_error(path + ": built without HDF5 (install libhdf5-dev)");
}

#else

bool has_fclib() { return true; }

namespace {

// A HDF5 identifier with its closing function.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

// HDF5 prints errors by itself by default.
struct Quiet {
  H5E_auto2_t function = nullptr;
  void* data = nullptr;
  Quiet() {
    H5Eget_auto2(H5E_DEFAULT, &function, &data);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~Quiet() { H5Eset_auto2(H5E_DEFAULT, function, data); }
};

template <class T>
struct Native;
template <>
struct Native<int> {
  static hid_t type() { return H5T_NATIVE_INT; }
};
template <>
struct Native<double> {
  static hid_t type() { return H5T_NATIVE_DOUBLE; }
};

constexpr hssize_t kMostEntries = hssize_t{1} << 31;
constexpr hsize_t kBestCompression =
    1032;  // of deflate; other filters are not expected to do better

// What `set` claims to hold, in entries, once that is known to fit the bytes that the file has for
// it: a damaged extent must not ask for memory.
template <class T>
std::size_t believable_count(hid_t file, hid_t set, const std::string& full) {
  Handle space(H5Dget_space(set), H5Sclose);
  const hssize_t count = H5Sget_simple_extent_npoints(space);
  hsize_t file_size = 0;
  if (count < 0 || count > kMostEntries || H5Fget_filesize(file, &file_size) < 0) {
    throw std::runtime_error(full + " has a size that cannot be");
  }
  const hsize_t stored = std::min(H5Dget_storage_size(set), file_size);
  if (static_cast<hsize_t>(count) * sizeof(T) > kBestCompression * stored) {
    throw std::runtime_error(full + " says that it has " + std::to_string(count) +
                             " entries, but the file holds " + std::to_string(stored) +
                             " bytes of it");
  }
  return static_cast<std::size_t>(count);
}

// A file may lead to others by links, by storage that lies outside and by virtual data; and name
// filters, which HDF5 would load as code, or the same one twice, which may expand without a bound.
herr_t no_other_file(const char*, const char*, const char*, const char*, unsigned*, hid_t, void*) {
  return -1;
}

void check_storage(hid_t set, const std::string& full) {
  Handle made(H5Dget_create_plist(set), H5Pclose);
  if (H5Pget_external_count(made) != 0 || H5Pget_layout(made) == H5D_VIRTUAL)
    throw std::runtime_error(full + " lies in another file, which is not read");
  std::set<H5Z_filter_t> filters;
  for (int k = 0; k < H5Pget_nfilters(made); ++k) {
    std::size_t values = 0;
    const H5Z_filter_t filter = H5Pget_filter2(made, static_cast<unsigned>(k), nullptr, &values,
                                               nullptr, 0, nullptr, nullptr);
    if (filter < 0 || filter >= H5Z_FILTER_RESERVED || !filters.insert(filter).second)
      throw std::runtime_error(full + " has a filter that HDF5 does not come with, or one twice");
  }
}

template <class T>
std::vector<T> read(hid_t file, const std::string& path, const std::string& name) {
  const std::string full = path + ": /fclib_local/" + name;
  Handle access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
  H5Pset_elink_cb(access, no_other_file, nullptr);
  Handle set(H5Dopen2(file, ("/fclib_local/" + name).c_str(), access), H5Dclose);
  if (set < 0) throw std::runtime_error(full + " is missing, damaged or a link to another file");
  check_storage(set, full);
  const std::size_t count = believable_count<T>(file, set, full);
  std::vector<T> out(count);
  if (count > 0 && H5Dread(set, Native<T>::type(), H5S_ALL, H5S_ALL, H5P_DEFAULT, out.data()) < 0) {
    throw std::runtime_error(full + " cannot be read; the file is truncated or of another kind");
  }
  return out;
}

int read_integer(hid_t file, const std::string& path, const std::string& name) {
  const std::vector<int> v = read<int>(file, path, name);
  if (v.size() != 1)
    throw std::runtime_error(path + ": /fclib_local/" + name + " is not a single number");
  return v[0];
}

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
  const int d = read_integer(file, path, "spacedim");
  if (d != 2 && d != 3) fail("spacedim is " + std::to_string(d));
  const std::vector<double> q = read<double>(file, path, "vectors/q");
  const std::vector<double> mu = read<double>(file, path, "vectors/mu");
  const int m = read_integer(file, path, "W/m"), n = read_integer(file, path, "W/n");
  const int nz = read_integer(file, path, "W/nz");
  const std::vector<int> p = read<int>(file, path, "W/p"), i = read<int>(file, path, "W/i");
  const std::vector<double> x = read<double>(file, path, "W/x");
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

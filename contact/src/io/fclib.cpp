// Tether: the fclib HDF5 format. SPDX-License-Identifier: BSD-3-Clause
//
//   fclib_local:          w = W x + V y + q, V'x + R y + s = 0
//   fclib_global:         M v = H x + G y + f, w = H'v + w_0, G'v + b = 0
//   fclib_global_rolling: the same, five rows a contact
#include <algorithm>
#include <limits>
#include <set>
#include <type_traits>

#include "io/file_problem.hpp"
#ifdef TETHER_HAVE_HDF5
#include <hdf5.h>
#endif

namespace tether::contact {

#ifndef TETHER_HAVE_HDF5

bool has_fclib() { return false; }
detail::FileProblem detail::read_fclib(const std::string& path) {
  throw std::runtime_error(path + ": built without HDF5 (install libhdf5-dev)");
}
void write_fclib(const Problem&, const std::string& path) {
  throw std::runtime_error(path + ": built without HDF5 (install libhdf5-dev)");
}

#else

bool has_fclib() { return true; }

using detail::FileMatrix;
using detail::FileProblem;

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
hid_t native() {
  return std::is_same_v<T, int> ? H5T_NATIVE_INT : H5T_NATIVE_DOUBLE;
}

constexpr hssize_t kMostEntries = hssize_t{1} << 31;
constexpr hsize_t kBestCompression =
    1032;  // of deflate; other filters are not expected to do better

// Number of entries of `set`, checked against the bytes that the file has for it: a damaged extent
// must not ask for memory.
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

// A file may refer to other files by links, external storage and virtual data. It may name filters,
// which HDF5 would load as code, or the same filter twice, which may expand without bound.
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
  const std::string full = path + ": /" + name;
  Handle access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
  H5Pset_elink_cb(access, no_other_file, nullptr);
  Handle set(H5Dopen2(file, ("/" + name).c_str(), access), H5Dclose);
  if (set < 0) throw std::runtime_error(full + " is missing, damaged or a link to another file");
  check_storage(set, full);
  const std::size_t count = believable_count<T>(file, set, full);
  std::vector<T> out(count);
  if (count > 0 && H5Dread(set, native<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, out.data()) < 0) {
    throw std::runtime_error(full + " cannot be read; the file is truncated or of another kind");
  }
  return out;
}

/// Whether the file has it, itself.
bool has(hid_t file, const std::string& name) {
  return H5Lexists(file, ("/" + name).c_str(), H5P_DEFAULT) > 0;
}

// A group of a file that is read.
class Group {
 public:
  Group(hid_t file, std::string path, std::string name)
      : file_(file), path_(std::move(path)), name_(std::move(name)) {}

  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(path_ + ": /" + name_ + what);
  }
  bool has(const std::string& what) const { return contact::has(file_, name_ + what); }
  int integer(const std::string& what) const {
    const std::vector<int> v = list<int>(what);
    if (v.size() != 1) fail(what + " is not a single number");
    return v[0];
  }
  template <class T>
  std::vector<T> list(const std::string& what) const {
    return read<T>(file_, path_, name_ + what);
  }
  linalg::VectorX vector(const std::string& what) const {
    const std::vector<double> v = list<double>("vectors/" + what);
    return Eigen::Map<const Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(v.size()));
  }
  linalg::VectorX vector(const std::string& what, long size) const {
    linalg::VectorX v = vector(what);
    if (v.size() != size)
      fail("vectors/" + what + " has " + std::to_string(v.size()) + " entries, " +
           std::to_string(size) + " are expected");
    return v;
  }
  FileMatrix matrix(const std::string& what) const;
  void need(const char* what, const FileMatrix& A, long rows, long columns) const {
    if (A.rows != rows || A.columns != columns)
      fail(std::string(what) + " is " + std::to_string(A.rows) + " x " + std::to_string(A.columns) +
           ", " + std::to_string(rows) + " x " + std::to_string(columns) + " is expected");
  }

 private:
  hid_t file_;
  std::string path_, name_;
};

FileMatrix Group::matrix(const std::string& what) const {
  FileMatrix out;
  out.rows = integer(what + "/m");
  out.columns = integer(what + "/n");
  const int nz = integer(what + "/nz");
  const std::vector<int> p = list<int>(what + "/p"), i = list<int>(what + "/i");
  const std::vector<double> x = list<double>(what + "/x");
  if (out.rows < 0 || out.columns < 0 || nz < -2) fail(what + " has sizes that cannot be");
  const auto put = [&](int row, int column, double value) {
    if (row < 0 || row >= out.rows || column < 0 || column >= out.columns)
      fail(what + " has an index outside of the matrix");
    out.entries.push_back({row, column, value});
  };
  const std::size_t most = std::min(i.size(), x.size());
  if (nz >= 0) {
    if (static_cast<std::size_t>(nz) > std::min(most, p.size()))
      fail(what + " has fewer than nz entries");
    for (std::size_t k = 0; k < static_cast<std::size_t>(nz); ++k) put(i[k], p[k], x[k]);
    return out;
  }
  const std::size_t lines = static_cast<std::size_t>(nz == -1 ? out.columns : out.rows);
  if (p.size() < lines + 1) fail(what + "/p is too short");
  for (std::size_t k = 0; k < lines; ++k) {
    if (p[k] < 0 || p[k] > p[k + 1] || static_cast<std::size_t>(p[k + 1]) > most)
      fail(what + "/p must ascend from 0 to the number of entries");
    for (int e = p[k]; e < p[k + 1]; ++e) {
      const int other = i[static_cast<std::size_t>(e)], self = static_cast<int>(k);
      const double value = x[static_cast<std::size_t>(e)];
      nz == -1 ? put(other, self, value) : put(self, other, value);
    }
  }
  return out;
}

}  // namespace

FileProblem detail::read_fclib(const std::string& path) {
  Quiet quiet;
  Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (file < 0) throw std::runtime_error(path + ": not an HDF5 file, or truncated");
  const bool rolling = has(file, "fclib_global_rolling");
  FileProblem out;
  const bool local = !rolling && (has(file, "fclib_local") || !has(file, "fclib_global"));
  const Group group(file, path,
                    rolling ? "fclib_global_rolling/"
                    : local ? "fclib_local/"
                            : "fclib_global/");
  const int d = out.dimension = group.integer("spacedim");
  if (rolling ? d != 5 : d != 2 && d != 3) group.fail("spacedim is " + std::to_string(d));
  out.mu = group.vector("mu");
  if (rolling) out.rolling = group.vector("mu_r", out.mu.size());
  if (out.mu.size() > std::numeric_limits<int>::max() / d) group.fail("vectors/mu is too long");
  const int rows = d * out.contacts();
  // Rows of joints follow those of the contacts. Their number may be claimed by few bytes.
  const auto add_joints = [&](const FileMatrix& of, long joints, const char* vector) {
    if (joints > std::numeric_limits<int>::max() - rows)
      group.fail("has " + std::to_string(joints) + " rows of joints, more than there can be");
    out.joints = static_cast<int>(joints);
    (out.is_local() ? out.A : *out.J).put(of, rows, 0);
    out.q.conservativeResize(rows + joints);
    out.q.tail(joints) = group.vector(vector, joints);
  };
  if (local) {
    out.A = group.matrix("W");
    group.need("W", out.A, rows, rows);
    out.q = group.vector("q", rows);
    if (!group.has("V")) return out;
    const FileMatrix V = group.matrix("V"), R = group.matrix("R");
    group.need("V", V, rows, R.rows);
    group.need("R", R, R.rows, R.rows);
    add_joints(V.transposed(), R.rows, "s");
    out.A.put(V, 0, rows);
    out.A.put(R, rows, rows);
    return out;
  }
  const FileMatrix H = group.matrix("H");
  out.A = group.matrix("M");
  group.need("M", out.A, out.A.rows, out.A.rows);
  group.need("H", H, out.A.rows, rows);
  out.J = H.transposed();
  out.f = group.vector("f", out.A.rows);
  out.q = group.vector("w", rows);
  if (!group.has("G")) return out;
  const FileMatrix G = group.matrix("G");
  group.need("G", G, out.A.rows, G.columns);
  add_joints(G.transposed(), G.columns, "b");
  return out;
}

namespace {

template <class T>
void write(hid_t file, const std::string& path, const std::string& name, const T* data,
           std::size_t count) {
  const hsize_t size = count;
  Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose);
  Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
  H5Pset_create_intermediate_group(links, 1);
  Handle set(H5Dcreate2(file, ("/fclib_local/" + name).c_str(), native<T>(), space, links,
                        H5P_DEFAULT, H5P_DEFAULT),
             H5Dclose);
  if (set < 0 || H5Dwrite(set, native<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0) {
    throw std::runtime_error(path + ": " + name + " cannot be written");
  }
}

}  // namespace

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

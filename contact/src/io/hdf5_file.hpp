// Tether: reading HDF5 files that others made. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <hdf5.h>

#include <algorithm>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

namespace tether::contact::detail {

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
inline herr_t no_other_file(const char*, const char*, const char*, const char*, unsigned*, hid_t,
                            void*) {
  return -1;
}

inline void check_storage(hid_t set, const std::string& full) {
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
  if (count > 0 && H5Dread(set, Native<T>::type(), H5S_ALL, H5S_ALL, H5P_DEFAULT, out.data()) < 0) {
    throw std::runtime_error(full + " cannot be read; the file is truncated or of another kind");
  }
  return out;
}

inline int read_integer(hid_t file, const std::string& path, const std::string& name) {
  const std::vector<int> v = read<int>(file, path, name);
  if (v.size() != 1) throw std::runtime_error(path + ": /" + name + " is not a single number");
  return v[0];
}

/// Whether the file has it, itself.
inline bool has(hid_t file, const std::string& name) {
  return H5Lexists(file, ("/" + name).c_str(), H5P_DEFAULT) > 0;
}

}  // namespace tether::contact::detail

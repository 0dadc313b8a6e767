// Tether: a .vtp file, and a .pvtp that joins some. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tether::scene {

/// Binary arrays behind the XML, each with its length in front.
class Appended {
 public:
  template <class T>
  std::size_t add(const std::vector<T>& values) {
    const std::size_t offset = bytes_.size();
    const std::uint64_t length = values.size() * sizeof(T);
    append(&length, sizeof length);
    append(values.data(), length);
    return offset;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  void append(const void* data, std::size_t length) {
    if (length > 0) bytes_.append(static_cast<const char*>(data), length);
  }
  std::string bytes_;
};

/// One .vtp file: points, then single points and polygons on them, then data of the points.
class PolyData {
 public:
  std::vector<float> points;
  std::vector<std::int32_t> vertices, polygons, ends;  // `ends`: of each polygon in `polygons`

  void scalars(const char* name, const std::vector<float>& values) { data(name, values, 1); }
  void vectors(const char* name, const std::vector<float>& values) { data(name, values, 3); }

  void write(const std::string& file);
  /// The .pvtp of pieces with data as these, in files beside it.
  void write_joined(const std::string& file, const std::vector<std::string>& pieces) const;

 private:
  void data(const char* name, const std::vector<float>& values, int components);
  std::string data_, declared_;  // the data in this file, and in each piece
  Appended appended_;
};

}  // namespace tether::scene

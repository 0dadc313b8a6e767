// Tether: files of surfaces: OBJ, STL, MSH and heights. SPDX-License-Identifier: BSD-3-Clause
#include "surface_files.hpp"

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <map>

#include "toml/fields.hpp"

namespace tether::scene {

namespace {

using Eigen::Vector3d;

constexpr std::size_t kStlHead = 84, kStlTriangle = 50;  // bytes of a binary file

/// Words of a text, line by line.
class Lines {
 public:
  Lines(std::string_view text, std::string_view blanks) : text_(text), blanks_(blanks) {}

  bool next() {
    if (at_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    line_ = text_.substr(at_, end - at_);
    line_ = line_.substr(0, line_.find('#'));
    at_ = end + 1;
    ++number_;
    return true;
  }
  /// The next word of the line; empty: there is none.
  std::string_view word() {
    const std::size_t from = std::min(line_.find_first_not_of(blanks_), line_.size());
    const std::size_t to = std::min(line_.find_first_of(blanks_, from), line_.size());
    const std::string_view out = line_.substr(from, to - from);
    line_.remove_prefix(to);
    return out;
  }
  [[noreturn]] void wrong(const std::string& what) const {
    throw SurfaceError(fmt::format("line {}: {}", number_, what));
  }
  double number(std::string_view word) const {
    double value = 0;
    if (!word.empty() && word[0] == '+') word.remove_prefix(1);
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value))
      wrong(fmt::format("\"{}\" is no finite number", word.substr(0, 40)));
    return value;
  }
  Vector3d point() {
    Vector3d p;
    for (int k = 0; k < 3; ++k) p[k] = number(word());
    return p;
  }

 private:
  std::string_view text_, blanks_, line_;
  std::size_t at_ = 0;
  int number_ = 0;
};

void limit(std::size_t count, std::size_t most, const char* what) {
  if (count > most) throw SurfaceError(fmt::format("has more than {} {}", most, what));
}

/// Points by their coordinates.
class Corners {
 public:
  explicit Corners(TriangleSurface& out) : out_(out) {}

  int number(const Vector3d& p) {
    const auto [at, fresh] =
        known_.emplace(std::array<double, 3>{p.x(), p.y(), p.z()}, out_.points.size());
    if (fresh) {
      limit(out_.points.size() + 1, kMostListed, "points");
      out_.points.push_back(p);
    }
    return static_cast<int>(at->second);
  }
  void add(const std::array<Vector3d, 3>& corners) {
    limit(out_.triangles.size() + 1, kMostTriangles, "triangles");
    out_.triangles.push_back({number(corners[0]), number(corners[1]), number(corners[2])});
  }

 private:
  TriangleSurface& out_;
  std::map<std::array<double, 3>, std::size_t> known_;
};

// Little-endian, whatever the machine is.
std::uint32_t whole(std::string_view bytes, std::size_t at) {
  std::uint32_t out = 0;
  for (std::size_t k = 4; k-- > 0;) out = out << 8 | static_cast<unsigned char>(bytes[at + k]);
  return out;
}

Vector3d point_of(std::string_view bytes, std::size_t at, const char* kind, std::size_t number) {
  Vector3d out;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t bits = whole(bytes, at + 4 * k);
    float value = 0;
    std::memcpy(&value, &bits, sizeof value);
    if (!std::isfinite(value))
      throw SurfaceError(fmt::format("{} {}: a number is not finite", kind, number));
    out[static_cast<Eigen::Index>(k)] = static_cast<double>(value);
  }
  return out;
}

TriangleSurface parse_binary_stl(std::string_view bytes, std::size_t count) {
  TriangleSurface out;
  Corners corners(out);
  limit(count, kMostTriangles, "triangles");
  for (std::size_t t = 0; t < count; ++t) {
    std::array<Vector3d, 3> corner;
    for (std::size_t k = 0; k < 3; ++k)
      corner[k] = point_of(bytes, kStlHead + kStlTriangle * t + 12 + 12 * k, "triangle", t + 1);
    corners.add(corner);
  }
  return out;
}

TriangleSurface parse_text_stl(std::string_view text) {
  TriangleSurface out;
  Corners corners(out);
  Lines lines(text, " \t\r");
  std::array<Vector3d, 3> corner;
  std::size_t count = 0;
  while (lines.next()) {
    const std::string_view key = lines.word();
    if (key == "vertex") {
      if (count == 3) lines.wrong("a facet has three corners");
      corner[count++] = lines.point();
    } else if (key == "endfacet") {
      if (count != 3) lines.wrong("a facet has three corners");
      corners.add(corner);
      count = 0;
    }
  }
  return out;
}

TriangleSurface some(TriangleSurface surface) {
  if (surface.triangles.empty()) throw SurfaceError("has no triangles");
  return surface;
}

/// Wavefront OBJ: `v` and `f`, whose polygons become fans; all else is passed over.
TriangleSurface parse_obj(std::string_view text) {
  TriangleSurface out;
  Lines lines(text, " \t\r");
  // From 1; from the last point so far where it is below 0. Of 7/2/3 only the 7 counts.
  const auto index = [&](std::string_view word) {
    const std::string_view first = word.substr(0, word.find('/'));
    int value = 0;
    const auto [end, error] = std::from_chars(first.data(), first.data() + first.size(), value);
    const int count = static_cast<int>(out.points.size());
    const int k = value < 0 ? count + value : value - 1;
    if (error != std::errc() || end != first.data() + first.size() || k < 0 || k >= count)
      lines.wrong(fmt::format("\"{}\" is no point above it", word.substr(0, 40)));
    return k;
  };
  while (lines.next()) {
    const std::string_view key = lines.word();
    if (key == "v") {
      limit(out.points.size() + 1, kMostListed, "points");
      out.points.push_back(lines.point());
    } else if (key == "f") {
      std::vector<int> corners;
      for (std::string_view word = lines.word(); !word.empty(); word = lines.word())
        corners.push_back(index(word));
      if (corners.size() < 3) lines.wrong("a face has three corners or more");
      limit(out.triangles.size() + corners.size() - 2, kMostTriangles, "triangles");
      for (std::size_t k = 1; k + 1 < corners.size(); ++k)
        out.triangles.push_back({corners[0], corners[k], corners[k + 1]});
    }
  }
  return some(std::move(out));
}

// A binary file may begin with "solid", too: its length tells.
/// STL, as text or binary; equal corners are one point.
TriangleSurface parse_stl(std::string_view bytes) {
  if (bytes.size() >= kStlHead) {
    const std::size_t count = whole(bytes, kStlHead - 4);
    if (bytes.size() == kStlHead + kStlTriangle * count)
      return some(parse_binary_stl(bytes, count));
  }
  if (bytes.substr(0, 5) != "solid")
    throw SurfaceError("is no STL: neither text that begins with \"solid\" nor 84 + 50 n bytes");
  return some(parse_text_stl(bytes));
}

/// MuJoCo's MSH: how many points, normals, texture coordinates and triangles there are, then these.
TriangleSurface parse_msh(std::string_view bytes) {
  constexpr std::size_t kHead = 16, kWord = 4;
  std::size_t count[4] = {};
  for (std::size_t k = 0; k < 4 && bytes.size() >= kHead; ++k) count[k] = whole(bytes, kWord * k);
  const std::size_t faces = kHead + kWord * (3 * count[0] + 3 * count[1] + 2 * count[2]);
  if (bytes.size() != faces + kWord * 3 * count[3] || bytes.empty())
    throw SurfaceError("is no MSH: its length is not that of its numbers");
  limit(count[0], kMostListed, "points");
  limit(count[3], kMostTriangles, "triangles");
  TriangleSurface out;
  for (std::size_t k = 0; k < count[0]; ++k)
    out.points.push_back(point_of(bytes, kHead + 12 * k, "point", k + 1));
  for (std::size_t t = 0; t < count[3]; ++t) {
    std::array<int, 3> corners{};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t corner = whole(bytes, faces + kWord * (3 * t + k));
      if (corner >= count[0])
        throw SurfaceError(fmt::format("triangle {}: {} is no point", t + 1, corner));
      corners[k] = static_cast<int>(corner);
    }
    out.triangles.push_back(corners);
  }
  return some(std::move(out));
}

}  // namespace

// A scene from an untrusted source reads nothing but what lies beside it: no way out of its folder,
// by a link either, and no device.
std::string read_beside(const std::string& of, const std::string& name, std::string& path,
                        const std::string& within) {
  namespace fs = std::filesystem;
  std::error_code error;
  const auto place = [&error](const fs::path& folder) {
    return fs::canonical(folder.empty() ? fs::path(".") : folder, error);
  };
  const fs::path base = place(fs::path(of).parent_path());
  const fs::path fence = within.empty() || error ? base : place(within);
  const fs::path file = error ? fs::path() : fs::canonical(base / name, error);
  if (error || !fs::is_regular_file(file, error))
    throw SurfaceError("there is no such file beside the scene");
  if (std::mismatch(fence.begin(), fence.end(), file.begin(), file.end()).first != fence.end())
    throw SurfaceError(within.empty() ? "must lie in the folder of the scene, or below it"
                                      : "must lie in the folder of --files, or below it");
  path = file.string();
  std::ifstream stream(file, std::ios::binary);
  std::string text = files::read_stream(stream, kLargestPart);
  if (stream.bad() || !stream.eof() || text.size() > kLargestPart)
    throw SurfaceError("cannot be read, or is larger than 64 MiB");
  return text;
}

TriangleSurface parse_triangles(const std::string& name, std::string_view bytes) {
  std::string ending = std::filesystem::path(name).extension().string();
  for (char& c : ending)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  if (ending == ".obj") return parse_obj(bytes);
  if (ending == ".stl") return parse_stl(bytes);
  if (ending == ".msh") return parse_msh(bytes);
  throw SurfaceError("must end in .obj, .stl or .msh: no other mesh is read");
}

Heights parse_heights(std::string_view text) {
  Heights out;
  Lines lines(text, " \t\r,;");
  while (lines.next()) {
    const std::size_t before = out.values.size();
    for (std::string_view word = lines.word(); !word.empty(); word = lines.word()) {
      limit(out.values.size() + 1, kMostListed, "heights");
      out.values.push_back(lines.number(word));
    }
    const int columns = static_cast<int>(out.values.size() - before);
    if (columns == 0) continue;
    if (out.columns == 0) out.columns = columns;
    if (columns != out.columns)
      lines.wrong(fmt::format("has {} heights, the first row {}", columns, out.columns));
  }
  if (out.columns < 2 || out.values.size() < 2 * static_cast<std::size_t>(out.columns))
    throw SurfaceError("needs at least two rows of two heights");
  return out;
}

}  // namespace tether::scene

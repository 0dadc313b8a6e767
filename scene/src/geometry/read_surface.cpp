// Tether: meshes and height fields of a scene file, and the files of surfaces that it names.
// SPDX-License-Identifier: BSD-3-Clause
#include "read_surface.hpp"

#include <Eigen/Core>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "bounds.hpp"

namespace tether::scene {

namespace {

/// More belong to no scene.
constexpr std::size_t kMostTriangles = 2 * kMostListed;

/// An error in a file, by line where it has lines.
class SurfaceError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct TriangleSurface {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<int, 3>> triangles;
};

struct Heights {
  std::vector<double> values;  // row after row
  int columns = 0;
};

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

TriangleSurface parse_binary_stl(std::string_view bytes, std::size_t count) {
  TriangleSurface out;
  Corners corners(out);
  limit(count, kMostTriangles, "triangles");
  for (std::size_t t = 0; t < count; ++t) {
    std::array<Vector3d, 3> corner;
    for (std::size_t k = 0; k < 9; ++k) {
      const std::uint32_t bits = whole(bytes, kStlHead + kStlTriangle * t + 12 + 4 * k);
      float value = 0;
      std::memcpy(&value, &bits, sizeof value);
      if (!std::isfinite(value))
        throw SurfaceError(fmt::format("triangle {}: a number is not finite", t + 1));
      corner[k / 3][static_cast<Eigen::Index>(k % 3)] = static_cast<double>(value);
    }
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

/// Rows of numbers between blanks or commas, at least 2 x 2; # begins a comment.
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

}  // namespace

}  // namespace tether::scene

namespace tether::scene::files {

namespace {

namespace fs = std::filesystem;

// Limits for all bodies together: a file may be named by many, and each reads it.
constexpr std::size_t kMostBytes = 4 * kLargestPart, kMostOfScene = 10 * kMostTriangles;

// A scene from an untrusted source reads nothing but what lies beside it: no way out of its folder,
// by a link either, and no device.
bool read_beside(Fields& in, Reader& r, const std::string& name, std::string& text) {
  std::error_code error;
  const fs::path folder = fs::path(in.place().file).parent_path();
  const fs::path base = fs::canonical(folder.empty() ? fs::path(".") : folder, error);
  const fs::path file = error ? fs::path() : fs::canonical(base / name, error);
  if (error || !fs::is_regular_file(file, error)) {
    in.wrong("file", "there is no such file beside the scene");
    return false;
  }
  if (std::mismatch(base.begin(), base.end(), file.begin(), file.end()).first != base.end()) {
    in.wrong("file", "must lie in the folder of the scene, or below it");
    return false;
  }
  if (r.surface_bytes > kMostBytes) {
    in.wrong("file", "comes after 256 MiB of surfaces that other bodies of the scene have read");
    return false;
  }
  std::ifstream stream(file, std::ios::binary);
  text = read_stream(stream, kLargestPart);
  r.surface_bytes += text.size();
  r.surface_files.insert(file.string());
  if (stream.bad() || !stream.eof() || text.size() > kLargestPart) {
    in.wrong("file", "cannot be read, or is larger than 64 MiB");
    return false;
  }
  return true;
}

// Lets `parse(name, text)` read the file that is named; false: it is missing or wrong.
template <class Parse>
bool from_file(Fields& in, Reader& r, const Parse& parse) {
  const std::string name = in.input_name("file");
  std::string text;
  if (name.empty() || !read_beside(in, r, name, text)) return false;
  try {
    parse(fs::path(name).extension().string(), text);
  } catch (const SurfaceError& e) {
    in.wrong("file", e.what());
    return false;
  }
  return true;
}

bool is_number(const Value& v) { return v.kind() == Value::Kind::number && kAny.holds(v.number()); }

std::vector<std::array<int, 3>> read_triangles(Fields& in, std::size_t points) {
  const Value* value = in.find("triangles");
  bool right = value->kind() == Value::Kind::array && !value->items().empty() &&
               value->items().size() <= kMostTriangles;
  std::vector<std::array<int, 3>> out;
  for (std::size_t k = 0; right && k < value->items().size(); ++k) {
    const std::vector<Value>& corners = value->items()[k].items();
    right = corners.size() == 3;
    for (const Value& c : corners)
      right = right && is_number(c) && c.whole() && c.number() >= 0 &&
              c.number() < static_cast<double>(points);
    if (right)
      out.push_back({static_cast<int>(corners[0].number()), static_cast<int>(corners[1].number()),
                     static_cast<int>(corners[2].number())});
  }
  if (right) return out;
  in.wrong("triangles",
           fmt::format("must be an array of 1 to {} triangles [i, j, k], numbers of points from 0",
                       kMostTriangles));
  return {};
}

// Rows of equal length, at least two of two.
Heights read_rows(Fields& in) {
  const Value* value = in.find("heights");
  Heights out;
  bool right = value->kind() == Value::Kind::array && value->items().size() >= 2;
  for (std::size_t k = 0; right && k < value->items().size(); ++k) {
    const std::vector<Value>& row = value->items()[k].items();
    if (k == 0) out.columns = static_cast<int>(row.size());
    right = row.size() >= 2 && static_cast<int>(row.size()) == out.columns &&
            out.values.size() + row.size() <= kMostListed && all_of(row, is_number);
    if (right)
      for (const Value& each : row) out.values.push_back(each.number());
  }
  if (right) return out;
  in.wrong("heights",
           fmt::format("must be an array of rows of numbers, all of one length, at least "
                       "2 x 2, at most {}, m",
                       kMostListed));
  return {};
}

// Stands for what is wrong.
Shape one_triangle() { return Shape::mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}); }

bool in_range(const Shape& shape) {
  return all_of(shape.points, [](const Eigen::Vector3d& p) {
    return p.allFinite() && p.cwiseAbs().maxCoeff() < 1e100;
  });
}

// All that the bodies of a scene have is bounded, too: few lines repeat a body many times.
bool is_within(Fields& in, Reader& r, const Shape& shape) {
  r.surface_triangles += shape.triangles.size();
  if (r.surface_triangles <= kMostOfScene) return true;
  in.wrong("shape",
           fmt::format("all surfaces of a scene together have at most {} triangles", kMostOfScene));
  return false;
}

bool one_of(Fields& in, const char* inline_key, const char* allowed) {
  if (in.has("file") == in.has(inline_key)) {
    if (in.has("file"))
      in.wrong("file", fmt::format("give file or {}, not both", inline_key));
    else
      in.missing(inline_key, allowed);
    return false;
  }
  return true;
}

}  // namespace

void read_mesh(Fields& in, Reader& r, Shape& shape) {
  shape = one_triangle();
  in.pass_over({"points", "triangles"});
  const double scale = in.number("scale", 1, kPositive, "m in one unit of the points");
  if (!one_of(in, "points", "its corners [[x, y, z], ...], m, and triangles; or a file")) return;
  Shape read = shape;
  if (in.has("points")) {
    if (!in.has("triangles"))
      return in.missing("triangles", "[[i, j, k], ...], numbers of points from 0");
    read.points = in.points("points", 3, kMostListed);
    if (!read.points.empty()) read.triangles = read_triangles(in, read.points.size());
    if (read.points.empty() || read.triangles.empty()) return;
  } else {
    if (in.has("triangles")) return in.wrong("triangles", "are those of the file");
    const bool right = from_file(in, r, [&](const std::string& ending, const std::string& text) {
      if (ending != ".obj" && ending != ".stl")
        throw SurfaceError("must end in .obj or .stl: no other mesh is read");
      TriangleSurface surface = ending == ".obj" ? parse_obj(text) : parse_stl(text);
      read.points = std::move(surface.points);
      read.triangles = std::move(surface.triangles);
    });
    if (!right) return;
  }
  if (scale != 1)
    for (Eigen::Vector3d& p : read.points) p *= scale;
  if (!in_range(read))
    return in.wrong(in.has("file") ? "file" : "points", "reaches beyond 1e100 m");
  if (all_of(read.triangles, [&](const auto& t) {
        const auto corner = [&](std::size_t k) { return read.points[linalg::at(t[k])]; };
        const Eigen::Vector3d a = corner(1) - corner(0), b = corner(2) - corner(0);
        return !(a.cross(b).stableNorm() > 0);
      }))
    return in.wrong(in.has("file") ? "file" : "triangles", "none of the triangles has an area");
  if (is_within(in, r, read)) shape = std::move(read);
}

void read_height_field(Fields& in, Reader& r, Shape& shape) {
  shape = one_triangle();
  in.pass_over({"heights", "file"});
  const double scale = in.number("scale", 1, kPositive, "m in one unit of the heights");
  if (!in.has("spacing")) return in.missing("spacing", "[along x, along y], m, > 0");
  const std::vector<double> spacing = in.numbers("spacing", {2}, "m");
  if (spacing.empty()) return;
  if (!(spacing[0] > 0 && spacing[1] > 0)) return in.wrong("spacing", "each must be > 0, m");
  if (!one_of(in, "heights", "rows [[z, ...], ...] along x, m; or a file")) return;
  Heights heights;
  if (in.has("heights")) {
    heights = read_rows(in);
  } else {
    from_file(in, r,
              [&](const std::string&, const std::string& text) { heights = parse_heights(text); });
  }
  if (heights.columns == 0) return;
  for (double& each : heights.values) each *= scale;
  Shape read = Shape::height_field(heights.values, heights.columns, spacing[0], spacing[1]);
  if (!in_range(read)) return in.wrong("spacing", "the field reaches beyond 1e100 m");
  if (is_within(in, r, read)) shape = std::move(read);
}

}  // namespace tether::scene::files

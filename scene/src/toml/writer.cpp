// Tether: values and tables as TOML. SPDX-License-Identifier: BSD-3-Clause
#include "form.hpp"

#include <cmath>

namespace tether::scene::files {

using Eigen::Vector3d;

// fmt prints the shortest digits that give the same number again; "-0" would be an integer.
std::string toml(double x) { return x == 0 && std::signbit(x) ? "-0.0" : fmt::format("{}", x); }

std::string toml(const std::vector<double>& numbers) {
  std::string out = "[";
  for (const double x : numbers) out += (out.size() > 1 ? ", " : "") + toml(x);
  return out + "]";
}

std::string toml(bool x) { return x ? "true" : "false"; }

std::string toml(int x) { return fmt::format("{}", x); }

std::string toml(const Vector3d& v) { return toml(std::vector<double>{v.x(), v.y(), v.z()}); }

std::string toml(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\')
      out += std::string("\\") + c;
    else if (code < 0x20 || code == 0x7f)
      out += fmt::format("\\u{:04x}", code);
    else
      out += c;
  }
  return out + '"';
}

std::string toml(const std::string& text) { return toml(std::string_view(text)); }

std::string toml(const Eigen::Quaterniond& q) {
  return fmt::format("{{ wxyz = {} }}", toml(std::vector<double>{q.w(), q.x(), q.y(), q.z()}));
}

std::string toml(const std::vector<Vector3d>& points) {
  std::string out = "[";
  for (const Vector3d& p : points) out += (out.size() > 1 ? ", " : "") + toml(p);
  return out + "]";
}

std::string toml(const std::vector<std::array<int, 3>>& triangles) {
  std::string out = "[";
  for (const std::array<int, 3>& t : triangles)
    out += fmt::format("{}[{}, {}, {}]", out.size() > 1 ? ", " : "", t[0], t[1], t[2]);
  return out + "]";
}

std::string toml(const std::vector<std::array<double, 2>>& rows) {
  std::string out = "[";
  for (const std::array<double, 2>& row : rows)
    out += (out.size() > 1 ? ", " : "") + toml(std::vector<double>{row[0], row[1]});
  return out + "]";
}

void Writer::raw(std::string_view key, const std::string& value, std::string_view comment) {
  if (layout_ == Layout::inside) {
    text_ += fmt::format("{}{} = {}", text_.empty() ? "" : ", ", key, value);
    return;
  }
  text_ += fmt::format("{} = {}", key, value);
  if (!comment.empty()) text_ += fmt::format("  # {}", comment);
  text_ += '\n';
}

std::string names(const Scene& scene, const std::vector<int>& bodies) {
  std::string text;
  for (const int body : bodies)
    text +=
        (text.empty() ? "" : ", ") +
        toml(body < 0 ? std::string("world") : scene.bodies[static_cast<std::size_t>(body)].name);
  return "[" + text + "]";
}

}  // namespace tether::scene::files

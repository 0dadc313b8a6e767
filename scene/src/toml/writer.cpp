// Tether: values and tables as TOML. SPDX-License-Identifier: BSD-3-Clause
#include "form.hpp"

#include <cmath>

namespace tether::scene::files {

// fmt prints the shortest digits that give the same number again; "-0" would be an integer.
std::string toml(double x) { return x == 0 && std::signbit(x) ? "-0.0" : fmt::format("{}", x); }

std::string toml(bool x) { return x ? "true" : "false"; }

std::string toml(int x) { return fmt::format("{}", x); }

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

std::string toml(const Eigen::Quaterniond& q) {
  return fmt::format("{{ wxyz = {} }}", toml(std::array{q.w(), q.x(), q.y(), q.z()}));
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
  std::vector<std::string> all;
  for (const int body : bodies)
    all.push_back(body < 0 ? "world" : scene.bodies[linalg::at(body)].name);
  return toml(all);
}

}  // namespace tether::scene::files

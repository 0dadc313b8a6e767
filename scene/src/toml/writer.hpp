// Tether: values and tables as TOML. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>

#include <tether/scene/words.hpp>

namespace tether::scene::files {

/// Read again, each gives the same bits.
std::string toml(double x);
std::string toml(const std::vector<double>& numbers);
std::string toml(bool x);
std::string toml(int x);
std::string toml(const Eigen::Vector3d& v);
std::string toml(std::string_view text);
std::string toml(const std::string& text);
std::string toml(const Eigen::Quaterniond& q);
std::string toml(const std::vector<Eigen::Vector3d>& points);
std::string toml(const std::vector<std::array<int, 3>>& triangles);
std::string toml(const std::vector<std::array<double, 2>>& rows);
template <class E>
std::string toml_word(E value) {
  return toml(word(value));
}

/// Writes tables line by line, or the inside of one in a line.
class Writer {
 public:
  enum class Layout { lines, inside };
  explicit Writer(Layout layout = Layout::lines) : layout_(layout) {}
  void table(std::string_view name) { text_ += fmt::format("\n[{}]\n", name); }
  void item(std::string_view name) { text_ += fmt::format("\n[[{}]]\n", name); }
  template <class T>
  void field(std::string_view key, const T& value, std::string_view comment = "") {
    raw(key, toml(value), comment);
  }
  /// `value` is TOML already.
  void raw(std::string_view key, const std::string& value, std::string_view comment = "");
  std::string take() { return std::move(text_); }

 private:
  Layout layout_;
  std::string text_;
};

/// The names of bodies, -1 being the world: ["a", "world"]
std::string names(const Scene& scene, const std::vector<int>& bodies);

}  // namespace tether::scene::files

// Tether: files that tests write and remove. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>

inline std::string slurp(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream all;
  all << file.rdbuf();
  return all.str();
}

inline void spill(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

struct Temporary {
  std::string path;
  explicit Temporary(const std::string& name) : path(name) {}
  ~Temporary() { std::remove(path.c_str()); }
};

// Files of tests that run scenes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace tether::test {

inline std::string content(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

/// An empty folder of this process's own (others may test here, too), gone when it ends.
inline std::filesystem::path folder(const std::string& name) {
  namespace fs = std::filesystem;
  struct Own {
    fs::path path = fs::temp_directory_path() / ("tether_test_run_" + std::to_string(getpid()));
    ~Own() {
      std::error_code ignored;
      fs::remove_all(path, ignored);
    }
  };
  static const Own own;
  const fs::path path = own.path / name;
  fs::remove_all(path);
  fs::create_directories(path);
  return path;
}

}  // namespace tether::test

// Tether: a file in memory with a path, for readers that take paths. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace tether::fuzz {

class MemoryFile {
 public:
  explicit MemoryFile(const std::string& kind) {
    const std::filesystem::path shared = "/dev/shm";
    const std::filesystem::path folder =
        std::filesystem::is_directory(shared) ? shared : std::filesystem::temp_directory_path();
    path_ = folder / ("tether_fuzz_" + std::to_string(getpid()) + "." + kind);
  }
  ~MemoryFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  void write(const void* data, std::size_t size) const {
    std::ofstream out(path_, std::ios::binary | std::ios::trunc);
    if (!out.write(static_cast<const char*>(data), static_cast<std::streamsize>(size)))
      std::abort();
  }
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

}  // namespace tether::fuzz

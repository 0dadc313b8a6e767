// Tether: loads the module of MPI where it is needed. SPDX-License-Identifier: BSD-3-Clause
#include <dlfcn.h>
#include <fmt/core.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>

#include "program/ranks/ranks.hpp"

namespace tether::scene {

namespace {

// Open MPI; MPICH and others that use its process manager.
int number_of(const char* open_mpi, const char* mpich, int otherwise) {
  for (const char* name : {open_mpi, mpich})
    if (const char* text = std::getenv(name)) return std::atoi(text);
  return otherwise;
}

// Beside the program, as built, or where it is installed.
std::vector<std::filesystem::path> places() {
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
  return {program / "tether_mpi.so",
          (program / TETHER_MODULES / "tether_mpi.so").lexically_normal()};
}

// To say it once is enough: the others end without a word.
[[noreturn]] void refuse_ranks(int count, const std::string& why) {
  const bool silent = number_of("OMPI_COMM_WORLD_RANK", "PMI_RANK", 0) != 0;
  if (silent && !std::freopen("/dev/null", "w", stderr)) std::fclose(stderr);
  throw std::runtime_error(
      fmt::format("{} processes were started for one run, which needs the module tether_mpi.so: {}",
                  count, why));
}

}  // namespace

std::unique_ptr<Ranks> join_ranks() {
  const int count = number_of("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", 1);
  if (count <= 1) return nullptr;
  std::filesystem::path file;
  std::string looked;
  for (const auto& place : places()) {
    std::error_code error;
    if (file.empty() && std::filesystem::exists(place, error)) file = place;
    looked += (looked.empty() ? "" : " or ") + place.string();
  }
  if (file.empty())
    refuse_ranks(
        count,
        fmt::format("there is no {}; it is built where CMake finds MPI (Debian libopenmpi-dev)",
                    looked));
  // MPI's own modules look for its symbols.
  void* module = dlopen(file.c_str(), RTLD_NOW | RTLD_GLOBAL);
  if (!module) refuse_ranks(count, dlerror());
  auto* make = reinterpret_cast<MakeRanks*>(dlsym(module, "tether_make_ranks"));
  std::unique_ptr<Ranks> ranks(make ? make(TETHER_VERSION) : nullptr);
  if (!ranks) refuse_ranks(count, file.string() + " is of another version");
  if (ranks->messages().size() == 1)
    refuse_ranks(count,
                 file.string() + " was built with another MPI than the one that has started them");
  return ranks;
}

}  // namespace tether::scene

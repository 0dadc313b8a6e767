// Tether: mutation of inputs, for compilers without libFuzzer. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace tether::fuzz {

/// The same sequence with every compiler: std::uniform_int_distribution differs between libraries.
class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  std::size_t below(std::size_t n) { return n == 0 ? 0 : engine_() % n; }
  char byte() { return static_cast<char>(engine_()); }

 private:
  std::mt19937 engine_;
};

/// `input` with one to four damages: bits, bytes, cuts, pieces of itself and of `other`, and for
/// texts whole numbers, values and lines, for binary data whole numbers of four or eight bytes.
std::string mutated(const std::string& input, const std::string& other, bool text, Random& random);

}  // namespace tether::fuzz

/// A target reads one input; what it must never do ends the program.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

/// Inputs that the target makes itself, beside those in files; may be empty.
std::vector<std::string> own_corpus();

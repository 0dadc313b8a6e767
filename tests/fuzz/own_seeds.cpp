// Tether: what a target makes itself, for libFuzzer. SPDX-License-Identifier: BSD-3-Clause
//
// libFuzzer begins with files; a target whose inputs are made by the program (saved states) has
// none, and would be given noise for ever. States are longer than libFuzzer's inputs without files:
// -max_len=65536.
#include <algorithm>

#include "driver.hpp"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t most, unsigned seed) {
  static const std::vector<std::string> seeds = own_corpus();
  constexpr std::size_t kNothing = 16;  // bytes: no input of a target that makes its own
  if (!seeds.empty() && size < kNothing) {
    const std::string& one = seeds[seed % seeds.size()];
    if (one.size() <= most) {
      std::copy(one.begin(), one.end(), data);
      return one.size();
    }
  }
  return LLVMFuzzerMutate(data, size, most);
}

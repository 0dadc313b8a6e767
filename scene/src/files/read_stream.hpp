// Tether: the bytes of a stream. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <istream>
#include <string>
#include <vector>

namespace tether::scene::files {

/// All that is left of it, a block more than `most` bytes at most. By blocks: reading a folder, or
/// a file that is truncated meanwhile, fails without a throw.
inline std::string read_stream(std::istream& in, std::size_t most) {
  std::string text;
  std::vector<char> block(std::size_t{1} << 16);
  while (in && text.size() <= most) {
    in.read(block.data(), static_cast<std::streamsize>(block.size()));
    text.append(block.data(), static_cast<std::size_t>(in.gcount()));
  }
  return text;
}

}  // namespace tether::scene::files

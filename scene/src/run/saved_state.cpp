// Tether: the file of a saved state. SPDX-License-Identifier: BSD-3-Clause
#include "saved_state.hpp"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <sstream>
#include <tether/scene/files.hpp>

#include "output/binary.hpp"
#include "output/files.hpp"
#include "plan/engine_type.hpp"

namespace tether::scene {

namespace {

const std::string kFormat = kStateHead;
const std::string kThis = kFormat + "5 " TETHER_VERSION "\n";

// CRC-32 of IEEE 802.3 (polynomial 0x04c11db7, bits reversed): finds every damage of up to 32 bits
// in a row, and any other but for one in 4e9.
std::uint32_t crc32(std::string_view bytes) {
  static const std::array<std::uint32_t, 256> table = [] {
    std::array<std::uint32_t, 256> t{};
    for (std::uint32_t n = 0; n < 256; ++n) {
      std::uint32_t c = n;
      for (int k = 0; k < 8; ++k) c = (c & 1) != 0 ? 0xedb88320u ^ (c >> 1) : c >> 1;
      t[n] = c;
    }
    return t;
  }();
  std::uint32_t c = 0xffffffffu;
  for (const char byte : bytes) c = table[(c ^ static_cast<unsigned char>(byte)) & 0xff] ^ (c >> 8);
  return c ^ 0xffffffffu;
}

// Without blocking: a pipe may never have a writer, and the first signal is only noted.
std::string all_of(const std::string& file, const std::function<bool()>& interrupted) {
  const Open in{open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)};
  if (in.descriptor < 0) throw std::runtime_error("cannot open the saved state " + file);
  // A device has no end; states hold a few hundred bytes a body.
  constexpr std::size_t kLargest = std::size_t{1} << 32;
  std::string all, block(std::size_t{1} << 16, '\0');
  const auto is_state = [&] { return all.compare(0, kFormat.size(), kFormat) == 0; };
  while (all.size() <= kLargest) {
    pollfd ready{in.descriptor, POLLIN, 0};
    if (poll(&ready, 1, 100) <= 0) {  // ms
      if (interrupted && interrupted())
        throw Interrupted("interrupted while the saved state " + file + " was waited for");
      continue;
    }
    const ssize_t count = read(in.descriptor, block.data(), block.size());
    if (count < 0 && (errno == EAGAIN || errno == EINTR)) continue;
    if (count <= 0) break;
    all.append(block.data(), static_cast<std::size_t>(count));
    if (all.size() >= kFormat.size() && !is_state()) break;
  }
  if (!is_state()) throw std::runtime_error(file + " is not a saved state");
  return all;
}

}  // namespace

std::uint64_t hash_of_motion(const Scene& scene, const Plan& plan) {
  Scene moving = scene;
  moving.name.clear();
  moving.end = 1;
  moving.output = Output{};
  moving.expect.clear();
  moving.engine = EngineKind::automatic;
  engine_type(plan.engine).spell_out(moving, true);
  return binary::hash_of(write_scene(moving));
}

void write_state(const std::string& file, std::uint64_t scene, const std::string& content) {
  std::ostringstream out;
  out << kThis;
  binary::Archive io(out);
  io(scene, static_cast<std::uint64_t>(content.size()));
  out << content;
  std::string bytes = out.str();
  std::ostringstream check;
  binary::Archive sum(check);
  sum(crc32(bytes));
  write_whole_regular(file, bytes + check.str());
}

SavedState read_state(const std::string& file, std::uint64_t scene, bool any_scene,
                      const std::function<bool()>& interrupted) {
  const std::string bytes = all_of(file, interrupted);
  const std::size_t line = bytes.find('\n');
  constexpr std::size_t kNumbers = sizeof(std::uint64_t[2]), kCheck = sizeof(std::uint32_t);
  if (line == std::string::npos || bytes.size() < line + 1 + kNumbers + kCheck)
    throw std::runtime_error("the saved state " + file + " is cut off");
  const std::string_view sum = std::string_view(bytes).substr(0, bytes.size() - kCheck);
  std::istringstream check(bytes.substr(sum.size()));
  if (bytes.compare(0, kFormat.size() + 2, kThis, 0, kFormat.size() + 2) != 0)
    throw std::runtime_error(file + " is a saved state of another version of Tether");
  std::uint32_t told = 0;
  binary::Archive of_sum(check);
  of_sum(told);
  if (told != crc32(sum))
    throw std::runtime_error("the saved state " + file + " is damaged: its check sum is wrong");
  std::istringstream head(bytes.substr(line + 1, kNumbers));
  std::uint64_t of = 0, length = 0;
  binary::Archive numbers(head);
  numbers(of, length);
  if (length != sum.size() - (line + 1 + kNumbers))
    throw std::runtime_error("the saved state " + file + " is damaged: its length is wrong");
  const bool same_version = bytes.compare(0, line + 1, kThis) == 0;
  if (!any_scene && !same_version)
    throw std::runtime_error("the saved state " + file + " was written by Tether " +
                             bytes.substr(kFormat.size() + 2, line - kFormat.size() - 2) +
                             ", this is " TETHER_VERSION
                             ": --force goes on from it, with other bits");
  if (!any_scene && of != scene)
    throw std::runtime_error(
        "the saved state " + file +
        " is of another scene, or of another version of it: bodies, effects or options differ; "
        "--force goes on from its positions and velocities");
  return {std::string(sum.substr(line + 1 + kNumbers)),
          same_version && of == scene ? Engine::Restore::exact : Engine::Restore::near};
}

}  // namespace tether::scene

// Tether: one run at a time writes a file. SPDX-License-Identifier: BSD-3-Clause
#include "output_lock.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <stdexcept>

#include "whole_file.hpp"

namespace tether::scene {

namespace {

/// Whether the name still stands for the open file: its last owner may have removed it.
bool is_there(const std::string& name, int descriptor) {
  struct stat open_file {
  }, named{};
  return fstat(descriptor, &open_file) == 0 && stat(name.c_str(), &named) == 0 &&
         open_file.st_ino == named.st_ino && open_file.st_dev == named.st_dev;
}

/// Text of a lock: the number of its process, which a run has written, or what somebody else did.
std::string content(int descriptor) {
  char text[16] = {};
  const ssize_t count = pread(descriptor, text, sizeof text - 1, 0);
  return {text, static_cast<std::size_t>(std::max<ssize_t>(count, 0))};
}

bool is_lock(const std::string& text) {
  return text.find_first_not_of("0123456789\n") == std::string::npos && text.size() < 15;
}

}  // namespace

void OutputLock::take(const std::string& file) {
  std::error_code error;
  const auto there = std::filesystem::status(file, error);
  if (std::filesystem::exists(there) && !std::filesystem::is_regular_file(there)) return;
  make_folder_of(file);
  const std::string name = file + ".lock";
  for (;;) {
    const int descriptor = open(name.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (descriptor < 0) return;  // whoever writes the file says why that cannot be
    if (flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
      const bool busy = errno == EWOULDBLOCK;
      const std::string owner = busy ? content(descriptor) : "";
      close(descriptor);
      if (!busy) return;
      throw std::runtime_error(fmt::format(
          "{} is being written by another run{}: wait for it, or give this one other files "
          "(--output DIR)",
          file, owner.empty() ? "" : " (process " + owner.substr(0, owner.find('\n')) + ")"));
    }
    if (!is_there(name, descriptor)) {
      close(descriptor);
      continue;
    }
    if (!is_lock(content(descriptor))) {
      close(descriptor);
      throw std::runtime_error(name +
                               " is there and is no lock of a run: it stays, and nothing is run");
    }
    const std::string self = fmt::format("{}\n", getpid());
    if (ftruncate(descriptor, 0) != 0 || write(descriptor, self.data(), self.size()) < 0) {
      // Only for the message to a run that is refused.
    }
    held_.push_back({name, descriptor});
    return;
  }
}

OutputLock::~OutputLock() {
  for (const Held& each : held_) {
    unlink(each.name.c_str());  // while it is held, see is_there
    close(each.descriptor);
  }
}

}  // namespace tether::scene

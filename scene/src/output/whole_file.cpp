// Tether: files that are whole or absent. SPDX-License-Identifier: BSD-3-Clause
#include "whole_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <stdexcept>

namespace tether::scene {

namespace fs = std::filesystem;

namespace {

[[noreturn]] void fail(const std::string& file) {
  throw std::runtime_error(fmt::format("cannot write {}: {}", file, std::strerror(errno)));
}

/// A descriptor that is closed in the end.
struct Open {
  int descriptor;
  ~Open() {
    if (descriptor >= 0) close(descriptor);
  }
};

constexpr int kNew = O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC;

void write_all(const Open& out, const std::string& file, std::string_view content, bool lasting) {
  if (out.descriptor < 0) fail(file);
  while (!content.empty()) {
    const ssize_t written = write(out.descriptor, content.data(), content.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) fail(file);
    content.remove_prefix(static_cast<std::size_t>(written));
  }
  if (lasting && fsync(out.descriptor) != 0 && errno != EINVAL && errno != EROFS) fail(file);
}

// A full disk gets its room back.
void write_or_remove(const Open& out, const std::string& file, std::string_view content,
                     bool lasting) {
  try {
    write_all(out, file, content, lasting);
  } catch (...) {
    std::error_code ignored;
    fs::remove(file, ignored);
    throw;
  }
}

// A file that has the name is removed, not written into: it may be a link, a pipe or the second
// name of another file.
void replace(const std::string& file, std::string_view content, bool lasting) {
  unlink(file.c_str());
  const Open out{open(file.c_str(), kNew, 0666)};
  if (out.descriptor < 0) fail(file);
  write_or_remove(out, file, content, lasting);
}

// The name in the folder outlasts a loss of power only with the folder.
void sync_folder_of(const std::string& file) {
  const fs::path folder = fs::path(file).parent_path();
  const Open in{open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
  if (in.descriptor >= 0) fsync(in.descriptor);
}

}  // namespace

int open_to_write(const std::string& file, int flags) {
  struct stat there {};
  const bool is_pipe = stat(file.c_str(), &there) == 0 && S_ISFIFO(there.st_mode);
  if (!is_pipe) return open(file.c_str(), O_WRONLY | O_CLOEXEC | flags, 0666);
  for (;;) {
    const int descriptor = open(file.c_str(), O_WRONLY | O_CLOEXEC | O_NONBLOCK);
    if (descriptor >= 0) {
      fcntl(descriptor, F_SETFL, 0);  // writes wait
      return descriptor;
    }
    if (errno != ENXIO) return -1;
    // A sleep ends by every signal that is handled; open() would go on.
    constexpr timespec kLook{0, 20000000};
    if (nanosleep(&kLook, nullptr) != 0)
      throw Interrupted("interrupted while a reader of " + file + " was waited for");
  }
}

void make_folder_of(const std::string& file) {
  const fs::path folder = fs::path(file).parent_path();
  if (folder.empty()) return;
  std::error_code error;
  fs::create_directories(folder, error);
  if (error)
    throw std::runtime_error(fmt::format("cannot make {}: {}", folder.string(), error.message()));
}

void write_whole_regular(const std::string& file, std::string_view content) {
  make_folder_of(file);
  std::error_code error;
  const fs::file_status there = fs::status(file, error);
  if (fs::exists(there) && !fs::is_regular_file(there))
    throw std::runtime_error("cannot write " + file + ": it is there and is no file");
  const std::string fresh = file + ".new";
  replace(fresh, content, true);
  if (std::rename(fresh.c_str(), file.c_str()) != 0) {
    const int reason = errno;
    fs::remove(fresh, error);
    errno = reason;
    fail(file);
  }
  sync_folder_of(file);
}

void write_whole(const std::string& file, std::string_view content) {
  std::error_code error;
  const fs::file_status there = fs::status(file, error);
  if (fs::exists(there) && !fs::is_regular_file(there))
    write_all(Open{open_to_write(file, 0)}, file, content, false);
  else
    write_whole_regular(file, content);
}

void write_fresh(const std::string& file, std::string_view content) {
  replace(file, content, false);
}

void write_new(const std::string& file, std::string_view content) {
  Open out{open(file.c_str(), kNew, 0666)};
  if (out.descriptor < 0) fail(file);
  write_or_remove(out, file, content, false);
}

void check_writable(const std::string& file) {
  std::error_code error;
  const fs::file_status there = fs::status(file, error);
  if (fs::exists(there) && !fs::is_regular_file(there)) return;  // a device
  make_folder_of(file);
  const std::string trial = file + ".new";
  {
    const Open out{open(trial.c_str(), kNew, 0666)};
    // A file that is there gives way when the new one is written, not before.
    if (out.descriptor < 0 && (errno != EEXIST || fs::is_directory(trial, error))) fail(file);
    if (out.descriptor < 0) return;
  }
  fs::remove(trial, error);
}

}  // namespace tether::scene

// Tether: files that are whole or absent. SPDX-License-Identifier: BSD-3-Clause
#include "files.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <stdexcept>
#include <utility>

namespace tether::scene {

namespace fs = std::filesystem;

namespace {

[[noreturn]] void fail(const std::string& file) {
  throw std::runtime_error(fmt::format("cannot write {}: {}", file, std::strerror(errno)));
}

constexpr int kNew = O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC;

void write_all(int descriptor, const std::string& file, std::string_view content, bool lasting) {
  if (descriptor < 0 || write_bytes(descriptor, content) < content.size()) fail(file);
  if (lasting && fsync(descriptor) != 0 && errno != EINVAL && errno != EROFS) fail(file);
}

// A full disk gets its room back.
void make(const std::string& file, std::string_view content, bool lasting) {
  const Open out{open(file.c_str(), kNew, 0666)};
  if (out.descriptor < 0) fail(file);
  try {
    write_all(out.descriptor, file, content, lasting);
  } catch (...) {
    std::error_code ignored;
    fs::remove(file, ignored);
    throw;
  }
}

// The name in the folder outlasts a loss of power only with the folder.
void sync_folder_of(const std::string& file) {
  const fs::path folder = fs::path(file).parent_path();
  const Open in{open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
  if (in.descriptor >= 0) fsync(in.descriptor);
}

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

Open::~Open() {
  if (descriptor >= 0) close(descriptor);
}

std::size_t write_bytes(int descriptor, std::string_view content) {
  std::size_t done = 0;
  while (done < content.size()) {
    const ssize_t written = write(descriptor, content.data() + done, content.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written == 0) errno = ENOSPC;
    if (written <= 0) break;
    done += static_cast<std::size_t>(written);
  }
  return done;
}

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
    constexpr auto interval = timespec{0, 20000000};  // 20 ms
    if (nanosleep(&interval, nullptr) != 0)
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
  unlink(fresh.c_str());  // it may be a link, a pipe or the second name of another file
  make(fresh, content, true);
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
    write_all(Open{open_to_write(file, 0)}.descriptor, file, content, false);
  else
    write_whole_regular(file, content);
}

void write_fresh(const std::string& file, std::string_view content) {
  unlink(file.c_str());
  make(file, content, false);
}

void write_new(const std::string& file, std::string_view content) { make(file, content, false); }

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

RowFile::RowFile(std::string file, std::size_t kept) : file_(std::move(file)), size_(kept) {
  make_folder_of(file_);
  descriptor_ = open_to_write(file_, O_CREAT | (kept > 0 ? 0 : O_TRUNC));
  if (descriptor_ < 0) fail(file_);
  const auto end = static_cast<off_t>(kept);
  if (kept > 0 && (ftruncate(descriptor_, end) != 0 || lseek(descriptor_, end, SEEK_SET) != end)) {
    close(std::exchange(descriptor_, -1));
    fail(file_);
  }
}

RowFile::~RowFile() {
  if (descriptor_ < 0) return;
  try {
    flush();
    close(descriptor_);
  } catch (const std::exception&) {  // whatever ends this run early has said why
  }
}

void RowFile::flush() {
  const std::size_t done = write_bytes(descriptor_, waiting_);
  if (done < waiting_.size()) {
    const int reason = errno;
    waiting_.resize(done);
    size_ += waiting_.rfind('\n') + 1;  // npos + 1 is 0
    // Rows cannot be taken back from a device or a pipe.
    if (ftruncate(descriptor_, static_cast<off_t>(size_)) != 0) waiting_.clear();
    close(std::exchange(descriptor_, -1));
    errno = reason;
    fail(file_);
  }
  size_ += done;
  waiting_.clear();
}

void RowFile::keep() {
  flush();
  fsync(descriptor_);  // devices have none
}

void OutputLock::take(const std::string& file) {
  std::error_code error;
  const fs::file_status there = fs::status(file, error);
  if (fs::exists(there) && !fs::is_regular_file(there)) return;
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

std::string one_name(const std::string& file) {
  std::error_code error;
  const fs::path whole = fs::weakly_canonical(fs::absolute(file, error), error);
  return error ? file : whole.string();
}

bool names_file(const std::string& path) {
  const fs::path name = fs::path(path).filename();
  return !name.empty() && name != "." && name != "..";
}

std::string identity(const std::string& file) {
  struct stat there {};
  if (stat(file.c_str(), &there) == 0 && S_ISREG(there.st_mode))
    return fmt::format("file {} of device {}", there.st_ino, there.st_dev);
  return one_name(file);
}

bool is_device(const std::string& file) {
  std::error_code error;
  const fs::file_status there = fs::status(file, error);
  return fs::exists(there) && !fs::is_regular_file(there) && !fs::is_directory(there);
}

std::vector<std::string> inputs_of(const Scene& scene) {
  std::vector<std::string> out = scene.surface_files;
  out.push_back(scene.file);
  return out;
}

namespace {

constexpr std::size_t kLongestHead = std::size_t{1} << 16;  // bytes; of a sweep over many numbers

bool is_own(std::string_view head) {
  for (const std::string_view own :
       {kRecordsHead, kEventsHead, kContactsHead, kCostHead, kStateHead, kCertificateHead})
    if (head.substr(0, own.size()) == own) return true;
  const std::string_view mark = kMarkup, line = head.substr(0, head.find('\n'));
  if (line.find(kSweepHead) != std::string_view::npos) return true;
  const std::size_t at = head.find(mark);
  return (line.substr(0, 5) == "<?xml" || line == "<!DOCTYPE html>") && at == line.size() + 1;
}

}  // namespace

void check_replaceable(const std::string& file) {
  for (const char* with : {"", ".new"}) {
    const std::string name = file + with;
    std::error_code error;
    if (!fs::is_regular_file(name, error)) continue;
    std::ifstream in(name, std::ios::binary);
    std::string head(kLongestHead, '\0');
    in.read(head.data(), static_cast<std::streamsize>(head.size()));
    head.resize(static_cast<std::size_t>(in.gcount()));
    if ((in.eof() && head.empty()) || is_own(head)) continue;
    throw std::invalid_argument(
        fmt::format("{} is there and was not written by Tether: --force replaces it", name));
  }
}

}  // namespace tether::scene

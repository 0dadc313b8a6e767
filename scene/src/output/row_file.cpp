// Tether: tables that end with a whole row. SPDX-License-Identifier: BSD-3-Clause
#include "row_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "whole_file.hpp"

namespace tether::scene {

namespace {

constexpr std::size_t kWaiting = 4096;  // bytes; who watches a table sees it grow

}  // namespace

RowFile::RowFile(std::string file, std::size_t kept) : file_(std::move(file)), size_(kept) {
  make_folder_of(file_);
  descriptor_ = open_to_write(file_, O_CREAT | (kept > 0 ? 0 : O_TRUNC));
  if (descriptor_ < 0) fail();
  const auto end = static_cast<off_t>(kept);
  if (kept > 0 && (ftruncate(descriptor_, end) != 0 || lseek(descriptor_, end, SEEK_SET) != end)) {
    close(std::exchange(descriptor_, -1));
    fail();
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

void RowFile::put(std::string_view rows) {
  waiting_ += rows;
  if (waiting_.size() >= kWaiting) flush();
}

void RowFile::flush() {
  std::size_t done = 0;
  while (done < waiting_.size()) {
    const ssize_t written = write(descriptor_, waiting_.data() + done, waiting_.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      const int reason = written == 0 ? ENOSPC : errno;
      waiting_.resize(done);
      size_ += waiting_.rfind('\n') + 1;  // npos + 1 is 0
      // Rows cannot be taken back from a device or a pipe.
      if (ftruncate(descriptor_, static_cast<off_t>(size_)) != 0) waiting_.clear();
      close(std::exchange(descriptor_, -1));
      errno = reason;
      fail();
    }
    done += static_cast<std::size_t>(written);
  }
  size_ += done;
  waiting_.clear();
}

void RowFile::keep() {
  flush();
  fsync(descriptor_);  // devices have none
}

void RowFile::fail() {
  throw std::runtime_error(fmt::format("cannot write {}: {}", file_, std::strerror(errno)));
}

}  // namespace tether::scene

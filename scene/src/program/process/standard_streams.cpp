// Tether: the descriptors that the program starts with, and its text output.
// SPDX-License-Identifier: BSD-3-Clause
#include "standard_streams.hpp"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "output/files.hpp"
#include "record/formats.hpp"

namespace tether::scene {

void guard_standard_streams() {
  for (int descriptor = 0; descriptor <= 2; ++descriptor)
    if (fcntl(descriptor, F_GETFD) < 0 && errno == EBADF)
      if (open("/dev/null", descriptor == 1 ? O_RDONLY : O_RDWR) < 0) return;
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

namespace {

bool reader_left = false;

}  // namespace

StandardOutput::StandardOutput(std::string file) : file_(std::move(file)) {
  if (file_ != "-") return;
  std::fflush(stdout);
  real_ = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3);
  if (real_ < 0 || dup2(STDERR_FILENO, STDOUT_FILENO) < 0)
    throw std::runtime_error(std::string("no standard output: ") + std::strerror(errno));
}

StandardOutput::~StandardOutput() {
  if (real_ < 0) return;
  std::fflush(stdout);
  dup2(real_, STDOUT_FILENO);
  close(real_);
}

void StandardOutput::write(const std::string& content) {
  if (file_ != "-") return write_whole(file_, content);
  std::size_t at = 0;
  while (at < content.size()) {
    const ssize_t n = ::write(real_, content.data() + at, content.size() - at);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno == EPIPE) {
      reader_left = true;
      return;
    }
    if (n <= 0)
      throw std::runtime_error(std::string("cannot write the standard output: ") +
                               std::strerror(errno));
    at += static_cast<std::size_t>(n);
  }
}

int flushed(int status) {
  if (reader_left) return kSignal + SIGPIPE;
  errno = 0;
  const bool failed = std::fflush(stdout) != 0 || std::ferror(stdout) != 0;
  if (!failed) return status;
  const int reason = errno;  // 0: it was an earlier write
  pollfd standard_output{STDOUT_FILENO, POLLOUT, 0};
  const bool left = poll(&standard_output, 1, 0) == 1 && (standard_output.revents & POLLERR) != 0;
  if (reason == EPIPE || left) return kSignal + SIGPIPE;
  std::fprintf(stderr, "tether: cannot write the standard output%s%s\n", reason != 0 ? ": " : "",
               reason != 0 ? std::strerror(reason) : "");
  return kWrong;
}

namespace fs = std::filesystem;

StandardOutputFile::StandardOutputFile(Output& output) {
  std::string* there = nullptr;
  for (const formats::Format* each : formats::all()) {
    std::string& file = output[each->name];
    if (file != "-") continue;
    if (each->film)
      throw std::invalid_argument(std::string(each->name) +
                                  " = \"-\": a film has many files and needs a name");
    if (there != nullptr)
      throw std::invalid_argument("only one output can be -, the standard output");
    there = &file;
  }
  if (there == nullptr) return;
  std::string folder = (fs::temp_directory_path() / "tether-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr)
    throw std::runtime_error("cannot make " + folder + ": " + std::strerror(errno));
  folder_ = folder;
  *there = file_ = (fs::path(folder) / "output").string();
  out_ = std::make_unique<StandardOutput>("-");
}

StandardOutputFile::~StandardOutputFile() {
  std::error_code ignored;
  if (!folder_.empty()) fs::remove_all(folder_, ignored);
}

void StandardOutputFile::copy() {
  if (!out_) return;
  std::ifstream in(file_, std::ios::binary);
  out_->write({std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()});
}

}  // namespace tether::scene

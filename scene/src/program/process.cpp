// Tether: the descriptors that the program starts with, and its text output.
// SPDX-License-Identifier: BSD-3-Clause
#include "program/process.hpp"

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
#include <algorithm>
#include <ctime>
#include <fmt/core.h>
#include <stdexcept>
#include <sys/wait.h>

namespace tether::scene {

void guard_standard_streams() {
  for (int descriptor = 0; descriptor <= 2; ++descriptor)
    if (fcntl(descriptor, F_GETFD) < 0 && errno == EBADF)
      if (open("/dev/null", descriptor == 1 ? O_RDONLY : O_RDWR) < 0) return;
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

namespace fs = std::filesystem;

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
  if (write_bytes(real_, content) == content.size()) return;
  reader_left = errno == EPIPE;
  if (!reader_left)
    throw std::runtime_error(std::string("cannot write the standard output: ") +
                             std::strerror(errno));
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

namespace {

volatile std::sig_atomic_t caught = 0;
std::timespec first{};

// timeout(1), shells and supervisors signal a process and then its group: what comes within a
// second is the same wish. A later one is of somebody who does not want to wait. All calls here are
// safe in a handler (POSIX).
extern "C" void note(int signal) {
  std::timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  if (caught == 0) {
    first = now;
    caught = signal;
    alarm(1);
    return;
  }
  const double seconds = std::difftime(now.tv_sec, first.tv_sec) +
                         1e-9 * static_cast<double>(now.tv_nsec - first.tv_nsec);
  if (seconds < 1) return;
  std::signal(signal, SIG_DFL);
  raise(signal);
}

// Whoever begins to wait in a sleep after the signal (open_to_write) hears of it within a second.
extern "C" void remind(int) { alarm(1); }

}  // namespace

void catch_signals() {
  const auto signals = {SIGINT, SIGTERM, SIGHUP};
  struct sigaction action {};
  action.sa_handler = note;
  action.sa_flags = SA_RESTART;  // calls of the system go on, so that no file is cut
  sigemptyset(&action.sa_mask);
  for (const int signal : signals) sigaddset(&action.sa_mask, signal);
  for (const int signal : signals) {
    struct sigaction before {};
    if (sigaction(signal, nullptr, &before) != 0) continue;
    if (signal == SIGHUP && before.sa_handler == SIG_IGN) continue;
    sigaction(signal, &action, nullptr);
  }
  action.sa_handler = remind;
  sigaction(SIGALRM, &action, nullptr);
}

int caught_signal() { return caught; }

namespace {

struct Job {
  std::size_t number;
  pid_t process;
  int pipe;  // its result comes here, up to the end of the file
  std::string result;
};

Job begin(std::size_t number, const std::function<std::string(std::size_t)>& work) {
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error(std::string("no pipe: ") + std::strerror(errno));
  const pid_t process = fork();
  if (process < 0) {
    const int reason = errno;
    close(ends[0]), close(ends[1]);
    throw std::runtime_error(std::string("no process: ") + std::strerror(reason));
  }
  if (process == 0) {
    close(ends[0]);
    const std::string result = work(number);
    // The parent prints what it has yet to print.
    _exit(write_bytes(ends[1], result) == result.size() ? 0 : 1);
  }
  close(ends[1]);
  return {number, process, ends[0], ""};
}

/// True: more may come.
bool read_some(Job& job) {
  char block[4096];
  const ssize_t n = read(job.pipe, block, sizeof block);
  if (n > 0) job.result.append(block, static_cast<std::size_t>(n));
  return n > 0 || (n < 0 && errno == EINTR);
}

/// Why its process has no result; empty: it has one.
std::string end_of(const Job& job) {
  close(job.pipe);
  int status = 0;
  while (waitpid(job.process, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status)) return fmt::format("its process died of signal {}", WTERMSIG(status));
  if (WEXITSTATUS(status) != 0 || job.result.empty()) return "its process gave no result";
  return "";
}

}  // namespace

std::vector<std::string> WorkerProcesses::run(std::size_t jobs) {
  std::fflush(nullptr);
  std::vector<std::string> results(jobs);
  std::vector<Job> busy;
  std::size_t next = 0, done = 0;
  while (true) {
    const auto to_do = [&] { return next < jobs && !(stopped && stopped()); };
    while (busy.size() < processes_ && to_do()) {
      try {
        busy.push_back(begin(next, work));
      } catch (const std::runtime_error&) {
        if (busy.empty()) throw;
        break;  // with fewer at a time
      }
      ++next;
    }
    if (busy.empty()) return results;
    std::vector<pollfd> pipes;
    for (const Job& each : busy) pipes.push_back({each.pipe, POLLIN, 0});
    if (poll(pipes.data(), pipes.size(), -1) < 0) continue;  // a signal
    for (std::size_t k = busy.size(); k-- > 0;) {
      if (pipes[k].revents == 0 || read_some(busy[k])) continue;
      const std::string why = end_of(busy[k]);
      results[busy[k].number] = why.empty() ? std::move(busy[k].result) : lost(why);
      busy.erase(busy.begin() + static_cast<std::ptrdiff_t>(k));
      if (progress) progress(++done);
    }
  }
}

}  // namespace tether::scene

// Tether: independent jobs in processes of their own. SPDX-License-Identifier: BSD-3-Clause
#include "worker_processes.hpp"

#include <fmt/core.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>

namespace tether::scene {

namespace {

struct Job {
  std::size_t number;
  pid_t process;
  int pipe;  // its result comes here, up to the end of the file
  std::string result;
};

[[noreturn]] void child(int pipe, const std::function<std::string(std::size_t)>& work,
                        std::size_t number) {
  const std::string result = work(number);
  std::size_t at = 0;
  while (at < result.size()) {
    const ssize_t n = write(pipe, result.data() + at, result.size() - at);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) _exit(1);
    at += static_cast<std::size_t>(n);
  }
  _exit(0);  // what the parent has yet to print stays its own
}

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
    child(ends[1], work, number);
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

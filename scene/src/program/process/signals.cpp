// Tether: Ctrl-C and its kind. SPDX-License-Identifier: BSD-3-Clause
#include "signals.hpp"

#include <unistd.h>

#include <csignal>
#include <ctime>
#include <initializer_list>

namespace tether::scene {

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

}  // namespace tether::scene

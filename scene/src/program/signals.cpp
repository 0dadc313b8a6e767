// Tether: Ctrl-C and its kind. SPDX-License-Identifier: BSD-3-Clause
#include "signals.hpp"

#include <csignal>
#include <initializer_list>

namespace tether::scene {

namespace {

volatile std::sig_atomic_t caught = 0;

extern "C" void note(int signal) { caught = signal; }

}  // namespace

void catch_signals() {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    if (sigaction(signal, nullptr, &before) != 0) continue;
    if (signal == SIGHUP && before.sa_handler == SIG_IGN) continue;
    struct sigaction action {};
    action.sa_handler = note;
    // Calls of the system go on, so that no file is cut; a second signal finds no handler.
    action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
    sigemptyset(&action.sa_mask);
    sigaction(signal, &action, nullptr);
  }
}

int caught_signal() { return caught; }

}  // namespace tether::scene

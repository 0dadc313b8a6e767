// Tether: the descriptors that the program starts with, and its text output.
// SPDX-License-Identifier: BSD-3-Clause
#include "standard_streams.hpp"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>

#include "commands.hpp"

namespace tether::scene {

void guard_standard_streams() {
  for (int descriptor = 0; descriptor <= 2; ++descriptor)
    if (fcntl(descriptor, F_GETFD) < 0 && errno == EBADF)
      if (open("/dev/null", O_RDWR) < 0) return;
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

int flushed(int status) {
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

}  // namespace tether::scene

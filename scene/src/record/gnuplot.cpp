// Tether: runs gnuplot. SPDX-License-Identifier: BSD-3-Clause
#include "gnuplot.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <vector>

#include "output/whole_file.hpp"

extern char** environ;

namespace tether::scene {

namespace {

/// A descriptor that is closed in the end.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() { shut(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int number() const { return number_; }
  void shut() {
    if (number_ >= 0) close(number_);
    number_ = -1;
  }

 private:
  int number_;
};

struct Outcome {
  int code;  // 127: there is no gnuplot; 126: it could not be run
  std::string picture;
};

/// gnuplot reads the script from a nameless file and writes to a pipe: no name from a scene reaches
/// it, since it takes names that begin with | for commands.
Outcome execute(const std::string& script) {
  std::FILE* const file = std::tmpfile();
  if (file == nullptr) return {126, ""};
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> in(file, std::fclose);
  int ends[2];
  if (std::fwrite(script.data(), 1, script.size(), file) != script.size() ||
      std::fflush(file) != 0 || lseek(fileno(file), 0, SEEK_SET) != 0 ||
      pipe2(ends, O_CLOEXEC) != 0)
    return {126, ""};
  const Descriptor from(ends[0]);
  Descriptor to(ends[1]);
  // Without the settings in ~/.gnuplot.
  std::string program = "gnuplot", defaults = "--default-settings", standard = "-";
  char* const argv[] = {program.data(), defaults.data(), standard.data(), nullptr};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, fileno(file), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, to.number(), STDOUT_FILENO);
  // Its remarks on empty ranges would only worry; a failure shows in the exit code.
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  // In a group of its own: Ctrl-C ends the run with its picture, not gnuplot.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  pid_t child = 0;
  const int spawned = posix_spawnp(&child, "gnuplot", &actions, &attributes, argv, environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (spawned != 0) return {127, ""};
  to.shut();
  Outcome outcome{126, ""};
  std::vector<char> block(std::size_t{1} << 16);
  for (;;) {
    const ssize_t count = read(from.number(), block.data(), block.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    outcome.picture.append(block.data(), static_cast<std::size_t>(count));
  }
  int status = 0;
  pid_t ended = 0;
  while ((ended = waitpid(child, &status, 0)) < 0 && errno == EINTR) {
  }
  if (ended == child && WIFEXITED(status)) outcome.code = WEXITSTATUS(status);
  return outcome;
}

}  // namespace

std::string picture_head(int width, int height) {
  return fmt::format(
      "set terminal svg size {},{} font 'Helvetica,13' background rgb 'white'\n"
      "set encoding utf8\n"
      "set border 3 lc rgb '#404040'\nset tics nomirror out tc rgb '#202020'\n"
      "set grid xtics ytics lc rgb '#e4e4e4' lt 1 lw 0.6\n",
      width, height);
}

std::string gnuplot(const std::string& script, const std::string& file) {
  const Outcome outcome = execute(script);
  if (outcome.code == 0) {
    write_whole(file, outcome.picture);
    return "";
  }
  const std::string left = file + ".gp";
  write_whole(left, script);
  return outcome.code == 127
             ? "gnuplot is missing (Debian gnuplot-nox): the script is left in " + left
             : fmt::format("gnuplot failed on {} ({})", left, outcome.code);
}

}  // namespace tether::scene

// Tether: runs gnuplot. SPDX-License-Identifier: BSD-3-Clause
#include "gnuplot.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>

extern char** environ;

namespace tether::scene {

namespace {

std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("''") : std::string(1, c);
  return out + "'";
}

/// Exit code of `gnuplot script`; 127: there is no gnuplot.
int execute(const std::string& script) {
  std::string program = "gnuplot", argument = script;
  char* const argv[] = {program.data(), argument.data(), nullptr};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  // Its remarks on empty ranges would only worry; a failure shows in the exit code.
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int spawned = posix_spawnp(&child, "gnuplot", &actions, nullptr, argv, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (spawned != 0) return 127;
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status)) return 126;
  return WEXITSTATUS(status);
}

}  // namespace

std::string picture_head(const std::string& file, int width, int height) {
  return fmt::format(
      "set terminal svg size {},{} font 'Helvetica,13' background rgb 'white'\n"
      "set output {}\nset encoding utf8\n"
      "set border 3 lc rgb '#404040'\nset tics nomirror out tc rgb '#202020'\n"
      "set grid xtics ytics lc rgb '#e4e4e4' lt 1 lw 0.6\n",
      width, height, quoted(file));
}

void check_writable(const std::string& file) {
  const std::string name = file + ".gp";
  if (!std::ofstream(name, std::ios::binary | std::ios::app))
    throw std::runtime_error("cannot write " + name);
  std::error_code ignored;
  std::filesystem::remove(name, ignored);
}

std::string gnuplot(const std::string& script, const std::string& file) {
  const std::string name = file + ".gp";
  {
    std::ofstream out(name, std::ios::binary);
    out << script;
    if (!out.flush()) throw std::runtime_error("cannot write " + name);
  }
  const int code = execute(name);
  if (code != 0)
    return code == 127 ? "gnuplot is missing (Debian gnuplot-nox): the script is left in " + name
                       : fmt::format("gnuplot failed on {} ({})", name, code);
  std::error_code ignored;
  std::filesystem::remove(name, ignored);
  return "";
}

}  // namespace tether::scene

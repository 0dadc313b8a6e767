// Tether: the descriptors that the program starts with, and its text output.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace tether::scene {

/// Descriptors 0 to 2 that are closed become /dev/null, so that no file of a run gets their number
/// and what is printed; the standard output so that a write to it is an error. A pipe that is
/// closed and a limit of file sizes become errors of the write in place of signals: a run whose
/// reader has left still ends with whole files.
void guard_standard_streams();

/// The standard output while a file called "-" is written there: all other text goes to the
/// standard error, so that the two do not mix.
class StandardOutput {
 public:
  /// `file`: "-" or any other name, with which `write` replaces that file.
  explicit StandardOutput(std::string file);
  ~StandardOutput();
  StandardOutput(const StandardOutput&) = delete;
  StandardOutput& operator=(const StandardOutput&) = delete;

  /// Throws std::runtime_error; where the reader of a pipe has left, `flushed` says so later.
  void write(const std::string& content);

 private:
  std::string file_;
  int real_ = -1;  // descriptor of the standard output; -1: untouched
};

/// `status`, or what the program exits with since its text was lost: 128 + SIGPIPE without a word
/// when the reader of a pipe has left, as shells know it, else kWrong with the reason.
int flushed(int status);

}  // namespace tether::scene

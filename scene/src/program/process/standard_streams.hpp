// Tether: the descriptors that the program starts with, and its text output.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/scene.hpp>

namespace tether::scene {

/// Exit codes of `tether`.
enum ExitCode : int {
  kGood = 0,
  kNotMet = 1,   ///< an [[expect]] does not hold, a contact problem is not solved
  kWrong = 2,    ///< a file, a scene or an option is wrong; nothing was run
  kFailed = 3,   ///< the run could not go on
  kSignal = 128  ///< and the number of the signal that ended it, as shells have it
};

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

/// The output that is called "-" is a file in a folder of its own while the run goes, so that it is
/// whole before its first byte leaves. Nothing without such an output.
class StandardOutputFile {
 public:
  /// Replaces "-" in `output`. std::invalid_argument where there are two, or where it is a film,
  /// which has many files.
  explicit StandardOutputFile(Output& output);
  ~StandardOutputFile();
  StandardOutputFile(const StandardOutputFile&) = delete;
  StandardOutputFile& operator=(const StandardOutputFile&) = delete;

  void copy();

 private:
  std::string folder_, file_;
  std::unique_ptr<StandardOutput> out_;
};

}  // namespace tether::scene

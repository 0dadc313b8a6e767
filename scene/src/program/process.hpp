// Tether: the descriptors that the program starts with, and its text output.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <tether/scene/scene.hpp>
#include <vector>

namespace tether::scene {

/// From now on the first SIGINT, SIGTERM or SIGHUP is only noted; one that comes a second later or
/// more ends the program. SIGHUP stays ignored where it is (nohup).
void catch_signals();

/// 0: none yet.
int caught_signal();

/// Exit codes of `tether`.
enum ExitCode : int {
  kGood,
  kNotMet,       ///< an [[expect]] does not hold, a contact problem is not solved
  kWrong,        ///< a file, a scene or an option is wrong; nothing was run
  kFailed,       ///< the run could not go on
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

/// Some processes do jobs 0 to n - 1, each the next one that nobody has begun. A job whose process
/// dies is lost, the others go on.
class WorkerProcesses {
 public:
  explicit WorkerProcesses(unsigned processes) : processes_(processes) {}

  std::function<std::string(std::size_t)> work;         ///< in a process of its own
  std::function<std::string(const std::string&)> lost;  ///< result of a job whose process died
  std::function<bool()> stopped;                        ///< true: no more jobs are begun
  std::function<void(std::size_t)> progress;            ///< jobs that are done

  /// Results in the order of the jobs; empty: not begun. Throws std::runtime_error where there are
  /// no processes to be had.
  std::vector<std::string> run(std::size_t jobs);

 private:
  unsigned processes_;
};

}  // namespace tether::scene

// Tether: files that are whole or absent. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tether/scene/scene.hpp>
#include <vector>

namespace tether::scene {

/// The path in one spelling; links are followed as far as they exist.
std::string one_name(const std::string& file);
/// Whether a path ends in a name.
bool names_file(const std::string& path);
/// The same for all spellings of a path, and for second names of a file.
std::string identity(const std::string& file);
/// Something there that is neither a file nor a folder.
bool is_device(const std::string& file);

/// The scene and what was read with it.
std::vector<std::string> inputs_of(const Scene& scene);

// By these a later run knows which files it may replace.
constexpr const char* kRecordsHead =
    "time_s,kinetic_energy_J,potential_energy_J,energy_J,energy_change_J,momentum_x,momentum_y,"
    "momentum_z,angular_momentum_x,angular_momentum_y,angular_momentum_z,drift";
constexpr const char* kEventsHead =
    "time_s,kind,first,second,normal_speed_before_m_per_s,normal_speed_after_m_per_s,"
    "energy_lost_J,impulse_x_N_s,impulse_y_N_s,impulse_z_N_s,joint\n";
constexpr const char* kContactsHead =
    "time_s,first,second,x_m,y_m,z_m,normal_x,normal_y,normal_z,gap_m,normal_force_N,fx_N,fy_N,"
    "fz_N,slip_x_m_per_s,slip_y_m_per_s,slip_z_m_per_s\n";
constexpr const char* kCostHead =
    "method,setting,error,seconds,steps,contact_problems,drift,penetration_m,expectations_met,"
    "status\n";
/// Behind the numbers that a sweep varies.
constexpr const char* kSweepHead =
    "status,met,expectations,time_s,start_energy_J,end_energy_J,lowest_change_J,largest_change_J,"
    "drift,penetration_m,residual,contacts,steps,contact_problems,unsolved,seconds";
constexpr const char* kStateHead = "tether state ";
constexpr const char* kCertificateHead = "tether certificate ";
/// In a line of its own near the beginning of XML and HTML.
constexpr const char* kMarkup = "<!-- written by Tether -->\n";

/// Throws std::invalid_argument if the file, or what it is called while it is made, is there and
/// was not written by Tether. Empty files, and what is no regular file, hold nothing that is lost.
void check_replaceable(const std::string& file);

/// Somebody does not want to wait for the other end of a pipe.
struct Interrupted : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A descriptor that is closed in the end.
struct Open {
  int descriptor;
  ~Open();
};

/// write(2) until all is written or no more can be, for the reason in errno: how many bytes are.
std::size_t write_bytes(int descriptor, std::string_view content);

/// open(2) with O_WRONLY and these flags. A pipe without a reader is waited for until a signal
/// comes that somebody handles: Interrupted.
int open_to_write(const std::string& file, int flags);

/// Makes the folder of a file. Throws std::runtime_error.
void make_folder_of(const std::string& file);

/// Replaces the file atomically: a reader finds the old content or all of the new one, also after a
/// loss of power. A target that is not a regular file (/dev/stdout) is written to. Throws
/// std::runtime_error.
void write_whole(const std::string& file, std::string_view content);

/// The same, but an existing target must be a regular file.
void write_whole_regular(const std::string& file, std::string_view content);

/// A file that nobody reads before the run has named it elsewhere: gone again where it could not be
/// written. What had its name is removed first. Throws std::runtime_error.
void write_fresh(const std::string& file, std::string_view content);

/// The same where nothing has the name; what has it stays, and std::runtime_error says so.
void write_new(const std::string& file, std::string_view content);

/// The error of `write_whole` before the work is done; makes the folder.
void check_writable(const std::string& file);

/// A file to which whole rows are added. Where the disk is full or the run ends early it is cut
/// back to its last whole row; rows leave together, so that a run that is killed leaves whole ones,
/// too.
class RowFile {
 public:
  /// Makes its folder. The first `kept` bytes of a file that is there stay and are safe at every
  /// instant; 0: it is a new one. Throws std::runtime_error, as all of these.
  RowFile(std::string file, std::size_t kept);
  ~RowFile();
  RowFile(const RowFile&) = delete;
  RowFile& operator=(const RowFile&) = delete;

  /// One or more rows, each with its end.
  void put(std::string_view rows) {
    waiting_ += rows;
    // Who watches a table sees it grow.
    if (waiting_.size() >= 4096) flush();
  }
  void flush();
  /// Makes what was put outlast a loss of power.
  void keep();
  const std::string& name() const { return file_; }

 private:
  std::string file_, waiting_;
  int descriptor_;
  std::size_t size_;  // of the rows in the file
};

/// Holds FILE.lock for each file that a run writes. The system lets go of it when the process ends,
/// however it ends: a lock file that is left behind locks nothing.
class OutputLock {
 public:
  OutputLock() = default;
  ~OutputLock();
  OutputLock(const OutputLock&) = delete;
  OutputLock& operator=(const OutputLock&) = delete;

  /// Throws std::runtime_error if another run writes the file now. Makes its folder. Files that are
  /// no regular files (/dev/null) have no lock, nor have folders without locks (some networks).
  void take(const std::string& file);

 private:
  struct Held {
    std::string name;
    int descriptor;
  };
  std::vector<Held> held_;
};

}  // namespace tether::scene

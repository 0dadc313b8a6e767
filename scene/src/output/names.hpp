// Tether: what a run writes. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/scene.hpp>

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
/// In a line of its own near the beginning of XML and HTML.
constexpr const char* kMarkup = "<!-- written by Tether -->\n";

/// Throws std::invalid_argument if the file, or what it is called while it is made, is there and
/// was not written by Tether. Empty files, and what is no regular file, hold nothing that is lost.
void check_replaceable(const std::string& file);

}  // namespace tether::scene

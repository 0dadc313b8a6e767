// Tether: planar rods joined by pins, with redundant rows. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// "index 1" (q, v, lam) and "index 0" (q, v), where q holds x, y of the centre and the angle of
/// each rod.
///
/// - "index 1": M v' = f - G^T lam, 0 = g'' - epsilon lam. Where rows are redundant or rank
///   drops, epsilon > 0 picks the multipliers of least norm and moves the accelerations by
///   O(epsilon). The multipliers are then known to round-off / epsilon only: their absolute
///   tolerance is scaled by 1e4. Without projection the turning parallelogram leaves its branch at
///   the flat position.
/// - "index 0": q' = v, v' = a with a from Gauss' principle (least constraint) by a complete
///   orthogonal decomposition that drops singular values below 1e-6 of the largest.
///
/// Rows: "position", "velocity" (two for each pin), "energy"; recommended are all, but
/// for the parallelogram in form "index 0" not the energy: 25 rows would exceed its 24 unknowns.
/// The error is taken over q.
std::vector<std::string> pinned_rods_forms();

/// N-four-bar: N + 1 vertical and N horizontal rods (1 m, 1 kg) between pins (i, 0) and (i, 1),
/// gravity 9.81; it starts upright and the tops move with 1 m/s in x. 6N + 3 coordinates, 6N + 2
/// rows; they lose rank by N whenever the vertical rods lie flat, about twice a second.
Problem n_four_bar(int N, double t_end, const std::string& form, double epsilon = 1e-8);

/// Three parallel cranks (1 m, 1 kg; pivots at x = 0, 1, 2) with a coupler of 2 m and 2 kg: 12
/// coordinates and 12 rows of rank 11, 10 when flat. `angle` from downward in rad, `speed` in
/// rad/s, gravity 9.81.
Problem parallelogram(double angle, double speed, double t_end, const std::string& form,
                      double epsilon = 1e-8);

/// Five rods (1 m, 1 kg), or ten (0.1 m, 0.1 kg), in a row from a pin at the origin, released at
/// rest along the x axis. No redundant rows; E = 0. Small differences grow fast: 3600-fold by t = 5
/// for the five rods. Reference at any t_end from the absolute angles in long double.
Problem five_link_chain(double t_end, const std::string& form);
Problem ten_link_chain(double t_end, const std::string& form);

/// Angle from the upward vertical and its rate: the exact motion of the N-four-bar.
void n_four_bar_exact(int N, double t, double* angle, double* speed);
/// The same for the parallelogram, from downward.
void parallelogram_exact(double angle0, double speed0, double t, double* angle, double* speed);

}  // namespace tether::problems

// Tether: torque-free rigid body. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>

namespace tether::problems {

/// "regular" w0 = (1, 0, 1), "euler" (1, 1, 1), "dzhanibekov" (0.01, 1, 0).
std::vector<std::string> rigid_body_motions();

/// Body with principal moments of inertia (1, 2, 3): attitude quaternion q (scalar first, body to
/// space, identity at the start) and angular velocity w in the body frame, an ordinary differential
/// equation in (q, w).
///
/// Rows: "quaternion norm" (|q|^2 - 1)/2, "energy" 2T, "angular momentum" (space vector, 3 rows).
/// Their five rows are independent except where the body rotates steadily. Reference at any t_end.
Problem rigid_body(const std::string& motion, double t_end);

}  // namespace tether::problems

// Tether: the index of a linear system (method, eq. 15). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace tether::ida_projection {

/// How often equations of E y' + A y = f have to be differentiated until they determine y': 0, 1,
/// 2, ..., by shuffles (Luenberger 1978). E, A: n x n, good to difference quotients. -1: more than
/// four times, or never.
int differential_index(Eigen::MatrixXd E, Eigen::MatrixXd A);

}  // namespace tether::ida_projection

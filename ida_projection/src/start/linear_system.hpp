// Tether: what a linear system of difference quotients determines. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace tether::ida_projection {

/// Columns that the matrix does not determine: those with an entry in a null vector. Columns are
/// scaled to 1, and rows where their units differ. Empty: none, or not known.
std::vector<char> undetermined_columns(Eigen::MatrixXd a, bool scale_rows);

/// How often equations of E y' + A y = f have to be differentiated until they determine y': 0, 1,
/// 2, ..., by shuffles (Luenberger 1978; method, eq. 15). E, A: n x n. -1: more than four times, or
/// never.
int differential_index(Eigen::MatrixXd E, Eigen::MatrixXd A);

}  // namespace tether::ida_projection

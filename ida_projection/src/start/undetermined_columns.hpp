// Tether: unknowns that a linear system does not determine. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace tether::ida_projection {

/// Columns that the matrix does not determine: those with an entry in a null vector, of a matrix of
/// difference quotients. Columns are scaled to 1, and rows where their units differ. Empty: none,
/// or not known.
std::vector<char> undetermined_columns(Eigen::MatrixXd a, bool scale_rows);

}  // namespace tether::ida_projection

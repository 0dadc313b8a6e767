// Tether: singular values of a dense matrix. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/export.hpp>
#include <tether/linalg/eigen.hpp>

TETHER_EXPORT_BEGIN
namespace tether::linalg {

/// They descend; min(rows, columns) of them. Jacobi's rotations of Eigen, compiled once.
VectorX singular_values(MatrixView A);

}  // namespace tether::linalg
TETHER_EXPORT_END

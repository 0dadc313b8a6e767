// Tether: linear algebra shared by the projection and the contact solvers.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/anderson.hpp>
#include <tether/linalg/block3.hpp>
#include <tether/linalg/block_lu.hpp>
#include <tether/linalg/cone_scaling.hpp>
#include <tether/linalg/convex_hull.hpp>
#include <tether/linalg/disjoint_sets.hpp>
#include <tether/linalg/friction_cone.hpp>
#include <tether/linalg/index.hpp>
#include <tether/linalg/least_squares.hpp>
#include <tether/linalg/minimum_norm.hpp>
#include <tether/linalg/pi.hpp>
#include <tether/linalg/pivoted_qr.hpp>
#include <tether/linalg/shortest_turn.hpp>
#include <tether/linalg/singular_values.hpp>
#include <tether/linalg/small_lu.hpp>
#include <tether/linalg/sparse_minimum_norm.hpp>
#include <tether/linalg/symmetric_eigen.hpp>

/// Linear algebra that the projection and the contact solvers share.
namespace tether::linalg {}

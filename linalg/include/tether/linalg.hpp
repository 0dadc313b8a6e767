// Tether: linear algebra shared by the projection and the contact solvers.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/minimum_norm.hpp>
#include <tether/linalg/small_lu.hpp>
#include <tether/linalg/sparse_minimum_norm.hpp>

// Tether: constraint projection for SUNDIALS IDA. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/ida_projection/builders.hpp>
#include <tether/ida_projection/constraints.hpp>
#include <tether/ida_projection/fast.hpp>
#include <tether/ida_projection/options.hpp>
#include <tether/ida_projection/projection.hpp>
#include <tether/ida_projection/statistics.hpp>

/// Constraint projection inside SUNDIALS IDA.
namespace tether::ida_projection {}

// Tether: constraint projection for SUNDIALS IDA. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <tether/export.hpp>
#include <tether/ida_projection/constraints.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::ida_projection {

// Each set knows which lengths of y it can be evaluated on (Constraints::least_unknowns): an index
// beyond the unknowns is refused when the set is attached.

/// |q|^2 = 1 for the four components y[first .. first + 3], as (|q|^2 - 1)/2 = 0.
Constraints quaternion_norm(int first, std::string name = "quaternion norm");

/// sum_j coefficients[j] y[j] = value; coefficients.size() must be N.
Constraints linear_invariant(std::vector<double> coefficients, double value,
                             std::string name = "linear invariant");

/// Scalar function of the state, H(y).
using ScalarFunction = std::function<double(ConstVector y)>;
/// Its gradient dH/dy; `gradient` is zero on entry.
using GradientFunction = std::function<void(ConstVector y, Vector gradient)>;

/// H(y) = value for any first integral H.
Constraints invariant(ScalarFunction H, GradientFunction gradient, double value,
                      std::string name = "invariant");

/// H(y) - y[work] = value: energy balance. `work` is the index of a state with w' = power of the
/// forces that H does not contain (drives, dampers); -1 for a conservative system.
Constraints energy(ScalarFunction H, GradientFunction gradient, double value, int work = -1,
                   std::string name = "energy");

}  // namespace tether::ida_projection
TETHER_EXPORT_END

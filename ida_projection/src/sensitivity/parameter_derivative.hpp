// Tether: the derivative of the constraints by a parameter. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <tether/ida_projection/sensitivities.hpp>
#include <vector>

namespace tether::ida_projection {

/// dg/dp_k: the caller's function, extrapolated central differences of g in p_k, or zero.
class ParameterDerivative {
 public:
  using Values = std::function<Status(double t, N_Vector y, double* g)>;

  explicit ParameterDerivative(Sensitivities given) : given_(std::move(given)) {}

  /// The first `rows` values of `g_p`. `value`: g, for differences, as many values as g_p has.
  Status evaluate(double t, N_Vector y, int parameter, std::size_t rows, const Values& value,
                  std::vector<double>& g_p);
  const Sensitivities& given() const { return given_; }
  /// The call that failed; empty where it was g itself.
  const std::string& message() const { return message_; }

 private:
  Status checked(int flag, int parameter, const std::string& thrown);
  Status differences(double t, N_Vector y, int parameter, const Values& value,
                     std::vector<double>& g_p);

  Sensitivities given_;
  std::string message_;
  std::vector<double> shifted_;
};

}  // namespace tether::ida_projection

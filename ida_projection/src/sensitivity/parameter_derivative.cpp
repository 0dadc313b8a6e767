// Tether: the derivative of the constraints by a parameter. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "constraints/evaluator.hpp"
#include "host/shortest.hpp"
#include "sensitivity/corrector.hpp"

namespace tether::ida_projection {

namespace {

// A part of the parameter's scale: rounding of g over it, and its fourth power, both are 1e-12.
constexpr double kIncrement = 1e-3;

// A parameter of the host, put back whatever happens.
struct Shifted {
  double* p;
  double value = *p;
  ~Shifted() { *p = value; }
};

}  // namespace

// dg/dp_k for the rows of the caller: the caller's function, extrapolated central differences of g
// in p_k, or zero.
Status SensitivityCorrector::derivative(int k, double t, N_Vector y) {
  std::vector<double>& g_p = row_terms_[static_cast<std::size_t>(k)];
  std::fill(g_p.begin(), g_p.end(), 0.0);
  const auto name = [k] { return "dg/dp of parameter " + std::to_string(k); };
  if (given_.derivative || given_.vector_derivative) {
    std::string thrown;
    const auto call = [&] {
      if (given_.vector_derivative) return given_.vector_derivative(t, y, k, g_p.data());
      return given_.derivative(t, ConstVector(N_VGetArrayPointer(y), N_VGetLength(y)), k,
                               Vector(g_p.data(), state_.constraints_.total_count()));
    };
    const int flag = guarded(call, thrown);
    if (flag != 0)
      message_ =
          name() + (thrown.empty() ? " returned " + std::to_string(flag) : " threw: " + thrown);
    if (flag != 0) return flag > 0 ? Status::callback_recoverable : Status::callback_fatal;
  } else if (given_.parameters != nullptr) {
    const Status status = differences(k, t, y, g_p);
    if (status != Status::success) return status;
  }
  if (all_finite(g_p.data(), g_p.size())) return Status::success;
  message_ = name() + " is not finite at t = " + brief(t);
  return Status::not_finite;
}

Status SensitivityCorrector::differences(int parameter, double t, N_Vector y,
                                         std::vector<double>& g_p) {
  const auto k = static_cast<std::size_t>(parameter);
  const Shifted p{given_.parameters + (given_.list.empty() ? parameter : given_.list[k])};
  const double size = std::abs(given_.scales.empty() ? p.value : given_.scales[k]);
  // A power of two: p + d - p is d.
  const double d = std::exp2(std::round(std::log2(kIncrement * (size > 0.0 ? size : 1.0))));
  shifted_.resize(g_p.size());
  return central_differences(d, g_p, shifted_, [&](double e, std::vector<double>& g) {
    *p.p = p.value + e;
    return rows_->value(t, y, g.data());
  });
}

}  // namespace tether::ida_projection

// Tether: the derivative of the constraints by a parameter. SPDX-License-Identifier: BSD-3-Clause
#include "sensitivity/parameter_derivative.hpp"

#include <algorithm>
#include <cmath>

#include "constraints/evaluator.hpp"
#include "host/shortest.hpp"

namespace tether::ida_projection {

namespace {

// A part of the parameter's scale: rounding of g over it, and its fourth power, both are 1e-12.
constexpr double kIncrement = 1e-3;

// A parameter of the host, put back whatever happens.
class Shifted {
 public:
  explicit Shifted(double* p) : p_(p), value_(*p) {}
  ~Shifted() { *p_ = value_; }
  Shifted(const Shifted&) = delete;
  Shifted& operator=(const Shifted&) = delete;
  void by(double increment) { *p_ = value_ + increment; }

 private:
  double* p_;
  double value_;
};

}  // namespace

Status ParameterDerivative::evaluate(double t, N_Vector y, int parameter, std::size_t rows,
                                     const Values& value, std::vector<double>& g_p) {
  message_.clear();
  std::fill(g_p.begin(), g_p.end(), 0.0);
  Status status = Status::success;
  if (given_.derivative || given_.vector_derivative) {
    std::string thrown;
    const int flag = guarded(
        [&] {
          if (given_.vector_derivative)
            return given_.vector_derivative(t, y, parameter, g_p.data());
          return given_.derivative(t, ConstVector(N_VGetArrayPointer(y), N_VGetLength(y)),
                                   parameter, Vector(g_p.data(), static_cast<Eigen::Index>(rows)));
        },
        thrown);
    status = checked(flag, parameter, thrown);
  } else if (given_.parameters != nullptr) {
    status = differences(t, y, parameter, value, g_p);
  }
  if (status != Status::success || all_finite(g_p.data(), g_p.size())) return status;
  message_ =
      "dg/dp of parameter " + std::to_string(parameter) + " is not finite at t = " + brief(t);
  return Status::not_finite;
}

Status ParameterDerivative::checked(int flag, int parameter, const std::string& thrown) {
  if (flag == 0) return Status::success;
  message_ = "dg/dp of parameter " + std::to_string(parameter) +
             (thrown.empty() ? " returned " + std::to_string(flag) : " threw: " + thrown);
  return flag > 0 ? Status::callback_recoverable : Status::callback_fatal;
}

// (8 (g(p + d) - g(p - d)) - (g(p + 2 d) - g(p - 2 d))) / 12 d, of fourth order.
Status ParameterDerivative::differences(double t, N_Vector y, int parameter, const Values& value,
                                        std::vector<double>& g_p) {
  const auto k = static_cast<std::size_t>(parameter);
  double* p = given_.parameters + (given_.list.empty() ? parameter : given_.list[k]);
  const double size = std::abs(given_.scales.empty() ? *p : given_.scales[k]);
  // A power of two: p + d - p is d.
  const double d = std::exp2(std::round(std::log2(kIncrement * (size > 0.0 ? size : 1.0))));
  shifted_.resize(g_p.size());
  Shifted moved(p);
  for (const auto& [steps, weight] :
       {std::pair{1.0, 8.0}, {-1.0, -8.0}, {2.0, -1.0}, {-2.0, 1.0}}) {
    moved.by(steps * d);
    const Status status = value(t, y, shifted_.data());
    if (status != Status::success) return status;
    for (std::size_t i = 0; i < g_p.size(); ++i) g_p[i] += weight * shifted_[i];
  }
  for (double& entry : g_p) entry /= 12.0 * d;
  return Status::success;
}

}  // namespace tether::ida_projection

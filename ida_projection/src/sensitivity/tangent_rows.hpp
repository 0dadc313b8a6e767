// Tether: moves of sensitivities onto the tangent of the constraints.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <sundials/sundials_nvector.h>
#include <utility>
#include <vector>

#include "attach/impl.hpp"

namespace tether::ida_projection {

/// slope <- d values / de at e = 0, of fourth order: at(e, values) evaluates them four times.
template <class At>
Status central_differences(double e, std::vector<double>& slope, std::vector<double>& values,
                           At at) {
  std::fill(slope.begin(), slope.end(), 0.0);
  for (const auto& [steps, weight] :
       {std::pair{1.0, 8.0}, {-1.0, -8.0}, {2.0, -1.0}, {-2.0, 1.0}}) {
    const Status status = at(steps * e, values);
    if (status != Status::success) return status;
    for (std::size_t i = 0; i < slope.size(); ++i) slope[i] += weight / (12.0 * e) * values[i];
  }
  return Status::success;
}

/// C at one state, and the shortest ds with C ds = r there. The rows are linear in s, so that one
/// move leaves rounding only. Rows that are dependent on the set have dependent derivatives there,
/// up to an error as large as the distance from the set. Rows whose independent part is below a
/// thousandth therefore take no part.
class TangentRows : public Companion {
 public:
  virtual int rows() const = 0;
  /// g(t, y) itself, for differences in parameters.
  virtual Status value(double t, N_Vector y, double* g) = 0;
  /// C(t, y); `weights`: reciprocal tolerances of y; `id` as in RowsAt::set_algebraic().
  virtual Status evaluate(double t, N_Vector y, N_Vector weights, N_Vector id) = 0;
  /// Its factors in the metric D, one entry for each component.
  virtual Status factor(N_Vector D) = 0;
  /// r = C s, with the accuracy that g allows, whatever C is good for.
  virtual Status product(N_Vector s, double* r) = 0;
  virtual void solve(const std::vector<double>& r, N_Vector ds) = 0;
  virtual void forget_failure() {}

  const std::string& message() const { return message_; }

 protected:
  std::string message_;
};

/// As make_..._mover() in movers/mover.hpp.
std::unique_ptr<TangentRows> make_contiguous_tangent(const Constraints&, const Options&,
                                                     Statistics&, int size);
std::unique_ptr<TangentRows> make_gradient_tangent(const Constraints&, Statistics&, N_Vector like);

/// Chooses between them by the kind of the rows.
inline std::unique_ptr<TangentRows> make_tangent_rows(const Constraints& rows,
                                                      const Options& options,
                                                      Statistics& statistics, N_Vector like) {
  if (std::holds_alternative<Gradients>(rows.jacobian))
    return make_gradient_tangent(rows, statistics, like);
  return make_contiguous_tangent(rows, options, statistics, static_cast<int>(N_VGetLength(like)));
}

}  // namespace tether::ida_projection

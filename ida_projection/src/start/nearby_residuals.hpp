// Tether: what F notices near a candidate. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <tether/ida_projection/statistics.hpp>
#include <utility>
#include <vector>

#include "host/corrector.hpp"
#include "host/owned_vector.hpp"
#include "host/rounding.hpp"

namespace tether::ida_projection {

/// F near a point, with y or y' of some components changed, through IDA's own callback, which
/// evaluates F(t, ypred + ycor, yppred + cj ycor). ypred is replaced for each evaluation and put
/// back: where only y' is to change, by ycor, y is the same to the last bit. Contiguous vectors.
class NearbyResiduals {
 public:
  enum class Of { values, rates };

  /// y_j changes by change[j], y'_j by cj change[j], around y (null: the prediction), whose values
  /// are rounded to fit. One evaluation of F here, and one in each call.
  NearbyResiduals(const Candidate& candidate, Corrector& corrector, Statistics& statistics,
                  std::vector<double> change, N_Vector around = nullptr)
      : candidate_(candidate),
        corrector_(corrector),
        statistics_(statistics),
        change_(std::move(change)),
        low_(change_.size()),
        point_(low_),
        ycor_(candidate.base),
        f_(candidate.base) {
    const double* y = N_VGetArrayPointer(around != nullptr ? around : candidate.base);
    for (std::size_t j = 0; j < low_.size(); ++j) low_[j] = y[j] - change_[j];
    N_VConst(0.0, ycor_);
    if (evaluate({}, Of::values)) before_ = f();
  }

  /// Whether F can be evaluated at the point itself.
  bool known() const { return before_.has_value(); }
  /// Sets noticed[i] to 1 where F_i differs, bit for bit, once all of these components are changed.
  /// False: F cannot be evaluated there.
  bool notices(const std::vector<int>& components, Of what, std::vector<char>& noticed) {
    if (!known() || !evaluate(components, what)) return false;
    for (std::size_t i = 0; i < noticed.size(); ++i)
      noticed[i] |=
          !(f()[static_cast<Eigen::Index>(i)] == (*before_)[static_cast<Eigen::Index>(i)]);
    return true;
  }
  /// The change of F by that of one component, over change[j].
  bool slope(int component, Of what, Eigen::Ref<Eigen::VectorXd> slope) {
    if (!known() || !evaluate({component}, what)) return false;
    slope = (f() - *before_) / change_[static_cast<std::size_t>(component)];
    return true;
  }

  /// Changes of about `size` tolerances, large enough for y' to change in the last bit. They vary
  /// irregularly with j, so that those of one equation do not cancel.
  static std::vector<double> irregular_changes(const Candidate& candidate, double size,
                                               double turn = 2.3) {
    std::vector<double> change(static_cast<std::size_t>(N_VGetLength(candidate.base)));
    for (std::size_t j = 0; j < change.size(); ++j) {
      const double w = candidate.weight_entries[j];
      change[j] = size * irregular(j, turn) *
                  std::max(w > 0.0 ? 1.0 / w : 1.0, 1e-3 / std::abs(candidate.cj));
    }
    return change;
  }

 private:
  Eigen::Map<const Eigen::VectorXd> f() const {
    return {N_VGetArrayPointer(f_), static_cast<Eigen::Index>(change_.size())};
  }
  bool evaluate(const std::vector<int>& components, Of what) {
    for (std::size_t j = 0; j < low_.size(); ++j) point_[j] = low_[j] + change_[j];
    for (const int i : components) {
      const auto j = static_cast<std::size_t>(i);
      if (what == Of::values) {
        point_[j] += change_[j];
      } else {
        N_VGetArrayPointer(ycor_)[j] = change_[j];
        point_[j] = low_[j];
      }
    }
    ++statistics_.residual_evaluations;
    const bool evaluated =
        corrector_.residual_with(
            candidate_, [this](std::size_t j) { return point_[j]; }, ycor_, f_) == 0;
    for (const int j : components) N_VGetArrayPointer(ycor_)[j] = 0.0;
    return evaluated;
  }

  const Candidate& candidate_;
  Corrector& corrector_;
  Statistics& statistics_;
  std::vector<double> change_, low_, point_;
  OwnedVector ycor_, f_;
  std::optional<Eigen::VectorXd> before_;  // F at the point; empty: it cannot be evaluated
};

}  // namespace tether::ida_projection

// Tether: which variables are algebraic.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "impl.hpp"

namespace tether::ida_projection {

void Projection::Impl::set_id(N_Vector id) {
  if (!id_) id_ = OwnedVector(id);
  if (static_cast<N_Vector>(id_) != id) N_VScale(1.0, id, id_);
  algebraic_.clear();
  if (contiguous_) {
    const double* mask = N_VGetArrayPointer(id_);
    for (int j = 0; j < size_; ++j)
      if (mask[j] == 0.0) algebraic_.push_back(j);
    has_algebraic_ = !algebraic_.empty();
  } else {
    has_algebraic_ = N_VMin(id_) == 0.0;
  }
}

// Component j is algebraic if F does not change at all when y'_j does. F is reached through IDA's
// own residual callback: it evaluates F(t, ypred + ycor, yppred + cj ycor), and ypred can be
// shifted by -ycor (and put back bit for bit) so that only y' feels ycor.
Status Projection::Impl::derive_id(const Candidate& candidate, void* mem) {
  if (!contiguous_ || size_ > options_.derive_id_limit) {
    message = contiguous_ ? "more unknowns than Options::derive_id_limit"
                          : "vectors without contiguous memory";
    message +=
        ": algebraic variables were not derived and stay in the error test; give IDA's id vector "
        "in Options::id";
    return Status::success;
  }
  const double cj = step_data().cj;
  OwnedVector ycor(candidate.base), base(candidate.base), shifted(candidate.base);
  N_VScale(1.0, candidate.base, saved_);
  N_VConst(0.0, ycor);
  double* e = N_VGetArrayPointer(ycor);
  double* predicted = N_VGetArrayPointer(candidate.base);
  const double* original = N_VGetArrayPointer(saved_);
  const double* w = N_VGetArrayPointer(candidate.weights);
  const auto residual = [&](N_Vector into) {
    ++statistics_.residual_evaluations;
    return system_(ycor, into, mem);
  };

  OwnedVector id(candidate.base);
  double* mask = N_VGetArrayPointer(id);
  const double* before = N_VGetArrayPointer(base);
  const double* after = N_VGetArrayPointer(shifted);
  bool known = true;
  for (int j = 0; j < size_ && known; ++j) {
    bool moves = false, answered = false;
    for (const double sign : {1.0, -1e3}) {
      const double weight = w[j] > 0.0 ? 1.0 / w[j] : 1.0;
      const double change = sign * std::max(weight, 1e-3 / std::abs(cj));  // y'_j by cj times this
      const double low = original[j] - change;
      const double y_j = low + change;  // what F sees in both evaluations, bit for bit
      predicted[j] = y_j;
      bool ok = residual(base) == 0;
      predicted[j] = low;
      e[j] = change;
      ok = residual(shifted) == 0 && ok;
      e[j] = 0.0;
      predicted[j] = original[j];
      if (!ok) continue;  // F refuses this y'; the other size decides
      answered = true;
      moves = moves || !std::equal(before, before + size_, after);
    }
    known = answered;
    mask[j] = moves ? 1.0 : 0.0;
  }
  N_VScale(1.0, saved_, candidate.base);
  if (!known) {
    message =
        "F could not be evaluated while algebraic variables were looked for; give IDA's id vector "
        "in Options::id";
    return Status::success;
  }
  set_id(id);
  return Status::success;
}

}  // namespace tether::ida_projection

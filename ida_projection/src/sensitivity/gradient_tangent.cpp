// Tether: moves of sensitivities by gradients, on any N_Vector. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>

#include "host/owned_vector.hpp"
#include "movers/vector/gradient_store.hpp"
#include "rows/row_trust.hpp"
#include "sensitivity/tangent_rows.hpp"

namespace tether::ida_projection {

namespace {

class GradientTangent final : public TangentRows {
 public:
  GradientTangent(const Constraints& constraints, Statistics& statistics, N_Vector like)
      : store_(constraints, statistics, like), WT_(like), D_(like) {
    for (int i = 0; i < rows(); ++i) C_.emplace_back(like);
  }

  int rows() const override { return store_.rows(); }

  Status value(double t, N_Vector y, double* g) override {
    const Status status = with_message(store_.value(t, y));
    std::copy(store_.g().begin(), store_.g().end(), g);
    return status;
  }

  // Algebraic components do not move where no row contains them.
  Status evaluate(double t, N_Vector y, N_Vector weights, N_Vector id) override {
    const Status status = with_message(store_.fill(t, y));
    if (status != Status::success) return status;
    for (std::size_t i = 0; i < C_.size(); ++i) N_VScale(1.0, store_.gradients()[i], C_[i]);
    N_VConst(0.0, WT_);
    (void)N_VInvTest(weights, WT_);
    held_ = id != nullptr && !store_.contains_algebraic(id) ? id : nullptr;
    return status;
  }

  Status factor(N_Vector D) override {
    for (std::size_t i = 0; i < C_.size(); ++i) N_VScale(1.0, C_[i], store_.gradients()[i]);
    if (held_ != nullptr)
      N_VProd(D, held_, D_);
    else
      N_VScale(1.0, D, D_);
    const Status status = with_message(store_.factor(D_, WT_));
    store_.keep_firm(RowTrust::kThin);
    return status;
  }

  Status product(N_Vector s, double* r) override {
    for (std::size_t i = 0; i < C_.size(); ++i) r[i] = N_VDotProd(C_[i], s);
    return Status::success;
  }
  void solve(const std::vector<double>& r, N_Vector ds) override { store_.solve(r, D_, ds); }

 private:
  Status with_message(Status status) {
    if (status != Status::success) message_ = store_.report.text;
    return status;
  }

  GradientStore store_;
  OwnedVector WT_, D_;
  N_Vector held_ = nullptr;
  std::vector<OwnedVector> C_;
};

}  // namespace

std::unique_ptr<TangentRows> make_gradient_tangent(const Constraints& constraints,
                                                   Statistics& statistics, N_Vector like) {
  return std::make_unique<GradientTangent>(constraints, statistics, like);
}

}  // namespace tether::ida_projection

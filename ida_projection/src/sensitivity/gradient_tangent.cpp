// Tether: moves of sensitivities by gradients, on any N_Vector. SPDX-License-Identifier:
// BSD-3-Clause
#include "constraints/evaluator.hpp"
#include "host/owned_vector.hpp"
#include "rows/gradient_rows.hpp"
#include "rows/row_trust.hpp"
#include "sensitivity/tangent_rows.hpp"

namespace tether::ida_projection {

namespace {

class GradientTangent final : public TangentRows {
 public:
  GradientTangent(const Constraints& constraints, Statistics& statistics, N_Vector like)
      : statistics_(statistics),
        rows_(constraints.total_count(), like),
        WT_(like),
        D_(like),
        work_(like) {
    flatten(constraints, 0);
    for (int i = 0; i < rows_.rows(); ++i) owned_.emplace_back(like);
    for (const OwnedVector& row : owned_) C_.push_back(row);
  }

  int rows() const override { return rows_.rows(); }

  Status value(double t, N_Vector y, double* g) override {
    ++statistics_.value_evaluations;
    return each("Gradients::value",
                [&](const Part& part) { return part.rows->value(t, y, g + part.first); });
  }

  Status evaluate(double t, N_Vector y, N_Vector weights, N_Vector id) override {
    ++statistics_.jacobian_evaluations;
    for (N_Vector row : C_) N_VConst(0.0, row);
    const Status status = each("Gradients::fill", [&](const Part& part) {
      return part.rows->fill(t, y, C_.data() + part.first);
    });
    N_VConst(0.0, WT_);
    (void)N_VInvTest(weights, WT_);
    held_ = status == Status::success && id != nullptr && !contain_algebraic(id) ? id : nullptr;
    return status;
  }

  Status factor(N_Vector D) override {
    for (std::size_t i = 0; i < C_.size(); ++i) N_VScale(1.0, C_[i], rows_.gradients()[i]);
    if (held_ != nullptr)
      N_VProd(D, held_, D_);
    else
      N_VScale(1.0, D, D_);
    ++statistics_.factorizations;
    const int bad = rows_.factor(D_, WT_);
    if (bad >= 0) {
      message_ = "the gradient of row " + std::to_string(bad) + " is not finite";
      return Status::not_finite;
    }
    rows_.keep_firm(RowTrust::kThin);
    return Status::success;
  }

  Status product(N_Vector s, double* r) override {
    for (std::size_t i = 0; i < C_.size(); ++i) r[i] = N_VDotProd(C_[i], s);
    return Status::success;
  }
  void solve(const std::vector<double>& r, N_Vector ds) override { rows_.solve(r, D_, ds); }

 private:
  struct Part {
    const Gradients* rows;
    int first;
  };

  // Algebraic components do not move where no row contains them.
  bool contain_algebraic(N_Vector id) {
    for (N_Vector row : C_) {
      N_VProd(id, row, work_);
      N_VLinearSum(1.0, row, -1.0, work_, work_);
      if (N_VMaxNorm(work_) > 0.0) return true;
    }
    return false;
  }

  int flatten(const Constraints& set, int first) {
    if (set.count > 0) parts_.push_back({&std::get<Gradients>(set.jacobian), first});
    first += set.count;
    for (const Constraints& part : set.joined) first = flatten(part, first);
    return first;
  }

  template <class Call>
  Status each(const char* what, Call call) {
    for (const Part& part : parts_) {
      std::string thrown;
      const int flag = guarded([&] { return call(part); }, thrown);
      if (flag == 0) continue;
      message_ = std::string(what) +
                 (thrown.empty() ? " returned " + std::to_string(flag) : " threw: " + thrown);
      return flag > 0 ? Status::callback_recoverable : Status::callback_fatal;
    }
    return Status::success;
  }

  Statistics& statistics_;
  GradientRows rows_;
  OwnedVector WT_, D_, work_;
  N_Vector held_ = nullptr;
  std::vector<OwnedVector> owned_;
  std::vector<N_Vector> C_;
  std::vector<Part> parts_;
};

}  // namespace

std::unique_ptr<TangentRows> make_gradient_tangent(const Constraints& constraints,
                                                   Statistics& statistics, N_Vector like) {
  return std::make_unique<GradientTangent>(constraints, statistics, like);
}

}  // namespace tether::ida_projection

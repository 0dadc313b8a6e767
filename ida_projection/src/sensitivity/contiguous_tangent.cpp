// Tether: moves of sensitivities, on contiguous vectors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <utility>

#include "constraints/evaluator.hpp"
#include "host/shortest.hpp"
#include "rows/split_rows.hpp"
#include "sensitivity/tangent_rows.hpp"

namespace tether::ida_projection {

namespace {

// Which rows are independent is looked for so often, in steps, where some are not.
constexpr int kDecideEvery = 8;
constexpr double kAlong = 1e-3;  // of y, for differences along s

template <class Rows>
class ContiguousTangent final : public TangentRows {
 public:
  ContiguousTangent(const Constraints& constraints, const Options& options, Statistics& statistics,
                    int size)
      : options_(options),
        statistics_(statistics),
        evaluator_(constraints, statistics),
        blocks_(constraints, evaluator_, size),
        y_(static_cast<std::size_t>(size), 0.0),
        WT_(y_) {}

  int rows() const override { return evaluator_.rows(); }
  void forget_failure() override { evaluator_.forget(); }

  Status value(double t, N_Vector y, double* g) override {
    return with_message(evaluator_.value(t, N_VGetArrayPointer(y), size(), g));
  }

  Status evaluate(double t, N_Vector y, N_Vector weights, N_Vector id) override {
    t_ = t;
    load(y, weights);
    Status status = structure(t, id);
    if (status != Status::success) return status;
    const double* WT = evaluator_.uses_differences() || blocks_.mixed() ? WT_.data() : nullptr;
    status = blocks_.evaluate(evaluator_, t, y_.data(), WT);
    if (status == Status::success && blocks_.outgrown()) {
      blocks_.rearrange();
      known_ = false;
      status = blocks_.evaluate(evaluator_, t, y_.data(), WT);
    }
    return with_message(status);
  }

  Status factor(N_Vector D) override {
    blocks_.set_metric(N_VGetArrayPointer(D));
    return factor_rows();
  }

  Status product(N_Vector s, double* r) override {
    const double* entries = N_VGetArrayPointer(s);
    if (evaluator_.uses_differences()) return differences(entries, r);
    for (int i = 0; i < rows(); ++i) r[i] = blocks_.times(i, entries);
    return Status::success;
  }

  void solve(const std::vector<double>& r, N_Vector ds) override {
    blocks_.solve(r);
    N_VConst(0.0, ds);
    double* to = N_VGetArrayPointer(ds);
    for (const auto* block : {&blocks_.d, &blocks_.a}) {
      if (block->rows.empty()) continue;
      block->for_columns([to, dy = block->dy.data()](int k, int j) { to[j] = dy[k]; });
    }
  }

 private:
  // A C by differences is good for Newton's moves only: C s by those of g along s, of fourth order.
  Status differences(const double* s, double* r) {
    double largest_s = 0.0, largest_y = 0.0;
    for (std::size_t j = 0; j < y_.size(); ++j) {
      largest_s = std::max(largest_s, std::abs(s[j]));
      largest_y = std::max({largest_y, std::abs(y_[j]), WT_[j]});
    }
    std::fill(r, r + rows(), 0.0);
    if (largest_s == 0.0) return Status::success;
    const double d = kAlong * (largest_y > 0.0 ? largest_y : 1.0) / largest_s;
    shifted_.resize(y_.size());
    g_.resize(static_cast<std::size_t>(rows()));
    slope_.resize(g_.size());
    const Status status = central_differences(d, slope_, g_, [&](double e, auto& g) {
      for (std::size_t j = 0; j < y_.size(); ++j) shifted_[j] = y_[j] + e * s[j];
      return with_message(evaluator_.value(t_, shifted_.data(), size(), g.data()));
    });
    std::copy(slope_.begin(), slope_.end(), r);
    return status;
  }

  Status with_message(Status status) {
    if (status != Status::success) message_ = evaluator_.message();
    return status;
  }

  int size() const { return static_cast<int>(y_.size()); }

  void load(N_Vector y, N_Vector weights) {
    const double *from = N_VGetArrayPointer(y), *w = N_VGetArrayPointer(weights);
    for (std::size_t j = 0; j < y_.size(); ++j) {
      y_[j] = from[j];
      WT_[j] = w[j] > 0.0 ? 1.0 / w[j] : 0.0;
    }
  }

  Status structure(double t, N_Vector id) {
    if (structured_ && id == id_) return Status::success;
    known_ = false;
    const double* mask = id != nullptr ? N_VGetArrayPointer(id) : nullptr;
    const Status status = blocks_.structure(evaluator_, t, y_, WT_, options_.hold, mask);
    structured_ = status == Status::success;
    id_ = id;
    if (!structured_) message_ = blocks_.message;
    return status;
  }

  Status factor_rows() {
    known_ = known_ && Rows::kDense && !(blocks_.dropped_rows() && ++age_ % kDecideEvery == 0);
    if (known_ && blocks_.factor_kept()) {
      ++statistics_.refactorizations;
      return Status::success;
    }
    ++statistics_.factorizations;
    if (!blocks_.factor()) {
      message_ = "the constraint Jacobian C has an entry that is not finite at t = " + brief(t_);
      return Status::not_finite;
    }
    if constexpr (Rows::kDense)
      for (auto* block : {&blocks_.d, &blocks_.a})
        if (!block->rows.empty()) block->solver.use_rank(RowTrust::firm_rows(block->solver));
    known_ = true;
    return Status::success;
  }

  const Options& options_;
  Statistics& statistics_;
  Evaluator evaluator_;
  Rows blocks_;
  std::vector<double> y_, WT_, shifted_, g_, slope_;
  N_Vector id_ = nullptr;
  bool structured_ = false;
  bool known_ = false;  // which rows are independent
  int age_ = 0;
  double t_ = 0.0;
};

}  // namespace

std::unique_ptr<TangentRows> make_contiguous_tangent(const Constraints& constraints,
                                                     const Options& options, Statistics& statistics,
                                                     int size) {
  if (wants_sparse_factors(constraints, size))
    return std::make_unique<ContiguousTangent<SparseRows>>(constraints, options, statistics, size);
  return std::make_unique<ContiguousTangent<DenseRows>>(constraints, options, statistics, size);
}

}  // namespace tether::ida_projection

// Tether: a projection that the caller does himself. SPDX-License-Identifier: BSD-3-Clause
#include "host/owned_vector.hpp"
#include "movers/newton.hpp"

namespace tether::ida_projection {

namespace {

class UserRows final : public Newton<UserRows> {
 public:
  UserRows(const Constraints& constraints, const Options& options, Statistics& statistics,
           N_Vector like)
      : Newton(Kind::projection, options, statistics),
        user_(std::get<UserProjection>(constraints.jacobian)),
        y_(like),
        change_(like),
        error_(like) {}

  Status load(const Candidate& candidate, bool) override {
    at_ = candidate;
    return Status::success;
  }
  Status value(double t, bool) override {
    N_VLinearSum(1.0, at_.base, 1.0, at_.correction, y_);
    N_VScale(1.0, at_.correction, error_);
    N_VConst(0.0, change_);
    ++statistics_.value_evaluations;
    std::string thrown;
    const double tolerance = options_.advanced.tolerance;
    const int flag = guarded(
        [&] { return user_.function(t, y_, change_, tolerance, error_, user_.user_data); }, thrown);
    return flag == 0 ? Status::success : report.failed(flag, "the user's projection", thrown, 0);
  }
  Status factor(double, bool) override { return Status::success; }
  Solution solve(Solve) override {
    ++statistics_.iterations;
    Solution found;
    found.length = N_VWrmsNorm(change_, at_.weights);
    return found;
  }
  Status apply(double share, const Candidate& candidate) override {
    N_VLinearSum(1.0, candidate.correction, share, change_, candidate.correction);
    return Status::success;
  }
  bool is_rounding() override { return false; }
  double follow(const Candidate&, N_Vector change) override {
    return change != nullptr ? N_VWrmsNorm(change, at_.weights) : 0.0;
  }
  double corrected() const override { return N_VWrmsNorm(at_.correction, at_.weights); }
  void forget() {}

 private:
  UserProjection user_;
  Candidate at_{};
  OwnedVector y_, change_, error_;
};

}  // namespace

std::unique_ptr<RowsAt> make_user_rows(const Constraints& constraints, const Options& options,
                                       Statistics& statistics, N_Vector like) {
  return std::make_unique<UserRows>(constraints, options, statistics, like);
}

}  // namespace tether::ida_projection

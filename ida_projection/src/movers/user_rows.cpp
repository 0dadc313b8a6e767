// Tether: a projection that the caller does himself. SPDX-License-Identifier: BSD-3-Clause
#include "host/owned_vector.hpp"
#include "movers/mover.hpp"

namespace tether::ida_projection {

namespace {

class UserRows final : public RowsAt {
 public:
  UserRows(const Constraints& constraints, const Options& options, Statistics& statistics,
           N_Vector like)
      : user_(std::get<UserProjection>(constraints.jacobian)),
        options_(options),
        statistics_(statistics),
        y_(like),
        change_(like),
        error_(like) {}

  bool gives_g() const override { return false; }
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
    const int flag = guarded(
        [&] {
          return user_.function(t, y_, change_, options_.advanced.tolerance, error_,
                                user_.user_data);
        },
        thrown);
    if (flag == 0) return Status::success;
    message = thrown.empty() ? "the user's projection returned " + std::to_string(flag)
                             : "the user's projection threw: " + thrown;
    if (flag < 0) fatal_ = true;
    return flag > 0 ? Status::callback_recoverable : Status::callback_fatal;
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
  double size() const override { return 0.0; }
  double change() const override { return N_VWrmsNorm(at_.correction, at_.weights); }
  double shift(N_Vector change) override { return N_VWrmsNorm(change, at_.weights); }
  void restart(const Candidate&) override {}
  double drift() const override { return 0.0; }
  bool may_test_with_factors() const override { return false; }
  bool contradicts() override { return false; }
  Status set_algebraic(const Candidate&, N_Vector) override { return Status::success; }
  void reset() override {}
  bool fatal() const override { return fatal_; }
  void forget_failure() override { fatal_ = false; }

 private:
  UserProjection user_;
  const Options& options_;
  Statistics& statistics_;
  Candidate at_{};
  OwnedVector y_, change_, error_;
  bool fatal_ = false;
};

}  // namespace

std::unique_ptr<RowsAt> make_user_rows(const Constraints& constraints, const Options& options,
                                       Statistics& statistics, N_Vector like) {
  return std::make_unique<UserRows>(constraints, options, statistics, like);
}

}  // namespace tether::ida_projection

// Tether: a projection that the caller does himself. SPDX-License-Identifier: BSD-3-Clause
#include "attach/shortest.hpp"
#include "host/owned_vector.hpp"
#include "movers/mover.hpp"

namespace tether::ida_projection {

namespace {

class UserMover final : public Mover {
 public:
  UserMover(const Constraints& constraints, const Options& options, Statistics& statistics,
            N_Vector like)
      : user_(std::get<UserProjection>(constraints.jacobian)),
        options_(options),
        statistics_(statistics),
        y_(like),
        change_(like),
        error_(like) {}

  Move measure(const Candidate& candidate) override {
    Move result;
    N_VLinearSum(1.0, candidate.base, 1.0, candidate.correction, y_);
    N_VScale(1.0, candidate.correction, error_);
    N_VConst(0.0, change_);
    ++statistics_.value_evaluations;
    ++statistics_.iterations;
    std::string thrown;
    const int flag = guarded(
        [&] {
          return user_.function(candidate.t, y_, change_, options_.advanced.tolerance, error_,
                                user_.user_data);
        },
        thrown);
    if (flag != 0) {
      message_ = thrown.empty() ? "the user's projection returned " + std::to_string(flag)
                                : "the user's projection threw: " + thrown;
      if (flag < 0) fatal_ = true;
      result.status = flag > 0 ? Status::callback_recoverable : Status::callback_fatal;
      return result;
    }
    result.status = Status::success;
    result.moves = 1;
    result.length = N_VWrmsNorm(change_, candidate.weights);
    return result;
  }

  Move move(const Candidate& candidate) override {
    Move result = measure(candidate);
    if (result.status != Status::success) return result;
    result.status = Status::success;
    double factor = 1.0;
    if (!(result.length <= options_.advanced.largest_move)) {
      const double limit = options_.advanced.largest_move *
                           std::max(1.0, N_VWrmsNorm(candidate.correction, candidate.weights));
      if (!(result.length <= limit)) {
        if (options_.advanced.long_move == LongMove::reject || !std::isfinite(result.length)) {
          result.status = std::isfinite(result.length) ? Status::move_too_long : Status::not_finite;
          message_ = "the user's projection moved by " + brief(result.length) +
                     " tolerances, the limit is " + brief(limit) + " (Options::largest_move)";
          return result;
        }
        factor = limit / result.length;
        result.left = result.length - limit;
        result.length = limit;
        result.capped = true;
      }
    }
    N_VLinearSum(1.0, candidate.correction, factor, change_, candidate.correction);
    return result;
  }

  Status settle(const Candidate& candidate, N_Vector) override {
    const Move again = measure(candidate);
    if (again.status != Status::success) return again.status;
    N_VLinearSum(1.0, candidate.correction, 1.0, change_, candidate.correction);
    return Status::success;
  }

  double remaining_drift(const Candidate&) override { return -1.0; }

  Status set_algebraic(const Candidate&, N_Vector) override { return Status::success; }

 private:
  UserProjection user_;
  const Options& options_;
  Statistics& statistics_;
  OwnedVector y_, change_, error_;
};

}  // namespace

std::unique_ptr<Mover> make_user_mover(const Constraints& constraints, const Options& options,
                                       Statistics& statistics, N_Vector like) {
  return std::make_unique<UserMover>(constraints, options, statistics, like);
}

}  // namespace tether::ida_projection

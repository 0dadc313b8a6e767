// Tether: IDA with fast vectors and factors takes the same steps, bit for bit.
// SPDX-License-Identifier: BSD-3-Clause
#include <nvector/nvector_serial.h>
#include <problems/akzo_nobel.hpp>
#include <problems/andrews.hpp>
#include <problems/bricard.hpp>
#include <problems/car_axis.hpp>
#include <problems/governor.hpp>
#include <problems/kepler.hpp>
#include <problems/link_chain.hpp>
#include <problems/lotka_volterra.hpp>
#include <problems/pendulum.hpp>
#include <problems/pinned_rods.hpp>
#include <problems/rigid_body.hpp>
#include <problems/robertson.hpp>
#include <problems/slider_crank.hpp>
#include <problems/slider_crank_equal.hpp>
#include <problems/transistor_amplifier.hpp>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "host.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

std::vector<Problem> everything() {
  std::vector<Problem> all;
  for (const auto& form : pendulum_forms()) all.push_back(pendulum(1.0, 9.81, 10.0, form));
  for (const auto& form : car_axis_forms()) all.push_back(car_axis(form));
  for (const auto& form : andrews_forms()) all.push_back(andrews(form));
  for (const auto& form : slider_crank_forms()) all.push_back(slider_crank(form));
  for (const auto& form : robertson_forms()) all.push_back(robertson(40.0, form));
  for (const auto& motion : rigid_body_motions()) all.push_back(rigid_body(motion, 10.0));
  for (const auto& form : slider_crank_equal_forms())
    all.push_back(slider_crank_equal(kSliderCrankTurn, 1.0, form));
  for (const auto& form : pinned_rods_forms()) {
    all.push_back(n_four_bar(2, 1.0, form));
    all.push_back(five_link_chain(1.0, form));
    all.push_back(parallelogram(0.0, 8.0, 1.0, form));
  }
  for (const auto& form : bricard_forms()) all.push_back(bricard(1.0, form));
  for (const auto& form : governor_forms()) all.push_back(governor(0.1, form));
  all.push_back(kepler(0.6, 10.0));
  all.push_back(lotka_volterra(2.0, 0.5, 10.0));
  all.push_back(akzo_nobel());
  all.push_back(transistor_amplifier());
  all.push_back(link_chain(4, 0.3));
  return all;
}

/// Up to `steps` steps of both side by side: every time, order and bit of y and y' must agree.
void compare(const Problem& problem, double tolerance, bool projected, int steps) {
  INFO(problem.name << ", " << problem.form << ", tolerance " << tolerance
                    << (projected ? ", projected" : ""));
  Host plain(problem, tolerance), fast(problem, tolerance, Vectors::fast);
  if (projected) {
    plain.attach(problem.recommended_constraints());
    fast.attach(problem.recommended_constraints());
  }
  bool same = true;
  int flag = 0;
  for (int k = 0; k < steps && same && flag >= 0 && plain.t < problem.t_end; ++k) {
    flag = plain.step();
    const auto derivative = [&](const Host& host) {
      const double* yp = N_VGetArrayPointer(host.yp);
      return std::vector<double>(yp, yp + problem.size);
    };
    same = fast.step() == flag && plain.t == fast.t && same_bits(plain.state(), fast.state()) &&
           same_bits(derivative(plain), derivative(fast));
  }
  INFO("t = " << plain.t << ", step " << plain.steps());
  CHECK(same);
  CHECK(plain.steps() == fast.steps());
}

/// Those of IDA's vectors that its nonlinear solver works with.
struct Inside {
  explicit Inside(void* ida) {
    N_Vector yn, ypn, residual;
    void* data;
    sunrealtype t, cj;
    IDAGetNonlinearSystemData(ida, &t, &y_predicted, &yp_predicted, &yn, &ypn, &residual, &cj,
                              &data);
  }
  N_Vector y_predicted, yp_predicted;
};

bool is_fast(N_Vector v) { return v->ops->nvlinearsum != N_VLinearSum_Serial; }

}  // namespace

TEST_CASE("IDA's own vectors become fast with the first step, the caller's do not") {
  Host host(pendulum(1.0, 9.81, 10.0, "index 1"), 1e-6);
  host.attach(host.problem.recommended_constraints());
  const Inside inside(host.ida);
  CHECK_FALSE(is_fast(inside.y_predicted));
  REQUIRE(host.step() >= 0);
  CHECK(is_fast(inside.y_predicted));
  CHECK(is_fast(inside.yp_predicted));
  CHECK_FALSE(is_fast(host.y));
  CHECK_FALSE(is_fast(host.yp));
  REQUIRE(host.restart() >= 0);
  REQUIRE(host.finish() >= 0);
}

TEST_CASE("IDA's work space and its linear solution become fast with its own vectors") {
  Host host(pendulum(1.0, 9.81, 10.0, "index 1"), 1e-6);
  static bool work_is_fast, solution_is_fast;
  static decltype(_generic_SUNLinearSolver_Ops::solve) solve;
  const SUNMatrix matrix = SUNDenseMatrix(host.problem.size, host.problem.size, host.context);
  const SUNLinearSolver solver = SUNLinSol_Dense(host.y, matrix, host.context);
  solve = solver->ops->solve;
  solver->ops->solve = [](SUNLinearSolver S, SUNMatrix A, N_Vector x, N_Vector b,
                          sunrealtype tolerance) {
    solution_is_fast = is_fast(x);
    return solve(S, A, x, b, tolerance);
  };
  REQUIRE(IDASetLinearSolver(host.ida, solver, matrix) == IDA_SUCCESS);
  const auto jacobian = [](sunrealtype t, sunrealtype cj, N_Vector y, N_Vector yp, N_Vector,
                           SUNMatrix J, void* data, N_Vector work, N_Vector, N_Vector) {
    work_is_fast = is_fast(work);
    static_cast<const Problem*>(data)->jacobian(t, cj, N_VGetArrayPointer(y),
                                                N_VGetArrayPointer(yp), SM_DATA_D(J));
    return 0;
  };
  REQUIRE(IDASetJacFn(host.ida, jacobian) == IDA_SUCCESS);
  host.attach(host.problem.recommended_constraints());
  work_is_fast = solution_is_fast = true;
  REQUIRE(host.step() >= 0);
  CHECK_FALSE(work_is_fast);
  REQUIRE(host.finish() >= 0);
  CHECK(work_is_fast);
  CHECK(solution_is_fast);
  CHECK_FALSE(is_fast(host.y));
  IDAFree(&host.ida);
  SUNLinSolFree(solver);
  SUNMatDestroy(matrix);
}

TEST_CASE("where no move is needed IDA's vectors become fast, too, without constraints not") {
  for (const bool constrained : {true, false}) {
    CAPTURE(constrained);
    Host host(robertson(40.0, "index 0"), 1e-6);
    host.attach(constrained ? host.problem.recommended_constraints() : tp::Constraints());
    REQUIRE(host.finish() >= 0);
    CHECK(host.projection().statistics().projections == 0);
    CHECK(is_fast(Inside(host.ida).y_predicted) == constrained);
    CHECK_FALSE(is_fast(host.y));
  }
}

TEST_CASE("a vector with an operation of the caller's keeps all of them") {
  Host host(pendulum(1.0, 9.81, 10.0, "index 1"), 1e-6);
  host.attach(host.problem.recommended_constraints());
  const Inside inside(host.ida);
  inside.y_predicted->ops->nvmin = [](N_Vector v) { return N_VMin_Serial(v); };
  for (int k = 0; k < 20; ++k) REQUIRE(host.step() >= 0);
  CHECK(host.projection().statistics().projections > 0);
  CHECK_FALSE(is_fast(inside.y_predicted));
  CHECK(is_fast(inside.yp_predicted));
}

TEST_CASE("Fast vectors and factors leave every bit of plain IDA's steps on all problems") {
  for (const Problem& problem : everything())
    for (const double tolerance : {1e-4, 1e-8}) compare(problem, tolerance, false, 150);
}

TEST_CASE("Fast vectors and factors leave every bit of projected steps on all problems") {
  for (const Problem& problem : everything())
    for (const double tolerance : {1e-4, 1e-8}) compare(problem, tolerance, true, 80);
}

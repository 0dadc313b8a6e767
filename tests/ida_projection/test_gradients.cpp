// Tether: constraints as gradients in N_Vectors of any kind. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Dense>
#include <cmath>
#ifdef TETHER_TEST_OPENMP
#include <nvector/nvector_openmp.h>
#endif
#include <nvector/nvector_serial.h>
#include <problems/pendulum.hpp>
#include <problems/rigid_body.hpp>
#include <sunlinsol/sunlinsol_spgmr.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

// Reading works for every kind of vector here; the plugin must not know that.
double* entries(N_Vector v) {
#ifdef TETHER_TEST_OPENMP
  if (N_VGetVectorID(v) == SUNDIALS_NVEC_OPENMP) return NV_DATA_OMP(v);
#endif
  return NV_DATA_S(v);
}

tp::Constraints as_gradients(const tp::Constraints& dense, int n) {
  return gradients_of(dense, n, entries);
}

int residual(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  static_cast<const Problem*>(data)->residual(t, entries(y), entries(yp), entries(r));
  return 0;
}

enum class Kind { serial, open_mp, custom };

/// A serial vector that hides its array, as a framework's own vector type would.
N_Vector make_vector(Kind kind, const std::vector<double>& values, SUNContext context) {
  const auto n = static_cast<sunindextype>(values.size());
#ifdef TETHER_TEST_OPENMP
  N_Vector v = kind == Kind::open_mp ? N_VNew_OpenMP(n, 1, context) : N_VNew_Serial(n, context);
#else
  N_Vector v = N_VNew_Serial(n, context);
#endif
  std::copy(values.begin(), values.end(), entries(v));
  if (kind == Kind::custom) {
    v->ops->nvgetvectorid = [](N_Vector) { return SUNDIALS_NVEC_CUSTOM; };
    v->ops->nvgetarraypointer = nullptr;  // clones inherit the table
  }
  return v;
}

struct End {
  int flag;
  long steps;
  std::vector<double> y;
  tp::Statistics statistics;
  int shifted;  ///< steps that left IDA another prediction than its own
};

struct LinearSystem {
  SUNLinearSolver solver;
  SUNMatrix matrix;
};

/// IDA's prediction, as its own Newton iteration left it in the present step.
struct Prediction {
  N_Vector vector = nullptr;
  std::vector<double> then;
  int (*solve)(SUNNonlinearSolver, N_Vector, N_Vector, N_Vector, sunrealtype, sunbooleantype,
               void*) = nullptr;
} prediction;

SUNNonlinearSolver newton_that_notes_predictions(N_Vector y, SUNContext context) {
  SUNNonlinearSolver newton = SUNNonlinSol_Newton(y, context);
  prediction.solve = newton->ops->solve;
  newton->ops->solve = [](SUNNonlinearSolver s, N_Vector y0, N_Vector ycor, N_Vector weights,
                          sunrealtype tolerance, sunbooleantype setup, void* mem) {
    const int flag = prediction.solve(s, y0, ycor, weights, tolerance, setup, mem);
    prediction.vector = y0;
    prediction.then.assign(entries(y0), entries(y0) + NV_LENGTH_S(y0));
    return flag;
  };
  return newton;
}

/// To the end of the problem with the linear system that `attach(ida, y, context)` made.
template <class Attach>
End run_with(Kind kind, const Problem& problem, double tolerance, const tp::Constraints& set,
             Attach attach) {
  Context context;
  N_Vector y = make_vector(kind, problem.y0, context), yp = make_vector(kind, problem.yp0, context);
  N_Vector id = make_vector(kind, problem.id, context);
  void* ida = IDACreate(context);
  IDAInit(ida, residual, 0.0, y, yp);
  IDASetUserData(ida, const_cast<Problem*>(&problem));
  IDASStolerances(ida, tolerance, tolerance);
  IDASetMaxNumSteps(ida, 100000);
  const LinearSystem system = attach(ida, y, context);
  End end{};
  {
    tp::Options options;
    options.id = id;
    SUNNonlinearSolver newton = newton_that_notes_predictions(y, context);
    options.nonlinear_solver = newton;
    tp::Projection projection(ida, set, options);
    sunrealtype t = 0.0;
    while (t < problem.t_end && end.flag >= 0) {
      end.flag = IDASolve(ida, problem.t_end, &t, y, yp, IDA_ONE_STEP);
      const auto now = entries(prediction.vector);
      end.shifted += !std::equal(prediction.then.begin(), prediction.then.end(), now);
    }
    if (end.flag >= 0) IDAGetDky(ida, problem.t_end, 0, y);
    IDAGetNumSteps(ida, &end.steps);
    end.statistics = projection.statistics();
    end.y.assign(entries(y), entries(y) + problem.size);
    IDAFree(&ida);
    SUNNonlinSolFree(newton);
  }
  SUNLinSolFree(system.solver);
  if (system.matrix) SUNMatDestroy(system.matrix);
  for (N_Vector v : {y, yp, id}) N_VDestroy(v);
  return end;
}

/// With the matrix-free GMRES solver, which any vector type can use.
End run(Kind kind, const Problem& problem, double tolerance, const tp::Constraints& set) {
  return run_with(kind, problem, tolerance, set, [](void* ida, N_Vector y, SUNContext context) {
    SUNLinearSolver solver = SUNLinSol_SPGMR(y, SUN_PREC_NONE, 10, context);
    IDASetLinearSolver(ida, solver, nullptr);
    IDASetEpsLin(ida, 1e-3);
    return LinearSystem{solver, nullptr};
  });
}

void close(const End& a, const End& b, double tolerance) {
  REQUIRE(a.flag >= 0);
  REQUIRE(b.flag >= 0);
  CHECK(a.shifted + b.shifted == 0);
  for (std::size_t i = 0; i < a.y.size(); ++i) CHECK(std::abs(a.y[i] - b.y[i]) < tolerance);
  CHECK(std::abs(a.steps - b.steps) <= 0.02 * static_cast<double>(b.steps) + 2.0);
}

}  // namespace

TEST_CASE("gradients: the same motion as the dense path, dense LU") {
  for (const char* form : {"index 1", "index 0"})
    for (const tp::Metric metric : {tp::Metric::local_correction, tp::Metric::error_weights}) {
      const Problem problem = pendulum(1.0, 1.0, 20.0, form);
      INFO(form << ", metric " << static_cast<int>(metric));
      const tp::Constraints rows = std::string(form) == "index 1"
                                       ? problem.recommended_constraints()
                                       : problem.select({"position", "velocity", "energy"});
      tp::Options options;
      options.advanced.metric = metric;
      const Run dense = integrate(problem, 1e-6, rows, options, false);
      const Run gradients = integrate(problem, 1e-6, as_gradients(rows, 5), options, false);
      REQUIRE(gradients.flag >= 0);
      CHECK(std::abs(gradients.steps - dense.steps) <= 0.02 * static_cast<double>(dense.steps));
      for (std::size_t i = 0; i < 5; ++i) CHECK(std::abs(gradients.y[i] - dense.y[i]) < 2e-5);
      CHECK(gradients.statistics.failures() == 0);
    }
}

TEST_CASE("gradients: capped moves go a part of the way") {
  Problem near = tether::test::circle(5.0);
  near.y0 = {1.0 + 1e-5, 0.0};
  near.yp0 = {0.0, 1.0 + 1e-5};
  tp::Options options;
  options.advanced.long_move = tp::LongMove::cap;
  options.advanced.largest_move = 0.5;
  Host host(near, 1e-6);
  host.attach(as_gradients(on_circle(), 2), options);
  REQUIRE(host.step() >= 0);
  const std::vector<double> y = host.state();
  CHECK(host.projection().statistics().moves_capped >= 1);
  CHECK(std::hypot(y[0], y[1]) - 1.0 > 1e-6);
}

TEST_CASE("gradients: a value that is no number fails the step by name") {
  tp::Constraints rows = as_gradients(on_circle(), 2);
  tp::Gradients gradients = std::get<tp::Gradients>(rows.jacobian);
  const auto value = gradients.value;
  gradients.value = [value](double t, N_Vector y, double* g) {
    value(t, y, g);
    if (t > 0.0) g[0] = std::nan("");
  };
  rows.jacobian = std::move(gradients);
  const Run run = integrate(tether::test::circle(5.0), 1e-6, rows, {}, false);
  CHECK(run.flag < 0);
  CHECK(run.statistics.not_finite > 0);
  CHECK(run.status == tp::Status::not_finite);
}

TEST_CASE("gradients: redundant rows, inconsistent rows") {
  const Problem body = rigid_body("regular", 10.0);
  const tp::Constraints once = body.recommended_constraints();
  const tp::Constraints twice = once + body.select({"energy"}) + body.select({"quaternion norm"});
  const Run full = integrate(body, 1e-7, as_gradients(once, 7), {}, false);
  const Run redundant = integrate(body, 1e-7, as_gradients(twice, 7), {}, false);
  REQUIRE(redundant.flag >= 0);
  CHECK(redundant.statistics.rank_drops == redundant.statistics.factorizations);
  CHECK(redundant.statistics.failures() == 0);
  for (std::size_t i = 0; i < 7; ++i) CHECK(std::abs(full.y[i] - redundant.y[i]) < 1e-6);

  const tp::Constraints other = row(
      "other circle", [](double, const double* y) { return y[0] * y[0] + y[1] * y[1] - 2.0; },
      [](double, const double* y, double* c) {
        c[0] = 2.0 * y[0];
        c[1] = 2.0 * y[1];
      });
  const Run refused =
      integrate(tether::test::circle(5.0), 1e-6, as_gradients(on_circle() + other, 2), {}, false);
  CHECK(refused.flag < 0);
  CHECK(refused.status == tp::Status::inconsistent);
  CHECK(refused.statistics.inconsistent == 1);  // a shorter step cures nothing: none is tried
  CHECK(contains(refused.message, "other circle"));
  CHECK(refused.steps == 0);
}

TEST_CASE("gradients on serial, OpenMP and custom vectors") {
  const Problem problem = pendulum(1.0, 1.0, 10.0, "index 0");
  const tp::Constraints dense = problem.recommended_constraints();
  const tp::Constraints gradients = as_gradients(dense, 5);
  const End reference = run(Kind::serial, problem, 1e-7, dense);
  const End serial = run(Kind::serial, problem, 1e-7, gradients);
  const End open_mp = run(Kind::open_mp, problem, 1e-7, gradients);
  const End custom = run(Kind::custom, problem, 1e-7, gradients);
  close(serial, reference, 1e-6);
  close(custom, serial, 1e-6);
  // One thread: the same operations in the same order.
  CHECK(same_bits(open_mp.y, serial.y));
  CHECK(open_mp.steps == serial.steps);
  CHECK(custom.statistics.projections >= custom.steps - 5);
  CHECK(custom.statistics.extra_iterations == 0);
  for (const End* end : {&serial, &open_mp, &custom}) {
    CHECK(value(dense, 10.0, end->y.data(), 5).cwiseAbs().maxCoeff() < 1e-6);
    for (std::size_t i = 0; i < 4; ++i) CHECK(std::abs(end->y[i] - problem.reference[i]) < 1e-5);
  }
}

TEST_CASE("gradients on custom vectors with algebraic variables") {
  const Problem problem = pendulum(1.0, 1.0, 10.0, "index 1");
  const tp::Constraints gradients = as_gradients(problem.recommended_constraints(), 5);
  const End serial = run(Kind::serial, problem, 1e-7, gradients);
  const End custom = run(Kind::custom, problem, 1e-7, gradients);
  close(custom, serial, 1e-5);
  CHECK(custom.statistics.refreshes == 0);
}

namespace {

/// LU of a dense matrix for vectors that hide their array; `solver->content` is the factors.
SUNLinearSolver dense_solver_of_custom_vectors(SUNContext context) {
  using Factors = Eigen::PartialPivLU<Eigen::MatrixXd>;
  SUNLinearSolver solver = SUNLinSolNewEmpty(context);
  solver->content = new Factors();
  solver->ops->gettype = [](SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; };
  solver->ops->setup = [](SUNLinearSolver s, SUNMatrix A) {
    const Eigen::Index n = SUNDenseMatrix_Rows(A);
    static_cast<Factors*>(s->content)
        ->compute(Eigen::Map<Eigen::MatrixXd>(SUNDenseMatrix_Data(A), n, n));
    return 0;
  };
  solver->ops->solve = [](SUNLinearSolver s, SUNMatrix, N_Vector x, N_Vector b, sunrealtype) {
    const auto& factors = *static_cast<Factors*>(s->content);
    Eigen::Map<Eigen::VectorXd>(entries(x), factors.rows()) =
        factors.solve(Eigen::Map<Eigen::VectorXd>(entries(b), factors.rows())).eval();
    return 0;
  };
  solver->ops->free = [](SUNLinearSolver s) {
    delete static_cast<Factors*>(s->content);
    SUNLinSolFreeEmpty(s);
    return decltype(SUNLinSolFree(s)){};
  };
  return solver;
}

int jacobian_of_custom_vectors(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector yp, N_Vector,
                               SUNMatrix J, void* data, N_Vector, N_Vector, N_Vector) {
  static_cast<const Problem*>(data)->jacobian(t, cj, entries(y), entries(yp),
                                              SUNDenseMatrix_Data(J));
  return 0;
}

End run_with_direct_solver(Kind kind, const Problem& problem, double tolerance,
                           const tp::Constraints& set) {
  return run_with(kind, problem, tolerance, set, [&](void* ida, N_Vector, SUNContext context) {
    SUNMatrix matrix = SUNDenseMatrix(problem.size, problem.size, context);
    SUNLinearSolver solver = dense_solver_of_custom_vectors(context);
    IDASetLinearSolver(ida, solver, matrix);
    IDASetJacFn(ida, jacobian_of_custom_vectors);
    return LinearSystem{solver, matrix};
  });
}

}  // namespace

TEST_CASE("gradients on custom vectors, direct solver: polished as on serial ones") {
  for (const char* form : {"index 1", "index 0"}) {
    INFO(form);
    const Problem problem = pendulum(1.0, 1.0, 10.0, form);
    REQUIRE(problem.jacobian);
    const tp::Constraints rows =
        as_gradients(problem.select({"position", "velocity", "energy"}), problem.size);
    const End serial = run_with_direct_solver(Kind::serial, problem, 1e-6, rows);
    const End custom = run_with_direct_solver(Kind::custom, problem, 1e-6, rows);
    REQUIRE(serial.flag >= 0);
    CHECK(custom.statistics.extra_iterations > custom.steps / 8);
    CHECK(custom.shifted + serial.shifted == 0);
    if (form == std::string("index 0")) {
      CHECK(custom.statistics.extra_iterations == serial.statistics.extra_iterations);
      CHECK(custom.steps == serial.steps);
    }
    // Which algebraic variables answer to moves is known of serial vectors only: on others the test
    // of all is IDA's own, at shorter steps.
    CHECK(custom.steps <= 1.25 * serial.steps);
    CHECK(custom.statistics.untested == 0);
    for (std::size_t i = 0; i < serial.y.size(); ++i)
      CHECK(std::abs(custom.y[i] - problem.reference[i]) <=
            2.0 * std::abs(serial.y[i] - problem.reference[i]) + 1e-5);
  }
}

TEST_CASE("dense constraints on OpenMP vectors: the same bits as on serial ones") {
  const Problem problem = pendulum(1.0, 1.0, 10.0, "index 1");
  const End serial = run(Kind::serial, problem, 1e-7, problem.recommended_constraints());
  const End open_mp = run(Kind::open_mp, problem, 1e-7, problem.recommended_constraints());
  REQUIRE(serial.flag >= 0);
  CHECK(same_bits(serial.y, open_mp.y));
}

TEST_CASE("vectors without an array, or without operations, are refused by name") {
  Problem problem = tether::test::circle(1.0);
  Context context;
  N_Vector y = make_vector(Kind::custom, problem.y0, context);
  N_Vector yp = make_vector(Kind::custom, problem.yp0, context);
  void* ida = IDACreate(context);
  REQUIRE(IDAInit(ida, residual, 0.0, y, yp) == 0);
  CHECK(contains(thrown([&] { const tp::Projection made(ida, on_circle()); }), "Gradients"));
  IDAFree(&ida);

  y->ops->nvdotprod = nullptr;
  ida = IDACreate(context);
  REQUIRE(IDAInit(ida, residual, 0.0, y, yp) == 0);
  CHECK(contains(thrown([&] { const tp::Projection made(ida, as_gradients(on_circle(), 2)); }),
                 "N_VDotProd"));
  IDAFree(&ida);
  N_VDestroy(y);
  N_VDestroy(yp);
}

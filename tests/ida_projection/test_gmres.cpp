// Tether: systems too large for matrices, solved by GMRES. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <nvector/nvector_serial.h>
#include <problems/pendulum.hpp>
#include <sunlinsol/sunlinsol_spgmr.h>

#include "host.hpp"
#include "rod_chain.hpp"
#include "support/catch.hpp"

using namespace tether::test;

namespace {

/// With GMRES: a dense matrix of 4000 unknowns takes 128 MB. `rows` null: plain IDA.
Run integrate_without_matrix(const Problem& given, double tolerance, const tp::Constraints* rows,
                             const tp::Options& options = {}) {
  Problem problem = given;
  Context context;
  N_Vector y = N_VNew_Serial(problem.size, context), yp = N_VClone(y);
  std::copy(problem.y0.begin(), problem.y0.end(), N_VGetArrayPointer(y));
  std::copy(problem.yp0.begin(), problem.yp0.end(), N_VGetArrayPointer(yp));
  void* ida = IDACreate(context);
  const auto residual = [](sunrealtype t, N_Vector at, N_Vector slope, N_Vector r, void* data) {
    static_cast<Problem*>(data)->residual(t, N_VGetArrayPointer(at), N_VGetArrayPointer(slope),
                                          N_VGetArrayPointer(r));
    return 0;
  };
  IDAInit(ida, residual, 0.0, y, yp);
  IDASetUserData(ida, &problem);
  IDASStolerances(ida, tolerance, tolerance);
  SUNLinearSolver solver = SUNLinSol_SPGMR(y, SUN_PREC_NONE, 10, context);
  IDASetLinearSolver(ida, solver, nullptr);
  Run run;
  {
    std::unique_ptr<tp::Projection> projection;
    if (rows != nullptr) projection = std::make_unique<tp::Projection>(ida, *rows, options);
    sunrealtype t = 0.0;
    while (t < problem.t_end && run.flag >= 0) {
      run.flag = IDASolve(ida, problem.t_end, &t, y, yp, IDA_ONE_STEP);
      if (rows == nullptr || run.flag < 0) continue;
      const Eigen::VectorXd g = value(*rows, t, N_VGetArrayPointer(y), problem.size);
      run.drift = std::max(run.drift, g.lpNorm<Eigen::Infinity>());
    }
    if (run.flag >= 0) IDAGetDky(ida, problem.t_end, 0, y);
    IDAGetNumSteps(ida, &run.steps);
    run.y.assign(N_VGetArrayPointer(y), N_VGetArrayPointer(y) + problem.size);
    if (projection) run.statistics = projection->statistics();
    IDAFree(&ida);
  }
  SUNLinSolFree(solver);
  for (N_Vector v : {y, yp}) N_VDestroy(v);
  return run;
}

double apart(const Run& a, const Run& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.y.size(); ++i)
    largest = std::max(largest, std::abs(a.y[i] - b.y[i]));
  return largest;
}

}  // namespace

TEST_CASE("sparse rows of a thousand rods: plain IDA's steps, smaller errors, little work") {
  const RodChain chain(1000, 0.1);
  const Problem problem = chain.problem(0.5);
  const tp::Constraints rows = chain.sparse_rows();
  const Run reference = integrate_without_matrix(problem, 1e-9, &rows);
  double mean = 0.0;
  for (const double tolerance : {1e-4, 1e-5, 1e-7}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate_without_matrix(problem, tolerance, &rows);
    const Run plain = integrate_without_matrix(problem, tolerance, nullptr);
    REQUIRE(run.flag >= 0);
    REQUIRE(plain.flag >= 0);
    const double ratio = static_cast<double>(run.steps) / static_cast<double>(plain.steps);
    CHECK(ratio <= 1.4);
    mean += std::log(ratio) / 3.0;
    CHECK(apart(run, reference) <= 1.2 * apart(plain, reference) + tolerance);
    CHECK(run.drift <= tolerance);
    CHECK(run.statistics.failures() == 0);
    CHECK(run.statistics.iterations <= 5 * run.statistics.projections);
    CHECK(run.statistics.jacobian_evaluations <= run.statistics.projections + 20);
  }
  CHECK(std::exp(mean) <= 1.1);
}

TEST_CASE("dense rows of three hundred rods: the motion of sparse ones") {
  const RodChain chain(300, 0.1);  // 600 rows of 1200 unknowns
  const Problem problem = chain.problem(0.5);
  const tp::Constraints dense = chain.dense_rows(), sparse = chain.sparse_rows();
  const Run reference = integrate_without_matrix(problem, 1e-9, &sparse);
  for (const double tolerance : {1e-4, 1e-6}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate_without_matrix(problem, tolerance, &dense);
    const Run of_sparse = integrate_without_matrix(problem, tolerance, &sparse);
    REQUIRE(run.flag >= 0);
    REQUIRE(of_sparse.flag >= 0);
    CHECK(run.drift <= tolerance);
    CHECK(10 * run.steps <= 12 * of_sparse.steps);
    CHECK(10 * of_sparse.steps <= 12 * run.steps);
    CHECK(apart(run, reference) <= 1.5 * apart(of_sparse, reference) + tolerance);
    CHECK(run.statistics.failures() == 0);
  }
}

TEST_CASE("a thousand rods, GMRES: little more than plain IDA's steps") {
  const RodChain chain(1000, 0.1);
  const Problem problem = chain.problem(0.5);
  const tp::Constraints rows = chain.sparse_rows();
  double mean = 0.0;
  for (const double tolerance : {1.1e-3, 1e-3, 9e-4, 8e-4}) {
    const Run run = integrate_without_matrix(problem, tolerance, &rows);
    const Run plain = integrate_without_matrix(problem, tolerance, nullptr);
    REQUIRE(run.flag >= 0);
    mean += std::log(static_cast<double>(run.steps) / static_cast<double>(plain.steps)) / 4.0;
  }
  CHECK(std::exp(mean) <= 1.3);
}

namespace {

/// u_tt = u_xx - sin u on 2000 points of a period of 20, y = (u, u_t), with its energy.
constexpr int kPoints = 2000;
constexpr double kPeriod = 20.0, kMesh = kPeriod / kPoints;

double pull(const double* u, int i) {
  const double left = u[(i + kPoints - 1) % kPoints], right = u[(i + 1) % kPoints];
  return (left - 2.0 * u[i] + right) / (kMesh * kMesh) - std::sin(u[i]);
}

Problem sine_gordon(double t_end) {
  std::vector<double> y(2 * kPoints);
  for (std::size_t i = 0; i < kPoints; ++i) {
    const double x = kMesh * static_cast<double>(i) - kPeriod / 2.0, turn = 0.314159265358979324;
    y[i] = 3.0 * std::exp(-x * x) + 0.3 * std::cos(turn * x);
    y[kPoints + i] = 0.5 * std::sin(turn * x);
  }
  return ode(y, t_end, [](double, const double* at, double* f) {
    std::copy(at + kPoints, at + 2 * kPoints, f);
    for (int i = 0; i < kPoints; ++i) f[kPoints + i] = pull(at, i);
  });
}

double wave_energy(const double* y) {
  double sum = 0.0;
  for (int i = 0; i < kPoints; ++i) {
    const double slope = (y[(i + 1) % kPoints] - y[i]) / kMesh, rate = y[kPoints + i];
    sum += kMesh * (0.5 * rate * rate + 0.5 * slope * slope + 1.0 - std::cos(y[i]));
  }
  return sum;
}

}  // namespace

TEST_CASE("a wave equation, GMRES: where it fails the order rises no further than plain IDA's") {
  const Problem problem = sine_gordon(3.0);
  const tp::Constraints energy = row(
      "energy",
      [start = wave_energy(problem.y0.data())](double, const double* y) {
        return wave_energy(y) - start;
      },
      [](double, const double* y, double* gradient) {
        for (int i = 0; i < kPoints; ++i) {
          gradient[i] = -kMesh * pull(y, i);
          gradient[kPoints + i] = kMesh * y[kPoints + i];
        }
      });
  const Run reference = integrate_without_matrix(problem, 1e-8, nullptr);
  for (const double tolerance : {1e-3, 3e-4, 1e-4, 3e-5}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate_without_matrix(problem, tolerance, &energy);
    const Run plain = integrate_without_matrix(problem, tolerance, nullptr);
    REQUIRE(run.flag >= 0);
    CHECK(static_cast<double>(run.steps) <= 1.2 * static_cast<double>(plain.steps));
    CHECK(apart(run, reference) <= 1.2 * apart(plain, reference));
  }
}

TEST_CASE("GMRES: few rows of a mechanism keep their own metric, the weights are for fields") {
  const Problem swing = tether::problems::pendulum(1.0, 1.0, 3.0, "index 1");
  const tp::Constraints rows = swing.recommended_constraints();
  const auto end = [&](tp::Metric metric) {
    tp::Options options;
    options.advanced.metric = metric;
    const Run done = integrate_without_matrix(swing, 1e-6, &rows, options);
    REQUIRE(done.flag >= 0);
    return done.y;
  };
  CHECK(end(tp::Metric::automatic) == end(tp::Metric::local_correction));
  CHECK(end(tp::Metric::automatic) != end(tp::Metric::error_weights));
}

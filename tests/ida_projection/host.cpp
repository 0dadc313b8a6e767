// Tether: a program around IDA, as the tests need it. SPDX-License-Identifier: BSD-3-Clause
#include "host.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <cstring>
#include <limits>
#include <nvector/nvector_serial.h>
#include <stdexcept>
#include <sundials/sundials_config.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <tether/linalg/least_squares.hpp>
#include <utility>

namespace tether::test {

namespace {

int residual(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  const auto& problem = *static_cast<const Problem*>(data);
  problem.residual(t, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), N_VGetArrayPointer(r));
  const double* values = N_VGetArrayPointer(r);
  for (int i = 0; i < problem.size; ++i)
    if (!std::isfinite(values[i])) return 1;
  return 0;
}

int ida_jacobian(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector yp, N_Vector, SUNMatrix J,
                 void* data, N_Vector, N_Vector, N_Vector) {
  const auto& problem = *static_cast<const Problem*>(data);
  problem.jacobian(t, cj, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), SUNDenseMatrix_Data(J));
  return 0;
}

void require(int flag, const char* what) {
  if (flag != 0) throw std::runtime_error(std::string(what) + " returned " + std::to_string(flag));
}

#if SUNDIALS_VERSION_MAJOR < 7
void silent(int, const char*, const char*, char*, void*) {}
#endif

}  // namespace

Context::Context() {
#if SUNDIALS_VERSION_MAJOR >= 7
  require(SUNContext_Create(SUN_COMM_NULL, &context_), "SUNContext_Create");
  SUNContext_ClearErrHandlers(context_);
#else
  require(SUNContext_Create(nullptr, &context_), "SUNContext_Create");
#endif
}

Context::~Context() { SUNContext_Free(&context_); }

Host::Host(Problem what, double tolerance, Vectors vectors) : problem(std::move(what)) {
  const bool fast = vectors == Vectors::fast;
  const auto n = static_cast<sunindextype>(problem.size);
  t = problem.t0;
  y = vector(problem.y0);
  yp = vector(problem.yp0);
  if (fast) tp::fast_vector(y, yp);
  ida = IDACreate(context);
#if SUNDIALS_VERSION_MAJOR < 7
  IDASetErrHandlerFn(ida, silent, nullptr);
#endif
  require(IDAInit(ida, residual, problem.t0, y, yp), "IDAInit");
  require(IDASetUserData(ida, &problem), "IDASetUserData");
  if (problem.atol_scale.empty()) {
    require(IDASStolerances(ida, tolerance, tolerance), "IDASStolerances");
  } else {
    N_Vector atol = vector(problem.atol_scale);
    N_VScale(tolerance, atol, atol);
    require(IDASVtolerances(ida, tolerance, atol), "IDASVtolerances");
  }
  matrix_ = SUNDenseMatrix(n, n, context);
  linear_solver_ = fast && n <= tp::kLargestFastDense ? tp::fast_dense_solver(y, matrix_)
                                                      : SUNLinSol_Dense(y, matrix_, context);
  use_linear_solver();
  if (problem.jacobian) require(IDASetJacFn(ida, ida_jacobian), "IDASetJacFn");
  if (problem.initial_step > 0.0) IDASetInitStep(ida, problem.initial_step);
  IDASetMaxNumSteps(ida, 1000000);
}

Host::~Host() {
  IDAFree(&ida);
  SUNLinSolFree(linear_solver_);
  SUNMatDestroy(matrix_);
  projection_.reset();
  for (N_Vector v : owned_) N_VDestroy(v);
}

tp::Projection& Host::attach(tp::Constraints constraints, tp::Options options) {
  options.print = false;
  projection_ = std::make_unique<tp::Projection>(ida, std::move(constraints), std::move(options));
  return *projection_;
}

void Host::use_linear_solver() {
  require(IDASetLinearSolver(ida, linear_solver_, matrix_), "IDASetLinearSolver");
}

int Host::step() { return IDASolve(ida, problem.t_end, &t, y, yp, IDA_ONE_STEP); }
int Host::to(double t_out) { return IDASolve(ida, t_out, &t, y, yp, IDA_NORMAL); }

int Host::finish() {
  int flag = 0;
  while (t < problem.t_end && flag >= 0) flag = step();
  if (flag < 0) return flag;
  t = problem.t_end;
  return IDAGetDky(ida, t, 0, y);
}

int Host::restart() {
  t = problem.t0;
  std::copy(problem.y0.begin(), problem.y0.end(), N_VGetArrayPointer(y));
  std::copy(problem.yp0.begin(), problem.yp0.end(), N_VGetArrayPointer(yp));
  return IDAReInit(ida, t, y, yp);
}

long Host::steps() const {
  long n = 0;
  IDAGetNumSteps(ida, &n);
  return n;
}

double* Host::data() const { return N_VGetArrayPointer(y); }
std::vector<double> Host::state() const { return {data(), data() + problem.size}; }

N_Vector Host::vector(const std::vector<double>& values) const {
  N_Vector v = N_VNew_Serial(static_cast<sunindextype>(values.size()), context);
  std::copy(values.begin(), values.end(), N_VGetArrayPointer(v));
  owned_.push_back(v);
  return v;
}

Problem ode(std::vector<double> y0, double t_end,
            std::function<void(double t, const double* y, double* f)> f) {
  Problem p;
  p.name = "ode";
  p.size = static_cast<int>(y0.size());
  p.t_end = t_end;
  p.y0 = std::move(y0);
  p.yp0.resize(p.y0.size());
  f(0.0, p.y0.data(), p.yp0.data());
  p.id.assign(p.y0.size(), 1.0);
  p.residual = [f, n = p.size](double t, const double* y, const double* yp, double* r) {
    f(t, y, r);
    for (int i = 0; i < n; ++i) r[i] = yp[i] - r[i];
  };
  return p;
}

Problem circle(double t_end) {
  Problem p = ode({1.0, 0.0}, t_end, [](double, const double* y, double* f) {
    f[0] = -y[1];
    f[1] = y[0];
  });
  p.reference = {std::cos(t_end), std::sin(t_end)};
  p.error_components = 2;
  return p;
}

tp::Constraints on_circle() {
  return row(
      "circle", [](double, const double* y) { return (y[0] * y[0] + y[1] * y[1] - 1.0) / 2.0; },
      [](double, const double* y, double* c) {
        c[0] = y[0];
        c[1] = y[1];
      });
}

tp::Constraints row(std::string name, std::function<double(double, const double*)> g,
                    std::function<void(double, const double*, double*)> gradient) {
  tp::Constraints set;
  set.count = 1;
  set.names = {std::move(name)};
  set.value = [g = std::move(g)](double t, tp::ConstVector y, tp::Vector out) {
    out[0] = g(t, y.data());
  };
  set.jacobian = tp::DenseJacobian(
      [gradient = std::move(gradient)](double t, tp::ConstVector y, tp::Matrix C) {
        gradient(t, y.data(), C.data());
      });
  return set;
}

tp::Constraints circle_of(double square, const std::string& name) {
  return row(
      name, [square](double, const double* y) { return y[0] * y[0] + y[1] * y[1] - square; },
      [](double, const double* y, double* c) {
        c[0] = 2.0 * y[0];
        c[1] = 2.0 * y[1];
      });
}

Eigen::VectorXd value(const tp::Constraints& set, double t, const double* y, int n) {
  Eigen::VectorXd g(set.total_count());
  if (set.count > 0) set.value(t, tp::ConstVector(y, n), tp::Vector(g.data(), set.count));
  Eigen::Index first = set.count;
  for (const tp::Constraints& part : set.joined) {
    g.segment(first, part.total_count()) = value(part, t, y, n);
    first += part.total_count();
  }
  return g;
}

Eigen::MatrixXd jacobian(const tp::Constraints& set, double t, const double* y, int n) {
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> C(set.total_count(), n);
  C.setZero();
  if (set.count > 0)
    std::get<tp::DenseJacobian>(set.jacobian)
        .fill(t, tp::ConstVector(y, n), tp::Matrix(C.data(), set.count, n));
  Eigen::Index first = set.count;
  for (const tp::Constraints& part : set.joined) {
    C.middleRows(first, part.total_count()) = jacobian(part, t, y, n);
    first += part.total_count();
  }
  return C;
}

double distance(const Host& host, const tp::Constraints& set) {
  const int n = host.problem.size;
  Eigen::VectorXd g = value(set, host.t, host.data(), n);
  Eigen::MatrixXd A = jacobian(set, host.t, host.data(), n);
  N_Vector weights = N_VClone(host.y);
  IDAGetErrWeights(host.ida, weights);
  for (int j = 0; j < n; ++j) {
    const double w = N_VGetArrayPointer(weights)[j];
    A.col(j) *= w > 0.0 ? 1.0 / w : 1.0;
  }
  N_VDestroy(weights);
  double without_gradient = 0.0;
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    const double length = A.row(i).norm();
    if (length > 0.0) {
      A.row(i) /= length;
      g[i] /= length;
    } else {
      without_gradient = std::max(without_gradient, std::abs(g[i]));
      g[i] = 0.0;
    }
  }
  tether::linalg::LeastSquares factors(1e-9);
  factors.factor(A);
  return factors.solve(g).norm() / std::sqrt(n) + without_gradient;
}

Run integrate(const Problem& problem, double tolerance, const tp::Constraints& rows,
              const tp::Options& options, bool watch) {
  Host host(problem, tolerance);
  const bool projected = rows.total_count() > 0;
  if (projected) host.attach(rows, options);
  Run run;
  while (host.t < problem.t_end && host.steps() < 400000) {
    run.flag = host.step();
    if (run.flag < 0) break;
    int order = 0;
    IDAGetLastOrder(host.ida, &order);
    ++run.at_order[order];
    if (projected && watch) {
      run.distance = std::max(run.distance, distance(host, rows));
      run.drift =
          std::max(run.drift, value(rows, host.t, host.data(), problem.size).cwiseAbs().maxCoeff());
    }
  }
  if (run.flag >= 0 && host.t >= problem.t_end) IDAGetDky(host.ida, problem.t_end, 0, host.y);
  run.steps = host.steps();
  run.y = host.state();
  run.error = problem.reference.empty() ? 0.0 : host.error();
  if (projected) {
    run.statistics = host.projection().statistics();
    run.status = host.projection().status();
    run.message = host.projection().message();
  }
  return run;
}

Run integrate_plain(const Problem& problem, double tolerance) {
  return integrate(problem, tolerance, tp::Constraints{});
}

Run integrate_suppressed(const Problem& problem, double tolerance) {
  Host host(problem, tolerance);
  require(IDASetId(host.ida, host.vector(problem.id)), "IDASetId");
  require(IDASetSuppressAlg(host.ida, 1), "IDASetSuppressAlg");
  Run run;
  while (host.t < problem.t_end && run.flag >= 0 && host.steps() < 60000) run.flag = host.step();
  run.steps = host.steps();
  run.error = std::numeric_limits<double>::infinity();
  if (run.flag < 0 || host.t < problem.t_end) return run;
  IDAGetDky(host.ida, problem.t_end, 0, host.y);
  run.error = host.error();
  return run;
}

tp::Constraints gradients_of(const tp::Constraints& dense, int n, double* (*entries)(N_Vector)) {
  tp::Constraints set;
  set.count = dense.total_count();
  for (int i = 0; i < set.count; ++i) set.names.push_back(dense.name(i));
  tp::Gradients gradients;
  gradients.value = [dense, n, entries](double t, N_Vector y, double* g) {
    const Eigen::VectorXd values = value(dense, t, entries(y), n);
    std::copy(values.data(), values.data() + values.size(), g);
  };
  gradients.fill = [dense, n, entries](double t, N_Vector y, N_Vector* rows) {
    const Eigen::MatrixXd C = jacobian(dense, t, entries(y), n);
    for (Eigen::Index i = 0; i < C.rows(); ++i)
      for (int j = 0; j < n; ++j) entries(rows[i])[j] = C(i, j);
  };
  set.jacobian = gradients;
  return set;
}

tp::Constraints as_sparse(const tp::Constraints& rows, int n) {
  tp::Constraints set;
  set.count = rows.total_count();
  set.value = [rows, n](double t, tp::ConstVector y, tp::Vector g) {
    g = value(rows, t, y.data(), n);
  };
  tp::SparseJacobian sparse;
  for (int i = 0; i <= set.count; ++i) sparse.starts.push_back(i * n);
  for (int e = 0; e < set.count * n; ++e) sparse.columns.push_back(e % n);
  sparse.fill = [rows, n](double t, tp::ConstVector y, tp::Vector entries) {
    tp::Matrix(entries.data(), entries.size() / n, n) = jacobian(rows, t, y.data(), n);
  };
  set.jacobian = std::move(sparse);
  return set;
}

bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

}  // namespace tether::test

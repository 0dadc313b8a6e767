// Tether: difference quotients and plain IDA, to judge the test problems. SPDX-License-Identifier:
// BSD-3-Clause
#include "oracle.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <problems/dual.hpp>
#include <stdexcept>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <tether/linalg/least_squares.hpp>

namespace tether::problems::test {

namespace {

// d/dx of a vector function, error O(h^6).
Eigen::VectorXd slope(const std::function<Eigen::VectorXd(double)>& f, double x, double h) {
  Eigen::VectorXd table[3];
  for (int k = 0; k < 3; ++k, h /= 2.0) {
    const double up = x + h, down = x - h;
    table[k] = (f(up) - f(down)) / (up - down);
  }
  for (int k = 0; k < 2; ++k) table[k] = (4.0 * table[k + 1] - table[k]) / 3.0;
  return (16.0 * table[1] - table[0]) / 15.0;
}

std::vector<const Rows*> pick(const Problem& problem, const std::vector<std::string>& names) {
  std::vector<const Rows*> picked;
  for (const Rows& rows : problem.rows)
    if (names.empty() || std::find(names.begin(), names.end(), rows.name) != names.end())
      picked.push_back(&rows);
  return picked;
}

int ida_residual(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  const auto* problem = static_cast<const Problem*>(data);
  problem->residual(t, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), N_VGetArrayPointer(r));
  for (int i = 0; i < problem->size; ++i)
    if (!std::isfinite(N_VGetArrayPointer(r)[i])) return 1;
  return 0;
}

int ida_jacobian(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector yp, N_Vector, SUNMatrix J,
                 void* data, N_Vector, N_Vector, N_Vector) {
  const auto* problem = static_cast<const Problem*>(data);
  problem->jacobian(t, cj, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), SUNDenseMatrix_Data(J));
  return 0;
}

}  // namespace

Eigen::VectorXd value(const Rows& rows, double t, const Eigen::VectorXd& y) {
  Eigen::VectorXd g(rows.constraints.count);
  rows.constraints.value(t, ida_projection::ConstVector(y.data(), y.size()),
                         ida_projection::Vector(g.data(), g.size()));
  return g;
}

RowMajor jacobian(const Rows& rows, double t, const Eigen::VectorXd& y) {
  RowMajor C = RowMajor::Zero(rows.constraints.count, y.size());
  write_jacobian(rows.constraints, t, ida_projection::ConstVector(y.data(), y.size()), C.data());
  return C;
}

RowMajor differences(const Rows& rows, double t, const Eigen::VectorXd& y) {
  RowMajor C(rows.constraints.count, y.size());
  for (int j = 0; j < y.size(); ++j) {
    const auto along = [&](double x) {
      Eigen::VectorXd moved = y;
      moved[j] = x;
      return value(rows, t, moved);
    };
    C.col(j) = slope(along, y[j], 1e-3 * std::max(1.0, std::abs(y[j])));
  }
  return C;
}

Eigen::VectorXd time_differences(const Rows& rows, double t, const Eigen::VectorXd& y) {
  return slope([&](double x) { return value(rows, x, y); }, t, 1e-3);
}

Eigen::VectorXd residual(const Problem& problem, double t, const Eigen::VectorXd& y,
                         const Eigen::VectorXd& yp) {
  Eigen::VectorXd r(problem.size);
  problem.residual(t, y.data(), yp.data(), r.data());
  return r;
}

Eigen::MatrixXd residual_differences(const Problem& problem, double t, double cj,
                                     const Eigen::VectorXd& y, const Eigen::VectorXd& yp) {
  Eigen::MatrixXd J(problem.size, problem.size);
  for (int j = 0; j < problem.size; ++j) {
    const auto along = [&](double x) {
      Eigen::VectorXd moved = y, rate = yp;
      moved[j] += x;
      rate[j] += cj * x;
      return residual(problem, t, moved, rate);
    };
    J.col(j) = slope(along, 0.0, 1e-3 * std::max(1.0, std::abs(y[j])));
  }
  return J;
}

Eigen::VectorXd random_state(const Problem& problem, std::mt19937& random, double* t) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const double mix = uniform(random) > 0.0 ? 1.0 : 0.0;
  *t = (mix == 1.0 ? problem.t0 : problem.t_end) +
       0.01 * (problem.t_end - problem.t0) * uniform(random);
  Eigen::VectorXd y(problem.size);
  for (int i = 0; i < problem.size; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double end = std::isfinite(problem.reference[k]) ? problem.reference[k] : problem.y0[k];
    const double middle = mix * problem.y0[k] + (1.0 - mix) * end;
    const double typical = std::abs(problem.y0[k]) + std::abs(end);
    const double size = 1e-6 + std::min(0.05, 0.05 * typical) + 1e-3 * std::abs(middle);
    y[i] = middle + size * uniform(random);
  }
  return y;
}

Eigen::VectorXd project(const Problem& problem, double t, Eigen::VectorXd y,
                        const std::vector<std::string>& names) {
  const std::vector<const Rows*> picked = pick(problem, names);
  int m = 0;
  for (const Rows* rows : picked) m += rows->constraints.count;
  if (m == 0) return y;
  RowMajor C(m, problem.size);
  Eigen::VectorXd g(m);
  for (int iteration = 0; iteration < 60; ++iteration) {
    int row = 0;
    for (const Rows* rows : picked) {
      const int count = rows->constraints.count;
      g.segment(row, count) = value(*rows, t, y);
      C.middleRows(row, count) = jacobian(*rows, t, y);
      row += count;
    }
    // Rows of very different size are made equal before the rank is judged.
    for (int i = 0; i < m; ++i) {
      const double size = C.row(i).norm();
      if (size == 0.0) continue;
      C.row(i) /= size;
      g[i] /= size;
    }
    linalg::LeastSquares factor(1e-9);
    factor.factor(C);
    Eigen::VectorXd move = factor.solve(g);
    const double limit = 0.1 * (1.0 + y.norm());
    if (move.norm() > limit) move *= limit / move.norm();
    y -= move;
    if (iteration > 3 && move.norm() < 1e-15 * (1.0 + y.norm())) break;
  }
  return y;
}

Eigen::VectorXd derivative(const Problem& problem, double t, const Eigen::VectorXd& y) {
  std::vector<int> differential;
  for (int i = 0; i < problem.size; ++i)
    if (problem.id[static_cast<std::size_t>(i)] == 1.0) differential.push_back(i);
  const int count = static_cast<int>(differential.size());
  Eigen::VectorXd yp = Eigen::VectorXd::Zero(problem.size);
  const Eigen::VectorXd at_zero = residual(problem, t, y, yp).head(count);
  const double probe = 1.0 + at_zero.cwiseAbs().maxCoeff();  // F is linear: any size is exact
  Eigen::MatrixXd A(count, count);
  for (int j = 0; j < count; ++j) {
    yp.setZero();
    yp[differential[static_cast<std::size_t>(j)]] = probe;
    A.col(j) = (residual(problem, t, y, yp).head(count) - at_zero) / probe;
  }
  linalg::LeastSquares factor;
  factor.factor(A);
  yp.setZero();
  for (int refinement = 0; refinement < 3; ++refinement) {
    const Eigen::VectorXd step = factor.solve(-residual(problem, t, y, yp).head(count));
    for (int j = 0; j < count; ++j) yp[differential[static_cast<std::size_t>(j)]] += step[j];
  }
  return yp;
}

Eigen::VectorXd motion(const Problem& problem, double t, Eigen::VectorXd* y) {
  const int N = problem.size;
  Eigen::VectorXd yp = derivative(problem, t, *y);
  Eigen::MatrixXd A(N, N);
  for (int iteration = 0; iteration < 4; ++iteration) {
    for (int j = 0; j < N; ++j) {
      const bool differential = problem.id[static_cast<std::size_t>(j)] == 1.0;
      const auto along = [&](double x) {
        Eigen::VectorXd moved = *y, rate = yp;
        (differential ? rate : moved)[j] += x;
        return residual(problem, t, moved, rate);
      };
      A.col(j) = slope(along, 0.0, 1.0);
    }
    linalg::LeastSquares factor;
    factor.factor(A);
    const Eigen::VectorXd step = factor.solve(-residual(problem, t, *y, yp));
    for (int j = 0; j < N; ++j)
      (problem.id[static_cast<std::size_t>(j)] == 1.0 ? yp : *y)[j] += step[j];
  }
  return yp;
}

Eigen::VectorXd integrate(const Problem& problem, double rtol, double atol, long* steps,
                          bool analytic) {
  SUNContext context = nullptr;
#ifdef SUN_COMM_NULL  // SUNDIALS 7
  SUNContext_Create(SUN_COMM_NULL, &context);
#else
  SUNContext_Create(nullptr, &context);
#endif
  const int N = problem.size;
  const auto vector = [&](const std::vector<double>& from) {
    N_Vector v = N_VNew_Serial(N, context);
    std::copy(from.begin(), from.end(), N_VGetArrayPointer(v));
    return v;
  };
  N_Vector y = vector(problem.y0), yp = vector(problem.yp0), id = vector(problem.id);
  std::vector<double> scale = problem.atol_scale;
  if (scale.empty()) scale.assign(static_cast<std::size_t>(N), 1.0);
  N_Vector absolute = vector(scale);
  N_VScale(atol, absolute, absolute);
  SUNMatrix matrix = SUNDenseMatrix(N, N, context);
  SUNLinearSolver solver = SUNLinSol_Dense(y, matrix, context);
  void* ida = IDACreate(context);
  Problem copy = problem;
  IDAInit(ida, ida_residual, problem.t0, y, yp);
  IDASVtolerances(ida, rtol, absolute);
  IDASetUserData(ida, &copy);
  IDASetId(ida, id);
  IDASetSuppressAlg(ida, SUNTRUE);
  IDASetLinearSolver(ida, solver, matrix);
  if (analytic) IDASetJacFn(ida, ida_jacobian);
  IDASetMaxNumSteps(ida, 5000000);
  if (problem.initial_step > 0.0) IDASetInitStep(ida, problem.initial_step);
  IDASetStopTime(ida, problem.t_end);
  sunrealtype t = problem.t0;
  const int flag = IDASolve(ida, problem.t_end, &t, y, yp, IDA_NORMAL);
  if (steps) IDAGetNumSteps(ida, steps);
  const Eigen::VectorXd end = Eigen::Map<Eigen::VectorXd>(N_VGetArrayPointer(y), N);
  IDAFree(&ida);
  SUNLinSolFree(solver);
  SUNMatDestroy(matrix);
  for (N_Vector v : {y, yp, id, absolute}) N_VDestroy(v);
  SUNContext_Free(&context);
  if (flag < 0)
    throw std::runtime_error(problem.name + ", " + problem.form + ": IDASolve returned " +
                             std::to_string(flag) + " at t = " + std::to_string(t));
  return end;
}

Eigen::VectorXd vector(const std::vector<double>& from) {
  return Eigen::Map<const Eigen::VectorXd>(from.data(), static_cast<int>(from.size()));
}

const Rows* find(const Problem& problem, const std::string& name) {
  for (const Rows& rows : problem.rows)
    if (rows.name == name) return &rows;
  return nullptr;
}

std::string label(const Problem& problem) { return problem.name + ", " + problem.form; }

}  // namespace tether::problems::test

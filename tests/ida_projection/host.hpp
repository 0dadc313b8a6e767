// Tether: a program around IDA, as the tests need it. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <ida/ida.h>
#include <memory>
#include <problems/problem.hpp>
#include <string>
#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>
#include <tether/ida_projection.hpp>
#include <vector>

namespace tether::test {

namespace tp = tether::ida_projection;
using problems::Problem;

/// A SUNContext that stays silent about IDA's errors.
class Context {
 public:
  Context();
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;
  operator SUNContext() const { return context_; }

 private:
  SUNContext context_ = nullptr;
};

/// SUNDIALS' own serial vectors and dense factors, or fast_vector and fast_dense_solver.
enum class Vectors { serial, fast };

/// IDA on a problem: serial vectors, dense LU, the problem's Jacobian (or IDA's differences),
/// tolerances rtol = atol = tol, atol times the problem's own factors.
class Host {
 public:
  Host(Problem problem, double tolerance, Vectors vectors = Vectors::serial);
  ~Host();
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  tp::Projection& attach(tp::Constraints constraints, tp::Options options = {});
  tp::Projection& projection() { return *projection_; }

  int step();                ///< one accepted step
  int to(double t_out);      ///< IDA_NORMAL; the result is interpolated
  int finish();              ///< steps until t_end, then the interpolated y(t_end)
  void use_linear_solver();  ///< dense LU for the present `ida`
  int restart();             ///< IDAReInit at the problem's start
  long steps() const;
  std::vector<double> state() const;  ///< y as a vector
  double* data() const;
  double error() const { return problem.error(data()); }
  N_Vector vector(const std::vector<double>& values) const;  ///< owned by the host

  Problem problem;
  Context context;
  void* ida = nullptr;
  N_Vector y = nullptr, yp = nullptr;
  double t = 0.0;

 private:
  SUNMatrix matrix_ = nullptr;
  SUNLinearSolver linear_solver_ = nullptr;
  std::unique_ptr<tp::Projection> projection_;
  mutable std::vector<N_Vector> owned_;
};

/// y' = f(t, y) as a problem; the reference, if any, is set by the caller.
Problem ode(std::vector<double> y0, double t_end,
            std::function<void(double t, const double* y, double* f)> f);

/// x' = -y, y' = x from (1, 0): (cos t, sin t).
Problem circle(double t_end);
/// (x^2 + y^2 - 1)/2 = 0 with its Jacobian, named "circle".
tp::Constraints on_circle();

/// One row with its gradient.
tp::Constraints row(std::string name, std::function<double(double, const double*)> g,
                    std::function<void(double, const double*, double*)> gradient);

/// x^2 + y^2 = square, another way of saying on_circle() when square = 1.
tp::Constraints circle_of(double square, const std::string& name);

/// g and C of joined sets, by the given callbacks.
Eigen::VectorXd value(const tp::Constraints& set, double t, const double* y, int n);
Eigen::MatrixXd jacobian(const tp::Constraints& set, double t, const double* y, int n);

/// WRMS length, in IDA's present error weights, of the shortest way from y to the linearised
/// constraints; by Eigen, independently of the plugin. |g| itself for what has no gradient.
double distance(const Host& host, const tp::Constraints& set);

struct Run {
  int flag = 0;
  double error = 0.0;  ///< at t_end
  long steps = 0;
  double distance = 0.0;  ///< largest over the accepted steps, in tolerances
  double drift = 0.0;     ///< largest |g_i| over the accepted steps
  long at_order[6] = {};  ///< accepted steps at each order
  std::vector<double> y;
  tp::Statistics statistics;
  tp::Status status = tp::Status::unused;
  std::string message;
};

/// From t0 to t_end with the projection; `rows` empty: plain IDA. `watch` measures distances
/// (slow).
Run integrate(const Problem& problem, double tolerance, const tp::Constraints& rows,
              const tp::Options& options = {}, bool watch = true);
Run integrate_plain(const Problem& problem, double tolerance);

/// The same with algebraic variables out of the error test: plain IDA's best form of index 1 and 2.
/// The error of a run that failed or took 60000 steps is infinite.
Run integrate_suppressed(const Problem& problem, double tolerance);

/// The defaults but for one option.
inline tp::Options enabled(bool tp::Options::*option) {
  tp::Options options;
  options.*option = true;
  return options;
}

/// Rows as gradients in vectors whose entries `entries` tells.
tp::Constraints gradients_of(const tp::Constraints& rows, int n,
                             double* (*entries)(N_Vector) = N_VGetArrayPointer);
/// Rows as sparse ones with every entry in the pattern.
tp::Constraints as_sparse(const tp::Constraints& rows, int n);

/// Are both states the same, bit for bit?
bool same_bits(const std::vector<double>& a, const std::vector<double>& b);

}  // namespace tether::test

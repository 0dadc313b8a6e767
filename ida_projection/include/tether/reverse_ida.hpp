// Tether: IDA by reverse communication, with or without projection. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <tether/export.hpp>
#include <tether/ida_projection/options.hpp>
#include <tether/ida_projection/projection.hpp>
#include <tether/ida_projection/sundials_build.hpp>
#include <utility>
#include <vector>

TETHER_EXPORT_BEGIN
/// IDA by reverse communication.
namespace tether::reverse_ida {

/// Why a call has returned. All but `reached` and `failed` are requests: the caller fills result()
/// and calls go_on().
enum class Request : int {
  reached,      ///< t(), y() and yp() are the solution that was asked for
  failed,       ///< the integration cannot go on: flag(), message()
  residual,     ///< result() = F(t, y, yp), N entries
  jacobian,     ///< result() = dF/dy + cj dF/dyp, N x N by columns; zero on entry
  setup,        ///< factorise that matrix; it serves the requests `solve` up to the next one
  solve,        ///< result() = x with (dF/dy + cj dF/dyp) x = rhs()
  constraints,  ///< result() = g(t, y)
  constraint_jacobian,  ///< result() = dg/dy, m x N by rows; zero on entry
};

/// The enumerator as text.
const char* to_string(Request request);

/// Who solves the linear systems of Newton's method.
enum class Linear {
  differences,  ///< SUNDIALS' dense solver with difference quotients of F
  jacobian,     ///< SUNDIALS' dense solver; the caller gives the matrix
  own           ///< the caller factorises and solves
};

/// F(t, y, yp) = 0 from t0 on, and the constraints g(t, y) = 0 that its solution obeys.
struct Equations {
  double t0 = 0.0;                 ///< time of the initial values
  std::vector<double> y, yp;       ///< N values each
  double rtol = 1e-6;              ///< relative tolerance of IDA
  std::vector<double> atol{1e-6};  ///< absolute tolerances: one for all, or N
  std::vector<double> id;          ///< IDA's id (1 differential, 0 algebraic): N values, or none
  Linear linear = Linear::differences;  ///< who solves the linear systems

  int constraints = 0;              ///< m; 0: plain IDA
  std::vector<std::string> names;   ///< of the rows of g, for messages; m or none
  bool constraint_jacobian = true;  ///< false: dg/dy by differences of g
  /// Options of the projection; `id` above goes before its id. The reason why a run ends is only in
  /// ReverseIda::message().
  ida_projection::Options options = {};
};

/// IDA for programs that cannot give it functions to call: each call returns to the caller for F,
/// its Jacobian, linear solves, g and dg/dy, and goes on from there when they are there.
///
///     Request r = ida.solve(t_out);
///     while (r != Request::reached && r != Request::failed) {
///       if (r == Request::residual) f(ida.t(), ida.y(), ida.yp(), ida.result());
///       ...
///       r = ida.go_on();
///     }
///
/// IDA runs on a stack of its own (1 MB, Boost.Context); results are those of the same functions
/// given as callbacks, bit by bit. Not for use by two threads at once. One that was moved from
/// throws std::logic_error.
class ReverseIda {
 public:
  /// Throws std::invalid_argument, naming the argument and its value, std::runtime_error if the
  /// SUNDIALS that runs is not the one that the library was compiled with, and std::bad_alloc.
  explicit ReverseIda(Equations equations)
      : ReverseIda(std::move(equations), TETHER_SUNDIALS_BUILD) {}
  /// A request that is still open is given up; nothing is asked any more.
  ~ReverseIda();
  ReverseIda(ReverseIda&&) noexcept;
  ReverseIda& operator=(ReverseIda&&) noexcept;

  /// Up to `tout`, or by one step of IDA towards it. With constraints the point returned lies on
  /// them. Throws std::logic_error while a request is open.
  Request solve(double tout, bool one_step = false);
  /// Initial values onto the constraints and consistent with F, as Projection::make_consistent
  /// (with IDACalcIC); needs constraints. Throws std::logic_error as above, or without constraints.
  Request make_consistent();

  /// The request is answered: 0 with the result in place, > 0 it has no value here (IDA tries a
  /// smaller step), < 0 end the run. Throws std::logic_error if nothing was asked.
  Request go_on(int answer = 0);

  Request request() const;          ///< the last one returned
  double t() const;                 ///< time where IDA stands, or asks
  double cj() const;                ///< of `jacobian` and `setup`
  const double* y() const;          ///< N
  const double* yp() const;         ///< N; null in `solve`, `constraints` and `constraint_jacobian`
  const double* rhs() const;        ///< N; null but in `solve`
  double* result() const;           ///< null where nothing is asked
  std::size_t result_size() const;  ///< entries of result()

  int flag() const;             ///< of IDASolve, after `reached` and `failed`
  std::string message() const;  ///< why it failed; empty otherwise

  /// For IDASet... and IDAGet... between calls; its user data and functions belong to this class.
  void* ida_mem() const;
  /// Null without constraints.
  const ida_projection::Projection* projection() const;

 private:
  ReverseIda(Equations equations, const ida_projection::SundialsBuild& host);
  class TETHER_HIDDEN Implementation;
  Implementation& its() const;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tether::reverse_ida
TETHER_EXPORT_END

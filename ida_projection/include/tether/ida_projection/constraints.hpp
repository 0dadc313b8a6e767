// Tether: constraint projection for SUNDIALS IDA. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <sundials/sundials_nvector.h>
#include <tether/export.hpp>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::ida_projection {

/// Read-only view of the N unknowns y.
using ConstVector = Eigen::Map<const Eigen::VectorXd>;
/// Writable view of the m constraint values g.
using Vector = Eigen::Map<Eigen::VectorXd>;
/// Writable view of the m x N constraint Jacobian C = dg/dy; each row is contiguous.
using Matrix = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

/// A callable that returns either nothing (success) or an int with SUNDIALS' contract:
/// 0 success, > 0 recoverable (IDA retries with a smaller step), < 0 fatal.
/// An exception that leaves the callable counts as fatal; its text becomes the status message.
template <class... Arguments>
class Callable {
 public:
  Callable() = default;
  Callable(std::nullptr_t) {}  ///< empty, as by default

  /// From anything that can be called with these arguments.
  template <class F, class = std::enable_if_t<!std::is_same_v<std::decay_t<F>, Callable> &&
                                              std::is_invocable_v<std::decay_t<F>&, Arguments...>>>
  Callable(F&& f) {
    if constexpr (std::is_void_v<std::invoke_result_t<std::decay_t<F>&, Arguments...>>)
      call_ = [f = std::forward<F>(f)](Arguments... arguments) mutable -> int {
        f(std::forward<Arguments>(arguments)...);
        return 0;
      };
    else
      call_ = std::forward<F>(f);
  }

  /// Whether it holds a function.
  explicit operator bool() const { return static_cast<bool>(call_); }
  /// The int that the function returns, 0 where it returns nothing.
  int operator()(Arguments... arguments) const {
    return call_(std::forward<Arguments>(arguments)...);
  }

 private:
  std::function<int(Arguments...)> call_;
};

class RowsAt;
struct Constraints;
struct Options;
struct Statistics;
/// Makes the storage of rows on vectors like `like`. Those that few programs need come with the
/// rows that need them, so that a program links what it uses.
using MakeRows = std::unique_ptr<RowsAt> (*)(const Constraints&, const Options&, Statistics&,
                                             N_Vector like);
std::unique_ptr<RowsAt> make_gradient_rows(const Constraints&, const Options&, Statistics&,
                                           N_Vector like);  ///< of Gradients
std::unique_ptr<RowsAt> make_distributed_rows(const Constraints&, const Options&, Statistics&,
                                              N_Vector like);  ///< of DistributedRows

/// C by forward differences: increment max(sqrt(eps) |y_j|, min(WT_j, 1e-4 max_i |y_i|)) in each
/// column, WT_j the error weight rtol |y_j| + atol_j. Costs N evaluations of g for each C.
struct FiniteDifferences {};

/// C written by the caller. C is zero on entry, so only the non-zero entries need be set.
struct DenseJacobian {
  Callable<double, ConstVector, Matrix> fill;  ///< (t, y, C): writes C = dg/dy at (t, y)
  /// Optional: g as Constraints::value writes it and C as `fill` does, in one call, for rows whose
  /// value and gradient share work (angles, energies). Used wherever both are needed at one point;
  /// the other two are needed still, for g alone and C alone.
  Callable<double, ConstVector, Vector, Matrix> fill_with_value;

  DenseJacobian() = default;
  /// From `fill`.
  template <class F, class = std::enable_if_t<!std::is_same_v<std::decay_t<F>, DenseJacobian>>>
  DenseJacobian(F&& f) : fill(std::forward<F>(f)) {}
  /// From `fill` and `fill_with_value`.
  template <class F, class Both>
  DenseJacobian(F&& f, Both&& both)
      : fill(std::forward<F>(f)), fill_with_value(std::forward<Both>(both)) {}
};

/// Many rows with few entries each: C by its entries. The pattern is fixed and lists every entry
/// that can ever differ from zero (a velocity that is zero at the start included). Rows are
/// compressed: entries starts[i] .. starts[i + 1] - 1 belong to row i, in the ascending columns
/// `columns[..]`. `fill` writes their values in the same order; they are zero on entry. Joined
/// dense rows (energy) stay full rows, of which there should be few. Up to 128 rows in all, with m
/// N <= 65536, take the factors of dense rows: the run is that of the same rows as a DenseJacobian,
/// bit for bit. More rows take sparse factors, and agree with dense ones to the tolerance.
struct SparseJacobian {
  std::vector<int> starts;                     ///< count + 1, from 0 to the number of entries
  std::vector<int> columns;                    ///< of each entry
  Callable<double, ConstVector, Vector> fill;  ///< (t, y, entries)
  /// Optional: g and the entries in one call, as DenseJacobian::fill_with_value.
  Callable<double, ConstVector, Vector, Vector> fill_with_value;
};

/// Few constraints on any vector type (MPI, GPU, a framework's own): values and gradients through
/// N_Vectors only. `value` fills g[0..m-1] with the same numbers on every process; `fill` writes
/// the m gradients dg_i/dy, each an N_Vector like y. Replaces Constraints::value.
struct Gradients {
  Callable<double, N_Vector, double*> value;   ///< (t, y, g)
  Callable<double, N_Vector, N_Vector*> fill;  ///< (t, y, gradients)
  MakeRows make = make_gradient_rows;          ///< their storage; not to be changed
};

/// Many rows with few entries each on vectors that are spread over processes: a net of rods on MPI
/// ranks, with N_VectorParallel or any N_Vector whose entries of this process are an array. Each
/// row belongs to one process, whose Constraints::count, `value`, names and messages are about its
/// own rows. A row may contain unknowns of other processes, of which this one has copies, the
/// ghosts: `value` and `fill` get y with this process's unknowns first and its ghosts after them.
/// Every process calls the functions of its ghosts equally often, and in the same order. A failure
/// of one is a failure on all. mpi_rows.hpp makes everything but `value` and `fill` from the global
/// numbers of the columns.
struct DistributedRows {
  int unknowns = 0;          ///< of this process; 0: neither rows nor ghosts
  int ghosts = 0;            ///< copies of unknowns of other processes
  std::vector<int> starts;   ///< of each row's entries, as in SparseJacobian
  std::vector<int> columns;  ///< of each entry, once in a row: an unknown, or unknowns + ghost
  /// The entries, as SparseJacobian::fill, from y of unknowns + ghosts entries.
  Callable<double, ConstVector, Vector> fill;
  /// Fills the ghosts from the values of the unknowns that they copy.
  Callable<ConstVector, Vector> update_ghosts;
  /// Adds what ghosts hold to the unknowns that they copy (second argument).
  Callable<ConstVector, Vector> add_ghosts;
  MakeRows make = make_distributed_rows;  ///< their storage; not to be changed
};

/// The projection done by the caller, in the shape of CVODE's CVProjFn. From y at time t compute
/// corr with y + corr on the constraints, to accuracy eps_proj in the WRMS norm of IDA's error
/// weights. err holds a copy of the corrector's accumulated correction. IDA uses the projected
/// correction for its error test, so whatever is written to err is ignored.
struct UserProjection {
  /// 0 success, > 0 recoverable, < 0 fatal.
  using Function = int (*)(sunrealtype t, N_Vector y, N_Vector corr, sunrealtype eps_proj,
                           N_Vector err, void* user_data);
  Function function = nullptr;  ///< must be set
  void* user_data = nullptr;    ///< its last argument
};

/// The set { y : g(t, y) = 0 } on which the solution is kept, m rows, g in the caller's own units.
/// Join sets with `+`. Rows may be redundant, but they must not contradict each other.
struct Constraints {
  int count = 0;                                ///< m, rows of this set
  Callable<double, ConstVector, Vector> value;  ///< g(t, y)
  std::variant<FiniteDifferences, DenseJacobian, SparseJacobian, Gradients, UserProjection,
               DistributedRows>
      jacobian;                     ///< dg/dy
  std::vector<std::string> names;   ///< optional, one for each row; used in messages
  std::vector<Constraints> joined;  ///< sets added with `+`, their rows after those of this one
  /// The rows can only be evaluated on y with least_unknowns <= N <= most_unknowns; any other
  /// length is refused, by the row's name, when the set is attached and by check_jacobian.
  long least_unknowns = 0, most_unknowns = std::numeric_limits<long>::max();

  /// m over this set and everything joined to it.
  int total_count() const {
    int total = count;
    for (const Constraints& part : joined) total += part.total_count();
    return total;
  }
  /// The name given to a row, or "row i".
  std::string name(int row) const;
};

/// The rows of `a` followed by those of `b`. Gradients join only Gradients and, as second
/// ones, DistributedRows, to which nothing else is joined (an energy over all processes beside the
/// rods of each); a UserProjection joins nothing: std::invalid_argument otherwise.
Constraints operator+(Constraints a, const Constraints& b);

/// The result of check_jacobian.
struct JacobianReport {
  bool correct = true;    ///< no entry is wrong
  double worst = 0.0;     ///< largest relative difference |C - C_difference| / (column scale)
  int row = -1;           ///< of the worst entry; -1 when C is correct
  int column = -1;        ///< of the worst entry; -1 when C is correct, or for a value
  double given = 0.0;     ///< the caller's entry there
  double expected = 0.0;  ///< central differences with extrapolation there, or what `value` gives
  /// "row 2 (energy), column 3: given 1.0, differences give 2.0", or, with column -1,
  /// "row 2 (energy), g: fill_with_value gives 1.0, value gives 2.0".
  std::string message;
};

/// Compares the caller's Jacobian with extrapolated central differences at (t, y), entry by entry.
/// Works for DenseJacobian and SparseJacobian; FiniteDifferences pass trivially. An entry that the
/// pattern lacks is wrong, too, and so is a g or C of fill_with_value that differs from those of
/// the functions for one of them. An entry is wrong when it differs by more than `tolerance` times
/// the larger of its own size and its row's largest entry, both in the scale max(|y_j|, 1).
JacobianReport check_jacobian(const Constraints& constraints, double t, ConstVector y,
                              double tolerance = 1e-5);
/// The same for y in a std::vector.
JacobianReport check_jacobian(const Constraints& constraints, double t,
                              const std::vector<double>& y, double tolerance = 1e-5);

}  // namespace tether::ida_projection
TETHER_EXPORT_END

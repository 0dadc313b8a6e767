// Tether: checks of the constraints and options that a caller attaches. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <stdexcept>
#include <sundials/sundials_config.h>
#include <utility>
#include <vector>

#include "attach/impl.hpp"
#include "constraints/evaluator.hpp"
#include "host/shortest.hpp"

namespace tether::ida_projection {

void reject(const std::string& text) { throw std::invalid_argument("Projection: " + text); }

namespace {

// At most one row for each unknown is independent; so many more are a mistake, and take seconds.
constexpr int kMostRowsEach = 1000;

// The pattern of rows given by their entries.
template <class Rows>
void check_pattern(const std::string& kind, const Rows& sparse, int rows, long unknowns,
                   bool ascending) {
  const auto count = static_cast<int>(sparse.columns.size());
  if (!sparse.fill) reject(kind + "::fill is empty; give the entries of C(t, y)");
  if (static_cast<int>(sparse.starts.size()) != rows + 1)
    reject(kind + "::starts has " + std::to_string(sparse.starts.size()) + " entries for " +
           std::to_string(rows) + " rows; it must have one more than there are rows");
  if (sparse.starts.front() != 0 || sparse.starts.back() != count)
    reject(kind + "::starts goes from " + std::to_string(sparse.starts.front()) + " to " +
           std::to_string(sparse.starts.back()) + "; it must go from 0 to the number of entries, " +
           std::to_string(count));
  std::vector<int> seen(static_cast<std::size_t>(unknowns), -1);  // the last row with each column
  for (int i = 0; i < rows; ++i) {
    const int begin = sparse.starts[static_cast<std::size_t>(i)];
    const int end = sparse.starts[static_cast<std::size_t>(i) + 1];
    if (end < begin || end > count)
      reject(kind + "::starts[" + std::to_string(i + 1) + "] = " + std::to_string(end) +
             "; starts must not decrease, nor exceed the number of entries");
    for (int e = begin; e < end; ++e) {
      const int j = sparse.columns[static_cast<std::size_t>(e)];
      const bool outside = j < 0 || j >= unknowns;
      const bool descends =
          ascending && e > begin && j < sparse.columns[static_cast<std::size_t>(e) - 1];
      if (!outside && !descends && std::exchange(seen[static_cast<std::size_t>(j)], i) != i)
        continue;
      const std::string where = kind + "::columns[" + std::to_string(e) +
                                "] = " + std::to_string(j) + " in row " + std::to_string(i);
      if (outside) reject(where + "; it must be 0 .. " + std::to_string(unknowns - 1));
      reject(where + (ascending ? "; columns of a row must ascend, each once"
                                : "; a row contains each column once"));
    }
  }
}

// Rows of this process; `like` is the vector of all.
void check_distributed(const DistributedRows& given, int rows, N_Vector like) {
  const auto text = [](const char* name, long value) {
    return std::string("DistributedRows::") + name + " = " + std::to_string(value) + "; ";
  };
  if (like->ops->nvgetarraypointer == nullptr)
    reject("the vector type lacks N_VGetArrayPointer, which DistributedRows need");
  if (given.unknowns < 0 || given.ghosts < 0)
    reject(
        text(given.unknowns < 0 ? "unknowns" : "ghosts", std::min(given.unknowns, given.ghosts)) +
        "it must be >= 0");
  const bool whole = is_contiguous(like);  // in one process
  long here = whole ? static_cast<long>(N_VGetLength(like)) : -1;
  if (like->ops->nvgetlocallength != nullptr)
    here = static_cast<long>(like->ops->nvgetlocallength(like));
  if (here >= 0 && given.unknowns != here)
    reject(text("unknowns", given.unknowns) + "this process's part of y has " +
           std::to_string(here));
  if (given.unknowns == 0 && (rows > 0 || given.ghosts > 0))
    reject("DistributedRows on a process without unknowns; give its rows to another one");
  if (given.ghosts > 0 && (!given.update_ghosts || !given.add_ghosts))
    reject(text("ghosts", given.ghosts) + "update_ghosts and add_ghosts must both be given");
  if (rows == 0 && given.columns.empty()) return;
  check_pattern("DistributedRows", given, rows, static_cast<long>(given.unknowns) + given.ghosts,
                false);
}

void check_rows(const Constraints& set, long unknowns, N_Vector like) {
  if (set.count < 0)
    reject("constraints.count = " + std::to_string(set.count) + "; it must be >= 0");
  if (unknowns > 0 && set.count / kMostRowsEach > unknowns)
    reject("constraints.count = " + std::to_string(set.count) + "; it must be at most " +
           std::to_string(kMostRowsEach) + " for each of the " + std::to_string(unknowns) +
           " unknowns");
  if (!set.names.empty() && static_cast<int>(set.names.size()) != set.count)
    reject("constraints.names has " + std::to_string(set.names.size()) + " entries for " +
           std::to_string(set.count) + " rows; give one for each row, or none");
  const auto* distributed = std::get_if<DistributedRows>(&set.jacobian);
  if (distributed != nullptr) check_distributed(*distributed, set.count, like);
  if (set.count > 0 && (has_values(set) || distributed != nullptr) && !set.value)
    reject("constraints.value is empty although constraints.count = " + std::to_string(set.count) +
           "; give g(t, y)");
  if (const auto* dense = std::get_if<DenseJacobian>(&set.jacobian))
    if (set.count > 0 && !dense->fill) reject("DenseJacobian is empty; give C(t, y)");
  if (const auto* sparse = std::get_if<SparseJacobian>(&set.jacobian))
    if (set.count > 0) check_pattern("SparseJacobian", *sparse, set.count, unknowns, true);
  if (const auto* gradients = std::get_if<Gradients>(&set.jacobian))
    if (set.count > 0 && (!gradients->value || !gradients->fill || gradients->make == nullptr))
      reject("Gradients needs value and fill, and make as it was");
  if (const auto* user = std::get_if<UserProjection>(&set.jacobian))
    if (user->function == nullptr) reject("UserProjection::function is null");
  for (const Constraints& part : set.joined) check_rows(part, unknowns, like);
}

void require(bool condition, const std::string& name, double value, const std::string& right) {
  if (!condition) reject("options." + name + " = " + shortest(value) + "; it must be " + right);
}

}  // namespace

bool is_contiguous(N_Vector v) {
  if (v->ops->nvgetarraypointer == nullptr || N_VGetArrayPointer(v) == nullptr) return false;
  switch (N_VGetVectorID(v)) {
    case SUNDIALS_NVEC_SERIAL:
    case SUNDIALS_NVEC_OPENMP:
    case SUNDIALS_NVEC_PTHREADS:
      return true;
    case SUNDIALS_NVEC_CUSTOM:
      break;
    default:
      return false;  // distributed or on a device
  }
  if (v->ops->nvgetlength == nullptr) return false;
#if SUNDIALS_VERSION_MAJOR >= 7
  return N_VGetCommunicator(v) == SUN_COMM_NULL;
#else
  return N_VGetCommunicator(v) == nullptr;
#endif
}

namespace {

// IDAInit has checked those that IDA uses itself.
void check_vector_type(const Constraints& constraints, N_Vector like) {
  if (!has_rows(constraints) || has_values(constraints) ||
      std::holds_alternative<UserProjection>(constraints.jacobian))
    return;
  const N_Vector_Ops ops = like->ops;
  const char* missing = ops->nvdotprod == nullptr     ? "N_VDotProd"
                        : ops->nvmaxnorm == nullptr   ? "N_VMaxNorm"
                        : ops->nvgetlength == nullptr ? "N_VGetLength"
                                                      : nullptr;
  if (missing != nullptr)
    reject(std::string("the vector type lacks ") + missing +
           ", which constraints given as Gradients or DistributedRows need");
}

void check_numbers(const Advanced& given) {
  const auto kind = [](const char* name, auto value, auto last) {
    require(static_cast<int>(value) >= 0 && value <= last, name, static_cast<int>(value),
            "0 .. " + std::to_string(static_cast<int>(last)));
  };
  kind("metric", given.metric, Metric::automatic);
  kind("long_move", given.long_move, LongMove::cap);
  require(given.tolerance > 0.0, "tolerance", given.tolerance, "> 0 (tolerances)");
  kind("polish", given.polish, Polished::none);
  require(given.maximum_iterations >= 1, "maximum_iterations", given.maximum_iterations, ">= 1");
  require(
      given.largest_move >= 0.1, "largest_move", given.largest_move,
      ">= 0.1 (tolerances): the drift of a single good step is as long, and shorter limits make "
      "steps short instead");
  require(given.maximum_step >= 0.0, "maximum_step", given.maximum_step, ">= 0 (0: no limit)");
  require(given.maximum_order >= 1 && given.maximum_order <= 5, "maximum_order",
          given.maximum_order, "1 .. 5 (as IDASetMaxOrd)");
}

void check_solver(SUNNonlinearSolver solver) {
  if (solver == nullptr) return;
  const SUNNonlinearSolver_Ops ops = solver->ops;
  if (ops->gettype == nullptr || ops->solve == nullptr || ops->setsysfn == nullptr)
    reject("options.nonlinear_solver lacks gettype, solve or setsysfn, which IDA needs");
  if (SUNNonlinSolGetType(solver) != SUNNONLINEARSOLVER_ROOTFIND)
    reject("options.nonlinear_solver is not of root-finding type, which IDA needs");
}

// Options with an entry for each unknown.
void check_entries(const Options& options, N_Vector like, bool contiguous, sunindextype length) {
  const auto check_size = [&](std::size_t size, const char* name) {
    if (size == 0) return;
    if (!contiguous)
      reject(std::string("options.") + name + " needs contiguous vectors; use hold_vector");
    if (static_cast<sunindextype>(size) != length)
      reject(std::string("options.") + name + " has " + std::to_string(size) + " entries for " +
             std::to_string(length) + " unknowns");
  };
  check_size(options.hold.size(), "hold");
  check_size(options.group.size(), "group");
  for (std::size_t j = 0; j < options.group.size(); ++j)
    require(options.group[j] >= -1, "group[" + std::to_string(j) + "]", options.group[j],
            "a group >= 0, or -1 for none");
  const auto check_vector = [&](N_Vector v, const char* name) {
    if (v != nullptr && (N_VGetVectorID(v) != N_VGetVectorID(like) ||
                         (v->ops->nvgetlength != nullptr && N_VGetLength(v) != length)))
      reject(std::string("options.") + name +
             " is of another vector type or length than the unknowns (" + std::to_string(length) +
             ")");
  };
  check_vector(options.id, "id");
  check_vector(options.advanced.hold_vector, "hold_vector");
  for (sunindextype j = 0; options.id != nullptr && contiguous && j < length; ++j) {
    const double entry = N_VGetArrayPointer(options.id)[j];
    require(entry == 0.0 || entry == 1.0, "id[" + std::to_string(j) + "]", entry,
            "1 (differential) or 0 (algebraic)");
  }
}

}  // namespace

void validate(const Constraints& constraints, const Options& options, N_Vector like) {
  const bool has_length = like->ops->nvgetlength != nullptr, contiguous = is_contiguous(like);
  const sunindextype length = has_length ? N_VGetLength(like) : -1;
  check_vector_type(constraints, like);
  check_rows(constraints, has_length ? length : 0, like);
  const std::string refusal =
      has_length ? wrong_length(constraints, static_cast<long>(length)) : std::string();
  if (!refusal.empty()) reject(refusal);
  check_numbers(options.advanced);
  check_solver(options.nonlinear_solver);
  if (!has_rows(constraints)) return;
  if (has_values(constraints) && !contiguous)
    reject(
        "the vectors are not contiguous in this process; give the constraints as Gradients "
        "or DistributedRows");
  check_entries(options, like, contiguous, length);
}

}  // namespace tether::ida_projection

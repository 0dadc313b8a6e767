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

const char* missing_operation(N_Vector v) {
  const N_Vector_Ops ops = v->ops;
  if (ops->nvclone == nullptr) return "N_VClone";
  if (ops->nvdestroy == nullptr) return "N_VDestroy";
  if (ops->nvlinearsum == nullptr) return "N_VLinearSum";
  if (ops->nvscale == nullptr) return "N_VScale";
  if (ops->nvconst == nullptr) return "N_VConst";
  if (ops->nvwrmsnorm == nullptr) return "N_VWrmsNorm";
  return nullptr;
}

const char* missing_gradient_operation(N_Vector v) {
  const N_Vector_Ops ops = v->ops;
  if (ops->nvprod == nullptr) return "N_VProd";
  if (ops->nvdotprod == nullptr) return "N_VDotProd";
  if (ops->nvabs == nullptr) return "N_VAbs";
  if (ops->nvinv == nullptr) return "N_VInv";
  if (ops->nvmin == nullptr) return "N_VMin";
  if (ops->nvmaxnorm == nullptr) return "N_VMaxNorm";
  if (ops->nvaddconst == nullptr) return "N_VAddConst";
  if (ops->nvgetlength == nullptr) return "N_VGetLength";
  return nullptr;
}

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
  std::vector<int> seen(ascending ? 0 : static_cast<std::size_t>(unknowns), -1);
  for (int i = 0; i < rows; ++i) {
    const int begin = sparse.starts[static_cast<std::size_t>(i)];
    const int end = sparse.starts[static_cast<std::size_t>(i) + 1];
    if (end < begin || end > count)
      reject(kind + "::starts[" + std::to_string(i + 1) + "] = " + std::to_string(end) +
             "; starts must not decrease, nor exceed the number of entries");
    for (int e = begin; e < end; ++e) {
      const int j = sparse.columns[static_cast<std::size_t>(e)];
      const bool outside = j < 0 || j >= unknowns;
      const auto orderly = [&] {
        if (ascending) return e == begin || j > sparse.columns[static_cast<std::size_t>(e) - 1];
        return std::exchange(seen[static_cast<std::size_t>(j)], i) != i;
      };
      if (!outside && orderly()) continue;
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
    if (set.count > 0 && (!gradients->value || !gradients->fill))
      reject("Gradients needs both value and fill");
  if (const auto* user = std::get_if<UserProjection>(&set.jacobian))
    if (user->function == nullptr) reject("UserProjection::function is null");
  for (const Constraints& part : set.joined) check_rows(part, unknowns, like);
}

void require(bool condition, const char* name, double value, const char* right) {
  if (!condition)
    reject(std::string("options.") + name + " = " + shortest(value) + "; it must be " + right);
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

void validate(const Constraints& constraints, const Options& options, N_Vector like) {
  if (const char* missing = missing_operation(like))
    reject(std::string("the vector type lacks ") + missing + ", which the projection needs");
  check_rows(constraints, like->ops->nvgetlength != nullptr ? N_VGetLength(like) : 0, like);
  if (like->ops->nvgetlength != nullptr) {
    const std::string refusal = wrong_length(constraints, static_cast<long>(N_VGetLength(like)));
    if (!refusal.empty()) reject(refusal);
  }

  const auto check_kind = [](int value, int last, const char* name) {
    if (value < 0 || value > last)
      reject(std::string("options.") + name + " = " + std::to_string(value) + "; it must be 0 .. " +
             std::to_string(last));
  };
  check_kind(static_cast<int>(options.advanced.metric), static_cast<int>(Metric::automatic),
             "metric");
  check_kind(static_cast<int>(options.advanced.long_move), static_cast<int>(LongMove::cap),
             "long_move");
  require(options.advanced.tolerance > 0.0, "tolerance", options.advanced.tolerance,
          "> 0 (tolerances)");
  check_kind(static_cast<int>(options.advanced.polish), static_cast<int>(Polished::none), "polish");
  require(options.advanced.maximum_iterations >= 1, "maximum_iterations",
          options.advanced.maximum_iterations, ">= 1");
  require(
      options.advanced.largest_move >= 0.1, "largest_move", options.advanced.largest_move,
      ">= 0.1 (tolerances): the drift of a single good step is as long, and shorter limits make "
      "steps short instead");
  require(options.advanced.maximum_step >= 0.0, "maximum_step", options.advanced.maximum_step,
          ">= 0 (0: no limit)");
  require(options.advanced.maximum_order >= 1 && options.advanced.maximum_order <= 5,
          "maximum_order", options.advanced.maximum_order, "1 .. 5 (as IDASetMaxOrd)");
  if (options.nonlinear_solver != nullptr) {
    const SUNNonlinearSolver_Ops ops = options.nonlinear_solver->ops;
    if (ops->gettype == nullptr || ops->solve == nullptr || ops->setsysfn == nullptr)
      reject("options.nonlinear_solver lacks gettype, solve or setsysfn, which IDA needs");
  }
  if (options.nonlinear_solver != nullptr &&
      SUNNonlinSolGetType(options.nonlinear_solver) != SUNNONLINEARSOLVER_ROOTFIND)
    reject("options.nonlinear_solver is not of root-finding type, which IDA needs");

  if (!has_rows(constraints)) return;

  const bool contiguous = is_contiguous(like);
  const auto length = like->ops->nvgetlength != nullptr ? N_VGetLength(like) : -1;
  if (has_values(constraints) && !contiguous)
    reject(
        "the vectors are not contiguous in this process; give the constraints as Gradients "
        "or DistributedRows");
  if (!has_values(constraints) && !std::holds_alternative<UserProjection>(constraints.jacobian))
    if (const char* missing = missing_gradient_operation(like))
      reject(std::string("the vector type lacks ") + missing +
             ", which constraints given as Gradients or DistributedRows need");
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
    if (options.group[j] < -1)
      reject("options.group[" + std::to_string(j) + "] = " + std::to_string(options.group[j]) +
             "; it must be a group >= 0, or -1 for none");
  const auto check_vector = [&](N_Vector v, const char* name) {
    if (v == nullptr) return;
    if (N_VGetVectorID(v) != N_VGetVectorID(like) ||
        (v->ops->nvgetlength != nullptr && N_VGetLength(v) != length))
      reject(std::string("options.") + name +
             " is of another vector type or length than the unknowns (" + std::to_string(length) +
             ")");
  };
  check_vector(options.id, "id");
  check_vector(options.advanced.hold_vector, "hold_vector");
  if (options.id != nullptr && contiguous) {
    const double* id = N_VGetArrayPointer(options.id);
    for (sunindextype j = 0; j < length; ++j)
      if (id[j] != 0.0 && id[j] != 1.0)
        reject("options.id[" + std::to_string(j) + "] = " + shortest(id[j]) +
               "; it must be 1 (differential) or 0 (algebraic)");
  }
}

}  // namespace tether::ida_projection

// Tether: the projection in deal.II's SUNDIALS::IDA. SPDX-License-Identifier: BSD-3-Clause
//
// Headers of deal.II 9.4 or later, with SUNDIALS; the program links deal.II itself.
#pragma once

#include <algorithm>
#include <charconv>
#include <deal.II/base/config.h>
#include <deal.II/base/index_set.h>
#include <deal.II/lac/block_vector.h>
#include <deal.II/lac/la_parallel_block_vector.h>
#include <deal.II/lac/la_parallel_vector.h>
#include <deal.II/lac/vector.h>
#include <deal.II/sundials/ida.h>
#include <deal.II/sundials/n_vector.h>
#include <functional>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <tether/ida_projection/projection.hpp>
#include <tether/ida_projection/statistics.hpp>
#include <utility>
#include <vector>

/// The projection in deal.II's SUNDIALS::IDA.
namespace tether::ida_projection::deal_ii {

/// The set { y : g(t, y) = 0 }, few rows (mass, energy, momenta), as functions of deal.II's
/// vectors. Both must give the same numbers on every process; an exception ends the run with its
/// text.
template <class VectorType>
struct Rows {
  int count = 0;                   ///< m
  std::vector<std::string> names;  ///< optional, one for each row; used in messages
  /// Fills g[0..m-1], in the caller's own units.
  std::function<void(double t, const VectorType& y, std::vector<double>& g)> value;
  /// dg_row/dy, every element of it, into a vector that is laid out as y.
  std::function<void(double t, int row, const VectorType& y, VectorType& gradient)> gradient;
};

/// The work of solve_dae.
struct Run {
  unsigned int steps = 0;          ///< what IDA::solve_dae returns
  unsigned int attached = 0;       ///< projections: 1, and one more for each restart
  Status status = Status::unused;  ///< of the last one
  std::string message;             ///< empty when all is well
  Statistics statistics;           ///< since the last restart
};

namespace detail {

// The same in every locale.
inline std::string number(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

// IDA's memory and context are private members without an accessor; an explicit instantiation may
// name them all the same. A deal.II that calls them otherwise does not compile here.
template <class VectorType>
struct Access;
template <class Tag, typename Tag::Pointer pointer>
struct Reach {
  friend typename Tag::Pointer memory(Tag) { return pointer; }
};

#define TETHER_DEAL_II_VECTOR(tag, ...)                                       \
  struct tag {                                                                \
    using Pointer = void* ::dealii::SUNDIALS::IDA<__VA_ARGS__>::*;            \
    friend Pointer memory(tag);                                               \
  };                                                                          \
  template struct Reach<tag, &::dealii::SUNDIALS::IDA<__VA_ARGS__>::ida_mem>; \
  template <>                                                                 \
  struct Access<__VA_ARGS__> {                                                \
    using Tag = tag;                                                          \
  };

// The vectors for which deal.II itself has an IDA.
TETHER_DEAL_II_VECTOR(SerialVector, ::dealii::Vector<double>)
TETHER_DEAL_II_VECTOR(SerialBlocks, ::dealii::BlockVector<double>)
TETHER_DEAL_II_VECTOR(DistributedVector, ::dealii::LinearAlgebra::distributed::Vector<double>)
TETHER_DEAL_II_VECTOR(DistributedBlocks, ::dealii::LinearAlgebra::distributed::BlockVector<double>)
#undef TETHER_DEAL_II_VECTOR

template <class VectorType>
void* ida_memory(::dealii::SUNDIALS::IDA<VectorType>& ida) {
  return ida.*memory(typename Access<VectorType>::Tag{});
}

template <class VectorType>
Constraints constraints(const Rows<VectorType>& rows) {
  namespace internal = ::dealii::SUNDIALS::internal;
  Constraints c;
  c.count = rows.count;
  c.names = rows.names;
  Gradients gradients;
  gradients.value = [&rows](double t, N_Vector y, double* g) {
    std::vector<double> values(static_cast<std::size_t>(rows.count));
    rows.value(t, *internal::unwrap_nvector_const<VectorType>(y), values);
    if (values.size() != static_cast<std::size_t>(rows.count))
      throw std::length_error("Rows::value resized g to " + std::to_string(values.size()));
    std::copy(values.begin(), values.end(), g);
  };
  gradients.fill = [&rows](double t, N_Vector y, N_Vector* out) {
    for (int row = 0; row < rows.count; ++row)
      rows.gradient(t, row, *internal::unwrap_nvector_const<VectorType>(y),
                    *internal::unwrap_nvector<VectorType>(out[row]));
  };
  c.jacobian = std::move(gradients);
  return c;
}

}  // namespace detail

/// Instead of ida.solve_dae(solution, solution_dot): every step is on the rows. Every output, which
/// IDA interpolates, is moved onto them before ida.output_step sees it (solution alone:
/// solution_dot stays IDA's; after a restart, both are as the restart left them). Attached anew
/// after each restart. Hooks of `ida` must be set before. Throws std::invalid_argument for rows
/// that cannot be attached, std::runtime_error where IDA fails or an output cannot be moved onto
/// the rows, and whatever ida.solve_dae throws.
template <class VectorType>
Run solve_dae(::dealii::SUNDIALS::IDA<VectorType>& ida, const Rows<VectorType>& rows,
              VectorType& solution, VectorType& solution_dot, const Options& options = {}) {
  if (!rows.value || !rows.gradient)
    throw std::invalid_argument("deal_ii::solve_dae: Rows::value and Rows::gradient must be set");
  Run run;
  std::unique_ptr<Projection> projection;
  SUNContext context = nullptr;
  if (SUNContext_Create(nullptr, &context) != 0) throw std::bad_alloc();
  const std::unique_ptr<SUNContext, void (*)(SUNContext*)> own(
      &context, [](SUNContext* c) { SUNContext_Free(c); });
  const auto output_step = ida.output_step;  // of the caller's
  const auto should_restart = ida.solver_should_restart;
  const auto put_back = [&](const void*) {
    ida.output_step = output_step;
    ida.solver_should_restart = should_restart;
  };
  const std::unique_ptr<const void, decltype(put_back)> at_end(&ida, put_back);
  bool restarted = true;
  double last = 0;

  const auto attach = [&] {
    projection.reset();
    projection =
        std::make_unique<Projection>(detail::ida_memory(ida), detail::constraints(rows), options);
    restarted = false;
    ++run.attached;
  };
  // In its release mode deal.II 9.4 ignores what IDASolve returns, and goes on for ever.
  const auto check = [&](double t) {
    if (static_cast<int>(projection->status()) < 0 || !(t > last))
      throw std::runtime_error("deal_ii::solve_dae: IDA ended at t = " + detail::number(t) + ": " +
                               projection->message());
    last = t;
    const auto view = ::dealii::SUNDIALS::internal::make_nvector_view(solution, context);
    const ConsistencyReport moved = projection->project(t, view);
    if (!moved)
      throw std::runtime_error("deal_ii::solve_dae: the output at t = " + detail::number(t) +
                               " is not on the rows: " + moved.message);
  };
  // deal.II resets IDA, calls output_step, and then in turn steps, asks whether to restart (again
  // and again until the answer is no, with a reset each time), and calls output_step.
  ida.output_step = [&](double t, const VectorType& y, const VectorType& yp, unsigned int step) {
    if (restarted) {
      attach();
      last = t;
    }
    if (output_step) output_step(t, y, yp, step);
  };
  ida.solver_should_restart = [&](double t, VectorType& y, VectorType& yp) {
    if (!restarted) check(t);
    const bool restart = should_restart && should_restart(t, y, yp);
    restarted = restarted || restart;
    return restart;
  };

  const auto account = [&] {
    if (!projection) return;
    run.status = projection->status();
    run.message = projection->message();
    run.statistics = projection->statistics();
  };
  try {
    run.steps = ida.solve_dae(solution, solution_dot);
  } catch (const ::dealii::ExceptionBase& e) {
    account();
    if (run.message.empty()) throw;
    throw std::runtime_error("deal_ii::solve_dae: " + run.message + "; " + e.what());
  }
  account();
  return run;
}

}  // namespace tether::ida_projection::deal_ii

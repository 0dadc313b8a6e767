// Tether: the projection for programs in C. SPDX-License-Identifier: BSD-3-Clause
#include <cstring>
#include <limits>
#include <new>
#include <stdexcept>
#include <string>
#include <tether/ida_projection.h>
#include <tether/ida_projection.hpp>
#include <tether/ida_projection/sensitivities.hpp>
#include <utility>
#include <vector>

#include "c/guarded.hpp"

namespace ip = tether::ida_projection;

struct tether_constraints {
  ip::Constraints rows;
};

struct tether_projection {
  mutable ip::Projection projection;  // its getters call IDA, too
  mutable std::string table;
};

namespace {

/// each(field for C, the same for C++): those that differ in nothing but their type.
template <class ForC, class ForCpp, class Each>
void for_fields(ForC& c, ForCpp& cpp, Each&& each) {
  each(c.metric, cpp.advanced.metric);
  each(c.tolerance, cpp.advanced.tolerance);
  each(c.maximum_iterations, cpp.advanced.maximum_iterations);
  each(c.largest_move, cpp.advanced.largest_move);
  each(c.long_move, cpp.advanced.long_move);
  each(c.id, cpp.id);
  each(c.suppress_algebraic, cpp.suppress_algebraic);
  each(c.polish, cpp.advanced.polish);
  each(c.step_smoothing, cpp.step_smoothing);
  each(c.smooth_where_needed, cpp.advanced.smooth_where_needed);
  each(c.maximum_step, cpp.advanced.maximum_step);
  each(c.maximum_order, cpp.advanced.maximum_order);
  each(c.limit_order, cpp.advanced.limit_order);
  each(c.hold_vector, cpp.advanced.hold_vector);
  each(c.nonlinear_solver, cpp.nonlinear_solver);
  each(c.print, cpp.print);
}

using ip::c::Arguments;
using ip::c::fail;
using ip::c::guarded;

static_assert(int(ip::Status::doubtful) == TETHER_DOUBTFUL &&
              int(ip::Status::out_of_memory) == TETHER_OUT_OF_MEMORY &&
              int(ip::Status::misused) == TETHER_MISUSED &&
              int(ip::Metric::automatic) == TETHER_METRIC_AUTOMATIC &&
              int(ip::LongMove::cap) == TETHER_LONG_MOVE_CAP &&
              int(ip::Polished::none) == TETHER_POLISH_NONE);

// A function of C++ that calls one of C with its data. Arguments of C are pointers.
double* raw(ip::Vector v) { return v.data(); }
double* raw(ip::Matrix C) { return C.data(); }
const double* raw(ip::ConstVector y) { return y.data(); }
template <class Plain>
Plain raw(Plain argument) {
  return argument;
}
template <class Function>
auto bound(Function* f, void* user_data) {
  return [=](double t, auto... arguments) { return f(t, raw(arguments)..., user_data); };
}

// Rows with a value and a Jacobian made by `jacobian`, which checks its own arguments, go to a set.
template <class Value, class Jacobian>
int add_rows(const char* function, tether_constraints* set, int count, Value value, void* user_data,
             Jacobian&& jacobian) {
  return guarded(function, [&](const Arguments& arguments) {
    arguments.require(set, "constraints");
    constexpr int kMost = std::numeric_limits<int>::max() - 1;  // starts has an entry more
    const int there = set->rows.total_count();
    arguments.check(count >= 1, "count", count, "at least 1");
    if (count > kMost - there)
      arguments.refuse("count = " + std::to_string(count) + " after " + std::to_string(there) +
                       " rows, must be at most " + std::to_string(kMost - there));
    arguments.require(value, "value");
    ip::Constraints rows;
    rows.count = count;
    if constexpr (std::is_same_v<Value, tether_value_fn>) rows.value = bound(value, user_data);
    jacobian(arguments, rows.jacobian);
    set->rows = set->rows + rows;  // a copy: the set stays whole if memory runs out
  });
}

template <class Call>
int with(const tether_projection* projection, const char* function, Call&& call) {
  return guarded(function, [&](const Arguments& arguments) {
    arguments.require(projection, "projection");
    return call(projection->projection, arguments);
  });
}

int finish(const ip::ConsistencyReport& found, tether_report* report) {
  if (report != nullptr) {
    const auto& f = found;
    const tether_report r = {report->size,
                             static_cast<int>(f.status),
                             f.iterations,
                             f.move,
                             f.largest_change,
                             f.changed_component,
                             f.derivative_change,
                             f.drift_before,
                             f.drift_after,
                             f.residual_before,
                             f.residual_after,
                             f.rank,
                             f.slow_convergence ? 1 : 0};
    std::memcpy(report, &r, report->size);
  }
  if (found) return 0;
  fail(0, found.message.c_str());
  return found.status == ip::Status::unused ? TETHER_INTERNAL_ERROR
                                            : static_cast<int>(found.status);
}

// A call that returns a report.
template <class Call>
int reported(const tether_projection* projection, const char* function, tether_report* report,
             Call&& call) {
  return with(projection, function, [&](ip::Projection& own, const Arguments& arguments) {
    if (report != nullptr)
      arguments.check(report->size >= sizeof(size_t) && report->size <= sizeof *report,
                      "report->size", report->size, "sizeof(tether_report)");
    return finish(call(own), report);
  });
}

}  // namespace

// A structure of an older header lacks the last fields.
ip::Options ip::c::options_of(const tether_options* given, long unknowns) {
  tether_options o;
  tether_options_init(&o, sizeof o);
  if (given != nullptr) {
    if (given->size < sizeof(size_t) || given->size > sizeof o)
      throw std::invalid_argument("options->size = " + std::to_string(given->size) +
                                  ": call tether_options_init(options, sizeof *options) first");
    std::memcpy(&o, given, given->size);
  }
  if ((o.hold != nullptr || o.group != nullptr) && unknowns <= 0)
    throw std::invalid_argument("unknowns = " + std::to_string(unknowns) +
                                ", must be the length of options->hold and group");
  ip::Options options;
  for_fields(o, options,
             [](const auto& c, auto& cpp) { cpp = static_cast<std::decay_t<decltype(cpp)>>(c); });
  if (o.hold != nullptr)
    for (long i = 0; i < unknowns; ++i) options.hold.push_back(o.hold[i] != 0);
  if (o.group != nullptr) options.group.assign(o.group, o.group + unknowns);
  if (o.progress != nullptr)
    options.progress = [call = o.progress, data = o.progress_data](const ip::Progress& p) {
      call(p.t, p.step, p.order, p.drift, p.move, p.steps, data);
    };
  return options;
}

extern "C" {

const char* tether_last_error(void) { return ip::c::last_error; }

const char* tether_status_name(int status) {
  return ip::to_string(static_cast<ip::Status>(status));
}

int tether_options_init(tether_options* options, size_t size) {
  return guarded("tether_options_init", [&](const Arguments& arguments) {
    arguments.require(options, "options");
    tether_options o{};
    arguments.check(size >= sizeof(size_t) && size <= sizeof o, "size", size,
                    "sizeof(tether_options)");
    const ip::Options defaults;
    for_fields(o, defaults,
               [](auto& c, const auto& cpp) { c = static_cast<std::decay_t<decltype(c)>>(cpp); });
    o.size = size;
    std::memcpy(options, &o, size);
  });
}

tether_constraints* tether_constraints_new(void) { return new (std::nothrow) tether_constraints; }

void tether_constraints_free(tether_constraints* constraints) { delete constraints; }

int tether_add_rows(tether_constraints* constraints, int count, tether_value_fn value,
                    tether_jacobian_fn jacobian, void* user_data) {
  return add_rows("tether_add_rows", constraints, count, value, user_data,
                  [=](const Arguments&, auto& C_of_rows) {
                    if (jacobian != nullptr)
                      C_of_rows = ip::DenseJacobian(bound(jacobian, user_data));
                  });
}

int tether_add_sparse_rows(tether_constraints* constraints, int count, const int* starts,
                           const int* columns, tether_value_fn value, tether_entries_fn entries,
                           void* user_data) {
  return add_rows("tether_add_sparse_rows", constraints, count, value, user_data,
                  [=](const Arguments& arguments, auto& C_of_rows) {
                    arguments.require(starts, "starts");
                    arguments.require(columns, "columns");
                    arguments.require(entries, "entries");
                    for (int i = 0; i <= count; ++i)
                      if (i == 0 ? starts[0] != 0 : starts[i] < starts[i - 1])
                        arguments.refuse("starts[" + std::to_string(i) +
                                         "] = " + std::to_string(starts[i]) +
                                         ", must begin with 0 and never decrease");
                    ip::SparseJacobian pattern;
                    pattern.starts.assign(starts, starts + count + 1);
                    pattern.columns.assign(columns, columns + starts[count]);
                    pattern.fill = bound(entries, user_data);
                    C_of_rows = std::move(pattern);
                  });
}

int tether_add_gradients(tether_constraints* constraints, int count, tether_vector_value_fn value,
                         tether_gradients_fn gradients, void* user_data) {
  return add_rows("tether_add_gradients", constraints, count, value, user_data,
                  [=](const Arguments& arguments, auto& C_of_rows) {
                    arguments.require(gradients, "gradients");
                    ip::Gradients both;
                    both.value = bound(value, user_data);
                    both.fill = bound(gradients, user_data);
                    C_of_rows = std::move(both);
                  });
}

int tether_add_value_and_jacobian(tether_constraints* constraints,
                                  tether_value_and_jacobian_fn both, void* user_data) {
  return guarded("tether_add_value_and_jacobian", [&](const Arguments& arguments) {
    arguments.require(constraints, "constraints");
    arguments.require(both, "both");
    ip::Constraints& rows = constraints->rows;
    ip::Constraints& last = rows.joined.empty() ? rows : rows.joined.back();
    if (auto* dense = std::get_if<ip::DenseJacobian>(&last.jacobian))
      dense->fill_with_value = bound(both, user_data);
    else if (auto* sparse = std::get_if<ip::SparseJacobian>(&last.jacobian))
      sparse->fill_with_value = bound(both, user_data);
    else
      arguments.refuse(
          "the rows added last have no Jacobian; it must follow tether_add_rows with one, or "
          "tether_add_sparse_rows");
  });
}

int tether_add_quaternion_norm(tether_constraints* constraints, int first) {
  return guarded("tether_add_quaternion_norm", [&](const Arguments& arguments) {
    arguments.require(constraints, "constraints");
    constraints->rows = constraints->rows + ip::quaternion_norm(first);
  });
}

int tether_add_linear_invariant(tether_constraints* constraints, const sunrealtype* coefficients,
                                long length, sunrealtype value) {
  return guarded("tether_add_linear_invariant", [&](const Arguments& arguments) {
    arguments.require(constraints, "constraints");
    arguments.require(coefficients, "coefficients");
    arguments.check(length >= 1, "length", length, "the number of unknowns");
    constraints->rows =
        constraints->rows + ip::linear_invariant({coefficients, coefficients + length}, value);
  });
}

int tether_name_row(tether_constraints* constraints, int row, const char* name) {
  return guarded("tether_name_row", [&](const Arguments& arguments) {
    arguments.require(constraints, "constraints");
    arguments.require(name, "name");
    const int all = constraints->rows.total_count();
    if (row < 0 || row >= all)
      arguments.refuse("row = " + std::to_string(row) + ", must be in 0 .. " +
                       std::to_string(all - 1));
    ip::Constraints* part = &constraints->rows;
    int first = 0;
    for (std::size_t k = 0; row - first >= part->count; ++k) {
      first += part->count;
      part = &constraints->rows.joined[k];
    }
    std::string its = name;
    for (std::size_t i = part->names.size(); i < static_cast<std::size_t>(part->count); ++i)
      part->names.push_back("row " + std::to_string(first + static_cast<int>(i)));
    part->names[static_cast<std::size_t>(row - first)] = std::move(its);
  });
}

int tether_count_rows(const tether_constraints* constraints) {
  return guarded("tether_count_rows", [&](const Arguments& arguments) {
    arguments.require(constraints, "constraints");
    return constraints->rows.total_count();
  });
}

tether_projection* tether_projection_new_for(void* ida_mem, const tether_constraints* constraints,
                                             const tether_options* options, long unknowns,
                                             const tether_sundials_build* host, int* flag) {
  tether_projection* made = nullptr;
  const int result = guarded("tether_projection_new", [&](const Arguments& arguments) {
    arguments.require(ida_mem, "ida_mem");
    arguments.require(constraints, "constraints");
    if (constraints->rows.total_count() == 0) arguments.refuse("constraints has no rows");
    arguments.check_build(host);
    ip::Options chosen = ip::c::options_of(options, unknowns);
    made = new tether_projection{{ida_mem, constraints->rows, std::move(chosen)}, {}};
  });
  if (flag != nullptr) *flag = result;
  return made;
}

void tether_projection_free(tether_projection* projection) { delete projection; }

int tether_make_consistent(tether_projection* projection, sunrealtype t0, N_Vector yy, N_Vector yp,
                           IDAResFn F, void* user_data, tether_report* report) {
  ip::Consistency how;
  how.residual = F;
  how.user_data = user_data;
  return reported(projection, "tether_make_consistent", report,
                  [&](ip::Projection& own) { return own.make_consistent(t0, yy, yp, how); });
}

int tether_project(tether_projection* projection, sunrealtype t, N_Vector yy, N_Vector yp,
                   tether_report* report) {
  return reported(projection, "tether_project", report,
                  [&](ip::Projection& own) { return own.project(t, yy, yp); });
}

int tether_solve(tether_projection* projection, sunrealtype tout, sunrealtype* tret, N_Vector yret,
                 N_Vector ypret, int itask) {
  return with(projection, "tether_solve", [&](ip::Projection& own, const Arguments&) {
    return own.solve(tout, tret, yret, ypret, itask);
  });
}

int tether_project_sensitivities(tether_projection* projection,
                                 const tether_sensitivities* sensitivities) {
  const auto call = [&](ip::Projection& own, const Arguments& arguments) {
    arguments.require(sensitivities, "sensitivities");
    arguments.check(sensitivities->size == sizeof *sensitivities, "sensitivities->size",
                    sensitivities->size, "sizeof(tether_sensitivities)");
    const tether_sensitivities given = *sensitivities;
    ip::Sensitivities chosen;
    chosen.count = given.count;
    if (given.derivative != nullptr) chosen.derivative = bound(given.derivative, given.user_data);
    if (given.vector_derivative != nullptr)
      chosen.vector_derivative = bound(given.vector_derivative, given.user_data);
    chosen.parameters = given.parameters;
    const int count = given.count > 0 ? given.count : 0;
    if (given.scales != nullptr) chosen.scales.assign(given.scales, given.scales + count);
    if (given.list != nullptr) chosen.list.assign(given.list, given.list + count);
    chosen.nonlinear_solver = given.nonlinear_solver;
    own.project_sensitivities(std::move(chosen));
  };
  return with(projection, "tether_project_sensitivities", call);
}

int tether_make_sensitivities_consistent(tether_projection* projection, sunrealtype t0, N_Vector yy,
                                         N_Vector yp, N_Vector* s, N_Vector* sp,
                                         tether_report* report) {
  return reported(
      projection, "tether_make_sensitivities_consistent", report,
      [&](ip::Projection& own) { return own.make_sensitivities_consistent(t0, yy, yp, s, sp); });
}

int tether_project_gradient(tether_projection* projection, sunrealtype t, N_Vector yy, N_Vector v) {
  return reported(projection, "tether_project_gradient", nullptr,
                  [&](ip::Projection& own) { return own.project_gradient(t, yy, v); });
}

int tether_get_status(const tether_projection* projection) {
  return with(projection, "tether_get_status",
              [](ip::Projection& own, const Arguments&) { return static_cast<int>(own.status()); });
}

const char* tether_get_message(const tether_projection* projection) {
  const char* message = "";
  with(projection, "tether_get_message",
       [&](ip::Projection& own, const Arguments&) { message = own.message().c_str(); });
  return message;
}

int tether_get_statistic(const tether_projection* projection, const char* name, double* value) {
  const auto call = [&](ip::Projection& own, const Arguments& arguments) {
    arguments.require(name, "name");
    arguments.require(value, "value");
    const double found = own.statistics().number(name);
    if (std::isnan(found))
      arguments.refuse("name = \"" + std::string(name) + "\", must be one of " +
                       ip::Statistics::names());
    *value = found;
  };
  return with(projection, "tether_get_statistic", call);
}

const char* tether_get_statistics_table(const tether_projection* projection) {
  const auto write = [&](ip::Projection& own, const Arguments&) {
    projection->table = own.statistics().table();
  };
  return with(projection, "tether_get_statistics_table", write) == 0 ? projection->table.c_str()
                                                                     : nullptr;
}

int tether_reset_statistics(tether_projection* projection) {
  return with(projection, "tether_reset_statistics",
              [](ip::Projection& own, const Arguments&) { own.reset_statistics(); });
}

int tether_fast_vector(N_Vector y) {
  return guarded("tether_fast_vector", [&](const Arguments&) { ip::fast_vector(y); });
}

SUNLinearSolver tether_fast_dense_solver(N_Vector y, SUNMatrix A) {
  SUNLinearSolver solver = nullptr;
  guarded("tether_fast_dense_solver",
          [&](const Arguments&) { solver = ip::fast_dense_solver(y, A); });
  return solver;
}

}  // extern "C"

// Tether: the projection for programs in C. SPDX-License-Identifier: BSD-3-Clause
#include <cstring>
#include <exception>
#include <limits>
#include <new>
#include <string>
#include <tether/ida_projection.h>
#include <tether/ida_projection.hpp>
#include <tether/ida_projection/c_options.hpp>
#include <tether/ida_projection/sensitivities.hpp>
#include <utility>
#include <vector>

#include "c/guarded.hpp"

namespace ip = tether::ida_projection;

struct tether_constraints {
  ip::Constraints rows;
};

struct tether_projection {
  ip::Projection projection;
  std::string table;
};

namespace {

using ip::c::fail;
using ip::c::guarded;
using ip::c::ill;
using ip::c::null;

static_assert(int(ip::Status::doubtful) == TETHER_DOUBTFUL &&
              int(ip::Status::out_of_memory) == TETHER_OUT_OF_MEMORY &&
              int(ip::Status::misused) == TETHER_MISUSED &&
              int(ip::Metric::automatic) == TETHER_METRIC_AUTOMATIC &&
              int(ip::LongMove::cap) == TETHER_LONG_MOVE_CAP &&
              int(ip::Polished::none) == TETHER_POLISH_NONE);

int add(tether_constraints& set, const ip::Constraints& rows) {
  set.rows = set.rows + rows;  // a copy: the set stays whole if memory runs out
  return 0;
}

ip::Callable<double, ip::ConstVector, ip::Vector> value_of(tether_value_fn value, void* user_data) {
  return [value, user_data](double t, ip::ConstVector y, ip::Vector g) {
    return value(t, y.data(), g.data(), user_data);
  };
}

int check_rows(const char* function, const tether_constraints* set, int count, bool value) {
  if (set == nullptr) return null(function, "constraints");
  if (count < 1)
    return ill(std::string(function) + ": count = " + std::to_string(count) +
               ", must be at least 1");
  constexpr int kMost = std::numeric_limits<int>::max() - 1;  // starts has an entry more
  const int there = set->rows.total_count();
  if (count > kMost - there)
    return ill(std::string(function) + ": count = " + std::to_string(count) + " after " +
               std::to_string(there) + " rows, must be at most " + std::to_string(kMost - there));
  if (!value) return null(function, "value");
  return 0;
}

int finish(const ip::ConsistencyReport& found, tether_report* report) {
  if (report != nullptr) {
    tether_report r{};
    r.size = report->size;
    r.status = static_cast<int>(found.status);
    r.iterations = found.iterations;
    r.move = found.move;
    r.largest_change = found.largest_change;
    r.changed_component = found.changed_component;
    r.derivative_change = found.derivative_change;
    r.drift_before = found.drift_before;
    r.drift_after = found.drift_after;
    r.residual_before = found.residual_before;
    r.residual_after = found.residual_after;
    r.rank = found.rank;
    r.slow_convergence = found.slow_convergence ? 1 : 0;
    std::memcpy(report, &r, report->size);
  }
  if (found) return 0;
  fail(0, found.message.c_str());
  return found.status == ip::Status::unused ? TETHER_INTERNAL_ERROR
                                            : static_cast<int>(found.status);
}

bool bad_size(const char* function, const tether_report* report) {
  if (report == nullptr || (report->size >= sizeof(size_t) && report->size <= sizeof *report))
    return false;
  ill(std::string(function) + ": report->size = " + std::to_string(report->size) +
      ", must be sizeof(tether_report)");
  return true;
}

}  // namespace

extern "C" {

const char* tether_last_error(void) { return ip::c::last_error; }

const char* tether_status_name(int status) {
  return ip::to_string(static_cast<ip::Status>(status));
}

tether_constraints* tether_constraints_new(void) { return new (std::nothrow) tether_constraints; }

void tether_constraints_free(tether_constraints* constraints) { delete constraints; }

int tether_add_rows(tether_constraints* constraints, int count, tether_value_fn value,
                    tether_jacobian_fn jacobian, void* user_data) {
  return guarded([&] {
    if (const int flag = check_rows("tether_add_rows", constraints, count, value != nullptr))
      return flag;
    ip::Constraints rows;
    rows.count = count;
    rows.value = value_of(value, user_data);
    if (jacobian != nullptr)
      rows.jacobian =
          ip::DenseJacobian([jacobian, user_data](double t, ip::ConstVector y, ip::Matrix C) {
            return jacobian(t, y.data(), C.data(), user_data);
          });
    return add(*constraints, rows);
  });
}

int tether_add_sparse_rows(tether_constraints* constraints, int count, const int* starts,
                           const int* columns, tether_value_fn value, tether_entries_fn entries,
                           void* user_data) {
  return guarded([&] {
    const char* const function = "tether_add_sparse_rows";
    if (const int flag = check_rows(function, constraints, count, value != nullptr)) return flag;
    if (starts == nullptr) return null(function, "starts");
    if (columns == nullptr) return null(function, "columns");
    if (entries == nullptr) return null(function, "entries");
    for (int i = 0; i <= count; ++i)
      if (starts[i] < (i == 0 ? 0 : starts[i - 1]) || (i == 0 && starts[0] != 0))
        return ill(std::string(function) + ": starts[" + std::to_string(i) +
                   "] = " + std::to_string(starts[i]) + ", must begin with 0 and never decrease");
    ip::SparseJacobian pattern;
    pattern.starts.assign(starts, starts + count + 1);
    pattern.columns.assign(columns, columns + starts[count]);
    pattern.fill = [entries, user_data](double t, ip::ConstVector y, ip::Vector values) {
      return entries(t, y.data(), values.data(), user_data);
    };
    ip::Constraints rows;
    rows.count = count;
    rows.value = value_of(value, user_data);
    rows.jacobian = std::move(pattern);
    return add(*constraints, rows);
  });
}

int tether_add_value_and_jacobian(tether_constraints* constraints,
                                  tether_value_and_jacobian_fn both, void* user_data) {
  return guarded([&] {
    const char* const function = "tether_add_value_and_jacobian";
    if (constraints == nullptr) return null(function, "constraints");
    if (both == nullptr) return null(function, "both");
    ip::Constraints& rows = constraints->rows;
    ip::Constraints& last = rows.joined.empty() ? rows : rows.joined.back();
    const auto call = [both, user_data](double t, ip::ConstVector y, ip::Vector g, auto C) {
      return both(t, y.data(), g.data(), C.data(), user_data);
    };
    if (auto* dense = std::get_if<ip::DenseJacobian>(&last.jacobian))
      dense->fill_with_value = call;
    else if (auto* sparse = std::get_if<ip::SparseJacobian>(&last.jacobian))
      sparse->fill_with_value = call;
    else
      return ill(std::string(function) +
                 ": the rows added last have no Jacobian; it must follow tether_add_rows with one, "
                 "or tether_add_sparse_rows");
    return 0;
  });
}

int tether_add_gradients(tether_constraints* constraints, int count, tether_vector_value_fn value,
                         tether_gradients_fn gradients, void* user_data) {
  return guarded([&] {
    const char* const function = "tether_add_gradients";
    if (const int flag = check_rows(function, constraints, count, value != nullptr)) return flag;
    if (gradients == nullptr) return null(function, "gradients");
    ip::Gradients both;
    both.value = [value, user_data](double t, N_Vector y, double* g) {
      return value(t, y, g, user_data);
    };
    both.fill = [gradients, user_data](double t, N_Vector y, N_Vector* rows) {
      return gradients(t, y, rows, user_data);
    };
    ip::Constraints rows;
    rows.count = count;
    rows.jacobian = std::move(both);
    return add(*constraints, rows);
  });
}

int tether_add_quaternion_norm(tether_constraints* constraints, int first) {
  return guarded([&] {
    if (constraints == nullptr) return null("tether_add_quaternion_norm", "constraints");
    return add(*constraints, ip::quaternion_norm(first));
  });
}

int tether_add_linear_invariant(tether_constraints* constraints, const sunrealtype* coefficients,
                                long length, sunrealtype value) {
  return guarded([&] {
    const char* const function = "tether_add_linear_invariant";
    if (constraints == nullptr) return null(function, "constraints");
    if (coefficients == nullptr) return null(function, "coefficients");
    if (length < 1)
      return ill(std::string(function) + ": length = " + std::to_string(length) +
                 ", must be the number of unknowns");
    return add(*constraints, ip::linear_invariant({coefficients, coefficients + length}, value));
  });
}

int tether_name_row(tether_constraints* constraints, int row, const char* name) {
  return guarded([&] {
    const char* const function = "tether_name_row";
    if (constraints == nullptr) return null(function, "constraints");
    if (name == nullptr) return null(function, "name");
    const int all = constraints->rows.total_count();
    if (row < 0 || row >= all)
      return ill(std::string(function) + ": row = " + std::to_string(row) + ", must be in 0 .. " +
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
    return 0;
  });
}

int tether_count_rows(const tether_constraints* constraints) {
  if (constraints == nullptr) return null("tether_count_rows", "constraints");
  return constraints->rows.total_count();
}

int tether_options_init(tether_options* options, size_t size) {
  return guarded([&] {
    if (options == nullptr) return null("tether_options_init", "options");
    const ip::Options defaults;
    tether_options o{};
    if (size < sizeof(size_t) || size > sizeof o)
      return ill("tether_options_init: size = " + std::to_string(size) +
                 ", must be sizeof(tether_options)");
    o.size = size;
    const ip::Advanced& advanced = defaults.advanced;
    o.metric = static_cast<int>(advanced.metric);
    o.tolerance = advanced.tolerance;
    o.maximum_iterations = advanced.maximum_iterations;
    o.largest_move = advanced.largest_move;
    o.long_move = static_cast<int>(advanced.long_move);
    o.suppress_algebraic = defaults.suppress_algebraic;
    o.polish = static_cast<int>(advanced.polish);
    o.step_smoothing = defaults.step_smoothing;
    o.smooth_where_needed = advanced.smooth_where_needed;
    o.maximum_step = advanced.maximum_step;
    o.maximum_order = advanced.maximum_order;
    o.limit_order = advanced.limit_order;
    o.print = defaults.print;
    std::memcpy(options, &o, size);
    return 0;
  });
}

tether_projection* tether_projection_new_for(void* ida_mem, const tether_constraints* constraints,
                                             const tether_options* options, long unknowns,
                                             const tether_sundials_build* host, int* flag) {
  tether_projection* made = nullptr;
  const int result = guarded([&] {
    const char* const function = "tether_projection_new";
    if (ida_mem == nullptr) return null(function, "ida_mem");
    if (constraints == nullptr) return null(function, "constraints");
    if (host == nullptr) return null(function, "host");
    if (constraints->rows.total_count() == 0)
      return ill(std::string(function) + ": constraints has no rows");
    try {
      ip::check_running_sundials(*host);
    } catch (const std::runtime_error& error) {
      return fail(TETHER_WRONG_SUNDIALS, error.what());
    }
    ip::Options chosen = ip::options_of(options, unknowns);
    made = new tether_projection{{ida_mem, constraints->rows, std::move(chosen)}, {}};
    return 0;
  });
  if (flag != nullptr) *flag = result;
  return made;
}

void tether_projection_free(tether_projection* projection) { delete projection; }

int tether_make_consistent(tether_projection* projection, sunrealtype t0, N_Vector yy, N_Vector yp,
                           IDAResFn F, void* user_data, tether_report* report) {
  return guarded([&] {
    const char* const function = "tether_make_consistent";
    if (projection == nullptr) return null(function, "projection");
    if (bad_size(function, report)) return int{TETHER_ILL_INPUT};
    ip::Consistency how;
    how.residual = F;
    how.user_data = user_data;
    return finish(projection->projection.make_consistent(t0, yy, yp, how), report);
  });
}

int tether_project(tether_projection* projection, sunrealtype t, N_Vector yy, N_Vector yp,
                   tether_report* report) {
  return guarded([&] {
    if (projection == nullptr) return null("tether_project", "projection");
    if (bad_size("tether_project", report)) return int{TETHER_ILL_INPUT};
    return finish(projection->projection.project(t, yy, yp), report);
  });
}

int tether_solve(tether_projection* projection, sunrealtype tout, sunrealtype* tret, N_Vector yret,
                 N_Vector ypret, int itask) {
  return guarded([&] {
    if (projection == nullptr) return null("tether_solve", "projection");
    return projection->projection.solve(tout, tret, yret, ypret, itask);
  });
}

int tether_project_sensitivities_with(tether_projection* projection,
                                      const tether_sensitivities* sensitivities,
                                      const tether_idas_functions* idas) {
  return guarded([&] {
    const char* const function = "tether_project_sensitivities";
    if (projection == nullptr) return null(function, "projection");
    if (sensitivities == nullptr) return null(function, "sensitivities");
    if (idas == nullptr) return null(function, "idas");
    if (sensitivities->size != sizeof *sensitivities)
      return ill(std::string(function) + ": sensitivities->size = " +
                 std::to_string(sensitivities->size) + ", must be sizeof(tether_sensitivities)");
    const tether_sensitivities given = *sensitivities;
    ip::Sensitivities chosen;
    chosen.count = given.count;
    if (given.derivative != nullptr)
      chosen.derivative = [given](double t, ip::ConstVector y, int k, ip::Vector g_p) {
        return given.derivative(t, y.data(), k, g_p.data(), given.user_data);
      };
    if (given.vector_derivative != nullptr)
      chosen.vector_derivative = [given](double t, N_Vector y, int k, double* g_p) {
        return given.vector_derivative(t, y, k, g_p, given.user_data);
      };
    chosen.parameters = given.parameters;
    const int count = given.count > 0 ? given.count : 0;
    if (given.scales != nullptr) chosen.scales.assign(given.scales, given.scales + count);
    if (given.list != nullptr) chosen.list.assign(given.list, given.list + count);
    chosen.nonlinear_solver = given.nonlinear_solver;
    projection->projection.project_sensitivities(std::move(chosen), *idas);
    return 0;
  });
}

int tether_make_sensitivities_consistent(tether_projection* projection, sunrealtype t0, N_Vector yy,
                                         N_Vector yp, N_Vector* s, N_Vector* sp,
                                         tether_report* report) {
  return guarded([&] {
    const char* const function = "tether_make_sensitivities_consistent";
    if (projection == nullptr) return null(function, "projection");
    if (bad_size(function, report)) return int{TETHER_ILL_INPUT};
    return finish(projection->projection.make_sensitivities_consistent(t0, yy, yp, s, sp), report);
  });
}

int tether_project_gradient(tether_projection* projection, sunrealtype t, N_Vector yy, N_Vector v) {
  return guarded([&] {
    if (projection == nullptr) return null("tether_project_gradient", "projection");
    return finish(projection->projection.project_gradient(t, yy, v), nullptr);
  });
}

int tether_get_status(const tether_projection* projection) {
  return guarded([&] {
    if (projection == nullptr) return null("tether_get_status", "projection");
    return static_cast<int>(projection->projection.status());
  });
}

const char* tether_get_message(const tether_projection* projection) {
  const char* message = "";
  guarded([&] {
    if (projection != nullptr) message = projection->projection.message().c_str();
    return 0;
  });
  return message;
}

int tether_get_statistic(const tether_projection* projection, const char* name, double* value) {
  return guarded([&] {
    const char* const function = "tether_get_statistic";
    if (projection == nullptr) return null(function, "projection");
    if (name == nullptr) return null(function, "name");
    if (value == nullptr) return null(function, "value");
    const double found = projection->projection.statistics().number(name);
    if (std::isnan(found))
      return ill(std::string(function) + ": name = \"" + name + "\", must be one of " +
                 ip::Statistics::csv_header());
    *value = found;
    return 0;
  });
}

const char* tether_get_statistics_table(const tether_projection* projection) {
  auto* const own = const_cast<tether_projection*>(projection);  // the text only
  const int flag = guarded([&] {
    if (own == nullptr) return null("tether_get_statistics_table", "projection");
    own->table = own->projection.statistics().table();
    return 0;
  });
  return flag == 0 ? own->table.c_str() : nullptr;
}

int tether_reset_statistics(tether_projection* projection) {
  return guarded([&] {
    if (projection == nullptr) return null("tether_reset_statistics", "projection");
    projection->projection.reset_statistics();
    return 0;
  });
}

int tether_fast_vector(N_Vector y) {
  return guarded([&] {
    ip::fast_vector(y);
    return 0;
  });
}

SUNLinearSolver tether_fast_dense_solver(N_Vector y, SUNMatrix A) {
  SUNLinearSolver solver = nullptr;
  guarded([&] {
    solver = ip::fast_dense_solver(y, A);
    return 0;
  });
  return solver;
}

}  // extern "C"

// Tether: the functions for programs in C do what the C++ interface does, and report every error.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <problems/pendulum.hpp>
#include <stdexcept>
#include <string>
#include <sunnonlinsol/sunnonlinsol_newton.h>
#include <tether/ida_projection.h>
#include <vector>

#include "c/guarded.hpp"
#include "host.hpp"
#include "linalg/allocations.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;

namespace {

using Set = std::unique_ptr<tether_constraints, void (*)(tether_constraints*)>;
using Attached = std::unique_ptr<tether_projection, void (*)(tether_projection*)>;

Set new_set() { return Set(tether_constraints_new(), tether_constraints_free); }

Attached attach(Host& host, const Set& set, const tether_options* options = nullptr,
                int* flag = nullptr) {
  return Attached(tether_projection_new(host.ida, set.get(), options, host.problem.size, flag),
                  tether_projection_free);
}

// The unit circle in y[0], y[1]; user_data: calls until `value` returns what is said there.
struct Calls {
  long left = -1;
  int then = 0;
};

int circle_value(sunrealtype, const sunrealtype* y, sunrealtype* g, void* user_data) {
  auto* const calls = static_cast<Calls*>(user_data);
  if (calls != nullptr && calls->left >= 0 && calls->left-- == 0) return calls->then;
  g[0] = (y[0] * y[0] + y[1] * y[1] - 1) / 2;
  return 0;
}

int circle_jacobian(sunrealtype, const sunrealtype* y, sunrealtype* C, void*) {
  C[0] = y[0];
  C[1] = y[1];
  return 0;
}

int circle_vector_value(sunrealtype t, N_Vector y, sunrealtype* g, void* user_data) {
  return circle_value(t, N_VGetArrayPointer(y), g, user_data);
}

int circle_gradient(sunrealtype t, N_Vector y, N_Vector* rows, void* user_data) {
  return circle_jacobian(t, N_VGetArrayPointer(y), N_VGetArrayPointer(rows[0]), user_data);
}

/// y at the end, by the rows that `add` puts into a set.
std::vector<double> end_by_c(const std::function<int(tether_constraints*)>& add) {
  Host host(circle(20), 1e-6);
  const Set set = new_set();
  REQUIRE(add(set.get()) == 0);
  const Attached projection = attach(host, set);
  REQUIRE(projection != nullptr);
  REQUIRE(host.finish() >= 0);
  CHECK(tether_get_status(projection.get()) == TETHER_SUCCESS);
  double projections = 0;
  REQUIRE(tether_get_statistic(projection.get(), "projections", &projections) == 0);
  CHECK(projections >= static_cast<double>(host.steps()));
  return host.state();
}

std::vector<double> end_by_cpp(const tp::Constraints& rows) {
  Host host(circle(20), 1e-6);
  host.attach(rows);
  REQUIRE(host.finish() >= 0);
  return host.state();
}

tp::Constraints differences() {
  tp::Constraints rows = on_circle();
  rows.jacobian = tp::FiniteDifferences{};
  return rows;
}

tp::Constraints gradients() {
  tp::Constraints rows = on_circle();
  rows.value = nullptr;
  tp::Gradients both;
  both.value = [](double t, N_Vector y, double* g) {
    return circle_vector_value(t, y, g, nullptr);
  };
  both.fill = [](double t, N_Vector y, N_Vector* g) { return circle_gradient(t, y, g, nullptr); };
  rows.jacobian = both;
  return rows;
}

bool last_error_has(const std::string& part) { return contains(tether_last_error(), part); }

}  // namespace

TEST_CASE("C interface: every kind of rows gives the bits of the C++ interface") {
  const int starts[] = {0, 2}, columns[] = {0, 1};
  const auto dense = [](tether_constraints* set) {
    return tether_add_rows(set, 1, circle_value, circle_jacobian, nullptr);
  };
  CHECK(same_bits(end_by_c(dense), end_by_cpp(on_circle())));
  const auto both = [](sunrealtype t, const sunrealtype* y, sunrealtype* g, sunrealtype* C, void*) {
    const int flag = circle_value(t, y, g, nullptr);
    return flag != 0 ? flag : circle_jacobian(t, y, C, nullptr);
  };
  CHECK(same_bits(end_by_c([&](tether_constraints* set) {
                    const int flag = dense(set);
                    return flag != 0 ? flag : tether_add_value_and_jacobian(set, both, nullptr);
                  }),
                  end_by_cpp(on_circle())));
  CHECK(same_bits(end_by_c([&](tether_constraints* set) {
                    const int flag = tether_add_sparse_rows(set, 1, starts, columns, circle_value,
                                                            circle_jacobian, nullptr);
                    return flag != 0 ? flag : tether_add_value_and_jacobian(set, both, nullptr);
                  }),
                  end_by_cpp(as_sparse(on_circle(), 2))));
  CHECK(same_bits(end_by_c([](tether_constraints* set) {
                    return tether_add_rows(set, 1, circle_value, nullptr, nullptr);
                  }),
                  end_by_cpp(differences())));
  CHECK(same_bits(end_by_c([&](tether_constraints* set) {
                    return tether_add_sparse_rows(set, 1, starts, columns, circle_value,
                                                  circle_jacobian, nullptr);
                  }),
                  end_by_cpp(as_sparse(on_circle(), 2))));
  CHECK(same_bits(end_by_c([](tether_constraints* set) {
                    return tether_add_gradients(set, 1, circle_vector_value, circle_gradient,
                                                nullptr);
                  }),
                  end_by_cpp(gradients())));
}

TEST_CASE("C interface: the defaults are those of Options, and what is set is used") {
  tether_options options;
  REQUIRE(tether_options_init(&options, sizeof options) == 0);
  const tp::Options defaults;
  CHECK(options.metric == static_cast<int>(defaults.advanced.metric));
  CHECK(options.tolerance == defaults.advanced.tolerance);
  CHECK(options.hold == nullptr);

  const Set set = new_set();
  REQUIRE(tether_add_rows(set.get(), 1, circle_value, circle_jacobian, nullptr) == 0);
  const int hold[] = {0, 1};  // y[1] is not moved
  options.hold = hold;
  options.step_smoothing = 1;
  long reports = 0;
  options.progress = [](sunrealtype, sunrealtype step, int order, sunrealtype, sunrealtype, long,
                        void* data) { *static_cast<long*>(data) += step > 0 && order > 0; };
  options.progress_data = &reports;
  Host host(circle(1), 1e-6);
  {
    const Attached projection = attach(host, set, &options);
    REQUIRE(projection != nullptr);
    REQUIRE(host.finish() >= 0);
    CHECK(reports >= host.steps() - 1);  // the last one is reported with the next
    CHECK(reports <= host.steps());
  }
  Host same(circle(1), 1e-6);
  tp::Options wanted;
  wanted.hold = {false, true};
  wanted.step_smoothing = true;
  same.attach(on_circle(), wanted);
  REQUIRE(same.finish() >= 0);
  CHECK(same_bits(host.state(), same.state()));
}

TEST_CASE("C interface: every field of the options is handed on") {
  tether_options o;
  REQUIRE(tether_options_init(&o, sizeof o) == 0);
  const tp::Options defaults;
  Host host(circle(1), 1e-6);
  const int hold[] = {0, 1, 0}, group[] = {2, -1, 0};
  o.metric = TETHER_METRIC_LOCAL_CORRECTION;
  o.tolerance = 0.125;
  o.maximum_iterations = defaults.advanced.maximum_iterations + 1;
  o.largest_move = 0.375;
  o.long_move = TETHER_LONG_MOVE_CAP;
  o.id = host.y;
  o.suppress_algebraic = !defaults.suppress_algebraic;
  o.polish = TETHER_POLISH_NONE;
  o.step_smoothing = !defaults.step_smoothing;
  o.smooth_where_needed = !defaults.advanced.smooth_where_needed;
  o.maximum_step = 0.875;
  o.maximum_order = 3;
  o.limit_order = !defaults.advanced.limit_order;
  o.hold = hold;
  o.hold_vector = host.yp;
  o.group = group;
  o.print = !defaults.print;
  const tp::Options cpp = tp::c::options_of(&o, 3);
  CHECK(cpp.advanced.metric == tp::Metric::local_correction);
  CHECK(cpp.advanced.tolerance == 0.125);
  CHECK(cpp.advanced.maximum_iterations == o.maximum_iterations);
  CHECK(cpp.advanced.largest_move == 0.375);
  CHECK(cpp.advanced.long_move == tp::LongMove::cap);
  CHECK(cpp.id == host.y);
  CHECK(cpp.suppress_algebraic != defaults.suppress_algebraic);
  CHECK(cpp.advanced.polish == tp::Polished::none);
  CHECK(cpp.step_smoothing != defaults.step_smoothing);
  CHECK(cpp.advanced.smooth_where_needed != defaults.advanced.smooth_where_needed);
  CHECK(cpp.advanced.maximum_step == 0.875);
  CHECK(cpp.advanced.maximum_order == 3);
  CHECK(cpp.advanced.limit_order != defaults.advanced.limit_order);
  CHECK(cpp.hold == std::vector<bool>{false, true, false});
  CHECK(cpp.advanced.hold_vector == host.yp);
  CHECK(cpp.group == std::vector<int>{2, -1, 0});
  CHECK(cpp.print != defaults.print);
}

TEST_CASE("C interface: a structure of an older header keeps the defaults of what it lacks") {
  tether_options options;
  std::memset(&options, 0x55, sizeof options);
  const std::size_t old = offsetof(tether_options, hold);
  REQUIRE(tether_options_init(&options, old) == 0);
  unsigned char behind = 0;
  std::memcpy(&behind, reinterpret_cast<const unsigned char*>(&options) + old, 1);
  CHECK(behind == 0x55);  // not written
  const Set set = new_set();
  REQUIRE(tether_add_rows(set.get(), 1, circle_value, circle_jacobian, nullptr) == 0);
  Host host(circle(1), 1e-6);
  const Attached projection = attach(host, set, &options);
  REQUIRE(projection != nullptr);
  CHECK(host.finish() >= 0);
}

TEST_CASE("C interface: sets join in order, rows have names, counts say how many") {
  const Set set = new_set();
  CHECK(tether_count_rows(set.get()) == 0);
  REQUIRE(tether_add_rows(set.get(), 1, circle_value, circle_jacobian, nullptr) == 0);
  const double sum[] = {1, 1};
  REQUIRE(tether_add_linear_invariant(set.get(), sum, 2, 3) == 0);
  CHECK(tether_count_rows(set.get()) == 2);
  REQUIRE(tether_name_row(set.get(), 0, "circle") == 0);
  REQUIRE(tether_name_row(set.get(), 1, "line") == 0);
  Host host(circle(1), 1e-6);
  const Attached projection = attach(host, set);
  REQUIRE(projection != nullptr);
  // x + y = 3 and the unit circle have no common point: by name.
  const N_Vector y = host.vector({1, 0}), yp = host.vector({0, 1});
  tether_report report;
  report.size = sizeof report;
  CHECK(tether_project(projection.get(), 0, y, yp, &report) > 0);
  CHECK(report.status > TETHER_SUCCESS);
  CHECK(N_VGetArrayPointer(y)[0] == 1);
  CHECK(std::string(tether_last_error()).size() > 20);
}

TEST_CASE("C interface: consistent values are found and reported") {
  const Set set = new_set();
  REQUIRE(tether_add_rows(set.get(), 1, circle_value, circle_jacobian, nullptr) == 0);
  Host host(circle(1), 1e-6);
  const Attached projection = attach(host, set);
  REQUIRE(projection != nullptr);
  const N_Vector y = host.vector({1.1, 0.2}), yp = host.vector({-0.2, 1.1});
  tether_report report;
  report.size = offsetof(tether_report, rank);  // an older one
  report.rank = -7;
  REQUIRE(tether_make_consistent(projection.get(), 0, y, yp, nullptr, nullptr, &report) == 0);
  CHECK(report.drift_before == Approx(0.125));
  CHECK(report.drift_after < 1e-10);
  CHECK(report.rank == -7);
  const double* at = N_VGetArrayPointer(y);
  CHECK(std::abs(std::hypot(at[0], at[1]) - 1) < 1e-10);
  sunrealtype t = 0;
  REQUIRE(tether_solve(projection.get(), 0.5, &t, y, yp, IDA_NORMAL) >= 0);
  CHECK(std::abs(std::hypot(at[0], at[1]) - 1) < 1e-12);
  CHECK(tether_reset_statistics(projection.get()) == 0);
  double calls = -1;
  CHECK(tether_get_statistic(projection.get(), "solver_calls", &calls) == 0);
  CHECK(calls == 0);
  CHECK(contains(tether_get_statistics_table(projection.get()), "IDA has not called the plugin"));
}

TEST_CASE("C interface: what a callback returns ends the run or shortens the step") {
  for (const int returned : {-1, 1}) {
    Calls calls{6, returned};
    const Set set = new_set();
    REQUIRE(tether_add_rows(set.get(), 1, circle_value, circle_jacobian, &calls) == 0);
    Host host(circle(1), 1e-6);
    tether_options options;
    REQUIRE(tether_options_init(&options, sizeof options) == 0);
    options.print = 0;
    const Attached projection = attach(host, set, &options);
    REQUIRE(projection != nullptr);
    const int flag = host.finish();
    double failures = 0;
    if (returned < 0) {
      CHECK(flag < 0);
      CHECK(tether_get_status(projection.get()) == TETHER_CALLBACK_FATAL);
      CHECK(std::string(tether_get_message(projection.get())) != "");
      CHECK(tether_get_statistic(projection.get(), "callback_fatal", &failures) == 0);
    } else {
      CHECK(flag >= 0);
      CHECK(tether_get_statistic(projection.get(), "callback_recoverable", &failures) == 0);
    }
    CHECK(failures == 1);
  }
}

TEST_CASE("C interface: wrong arguments are refused by name and change nothing") {
  const Set set = new_set();
  const int starts[] = {0, 2, 1}, columns[] = {0, 1};
  const double one[] = {1};
  CHECK(tether_add_rows(nullptr, 1, circle_value, nullptr, nullptr) == TETHER_MEM_NULL);
  CHECK(tether_add_rows(set.get(), 0, circle_value, nullptr, nullptr) == TETHER_ILL_INPUT);
  CHECK(last_error_has("count = 0"));
  {
    const Set many = new_set();
    const int most = std::numeric_limits<int>::max();
    CHECK(tether_add_rows(many.get(), most, circle_value, nullptr, nullptr) == TETHER_ILL_INPUT);
    REQUIRE(tether_add_rows(many.get(), most - 2, circle_value, nullptr, nullptr) == 0);
    CHECK(tether_add_rows(many.get(), 2, circle_value, nullptr, nullptr) == TETHER_ILL_INPUT);
    CHECK(last_error_has("count = 2 after 2147483645 rows, must be at most 1"));
    CHECK(tether_count_rows(many.get()) == most - 2);
    tether::ida_projection::Constraints half, other;
    half.count = other.count = most / 2 + 1;
    CHECK_THROWS_AS(half + other, std::invalid_argument);
  }
  CHECK(tether_add_rows(set.get(), 1, nullptr, nullptr, nullptr) == TETHER_MEM_NULL);
  CHECK(last_error_has("value is null"));
  CHECK(tether_add_sparse_rows(set.get(), 2, starts, columns, circle_value, circle_jacobian,
                               nullptr) == TETHER_ILL_INPUT);
  CHECK(last_error_has("starts[2] = 1"));
  CHECK(tether_add_gradients(set.get(), 1, circle_vector_value, nullptr, nullptr) ==
        TETHER_MEM_NULL);
  CHECK(tether_add_value_and_jacobian(set.get(), nullptr, nullptr) == TETHER_MEM_NULL);
  const auto both = [](sunrealtype, const sunrealtype*, sunrealtype*, sunrealtype*, void*) {
    return 0;
  };
  CHECK(tether_add_value_and_jacobian(set.get(), both, nullptr) == TETHER_ILL_INPUT);
  CHECK(last_error_has("must follow tether_add_rows"));
  CHECK(tether_add_linear_invariant(set.get(), one, 0, 1) == TETHER_ILL_INPUT);
  CHECK(tether_add_quaternion_norm(set.get(), -1) == TETHER_ILL_INPUT);
  CHECK(tether_name_row(set.get(), 0, "none") == TETHER_ILL_INPUT);
  CHECK(last_error_has("row = 0"));
  CHECK(tether_count_rows(set.get()) == 0);
  CHECK(tether_options_init(nullptr, sizeof(tether_options)) == TETHER_MEM_NULL);

  Host host(circle(1), 1e-6);
  int flag = 0;
  CHECK(attach(host, set, nullptr, &flag) == nullptr);
  CHECK(flag == TETHER_ILL_INPUT);
  CHECK(last_error_has("no rows"));
  REQUIRE(tether_add_rows(set.get(), 1, circle_value, circle_jacobian, nullptr) == 0);
  // Rows and gradients do not join: the set stays what it was.
  CHECK(tether_add_gradients(set.get(), 1, circle_vector_value, circle_gradient, nullptr) ==
        TETHER_ILL_INPUT);
  CHECK(tether_count_rows(set.get()) == 1);
  const auto refused = [&](const tether_options& options, const char* part) {
    int why = 0;
    INFO(part);
    CHECK(attach(host, set, &options, &why) == nullptr);
    CHECK(why == TETHER_ILL_INPUT);
    CHECK(last_error_has(part));
  };
  tether_options options;
  REQUIRE(tether_options_init(&options, sizeof options) == 0);
  options.metric = 7;
  refused(options, "metric = 7");
  REQUIRE(tether_options_init(&options, sizeof options) == 0);
  options.long_move = -1;
  refused(options, "long_move = -1");
  REQUIRE(tether_options_init(&options, sizeof options) == 0);
  options.tolerance = -1;
  refused(options, "tolerance");
  REQUIRE(tether_options_init(&options, sizeof options) == 0);
  for (const std::size_t wrong : {std::size_t{0}, sizeof options + 1}) {
    options.size = wrong;
    refused(options, "tether_options_init");
  }
  REQUIRE(tether_options_init(&options, sizeof options) == 0);
  const int hold[] = {0, 1};
  options.hold = hold;
  CHECK(tether_projection_new(host.ida, set.get(), &options, 0, &flag) == nullptr);
  CHECK(last_error_has("unknowns = 0"));
  CHECK(tether_projection_new(nullptr, set.get(), nullptr, 2, &flag) == nullptr);
  CHECK(flag == TETHER_MEM_NULL);

  tether_sundials_build other = TETHER_SUNDIALS_BUILD;
  ++other.major;
  CHECK(tether_projection_new_for(host.ida, set.get(), nullptr, 2, &other, &flag) == nullptr);
  CHECK(flag == TETHER_WRONG_SUNDIALS);

  const Attached projection = attach(host, set, nullptr, &flag);
  REQUIRE(projection != nullptr);
  CHECK(flag == 0);
  CHECK(std::string(tether_last_error()).empty());
  double number = -1;
  CHECK(tether_get_statistic(projection.get(), "steps", &number) == TETHER_ILL_INPUT);
  CHECK(last_error_has("solver_calls"));
  CHECK(number == -1);
  tether_report report;
  report.size = 3;
  CHECK(tether_project(projection.get(), 0, host.y, nullptr, &report) == TETHER_ILL_INPUT);
  CHECK(tether_project(nullptr, 0, host.y, nullptr, nullptr) == TETHER_MEM_NULL);
  CHECK(tether_solve(nullptr, 0, nullptr, host.y, host.yp, IDA_NORMAL) == TETHER_MEM_NULL);
  CHECK(tether_get_status(nullptr) == TETHER_MEM_NULL);
  CHECK(std::string(tether_status_name(TETHER_NOT_CONVERGED)) != "");
  CHECK(tether_fast_vector(nullptr) == TETHER_ILL_INPUT);
  CHECK(tether_fast_dense_solver(host.y, nullptr) == nullptr);
  tether_projection_free(nullptr);
  tether_constraints_free(nullptr);
}

#if SUNDIALS_VERSION_MAJOR < 7  // later, N_VClone does not survive it at all
TEST_CASE("C interface: no exception passes where memory ends, and IDA is as it was") {
  bool done = false;
  long n = 0;
  for (; !done && n < 300; ++n) {
    Host host(circle(1), 1e-6);
    const Set set = new_set();
    REQUIRE(set != nullptr);
    // SUNDIALS' own N_VClone does not survive it: made before.
    const SUNNonlinearSolver newton = SUNNonlinSol_Newton(host.y, host.context);
    tether_options options;
    REQUIRE(tether_options_init(&options, sizeof options) == 0);
    options.nonlinear_solver = newton;
    Attached projection(nullptr, tether_projection_free);
    fail_allocation(n);
    int flag = tether_add_rows(set.get(), 1, circle_value, circle_jacobian, nullptr);
    if (flag == 0) flag = tether_name_row(set.get(), 0, "a name that is too long for its string");
    if (flag == 0) projection = attach(host, set, &options, &flag);
    done = !allocation_failed();
    fail_allocation(-1);
    INFO("allocation " << n);
    CHECK(flag == (done ? 0 : TETHER_MEM_FAIL));
    CHECK((projection != nullptr) == done);
    CHECK(host.finish() >= 0);
    IDAFree(&host.ida);
    projection.reset();
    SUNNonlinSolFree(newton);
  }
  CHECK(done);
  CHECK(n > 10);
}
#endif

TEST_CASE("C interface: sensitivities and gradients report what is wrong with their arguments") {
  Host host(circle(1.0), 1e-6);
  const Set set = new_set();
  REQUIRE(tether_add_rows(set.get(), 1, circle_value, circle_jacobian, nullptr) == 0);
  const Attached projection = attach(host, set);
  REQUIRE(projection);
  tether_sensitivities given = {};
  given.size = sizeof given;
  const auto refused = [&](int flag, int expected, const char* text) {
    CHECK(flag == expected);
    CHECK(contains(tether_last_error(), text));
  };
  tether_projection* p = projection.get();
  refused(tether_project_sensitivities(nullptr, &given), TETHER_MEM_NULL, "projection");
  refused(tether_project_sensitivities(p, nullptr), TETHER_MEM_NULL, "sensitivities");
  refused(tether_project_sensitivities(p, &given), TETHER_ILL_INPUT, "count = 0");
  given.count = 1;
  refused(tether_project_sensitivities(p, &given), TETHER_ILL_INPUT, "this program has IDA");
  given.size = 4;
  refused(tether_project_sensitivities(p, &given), TETHER_ILL_INPUT, "size = 4");
  refused(tether_make_sensitivities_consistent(p, 0.0, host.y, host.yp, nullptr, nullptr, nullptr),
          TETHER_ILL_INPUT, "project_sensitivities before");
  refused(tether_project_gradient(nullptr, 0.0, host.y, host.y), TETHER_MEM_NULL, "projection");
  refused(tether_project_gradient(p, 0.0, host.y, nullptr), TETHER_ILL_INPUT, "must not be null");
  // x on the unit circle at (1, 0) points across it.
  N_Vector x = host.vector({1.0, 2.0});
  CHECK(tether_project_gradient(p, 0.0, host.y, x) == 0);
  CHECK(std::abs(N_VGetArrayPointer(x)[0]) < 1e-12);
  CHECK(std::abs(N_VGetArrayPointer(x)[1] - 2.0) < 1e-12);
}

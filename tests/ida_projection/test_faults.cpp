// Tether: callbacks that fail at their k-th call, memory that ends at the n-th allocation.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <limits>
#include <new>
#include <nvector/nvector_serial.h>
#include <problems/pendulum.hpp>
#include <stdexcept>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

#include "contact_points.hpp"
#include "host.hpp"
#include "linalg/allocations.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

enum class Fault { none, stop, recoverable, not_a_number, exception };

/// The fault of one call; 0 otherwise.
struct Spoiler {
  Fault fault = Fault::none;
  long at = -1, calls = 0;  // the call that fails, from 1

  int operator()(double* values, long n) {
    if (++calls != at) return 0;
    if (fault == Fault::exception) throw std::runtime_error("the table ends here");
    if (fault == Fault::not_a_number)
      for (long i = 0; i < n; ++i) values[i] = std::numeric_limits<double>::quiet_NaN();
    return fault == Fault::stop ? -1 : fault == Fault::recoverable ? 1 : 0;
  }
};

Spoiler of_F, of_J;  // IDA's callbacks get the problem as their data

int residual(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  const auto& problem = *static_cast<const Problem*>(data);
  problem.residual(t, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), N_VGetArrayPointer(r));
  return of_F(N_VGetArrayPointer(r), problem.size);
}

int ida_jacobian(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector yp, N_Vector, SUNMatrix J,
                 void* data, N_Vector, N_Vector, N_Vector) {
  const auto& problem = *static_cast<const Problem*>(data);
  double* entries = SUNDenseMatrix_Data(J);
  problem.jacobian(t, cj, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), entries);
  return of_J(entries, problem.size);
}

/// The set with g and C spoilt.
tp::Constraints spoilt(const tp::Constraints& set, const std::shared_ptr<Spoiler>& of_g,
                       const std::shared_ptr<Spoiler>& of_C) {
  tp::Constraints out = set;
  if (set.value)
    out.value = [set, of_g](double t, tp::ConstVector y, tp::Vector g) {
      const int flag = set.value(t, y, g);
      return flag != 0 ? flag : (*of_g)(g.data(), g.size());
    };
  if (auto* own = std::get_if<tp::Gradients>(&out.jacobian)) {
    own->value = [value = own->value, of_g, m = set.count](double t, N_Vector y, double* g) {
      const int flag = value(t, y, g);
      return flag != 0 ? flag : (*of_g)(g, m);
    };
    own->fill = [fill = own->fill, of_C](double t, N_Vector y, N_Vector* rows) {
      const int flag = fill(t, y, rows);
      return flag != 0 ? flag : (*of_C)(N_VGetArrayPointer(rows[0]), N_VGetLength(rows[0]));
    };
  }
  if (auto* own = std::get_if<tp::DistributedRows>(&out.jacobian))
    own->fill = [fill = own->fill, of_C](double t, tp::ConstVector y, tp::Vector entries) {
      const int flag = fill(t, y, entries);
      return flag != 0 ? flag : (*of_C)(entries.data(), entries.size());
    };
  if (const auto* dense = std::get_if<tp::DenseJacobian>(&set.jacobian))
    out.jacobian =
        tp::DenseJacobian([fill = dense->fill, of_C](double t, tp::ConstVector y, tp::Matrix C) {
          const int flag = fill(t, y, C);
          return flag != 0 ? flag : (*of_C)(C.data(), C.size());
        });
  if (const auto* sparse = std::get_if<tp::SparseJacobian>(&set.jacobian)) {
    tp::SparseJacobian with_fault;
    with_fault.starts = sparse->starts;
    with_fault.columns = sparse->columns;
    with_fault.fill = [fill = sparse->fill, of_C](double t, tp::ConstVector y, tp::Vector entries) {
      const int flag = fill(t, y, entries);
      return flag != 0 ? flag : (*of_C)(entries.data(), entries.size());
    };
    out.jacobian = std::move(with_fault);
  }
  for (std::size_t k = 0; k < set.joined.size(); ++k)
    out.joined[k] = spoilt(set.joined[k], of_g, of_C);
  return out;
}

struct Case {
  std::string name;
  Problem problem;
  tp::Constraints rows;
  tp::Options options;
  double t_out;
};

/// Sparse rows of one process, without ghosts.
tp::Constraints as_distributed(tp::Constraints rows, int n) {
  const auto& sparse = std::get<tp::SparseJacobian>(rows.jacobian);
  tp::DistributedRows spread;
  spread.unknowns = n;
  spread.starts = sparse.starts;
  spread.columns = sparse.columns;
  spread.fill = sparse.fill;
  rows.jacobian = std::move(spread);
  return rows;
}

std::vector<Case> cases() {
  std::vector<Case> all;
  const Problem index1 = pendulum(1.0, 1.0, 3.0, "index 1");
  const Problem ggl = pendulum(1.0, 1.0, 3.0, "GGL");
  const Problem wheel = wheel_on_rail("index 1", true, 0.5);
  tp::Constraints differences = index1.recommended_constraints();
  differences.jacobian = tp::FiniteDifferences{};
  for (tp::Constraints& part : differences.joined) part.jacobian = tp::FiniteDifferences{};
  all.push_back({"index 1", index1, index1.recommended_constraints(), {}, 1.0});
  all.push_back({"differences", index1, differences, {}, 1.0});
  all.push_back({"sparse", index1, as_sparse(index1.recommended_constraints(), 5), {}, 1.0});
  const tp::Constraints all_rows = index1.recommended_constraints();
  all.push_back({"gradients", index1, gradients_of(all_rows, 5), {}, 1.0});
  all.push_back({"distributed", index1, as_distributed(as_sparse(all_rows, 5), 5), {}, 1.0});
  all.push_back({"GGL", ggl, ggl.select({"position", "velocity"}), {}, 0.5});
  all.push_back({"joined equations", wheel, wheel.select({"gap", "rate", "energy"}), {}, 0.2});
  return all;
}

struct Outcome {
  int flag = 0;
  tp::Status status = tp::Status::unused;
  std::string message;
  long F = 0, J = 0, g = 0, C = 0;  // calls
  double error = 0.0;
};

enum class Where { F, J, g, C };

Outcome run(const Case& c, Where where, Fault fault, long k) {
  Host host(c.problem, 1e-5);
  auto of_g = std::make_shared<Spoiler>(), of_C = std::make_shared<Spoiler>();
  of_F = of_J = Spoiler{};
  Spoiler& chosen = where == Where::F   ? of_F
                    : where == Where::J ? of_J
                    : where == Where::g ? *of_g
                                        : *of_C;
  chosen.fault = fault;
  chosen.at = k;
  host.attach(spoilt(c.rows, of_g, of_C), c.options);
  IDASetNlsResFn(host.ida, residual);
  if (c.problem.jacobian) IDASetJacFn(host.ida, ida_jacobian);
  Outcome end;
  try {
    end.flag = host.to(c.t_out);
  } catch (...) {
    end.flag = 12345;
  }
  end.status = host.projection().status();
  end.message = host.projection().message();
  end.F = of_F.calls;
  end.J = of_J.calls;
  end.g = of_g->calls;
  end.C = of_C->calls;
  return end;
}

// Every position of a short run, about forty of a long one.
long stride(long calls) { return std::max(1L, calls / 40); }

}  // namespace

TEST_CASE("F says stop at its k-th call: the run ends there with IDA's own flag") {
  for (const Case& c : cases()) {
    const long calls = run(c, Where::F, Fault::none, 0).F;
    REQUIRE(calls > 50);
    for (long k = 1; k <= calls; k += stride(calls)) {
      INFO(c.name << ", call " << k << " of " << calls);
      const Outcome end = run(c, Where::F, Fault::stop, k);
      CHECK(end.flag == IDA_RES_FAIL);
      CHECK(end.F == k);
      CHECK(end.status != tp::Status::success);
    }
  }
}

TEST_CASE("J, g or C says stop at its k-th call: the run ends there") {
  for (const Case& c : cases())
    for (const Where where : {Where::J, Where::g, Where::C}) {
      const Outcome whole = run(c, where, Fault::none, 0);
      REQUIRE(whole.flag >= 0);
      const auto count = [where](const Outcome& end) {
        return where == Where::J ? end.J : where == Where::g ? end.g : end.C;
      };
      for (long k = 1; k <= count(whole); k += stride(count(whole))) {
        INFO(c.name << ", " << static_cast<int>(where) << ", call " << k << " of " << count(whole));
        const Outcome end = run(c, where, Fault::stop, k);
        CHECK(end.flag < 0);
        CHECK(count(end) == k);
        CHECK(end.status ==
              (where == Where::J ? tp::Status::corrector_failed : tp::Status::callback_fatal));
        CHECK((where == Where::J || contains(end.message, "returned -1")));
      }
    }
}

TEST_CASE("an exception at the k-th call of F, J, g or C ends the run and does not pass IDA") {
  for (const Case& c : cases())
    for (const Where where : {Where::F, Where::J, Where::g, Where::C}) {
      const Outcome whole = run(c, where, Fault::none, 0);
      const long calls = where == Where::F   ? whole.F
                         : where == Where::J ? whole.J
                         : where == Where::g ? whole.g
                                             : whole.C;
      for (long k = 1; k <= calls; ++k) {
        INFO(c.name << ", " << static_cast<int>(where) << ", call " << k << " of " << calls);
        const Outcome end = run(c, where, Fault::exception, k);
        CHECK(end.flag == IDA_NLS_FAIL);
        CHECK(end.status == tp::Status::callback_fatal);
        CHECK(contains(end.message, "the table ends here"));
      }
    }
}

TEST_CASE("a recoverable failure or NaN at the k-th call of F, g or C costs no run") {
  for (const Case& c : cases())
    for (const Where where : {Where::F, Where::g, Where::C})
      for (const Fault fault : {Fault::recoverable, Fault::not_a_number}) {
        if (where == Where::F && fault == Fault::not_a_number) continue;  // IDA's own business
        const Outcome whole = run(c, where, fault, 0);
        const long calls = where == Where::F ? whole.F : where == Where::g ? whole.g : whole.C;
        for (long k = 2; k <= calls; k += 3 * stride(calls)) {
          INFO(c.name << ", " << static_cast<int>(where) << ", call " << k << " of " << calls);
          const Outcome end = run(c, where, fault, k);
          CHECK(end.flag >= 0);
          CHECK(end.status == tp::Status::success);
        }
      }
}

TEST_CASE("F fails once where its index is sought: rows keep the equations that they need") {
  const Problem wheel = wheel_on_rail("GGL", true, 0.5);
  const Case c{"GGL", wheel, wheel.select({"gap", "rate", "energy"}), {}, 0.2};
  for (long k = 2; k <= 60; ++k) {  // the index is sought by the calls 15 to 26
    INFO("call " << k);
    const Outcome end = run(c, Where::F, Fault::recoverable, k);
    CHECK(end.flag >= 0);
    CHECK(end.status == tp::Status::success);
  }
}

TEST_CASE("make_consistent and project end with the callback that says stop") {
  const Problem problem = pendulum(1.0, 1.0, 3.0, "index 1");
  const auto attempt = [&](Where where, long k) {
    Host host(problem, 1e-6);
    auto of_g = std::make_shared<Spoiler>(), of_C = std::make_shared<Spoiler>();
    of_F = of_J = Spoiler{};
    Spoiler& chosen = where == Where::F ? of_F : where == Where::g ? *of_g : *of_C;
    chosen.fault = Fault::stop;
    chosen.at = k;
    tp::Projection& projection = host.attach(spoilt(problem.recommended_constraints(), of_g, of_C));
    IDASetNlsResFn(host.ida, residual);
    host.data()[0] += 0.05;  // off the constraints
    host.data()[4] = 0.3;
    tp::Consistency how;
    how.residual = residual;
    how.user_data = &host.problem;
    how.derivative = tp::Consistency::Derivative::least_squares;
    const tp::ConsistencyReport first = projection.make_consistent(0.0, host.y, host.yp, how);
    if (!first) return std::make_pair(first, chosen.calls);
    host.data()[1] += 0.01;
    const tp::ConsistencyReport second = projection.project(0.0, host.y, host.yp);
    return std::make_pair(second, chosen.calls);
  };
  for (const Where where : {Where::F, Where::g, Where::C}) {
    const auto [whole, calls] = attempt(where, 0);
    REQUIRE(whole.status == tp::Status::success);
    for (long k = 1; k <= calls; ++k) {
      INFO(static_cast<int>(where) << ", call " << k << " of " << calls);
      const auto [report, made] = attempt(where, k);
      CHECK(report.status == tp::Status::callback_fatal);
      CHECK_FALSE(report.message.empty());
      CHECK(made == k);
    }
  }
}

#if SUNDIALS_VERSION_MAJOR < 7  // later, N_VClone does not survive it at all
TEST_CASE("memory that ends at the n-th allocation: a status, no crash, no leak") {
  for (const Case& c : cases()) {
    if (!c.problem.jacobian) continue;  // SUNDIALS' difference quotients clone vectors
    const auto attempt = [&](long n, tp::Status* status, bool* refused, bool* reached) {
      of_F = of_J = Spoiler{};
      Host host(c.problem, 1e-5);
      tp::Constraints rows = c.rows;
      tp::Options options = c.options;
      options.print = false;
      // This is made before: SUNDIALS' own N_VClone does not survive the lack of memory.
      SUNNonlinearSolver newton = SUNNonlinSol_Newton(host.y, host.context);
      IDASetId(host.ida, host.vector(c.problem.id));
      options.nonlinear_solver = newton;
      int flag = 0;
      *refused = false;
      *status = tp::Status::unused;
      {
        std::unique_ptr<tp::Projection> projection;
        try {
          fail_allocation(n);
          projection =
              std::make_unique<tp::Projection>(host.ida, std::move(rows), std::move(options));
        } catch (const std::bad_alloc&) {
          *refused = true;
        }
        if (projection) flag = host.to(c.t_out);
        *reached = allocation_failed();
        fail_allocation(-1);
        if (projection) *status = projection->status();
        IDAFree(&host.ida);
      }
      SUNNonlinSolFree(newton);
      return flag;
    };
    tp::Status status{};
    bool refused = false, reached = true;
    REQUIRE(attempt(-1, &status, &refused, &reached) >= 0);
    reached = true;
    int ended = 0, refusals = 0;
    for (long n = 0; reached; ++n) {
      const long before = blocks_alive();
      const int flag = attempt(n, &status, &refused, &reached);
      const long left = blocks_alive() - before;
      INFO(c.name << ", allocation " << n << ", flag " << flag);
      // Eigen's minimum degree ordering goes on without the block that it could not reallocate, and
      // forgets the old one.
      CHECK(left <= (c.name == "sparse" && flag == 0 && !refused ? 1 : 0));
      if (refused)
        ++refusals;
      else if (flag < 0)
        ++ended;
      else
        CHECK(status == tp::Status::success);
    }
    CHECK(refusals > 20);
    CHECK(ended > 10);
  }
}
#endif

TEST_CASE("a solver that takes no functions is refused before IDA lets go of its own") {
  Host host(pendulum(1.0, 1.0, 20.0, "index 1"), 1e-6);
  SUNNonlinearSolver newton = SUNNonlinSol_Newton(host.y, host.context);
  tp::Options options;
  options.nonlinear_solver = newton;
  const auto refused = [&] {
    return thrown([&] { host.attach(host.problem.recommended_constraints(), options); });
  };
  const auto set_system = newton->ops->setsysfn;
  newton->ops->setsysfn = [](SUNNonlinearSolver, SUNNonlinSolSysFn) { return -7; };
  CHECK(contains(refused(), "refuses a system function, flag -7"));
  newton->ops->setsysfn = nullptr;
  CHECK(contains(refused(), "setsysfn"));
  newton->ops->setsysfn = set_system;
  newton->ops->setmaxiters = [](SUNNonlinearSolver, int) { return -8; };
  CHECK(contains(refused(), "number of iterations"));
  CHECK(host.finish() >= 0);  // IDA is as it was
  SUNNonlinSolFree(newton);
}

// Tether: rows that contain algebraic variables which equations of F determine.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <problems/pendulum.hpp>
#include <problems/rows.hpp>

#include "contact_points.hpp"
#include "host.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

/// With the reference of the form that has neither contact point nor force among its unknowns.
Problem with_reference(Problem problem, const Problem& reduced) {
  problem.reference = integrate_plain(reduced, 1e-12).y;
  problem.reference.resize(static_cast<std::size_t>(problem.size),
                           std::numeric_limits<double>::quiet_NaN());
  return problem;
}

/// With unknowns that stand still, up to `size`, and a Jacobian by differences.
Problem among_many(const Problem& problem, int size) {
  Problem out = problem;
  const int n = problem.size;
  const std::size_t all = static_cast<std::size_t>(size);
  out.size = size;
  out.y0.resize(all, 1.0);
  out.yp0.resize(all, 0.0);
  out.id.resize(all, 1.0);
  if (!out.atol_scale.empty()) out.atol_scale.resize(all, 1.0);
  out.residual = [problem, n, size](double t, const double* y, const double* yp, double* r) {
    problem.residual(t, y, yp, r);
    std::copy(yp + n, yp + size, r + n);
  };
  out.jacobian = [problem, n, size](double t, double cj, const double* y, const double* yp,
                                    double* J) {
    constexpr double kStep = 1e-6;
    std::fill_n(J, size * size, 0.0);
    std::vector<double> a(y, y + n), b(yp, yp + n), r(a), before(a);
    for (int j = 0; j < n; ++j)
      for (std::vector<double>* each : {&a, &b}) {
        double& changed = (*each)[static_cast<std::size_t>(j)];
        const double kept = changed;
        changed = kept - kStep;
        problem.residual(t, a.data(), b.data(), before.data());
        changed = kept + kStep;
        problem.residual(t, a.data(), b.data(), r.data());
        changed = kept;
        for (std::size_t i = 0; i < r.size(); ++i)
          J[j * size + static_cast<int>(i)] +=
              (each == &a ? 1.0 : cj) * (r[i] - before[i]) / (2 * kStep);
      }
    for (int j = n; j < size; ++j) J[j * size + j] = cj;
  };
  return out;
}

/// Rows of the problem for among_many().
tp::Constraints rows_among_many(const Problem& problem, const std::vector<std::string>& groups) {
  const tp::Constraints few = problem.select(groups);
  const int n = problem.size;
  tp::Constraints out;
  out.count = few.total_count();
  out.value = [few, n](double t, tp::ConstVector y, tp::Vector g) {
    g = value(few, t, y.data(), n);
    return 0;
  };
  out.jacobian = tp::DenseJacobian([few, n](double t, tp::ConstVector y, tp::Matrix C) {
    C.setZero();
    C.leftCols(n) = jacobian(few, t, y.data(), n);
    return 0;
  });
  return out;
}

struct Count {
  double steps = 0.0, error = 0.0;  // geometric means over those of plain IDA's best form
  int runs = 0;
};

/// Every choice of rows without the tangency equations, dense and sparse.
void check(const Problem& problem, double tolerance, Count* count) {
  const Run plain = integrate_suppressed(problem, tolerance);
  REQUIRE(plain.flag >= 0);
  const tp::Constraints tangency = problem.select({"tangency"});
  for (const std::vector<std::string>& groups :
       {std::vector<std::string>{"gap"}, {"gap", "rate"}, {"gap", "rate", "energy"}}) {
    const tp::Constraints rows = problem.select(groups);
    for (const bool sparse : {false, true}) {
      INFO(problem.name << ", " << problem.form << ", tolerance " << tolerance << ", "
                        << groups.size() << (sparse ? " groups, sparse" : " groups"));
      const Run run =
          integrate(problem, tolerance, sparse ? as_sparse(rows, problem.size) : rows, {}, false);
      INFO(tp::to_string(run.status) << ": " << run.message);
      REQUIRE(run.flag >= 0);
      CHECK(static_cast<double>(run.steps) <= 1.4 * static_cast<double>(plain.steps));
      CHECK(run.error <= 100.0 * tolerance);
      CHECK(run.statistics.failures() <= 2);
      count->steps += std::log(static_cast<double>(run.steps) / static_cast<double>(plain.steps));
      count->error += std::log(run.error / plain.error);
      ++count->runs;
      // The contact point stays where F wants it.
      CHECK(value(tangency, 0.0, run.y.data(), problem.size).cwiseAbs().maxCoeff() <=
            20.0 * tolerance);
    }
  }
}

}  // namespace

TEST_CASE("contact point of a wheel on a rail as algebraic unknown: any choice of rows, any form") {
  Count count;
  for (const bool rolling : {false, true}) {
    const Problem reduced = wheel_on_rail("explicit", rolling, 1.5);
    for (const std::string& form : contact_forms()) {
      const Problem problem = with_reference(wheel_on_rail(form, rolling, 1.5), reduced);
      for (const double tolerance : {1e-3, 1e-5, 1e-8}) check(problem, tolerance, &count);
    }
  }
  CHECK(std::exp(count.steps / count.runs) <= 1.0);
  CHECK(std::exp(count.error / count.runs) <= 2.0);
}

TEST_CASE("contact point of an ellipsoid on a plane as algebraic unknown") {
  Count count;
  for (const bool rolling : {false, true}) {
    const Problem reduced = ellipsoid_on_plane("explicit", rolling, 1.0);
    for (const std::string& form : contact_forms()) {
      const Problem problem = with_reference(ellipsoid_on_plane(form, rolling, 1.0), reduced);
      for (const double tolerance : {1e-4, 1e-7}) check(problem, tolerance, &count);
    }
  }
  CHECK(std::exp(count.steps / count.runs) <= 1.0);
  CHECK(std::exp(count.error / count.runs) <= 2.0);
}

TEST_CASE("contact point of a superquadric on a plane as algebraic unknown") {
  Count count;
  for (const bool rolling : {false, true}) {
    const Problem reduced = superquadric_on_plane("explicit", rolling, 0.8);
    for (const std::string& form : contact_forms()) {
      const Problem problem = with_reference(superquadric_on_plane(form, rolling, 0.8), reduced);
      for (const double tolerance : {1e-4, 1e-7}) check(problem, tolerance, &count);
    }
  }
  CHECK(std::exp(count.steps / count.runs) <= 1.0);
  CHECK(std::exp(count.error / count.runs) <= 1.0);
}

TEST_CASE("contact points in other units: a rail of micrometres and one of kilometres") {
  for (const double scale : {1e-6, 1e3}) {
    const double t_end = 1.5 * std::sqrt(scale);
    Count count;
    const Problem reduced = wheel_on_rail("explicit", true, t_end, 0.1, scale);
    for (const char* form : {"index 1", "index 2"})
      check(with_reference(wheel_on_rail(form, true, t_end, 0.1, scale), reduced), 1e-6, &count);
  }
}

TEST_CASE("contact points of a circle on a straight rail: nothing depends on them but the force") {
  const Problem problem = wheel_on_rail("index 1", true, 1.0, 0.0);
  const Run run = integrate(problem, 1e-6, problem.select({"gap", "rate"}), {}, false);
  REQUIRE(run.flag >= 0);
  CHECK(run.drift <= 1e-9);
}

TEST_CASE("rows written in algebraic copies of the positions alone") {
  // (x, y, vx, vy, lam) of the pendulum, and p = 1000 (x, y): length p^2/2 - 1000^2/2.
  const Problem plain = pendulum(1.0, 1.0, 20.0, "index 1");
  Problem problem = plain;
  problem.size = 7;
  problem.jacobian = nullptr;
  problem.y0.insert(problem.y0.end(), {1000.0 * plain.y0[0], 1000.0 * plain.y0[1]});
  problem.yp0.resize(7, 0.0);
  problem.id.resize(7, 0.0);
  problem.reference.resize(7, std::numeric_limits<double>::quiet_NaN());
  problem.residual = [plain](double t, const double* y, const double* yp, double* r) {
    plain.residual(t, y, yp, r);
    r[5] = y[5] - 1000.0 * y[0];
    r[6] = y[6] - 1000.0 * y[1];
  };
  const tp::Constraints copies = make_rows(
                                     "copies", {"length", "rate"},
                                     [](double, const double* y, double* g) {
                                       g[0] = (y[5] * y[5] + y[6] * y[6] - 1e6) / 2.0;
                                       g[1] = y[5] * y[2] + y[6] * y[3];
                                     },
                                     [](double, const double* y, double* C) {
                                       C[5] = y[5];
                                       C[6] = y[6];
                                       C[7 + 2] = y[5];
                                       C[7 + 3] = y[6];
                                       C[7 + 5] = y[2];
                                       C[7 + 6] = y[3];
                                     })
                                     .constraints;
  for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
    INFO("tolerance " << tolerance);
    const Run direct =
        integrate(plain, tolerance, plain.select({"position", "velocity"}), {}, false);
    for (const bool sparse : {false, true}) {
      const Run run =
          integrate(problem, tolerance, sparse ? as_sparse(copies, 7) : copies, {}, false);
      INFO(run.message);
      REQUIRE(run.flag >= 0);
      // The copies are outputs, so that IDA's error test sees positions twice, a thousandfold.
      CHECK(static_cast<double>(run.steps) <= 1.5 * static_cast<double>(direct.steps));
      CHECK(run.error <= 10.0 * direct.error);
      CHECK(std::abs(std::hypot(run.y[0], run.y[1]) - 1.0) <= 10.0 * tolerance);
    }
  }
}

TEST_CASE("rows that repeat an equation of F are solved for its algebraic variable as before") {
  const Problem problem = pendulum(1.0, 1.0, 50.0, "index 1");
  for (const double tolerance : {1e-4, 1e-7}) {
    const Run without = integrate(problem, tolerance,
                                  problem.select({"position", "velocity", "energy"}), {}, false);
    const Run with =
        integrate(problem, tolerance,
                  problem.select({"position", "velocity", "acceleration", "energy"}), {}, false);
    REQUIRE(with.flag >= 0);
    CHECK(static_cast<double>(with.steps) <= 1.1 * static_cast<double>(without.steps));
    CHECK(with.error <= 4.0 * without.error);
  }
}

TEST_CASE(
    "a start off the contact, contact point included: consistent from the gap alone, or both") {
  // Rows contain the contact point, which F determines: they are solved together with F.
  const auto residual = [](sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void* data) {
    static_cast<const Problem*>(data)->residual(t, N_VGetArrayPointer(y), N_VGetArrayPointer(yp),
                                                N_VGetArrayPointer(r));
    return 0;
  };
  const std::vector<std::vector<std::string>> choices = {{"gap"}, {"gap", "rate"}};
  for (const auto& groups : choices)
    for (const bool ellipsoid : {false, true})
      for (const bool rolling : {false, true})
        for (const std::string& form : contact_forms())
          for (const double off : {1e-6, 1e-3, 3e-2}) {
            Problem problem = ellipsoid ? ellipsoid_on_plane(form, rolling, 0.2)
                                        : wheel_on_rail(form, rolling, 0.2);
            INFO(problem.name << ", " << form << ", rolling " << rolling << ", off by " << off
                              << ", " << groups.size() << " groups");
            Host host(problem, 1e-6);
            tp::Options options;
            options.id = host.vector(problem.id);
            host.attach(problem.select(groups), options);
            for (int i = 0; i < problem.size; ++i) host.data()[i] += off * std::sin(1.0 + 3.0 * i);
            tp::Consistency how;
            how.residual = residual;
            how.user_data = &problem;
            const tp::ConsistencyReport report =
                host.projection().make_consistent(0.0, host.y, host.yp, how);
            INFO(report.message);
            REQUIRE(report.status == tp::Status::success);
            const auto size = [&](const char* group) {
              return value(problem.select({group}), 0.0, host.data(), problem.size)
                  .cwiseAbs()
                  .maxCoeff();
            };
            CHECK(size("gap") <= 1e-9);
            // Forms of index 1 leave a speed at which the bodies part as it is.
            if (groups.size() == 2 || form == "index 2" || form == "GGL")
              CHECK(size("rate") <= 1e-9);
            CHECK(size("tangency") <= 1e-9);
            CHECK(report.residual_after <= 1e-7);
            CHECK(report.move <= 5.0 * off / 1e-6);
            REQUIRE(host.finish() >= 0);
            CHECK(host.steps() <= 100);
          }
}

TEST_CASE("contact points: the equations that rows need move with them though no index is known") {
  const Problem wheel = wheel_on_rail("GGL", false, 0.5);
  const std::vector<std::string> groups = {"gap", "rate", "energy"};
  tp::Options unsought;  // nothing asks for the index
  unsought.suppress_algebraic = false;
  unsought.advanced.smooth_where_needed = false;
  for (const double tolerance : {1e-4, 1e-5, 1e-7}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(wheel, tolerance, wheel.select(groups), unsought, false);
    INFO(run.message);
    CHECK(run.flag >= 0);
    CHECK(run.statistics.largest_drift_after < 1e-8);
  }
  // So many unknowns that finding the index would take more evaluations than a given Jacobian.
  const Problem many = among_many(wheel, 210);
  for (const double tolerance : {1e-4, 1e-5}) {
    INFO("tolerance " << tolerance);
    const Run run = integrate(many, tolerance, rows_among_many(wheel, groups), {}, true);
    INFO(run.message);
    CHECK(run.flag >= 0);
    CHECK(run.statistics.largest_drift_after < 1e-8);
  }
}

TEST_CASE("contact points: energy without the rows that keep the body in contact is told so") {
  int told = 0;
  const double tolerance = std::pow(10.0, -4.5);
  for (const std::string form : {"index 1", "index 1 a"})
    for (const Problem& problem :
         {wheel_on_rail(form, false, 2.3, 0.13), ellipsoid_on_plane(form, false, 2.7)}) {
      INFO(form << ", " << problem.size << " unknowns");
      const Run alone = integrate(problem, tolerance, problem.select({"energy"}), {}, false);
      INFO(alone.message);
      CHECK((alone.message.empty() || contains(alone.message, "give also the rows")));
      told += alone.status == tp::Status::doubtful ? 1 : 0;
      const Run all = integrate(problem, tolerance, problem.recommended_constraints(), {}, false);
      CHECK(all.message.empty());
    }
  CHECK(told >= 1);
}

// Tether: forward sensitivities with IDAS. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <idas/idas.h>
#include <nvector/nvector_serial.h>
#include <problems/pendulum.hpp>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "sensitive.hpp"
#include "support/catch.hpp"

// Linked with IDAS instead of IDA: the same functions for another memory layout.

using namespace tether::test;
using namespace tether::problems;

namespace {

/// x' = p v, v' = -p x from (1, 0): (cos pt, -sin pt), energy kept.
struct Oscillator {
  double p = 1.3;
};

int residual(sunrealtype, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  const double p = static_cast<const Oscillator*>(data)->p;
  const double *u = N_VGetArrayPointer(y), *up = N_VGetArrayPointer(yp);
  N_VGetArrayPointer(r)[0] = up[0] - p * u[1];
  N_VGetArrayPointer(r)[1] = up[1] + p * u[0];
  return 0;
}

struct Result {
  int flag = 0;
  long steps = 0;
  std::vector<double> y, sensitivity;
  tp::Status status = tp::Status::unused;
  std::string message;
  tp::Statistics statistics;
};

enum class Attach { no, nothing, circle };

Result run(int method, Attach attach, bool attach_last = false) {
  Oscillator data;
  Problem problem = tether::test::circle(10.0);
  problem.y0 = {1.0, 0.0};
  problem.yp0 = {0.0, -data.p};
  Host host(problem, 1e-8);  // brings vectors, context and linear solver
  IDAFree(&host.ida);
  host.ida = IDACreate(host.context);
#if SUNDIALS_VERSION_MAJOR < 7
  IDASetErrHandlerFn(
      host.ida, [](int, const char*, const char*, char*, void*) {}, nullptr);
#endif
  REQUIRE(IDAInit(host.ida, residual, 0.0, host.y, host.yp) == 0);
  IDASetUserData(host.ida, &data);
  IDASStolerances(host.ida, 1e-8, 1e-8);
  host.use_linear_solver();
  N_Vector s = host.vector({0.0, 0.0}), sp = host.vector({0.0, -1.0});
  if (attach != Attach::no && !attach_last)
    host.attach(attach == Attach::circle ? on_circle() : tp::Constraints{});
  double parameters[1] = {data.p};
  REQUIRE(IDASensInit(host.ida, 1, method, nullptr, &s, &sp) == 0);
  REQUIRE(IDASetSensParams(host.ida, &data.p, parameters, nullptr) == 0);
  REQUIRE(IDASensEEtolerances(host.ida) == 0);
  if (attach != Attach::no && attach_last)
    host.attach(attach == Attach::circle ? on_circle() : tp::Constraints{});

  Result result;
  result.flag = host.finish();
  if (result.flag >= 0) {
    IDAGetSensDky1(host.ida, 10.0, 0, 0, s);
  }
  result.steps = host.steps();
  result.y = host.state();
  result.sensitivity = {N_VGetArrayPointer(s)[0], N_VGetArrayPointer(s)[1]};
  if (attach != Attach::no) {
    result.status = host.projection().status();
    result.message = host.projection().message();
    result.statistics = host.projection().statistics();
  }
  return result;
}

}  // namespace

TEST_CASE("staggered sensitivities: the state is projected, sensitivities are right") {
  for (const int method : {IDA_STAGGERED}) {
    const Result plain = run(method, Attach::no), projected = run(method, Attach::circle);
    REQUIRE(plain.flag >= 0);
    REQUIRE(projected.flag >= 0);
    CHECK(projected.status == tp::Status::success);
    CHECK(projected.statistics.projections > 50);
    CHECK(projected.statistics.failures() == 0);
    const double p = 1.3, t = 10.0;
    CHECK(std::abs(projected.y[0] - std::cos(p * t)) < 1e-6);
    CHECK(std::abs(std::hypot(projected.y[0], projected.y[1]) - 1.0) < 1e-9);
    CHECK(std::abs(projected.sensitivity[0] + t * std::sin(p * t)) < 1e-4);
    CHECK(std::abs(projected.sensitivity[1] + t * std::cos(p * t)) < 1e-4);
    CHECK(projected.steps < 2 * plain.steps);
  }
}

TEST_CASE("staggered sensitivities without constraints: the same bits") {
  const Result plain = run(IDA_STAGGERED, Attach::no),
               attached = run(IDA_STAGGERED, Attach::nothing);
  REQUIRE(attached.flag >= 0);
  CHECK(attached.statistics.solver_calls >= attached.steps);
  CHECK(attached.steps == plain.steps);
  CHECK(same_bits(attached.y, plain.y));
  CHECK(same_bits(attached.sensitivity, plain.sensitivity));
}

TEST_CASE("attached after IDASensInit: the same") {
  const Result before = run(IDA_STAGGERED, Attach::circle),
               after = run(IDA_STAGGERED, Attach::circle, true);
  REQUIRE(after.flag >= 0);
  CHECK(same_bits(before.y, after.y));
  CHECK(same_bits(before.sensitivity, after.sensitivity));
}

TEST_CASE("simultaneous sensitivities are refused with the way out") {
  for (const bool last : {false, true}) {
    const Result result = run(IDA_SIMULTANEOUS, Attach::circle, last);
    CHECK(result.flag < 0);
    CHECK(result.steps == 0);
    CHECK(result.status == tp::Status::simultaneous_sensitivities);
    CHECK(contains(result.message, "IDA_STAGGERED"));
    CHECK(result.statistics.projections == 0);
  }
  CHECK(run(IDA_SIMULTANEOUS, Attach::no).flag >= 0);  // IDAS itself can
}

namespace {

/// The pendulum of problems/pendulum.hpp with p = (L, g).
Parametric pendulum_of(int index, double L = 1.3, double g = 9.8) {
  Parametric made;
  made.size = 5;
  made.rows = index == 0 ? 4 : 3;
  made.p = {L, g};
  made.y0 = {L, 0.0, 0.0, 0.0, 0.0};
  made.yp0 = {0.0, 0.0, 0.0, -g, 0.0};
  made.id = {1.0, 1.0, 1.0, 1.0, index == 0 ? 1.0 : 0.0};
  made.s0 = {{1.0, 0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0, 0.0}};
  made.sp0 = {{0.0, 0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, -1.0, 0.0}};
  made.F = [index](const Complex* y, const Complex* yp, const Complex* p, Complex* r) {
    r[0] = yp[0] - y[2];
    r[1] = yp[1] - y[3];
    r[2] = yp[2] + y[0] * y[4];
    r[3] = yp[3] + y[1] * y[4] + p[1];
    if (index == 0) r[4] = p[0] * p[0] * yp[4] + 3.0 * p[1] * y[3];
    if (index == 1) r[4] = y[2] * y[2] + y[3] * y[3] - p[1] * y[1] - p[0] * p[0] * y[4];
    if (index == 2) r[4] = y[0] * y[2] + y[1] * y[3];
  };
  made.g = [index](const Complex* y, const Complex* p, Complex* g_of) {
    g_of[0] = 0.5 * (y[0] * y[0] + y[1] * y[1] - p[0] * p[0]);
    g_of[1] = y[0] * y[2] + y[1] * y[3];
    g_of[2] = 0.5 * (y[2] * y[2] + y[3] * y[3]) + p[1] * y[1];
    if (index == 0) g_of[3] = y[2] * y[2] + y[3] * y[3] - p[1] * y[1] - p[0] * p[0] * y[4];
  };
  return made;
}

// y(t) = (L X(r), sqrt(g L) X'(r), g/L Z(r)) with r = t sqrt(g/L).
std::vector<std::vector<double>> pendulum_derivatives(double L, double g, double t) {
  double y[5];
  pendulum_exact(L, g, t, y);
  const double yp[5] = {y[2], y[3], -y[0] * y[4], -y[1] * y[4] - g, -3.0 * g * y[3] / (L * L)};
  const double by_L[5] = {1.0, 1.0, 0.5, 0.5, -1.0}, by_g[5] = {0.0, 0.0, 0.5, 0.5, 1.0};
  std::vector<std::vector<double>> s(2, std::vector<double>(5));
  for (std::size_t j = 0; j < 5; ++j) {
    s[0][j] = by_L[j] * y[j] / L - t / (2.0 * L) * yp[j];
    s[1][j] = by_g[j] * y[j] / g + t / (2.0 * g) * yp[j];
  }
  return s;
}

// q'' = -mu q/|q|^3 from (1 - e, 0) with the speed of eccentricity e for mu = 1, p = (mu, v_y(0)).
Parametric kepler_of(double e) {
  Parametric made;
  const double speed = std::sqrt((1.0 + e) / (1.0 - e));
  made.size = 4;
  made.rows = 2;
  made.p = {1.0, speed};
  made.y0 = {1.0 - e, 0.0, 0.0, speed};
  made.yp0 = {0.0, speed, -1.0 / ((1.0 - e) * (1.0 - e)), 0.0};
  made.id = {1.0, 1.0, 1.0, 1.0};
  made.s0 = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}};
  made.sp0 = {{0.0, 0.0, made.yp0[2], 0.0}, {0.0, 1.0, 0.0, 0.0}};
  made.F = [](const Complex* y, const Complex* yp, const Complex* p, Complex* r) {
    const Complex d = std::sqrt(y[0] * y[0] + y[1] * y[1]), w = p[0] / (d * d * d);
    r[0] = yp[0] - y[2];
    r[1] = yp[1] - y[3];
    r[2] = yp[2] + w * y[0];
    r[3] = yp[3] + w * y[1];
  };
  made.g = [e](const Complex* y, const Complex* p, Complex* g) {
    const Complex d = std::sqrt(y[0] * y[0] + y[1] * y[1]);
    g[0] = 0.5 * (y[2] * y[2] + y[3] * y[3]) - p[0] / d - (0.5 * p[1] * p[1] - p[0] / (1.0 - e));
    g[1] = y[0] * y[3] - y[1] * y[2] - (1.0 - e) * p[1];
  };
  return made;
}

// By Kepler's equation for the orbit of (mu, v), complex for the complex step.
std::vector<std::vector<double>> kepler_derivatives(double e, double t) {
  const std::vector<double> p0 = kepler_of(e).p;
  std::vector<std::vector<double>> s;
  for (std::size_t k = 0; k < 2; ++k) {
    Complex p[2] = {p0[0], p0[1]};
    p[k] += Complex(0.0, kStep);
    const Complex start = 1.0 - e, a = 1.0 / (2.0 / start - p[1] * p[1] / p[0]);
    const Complex ecc = 1.0 - start / a, n = std::sqrt(p[0] / (a * a * a)), M = n * t;
    Complex E = M;
    for (int i = 0; i < 60; ++i) E -= (E - ecc * std::sin(E) - M) / (1.0 - ecc * std::cos(E));
    const Complex rate = n / (1.0 - ecc * std::cos(E)), b = a * std::sqrt(1.0 - ecc * ecc);
    const Complex y[4] = {a * (std::cos(E) - ecc), b * std::sin(E), -a * std::sin(E) * rate,
                          b * std::cos(E) * rate};
    s.emplace_back();
    for (const Complex& entry : y) s.back().push_back(entry.imag() / kStep);
  }
  return s;
}

// With sensitivities of the given kind, or with the plugin but not those, or plain.
enum class Part { plain, state, both };

struct Outcome {
  int flag = 0;
  long steps = 0;
  double error = 0.0, drift = 0.0;
};

Outcome outcome(const Parametric& model, Part what, double tol, double t, bool control,
                const std::vector<std::vector<double>>& exact, int components,
                Sensitive::Rows kind = Sensitive::Rows::dense) {
  Sensitive run(model, tol, t);
  if (what != Part::plain) run.attach(kind);
  run.begin(control);
  if (what == Part::both) run.project(kind);
  Outcome out;
  out.flag = run.run();
  out.steps = run.host().steps();
  out.error = out.flag < 0 ? 1e300 : run.error(exact, components);
  out.drift = run.drift;
  return out;
}

}  // namespace

TEST_CASE("projected sensitivities: the pendulum's period has dT/dL = T/(2 L), dT/dg = -T/(2 g)") {
  const double L = 1.3, g = 9.8, T = pendulum_period(L, g);
  for (const int index : {0, 1, 2}) {
    Sensitive run(pendulum_of(index), 1e-9, T);
    run.attach();
    run.begin(true);
    run.project();
    REQUIRE(run.run() >= 0);
    // It turns where x vy - y vx = 0.
    const double* y = run.host().data();
    const double turns = y[0] * (-y[1] * y[4] - g) + y[1] * y[0] * y[4];
    for (std::size_t k = 0; k < 2; ++k) {
      const double* s = N_VGetArrayPointer(run.s[k]);
      const double moves = s[0] * y[3] + y[0] * s[3] - s[1] * y[2] - y[1] * s[2];
      const double expected = k == 0 ? T / (2.0 * L) : -T / (2.0 * g);
      CHECK(std::abs(-moves / turns - expected) < 1e-6 * std::abs(expected));
    }
    CHECK(run.drift < 1e-11);
  }
}

TEST_CASE("projected sensitivities: more accurate than plain IDAS' in every form, in its steps") {
  const double L = 1.3, g = 9.8, t = 10.0;
  const auto exact = pendulum_derivatives(L, g, t);
  for (const bool control : {false, true})
    for (const int index : {0, 1, 2}) {
      double gained = 0.0;
      for (const double tol : {1e-4, 1e-6, 1e-8}) {
        const auto model = pendulum_of(index, L, g);
        const Outcome plain = outcome(model, Part::plain, tol, t, control, exact, 4);
        const Outcome both = outcome(model, Part::both, tol, t, control, exact, 4);
        REQUIRE(both.flag >= 0);
        CHECK(both.drift < 1e-11);
        CHECK(both.error < plain.error);
        if (plain.flag >= 0 && (control || index > 0)) CHECK(both.steps < plain.steps);
        CHECK(both.error < 2e3 * std::pow(tol, 0.9));
        gained += std::log10(std::min(plain.error, 1e6) / both.error);
      }
      CHECK(gained / 3.0 > (index == 2 ? 0.3 : 1.5));  // decades
    }
}

TEST_CASE("projected sensitivities: Kepler's motion by its mass and its speed, any kind of rows") {
  const double e = 0.6, t = 20.0;
  const auto exact = kepler_derivatives(e, t);
  const Outcome plain = outcome(kepler_of(e), Part::plain, 1e-7, t, true, exact, 4);
  for (const auto kind : {Sensitive::Rows::dense, Sensitive::Rows::sparse,
                          Sensitive::Rows::differences, Sensitive::Rows::gradients}) {
    const Outcome both = outcome(kepler_of(e), Part::both, 1e-7, t, true, exact, 4, kind);
    REQUIRE(both.flag >= 0);
    CHECK(both.drift < (kind == Sensitive::Rows::differences ? 1e-4 : 1e-9));
    CHECK(both.error < 0.2 * plain.error);
    CHECK(both.steps < 1.1 * plain.steps);
  }
  const Outcome tight = outcome(kepler_of(e), Part::both, 1e-10, t, true, exact, 4);
  CHECK(tight.error < 1e-6);
}

TEST_CASE("projected sensitivities: dg/dp by differences of g is as good as by a function") {
  const auto exact = kepler_derivatives(0.6, 5.0);
  for (const bool list : {false, true}) {
    Sensitive run(kepler_of(0.6), 1e-8, 5.0);
    run.attach();
    run.begin(true);
    tp::Sensitivities given = run.by_differences();
    if (list) {
      given.list = {0, 1};
      given.scales = {1.0, -2.0};
    }
    tp::project_sensitivities(run.host().projection(), given);
    const std::vector<double> before = run.p;
    REQUIRE(run.run() >= 0);
    CHECK(same_bits(before, run.p));
    CHECK(run.drift < 1e-10);
    CHECK(run.error(exact, 4) < 2e-6);
  }
}

TEST_CASE("projected sensitivities: errors of dg/dp end the run or cut the step, by name") {
  struct Failure {
    std::function<int(int calls, double* g)> act;
    tp::Status status;
    const char* text;
  };
  const std::vector<Failure> failures = {
      {[](int n, double*) { return n > 20 ? -1 : 0; }, tp::Status::callback_fatal, "returned -1"},
      {[](int n, double*) -> int { return n > 20 ? throw std::runtime_error("no more") : 0; },
       tp::Status::callback_fatal, "no more"},
      {[](int n, double*) { return n > 20 ? 1 : 0; }, tp::Status::callback_recoverable,
       "returned 1"},
      {[](int n, double* g) { return n > 20 ? (g[0] = std::nan(""), 0) : 0; },
       tp::Status::not_finite, "not finite"}};
  for (const Failure& failure : failures) {
    Sensitive run(pendulum_of(1), 1e-6, 5.0);
    run.attach();
    run.begin(true);
    tp::Sensitivities given;
    given.count = 2;
    int calls = 0;
    given.derivative = [&](double, tp::ConstVector y, int k, tp::Vector g) {
      if (k == 0) g[0] = -1.3;
      if (k == 1) g[2] = y[1];
      return failure.act(++calls, g.data());
    };
    tp::project_sensitivities(run.host().projection(), given);
    CHECK(run.run() < 0);
    CHECK(run.host().projection().status() == failure.status);
    CHECK(contains(run.host().projection().message(), "dg/dp of parameter"));
    CHECK(contains(run.host().projection().message(), failure.text));
  }
  // Now and then: smaller steps get through.
  Sensitive run(pendulum_of(1), 1e-6, 2.0);
  run.attach();
  run.begin(true);
  tp::Sensitivities given;
  given.count = 2;
  int calls = 0;
  given.derivative = [&](double, tp::ConstVector y, int k, tp::Vector g) {
    if (k == 0) g[0] = -1.3;
    if (k == 1) g[2] = y[1];
    return ++calls % 50 == 0 ? 1 : 0;
  };
  tp::project_sensitivities(run.host().projection(), given);
  CHECK(run.run() >= 0);
  CHECK(run.error(pendulum_derivatives(1.3, 9.8, 2.0), 4) < 1e-3);
  CHECK(run.drift < 1e-11);
}

TEST_CASE("projected sensitivities: a false dg/dp is refused before it is integrated") {
  Sensitive run(pendulum_of(1), 1e-6, 5.0);
  run.attach();
  run.begin(true);
  tp::Sensitivities given;
  given.count = 2;  // and g depends on neither
  tp::project_sensitivities(run.host().projection(), given);
  CHECK(run.run() < 0);
  CHECK(run.host().projection().status() == tp::Status::move_too_long);
  CHECK(contains(run.host().projection().message(), "make_sensitivities_consistent"));
}

TEST_CASE("projected sensitivities: IDAReInit and IDASensReInit start anew, toggled off is plain") {
  const auto exact = pendulum_derivatives(1.3, 9.8, 3.0);
  Sensitive run(pendulum_of(1), 1e-7, 3.0);
  run.attach();
  run.begin(true);
  run.project();
  REQUIRE(run.run() >= 0);
  const auto restart = [&] {
    REQUIRE(run.host().restart() == 0);
    for (std::size_t k = 0; k < 2; ++k)
      for (std::size_t j = 0; j < 5; ++j) {
        N_VGetArrayPointer(run.s[k])[j] = run.model.s0[k][j];
        N_VGetArrayPointer(run.sp[k])[j] = run.model.sp0[k][j];
      }
  };
  restart();
  REQUIRE(IDASensReInit(run.host().ida, IDA_STAGGERED, run.s.data(), run.sp.data()) == 0);
  REQUIRE(run.run() >= 0);
  CHECK(run.error(exact, 4) < 1e-4);
  CHECK(run.drift < 1e-11);

  restart();
  REQUIRE(IDASensToggleOff(run.host().ida) == 0);
  const long projected = run.host().projection().statistics().sensitivity_projections;
  REQUIRE(run.host().finish() >= 0);
  CHECK(run.host().projection().statistics().sensitivity_projections == projected);
  Sensitive alone(pendulum_of(1), 1e-7, 3.0);
  alone.attach();
  REQUIRE(alone.host().finish() >= 0);
  CHECK(same_bits(alone.host().state(), run.host().state()));
}

TEST_CASE("projected sensitivities: without constraints the bits of plain IDAS") {
  Sensitive plain(pendulum_of(0), 1e-6, 3.0), with(pendulum_of(0), 1e-6, 3.0);
  plain.begin(true);
  REQUIRE(plain.run() >= 0);
  with.host().attach({});
  with.begin(true);
  with.project();
  REQUIRE(with.run() >= 0);
  CHECK(with.host().steps() == plain.host().steps());
  CHECK(same_bits(with.host().state(), plain.host().state()));
  for (std::size_t k = 0; k < 2; ++k)
    CHECK(same_bits({N_VGetArrayPointer(with.s[k]), N_VGetArrayPointer(with.s[k]) + 5},
                    {N_VGetArrayPointer(plain.s[k]), N_VGetArrayPointer(plain.s[k]) + 5}));
}

TEST_CASE("projected sensitivities: initial ones onto the constraints, with their derivative") {
  for (const auto kind : {Sensitive::Rows::dense, Sensitive::Rows::sparse,
                          Sensitive::Rows::differences, Sensitive::Rows::gradients}) {
    Sensitive run(pendulum_of(0), 1e-8, 1.0);
    // A later point of the motion, with its sensitivities and their derivatives disturbed.
    const double t = 0.4, h = 1e-3;
    double y[5], to[5];
    pendulum_exact(1.3, 9.8, t, y);
    const auto exact = pendulum_derivatives(1.3, 9.8, t);
    const auto plus = pendulum_derivatives(1.3, 9.8, t + h);
    const auto minus = pendulum_derivatives(1.3, 9.8, t - h);
    const double yp[5] = {y[2], y[3], -y[0] * y[4], -y[1] * y[4] - 9.8, -3.0 * 9.8 * y[3] / 1.69};
    std::copy(y, y + 5, run.host().data());
    std::copy(yp, yp + 5, N_VGetArrayPointer(run.host().yp));
    for (std::size_t k = 0; k < 2; ++k)
      for (std::size_t j = 0; j < 5; ++j) {
        to[j] = 1e-3 * std::sin(static_cast<double>(j + 3 * k));
        N_VGetArrayPointer(run.s[k])[j] = exact[k][j] + to[j];
        N_VGetArrayPointer(run.sp[k])[j] = (plus[k][j] - minus[k][j]) / (2.0 * h) + to[j];
      }
    run.attach(kind);
    run.begin(true);
    run.project(kind);
    const tp::ConsistencyReport report = run.host().projection().make_sensitivities_consistent(
        t, run.host().y, run.host().yp, run.s.data(), run.sp.data());
    REQUIRE(report);
    CHECK(report.drift_before > 1e-4);
    CHECK(report.drift_after < 1e-8);
    // The sum of rows along the motion does not change to first order.
    for (std::size_t k = 0; k < 2; ++k)
      for (const double side : {1.0, -1.0}) {
        const double e = side * 1e-4;
        std::vector<Complex> at(5), p = {1.3, 9.8}, g(4);
        for (std::size_t j = 0; j < 5; ++j)
          at[j] = {y[j] + e * yp[j], kStep * (N_VGetArrayPointer(run.s[k])[j] +
                                              e * N_VGetArrayPointer(run.sp[k])[j])};
        p[k] += Complex(0.0, kStep);
        run.model.g(at.data(), p.data(), g.data());
        for (const Complex& row : g) CHECK(std::abs(row.imag() / kStep) < 1e-5);
      }
  }
}

TEST_CASE("projected sensitivities: what cannot be is refused by name") {
  const auto thrown_by = [](const std::function<void(Sensitive&)>& act) {
    Sensitive run(pendulum_of(1), 1e-6, 1.0);
    return thrown([&] { act(run); });
  };
  const auto with = [&](int method, const std::function<void(tp::Sensitivities&)>& change,
                        Sensitive::Rows kind = Sensitive::Rows::dense) {
    return thrown_by([&](Sensitive& run) {
      run.attach(kind);
      if (method != 0) run.begin(true);
      if (method == IDA_SIMULTANEOUS)
        IDASensReInit(run.host().ida, method, run.s.data(), run.sp.data());
      tp::Sensitivities given = run.by_differences();
      change(given);
      tp::project_sensitivities(run.host().projection(), given);
    });
  };
  const auto nothing = [](tp::Sensitivities&) {};
  CHECK(contains(with(0, nothing), "IDASensInit with IDA_STAGGERED"));
  CHECK(contains(with(IDA_SIMULTANEOUS, nothing), "IDA_SIMULTANEOUS"));
  CHECK(contains(with(IDA_STAGGERED, [](auto& s) { s.count = 0; }), "count = 0"));
  CHECK(contains(with(IDA_STAGGERED, [](auto& s) { s.scales = {1.0}; }), "scales has 1 entries"));
  CHECK(contains(with(IDA_STAGGERED, [](auto& s) { s.scales = {1.0, 0.0}; }), "not 0"));
  CHECK(contains(with(IDA_STAGGERED, [](auto& s) { s.list = {0, -1}; }), "-1 < 0"));
  CHECK(contains(with(IDA_STAGGERED,
                      [](auto& s) {
                        s.parameters = nullptr, s.list = {0, 1};
                      }),
                 "parameters, which is null"));
  CHECK(
      contains(with(
                   IDA_STAGGERED,
                   [](auto& s) { s.derivative = [](double, tp::ConstVector, int, tp::Vector) {}; },
                   Sensitive::Rows::gradients),
               "vector_derivative"));
  CHECK(contains(thrown_by([](Sensitive& run) {
                   tp::Constraints own;
                   own.jacobian = tp::UserProjection{[](sunrealtype, N_Vector, N_Vector,
                                                        sunrealtype, N_Vector, void*) { return 0; },
                                                     nullptr};
                   run.host().attach(own);
                   run.begin(true);
                   tp::project_sensitivities(run.host().projection(), run.by_differences());
                 }),
                 "UserProjection"));
  // Only IDAS knows how many there are.
  Sensitive run(pendulum_of(1), 1e-6, 1.0);
  run.attach();
  run.begin(true);
  tp::Sensitivities given = run.by_differences();
  given.count = 3;
  tp::project_sensitivities(run.host().projection(), given);
  CHECK(run.run() < 0);
  CHECK(contains(run.host().projection().message(), "count = 3, but IDASensInit was given 2"));
}

namespace {

/// n point masses on massless rods, released straight and level, index 1; p = (length of each rod,
/// gravity, mass of the last one; the others have mass 1). `unit`: of lengths.
Parametric chain_of(int n, double unit = 1.0) {
  Parametric made;
  const auto N = static_cast<std::size_t>(n);
  made.size = 5 * n;
  made.rows = 2 * n + 1;
  made.p = {unit, 9.8 * unit, 1.7};
  made.y0.assign(5 * N, 0.0);
  made.yp0 = made.id = made.y0;
  made.s0.assign(3, made.y0);
  made.sp0 = made.s0;
  for (std::size_t i = 0; i < N; ++i) {
    made.y0[2 * i] = static_cast<double>(i + 1) * unit;
    made.s0[0][2 * i] = static_cast<double>(i + 1);
    made.yp0[2 * N + 2 * i + 1] = -made.p[1];
    made.sp0[1][2 * N + 2 * i + 1] = -1.0;
  }
  std::fill(made.id.begin(), made.id.end() - n, 1.0);
  const auto accelerations = [n](const Complex* y, const Complex* p, Complex* a) {
    const Complex* l = y + 4 * n;
    for (int i = 0; i < n; ++i)
      for (int c = 0; c < 2; ++c) {
        const Complex rod = y[2 * i + c] - (i > 0 ? y[2 * i - 2 + c] : 0.0);
        Complex force = -l[i] * rod;
        if (i + 1 < n) force += l[i + 1] * (y[2 * i + 2 + c] - y[2 * i + c]);
        a[2 * i + c] = force / (i + 1 < n ? 1.0 : p[2]) - (c == 1 ? p[1] : 0.0);
      }
  };
  made.F = [n, accelerations](const Complex* y, const Complex* yp, const Complex* p, Complex* r) {
    std::vector<Complex> a(static_cast<std::size_t>(2 * n));
    accelerations(y, p, a.data());
    const Complex* v = y + 2 * n;
    for (int j = 0; j < 2 * n; ++j) {
      r[j] = yp[j] - v[j];
      r[2 * n + j] = yp[2 * n + j] - a[static_cast<std::size_t>(j)];
    }
    for (int i = 0; i < n; ++i) {
      r[4 * n + i] = 0.0;
      for (int c = 0; c < 2; ++c) {
        const int j = 2 * i + c;
        const auto before = [&](const Complex* x) { return i > 0 ? x[j - 2] : Complex(0.0); };
        r[4 * n + i] += (v[j] - before(v)) * (v[j] - before(v)) +
                        (y[j] - before(y)) * (a[static_cast<std::size_t>(j)] - before(a.data()));
      }
    }
  };
  made.g = [n](const Complex* y, const Complex* p, Complex* g) {
    const Complex* v = y + 2 * n;
    g[2 * n] = 0.0;
    for (int i = 0; i < n; ++i) {
      g[i] = -0.5 * p[0] * p[0];
      g[n + i] = 0.0;
      for (int c = 0; c < 2; ++c) {
        const int j = 2 * i + c;
        const Complex rod = y[j] - (i > 0 ? y[j - 2] : 0.0), rate = v[j] - (i > 0 ? v[j - 2] : 0.0);
        g[i] += 0.5 * rod * rod;
        g[n + i] += rod * rate;
        g[2 * n] += 0.5 * (i + 1 < n ? 1.0 : p[2]) * v[j] * v[j];
      }
      g[2 * n] += (i + 1 < n ? 1.0 : p[2]) * p[1] * y[2 * i + 1];
    }
  };
  return made;
}

/// dy/dp by central differences of tight projected runs, extrapolated once.
template <class Make>
std::vector<std::vector<double>> differences(Make make, double t, double tol) {
  const auto end = [&](std::size_t k, double factor) {
    Parametric model = make();
    const double change = model.p[k] * factor;
    for (std::size_t j = 0; j < model.y0.size(); ++j) {
      model.y0[j] += change * model.s0[k][j];
      model.yp0[j] += change * model.sp0[k][j];
    }
    model.p[k] += change;
    Sensitive run(model, tol, t);
    run.attach();
    if (run.host().finish() < 0) throw std::runtime_error("reference");
    return run.host().state();
  };
  const Parametric model = make();
  std::vector<std::vector<double>> s(model.p.size());
  for (std::size_t k = 0; k < s.size(); ++k) {
    const double d = 2e-3;
    const std::vector<double> a = end(k, d), b = end(k, -d), c = end(k, 2 * d), e = end(k, -2 * d);
    for (std::size_t j = 0; j < a.size(); ++j)
      s[k].push_back((8.0 * (a[j] - b[j]) - (c[j] - e[j])) / (12.0 * d * model.p[k]));
  }
  return s;
}

}  // namespace

TEST_CASE("projected sensitivities: a double pendulum against differences of tight runs") {
  for (const double unit : {1.0, 1e-3}) {
    const auto make = [unit] { return chain_of(2, unit); };
    const auto exact = differences(make, 1.2, 1e-12 * std::min(1.0, unit));
    const Outcome run =
        outcome(make(), Part::both, 1e-10 * std::min(1.0, unit), 1.2, true, exact, 8);
    CHECK(run.error < 1e-6);
    CHECK(run.drift < 1e-10 * unit);
  }
}

TEST_CASE("projected sensitivities: a chain of 20 rods, dense and sparse rows") {
  const auto make = [] { return chain_of(20); };
  const auto exact = differences(make, 0.5, 1e-10);
  const Outcome plain = outcome(make(), Part::plain, 1e-6, 0.5, true, exact, 80);
  for (const auto kind : {Sensitive::Rows::dense, Sensitive::Rows::sparse}) {
    const Outcome both = outcome(make(), Part::both, 1e-6, 0.5, true, exact, 80, kind);
    REQUIRE(both.flag >= 0);
    CHECK(both.drift < 1e-11);
    CHECK(plain.drift > 1e-5);
    CHECK(both.error < 4e-6);
    CHECK(both.steps < 0.6 * plain.steps);
  }
}

TEST_CASE("projected sensitivities: rows on algebraic variables that F determines") {
  // x' = -w y, y' = w x from (R, 0), u = x^2, and the row u + y^2 = R^2.
  const double w = 1.4, R = 0.8, t = 12.0;
  Parametric model;
  model.size = 3;
  model.rows = 1;
  model.p = {w, R};
  model.y0 = {R, 0.0, R * R};
  model.yp0 = {0.0, w * R, 0.0};
  model.id = {1.0, 1.0, 0.0};
  model.s0 = {{0.0, 0.0, 0.0}, {1.0, 0.0, 2.0 * R}};
  model.sp0 = {{0.0, R, 0.0}, {0.0, w, 0.0}};
  model.F = [](const Complex* y, const Complex* yp, const Complex* p, Complex* r) {
    r[0] = yp[0] + p[0] * y[1];
    r[1] = yp[1] - p[0] * y[0];
    r[2] = y[2] - y[0] * y[0];
  };
  model.g = [](const Complex* y, const Complex* p, Complex* g) {
    g[0] = y[2] + y[1] * y[1] - p[1] * p[1];
  };
  const double c = std::cos(w * t), s = std::sin(w * t);
  const std::vector<std::vector<double>> exact = {{-R * t * s, R * t * c, -2.0 * R * R * t * s * c},
                                                  {c, s, 2.0 * R * c * c}};
  const Outcome plain = outcome(model, Part::plain, 1e-7, t, true, exact, 3);
  for (const bool by_differences : {false, true}) {
    Sensitive run(model, 1e-7, t);
    run.attach();
    run.begin(true);
    if (by_differences)
      tp::project_sensitivities(run.host().projection(), run.by_differences());
    else
      run.project();
    REQUIRE(run.run() >= 0);
    CHECK(run.host().projection().statistics().sensitivity_projections > 100);
    CHECK(run.drift < 1e-12);
    CHECK(run.error(exact, 3) < 1e-6);
    // u is an output: IDA's error test sees it, as without the rows.
    CHECK(run.host().steps() < 1.05 * plain.steps);
  }
}

TEST_CASE("projected sensitivities: charges of small capacitors, by capacitance and conductance") {
  // cos 3 t and -sin 3 t drive two capacitors that are not linear: unknowns are these, the voltages
  // and the charges. Charges have next to no part in the rows' error weights.
  const auto charge = [](int i, const Complex* y, const Complex* p) {
    const Complex v = y[2 + i];
    return (i == 0 ? p[0] : 0.1 * p[0]) * (v + 0.3 * v * v * v) - y[4 + i];
  };
  for (const double c : {1e-2, 1e-4}) {
    Parametric m;
    m.size = 6;
    m.rows = 2;
    m.p = {c, c};
    m.y0 = {0.0, 1.0, 0.0, 0.0, 0.0, 0.0};
    m.yp0 = {3.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    m.id = {1.0, 1.0, 0.0, 0.0, 1.0, 1.0};
    m.s0.assign(2, std::vector<double>(6, 0.0));
    m.sp0 = m.s0;
    m.F = [=](const Complex* y, const Complex* yp, const Complex* p, Complex* r) {
      const Complex between = p[1] * (y[2] - y[3]);
      r[0] = yp[0] - 3.0 * y[1];
      r[1] = yp[1] + 3.0 * y[0];
      r[2] = yp[4] - p[1] * (2.0 * y[0] - y[2]) + between;
      r[3] = yp[5] - p[1] * (2.0 * y[0] - y[3]) - between;
      for (int i = 0; i < 2; ++i) r[4 + i] = charge(i, y, p);
    };
    m.g = [=](const Complex* y, const Complex* p, Complex* g) {
      for (int i = 0; i < 2; ++i) g[i] = charge(i, y, p);
    };
    Sensitive tight(m, 1e-10, 10.0);
    tight.begin(true);
    REQUIRE(tight.run() >= 0);
    std::vector<std::vector<double>> exact;
    for (N_Vector s : tight.s)
      exact.emplace_back(N_VGetArrayPointer(s), N_VGetArrayPointer(s) + m.size);
    for (const bool error_control : {false, true})
      for (const double tolerance : {1e-4, 1e-6}) {
        INFO("c = " << c << ", tolerance " << tolerance << ", error control " << error_control);
        Sensitive projected(m, tolerance, 10.0);
        projected.begin(error_control);
        projected.attach();
        projected.project();
        REQUIRE(projected.run() >= 0);
        CHECK(projected.error(exact, 4) <= 20.0 * tolerance);
      }
  }
}

TEST_CASE("projected sensitivities: IDAS' own residuals by differences") {
  const auto exact = pendulum_derivatives(1.3, 9.8, 5.0);
  double errors[2], drifts[2];
  for (const bool projected : {false, true}) {
    Sensitive run(pendulum_of(1), 1e-6, 5.0);
    // Its residual reads p where IDAS changes it.
    if (projected) run.attach();
    run.begin(true, nullptr);
    if (projected) run.project();
    REQUIRE(run.run() >= 0);
    errors[projected] = run.error(exact, 4);
    drifts[projected] = run.drift;
  }
  CHECK(errors[1] < 0.1 * errors[0]);
  CHECK(drifts[1] < 1e-11);
}

TEST_CASE("gradients of functions on the constraints: what points across them is left out") {
  double y[5];
  pendulum_exact(1.3, 9.8, 0.4, y);
  for (const auto kind : {Sensitive::Rows::dense, Sensitive::Rows::sparse,
                          Sensitive::Rows::differences, Sensitive::Rows::gradients}) {
    Sensitive run(pendulum_of(0), 1e-8, 1.0);
    tp::Projection& projection = run.attach(kind);
    std::copy(y, y + 5, run.host().data());
    // Here C itself counts, and one by differences is what it is.
    const double accuracy = kind == Sensitive::Rows::differences ? 1e-3 : 1e-8;
    // x, and x with multiples of the rows: the same function on the set.
    std::vector<std::vector<double>> found;
    for (const double factor : {0.0, 3.0}) {
      N_Vector v = run.host().vector({1.0, 0.0, 0.0, 0.0, 0.0});
      double* entries = N_VGetArrayPointer(v);
      const Eigen::MatrixXd C = jacobian(run.constraints(Sensitive::Rows::dense), 0.0, y, 5);
      for (int j = 0; j < 5; ++j) entries[j] += factor * (C(0, j) - 2.0 * C(2, j) + C(3, j));
      REQUIRE(projection.project_gradient(0.0, run.host().y, v));
      for (int i = 0; i < 4; ++i) {
        double along = 0.0;
        for (int j = 0; j < 5; ++j) along += C(i, j) * entries[j];
        CHECK(std::abs(along) < accuracy);
      }
      found.emplace_back(entries, entries + 5);
    }
    double size = 0.0;
    for (std::size_t j = 0; j < 5; ++j) {
      CHECK(std::abs(found[0][j] - found[1][j]) < accuracy);
      size = std::max(size, std::abs(found[0][j]));
    }
    CHECK(size > 0.01);
  }
}

// Tether: what wrong rows, wrong options and starts off the constraints make the plugin say.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdio>
#include <problems/pendulum.hpp>
#include <unistd.h>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;
using namespace tether::problems;

namespace {

/// The run's stderr, read back when it is over.
class Stderr {
 public:
  Stderr() : file_(std::tmpfile()) {
    std::fflush(stderr);
    kept_ = dup(2);
    dup2(fileno(file_), 2);
  }
  ~Stderr() {
    if (kept_ >= 0) text();
    std::fclose(file_);
  }
  std::string text() {
    std::fflush(stderr);
    dup2(kept_, 2);
    close(kept_);
    kept_ = -1;
    std::rewind(file_);
    std::string all;
    for (int c = std::fgetc(file_); c != EOF; c = std::fgetc(file_)) all += static_cast<char>(c);
    return all;
  }

 private:
  std::FILE* file_;
  int kept_ = -1;
};

struct Ended {
  int flag;
  tp::Status status;
  std::string message, printed;
};

Ended run(const Problem& problem, double tolerance, const tp::Constraints& rows, long most_steps,
          const tp::Options& options = {}, double shift = 0.0) {
  Host host(problem, tolerance);
  host.data()[0] += shift;
  REQUIRE(IDAReInit(host.ida, problem.t0, host.y, host.yp) == 0);
  Stderr captured;
  Ended end{};
  {
    tp::Projection projection(host.ida, rows, options);
    while (host.t < problem.t_end && host.steps() < most_steps && end.flag >= 0)
      end.flag = host.step();
    end.status = projection.status();
    end.message = projection.message();
    IDAFree(&host.ida);
  }
  end.printed = captured.text();
  return end;
}

long count(const std::string& text, const std::string& part) {
  long n = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

Problem swing(double t_end) { return pendulum(1.7, 3.3, t_end, "index 1"); }

}  // namespace

TEST_CASE("an entry of C that is wrong by a factor 2 is named") {
  const Problem problem = swing(100.0);
  const tp::Constraints wrong = row(
      "length", [](double, const double* y) { return y[0] * y[0] + y[1] * y[1] - 1.7 * 1.7; },
      [](double, const double* y, double* c) {
        c[0] = 4.0 * y[0];
        c[1] = 2.0 * y[1];
      });
  const Ended end = run(problem, 1e-6, wrong + problem.select({"velocity", "energy"}), 3000);
  INFO(end.message);
  CHECK(end.status != tp::Status::success);
  CHECK(contains(end.message, "check_jacobian"));
  CHECK(contains(end.message, "row 0 (length)"));
  CHECK(count(end.printed, "check_jacobian") >= 1);
}

TEST_CASE("C too large by a factor is named: moves that shrink slowly have not converged") {
  for (const double factor : {3.0, 10.0, 1000.0}) {
    INFO("factor " << factor);
    const Ended end =
        run(circle(50.0), 1e-5,
            row(
                "circle",
                [](double, const double* y) { return (y[0] * y[0] + y[1] * y[1] - 1.0) / 2.0; },
                [factor](double, const double* y, double* c) {
                  c[0] = factor * y[0];
                  c[1] = factor * y[1];
                }),
            3000);
    CHECK(end.status != tp::Status::success);
    CHECK(contains(end.message, "check_jacobian"));
  }
}

TEST_CASE("a long collapse is explained once, restarts and all") {
  const Problem problem = swing(100.0);
  Host host(problem, 1e-6);
  const tp::Constraints wrong = row(
      "energy", [](double, const double* y) { return y[2] * y[2] + y[3] * y[3] + 6.9 * y[1]; },
      [](double, const double* y, double* c) {
        c[1] = 6.9;
        c[2] = 2.0 * y[2];
        c[3] = 2.0 * y[3];
      });
  Stderr captured;
  {
    tp::Projection projection(host.ida, problem.select({"position", "velocity"}) + wrong);
    for (int restart = 0; restart < 3; ++restart) {
      int flag = 0;
      while (host.steps() < 3000 && host.t < problem.t_end && flag >= 0) flag = host.step();
      REQUIRE(host.restart() == 0);
    }
    IDAFree(&host.ida);
  }
  const std::string printed = captured.text();
  INFO(printed);
  CHECK(count(printed, "IDA rejected") + count(printed, "each of the last") == 1);
  CHECK(count(printed, "at t = ") == 1);  // what the first steps of the first run have shown
  CHECK(count(printed, "tether:") == 2);
}

TEST_CASE("an id vector that calls everything algebraic is named") {
  const Problem problem = swing(100.0);
  Host host(problem, 1e-6);
  tp::Options options;
  options.id = host.vector(std::vector<double>(5, 0.0));
  const Ended end = run(problem, 1e-6, problem.recommended_constraints(), 3000, options);
  INFO(end.message);
  CHECK(end.status != tp::Status::success);
  CHECK(contains(end.message, "id"));
}

TEST_CASE("an id vector that takes some variables for the other kind is named") {
  struct Case {
    const char* form;
    std::vector<double> id;
    std::vector<const char*> said;
  };
  const std::vector<Case> cases = {
      {"index 1", {1, 1, 1, 1, 1}, {"the id vector calls y[4] differential"}},
      {"index 1", {1, 1, 0, 1, 0}, {"the id vector calls y[2] algebraic"}},
      {"index 1", {0, 1, 0, 1, 1}, {"calls y[0] and y[2] algebraic", "it calls y[4] differential"}},
      {"index 2", {1, 1, 1, 0, 0}, {"the id vector calls y[3] algebraic"}},
      {"GGL", {1, 1, 1, 1, 1, 0}, {"the id vector calls y[4] differential"}},
      {"index 1", {1, 1, 1, 1, 0}, {}},
      {"index 1 w", {1, 1, 1, 1, 0, 0, 0}, {}},
      {"index 0", {1, 1, 1, 1, 1}, {}},
      {"index 2", {1, 1, 1, 1, 0}, {}},
      {"GGL", {1, 1, 1, 1, 0, 0}, {}}};
  for (const Case& what : cases) {
    const Problem problem = pendulum(1.3, 6.1, 3.0, what.form);
    Host owner(problem, 1e-6);
    tp::Options options;
    options.id = owner.vector(what.id);
    const Ended end = run(problem, 1e-6, problem.recommended_constraints(), 3000, options);
    INFO(what.form << ": " << end.flag << " " << end.message);
    CHECK(contains(end.message, "id vector") == !what.said.empty());
    for (const char* said : what.said) {
      CHECK(contains(end.message, said));
      CHECK(contains(end.printed, said));
      CHECK(end.status == tp::Status::doubtful);
    }
  }
}

TEST_CASE("F of index 3 is named where its run fails, forms of index 1 and 2 are not") {
  for (const bool third : {true, false})
    for (const double tolerance : {1e-6, 1e-8}) {
      Problem problem = pendulum(1.7, 3.3, 10.0, "index 2");
      if (third) {
        const auto residual = problem.residual;
        problem.residual = [residual](double t, const double* y, const double* yp, double* r) {
          residual(t, y, yp, r);
          r[4] = y[0] * y[0] + y[1] * y[1] - 1.7 * 1.7;
        };
        problem.jacobian = nullptr;
      }
      const Ended end = run(problem, tolerance, problem.recommended_constraints(), 20000);
      INFO("tolerance " << tolerance << ": " << end.flag << " " << end.message);
      CHECK(contains(end.message, "F is of index 3") == third);
      CHECK((end.status == tp::Status::success) != third);
    }
}

TEST_CASE("a run that stands still ends by name, after a bounded number of steps") {
  // z = 1 / (1 - t) has no value at t = 1: IDA goes on there until z overflows.
  const Problem problem = ode({1.0, 0.0, 1.0}, 2.0, [](double, const double* y, double* f) {
    f[0] = -y[1];
    f[1] = y[0];
    f[2] = y[2] * y[2];
  });
  Host host(problem, 1e-6);
  host.attach(on_circle());
  int flag = 0;
  while (flag >= 0 && host.steps() < 20000) flag = host.step();
  CHECK(flag < 0);
  CHECK(host.steps() <= 1500);
  CHECK(host.projection().status() == tp::Status::collapsed);
  CHECK(contains(host.projection().message(), "shorter than its rounding"));
}

TEST_CASE("a start off the constraints is explained once on stderr") {
  const Problem problem = swing(20.0);
  const Ended end = run(problem, 1e-8, problem.recommended_constraints(), 2000, {}, 0.3);
  INFO(end.message << " | " << end.printed);
  CHECK(end.flag < 0);
  CHECK(count(end.printed, "times without a point on the constraints") == 1);
  CHECK(contains(end.printed, "make_consistent"));

  tp::Options silent;
  silent.print = false;
  CHECK(run(problem, 1e-8, problem.recommended_constraints(), 2000, silent, 0.3).printed.empty());
}

TEST_CASE("a start off by fewer tolerances than a move may be long is named, too") {
  // Its moves are made; IDA's error test refuses all of them and says so in its own words only.
  for (const double tolerance : {1e-4, 1e-6}) {
    const Problem problem = swing(20.0);
    const Ended end = run(problem, tolerance, problem.recommended_constraints(), 2000, {},
                          15.0 * tolerance * (1.0 + problem.y0[0]));
    INFO(end.flag << " " << end.message);
    CHECK(end.flag == IDA_ERR_FAIL);
    CHECK(end.status == tp::Status::doubtful);
    CHECK(contains(end.message, "tolerances off the constraints"));
    CHECK(count(end.printed, "make_consistent") == 1);
  }
}

TEST_CASE("moves that do not converge: what is wrong with C or the tolerances is in the message") {
  const Problem problem = swing(50.0);
  const tp::Constraints wrong =
      problem.select({"position"}) +
      row(
          "across", [](double, const double* y) { return y[0] * y[2] + y[1] * y[3]; },
          [](double, const double* y, double* c) {
            c[0] = y[2];
            c[1] = y[3];
            c[2] = -y[0];
            c[3] = y[1];
          });
  int ended = 0;
  for (const double tolerance : {1e-4, 1e-5, 1e-6, 1e-7, 1e-8}) {
    const Ended end = run(problem, tolerance, wrong, 4000);
    INFO(end.flag << " " << end.message);
    if (end.flag != IDA_CONV_FAIL) continue;
    ++ended;
    CHECK(end.status == tp::Status::not_converged);
    CHECK(contains(end.message, "check_jacobian finds there: row 1 (across), column 2"));
    CHECK(contains(end.printed, "row 1 (across), column 2"));
  }
  CHECK(ended > 0);
}

TEST_CASE("a healthy run says nothing while IDA looks for its first step") {
  // Octave's ode15s begins with y' = 0 unless told otherwise, so that IDA tries long steps.
  for (const double t_end : {2.0, 20.0, 74.0, 500.0}) {
    Problem problem = pendulum(1.0, 1.0, t_end, "index 0");
    problem.yp0.assign(problem.yp0.size(), 0.0);
    const Ended end = run(problem, 1e-6, problem.recommended_constraints(), 2000);
    INFO("to " << t_end << ": " << end.message << " | " << end.printed);
    CHECK(end.flag >= 0);
    CHECK(end.printed.empty());
  }
}

TEST_CASE("a row that holds one side only, max(u, 0), is named in the first steps") {
  // Moves from the other side are none: the run goes on, up to 1.6 times as long and off by 1.
  const Problem problem = swing(50.0);
  const auto u = [](const double* y) { return y[0] * y[0] + y[1] * y[1] - 1.7 * 1.7; };
  const tp::Constraints one_sided = row(
      "outside", [u](double, const double* y) { return std::max(u(y), 0.0); },
      [u](double, const double* y, double* c) {
        const double slope = u(y) > 0.0 ? 2.0 : 0.0;
        c[0] = slope * y[0];
        c[1] = slope * y[1];
      });
  for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
    const Ended end =
        run(problem, tolerance, one_sided + problem.select({"velocity", "energy"}), 150);
    INFO(tolerance << ": " << end.message);
    CHECK(end.status == tp::Status::doubtful);
    CHECK(contains(end.message, "outside"));
    CHECK(contains(end.message, "|.| or max"));
  }
}

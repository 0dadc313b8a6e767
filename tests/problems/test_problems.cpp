// Tether: are the test problems what they say? SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <problems/akzo_nobel.hpp>
#include <problems/andrews.hpp>
#include <problems/bricard.hpp>
#include <problems/car_axis.hpp>
#include <problems/governor.hpp>
#include <problems/kepler.hpp>
#include <problems/link_chain.hpp>
#include <problems/lotka_volterra.hpp>
#include <problems/pendulum.hpp>
#include <problems/pinned_rods.hpp>
#include <problems/rigid_body.hpp>
#include <problems/robertson.hpp>
#include <problems/slider_crank.hpp>
#include <problems/slider_crank_equal.hpp>
#include <problems/transistor_amplifier.hpp>

#include "oracle.hpp"
#include "support/catch.hpp"

using namespace tether::problems;
using namespace tether::problems::test;

namespace {

constexpr double kGravity = 9.81;

std::vector<Problem> everything() {
  std::vector<Problem> all;
  for (const std::string& form : pendulum_forms()) {
    all.push_back(pendulum(1.0, kGravity, 10.0, form));
    all.push_back(pendulum(2.5, kPendulumPeriodTwo, 3.0, form));
  }
  for (const std::string& form : car_axis_forms()) all.push_back(car_axis(form));
  for (const std::string& form : andrews_forms()) all.push_back(andrews(form));
  for (const std::string& form : slider_crank_forms())
    for (const bool consistent : {true, false}) all.push_back(slider_crank(form, consistent));
  for (const std::string& form : robertson_forms()) all.push_back(robertson(40.0, form));
  for (const std::string& motion : rigid_body_motions()) all.push_back(rigid_body(motion, 10.0));
  all.push_back(kepler(0.6, 10.0));
  all.push_back(kepler(0.9, 20.0));
  all.push_back(lotka_volterra(2.0, 0.5, 10.0));
  all.push_back(akzo_nobel());
  all.push_back(transistor_amplifier());
  for (const std::string& form : slider_crank_equal_forms()) {
    all.push_back(slider_crank_equal(kSliderCrankTurn, 1.0, form));
    all.push_back(slider_crank_equal(kSliderCrankSwing, 0.5, form));
  }
  for (const std::string& form : pinned_rods_forms()) {
    all.push_back(n_four_bar(2, 1.0, form));
    all.push_back(five_link_chain(1.0, form));
    all.push_back(ten_link_chain(0.3, form));
    all.push_back(parallelogram(kThirdTurn / 2.0, 0.0, 1.0, form));
    all.push_back(parallelogram(0.0, 8.0, 1.0, form));
  }
  for (const std::string& form : bricard_forms()) all.push_back(bricard(1.0, form));
  for (const std::string& form : governor_forms()) all.push_back(governor(0.1, form));
  all.push_back(link_chain(8, 0.3));
  return all;
}

bool regularised(const Problem& problem) {
  return problem.form == "index 1" &&
         (problem.name == "parallelogram" || problem.name.rfind("four bar", 0) == 0);
}

bool published_start(const Problem& problem) {
  return problem.name == "slider crank" && std::abs(problem.y0[1]) == 0.0;
}

// The second multipliers of the stabilised forms, which stand last, are 0 on solutions.
void without_mu(const Problem& problem, Eigen::VectorXd& y) {
  if (problem.form.rfind("GGL", 0) == 0)
    y.tail(find(problem, "position")->constraints.count).setZero();
}

// Size of the terms that cancel in F: its entries' scale for round-off.
Eigen::VectorXd residual_scale(const Problem& p, double t, const Eigen::VectorXd& y,
                               const Eigen::VectorXd& yp) {
  const Eigen::MatrixXd dy = residual_differences(p, t, 0.0, y, yp);
  const Eigen::MatrixXd both = residual_differences(p, t, 1.0, y, yp);
  return dy.cwiseAbs() * y.cwiseAbs() + (both - dy).cwiseAbs() * yp.cwiseAbs() +
         Eigen::VectorXd::Constant(p.size, 1e-3);
}

}  // namespace

TEST_CASE("sizes fit together") {
  for (const Problem& p : everything()) {
    INFO(label(p));
    const auto N = static_cast<std::size_t>(p.size);
    CHECK(p.y0.size() == N);
    CHECK(p.yp0.size() == N);
    CHECK(p.id.size() == N);
    CHECK(p.reference.size() == N);
    CHECK((p.atol_scale.empty() || p.atol_scale.size() == N));
    CHECK(p.error_components <= p.size);
    CHECK(p.t_end > p.t0);
    int rows = 0;
    for (const std::string& name : p.recommended) {
      REQUIRE(find(p, name) != nullptr);
      rows += find(p, name)->constraints.count;
    }
    CHECK(p.recommended_constraints().total_count() == rows);
    for (const Rows& group : p.rows)
      CHECK(group.constraints.names.size() == static_cast<std::size_t>(group.constraints.count));
    CHECK_THROWS_AS(p.select({"no such rows"}), std::invalid_argument);
    CHECK(p.error(p.reference.data()) == 0.0);
    std::vector<double> wrong = p.reference;
    wrong[0] += 0.5 * (1.0 + std::abs(wrong[0]));
    CHECK(p.error(wrong.data()) == Approx(0.5));
  }
}

TEST_CASE("the start satisfies F") {
  for (const Problem& p : everything()) {
    INFO(label(p));
    const Eigen::VectorXd y = vector(p.y0), yp = vector(p.yp0);
    const Eigen::VectorXd r = residual(p, p.t0, y, yp);
    // Published start: its velocity rows are wrong by 1.2e-8, and the index-2 form contains them.
    // Solved for the accelerations in double, the start in long double.
    const double solved =
        p.index == 0 && p.name == "andrews" ? 1e-9 * yp.cwiseAbs().maxCoeff() : 0.0;
    const double slack = published_start(p) && p.index >= 2 ? 2e-8 : solved;
    const Eigen::VectorXd scale = residual_scale(p, p.t0, y, yp);
    for (int i = 0; i < p.size; ++i) {
      INFO("equation " << i);
      CHECK(std::abs(r[i]) <= 2e-14 * scale[i] + slack);
    }
  }
}

TEST_CASE("the start and the reference satisfy every row") {
  for (const Problem& p : everything()) {
    for (const Rows& rows : p.rows) {
      INFO(label(p) << ", " << rows.name);
      const Eigen::VectorXd y = vector(p.y0);
      const RowMajor C = jacobian(rows, p.t0, y);
      const Eigen::VectorXd at_start = value(rows, p.t0, y);
      const double slack = published_start(p) ? 2e-8 : 0.0;
      for (int i = 0; i < at_start.size(); ++i) {
        const double scale = C.row(i).cwiseAbs().dot(y.cwiseAbs()) + 1e-3;
        CHECK(std::abs(at_start[i]) <= 1e-14 * scale + slack);
      }
    }
  }
}

TEST_CASE("row Jacobians agree with differences") {
  std::mt19937 random(1);
  for (const Problem& p : everything()) {
    for (int repeat = 0; repeat < 3; ++repeat) {
      double t;
      const Eigen::VectorXd y = random_state(p, random, &t);
      const Eigen::VectorXd weight = y.cwiseAbs().cwiseMax(1.0);
      for (const Rows& rows : p.rows) {
        INFO(label(p) << ", " << rows.name);
        const RowMajor given = jacobian(rows, t, y), expected = differences(rows, t, y);
        for (int i = 0; i < given.rows(); ++i) {
          const double scale =
              expected.row(i).cwiseAbs().cwiseProduct(weight.transpose()).maxCoeff();
          for (int j = 0; j < given.cols(); ++j) {
            INFO("row " << i << ", column " << j << ": given " << given(i, j) << ", differences "
                        << expected(i, j));
            CHECK(std::abs(given(i, j) - expected(i, j)) * weight[j] <= 2e-9 * scale);
          }
        }
      }
    }
  }
}

TEST_CASE("Jacobians of F agree with differences") {
  std::mt19937 random(2);
  for (const Problem& p : everything()) {
    if (!p.jacobian) continue;
    for (int repeat = 0; repeat < 3; ++repeat) {
      double t;
      const double cj = repeat == 0 ? 0.0 : repeat == 1 ? 1.7 : 400.0;
      const Eigen::VectorXd y = random_state(p, random, &t);
      const Eigen::VectorXd yp = derivative(p, t, y);
      Eigen::MatrixXd given = Eigen::MatrixXd::Constant(p.size, p.size, std::nan(""));
      p.jacobian(t, cj, y.data(), yp.data(), given.data());
      const Eigen::MatrixXd expected = residual_differences(p, t, cj, y, yp);
      const Eigen::VectorXd weight = y.cwiseAbs().cwiseMax(1.0);
      for (int i = 0; i < p.size; ++i) {
        const double scale =
            expected.row(i).cwiseAbs().cwiseProduct(weight.transpose()).maxCoeff() +
            1e-3 * std::abs(residual(p, t, y, yp)[i]) + 1e-3;  // differences have round-off, too
        for (int j = 0; j < p.size; ++j) {
          INFO(label(p) << ", cj " << cj << ", entry " << i << " " << j << ": given " << given(i, j)
                        << ", differences " << expected(i, j));
          CHECK(std::abs(given(i, j) - expected(i, j)) * weight[j] <= 1e-8 * scale);
        }
      }
    }
  }
}

// d/dt position = velocity and d/dt velocity = acceleration, along y' of the equations of motion,
// whatever the velocities and multipliers are.
TEST_CASE("each group is the derivative of the one below") {
  std::mt19937 random(3);
  for (const Problem& p : everything()) {
    for (const auto& pair :
         {std::make_pair("position", "velocity"), std::make_pair("velocity", "acceleration")}) {
      const Rows* lower = find(p, pair.first);
      const Rows* upper = find(p, pair.second);
      if (!lower || !upper) continue;
      for (int repeat = 0; repeat < 3; ++repeat) {
        double t;
        Eigen::VectorXd y = random_state(p, random, &t);
        y = project(p, t, y, {"position"});
        without_mu(p, y);
        const Eigen::VectorXd yp = derivative(p, t, y);
        const RowMajor C = jacobian(*lower, t, y);
        const Eigen::VectorXd rate = C * yp + time_differences(*lower, t, y);
        const Eigen::VectorXd expected = value(*upper, t, y);
        for (int i = 0; i < rate.size(); ++i) {
          INFO(label(p) << ", " << pair.first << ", row " << i);
          const double scale =
              C.row(i).cwiseAbs().dot(yp.cwiseAbs()) + std::abs(expected[i]) + 1e-2;
          CHECK(std::abs(rate[i] - expected[i]) <= 2e-10 * scale);
        }
      }
    }
  }
}

// C y' + g_t = 0 on the constraints, for the groups that contain differential unknowns only.
TEST_CASE("invariants stay constant along the motion") {
  std::mt19937 random(4);
  for (const Problem& p : everything()) {
    if (p.name == "transistor amplifier") continue;  // its rows are equations of F, with all ids 1
    // Here w is an unknown that only the equations of motion, not solved here, tie to the rest.
    if (p.index > 1 && p.form.back() == 'w') continue;
    // From a random state its springs accelerate too much for Gauss-Newton onto the accelerations.
    const bool stiff = p.name == "governor";
    if (stiff && p.index > 1) continue;
    for (int repeat = 0; repeat < 3; ++repeat) {
      double t;
      Eigen::VectorXd y = random_state(p, random, &t);
      y = project(p, t, y, stiff ? p.recommended : std::vector<std::string>());
      without_mu(p, y);
      const bool index1 = p.form.rfind("index 1", 0) == 0;
      const Eigen::VectorXd yp = index1 ? motion(p, t, &y) : derivative(p, t, y);
      for (const Rows& rows : p.rows) {
        const RowMajor C = jacobian(rows, t, y);
        const Eigen::Map<const Eigen::VectorXd> id(p.id.data(), p.size);
        const bool algebraic =
            (C.array().abs().rowwise() * (1.0 - id.transpose().array())).maxCoeff() > 0.0;
        if (algebraic) continue;
        const Eigen::VectorXd at = value(rows, t, y);
        const Eigen::VectorXd rate = C * yp + time_differences(rows, t, y);
        for (int i = 0; i < rate.size(); ++i) {
          INFO(label(p) << ", " << rows.name << ", row " << i << ", t " << t);
          const double scale = C.row(i).cwiseAbs().dot(yp.cwiseAbs()) + 5.0;
          CHECK(std::abs(at[i]) <= 1e-12 * (1.0 + C.row(i).cwiseAbs().dot(y.cwiseAbs())));
          // The regularised forms let the second derivatives be epsilon lam.
          const double slack = regularised(p) ? 1e-6 : 0.0;
          CHECK(std::abs(rate[i]) <= 2e-10 * scale + slack);
        }
      }
    }
  }
}

TEST_CASE("copies work alone") {
  Problem copy;
  {
    const Problem original = andrews("index 1");
    copy = original;
  }
  CHECK(residual(copy, 0.0, vector(copy.y0), vector(copy.yp0)).cwiseAbs().maxCoeff() < 1e-10);
}

TEST_CASE("the references satisfy the rows to their own accuracy") {
  for (const Problem& p : everything()) {
    const Eigen::VectorXd end = vector(p.reference);
    if (!end.allFinite()) continue;
    const double slack = published_start(p) ? 1e-7 : 1e-14;
    for (const Rows& rows : p.rows) {
      INFO(label(p) << ", " << rows.name);
      const RowMajor C = jacobian(rows, p.t_end, end);
      const Eigen::VectorXd at_end = value(rows, p.t_end, end);
      for (int i = 0; i < at_end.size(); ++i)
        CHECK(std::abs(at_end[i]) <= slack * (C.row(i).cwiseAbs().dot(end.cwiseAbs()) + 1.0));
    }
  }
}

// IDA's Newton iteration does not get through the governor's index-2 forms below 1e-7.
double plain_ida_tolerance(const Problem& p) { return p.name == "governor" ? 1e-6 : 1e-8; }

// About three times what is measured at that tolerance, with nothing projected.
double plain_ida_bound(const Problem& p) {
  if (p.name == "governor") return 3.5e-4;
  if (p.name == "bricard") return 1e-5;
  if (p.name == "pendulum") return p.form == "index 1" ? 1.5e-3 : 1.5e-4;
  if (p.name == "car axis") return 2e-5;
  if (p.name == "andrews") return 1e-6;
  if (p.name == "slider crank") return 2e-7;
  if (p.name == "slider crank with equal lengths") return 1.5e-6;
  if (p.name == "kepler") return 2e-4;
  if (p.name == "robertson") return 2e-8;
  if (p.name == "akzo nobel") return 1e-7;
  if (p.name == "transistor amplifier") return 5e-8;
  if (p.name.rfind("chain", 0) == 0) return 1e-5;
  return 1e-6;
}

TEST_CASE("plain IDA reaches the references") {
  for (const Problem& p : everything()) {
    if (p.index > 2) continue;  // not what IDA is made for
    // Turning through the flat position, without projection, the multiplier form leaves the branch.
    if (p.name == "parallelogram" && p.form == "index 1" && p.y0[14] != 0.0) continue;
    for (const bool analytic : {false, true}) {
      if (analytic && !p.jacobian) continue;
      long steps = 0;
      const double tolerance = plain_ida_tolerance(p);
      const Eigen::VectorXd end = integrate(p, tolerance, tolerance, &steps, analytic);
      const double error = p.error(end.data());
      INFO(label(p) << ", " << (analytic ? "given" : "difference") << " Jacobian: error " << error
                    << " in " << steps << " steps");
      CHECK(error < plain_ida_bound(p));
    }
  }
}

TEST_CASE("transistor amplifier: the start keeps the sums of currents") {
  const Problem p = transistor_amplifier();
  const Rows& rows = *find(p, "currents");
  Eigen::VectorXd rate = jacobian(rows, p.t0, vector(p.y0)) * vector(p.yp0);
  rate[0] -= 20.0 * 3.14159265358979323846 / 1000.0;  // of the signal, through R0
  CHECK(rate.cwiseAbs().maxCoeff() < 1e-16);
  // The published derivatives keep them to three digits.
  CHECK(p.yp0[0] == Approx(51.338775).epsilon(1e-3));
  CHECK(p.yp0[3] == Approx(-24.9757667).epsilon(1e-3));
  CHECK(p.yp0[6] == Approx(-10.00564453).epsilon(1e-3));
}

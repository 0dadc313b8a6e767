// Tether: are the circuits, tubes and wheels of the test set for IVP solvers what was published?
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <problems/charge_pump.hpp>
#include <problems/fekete.hpp>
#include <problems/linear_masses.hpp>
#include <problems/nand_gate.hpp>
#include <problems/oregonator.hpp>
#include <problems/two_bit_adder.hpp>
#include <problems/water_tube.hpp>
#include <problems/wheelset.hpp>
#include <tether/ida_projection/constraints.hpp>

#include "oracle.hpp"
#include "support/catch.hpp"

using namespace tether::problems;
using namespace tether::problems::test;

namespace {

std::vector<Problem> the_set() {
  std::vector<Problem> all = {charge_pump(), water_tube(), two_bit_adder(), wheelset()};
  for (const char* form : {"index 2", "index 1", "GGL"}) {
    all.push_back(fekete(form));
    all.push_back(linear_masses(form));
  }
  for (const std::string& form : nand_gate_forms()) all.push_back(nand_gate(form));
  all.push_back(oregonator());
  return all;
}

}  // namespace

TEST_CASE("problems of the test set start on F and on their rows, with right Jacobians") {
  for (const Problem& p : the_set()) {
    INFO(label(p));
    const auto N = static_cast<std::size_t>(p.size);
    CHECK(p.y0.size() == N);
    CHECK(p.yp0.size() == N);
    CHECK(p.id.size() == N);
    CHECK(p.reference.size() == N);
    CHECK(p.error(p.reference.data()) == 0.0);
    const Eigen::VectorXd y = vector(p.y0);
    CHECK(residual(p, p.t0, y, vector(p.yp0)).cwiseAbs().maxCoeff() < 1e-13);
    for (const Rows& rows : p.rows) {
      INFO(rows.name);
      CHECK(value(rows, p.t0, y).cwiseAbs().maxCoeff() < 1e-13);
      // Beside the start, where the pump's and the gates' characteristics have no kink.
      const Eigen::VectorXd beside = y.array() + 1e-3 * (1.0 + y.array().abs()) * 0.37;
      const auto report = tether::ida_projection::check_jacobian(
          rows.constraints, p.t0 + 0.013 * (p.t_end - p.t0),
          p.name == "wheelset" ? p.y0 : std::vector<double>(beside.data(), beside.data() + N));
      CHECK(report.correct);
      INFO(report.message);
    }
  }
}

TEST_CASE("plain IDA reaches the published ends of the test set") {
  struct Bound {
    Problem problem;
    double tolerance, error;
  };
  // About three times what is measured at that tolerance.
  for (const Bound& bound :
       {Bound{fekete("GGL"), 1e-8, 2e-7}, Bound{linear_masses("index 2"), 1e-8, 2e-6},
        Bound{water_tube(), 1e-8, 2e-7}, Bound{nand_gate("index 0"), 1e-8, 3e-7},
        Bound{nand_gate("index 1"), 1e-8, 3e-7}, Bound{wheelset(), 1e-8, 3e-6},
        Bound{oregonator(), 1e-8, 2e-7}}) {
    const Eigen::VectorXd end = integrate(bound.problem, bound.tolerance, bound.tolerance);
    INFO(label(bound.problem) << ": error " << bound.problem.error(end.data()));
    CHECK(bound.problem.error(end.data()) < bound.error);
  }
}

TEST_CASE("the exact motion of the linear masses solves their equations") {
  // One mass of 200 on a spring of 2 and a damper of 5: Taylor's series of the first piece.
  Problem p = linear_masses("index 1");
  const double h = 1e-3;
  p.t_end = h;
  const Eigen::VectorXd end = integrate(p, 1e-10, 1e-10);
  const double a = (10.0 - 5.0) / 200.0;
  CHECK(end[0] == Approx(h + a * h * h / 2.0).epsilon(1e-6));
  CHECK(end[2] == Approx(1.0 + a * h).epsilon(1e-6));
}

TEST_CASE("two-bit adder: starts as published") {
  const Problem p = two_bit_adder();
  const double* v = p.y0.data() + 175;
  CHECK(v[13] == Approx(0.215858486765796).epsilon(1e-7));
  CHECK(v[48] == Approx(0.204040692499482).epsilon(1e-7));
  CHECK(v[106] == Approx(4.734672533390062).epsilon(1e-7));
  CHECK(v[129] == Approx(4.999999999997678).epsilon(1e-12));
  CHECK(v[165] == Approx(-0.026017361873568).epsilon(1e-7));
  CHECK(v[174] == Approx(-2.499999999999992).epsilon(1e-12));
}

TEST_CASE("charge pump: the transistor's charge at rest is the published one") {
  const Problem p = charge_pump();
  CHECK(p.y0[0] == Approx(p.reference[0]).epsilon(1e-14));
}

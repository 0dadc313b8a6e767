// Tether: the test problems against published digits and closed forms. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <problems/andrews.hpp>
#include <problems/kepler.hpp>
#include <problems/lotka_volterra.hpp>
#include <problems/pendulum.hpp>
#include <problems/pinned_rods.hpp>
#include <problems/rigid_body.hpp>
#include <problems/slider_crank.hpp>
#include <problems/slider_crank_equal.hpp>
#include <tether/linalg/singular_values.hpp>

#include "oracle.hpp"
#include "support/catch.hpp"

using namespace tether::problems;
using namespace tether::problems::test;

namespace {

constexpr double g = 9.81;

}  // namespace

TEST_CASE("pendulum_exact against published digits") {
  struct Row {
    double t, x, y;
  };
  // 40-digit values for g = 9.81; the double nearest to 9.81 moves t = 2000 by 2e-13.
  for (const Row& row : {Row{0.5, 0.391048791550546, -0.920369948785192},
                         Row{1.0, -0.986291751131875, -0.165010853125541},
                         Row{10.0, 0.2750874625761168600543914, -0.9614192050991250642651351},
                         Row{100.0, 0.181513351427031, -0.983388480334058},
                         Row{1000.0, -0.6832301885523148554574465, -0.7302030604227623275486221},
                         Row{2000.0, -0.814603068589032, -0.580018827836935}}) {
    double y[5];
    pendulum_exact(1.0, g, row.t, y);
    const double bound = 1e-15 + 1.2e-16 * row.t;
    INFO(row.t);
    CHECK(std::abs(y[0] - row.x) < bound);
    CHECK(std::abs(y[1] - row.y) < bound);
  }
  double y[5];
  pendulum_exact(1.0, g, 10.0, y);
  CHECK(y[2] == Approx(-4.17559810095172883646052).epsilon(3e-15));
  CHECK(y[3] == Approx(-1.194749054560475271647513).epsilon(1e-14));
  CHECK(y[4] == Approx(2.0 * 14.14728360303362532066).epsilon(2e-15));
  pendulum_exact(1.0, g, 1000.0, y);
  CHECK(y[2] == Approx(-2.763853217052379217832877).epsilon(2e-13));
  CHECK(y[3] == Approx(2.586058669110933151661269).epsilon(2e-13));
  CHECK(pendulum_period(1.0, g) == Approx(2.3678419475762374493).epsilon(2e-16));
  CHECK(pendulum_period(1.0, kPendulumPeriodTwo) == Approx(2.0).epsilon(2e-16));
  pendulum_exact(1.0, kPendulumPeriodTwo, 30.0, y);
  CHECK(y[0] == Approx(1.0).epsilon(1e-15));
  CHECK(std::abs(y[3]) < 1e-13);
}

TEST_CASE("pendulum_exact solves the equations") {
  for (const double t : {0.3, 1.1, 7.0}) {
    const double L = 2.5;
    double y[5], up[5], down[5], h = 1e-5;
    pendulum_exact(L, g, t, y);
    pendulum_exact(L, g, t + h, up);
    pendulum_exact(L, g, t - h, down);
    const double a[2] = {-y[0] * y[4], -y[1] * y[4] - g};
    for (int i = 0; i < 2; ++i) {
      CHECK((up[i] - down[i]) / (2.0 * h) == Approx(y[2 + i]).margin(1e-8));
      CHECK((up[2 + i] - down[2 + i]) / (2.0 * h) == Approx(a[i]).margin(1e-8));
    }
    CHECK(y[0] * y[0] + y[1] * y[1] == Approx(L * L).epsilon(1e-15));
    CHECK((y[2] * y[2] + y[3] * y[3]) / 2.0 + g * y[1] == Approx(0.0).margin(1e-13));
  }
}

TEST_CASE("andrews: published start and energy of the converged end") {
  const Problem p = andrews("index 1 w");
  const double w[2] = {14222.4439199541138705911625887, -10666.8329399655854029433719415};
  const double lam[2] = {98.5668703962410896057654982170, -6.12268834425566265503114393122};
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK(p.y0[14 + i] == Approx(w[i]).epsilon(1e-14));
    CHECK(p.y0[21 + i] == Approx(lam[i]).epsilon(1e-14));
  }
  for (std::size_t i = 2; i < 6; ++i) CHECK(std::abs(p.y0[21 + i]) < 1e-12);

  const Eigen::VectorXd end = vector(p.reference);
  CHECK(value(*find(p, "position"), p.t_end, end).cwiseAbs().maxCoeff() < 1e-15);
  CHECK(value(*find(p, "velocity"), p.t_end, end).cwiseAbs().maxCoeff() < 1e-13);
  CHECK(std::abs(value(*find(p, "energy"), p.t_end, end)[0]) < 2e-13);
  // Published values are good to nine digits in q and v, six in the accelerations and multipliers:
  // those do not even belong to the published q and v.
  CHECK(p.reference[8] == Approx(-0.1424379294994111e4).epsilon(1e-8));
  CHECK(p.reference[11] == Approx(0.5735699284790808).epsilon(1e-7));
  CHECK(p.reference[14] == Approx(-0.2463176316945196e5).epsilon(1e-8));
  CHECK(p.reference[17] == Approx(0.5667493645176213e6).epsilon(2e-6));
  CHECK(p.reference[21] == Approx(0.1991753333731910e3).epsilon(2e-6));
  CHECK(p.reference[26] == Approx(0.1161740700019673e2).epsilon(2e-6));
}

TEST_CASE("slider crank: published start and end") {
  const Problem p = slider_crank("index 1 w", false);
  // The published accelerations and multipliers carry the start's inconsistency of 1e-8 in v.
  const double w[7] = {0.0,
                       -1.344541576008661e-3,
                       -5.062194923138079e3,
                       -6.833142732779555e-5,
                       1.449382650173157e-8,
                       -4.268463211410861,
                       2.098334687947376e-1};
  const double lam[3] = {-6.397251492537153e-8, 382.4589508329281, -4.376060460948886e-9};
  for (std::size_t i = 0; i < 7; ++i) CHECK(p.y0[14 + i] == Approx(w[i]).margin(5e-7));
  for (std::size_t i = 0; i < 3; ++i) CHECK(p.y0[21 + i] == Approx(lam[i]).margin(3e-8));
  const double w_end[7] = {0.0,
                           0.6488737541276957e4,
                           0.2167938629509884e4,
                           0.3391137060286523e2,
                           0.1715134772216488,
                           -0.1422449408912512e1,
                           0.1003946428124810e1};
  for (std::size_t i = 0; i < 7; ++i)
    CHECK(p.reference[14 + i] == Approx(w_end[i]).epsilon(1e-7).margin(1e-10));

  // The nearest consistent start: 1e-10 away in q, 1.4e-8 in v.
  const Problem nearest = slider_crank("index 1 w");
  const Eigen::VectorXd change = (vector(nearest.y0) - vector(p.y0)).head(14);
  CHECK(change.head(7).cwiseAbs().maxCoeff() == Approx(1.0e-10).epsilon(0.1));
  CHECK(change.tail(7).cwiseAbs().maxCoeff() == Approx(1.4e-8).epsilon(0.1));
}

TEST_CASE("published digits of the ordinary differential equations") {
  const auto close = [](const Problem& p, std::size_t first, const std::vector<double>& expected,
                        double bound) {
    for (std::size_t i = 0; i < expected.size(); ++i) {
      INFO(label(p) << ", t " << p.t_end << ", component " << first + i);
      CHECK(std::abs(p.reference[first + i] - expected[i]) < bound);
    }
  };
  close(rigid_body("regular", 1.0), 0,
        {0.779039602588, 0.358209265957, 0.195829970695, 0.475850861047, 0.57780247181208,
         0.81617663747981, 0.88201581551054},
        6e-13);
  close(rigid_body("regular", 10.0), 0,
        {0.861441174065, 0.107340757620, 0.220947321794, -0.444498983542}, 6e-13);
  close(rigid_body("regular", 100.0), 0,
        {-0.269809365972, -0.023962434208, 0.088092237104, 0.958576270071, -0.84846767655152,
         0.52924720296594, 0.95217249805427},
        6e-13);
  close(rigid_body("regular", 100.0), 4, {-0.84846767655152, 0.52924720296594, 0.95217249805427},
        1e-14);
  close(rigid_body("euler", 10.0), 0,
        {0.462545440554643, -0.314335145144606, 0.049429631279300, 0.827527548484414,
         -0.603470423092518, -1.278993138547872, 0.887726788215733},
        2e-15);
  close(rigid_body("euler", 100.0), 4, {-0.509766254382673, -1.319143042240931, 0.867921201128947},
        2e-15);
  close(rigid_body("dzhanibekov", 10.0), 0,
        {0.222662676783, -0.148330597238, -0.746845556368, 0.608802990485, 0.9767826163387,
         0.2144661288375, -0.5639161520361},
        6e-13);
  close(kepler(0.6, 10.0), 0,
        {-1.53502359190981, -0.283668406499781, 0.227150732077498, -0.479187758203220}, 6e-15);
  close(kepler(0.6, 100.0), 0,
        {-0.104183204434181, -0.694741715567951, 1.23617776268708, 0.564623251085865}, 6e-15);
  close(kepler(0.6, 1000.0), 0,
        {-0.602737579924083, 0.799997002256847, -0.998356404550952, -0.00218647255324675}, 1e-14);
  close(kepler(0.9, 100.0), 0, {-0.750633333029645, -0.431000027577321}, 2e-15);
  close(lotka_volterra(2.0, 0.5, 10.0), 0, {0.302509343626, 1.062025093115}, 6e-13);
  close(lotka_volterra(2.0, 0.5, 100.0), 0, {0.463671060345, 0.434738529423}, 1e-11);
  close(lotka_volterra(3.0, 1.0, 100.0), 0, {1.071055430239362, 0.179085632362414}, 2e-15);

  // Slider crank with equal lengths: th1 and, where published, the slider.
  const auto crank = [&](const SliderCrankMotion& motion, double t, double angle, double bound) {
    const Problem p = slider_crank_equal(motion, t, "index 1");
    close(p, 0, {angle, -angle, 2.0 * std::cos(angle)}, 2.0 * bound);
  };
  crank(kSliderCrankSlow, 1.0, 1.596710176854, 6e-13);
  crank(kSliderCrankSlow, 10.0, 11.067471498642, 6e-13);
  crank(kSliderCrankSlow, 20.0, 21.419025448666, 6e-13);
  crank(kSliderCrankTurn, 1.0, 1.552839757058, 6e-13);
  crank(kSliderCrankTurn, 2.0, 2.907440247011, 6e-13);
  crank(kSliderCrankTurn, 10.0, 20.472423114882, 6e-13);
  crank(kSliderCrankSwing, 1.0, -1.05220168649591, 6e-15);
  crank(kSliderCrankSwing, 2.0, -3.70057861187332, 6e-15);
  crank(kSliderCrankSwing, 5.0, 0.775938144771567, 6e-15);
  crank(kSliderCrankSwing, 10.0, 0.746757721449060, 6e-15);
  crank(kSliderCrankFast, 1.0, 4.75362081435110, 6e-15);
  crank(kSliderCrankFast, 10.0, 42.6381845060193, 6e-14);

  const auto top = [](int N, double t, double x, double y, double speed) {
    double angle, rate;
    n_four_bar_exact(N, t, &angle, &rate);
    INFO("four bar " << N << ", t " << t);
    CHECK(std::abs(std::sin(angle) - x) < 1e-14 * (1.0 + t));
    CHECK(std::abs(std::cos(angle) - y) < 1e-14 * (1.0 + t));
    CHECK(std::abs(rate - speed) < 5e-14 * (1.0 + t));
  };
  top(2, 1.0, -0.195020301949435, -0.980799205662174, 6.80738524086945);
  top(2, 10.0, 0.328458111540815, 0.944518538178601, 1.50664218084183);
  top(2, 20.0, 0.839746574306844, 0.542978536352885, 3.38544255642929);
  top(40, 1.0, -0.115356880632110, -0.993324111300450, 6.71481488072356);
  top(40, 20.0, 0.410901153762945, 0.911679900971981, 1.71856961005574);
  // Tip of the five-link chain.
  const auto tip = [](double t, double x, double y, double bound) {
    const Problem p = five_link_chain(t, "index 0");
    const double* last = p.reference.data() + 12;
    INFO("chain, t " << t);
    CHECK(std::abs(last[0] + 0.5 * std::cos(last[2]) - x) < bound);
    CHECK(std::abs(last[1] + 0.5 * std::sin(last[2]) - y) < bound);
  };
  tip(0.5, 4.562046198086, -1.232748571441, 1e-12);
  tip(1.0, 0.533569475142432, -4.919709597570844, 1e-13);
  tip(2.0, -4.596001576614814, -0.756076430632311, 1e-12);
  for (const auto& known :
       {std::make_pair(1.0, -1.04713983399093), std::make_pair(10.0, 1.04142900981959),
        std::make_pair(100.0, 0.506915291660435)}) {
    double angle, rate;
    parallelogram_exact(kThirdTurn / 2.0, 0.0, known.first, &angle, &rate);
    CHECK(std::abs(angle - known.second) < 1e-14 * (1.0 + known.first));
  }
}

static int rank_of(const Eigen::MatrixXd& C, double threshold) {
  const Eigen::VectorXd values = tether::linalg::singular_values(C);
  return static_cast<int>((values.array() > threshold * values[0]).count());
}

TEST_CASE("rank of the rows where it is known") {
  const auto rank = [](const Problem& p, const std::string& name, const Eigen::VectorXd& y) {
    return rank_of(jacobian(*find(p, name), p.t0, y), 1e-9);
  };
  for (const int N : {1, 2}) {
    const Problem upright = n_four_bar(N, 1.0, "index 0");
    CHECK(rank(upright, "position", vector(upright.y0)) == 6 * N + 2);
  }
  // Flat four bar, written down: vertical rods along x, horizontal ones between their ends.
  const Problem four_bar = n_four_bar(2, 1.0, "index 0");
  Eigen::VectorXd y = Eigen::VectorXd::Zero(four_bar.size);
  for (int i = 0; i < 3; ++i) y[3 * i] = i + 0.5;
  for (int i = 0; i < 2; ++i) y[9 + 3 * i] = i + 1.5;
  CHECK(value(*find(four_bar, "position"), 0.0, y).cwiseAbs().maxCoeff() == 0.0);
  CHECK(rank(four_bar, "position", y) == 12);

  const Problem cranks = parallelogram(kThirdTurn / 2.0, 0.0, 1.0, "index 0");
  CHECK(rank(cranks, "position", vector(cranks.y0)) == 11);
  const Problem flat = parallelogram(0.75 * kThirdTurn, 0.0, 1.0, "index 0");
  CHECK(rank(flat, "position", vector(flat.y0)) == 10);

  const Problem slider = slider_crank_equal(kSliderCrankSlow, 1.0, "index 1");
  CHECK(rank(slider, "position", vector(slider.y0)) == 2);
  Eigen::VectorXd dead = vector(slider.y0);
  dead.head(3) << 0.75 * kThirdTurn, -0.75 * kThirdTurn, 0.0;
  CHECK(rank(slider, "position", dead) == 1);

  const Problem orbit = kepler(0.6, 10.0);
  RowMajor all(4, 4);
  all << jacobian(orbit.rows[0], 0.0, vector(orbit.reference)),
      jacobian(orbit.rows[1], 0.0, vector(orbit.reference)),
      jacobian(orbit.rows[2], 0.0, vector(orbit.reference));
  CHECK(rank_of(all, 1e-12) == 3);
}

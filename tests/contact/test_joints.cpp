// Joints and contacts in one solve. SPDX-License-Identifier: BSD-3-Clause
#include <cstdlib>
#include <tether/contact/evaluate.hpp>
#include <tether/linalg/pivoted_qr.hpp>

#include "jointed_bodies.hpp"
#include "support/catch.hpp"

using namespace jointed_bodies;

namespace {

// A cart of 10 kg on four discs of 1 kg, r = 0.2 m, down a slope; gravity in the axes of the slope.
struct Cart : Mechanism {
  Cart(double degrees, double mu) {
    body(10, Vector3d(0.5, 1, 1).asDiagonal(), {0, 0, 0.4});
    for (int k = 0; k < 4; ++k) {
      const Vector3d hub(k < 2 ? 0.5 : -0.5, k % 2 ? 0.3 : -0.3, 0.2);
      const int disc = body(1, Vector3d(0.01, 0.02, 0.01).asDiagonal(), hub);
      hinge(disc, 0, hub);
      touch(disc, kWorld, hub - Vector3d(0, 0, 0.2), Vector3d::UnitZ(), mu);
    }
    fall(1, kGravity * Vector3d(std::sin(radians(degrees)), 0, -std::cos(radians(degrees))));
  }
};

// Along the slope: across it the axles hold the wheels against each other as they like.
double friction(const JointSolution& s, int contact) {
  return std::abs((tc::tangent_frame(Vector3d::UnitZ()).bottomRows<2>().transpose() *
                   s.impulses.segment<2>(3 * contact + 1))[0]);
}

// Crank, coupler and crank of 1 m from 60 degrees, each hinge given `copies` times; a third crank
// makes a row that the others imply. The coupler meets a wall with 1 m/s.
struct Parallelogram : Mechanism {
  Parallelogram(int copies, double mu, double degrees = 60) {
    const double a = radians(degrees);
    const Vector3d arm(std::sin(a), 0, -std::cos(a)), along_rod(-arm.z(), 0, arm.x());
    const int coupler = body(2, 0.2 * Matrix3d::Identity(), Vector3d(1, 0, 0) + arm);
    bodies.back().velocity = -along_rod;
    for (int k = 0; k < 3; ++k) {
      const Vector3d pivot(k, 0, 0);
      const int crank = rod(1, pivot, pivot + arm);
      bodies.back().velocity = -along_rod / 2;
      bodies.back().angular_velocity = Vector3d::UnitY();
      for (int c = 0; c < copies; ++c) {
        hinge(crank, kWorld, pivot);
        hinge(coupler, crank, pivot + arm);
      }
    }
    touch(coupler, kWorld, Vector3d(0, 0, 0) + arm, along_rod, mu);
  }
};

}  // namespace

TEST_CASE("joints: a cart on four hinged discs rolls down a slope, or slips") {
  const double slope = radians(10), limit = 0.0220408725886;
  const Cart rolls(10, 0.5);
  const JointSolution s = rolls.solve();
  CHECK(s.contacts.status == tc::Status::solved);
  CHECK(s.joint_error < 1e-13);
  for (const Vector6d& v : s.velocities) CHECK(v[0] == Approx(1.490552545048513).epsilon(1e-12));
  for (int k = 0; k < 4; ++k) CHECK(friction(s, k) == Approx(0.7452762725242567).epsilon(1e-10));
  double normal = 0;
  for (int k = 0; k < 4; ++k) normal += s.impulses[3 * k];
  CHECK(normal == Approx(14 * kGravity * std::cos(slope)).epsilon(1e-12));

  // The rear wheels carry more: they grip for longer than the front ones.
  CHECK(Cart(10, 10 * limit).solve().velocities[0][0] == Approx(1.490552545048513).epsilon(1e-10));
  const JointSolution slips = Cart(10, limit / 10).solve();
  CHECK(slips.contacts.status == tc::Status::solved);
  CHECK(slips.velocities[0][0] ==
        Approx(kGravity * (std::sin(slope) - limit / 10 * std::cos(slope))).epsilon(1e-10));
}

TEST_CASE("joints: a hinged rod on a belt, trailing and leading, up to where it jams") {
  // About the hinge: N (cos +- mu sin) = g/2 cos.
  for (const double degrees : {30.0, 45.0, 60.0}) {
    for (const double belt : {-1.0, 1.0}) {
      const double mu = 0.5, a = radians(degrees);
      Mechanism m;
      const Vector3d hinge_at(0, 0, std::sin(a)), tip(std::cos(a), 0, 0);
      const int rod = m.rod(1, hinge_at, tip);
      m.hinge(rod, kWorld, hinge_at);
      const int ground = m.fixed({belt, 0, 0});
      m.touch(rod, ground, tip, Vector3d::UnitZ(), mu);
      m.fall(1e-3);
      const JointSolution s = m.solve();
      INFO(degrees << " degrees, belt " << belt);
      CHECK(s.contacts.status == tc::Status::solved);
      const double wanted = kGravity / 2 / (1 + belt * mu * std::tan(a));
      CHECK(s.impulses[0] / 1e-3 == Approx(wanted).epsilon(1e-11));
      if (degrees == 30)
        CHECK(wanted == Approx(belt > 0 ? 3.806234688886301 : 6.895583492931881).epsilon(1e-13));
      // mu tan > 1: nothing holds the tip without driving it in.
      if (degrees == 60 && belt < 0) {
        m.contacts[0].mu = 0.6;
        CHECK(m.solve().contacts.status != tc::Status::solved);
        m.contacts[0].mu = 0.57;
        CHECK(m.solve().contacts.status == tc::Status::solved);
      }
    }
  }
}

TEST_CASE("joints: a step ladder stands on friction of half the cotangent") {
  for (const double degrees : {45.0, 60.0, 75.0}) {
    for (const double part : {0.999, 1.001}) {
      const double a = radians(degrees), mu = part / (2 * std::tan(a));
      Mechanism m;
      const Vector3d top(0, 0, std::sin(a)), left(-std::cos(a), 0, 0), right = -left;
      const int p = m.rod(1, left, top), q = m.rod(1, right, top);
      m.hinge(p, q, top);
      m.touch(p, kWorld, left, Vector3d::UnitZ(), mu);
      m.touch(q, kWorld, right, Vector3d::UnitZ(), mu);
      m.fall(1);
      const JointSolution s = m.solve();
      INFO(degrees << " degrees, " << part << " of the limit");
      CHECK(s.contacts.status == tc::Status::solved);
      const double speed = s.velocities[0].norm() + s.velocities[1].norm();
      CHECK((part > 1 ? speed < 1e-9 : speed > 1e-5));
      CHECK(s.impulses[0] == Approx(part > 1 ? kGravity : s.impulses[3]).epsilon(1e-9));
    }
  }
}

TEST_CASE("joints: an elastic impact takes (1 - e^2) w_n^2 / (2 J P J') through the joints") {
  for (const int copies : {1, 10}) {
    for (const double e : {0.0, 0.5, 1.0}) {
      Parallelogram m(copies, 0);
      m.contacts[0].bias[0] = -e;  // w_n+ = e, approach 1
      const JointSolution s = m.solve();
      CHECK(s.contacts.status == tc::Status::solved);
      // One degree of freedom: reduced mass 2 + 3/3 kg at the coupler.
      const double before = m.energy(s.velocities) + (1 - e * e) * 3.0 / 2;
      std::vector<Vector6d> came;
      for (const tc::RigidBody& b : m.bodies) came.push_back(b.velocities());
      CHECK(m.energy(came) == Approx(1.5).epsilon(1e-13));
      CHECK(before == Approx(1.5).epsilon(1e-12));
      CHECK(s.impulses[0] == Approx(3 * (1 + e)).epsilon(1e-12));
    }
  }
}

TEST_CASE(
    "joints: ten copies of every joint give the same answer, and a tenth of the impulse each") {
  Parallelogram one(1, 0.4), ten(10, 0.4);
  for (Mechanism* m : {static_cast<Mechanism*>(&one), static_cast<Mechanism*>(&ten)}) m->fall(0.3);
  const JointSolution a = one.solve(), b = ten.solve();
  REQUIRE(a.contacts.status == tc::Status::solved);
  REQUIRE(b.contacts.status == tc::Status::solved);
  CHECK((a.impulses - b.impulses).norm() < 1e-11 * a.impulses.norm());
  for (std::size_t i = 0; i < a.velocities.size(); ++i)
    CHECK((a.velocities[i] - b.velocities[i]).norm() < 1e-11);
  const double size = a.joint_impulses.norm();
  int row = 0;
  for (int crank = 0; crank < 3; ++crank)
    for (int copy = 0; copy < 10; ++copy)
      for (int k = 0; k < 10; ++k, ++row)
        CHECK(std::abs(b.joint_impulses[row] - a.joint_impulses[10 * crank + k] / 10) <
              1e-8 * size);
}

TEST_CASE("joints: contradicting rates are named, other joints keep theirs") {
  Mechanism m;
  const int a = m.body(1, Matrix3d::Identity(), {0, 0, 0});
  const int b = m.body(1, Matrix3d::Identity(), {5, 0, 0});
  m.drive(b, kWorld, Vector3d::UnitX(), 3);  // joint 0: alone
  m.drive(a, kWorld, Vector3d::UnitX(), 1);  // joints 1 and 2
  m.drive(a, kWorld, Vector3d::UnitX(), 2);
  const JointSolution s = m.solve();
  CHECK(s.contradicting == std::vector<int>{1, 2});
  CHECK(s.velocities[1][0] == Approx(3));
  CHECK(s.velocities[0][0] == Approx(1.5));  // least squares
  // The same rate twice contradicts nothing.
  Mechanism same;
  same.body(1, Matrix3d::Identity(), {0, 0, 0});
  same.drive(0, kWorld, Vector3d::UnitX(), 2);
  same.drive(0, kWorld, Vector3d::UnitX(), 2);
  CHECK(same.solve().contradicting.empty());
}

TEST_CASE("joints: contacts whose normal velocity the joints hold are left out, or named") {
  for (const double rate : {-1.0, 0.0, 1.0}) {
    Mechanism m;
    const int driven = m.body(1, Matrix3d::Identity(), {0, 0, 0.5});
    const int free = m.body(1, Matrix3d::Identity(), {3, 0, 0.5});
    m.drive(driven, kWorld, Vector3d::UnitZ(), rate);
    m.touch(driven, kWorld, {0, 0, 0}, Vector3d::UnitZ(), 0.5);
    m.touch(free, kWorld, {3, 0, 0}, Vector3d::UnitZ(), 0.5);
    m.fall(1);
    const JointSolution s = m.solve();
    INFO("rate " << rate);
    CHECK(s.contacts.blocked == (rate < 0 ? std::vector<int>{0} : std::vector<int>{}));
    CHECK(s.contacts.status == (rate < 0 ? tc::Status::infeasible : tc::Status::solved));
    CHECK(s.velocities[0][2] == Approx(rate));
    CHECK(s.impulses.head<3>().norm() == 0);
    CHECK(s.impulses[3] == Approx(kGravity));
  }
}

TEST_CASE("joints: a driven plate drags what lies on it, and pays for it") {
  Mechanism m;
  const int plate = m.body(4, Matrix3d::Identity(), {0, 0, 0});
  const int block = m.body(2, Matrix3d::Identity(), {0, 0, 0.1});
  m.drive(plate, kWorld, Vector3d::UnitX(), 5);
  m.touch(block, plate, {0, 0, 0.1}, Vector3d::UnitZ(), 0.3);
  m.fall(1);
  const JointSolution s = m.solve();
  CHECK(s.contacts.status == tc::Status::solved);
  CHECK(s.velocities[0][0] == Approx(5));
  CHECK(s.velocities[1][0] == Approx(0.3 * kGravity));  // slides
  CHECK(std::abs(s.joint_impulses[0]) == Approx(4 * 5 + 0.3 * 2 * kGravity));
}

TEST_CASE("joints: random mechanisms, against dense elimination") {
  std::srand(7);
  for (int trial = 0; trial < 30; ++trial) {
    const double units = std::pow(10, trial % 3 * 8 - 8);  // of mass
    Mechanism m;
    const int n = 3 + trial % 6;
    const auto random = [] { return Vector3d(Vector3d::Random()); };
    for (int i = 0; i < n; ++i) {
      const Vector3d s = (random().cwiseAbs() + Vector3d::Ones()) * units;
      m.body(units * (1 + i), s.asDiagonal(), random() * 2);
      m.bodies.back().velocity = random();
      m.bodies.back().angular_velocity = random();
    }
    for (int i = 1; i < n; ++i) m.ball(i, i - 1 - (i % 3 == 2), m.centre[at(i)] + random());
    m.ball(0, n - 1, m.centre[0] + random());
    if (trial % 2) m.ball(0, n - 1, m.centre[0] + random());  // a second point: a hinge, redundant
    for (int i = 0; i < n; ++i)
      m.touch(i, i % 2 ? i - 1 : kWorld, m.centre[at(i)] + random(), random().normalized(),
              0.2 * i);
    const JointSolution s = m.solve();

    const int rows = m.rows.count(), contacts = static_cast<int>(m.contacts.size());
    Eigen::MatrixXd G = Eigen::MatrixXd::Zero(rows, 6 * n),
                    J = Eigen::MatrixXd::Zero(3 * contacts, 6 * n);
    Eigen::MatrixXd W = Eigen::MatrixXd::Zero(6 * n, 6 * n);
    Eigen::VectorXd v(6 * n), mu(contacts);
    for (int i = 0; i < n; ++i) {
      W.block<6, 6>(6 * i, 6 * i) = m.bodies[at(i)].inverse_mass_matrix();
      v.segment<6>(6 * i) = m.bodies[at(i)].velocities();
    }
    for (int r = 0; r < rows; ++r)
      for (const tc::JointRows::Term* t = m.rows.begin(r); t != m.rows.end(r); ++t)
        G.block<1, 6>(r, 6 * t->body) += t->G.transpose();
    for (int c = 0; c < contacts; ++c) {
      const tc::ContactRows& contact = m.contacts[at(c)];
      mu[c] = contact.mu;
      J.block<3, 6>(3 * c, 6 * contact.first) += contact.J1;
      if (contact.second >= 0) J.block<3, 6>(3 * c, 6 * contact.second) += contact.J2;
    }
    // W = C C', P = C (1 - Q Q') C', Q orthonormal in the rows of G C.
    const Eigen::MatrixXd C = W.llt().matrixL();
    const Eigen::MatrixXd GC = G * C;
    tether::linalg::PivotedQr pivots(1e-9);
    pivots.factor(GC.rowwise().normalized().transpose());
    const Eigen::MatrixXd Q = pivots.Q().leftCols(pivots.rank());
    const Eigen::MatrixXd project = Eigen::MatrixXd::Identity(6 * n, 6 * n) - Q * Q.transpose();
    const Eigen::MatrixXd P = C * project * C.transpose();
    const Eigen::VectorXd start = C * (project * C.inverse() * v);
    const Eigen::MatrixXd A = J * P * J.transpose();
    const tc::Problem problem = tc::Problem::dense((A + A.transpose()) / 2, -J * start, mu);
    const tc::Residuals r = tc::evaluate(problem, tc::Law::coulomb, s.impulses);
    INFO("trial " << trial << ", rank " << pivots.rank());
    CHECK((s.contacts.status == tc::Status::solved || s.contacts.status == tc::Status::round_off));
    CHECK(r.signorini < 1e-9);
    CHECK(r.cone < 1e-9);
    CHECK(r.alignment < 1e-9);
    CHECK(s.joint_error < 1e-12);
    const Eigen::VectorXd end = start + P * J.transpose() * s.impulses;
    for (int i = 0; i < n; ++i) CHECK((s.velocities[at(i)] - end.segment<6>(6 * i)).norm() < 1e-9);
    // The impulses of the joints and contacts make the change of velocity.
    const Eigen::VectorXd change =
        W * (G.transpose() * s.joint_impulses + J.transpose() * s.impulses) + v - end;
    CHECK(change.norm() < 1e-9);
  }
}

TEST_CASE("joints: bad rows are refused by name") {
  Mechanism m;
  m.body(1, Matrix3d::Identity(), {0, 0, 0});
  CHECK_THROWS_AS(m.rows.on(0, Vector6d::Ones()), std::invalid_argument);
  CHECK_THROWS_AS(m.rows.add(3, std::nan("")), std::invalid_argument);
  m.rows.add(3);
  CHECK_THROWS_AS(m.rows.on(0, Vector6d::Constant(INFINITY)), std::invalid_argument);
  CHECK_THROWS_WITH(m.solve(), "joint 3: row 0 is on no body that moves");
  m.rows.on(7, Vector6d::Ones());
  CHECK_THROWS_WITH(m.solve(), "joint 3: body = 7: must be one of 1");
}

// Tether: bad input is refused, naming the argument, its value and what would be right.
// SPDX-License-Identifier: BSD-3-Clause
#include <functional>
#include <limits>
#include <string>
#include <tether/contact.hpp>
#include <tether/contact/joint_laws.hpp>

#include "support/catch.hpp"
#include "support/comma_locale.hpp"

using namespace tether::contact;
using Catch::Contains;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

const double kNan = std::numeric_limits<double>::quiet_NaN();
const double kInfinity = std::numeric_limits<double>::infinity();

// Two contacts that can be solved.
struct Good {
  MatrixXd A = MatrixXd::Identity(6, 6);
  VectorXd b = VectorXd::Ones(6), mu = VectorXd::Constant(2, 0.5);
  Problem problem() const { return Problem::dense(A, b, mu); }
};

// The message of what is refused; empty: it was not.
template <class Call>
std::string refusal(const Call& call) {
  try {
    call();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return {};
}

template <class Change>
std::string refused_problem(const Change& change) {
  Good good;
  change(good);
  return refusal([&] { good.problem(); });
}

}  // namespace

TEST_CASE("bad input: sizes of a problem") {
  CHECK(refusal([] { Good().problem(); }).empty());
  CHECK_THAT(refused_problem([](Good& p) { p.b = VectorXd::Ones(5); }),
             Contains("b has 5 entries") && Contains("2 friction coefficients"));
  CHECK_THAT(refused_problem([](Good& p) { p.b = VectorXd::Ones(600); }),
             Contains("b has 600 entries"));
  CHECK_THAT(refused_problem([](Good& p) { p.b.resize(0); }), Contains("b has 0 entries"));
  CHECK_THAT(refused_problem([](Good& p) { p.A = MatrixXd::Identity(5, 6); }),
             Contains("A is 5 x 6") && Contains("6 x 6"));
  CHECK_THAT(refused_problem([](Good& p) { p.A = MatrixXd::Identity(9, 9); }),
             Contains("A is 9 x 9") && Contains("6 x 6"));
  CHECK_THAT(refused_problem([](Good& p) { p.A.resize(0, 0); }), Contains("A is 0 x 0"));
}

TEST_CASE("bad input: values of a problem") {
  for (double bad : {kNan, kInfinity, -kInfinity}) {
    CHECK_THAT(refused_problem([&](Good& p) { p.A(0, 4) = bad; }),
               Contains("A(0, 4) = ") && Contains("must be finite"));
    CHECK_THAT(refused_problem([&](Good& p) { p.b[3] = bad; }),
               Contains("b(3) = ") && Contains("must be finite"));
    CHECK_THAT(refused_problem([&](Good& p) { p.mu[1] = bad; }),
               Contains("contact 1: mu = ") && Contains("must be finite and >= 0"));
  }
  CHECK_THAT(refused_problem([](Good& p) { p.mu[0] = -0.1; }),
             Contains("contact 0: mu = -0.1") && Contains(">= 0"));
  // No effective mass, a tangential block that is not semidefinite, and zero blocks.
  CHECK_THAT(refused_problem([](Good& p) { p.A(3, 3) = 0; }),
             Contains("contact 1: A_nn = 0") && Contains("must be > 0"));
  CHECK_THAT(refused_problem([](Good& p) { p.A(3, 3) = -2; }), Contains("contact 1: A_nn = -2"));
  CHECK_THAT(refused_problem([](Good& p) { p.A(4, 4) = -1; }),
             Contains("contact 1") && Contains("= -1") && Contains("positive semidefinite"));
  CHECK_THAT(refused_problem([](Good& p) { p.A.setZero(); }), Contains("contact 0: A_nn = 0"));
  // Finite entries whose sums are not.
  CHECK_THAT(refused_problem([](Good& p) { p.A *= 1e308; }), Contains("trace of A = inf"));
}

TEST_CASE("bad input: blocks of a problem") {
  const Good good;
  const Matrix3d I = Matrix3d::Identity();
  const auto refused = [&](int dimension, std::vector<MatrixBlock> blocks) {
    return refusal([&] { Problem::sparse(dimension, std::move(blocks), good.b, good.mu); });
  };
  CHECK(refused(3, {{0, 0, I}, {1, 1, I}}).empty());
  CHECK_THAT(refused(4, {}), Contains("dimension = 4") && Contains("2 or 3"));
  CHECK_THAT(refused(2, {}), Contains("b has 6 entries: 4 are needed"));
  CHECK_THAT(refused(3, {}), Contains("contact 0: A_nn = 0"));
  CHECK_THAT(refused(3, {{0, 0, I}}), Contains("contact 1: A_nn = 0"));
  CHECK_THAT(refused(3, {{0, 0, I}, {1, 1, Matrix3d::Zero()}}), Contains("contact 1: A_nn = 0"));
  for (const MatrixBlock& outside :
       {MatrixBlock{0, 2, I}, MatrixBlock{-1, 0, I}, MatrixBlock{2147483647, 0, I}})
    CHECK_THAT(refused(3, {{0, 0, I}, {1, 1, I}, outside}),
               Contains("block (") && Contains("must lie in 0 .. 1"));
  Matrix3d bad = I;
  bad(2, 1) = kNan;
  CHECK_THAT(refused(3, {{0, 0, I}, {1, 1, bad}}), Contains("block (1, 1): A(2, 1) = "));
  const Matrix3d large = 1e308 * I;
  CHECK_THAT(refused(3, {{0, 0, I}, {1, 1, I}, {0, 1, large}, {0, 1, large}}),
             Contains("block (0, 1): sum of blocks(0, 0) = inf"));
}

TEST_CASE("bad input: starts and answers") {
  const Problem p = Good().problem();
  VectorXd start = VectorXd::Zero(6);
  start[4] = kNan;
  CHECK_THAT(refusal([&] { Solver().solve(p, start); }), Contains("start(4) = "));
  for (int size : {0, 5, 7})
    CHECK_THAT(refusal([&] { Solver().solve(p, VectorXd::Zero(size)); }),
               Contains("start has " + std::to_string(size) + " entries: 6 are needed"));
  for (int size : {0, 5, 7})
    CHECK_THAT(refusal([&] { evaluate(p, Law::coulomb, VectorXd::Zero(size)); }),
               Contains("impulses has " + std::to_string(size) + " entries: 6 are needed"));
  // Any answer is judged; of one that is not finite no residual may look small.
  const Residuals r = evaluate(p, Law::coulomb, start);
  for (double each :
       {r.signorini, r.cone, r.alignment, r.dissipation, r.fixed_point, r.natural_map})
    CHECK(each != each);
  // A refusal leaves the solver usable.
  Solver solver;
  CHECK_THROWS_AS(solver.solve(p, start), std::invalid_argument);
  CHECK(solver.solve(p).status == Status::solved);
}

TEST_CASE("bad input: options of the solver") {
  const auto refused = [](auto change) {
    Options o;
    change(o);
    return refusal([&] { Solver solver(o); });
  };
  for (double bad : {0.0, -1e-9, kNan, kInfinity})
    CHECK_THAT(refused([&](Options& o) { o.tolerance = bad; }),
               Contains("tolerance = ") && Contains("must be finite and > 0"));
  for (double bad : {0.0, -1.0, kNan})
    CHECK_THAT(refused([&](Options& o) { o.max_work = bad; }), Contains("max_work = "));
}

TEST_CASE("bad input: one contact") {
  const Matrix3d I = Matrix3d::Identity();
  Matrix3d bad = I;
  bad(1, 2) = kNan;
  CHECK_THAT(refusal([&] { LocalBlock(bad, 0.5); }), Contains("A(1, 2) = "));
  CHECK_THAT(refusal([&] { LocalBlock(-I, 0.5); }), Contains("A_nn = -1"));
  CHECK_THAT(refusal([&] { LocalBlock(I, -1); }), Contains("mu = -1"));
  CHECK_THAT(refusal([&] { LocalBlock(Matrix3d::Zero(), 1); }), Contains("A_nn = 0"));
  for (double value : {kNan, kInfinity}) {
    CHECK_THAT(refusal([&] { LocalBlock(I, value); }), Contains("mu = "));
    const Vector3d q(1, value, 0);
    CHECK_THAT(refusal([&] { solve_one(Law::coulomb, I, q, 1); }), Contains("b(1) = "));
  }
}

TEST_CASE("bad input: bodies that are assembled") {
  RigidBody body;
  body.inverse_mass = 1;
  body.inverse_inertia.setIdentity();
  const std::vector<RigidBody> bodies(2, body);
  const auto touch = [] {
    return ContactRows::at_point(0, 1, {0, 0, -1}, {0, 0, 1}, Vector3d::UnitZ(), 0.5);
  };
  const auto refused = [&](auto change) {
    std::vector<RigidBody> b = bodies;
    std::vector<ContactRows> c{touch()};
    change(b, c);
    return refusal([&] { delassus(b, c); });
  };
  using B = std::vector<RigidBody>;
  using C = std::vector<ContactRows>;
  CHECK(refused([](B&, C&) {}).empty());
  CHECK_THAT(refused([](B& b, C&) { b[1].inverse_inertia(0, 2) = kNan; }),
             Contains("body 1: inverse_inertia(0, 2) = "));
  CHECK_THAT(refused([](B& b, C&) { b[0].angular_velocity[2] = kInfinity; }),
             Contains("body 0: angular_velocity(2) = inf"));
  CHECK_THAT(refused([](B&, C& c) { c[0].J2(1, 3) = kNan; }), Contains("contact 0: J2(1, 3) = "));
  CHECK_THAT(refused([](B&, C& c) { c[0].bias[0] = kNan; }), Contains("contact 0: bias(0) = "));
  CHECK_THAT(refused([](B&, C& c) { c[0].mu = -1; }), Contains("contact 0: mu = -1"));
  for (int other : {2, -2, 0})
    CHECK_THAT(refused([&](B&, C& c) { c[0].second = other; }),
               Contains("contact 0 names bodies 0 and " + std::to_string(other)));
  CHECK_THAT(refused([](B&, C& c) { c[0].first = -1; }), Contains("must be two of 2"));
  CHECK_THAT(refused([](B& b, C&) { b[1].inverse_inertia(1, 0) = 0.1; }),
             Contains("body 1: inverse_inertia(1, 0) = 0.1") && Contains("symmetric"));
  CHECK_THAT(refused([](B& b, C&) { b[0].inverse_inertia(2, 2) = -2; }),
             Contains("body 0: least eigenvalue of inverse_inertia = -2") && Contains(">= 0"));
  // Between fixed bodies nothing moves.
  CHECK_THAT(refused([](B& b, C&) { b[0] = b[1] = RigidBody(); }), Contains("contact 0: A_nn = 0"));
  const auto at = [](const Vector3d& r1, const Vector3d& r2, const Vector3d& n) {
    return refusal([&] { ContactRows::at_point(0, 1, r1, r2, n, 0.5); });
  };
  const Vector3d n = Vector3d::UnitZ(), zero = Vector3d::Zero(), bad(0, kNan, 0);
  CHECK_THAT(at(zero, zero, 2 * n), Contains("length of normal = 2") && Contains("must be 1"));
  CHECK_THAT(at(zero, zero, zero), Contains("length of normal = 0"));
  CHECK_THAT(at(zero, zero, bad), Contains("length of normal = "));
  CHECK_THAT(at(bad, zero, n), Contains("r1(1) = "));
  CHECK_THAT(at(zero, bad, n), Contains("r2(1) = "));
  const VectorXd two = VectorXd::Zero(2);  // GCC 12 calls the copy of an expression an overflow
  CHECK_THAT(refusal([&] { velocities_after(bodies, {touch()}, two); }),
             Contains("impulses has 2 entries: 3 are needed"));
  CHECK_THAT(refusal([&] { velocities_after(bodies, {touch()}, bad); }),
             Contains("impulses(1) = "));
}

TEST_CASE("bad input: body form") {
  RigidBody body;
  body.inverse_mass = 1;
  body.inverse_inertia.setIdentity();
  PointContact contact;
  contact.r1 = {0, 0, -1};
  contact.mu = 0.5;
  using B = std::vector<RigidBody>;
  using C = std::vector<PointContact>;
  const auto refused = [&](auto change) {
    B b{body, body};
    C c{contact};
    change(b, c);
    const std::string message = refusal([&] { BodySolver().solve(b, c); });
    // The yardstick reads the same input; only contacts between fixed bodies are its block's
    // affair.
    if (message.find("fixed bodies") == std::string::npos)
      CHECK(refusal([&] { evaluate(b, c, Law::coulomb, {Vector3d::Zero()}); }) == message);
    return message;
  };
  CHECK(refused([](B&, C&) {}).empty());
  CHECK_THAT(refused([](B& b, C&) { b[1].inverse_mass = -1; }),
             Contains("body 1: inverse_mass = -1") && Contains(">= 0"));
  CHECK_THAT(refused([](B& b, C&) { b[1].inverse_inertia(2, 0) = 0.3; }),
             Contains("body 1: inverse_inertia(2, 0) = 0.3") && Contains("symmetric"));
  for (double scale : {1e-150, 1.0, 1e150}) {
    CHECK_THAT(refused([&](B& b, C&) {
                 b[0].inverse_inertia << 1, 3, 0, 3, 1, 0, 0, 0, 1;
                 b[0].inverse_inertia *= scale;
               }),
               Contains("body 0: least eigenvalue of inverse_inertia = -2") && Contains(">= 0"));
    CHECK(refused([&](B& b, C&) {  // a rod does not turn about its axis
            b[0].inverse_inertia = scale * Vector3d(1, 1, 0).asDiagonal().toDenseMatrix();
          })
              .empty());
  }
  for (double bad : {kNan, kInfinity}) {
    CHECK_THAT(refused([&](B& b, C&) { b[0].inverse_mass = bad; }),
               Contains("body 0: inverse_mass = "));
    CHECK_THAT(refused([&](B& b, C&) { b[0].inverse_inertia(1, 2) = bad; }),
               Contains("body 0: inverse_inertia(1, 2) = "));
    CHECK_THAT(refused([&](B& b, C&) { b[0].velocity[1] = bad; }),
               Contains("body 0: velocity(1) = "));
    CHECK_THAT(refused([&](B& b, C&) { b[1].angular_velocity[2] = bad; }),
               Contains("body 1: angular_velocity(2) = "));
    CHECK_THAT(refused([&](B&, C& c) { c[0].r1[0] = bad; }), Contains("contact 0: r1(0) = "));
    CHECK_THAT(refused([](B&, C& c) { c[0].r1[0] = 1e200; }), Contains("contact 0: square of r1"));
    CHECK_THAT(refused([&](B&, C& c) { c[0].r2[2] = bad; }), Contains("contact 0: r2(2) = "));
    CHECK_THAT(refused([&](B&, C& c) { c[0].mu = bad; }), Contains("contact 0: mu = "));
    CHECK_THAT(refused([&](B&, C& c) { c[0].bias = bad; }), Contains("contact 0: bias = "));
    CHECK_THAT(refused([&](B&, C& c) { c[0].normal[0] = bad; }),
               Contains("contact 0: length of normal = "));
  }
  CHECK_THAT(refused([](B&, C& c) { c[0].mu = -0.5; }), Contains("contact 0: mu = -0.5"));
  CHECK_THAT(refused([](B&, C& c) { c[0].normal *= 2; }),
             Contains("length of normal = 2") && Contains("must be 1"));
  for (int bad : {-1, 2, 99})
    CHECK_THAT(refused([&](B&, C& c) { c[0].first = bad; }),
               Contains("contact 0: first = " + std::to_string(bad)) && Contains("2 bodies"));
  for (int bad : {-2, 0, 2})
    CHECK_THAT(refused([&](B&, C& c) { c[0].second = bad; }),
               Contains("contact 0: second = " + std::to_string(bad)) && Contains("-1"));
  CHECK_THAT(refused([](B& b, C&) { b[0] = RigidBody(); }),
             Contains("contact 0 joins fixed bodies") && Contains("must be able to move"));
  CHECK_THAT(refusal([&] { evaluate(B{body}, C{contact}, Law::coulomb, {}); }),
             Contains("impulses has 0 entries: 1 are needed"));
  const Residuals r = evaluate(B{body}, C{contact}, Law::coulomb, {Vector3d(0, 0, kNan)});
  CHECK(r.signorini != r.signorini);
  CHECK(r.natural_map != r.natural_map);
}

TEST_CASE("bad input: options of the body form") {
  const auto refused = [](auto change) {
    BodyOptions o;
    change(o);
    const std::string message = refusal([&] { BodySolver solver(o); });
    BodySolver solver;
    CHECK(refusal([&] { solver.set_options(o); }) == message);
    return message;
  };
  for (double bad : {0.0, -1.0, kNan, kInfinity})
    CHECK_THAT(refused([&](BodyOptions& o) { o.tolerance = bad; }), Contains("tolerance = "));
  CHECK_THAT(refused([](BodyOptions& o) { o.max_sweeps = 0; }), Contains("max_sweeps = 0"));
  CHECK_THAT(refused([](BodyOptions& o) { o.min_sweeps = -1; }), Contains("min_sweeps = -1"));
  for (int bad : {0, 257})
    CHECK_THAT(refused([&](BodyOptions& o) { o.threads = bad; }),
               Contains("threads = " + std::to_string(bad)) && Contains("1 .. 256"));
  CHECK_THAT(refused([](BodyOptions& o) { o.max_assembled = -1; }), Contains("max_assembled = -1"));
  CHECK_THAT(refused([](BodyOptions& o) { o.max_work = kNan; }), Contains("max_work = "));
  BodySolver solver;
  for (double bad : {-1.0, kNan, kInfinity})
    CHECK_THAT(refusal([&] { solver.scale_warm_start(bad); }),
               Contains("factor = ") && Contains("must be finite and >= 0"));
}

TEST_CASE("nothing to do is done") {
  const Problem none = Problem::dense(MatrixXd(0, 0), VectorXd(0), VectorXd(0));
  const Solution s = Solver().solve(none);
  CHECK(s.status == Status::solved);
  CHECK(s.impulses.size() == 0);
  CHECK(Solution().status == Status::unsolved);
  const Problem rest =
      Problem::dense(MatrixXd::Identity(3, 3), VectorXd::Zero(3), VectorXd::Ones(1));
  CHECK(Solver().solve(rest).impulses.isZero(0));
  CHECK(BodySolver().solve({}, {}).status == Status::solved);
}

TEST_CASE("bad input: the same words in a host whose numbers have a comma") {
  const auto said = [] {
    JointRows rows;
    JointLaws laws;
    return refused_problem([](Good& p) { p.mu[0] = -0.125; }) + "\n" +
           refusal([&] { rows.add(12345, INFINITY); }) + "\n" +
           refusal([&] { laws.add_bounded(2, 0, -0.25); }) + "\n" +
           refusal([&] { laws.add_sprung(3, 0, -0.5, 1, 0, 1); }) + "\n" +
           refusal([&] { laws.add_sprung(4, 0, 0, 0, 0, 1); });
  };
  const std::string plain = said();
  for (const char* part : {"mu = -0.125", "joint 12345: rate = inf:", "joint 2: bound = -0.25:",
                           "joint 3: stiffness = -0.5:", "joint 4: damping = 0:"})
    CHECK_THAT(plain, Contains(part));
  const tether::test::CommaLocale here;
  CHECK(said() == plain);
}

TEST_CASE("bad input: enumerations out of range, and vectors that are too short for a problem") {
  Options o;
  o.measure = static_cast<Measure>(99);
  CHECK_THROWS_AS(Solver(o), std::invalid_argument);
  o = Options();
  o.law = static_cast<Law>(99);
  CHECK_THROWS_AS(Solver(o), std::invalid_argument);
  BodyOptions b;
  b.law = static_cast<Law>(99);
  CHECK_THROWS_AS(BodySolver(b), std::invalid_argument);
  const Problem p = Problem::dense(Eigen::MatrixXd::Identity(6, 6), Eigen::VectorXd::Ones(6),
                                   Eigen::VectorXd::Ones(2));
  tether::linalg::VectorX x;
  CHECK_THROWS_AS(p.rescaled({}, {}), std::invalid_argument);
  CHECK_THROWS_AS(p.rescaled({0, 0}, {0}), std::invalid_argument);
  CHECK_THROWS_AS(p.unpack({}, x), std::invalid_argument);
}

namespace {

Stepper one_body(const SteppingOptions& options = {}) {
  BodySet bodies;
  bodies.add(1, Matrix3d::Identity(), Vector3d::Zero());
  return Stepper(bodies, {}, {}, options);
}

std::string refused_option(const std::function<void(SteppingOptions&)>& change) {
  SteppingOptions options;
  change(options);
  return refusal([&] { one_body(options); });
}

}  // namespace

TEST_CASE("bad input: options of steps, with their values") {
  CHECK(refused_option([](SteppingOptions&) {}).empty());
  CHECK(refused_option([](SteppingOptions& o) { o.step = -2; }) ==
        "stepping: step = -2: must be > 0 and finite");
  CHECK(refused_option([](SteppingOptions& o) { o.near_part = kNan; }) ==
        "stepping: near_part = nan: must be >= 0");
  CHECK(refused_option([](SteppingOptions& o) { o.max_halvings = 31; }) ==
        "stepping: max_halvings = 31: must lie in 0 .. 30");
  CHECK_THAT(refused_option([](SteppingOptions& o) { o.gravity = Vector3d(0, kNan, 0); }),
             Contains("stepping: gravity(1) = nan"));
}

TEST_CASE("bad input: enumerators of steps that are none") {
  for (const int k : {4, 99, 255}) {
    CHECK_THAT(refused_option([k](SteppingOptions& o) { o.law = static_cast<Law>(k); }),
               Contains("law = " + std::to_string(k)));
    CHECK_THAT(
        refused_option([k](SteppingOptions& o) { o.gyroscopic = static_cast<Gyroscopic>(k); }),
        Contains("gyroscopic = " + std::to_string(k)));
    CHECK_THAT(refused_option(
                   [k](SteppingOptions& o) { o.restitution_law = static_cast<RestitutionLaw>(k); }),
               Contains("restitution_law = " + std::to_string(k)));
    CHECK_THAT(refused_option([k](SteppingOptions& o) {
                 o.simultaneous_impacts = static_cast<SimultaneousImpacts>(k);
               }),
               Contains("simultaneous_impacts = " + std::to_string(k)));
  }
}

TEST_CASE("bad input: what a Stepper is told") {
  Stepper stepper = one_body();
  CHECK_THAT(refusal([&] { stepper.add_force("none", {}); }), Contains("force is empty"));
  CHECK_THAT(refusal([&] { stepper.observe({}); }), Contains("observer is empty"));
  CHECK_THAT(refusal([&] { stepper.start_anew(-1); }), Contains("steps = -1: must be >= 0"));
  stepper.step();
  stepper.bodies().motion.clear();
  CHECK_THAT(refusal([&] { stepper.step(); }), Contains("motion has 0 entries: 1 are needed"));
}

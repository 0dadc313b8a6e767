// Smooth scenes of many bodies. SPDX-License-Identifier: BSD-3-Clause
#include <nvector/nvector_serial.h>
#include <sunmatrix/sunmatrix_sparse.h>

#include <algorithm>
#include <cmath>

#include "smooth/newton_matrix.hpp"
#include "smooth/system.hpp"
#include "smooth_runs.hpp"
#include "sundials/quiet_context.hpp"

using namespace tether::scene;
using namespace mechanisms;

namespace {

/// Rods of 1 m on ball joints, in a line along x from (0, y, 0), at rest; every third one is
/// hinged.
void add_chain(Scene& s, int links, double y) {
  const int first = static_cast<int>(s.bodies.size());
  for (int i = 0; i < links; ++i) {
    s.bodies.push_back(rod("rod " + std::to_string(first + i), {double(i), y, 0}, {i + 1.0, y, 0}));
    Joint j = joint(i % 3 == 2 ? JointKind::hinge : JointKind::ball, i ? first + i - 1 : kWorld,
                    first + i, {double(i), y, 0});
    j.axis = Vector3d(0, 1, 0);
    s.joints.push_back(j);
  }
}

Scene chains(int links, int chains, double tolerance) {
  Scene s = scene(tolerance);
  s.gravity = Vector3d(0, 0, -kGravity);
  for (int i = 0; i < chains; ++i) add_chain(s, links, i);
  return s;
}

/// n x n balls on a curved surface, on rods along the lattice and, if `braced`, both diagonals of
/// its cells; two corners are joined to the world. Lengths in units of `unit`.
Scene net(int n, bool braced, double tolerance, double unit = 1) {
  Scene s = scene(tolerance);
  s.gravity = Vector3d(0, 0, -kGravity * unit);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      s.bodies.push_back(ball("ball " + std::to_string(n * i + j),
                              unit * Vector3d(i, j, 0.2 * i * i - 0.1 * j * j + 0.1 * i * j) / n, 1,
                              0.01 * unit * unit));
  const auto link = [&](int a, int b) {
    s.joints.push_back(joint(JointKind::distance, a, b, s.bodies[std::size_t(a)].position,
                             s.bodies[std::size_t(b)].position));
  };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const int here = n * i + j;
      if (i + 1 < n) link(here, here + n);
      if (j + 1 < n) link(here, here + 1);
      if (!braced || i + 1 == n || j + 1 == n) continue;
      link(here, here + n + 1);
      link(here + 1, here + n);
    }
  for (const int corner : {0, n - 1})
    s.joints.push_back(
        joint(JointKind::ball, corner, kWorld, s.bodies[std::size_t(corner)].position));
  return s;
}

/// Entries of L and U for these of a matrix, with pivots on the diagonal in this order.
long entries_of_factors(const std::vector<std::pair<int, int>>& places,
                        const std::vector<int>& order) {
  const std::size_t n = order.size();
  std::vector<std::size_t> when(n);
  for (std::size_t k = 0; k < n; ++k) when[std::size_t(order[k])] = k;
  std::vector<std::vector<char>> entry(n, std::vector<char>(n, 0));
  for (const auto& [row, column] : places)
    entry[when[std::size_t(row)]][when[std::size_t(column)]] = 1;
  for (std::size_t k = 0; k < n; ++k)
    for (std::size_t i = k + 1; i < n; ++i)
      if (entry[i][k])
        for (std::size_t j = k + 1; j < n; ++j) entry[i][j] |= entry[k][j];
  long count = 0;
  for (const auto& row : entry) count += std::count(row.begin(), row.end(), char(1));
  return count;
}

/// The scene turned by Q, its bodies and joints in the opposite order.
Scene turned_and_reversed(const Scene& from, const Eigen::Quaterniond& Q) {
  Scene s = from;
  s.gravity = Q * *s.gravity;
  const int last = static_cast<int>(s.bodies.size()) - 1;
  std::reverse(s.bodies.begin(), s.bodies.end());
  std::reverse(s.joints.begin(), s.joints.end());
  for (Body& body : s.bodies) {
    body.position = Q * body.position;
    body.orientation = Q * body.orientation;
    body.velocity = Q * body.velocity;
    body.angular_velocity = Q * body.angular_velocity;
  }
  for (Joint& each : s.joints) {
    if (each.first != kWorld) each.first = last - each.first;
    if (each.second != kWorld) each.second = last - each.second;
    each.at = Q * each.at;
    each.at_second = Q * each.at_second;
    each.axis = Q * each.axis;
  }
  return s;
}

}  // namespace

TEST_CASE("many joints move as few do: one chain beside nine others", "[smooth]") {
  // Alone its rows are dense, with the others sparse.
  const double tolerance = 1e-8;
  const Scene alone = chains(6, 1, tolerance), among = chains(6, 10, tolerance);
  const auto one = make_smooth_engine(alone), many = make_smooth_engine(among);
  for (const double t : {0.1, 0.4}) {
    one->advance(t);
    many->advance(t);
    for (std::size_t k = 0; k < 60; ++k) {
      const BodyState &a = one->bodies()[k % 6], &b = many->bodies()[k];
      INFO("t = " << t << ", body " << k);
      CHECK((a.position - b.position + Vector3d(0, double(k / 6), 0)).norm() < 1e-6);
      CHECK((a.velocity - b.velocity).norm() < 1e-5);
      CHECK((a.angular_velocity - b.angular_velocity).norm() < 1e-5);
    }
  }
  CHECK(many->diagnostics().drift < 1e-10);
  CHECK(many->counts().steps < 1.5 * double(one->counts().steps));
}

TEST_CASE("the sparse matrix has what the assembly writes but for what is zero everywhere",
          "[smooth]") {
  // A ball joint's force does not turn with its bodies: of 385 entries written for a link 128 are
  // ever not zero. The start, level and at rest, shows fewer.
  constexpr int kLinks = 20;
  Scene s = scene(1e-6);
  s.gravity = Vector3d(0, 0, -kGravity);
  for (int i = 0; i < kLinks; ++i) {
    s.bodies.push_back(rod("rod " + std::to_string(i), {double(i), 0, 0}, {i + 1.0, 0, 0}));
    s.joints.push_back(joint(JointKind::ball, i ? i - 1 : kWorld, i, {double(i), 0, 0}));
  }
  smooth::System system(s);
  QuietContext context;
  Eigen::VectorXd y = system.start_state(), yp;
  system.complete(0.0, y, yp);
  system.choose_rows(0.0, y.data(), 1e-8);
  N_Vector at = N_VMake_Serial(system.size(), y.data(), context);
  N_Vector rate = N_VMake_Serial(system.size(), yp.data(), context);
  {
    smooth::NewtonMatrix matrix(system, 0.0, at, rate, context);
    REQUIRE(SUNMatGetID(matrix.matrix()) == SUNMATRIX_SPARSE);
    CHECK(SUNSparseMatrix_NNZ(matrix.matrix()) < 130 * kLinks);
    for (int look = 0; look < 3; ++look) {
      INFO("state " << look);
      matrix.fill(0.1, 3.0, at, rate, matrix.matrix());
      mechanics::Entries all;
      all.record();
      system.jacobian(0.1, 3.0, y.data(), yp.data(), all);
      std::vector<int> slots;
      for (const auto& [row, column] : all.places) slots.push_back(row + system.size() * column);
      Eigen::MatrixXd wanted = Eigen::MatrixXd::Zero(system.size(), system.size());
      all.finish(slots);
      all.begin(wanted.data());
      system.jacobian(0.1, 3.0, y.data(), yp.data(), all);
      Eigen::MatrixXd found = Eigen::MatrixXd::Zero(system.size(), system.size());
      const sunindextype* starts = SUNSparseMatrix_IndexPointers(matrix.matrix());
      for (int column = 0; column < system.size(); ++column)
        for (auto e = starts[column]; e < starts[column + 1]; ++e)
          found(SUNSparseMatrix_IndexValues(matrix.matrix())[e], column) +=
              SUNSparseMatrix_Data(matrix.matrix())[e];
      CHECK((found - wanted).cwiseAbs().maxCoeff() <= 1e-14 * wanted.cwiseAbs().maxCoeff());
      y += 0.1 * Eigen::VectorXd::Random(system.size());
      yp += 0.1 * Eigen::VectorXd::Random(system.size());
    }
  }
  N_VDestroy(at);
  N_VDestroy(rate);
}

TEST_CASE("a chain of 300 links keeps its joints and its energy", "[smooth]") {
  // Dense rows would cost the cube of the links.
  Scene s = chains(300, 1, 1e-6);
  keep_energy(s);
  const auto engine = make_smooth_engine(s);
  const double energy =
      engine->diagnostics().kinetic_energy + engine->diagnostics().potential_energy;
  engine->advance(0.3);
  const Diagnostics d = engine->diagnostics();
  CHECK(d.drift < 1e-10);
  CHECK(d.kinetic_energy > 1);
  CHECK(std::abs(d.kinetic_energy + d.potential_energy - energy) < 1e-6 * d.kinetic_energy);
  // The far end falls freely, the first rod turns about its joint.
  CHECK(engine->bodies()[290].position.z() < engine->bodies()[0].position.z());
  CHECK(engine->counts().steps < 400);
}

TEST_CASE("closed loops by entries move as dense ones do: three rows of four-bars", "[smooth]") {
  // Alone 35 rows, three times that are chosen by their entries; rank drops at t = 0.714.
  const double tolerance = 1e-7;
  const Scene alone = four_bar(2, tolerance);
  Scene among = alone;
  const int bodies = static_cast<int>(alone.bodies.size());
  for (int copy = 1; copy < 3; ++copy) {
    const Vector3d aside(0, 0, copy);
    for (Body body : alone.bodies) {
      body.name += " of copy " + std::to_string(copy);
      body.position += aside;
      among.bodies.push_back(body);
    }
    for (Joint each : alone.joints) {
      if (each.first != kWorld) each.first += copy * bodies;
      if (each.second != kWorld) each.second += copy * bodies;
      each.name += " of copy " + std::to_string(copy);
      each.at += aside;
      among.joints.push_back(each);
    }
  }
  const auto one = make_smooth_engine(alone), many = make_smooth_engine(among);
  for (const double t : {0.5, 1.0}) {
    one->advance(t);
    many->advance(t);
    for (std::size_t k = 0; k < among.bodies.size(); ++k) {
      const BodyState &a = one->bodies()[k % std::size_t(bodies)], &b = many->bodies()[k];
      const Vector3d aside(0, 0, double(k / std::size_t(bodies)));
      INFO("t = " << t << ", body " << k);
      CHECK((a.position - b.position + aside).norm() < 1e-6);
      CHECK((a.velocity - b.velocity).norm() < 1e-5);
    }
  }
  const Vector3d top = end_of(*many, 0);
  CHECK(in_plane(top, -0.195020301949435, -0.980799205662174) < 1e-6);
  CHECK(many->diagnostics().drift < 1e-9);
  CHECK(many->counts().steps < 1.5 * double(one->counts().steps));
}

TEST_CASE("forty four-bars pass the point where forty rows become dependent", "[smooth]") {
  // Near it the rounding of joints 40 m away, over their sine, is beyond the finer tolerances.
  const double tolerance = GENERATE(1e-6, 1e-7, 5e-9, 3e-9);
  INFO("tolerance " << tolerance);
  const auto engine = make_smooth_engine(four_bar(40, tolerance));
  engine->advance(1.0);
  CHECK(in_plane(end_of(*engine, 0), -0.115356880632110, -0.993324111300450) < 10 * tolerance);
  CHECK(std::abs(energy(*engine) - 620.338333333333) < 1e-9 * 620);
  CHECK(engine->diagnostics().drift < 2e-9);
  CHECK(engine->counts().steps < 400 * std::pow(1e-6 / tolerance, 0.2));
}

TEST_CASE("coordinates are eliminated before velocities: a quarter less in the factors of a net",
          "[smooth]") {
  smooth::System system(net(10, false, 1e-6));
  const int moving = system.moving(), width = smooth::kBody, coordinates = smooth::kVelocity;
  Eigen::VectorXd y = system.start_state(), yp;
  system.complete(0, y, yp);
  smooth::Entries entries;
  entries.record();
  system.jacobian(0, 1, y.data(), yp.data(), entries);
  const auto factors = [&](int first) {
    return entries_of_factors(
        entries.places,
        smooth::elimination_order(system.size(), moving, width, first, entries.places));
  };
  const long together = factors(0), apart = factors(coordinates);
  INFO("entries: " << together << " body by body, " << apart << " coordinates first");
  CHECK(apart < 0.75 * double(together));
}

TEST_CASE("a net moves the same way turned, renumbered and in other units", "[smooth]") {
  const double tolerance = 1e-6, end = 0.2;
  const int n = 6;
  const auto plain = make_smooth_engine(net(n, false, tolerance));
  plain->advance(end);
  CHECK(plain->diagnostics().drift < 1e-10);
  CHECK(plain->counts().steps < 400);
  SECTION("turned and renumbered") {
    const Eigen::Quaterniond Q(Eigen::AngleAxisd(1.0, Vector3d(1, 2, 3).normalized()));
    const auto other = make_smooth_engine(turned_and_reversed(net(n, false, tolerance), Q));
    other->advance(end);
    for (std::size_t k = 0; k < n * n; ++k)
      CHECK((Q * plain->bodies()[k].position - other->bodies()[n * n - 1 - k].position).norm() <
            10 * tolerance);
  }
  for (const double unit : {1e-6, 1e6}) {
    SECTION("in units of " + std::to_string(unit)) {
      const auto other = make_smooth_engine(net(n, false, tolerance, unit));
      other->advance(end);
      for (std::size_t k = 0; k < n * n; ++k)
        CHECK((plain->bodies()[k].position - other->bodies()[k].position / unit).norm() <
              10 * tolerance);
    }
  }
}

TEST_CASE("a braced net, rigid by rows thinner than 1e-3, swings as one body", "[smooth]") {
  // Singular values from 5e-5 on, many rows that depend on others by coefficients of 1e3. Rows that
  // are left out let joints drift by 1e-3 at once, rows too many stall the run.
  const int n = 14;
  const auto engine = make_smooth_engine(net(n, true, 1e-6));
  const auto apart = [&](int a, int b) {
    return (engine->bodies()[std::size_t(a)].position - engine->bodies()[std::size_t(b)].position)
        .norm();
  };
  const double corners = apart(0, n * n - 1), sides = apart(n / 2, n * n - n / 2);
  const double before = energy(*engine);
  engine->advance(0.5);
  CHECK(engine->diagnostics().drift < 5e-9);
  CHECK(std::abs(apart(0, n * n - 1) - corners) < 1e-6);
  CHECK(std::abs(apart(n / 2, n * n - n / 2) - sides) < 1e-6);
  CHECK(engine->bodies()[n * n - 1].position.z() < 2.25);
  CHECK(std::abs(energy(*engine) - before) < 1e-6 * before);
  CHECK(engine->counts().steps < 150);
}

TEST_CASE("a braced net has rows too thin for the factors of A A^T", "[smooth]") {
  // Singular values to about 2e-6. Seven rows of 2699 are found by what they forbid the others'
  // velocities; with one too few no step succeeds.
  const auto engine = make_smooth_engine(net(30, true, 1e-6));
  engine->advance(1e-3);
  CHECK(engine->diagnostics().drift < 5e-9);
  CHECK(engine->counts().steps < 30);
}

TEST_CASE("a thousand free bodies take no room for rows without entries", "[smooth]") {
  Scene s = scene(1e-6);
  s.gravity = Vector3d(0, 0, -kGravity);
  for (int i = 0; i < 1000; ++i) {
    s.bodies.push_back(ball("ball " + std::to_string(i), {double(i), 0, 0}));
    s.bodies.back().angular_velocity = {1, 0.1 * i, 0};
  }
  const auto engine = make_smooth_engine(s);
  engine->advance(0.1);
  CHECK((engine->bodies()[999].position - Vector3d(999, 0, -0.005 * kGravity)).norm() < 1e-6);
  CHECK(engine->diagnostics().drift < 1e-12);
}

TEST_CASE("a rod too long for its closed net is refused by name", "[smooth]") {
  Scene s = net(6, true, 1e-6);
  Joint& rod = s.joints[40];
  const Vector3d way =
      s.bodies[std::size_t(rod.first)].position - s.bodies[std::size_t(rod.second)].position;
  rod.length = way.norm() + 5e-5;
  try {
    make_smooth_engine(s);
    FAIL("taken");
  } catch (const std::invalid_argument& e) {
    INFO(e.what());
    CHECK(std::string(e.what()).find("contradict") != std::string::npos);
    CHECK(std::string(e.what()).find("joint \"") != std::string::npos);
  }
}

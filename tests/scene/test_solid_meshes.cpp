// Bodies that move and are not convex: meshes as convex parts, in steps and by events, against
// closed forms. SPDX-License-Identifier: BSD-3-Clause
#include "event_runs.hpp"
#include "support/closed_meshes.hpp"

namespace {

using namespace event_runs;
using closed_meshes::of_cells;
using closed_meshes::Surface;
using Eigen::Matrix3d;
using Lines = std::array<std::vector<double>, 3>;

constexpr double kGravity = 9.81;

std::string vector(const Vector3d& v) {
  return "[" + number(v[0]) + ", " + number(v[1]) + ", " + number(v[2]) + "]";
}
std::string list(const std::vector<Vector3d>& points) {
  std::string out = "[";
  for (const Vector3d& p : points) out += vector(p) + ", ";
  return out + "]";
}
// A body's shape, moved by `by`.
std::string shape(const Surface& s, const Vector3d& by, const std::string& more = "") {
  std::string text = "shapes = [{ shape = \"mesh\", points = " + list(s.points) + ", triangles = [";
  for (const std::array<int, 3>& t : s.triangles)
    text += "[" + std::to_string(t[0]) + ", " + std::to_string(t[1]) + ", " + std::to_string(t[2]) +
            "], ";
  return text + "], position = " + vector(by) + more + " }]\n";
}
std::string body(const std::string& name, const std::string& fields) {
  return "[[body]]\nname = \"" + name + "\"\nmaterial = \"" + name + "\"\n" + fields;
}
std::string floor_and(const std::string& name, double friction) {
  return body("floor", "shape = \"plane\"\nfixed = true\n") + "[[pair]]\nbetween = [\"floor\", \"" +
         name + "\"]\nfriction = " + number(friction) + "\n";
}
std::unique_ptr<Engine> in_steps(const std::string& text, double step, double end,
                                 const Vector3d& gravity = {0, 0, -kGravity}) {
  const Scene scene =
      parse_scene("[scene]\nend = " + number(end) + "\ngravity = " + vector(gravity) +
                      "\n[stepping]\nstep = " + number(step) + "\n" + text,
                  "test");
  auto engine = make_engine(scene);
  engine->advance(end);
  return engine;
}
Vector3d place(const Engine& engine, int body) {
  return engine.bodies()[static_cast<std::size_t>(body)].position;
}

// 3 long, 1 wide, 2 high at its end.
Surface angle() {
  return of_cells(Lines{{{0, 1, 3}, {0, 1}, {0, 1, 2}}},
                  [](int x, int, int z) { return x == 0 || z == 0; });
}
const Vector3d kAngleCentre(1.25, 0.5, 0.75);

// An arch: 3 long, 1 wide, feet of 1 x 1 x 2 at both ends of a top of 1.
Surface arch() {
  return of_cells(Lines{{{0, 1, 2, 3}, {0, 1}, {0, 2, 3}}},
                  [](int x, int, int z) { return x != 1 || z == 1; });
}
const Vector3d kArchCentre(1.5, 0.5, 11.5 / 7);

// 1.2 x 0.8 x 0.1 on four legs of 0.1 x 0.1 x 0.6.
Surface table() {
  return of_cells(Lines{{{0, 0.1, 1.1, 1.2}, {0, 0.1, 0.7, 0.8}, {0, 0.6, 0.7}}},
                  [](int x, int y, int z) { return z == 1 || (x != 1 && y != 1); });
}
const double kTableTop = 1.2 * 0.8 * 0.1, kTableLegs = 4 * 0.1 * 0.1 * 0.6;
const Vector3d kTableCentre(0.6, 0.4,
                            (0.65 * kTableTop + 0.3 * kTableLegs) / (kTableTop + kTableLegs));

}  // namespace

TEST_CASE("solid mesh: the mass, centre and inertia of an angle are those of its two boxes",
          "[scene]") {
  const Scene scene =
      parse_scene(body("a", "density = 700\n" + shape(angle(), -kAngleCentre)), "test");
  const Body& a = scene.bodies[0];
  CHECK(a.shapes.size() == 2);
  CHECK(a.mass == Approx(700 * 4).epsilon(1e-14));
  Matrix3d inertia = Matrix3d::Zero();
  for (const auto& [size, centre] : {std::pair{Vector3d(1, 1, 2), Vector3d(0.5, 0.5, 1)},
                                     std::pair{Vector3d(2, 1, 1), Vector3d(2, 0.5, 0.5)}}) {
    const double m = 700 * size.prod();
    const Vector3d s = size.cwiseProduct(size), d = centre - kAngleCentre;
    inertia +=
        m / 12 * Vector3d(s[1] + s[2], s[0] + s[2], s[0] + s[1]).asDiagonal().toDenseMatrix();
    inertia += m * (d.squaredNorm() * Matrix3d::Identity() - d * d.transpose());
  }
  CHECK((a.inertia - inertia).norm() < 1e-13 * inertia.norm());
  // The centre of what is given is told.
  try {
    parse_scene(body("a", "density = 700\n" + shape(angle(), Vector3d::Zero())), "test");
    FAIL("read");
  } catch (const SceneError& e) {
    CHECK(std::string(e.what()).find("centre is [1.25, 0.5, 0.75") != std::string::npos);
  }
}

TEST_CASE("solid mesh: parts that fill hollows leave the mass of the mesh", "[scene]") {
  const Scene scene = parse_scene(
      body("a", "density = 1\n" + shape(angle(), -kAngleCentre, ", concavity = 2")), "test");
  REQUIRE(scene.bodies[0].shapes.size() == 1);
  CHECK(scene.bodies[0].mass == Approx(4).epsilon(1e-14));
  // Read again, it is the same.
  const Scene again = parse_scene(write_scene(scene), "again");
  CHECK(again.bodies[0].mass == scene.bodies[0].mass);
  CHECK(again.bodies[0].inertia == scene.bodies[0].inertia);
  CHECK(again.bodies[0].shapes[0].points == scene.bodies[0].shapes[0].points);
}

TEST_CASE("solid mesh: an angle and an arch tip where their centre is over the edge", "[scene]") {
  for (const auto& [s, centre, to_edge] :
       {std::tuple{angle(), kAngleCentre, 1.25}, std::tuple{arch(), kArchCentre, 1.5}})
    for (const double off : {-1e-3, 1e-3}) {
      INFO("edge at " << to_edge << ", beyond by " << off);
      const double tilt = std::atan(to_edge / centre.z()) + off;
      const Vector3d gravity = kGravity * Vector3d(-std::sin(tilt), 0, -std::cos(tilt));
      const std::string text = body("a", "density = 700\nposition = [0, 0, " + number(centre.z()) +
                                             "]\n" + shape(s, -centre)) +
                               floor_and("a", 10);
      // It falls by the moment off * m g d over the inertia about the edge: apart from the edge in
      // a second by far more than the tolerance.
      const auto stepped = in_steps(text, 1e-2, 1, gravity);
      const auto exact = run(text, 1e-8, 1, vector(gravity));
      for (const Engine* each : {stepped.get(), exact.get()}) {
        const double turned =
            Eigen::Quaterniond::Identity().angularDistance(each->bodies()[0].orientation);
        if (off < 0)
          CHECK(turned < 1e-7);
        else
          CHECK(turned > 1e-3);
      }
      if (off > 0) {
        const double there =
            Eigen::Quaterniond::Identity().angularDistance(exact->bodies()[0].orientation);
        const double here =
            Eigen::Quaterniond::Identity().angularDistance(stepped->bodies()[0].orientation);
        CHECK(here == Approx(there).epsilon(0.05));
      }
    }
}

TEST_CASE("solid mesh: a table slides as far as friction lets it", "[scene]") {
  const double mu = 0.3, speed = 2, stop = speed / (mu * kGravity);
  const double way = speed * speed / (2 * mu * kGravity);
  const std::string text =
      body("table", "density = 700\nvelocity = [2, 0, 0]\nposition = [0, 0, " +
                        number(kTableCentre.z()) + "]\n" + shape(table(), -kTableCentre)) +
      floor_and("table", mu);
  const auto exact = run(text, 1e-8, 1.2 * stop);
  CHECK(place(*exact, 0).x() == Approx(way).epsilon(1e-7));
  CHECK(std::abs(place(*exact, 0).z() - kTableCentre.z()) < 1e-8);
  const auto stepped = in_steps(text, 1e-3, 1.2 * stop);
  CHECK(place(*stepped, 0).x() == Approx(way).epsilon(2e-3));
  CHECK(std::abs(place(*stepped, 0).z() - kTableCentre.z()) < 1e-8);
}

TEST_CASE("solid mesh: a box slides over the seams of a plate that may move", "[scene]") {
  // In plan a comb: its top is flat, of eight parts or so.
  const Surface plate = of_cells(Lines{{{0, 0.3, 0.7, 1.2, 1.6, 2.2}, {0, 0.6, 1}, {0, 0.2}}},
                                 [](int x, int y, int) { return x % 2 == 0 || y == 0; });
  const double mu = 0.2, speed = 2, stop = speed / (mu * kGravity);
  const double way = speed * speed / (2 * mu * kGravity);
  const Vector3d half(1.1, 0.5, 0.1);
  const std::string text =
      body("plate", "mass = 1000\ninertia = [100, 400, 500]\nposition = [1.1, 0.5, 0.1]\n" +
                        shape(plate, -half)) +
      floor_and("plate", 1) +
      body("box",
           "shape = \"box\"\nsize = [0.2, 0.3, 0.2]\nmass = 1\nvelocity = [2, 0, 0]\n"
           "position = [0.15, 0.4, 0.3]\n") +
      "[[pair]]\nbetween = [\"plate\", \"box\"]\nfriction = " + number(mu) +
      "\n[[pair]]\nbetween = [\"floor\", \"box\"]\ntouch = false\n";
  REQUIRE(parse_scene(text, "test").bodies[0].shapes.size() >= 3);
  const auto exact = run(text, 1e-8, 1.1 * stop);
  CHECK(place(*exact, 2).x() - 0.15 == Approx(way).epsilon(1e-7));
  CHECK((place(*exact, 2) - Vector3d(0.15 + way, 0.4, 0.3)).norm() < 1e-6);
  const auto stepped = in_steps(text, 1e-3, 1.1 * stop);
  CHECK(place(*stepped, 2).x() - 0.15 == Approx(way).epsilon(2e-3));
  CHECK(std::abs(place(*stepped, 2).z() - 0.3) < 1e-8);
}

TEST_CASE("solid mesh: a ring falls over a peg and hangs on it", "[scene]") {
  // Ten sectors, a flat side inside above; the peg is a ball, which has no side to turn on.
  const double outer = 0.5, inner = 0.4, flat = inner * std::cos(std::acos(-1.0) / 10);
  const Surface ring =
      closed_meshes::ring(10, {{inner, -0.05}, {outer, -0.05}, {outer, 0.05}, {inner, 0.05}});
  const std::string text =
      body("ring", "density = 1000\nposition = [0, 0.3, 0]\n" + shape(ring, Vector3d::Zero())) +
      body("peg", "shape = \"capsule\"\nradius = 0.05\nlength = 1\nfixed = true\n") +
      "[[pair]]\nbetween = [\"ring\", \"peg\"]\nfriction = 0.5\n";
  REQUIRE(parse_scene(text, "test").bodies[0].shapes.size() == 10);
  const auto stepped = in_steps(text, 1e-3, 2, {0, -kGravity, 0});
  CHECK(place(*stepped, 0).y() == Approx(0.05 - flat).epsilon(1e-6));
  const auto exact = run(text, 1e-8, 2, "[0, -9.81, 0]");
  CHECK(place(*exact, 0).y() == Approx(0.05 - flat).epsilon(1e-7));
}

TEST_CASE("solid mesh: a convex mesh moves with the bits of its hull", "[scene]") {
  const Surface s =
      of_cells(Lines{{{-0.3, 0.3}, {-0.2, 0.2}, {-0.1, 0.1}}}, [](int, int, int) { return true; });
  const std::string fields =
      "density = 500\nposition = [0, 0, 0.6]\nvelocity = [1, 0.2, 0]\nangular_velocity = [2, 1, "
      "3]\n";
  std::string mesh = shape(s, Vector3d::Zero());
  mesh = mesh.substr(mesh.find("shape = "));
  const std::string hull = "shapes = [{ shape = \"convex\", points = " + list(s.points) + " }]\n";
  for (const bool events : {false, true}) {
    std::vector<std::unique_ptr<Engine>> both;
    for (const std::string& each : {shape(s, Vector3d::Zero()), hull}) {
      const std::string text = body("a", fields + each) + floor_and("a", 0.4);
      both.push_back(events ? run(text, 1e-6, 0.7) : in_steps(text, 1e-3, 0.7));
    }
    CHECK(place(*both[0], 0) == place(*both[1], 0));
    CHECK(both[0]->bodies()[0].orientation.coeffs() == both[1]->bodies()[0].orientation.coeffs());
  }
}

TEST_CASE("solid mesh: what has no inside is refused by its field", "[scene]") {
  const auto refusal = [](const std::string& fields) {
    try {
      parse_scene(body("a", fields), "test");
    } catch (const SceneError& e) {
      return std::string(e.what());
    }
    return std::string("read");
  };
  Surface open = angle();
  open.triangles.pop_back();
  CHECK_THAT(refusal("mass = 1\ninertia = [1, 1, 1]\n" + shape(open, Vector3d::Zero())),
             Catch::Matchers::Contains("triangles") &&
                 Catch::Matchers::Contains("belongs to no other triangle"));
  Surface turned = angle();
  std::swap(turned.triangles[5][1], turned.triangles[5][2]);
  CHECK_THAT(refusal("density = 1\n" + shape(turned, Vector3d::Zero())),
             Catch::Matchers::Contains("in the same direction"));
  CHECK_THAT(refusal("fixed = true\n" + shape(angle(), Vector3d::Zero(), ", concavity = 1")),
             Catch::Matchers::Contains("concavity") && Catch::Matchers::Contains("has no parts"));
  CHECK_THAT(refusal("density = 1\n" + shape(angle(), Vector3d::Zero(), ", concavity = -1")),
             Catch::Matchers::Contains("concavity"));
  CHECK_THAT(refusal("density = 1\nshape = \"box\"\nsize = [1, 1, 1]\nconcavity = 1\n"),
             Catch::Matchers::Contains("concavity"));
}

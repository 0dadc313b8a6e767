// Impacts of the event engine against closed forms. SPDX-License-Identifier: BSD-3-Clause
#include "event_runs.hpp"

using namespace event_runs;

namespace {

// Capobianco et al. (2021): a ball of radius 0.1 m, y0 = 1 m, friction 0.2.
std::string rotating_ball(double x, double v, double restitution) {
  return kFloor + R"(
[[body]]
name = "ball"
shape = "sphere"
radius = 0.1
mass = 1
material = "body"
position = [)" +
         number(x) + ", 0, 1]\nvelocity = [" + number(v) +
         ", 0, 0]\nangular_velocity = [0, -50, 0]\n" +
         pair("friction = 0.2\nrestitution = " + number(restitution));
}

}  // namespace

TEST_CASE("event: the impacts of a bouncing ball come to rest when their closed form does") {
  const double first = 0.4515236409857309;  // sqrt(2 h / g), h = 1 m
  struct Case {
    double e, rest;
  };
  const Case c = GENERATE(Case{0.5, 1.3545709229571927}, Case{0.9, 8.5789491787288872});
  for (const double tolerance : kLadder) {
    CAPTURE(c.e, tolerance);
    const auto engine = run(ball(1, c.e), tolerance, 10);
    const auto impacts = of_kind(*engine, Kind::impact), rests = of_kind(*engine, Kind::rest);
    REQUIRE(rests.size() == 1);
    CHECK(std::abs(rests[0].time - c.rest) < 10 * tolerance * c.rest);
    // As many impacts as are faster than what ends the sequence, and each in its time.
    double time = first, speed = 9.81 * first;
    for (std::size_t k = 0; k < impacts.size(); ++k) {
      CHECK(std::abs(impacts[k].time - time) < 10 * tolerance * std::max(1.0, time));
      CHECK(std::abs(impacts[k].before + speed) < 10 * tolerance);
      time += 2 * c.e * speed / 9.81;
      speed *= c.e;
    }
    const double last = 0.5 * std::max(tolerance, 1e-5) / c.e;  // 0.5 m/s is the scene's speed
    CHECK(impacts.size() ==
          static_cast<std::size_t>(std::ceil(std::log(last / (9.81 * first)) / std::log(c.e))));
    CHECK(std::abs(ledger(*engine, 2 * 9.81 * 1.1)) < 1e-9);
    CHECK(std::abs(engine->bodies()[1].position.z() - 0.1) < 1e-12);
    CHECK(engine->bodies()[1].velocity.norm() < 1e-13);
    CHECK(engine->counts().steps < 40 * static_cast<long>(impacts.size() + 1));
  }
}

TEST_CASE("event: a ball with restitution 0.99 rests after 90 s") {
  const auto engine = run(ball(1, 0.99), 1e-8, 90);
  const auto rests = of_kind(*engine, Kind::rest);
  REQUIRE(rests.size() == 1);
  CHECK(std::abs(rests[0].time - 89.853204556160450) < 1.3e-7);
  CHECK(engine->counts().impacts == 1363);  // to 5e-6 m/s
}

TEST_CASE("event: a ball of other units bounces alike") {
  const double scale = GENERATE(1e-8, 1e-3, 7e-3, 3e-2, 1e5, 1e8);
  const double tolerance = GENERATE(1e-4, 1e-6, 1e-8);
  CAPTURE(scale, tolerance);
  // Lengths, and the time by the gravity of 9.81 m/s^2.
  const double clock = std::sqrt(scale);
  const std::string text =
      kFloor + "[[body]]\nname = \"ball\"\nshape = \"sphere\"\nradius = " + number(0.1 * scale) +
      "\nmass = 1\nmaterial = \"body\"\nposition = " + "[0, 0, " + number(1.1 * scale) + "]\n" +
      pair("restitution = 0.5");
  const auto engine = run(text, tolerance, 2 * clock);
  const auto rests = of_kind(*engine, Kind::rest);
  REQUIRE(rests.size() == 1);
  CHECK(std::abs(rests[0].time - 1.3545709229571927 * clock) < 10 * tolerance * clock);
}

TEST_CASE("event: a ball told in millimetres comes to rest on a turned floor as one in metres") {
  // Its last bounces of 1e-5 mm/s were lower than rounding: it touched, and no rest was told.
  const double e = 0.63, first = std::sqrt(2 * 0.37 / 9.81);
  const Vector3d up = Eigen::AngleAxisd(2.3, Vector3d(-2, 0.3, 1).normalized()) * Vector3d::UnitZ();
  const auto along = [&](double x) {
    return "[" + number(x * up.x()) + ", " + number(x * up.y()) + ", " + number(x * up.z()) + "]";
  };
  const std::string text =
      "[[body]]\nname = \"ball\"\nshape = \"sphere\"\nradius = 210\nmass = 0.0073\n"
      "material = \"body\"\nposition = " +
      along(580) +
      "\n[[body]]\nname = \"floor\"\n"
      "shape = \"plane\"\nfixed = true\nmaterial = \"floor\"\nnormal = " +
      along(1) + "\n" + pair("restitution = 0.63");
  for (const double tolerance : {1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10}) {
    CAPTURE(tolerance);
    const auto engine = run(text, tolerance, 3, along(-9810));
    const auto rests = of_kind(*engine, Kind::rest);
    REQUIRE(rests.size() == 1);
    CHECK(std::abs(rests[0].time - first * (1 + e) / (1 - e)) < 10 * tolerance);
  }
}

TEST_CASE("event: a ball far from the origin bounces as one near it") {
  // Once an error of 1e-6 of its place counted as none, at 600 m 80 tolerances; and rounding there
  // made 180 to 760 of 1e-10.
  for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-10}) {
    CAPTURE(tolerance);
    const std::string text =
        "[[body]]\nname = \"floor\"\nshape = \"plane\"\nfixed = true\nmaterial = \"floor\"\n"
        "position = [600, -800, 300]\n[[body]]\nname = \"ball\"\nshape = \"sphere\"\n"
        "radius = 0.25\nmass = 3\nmaterial = \"body\"\nposition = [600.3, -800, 302.55]\n" +
        pair("restitution = 0.7");
    const auto engine = run(text, tolerance, 5);
    const auto rests = of_kind(*engine, Kind::rest);
    REQUIRE(rests.size() == 1);
    CHECK(std::abs(rests[0].time - std::sqrt(2 * 2.3 / 9.81) * 1.7 / 0.3) < 10 * tolerance);
    CHECK(std::abs(engine->bodies()[1].position.z() - 300.25) < 10 * tolerance);
  }
}

TEST_CASE("event: a rotating ball slips after its impact, then rolls (Capobianco)") {
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(rotating_ball(0, 0, 0), tolerance, 0.5);
    const auto impacts = of_kind(*engine, Kind::impact);
    REQUIRE(engine->events().size() == 1);
    CHECK(std::abs(impacts[0].time - 0.42835293687811934) < 10 * tolerance);
    CHECK(std::abs(impacts[0].before + 4.2021423107743507) < 10 * tolerance);
    // Slip: v_x = -0.84.. at the impact, then -mu g.
    const double since = 0.5 - 0.42835293687811934;
    CHECK(std::abs(engine->bodies()[1].velocity.x() + 0.84042846215487015 + 0.2 * 9.81 * since) <
          10 * tolerance);
    engine->advance(0.8);
    REQUIRE(engine->events().size() == 2);
    CHECK(engine->events()[1].kind == Kind::stop);
    CHECK(std::abs(engine->events()[1].time - 0.72811999417504005) < 10 * tolerance);
    CHECK(std::abs(engine->bodies()[1].velocity.x() + 10.0 / 7) < 10 * tolerance);
    CHECK(std::abs(engine->bodies()[1].angular_velocity.y() + 100.0 / 7) < 100 * tolerance);
    CHECK(engine->counts().residual_evaluations < 4000);
  }
}

TEST_CASE("event: a rotating ball bounces with slip, then with stick (Capobianco)") {
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(rotating_ball(-0.5, 1, 0.5), tolerance, 0.6);
    const auto velocity = [&] { return engine->bodies()[1].velocity.x(); };
    const auto spin = [&] { return -engine->bodies()[1].angular_velocity.y(); };
    CHECK(std::abs(velocity() + 0.26064269323230522) < 10 * tolerance);
    CHECK(std::abs(spin() - 18.48393266919237) < 10 * tolerance * 50);
    engine->advance(0.9);
    CHECK(std::abs(velocity() + 5.0 / 7) < 10 * tolerance);
    CHECK(std::abs(spin() - 50.0 / 7) < 10 * tolerance * 50);
    engine->advance(1.2);
    const auto impacts = of_kind(*engine, Kind::impact);
    REQUIRE(impacts.size() == 4);
    const double times[] = {0.42835293687811934, 0.85670587375623868, 1.0708823421952984,
                            1.1779705764148282};
    for (int k = 0; k < 4; ++k)
      CHECK(std::abs(impacts[static_cast<std::size_t>(k)].time - times[k]) < 10 * tolerance);
    // x moves at v_x between the impacts.
    CHECK(std::abs(engine->bodies()[1].position.x() -
                   (-0.3362773179859468 - 5.0 / 7 * (1.2 - 1.0708823421952984))) < 10 * tolerance);
  }
}

TEST_CASE("event: a pendulum bounces off a wall at its lowest point") {
  const std::string text = R"(
[[body]]
name = "wall"
shape = "plane"
normal = [1, 0, 0]
position = [-0.1, 0, 0]
fixed = true
material = "floor"
[[body]]
name = "bob"
shape = "sphere"
radius = 0.1
mass = 1
position = [0.86602540378443865, 0, -0.5]
material = "body"
[[joint]]
kind = "distance"
bodies = ["bob", "world"]
at = [[0.86602540378443865, 0, -0.5], [0, 0, 0]]
)" + pair("restitution = 0.8");
  const double times[] = {.538218666720128926, 1.58544198624292315, 2.61574618289199347,
                          3.63584806565328866, 4.64965458131063709, 5.65952273731369406};
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(text, tolerance, 6);
    const auto impacts = of_kind(*engine, Kind::impact);
    REQUIRE(impacts.size() == 6);
    for (std::size_t k = 0; k < 6; ++k)
      CHECK(std::abs(impacts[k].time - times[k]) < 10 * tolerance);
    CHECK(std::abs(impacts[0].before + 3.1320919526731651) < 10 * tolerance);
    CHECK(engine->diagnostics().drift < tolerance);
    CHECK(std::abs(ledger(*engine, -9.81 / 2)) < 10 * tolerance);
  }
}

TEST_CASE("event: two blocks and a wall collide as often as pi has it (Galperin)") {
  struct Case {
    double ratio;
    std::size_t collisions;
    double V, v;
  };
  const Case c =
      GENERATE(Case{1, 3, 1, 0}, Case{1e2, 31, 0.998857595563118433, 0.477860208205885924},
               Case{1e4, 314, 0.999998559562977706, 0.169731316195039981});
  const std::string text = R"(
[[body]]
name = "wall"
shape = "plane"
normal = [1, 0, 0]
fixed = true
material = "floor"
[[body]]
name = "small"
shape = "sphere"
radius = 0.1
mass = 1
position = [1.1, 0, 0]
material = "body"
[[body]]
name = "large"
shape = "sphere"
radius = 0.1
mass = )" + number(c.ratio) +
                           R"(
position = [2.3, 0, 0]
velocity = [-1, 0, 0]
material = "body"
[[pair]]
between = ["body", "body"]
restitution = 1
)" + pair("restitution = 1");
  for (const double tolerance : kLadder) {
    CAPTURE(c.ratio, tolerance);
    const auto engine = run(text, tolerance, 10, "");
    CHECK(engine->events().size() == c.collisions);
    CHECK(std::abs(engine->bodies()[2].velocity.x() - c.V) < 10 * tolerance);
    CHECK(std::abs(engine->bodies()[1].velocity.x() - c.v) < 10 * tolerance * 10);
    CHECK(std::abs(ledger(*engine, c.ratio / 2)) < 1e-10 * c.ratio);
  }
}

TEST_CASE("event: a ball leaves a smooth sphere where its closed form does") {
  // Centres move on R = 1 about the origin, v0 = 0.5 at the top; the floor is met at z = -1.
  const std::string text = R"(
[[body]]
name = "dome"
shape = "sphere"
radius = 0.9
fixed = true
material = "floor"
[[body]]
name = "ground"
shape = "plane"
position = [0, 0, -1.1]
fixed = true
material = "floor"
[[body]]
name = "ball"
shape = "sphere"
radius = 0.1
mass = 1
position = [0, 0, 1]
velocity = [0.5, 0, 0]
material = "body"
)" + pair("");
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(text, tolerance, 1.0);
    const auto lifts = of_kind(*engine, Kind::lift);
    REQUIRE(lifts.size() == 1);
    CHECK(std::abs(lifts[0].time - 0.754238838002551947) < 10 * tolerance);
    engine->advance(1.2);
    const auto impacts = of_kind(*engine, Kind::impact);
    REQUIRE(impacts.size() == 1);
    CHECK(std::abs(impacts[0].time - 1.17632347670251591) < 10 * tolerance);
    const BodyState& ball = engine->bodies()[2];
    CHECK(std::abs(ball.position.x() - ball.velocity.x() * (1.2 - 1.17632347670251591) -
                   1.47107772505707675) < 10 * tolerance);
  }
}

TEST_CASE("event: an oscillator hits, grazes and misses a wall") {
  // x'' + x = cos(2.6 t): a spring of 1 N/m to a slide that moves by cos(2.6 t) - 1 from 1.
  const auto text = [](double wall, double x, double restitution) {
    return R"(
[[body]]
name = "wall"
shape = "plane"
normal = [-1, 0, 0]
position = [)" +
           number(wall + 0.1) + R"(, 0, 0]
fixed = true
material = "floor"
[[body]]
name = "mass"
shape = "sphere"
radius = 0.1
mass = 1
position = [)" +
           number(x) + R"(, 0, 0]
material = "body"
[[body]]
name = "slide"
mass = 1
inertia = [1, 1, 1]
position = [-9, 0, 0]
[[joint]]
kind = "slider"
bodies = ["mass", "world"]
axis = [1, 0, 0]
[[joint]]
kind = "slider"
bodies = ["slide", "world"]
axis = [1, 0, 0]
motion = { amplitude = 1, frequency = )" +
           number(2.6 / (2 * M_PI)) + R"(, phase_deg = 90 }
[[spring]]
bodies = ["mass", "slide"]
at = [[)" + number(x) +
           R"(, 0, 0], [-9, 0, 0]]
stiffness = 1
rest = 10
)" + pair("restitution = " + number(restitution));
  };
  const double times[] = {5.81716802085445063, 10.0677003774410073, 13.8420170789961685};
  const double speeds[] = {0.326635499159025, 0.756107549699978, 0.584369585290600};
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(text(0.3, 0, 0.8), tolerance, 14, "");
    const auto impacts = of_kind(*engine, Kind::impact);
    REQUIRE(impacts.size() == 3);
    for (std::size_t k = 0; k < 3; ++k) {
      CHECK(std::abs(impacts[k].time - times[k]) < 10 * tolerance);
      CHECK(std::abs(impacts[k].before + speeds[k]) < 10 * tolerance);
    }
  }
  const double C = 0.17361111111111111;
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto grazing = run(text(C, -C, 0.8), tolerance, 2, "");
    CHECK(grazing->counts().impacts == 0);
    CHECK(std::abs(grazing->bodies()[1].position.x() + C * std::cos(2.6 * 2)) < 10 * tolerance);
    // A wall before the turn: the speed goes as the square root of the depth, errors of the place
    // grow by 1 / speed. Once depths below the tolerance were only touches: 60 tolerances off.
    for (const double part : {1e-3, 1e-4, 4e-5}) {
      CAPTURE(part);
      const double wall = C * (1 - part), time = std::acos(-1 + part) / 2.6;
      const double speed = 2.6 * C * std::sin(2.6 * time), e = 0.8, later = time + 0.4;
      const auto engine = run(text(wall, -C, e), tolerance, later, "");
      const auto impacts = of_kind(*engine, Kind::impact);
      REQUIRE(impacts.size() == 1);
      CHECK(std::abs(impacts[0].time - time) < 10 * tolerance);
      CHECK(std::abs(impacts[0].before + speed) < 10 * tolerance);
      const double x = -(1 + e) * speed * std::sin(0.4) - C * std::cos(2.6 * later);
      CHECK(std::abs(engine->bodies()[1].position.x() - x) < 10 * tolerance);
    }
  }
}

// Limits, motors and friction of joints in the event engine. SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <tether/scene/run.hpp>

#include "event/phase/friction_solve.hpp"
#include "event_runs.hpp"
#include "run_files.hpp"

using namespace event_runs;

namespace {

constexpr double kGravity = 9.81;

std::string carriage(const std::string& values, double start = 0,
                     const std::string& axis = "[1, 0, 0]") {
  return "[[body]]\nname = \"carriage\"\nmass = 1\ninertia = [1, 1, 1]\nposition = [" +
         number(start) +
         ", 0, 0]\n[[joint]]\nname = \"guide\"\nkind = \"slider\"\n"
         "bodies = [\"carriage\", \"world\"]\naxis = " +
         axis + "\n" + values + "\n";
}

std::string wheel(double speed, const std::string& values) {
  return "[[body]]\nname = \"wheel\"\nmass = 1\ninertia = [1, 1, 0.4]\nangular_velocity = [0, 0, " +
         number(speed) +
         "]\n[[joint]]\nname = \"shaft\"\nkind = \"hinge\"\nbodies = [\"wheel\", \"world\"]\n"
         "at = [0, 0, 0]\naxis = [0, 0, 1]\n" +
         values + "\n";
}

double spin(const Engine& engine) { return engine.bodies()[0].angular_velocity.z(); }

/// Two cranks of length 1 and a coupler between them, of mass 1 each (a coupler of 2), at an angle
/// from the horizontal. Hinges 0 and 1 are on the ground, 2 and 3 on the coupler.
std::string parallelogram(double angle, double speed, const std::string& friction) {
  const double c = std::cos(angle), s = std::sin(angle);
  std::string text;
  const auto at = [&](double x, double along) {
    return "[" + number(x + along * c) + ", 0, " + number(along * s) + "]";
  };
  const auto body = [&](const std::string& name, double x, double along, double mass, bool turns) {
    text += "[[body]]\nname = \"" + name + "\"\nmass = " + number(mass) +
            "\ninertia = [0.1, 0.1, 0.1]\nposition = " + at(x, along) + "\nvelocity = [" +
            number(-speed * along * s) + ", 0, " + number(speed * along * c) + "]\n" +
            (turns ? "angular_velocity = [0, " + number(-speed) + ", 0]\n" : "");
  };
  body("left", 0, 0.5, 1, true);
  body("right", 2, 0.5, 1, true);
  body("coupler", 1, 1, 2, false);
  int k = 0;
  const auto hinge = [&](const std::string& first, const std::string& second, double x,
                         double along) {
    text += "[[joint]]\nname = \"h" + std::to_string(k++) + "\"\nkind = \"hinge\"\nbodies = [\"" +
            first + "\", \"" + second + "\"]\nat = " + at(x, along) + "\naxis = [0, -1, 0]\n" +
            friction + "\n";
  };
  hinge("left", "world", 0, 0);
  hinge("right", "world", 2, 0);
  hinge("left", "coupler", 0, 1);
  hinge("right", "coupler", 2, 1);
  return text;
}

double angle_of(const Engine& engine) {
  const Vector3d p = engine.bodies()[2].position - Vector3d(1, 0, 0);
  return std::atan2(p.z(), p.x());
}

}  // namespace

TEST_CASE("event: a pendulum strikes the limit of its hinge: oracle 14") {
  const double exact[] = {.538218666720128926, 1.58544198624292315, 2.61574618289199347,
                          3.63584806565328866, 4.64965458131063709, 5.65952273731369406};
  // A rod of which (I + m r^2) / (m r) = 1.
  const double start = M_PI / 3, r = 0.8;
  const std::string text =
      "[[body]]\nname = \"rod\"\nmass = 2\ninertia = [0.32, 0.32, 0.32]\nposition = [" +
      number(r * std::sin(start)) + ", 0, " + number(-r * std::cos(start)) +
      "]\n[[joint]]\nkind = \"hinge\"\nbodies = [\"rod\", \"world\"]\nat = [0, 0, 0]\n"
      "axis = [0, 1, 0]\nlimits_deg = [-5, 60]\nlimit_restitution = 0.8\n";
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(text, tolerance, 5.8);
    const std::vector<ContactEvent> found = of_kind(*engine, Kind::impact);
    REQUIRE(found.size() == 6);
    double speed = 3.1320919526731651;
    for (int k = 0; k < 6; ++k, speed *= 0.8) {
      CHECK(std::abs(found[k].time - exact[k]) < 10 * tolerance);
      CHECK(std::abs(found[k].before + speed) < 10 * tolerance);
      CHECK(std::abs(found[k].after - 0.8 * speed) < 10 * tolerance);
      CHECK(std::abs(found[k].impulse.y() + 1.6 * 1.8 * speed) < 30 * tolerance);
      CHECK((found[k].first == 0 && found[k].second == -1));
    }
    CHECK(std::abs(ledger(*engine, -2 * kGravity * r * std::cos(start))) < 10 * tolerance);
  }
}

TEST_CASE("event: a carriage comes to rest on its limit as a bouncing ball does: oracle 1") {
  for (const double scale : {1.0, 1e-3}) {  // of lengths and of gravity
    const std::string gravity = "[0, 0, " + number(-kGravity * scale) + "]";
    const std::string text = carriage(
        "limits = [" + number(-scale) + ", " + number(9 * scale) + "]\nlimit_restitution = 0.5", 0,
        "[0, 0, 1]");
    for (const double tolerance : kLadder) {
      CAPTURE(scale, tolerance);
      const auto engine = run(text, tolerance, 2, gravity);
      const std::vector<ContactEvent> rests = of_kind(*engine, Kind::rest);
      REQUIRE(rests.size() == 1);
      CHECK(std::abs(rests[0].time - 1.3545709229571927134) < 10 * tolerance);
      CHECK(std::abs(engine->bodies()[0].position.z() + scale) < 10 * tolerance * scale);
      CHECK(std::abs(engine->forces().joints[0].drive - kGravity * scale) < 10 * tolerance * scale);
      CHECK(engine->diagnostics().contacts == 0);
    }
  }
}

TEST_CASE("event: a limit carries what presses on it and lets go when that turns") {
  // Pressed by 2 cos(2 t) until t = pi / 4.
  const std::string text =
      carriage("limits = [-3, 0]") +
      "[[load]]\nbody = \"carriage\"\nforce = [2, 0, 0]\nsine = { frequency = " + number(1 / M_PI) +
      ", phase_deg = 90 }\n";
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    auto engine = run(text, tolerance, 0.5);
    CHECK(std::abs(engine->forces().joints[0].drive + 2 * std::cos(1)) < 10 * tolerance);
    engine->advance(1.5);
    const std::vector<ContactEvent> lifts = of_kind(*engine, Kind::lift);
    REQUIRE(lifts.size() == 1);
    CHECK(std::abs(lifts[0].time - M_PI / 4) < 10 * tolerance);
    // x'' = 2 cos 2t from rest at pi / 4.
    const double x = -0.5 * std::cos(3.0) - (1.5 - M_PI / 4);
    CHECK(std::abs(engine->bodies()[0].position.x() - x) < 10 * tolerance);
  }
}

TEST_CASE("event: a mass on a spring in a guide that rubs: oracle 3") {
  const std::string text =
      carriage("friction = 0.15", 1) +
      "[[spring]]\nbodies = [\"carriage\", \"world\"]\nat = [[1, 0, 0], [-4, 0, 0]]\n"
      "stiffness = 1\nrest = 4\n";
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(text, tolerance, 1);
    for (int turn = 1; turn <= 3; ++turn) {
      engine->advance(turn * M_PI);
      const double x = turn == 1 ? -0.7 : turn == 2 ? 0.4 : -0.1;
      CHECK(std::abs(engine->bodies()[0].position.x() - x) < 10 * tolerance);
    }
    engine->advance(12);
    const std::vector<ContactEvent> stops = of_kind(*engine, Kind::stop);
    REQUIRE(stops.size() == 3);
    for (int k = 0; k < 3; ++k) {
      CHECK(std::abs(stops[k].time - (k + 1) * M_PI) < 10 * tolerance);
      CHECK((stops[k].first == 0 && stops[k].second == -1));
    }
    CHECK(std::abs(engine->bodies()[0].position.x() + 0.1) < 10 * tolerance);
    CHECK(engine->bodies()[0].velocity.norm() < 1e-12);
    CHECK(std::abs(engine->forces().joints[0].drive + 0.1) < 10 * tolerance);
  }
}

TEST_CASE("event: a carriage on an incline that rubs stays, or slides; thrown up it returns") {
  const double angle = M_PI / 6;
  const std::string axis = "[" + number(std::cos(angle)) + ", 0, " + number(std::sin(angle)) + "]";
  const double pull = kGravity * std::sin(angle);
  for (const double part : {1 + 1e-6, 1 - 1e-6}) {
    const auto engine = run(carriage("friction = " + number(part * pull), 0, axis), 1e-8, 1);
    const double way = part > 1 ? 0 : -0.5 * (1 - part) * pull;
    CHECK(std::abs(engine->bodies()[0].position.x() - way * std::cos(angle)) < 1e-8);
  }
  const double F = 0.4 * pull, up = 3 / (pull + F), top = 4.5 / (pull + F);
  const std::string text =
      "[[body]]\nname = \"carriage\"\nmass = 1\ninertia = [1, 1, 1]\nvelocity = [" +
      number(3 * std::cos(angle)) + ", 0, " + number(3 * std::sin(angle)) +
      "]\n[[joint]]\nkind = \"slider\"\nbodies = [\"world\", \"carriage\"]\naxis = " + axis +
      "\nfriction = " + number(F) + "\n";
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(text, tolerance, 2);
    const std::vector<ContactEvent> stops = of_kind(*engine, Kind::stop);
    REQUIRE(stops.size() == 1);
    CHECK(std::abs(stops[0].time - up) < 10 * tolerance);
    const double way = top - 0.5 * (pull - F) * (2 - up) * (2 - up);
    CHECK(std::abs(engine->bodies()[0].position.z() - way * std::sin(angle)) < 10 * tolerance);
  }
}

TEST_CASE("event: a motor of limited torque spins a wheel up to its speed and holds it there") {
  for (const double direction : {1.0, -1.0})
    for (const double tolerance : kLadder) {
      CAPTURE(direction, tolerance);
      const std::string text =
          wheel(0, "motor = { rate_rad = " + number(4 * direction) + ", torque = 2 }") +
          "[[load]]\nbody = \"wheel\"\ntorque = [0, 0, " + number(-0.5 * direction) + "]\n";
      const auto engine = run(text, tolerance, 0.8);
      CHECK(std::abs(spin(*engine) - direction * 1.5 / 0.4 * 0.8) < 10 * tolerance);
      CHECK(std::abs(engine->forces().joints[0].drive - 2 * direction) < 1e-12);
      engine->advance(2);
      const std::vector<ContactEvent> stops = of_kind(*engine, Kind::stop);
      REQUIRE(stops.size() == 1);
      CHECK(std::abs(stops[0].time - 0.4 * 4 / 1.5) < 10 * tolerance);
      CHECK(std::abs(spin(*engine) - 4 * direction) < tolerance);
      CHECK(std::abs(engine->forces().joints[0].drive - 0.5 * direction) < 1e-9);
    }
}

TEST_CASE("event: a motor yields where its load is above the limit, and catches up behind it") {
  const double omega = 0.6, N = 2, L = 3, I = 0.4;
  const std::string text =
      wheel(4, "motor = { rate_rad = 4, torque = 2 }") +
      "[[load]]\nbody = \"wheel\"\ntorque = [0, 0, -3]\nsine = { frequency = " +
      number(omega / (2 * M_PI)) + " }\n";
  const double from = std::asin(N / L) / omega;
  const auto speed = [&](double t) {
    return 4 + (N * (t - from) + L / omega * (std::cos(omega * t) - std::cos(omega * from))) / I;
  };
  double a = M_PI / omega - from, b = 2 * M_PI / omega;  // where the motor is stronger again
  for (int k = 0; k < 200; ++k) (speed(0.5 * (a + b)) < 4 ? a : b) = 0.5 * (a + b);
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(text, tolerance, 3);
    CHECK(std::abs(spin(*engine) - speed(3)) < 10 * tolerance);
    engine->advance(a + 0.1);
    REQUIRE(engine->events().size() == 2);
    CHECK(engine->events()[0].kind == Kind::slip);
    CHECK(std::abs(engine->events()[0].time - from) < 10 * tolerance);
    CHECK(engine->events()[1].kind == Kind::stop);
    CHECK(std::abs(engine->events()[1].time - a) < 10 * tolerance);
    CHECK(std::abs(spin(*engine) - 4) < tolerance);
    const double held = L * std::sin(omega * (a + 0.1));
    CHECK(std::abs(engine->forces().joints[0].drive - held) < 10 * tolerance);
  }
}

TEST_CASE("event: bounds far above all forces hold, and so do those of two laws of one joint") {
  for (const double bound : {2.0, 1e4, 1e9, 1e15}) {
    CAPTURE(bound);
    const std::string text =
        wheel(1, "motor = { rate_rad = 1, torque = " + number(bound) + " }\nfriction = 1.5") +
        "[[load]]\nbody = \"wheel\"\ntorque = [0, 0, -0.25]\n";
    const auto engine = run(text, 1e-8, 1);
    CHECK(std::abs(spin(*engine) - 1) < 1e-12);
    CHECK(std::abs(engine->forces().joints[0].drive - 0.25) < 1e-9);
    CHECK(engine->events().empty());
  }
  // Motor less friction, then the limit, which carries the motor less what the brake takes.
  const double speed = 3.5 / 0.4, way = 1.5 * M_PI, until = std::sqrt(2 * way / speed);
  const auto engine = run(
      wheel(0, "motor = { rate_rad = 100, torque = 5 }\nfriction = 1.5\nlimits_deg = [-10, 270]"),
      1e-8, 3);
  const std::vector<ContactEvent> impacts = of_kind(*engine, Kind::impact);
  REQUIRE(impacts.size() == 1);
  CHECK(std::abs(impacts[0].time - until) < 1e-7);
  CHECK(std::abs(impacts[0].before + speed * until) < 1e-7);
  CHECK(std::abs(spin(*engine)) < 1e-12);
  CHECK(std::abs(engine->forces().joints[0].drive) < 1e-8);
}

TEST_CASE("event: friction of four hinges of a mechanism holds it up to the sum of its bounds") {
  // It turns as one: (2 m l / 2 + 2 m l) g cos against four bounds.
  const double angle = 0.5, moment = 3 * kGravity * std::cos(angle);
  for (const double part : {1.001, 0.999}) {
    CAPTURE(part);
    const std::string friction = "friction = " + number(0.25 * part * moment);
    const auto engine = run(parallelogram(angle, 0, friction), 1e-8, 0.5);
    const double moved = angle_of(*engine) - angle;
    if (part < 1) {
      // From rest, linear: its moment of inertia is 2 (I + m l^2 / 4) + 2 m l^2 = 2.7 kg m^2, and
      // the moment grows as it falls.
      const double rate = std::sqrt(moment * std::tan(angle) / 2.7);
      const double first = -0.001 / std::tan(angle) * (std::cosh(0.5 * rate) - 1);
      CHECK(std::abs(moved / first - 1) < 1e-2);
      continue;
    }
    CHECK(std::abs(moved) < 1e-12);
    double sum = 0;
    for (const JointForce& each : engine->forces().joints) {
      CHECK(std::abs(each.drive) <= 0.25 * part * moment * (1 + 1e-9));
      sum += each.drive;
    }
    CHECK(std::abs(sum - moment) < 1e-6);
  }
}

TEST_CASE("event: friction of a mechanism's hinges, while all slide, is constant loads") {
  const double N = 0.3, end = 0.2;
  const std::string links = parallelogram(0.4, 3, "");
  // Cranks turn by +: hinges on the ground and on the coupler rub against that.
  std::string loads;
  for (const char* crank : {"left", "right"})
    loads +=
        std::string("[[load]]\nbody = \"") + crank + "\"\ntorque = [0, " + number(2 * N) + ", 0]\n";
  loads += "[[load]]\nbody = \"coupler\"\ntorque = [0, " + number(-2 * N) + ", 0]\n";
  Scene smooth = parse_scene(
      "[scene]\nend = 1\ngravity = [0, 0, -9.81]\n[smooth]\n"
      "tolerance = 1e-12\n" +
          links + loads,
      "smooth");
  const auto reference = make_engine(smooth);
  reference->advance(end);
  const double exact = angle_of(*reference);
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(parallelogram(0.4, 3, "friction = " + number(N)), tolerance, end);
    CHECK(engine->events().empty());
    CHECK(std::abs(angle_of(*engine) - exact) < 10 * tolerance);
    CHECK(std::abs(engine->bodies()[0].angular_velocity.y() -
                   reference->bodies()[0].angular_velocity.y()) < 10 * tolerance);
    CHECK(engine->diagnostics().drift < 1e-10);
  }
}

TEST_CASE("event: a motor presses a lever onto the floor; a stronger load lifts it") {
  const double arm = std::sqrt(0.75), mass = 2;
  const std::string lever =
      kFloor +
      "[[body]]\nname = \"lever\"\nshape = \"points\"\npoints = [[0.5, 0, 0]]\nmass = 2\n"
      "inertia = [0.1, 0.1, 0.1]\nmaterial = \"body\"\nposition = [" +
      number(0.5 * arm) +
      ", 0, 0.25]\norientation = { axis = [0, 1, 0], rad = " + number(std::asin(0.5)) +
      " }\n[[joint]]\nkind = \"hinge\"\nbodies = [\"lever\", \"world\"]\nat = [0, 0, 0.5]\n"
      "axis = [0, 1, 0]\nmotor = { rate_rad = 1, torque = 7 }\n";
  const double weight = mass * kGravity * 0.5 * arm;
  for (const double friction : {0.0, 0.5})
    for (const double tolerance : kLadder) {
      CAPTURE(friction, tolerance);
      const std::string text = lever + pair("friction = " + number(friction)) +
                               "[[load]]\nbody = \"lever\"\ntorque = [0, -40, 0]\n"
                               "table = [[0, 0], [1, 1]]\n";
      const auto engine = run(text, tolerance, 0.1);
      CHECK(engine->bodies()[1].velocity.norm() < 1e-12);
      CHECK(std::abs(engine->forces().joints[0].drive - 7) < 1e-9);
      CHECK(engine->diagnostics().contacts == 1);
      if (friction == 0)
        CHECK(std::abs(total_forces(*engine).contact[1].z() - (7 + weight - 4) / arm) < 1e-8);
      engine->advance(0.5);
      const std::vector<ContactEvent> lifts = of_kind(*engine, Kind::lift);
      REQUIRE(lifts.size() == 1);
      CHECK(std::abs(lifts[0].time - (7 + weight) / 40) < 10 * tolerance);
      CHECK(lifts[0].second + lifts[0].first == 1);
    }
}

TEST_CASE("event: a run of joint laws goes on from saved states with the same bits") {
  const Scene scene = parse_scene(
      "[scene]\nengine = \"event\"\ngravity = [0, -9.81, 0]\nend = 3\n"
      "[[body]]\nname = \"arm\"\nmass = 1\ninertia = [0.1, 0.1, 0.1]\nposition = [0.5, 0, 0]\n"
      "[[joint]]\nkind = \"hinge\"\nbodies = [\"arm\", \"world\"]\nat = [0, 0, 0]\n"
      "axis = [0, 0, 1]\nlimits_deg = [-70, 40]\nlimit_restitution = 0.6\nfriction = 0.3\n"
      "motor = { rate_deg = 50, torque = 3 }\n",
      "laws");
  for (const double cut : {0.2, 0.7, 1.5}) goes_on_with_its_bits(scene, cut, 3);
}

TEST_CASE("event: the table of events names the joint, and none where bodies touch") {
  const std::filesystem::path folder = tether::test::folder("events_of_joints");
  const std::string text =
      "[[body]]\nname = \"ball\"\nshape = \"sphere\"\nradius = 0.1\nmass = 1\nmaterial = \"body\"\n"
      "position = [0, 0, 1]\n[[body]]\nname = \"bead\"\nmass = 1\ninertia = [1, 1, 1]\n"
      "position = [5, 0, 0]\n[[joint]]\nname = \"wire\"\nkind = \"slider\"\n"
      "bodies = [\"bead\", \"world\"]\naxis = [0, 0, 1]\nlimits = [-0.5, 1]\n";
  Scene scene = parse_scene("[scene]\nengine = \"event\"\ngravity = [0, 0, -9.81]\nend = 0.5\n" +
                                kFloor + text + pair(""),
                            "test");
  scene.output["csv"] = (folder / "a.csv").string();
  REQUIRE(tether::scene::run(scene).failure.empty());
  const std::string table = tether::test::content(folder / "a.events.csv");
  CHECK(table.find(",impulse_z_N_s,joint\n") != std::string::npos);
  std::istringstream lines(table);
  int joints = 0, others = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.find(",bead,,") != std::string::npos)
      joints += line.substr(line.size() - 5) == ",wire";
    if (line.find(",ball,floor,") != std::string::npos) others += line.back() == ',';
  }
  CHECK(joints >= 1);
  CHECK(others >= 1);
}

TEST_CASE("event: a motor does not count where contacts press themselves together") {
  using namespace tether::scene::event;
  // Two contacts in one place that slide so that pressing opens them (Painleve, a_nn < mu a_nt),
  // and nothing closes them: of their forces 0 is right. Beside them a motor that is held with 10.
  const auto lawful = [](bool motor) {
    const int n = motor ? 5 : 4;
    Eigen::MatrixXd A = Eigen::MatrixXd::Identity(n, n);
    Eigen::VectorXd b = Eigen::VectorXd::Constant(n, 10);
    Eigen::Matrix2d each;
    each << 1, 0.8, 0.8, 1;
    for (int i = 0; i < 2; ++i) {
      for (int k = 0; k < 2; ++k) A.block<2, 2>(2 * i, 2 * k) = each;
      b.segment<2>(2 * i) << -0.3, -5;
    }
    FrictionProblem problem{A, b, {{0, 1, 0, 2}, {2, 1, 2, 2}}};
    Regimes regimes;
    regimes.of.assign(2, tether::contact::Regime::sliding);
    regimes.directions.assign(2, Eigen::VectorXd::Ones(1));
    regimes.fixed.assign(2, true);
    if (motor) {
      problem.parts.push_back({4, 1, -1, 0, 20});
      regimes.of.push_back(tether::contact::Regime::sticking);
      regimes.directions.emplace_back();
      regimes.fixed.push_back(false);
    }
    return share_forces(problem, regimes).solved;
  };
  CHECK_FALSE(lawful(false));
  CHECK_FALSE(lawful(true));
}

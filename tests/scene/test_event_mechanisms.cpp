// Joints, several contacts and friction in the event engine. SPDX-License-Identifier: BSD-3-Clause
#include <tether/scene/run.hpp>

#include "event/driver.hpp"
#include "event_runs.hpp"
#include "run_files.hpp"
#include "woodpecker.hpp"

using namespace event_runs;

namespace {

std::string cart(double friction) {
  std::string text =
      kFloor +
      "[[body]]\nname = \"cart\"\nmass = 10\ninertia = [1, 1, 1]\nposition = [0, 0, 0.2]\n";
  int k = 0;
  for (const char* at :
       {"[0.5, 0.4, 0.2]", "[0.5, -0.4, 0.2]", "[-0.5, 0.4, 0.2]", "[-0.5, -0.4, 0.2]"}) {
    const std::string name = "wheel " + std::to_string(k++);
    text += "[[body]]\nname = \"" + name +
            "\"\nshape = \"sphere\"\nradius = 0.2\nmass = 1\ninertia = [0.01, 0.02, 0.01]\n"
            "material = \"body\"\nposition = " +
            at + "\n[[joint]]\nkind = \"hinge\"\nbodies = [\"" + name +
            "\", \"cart\"]\nat = " + at + "\naxis = [0, 1, 0]\n";
  }
  return text + "[[pair]]\nbetween = [\"body\", \"body\"]\n" +
         pair("friction = " + number(friction));
}

std::string step_ladder(double friction, double degrees) {
  const double angle = degrees * M_PI / 180, c = std::cos(angle), s = std::sin(angle);
  std::string text = kFloor;
  for (const int side : {-1, 1})
    text +=
        std::string("[[body]]\nname = \"") + (side < 0 ? "left" : "right") +
        "\"\nshape = \"points\"\npoints = [[0.5, 0, 0]]\nmass = 1\ninertia = [0.01, " +
        number(1.0 / 12) + ", " + number(1.0 / 12) + "]\nmaterial = \"body\"\nposition = [" +
        number(0.5 * side * c) + ", 0, " + number(0.5 * s) +
        "]\norientation = { axis = [0, 1, 0], rad = " + number(side > 0 ? angle : M_PI - angle) +
        " }\n";
  return text + "[[joint]]\nkind = \"hinge\"\nbodies = [\"left\", \"right\"]\nat = [0, 0, " +
         number(s) + "]\naxis = [0, 1, 0]\n[[pair]]\nbetween = [\"body\", \"body\"]\n" +
         pair("friction = " + number(friction));
}

// Contacts of the woodpecker.
const std::string kLower = "\"edge\" and \"pole\"", kUpper = "\"edge\" and \"back\"",
                  kBeak = "\"beak\" and \"pole\"";

}  // namespace

TEST_CASE("event: a cart on four hinged wheels rolls down a slope, wheels sharing its weight") {
  const double slope = 10 * M_PI / 180;
  const std::string gravity =
      "[" + number(9.81 * std::sin(slope)) + ", 0, " + number(-9.81 * std::cos(slope)) + "]";
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(cart(0.5), tolerance, 1, gravity);
    CHECK(engine->events().empty());
    CHECK(std::abs(engine->bodies()[1].position.x() - 0.7452762725242567) < 10 * tolerance);
    CHECK(engine->diagnostics().drift < tolerance);
    CHECK(std::abs(ledger(*engine, -9.81 * std::cos(slope) * -0.2 * 14)) < 10 * tolerance);
  }
  // It rolls from mu = .0220408725886 on.
  const auto slip = [&](double friction) {
    const auto engine = run(cart(friction), 1e-8, 0.1, gravity);
    const BodyState& wheel = engine->bodies()[2];
    return wheel.velocity.x() - 0.2 * wheel.angular_velocity.y();
  };
  CHECK(std::abs(slip(0.0221)) < 1e-8);
  CHECK(slip(0.0219) > 1e-4);
}

TEST_CASE("event: a step ladder stands, slides or falls as its friction says") {
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto smooth = run(step_ladder(0, 60), tolerance, 0.5);
    const auto flat = of_kind(*smooth, Kind::impact);
    REQUIRE(!flat.empty() == false);  // its hinge meets no floor: it falls through
    // At the flat position all turns into rotation.
    const auto at_flat = run(step_ladder(0, 60), tolerance, 0.4810659304040532);
    CHECK(std::abs(at_flat->bodies()[2].angular_velocity.y() + 5.048477754073601) <
          10 * tolerance * 5);
    CHECK(std::abs(at_flat->bodies()[2].position.z()) < 10 * tolerance);
    const auto rough = run(step_ladder(0.3, 45), tolerance, 0.454673968534977);
    CHECK(std::abs(rough->bodies()[2].position.z()) < 10 * tolerance);
    CHECK(std::abs(std::abs(rough->bodies()[2].angular_velocity.y()) - 4.299638957499818) <
          10 * tolerance * 5);
  }
  // Stands iff mu >= cot(th) / 2.
  struct Case {
    double degrees, limit;
  };
  for (const Case c : {Case{60, .2886751345948129}, Case{45, .5}}) {
    const auto stands = run(step_ladder(c.limit + 1e-4, c.degrees), 1e-8, 1);
    CHECK(stands->diagnostics().kinetic_energy < 1e-20);
    const auto slides = run(step_ladder(c.limit - 1e-4, c.degrees), 1e-8, 1);
    CHECK(slides->diagnostics().kinetic_energy > 1e-8);
  }
}

TEST_CASE("event: a tilted block rocks with a speed ratio of 0.85 (Housner)") {
  const double tilt = 0.2, c = std::cos(tilt), s = std::sin(tilt);
  const double inertia = (0.16 + 1.44) / 12;
  const std::string text =
      kFloor +
      "[[body]]\nname = \"block\"\nshape = \"points\"\npoints = [[0.2, 0, -0.6], [-0.2, 0, -0.6]]\n"
      "mass = 1\ninertia = [" +
      number(inertia) + ", " + number(inertia) + ", " + number(inertia) +
      "]\nmaterial = \"body\"\nposition = [" + number(-(c * 0.2 - s * 0.6)) + ", 0, " +
      number(s * 0.2 + c * 0.6) + "]\norientation = { axis = [0, 1, 0], rad = 0.2 }\n" +
      pair("friction = 100");
  const double times[] = {0.478068508074417337, 1.10515535689112196, 1.58307313798996064,
                          1.96496438071558101,  2.27723015435507267, 2.53594550232646533,
                          2.75205328528712692,  2.9335369516370769};
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(text, tolerance, 3);
    const auto impacts = of_kind(*engine, Kind::impact);
    REQUIRE(impacts.size() == 8);
    engine->advance(5);
    const auto rests = of_kind(*engine, Kind::rest);
    REQUIRE(rests.size() == 1);
    CHECK(std::abs(rests[0].time - 3.9400541204745794) < 10 * tolerance * 3.94);
    CHECK(engine->events().back().kind == Kind::rest);
    CHECK(engine->bodies()[1].velocity.norm() < tolerance);
    CHECK(std::abs(engine->bodies()[1].position.z() - 0.6) < tolerance);
    for (std::size_t k = 0; k < 8; ++k) {
      CHECK(std::abs(impacts[k].time - times[k]) < 10 * tolerance);
      // A foot is 0.4 m from the one that the block turns about.
      CHECK(std::abs(impacts[k].before + 0.4 * 1.0108061836163 * std::pow(0.85, k)) <
            10 * tolerance);
    }
  }
}

TEST_CASE("event: the woodpecker's first events and states (Glocker)") {
  struct Expected {
    Kind kind;
    std::string contact;
    double time;
  };
  const Expected expected[] = {
      {Kind::stop, kLower, .021636314053},  {Kind::slip, kLower, .061213931248},
      {Kind::lift, kLower, .067023398145},  {Kind::impact, kUpper, .077877992290},
      {Kind::impact, kBeak, .080988805419}, {Kind::impact, kUpper, .081575328790},
      {Kind::lift, kUpper, .083416385579},  {Kind::impact, kLower, .118675112949},
      {Kind::impact, kLower, .121335470558}};
  // By an independent code at two tolerances: y, phi_M, phi_S at 0.1 s.
  const double y = -.00705933034423, phi_M = .0207247690364, phi_S = .00752887681468;
  for (const double tolerance : {1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10}) {
    CAPTURE(tolerance);
    woodpecker::Woodpecker toy(tolerance);
    const auto& events = toy.driver.events();
    const Vector3d there = toy.advanced_to(0.1);
    CHECK(std::abs(there[0] - y) < 10 * tolerance * 0.01);  // its way in a period is 2 cm
    CHECK(std::abs(there[1] - phi_M) < 10 * tolerance * 0.2);
    CHECK(std::abs(there[2] - phi_S) < 10 * tolerance * 0.2);
    toy.advanced_to(0.2);
    REQUIRE(events.size() >= 9);
    for (std::size_t k = 0; k < 9; ++k) {
      CHECK(events[k].kind == expected[k].kind);
      CHECK(toy.model.contact_name(events[k].contact) == expected[k].contact);
      CHECK(std::abs(toy.units.time * events[k].time - expected[k].time) < 10 * tolerance);
    }
    // Energy less work and losses.
    double energy = toy.model.energy() - toy.driver.state()[toy.driver.motion().work()];
    for (const auto& event : events) energy += event.lost;
    CHECK(std::abs(energy - toy.first_energy) * toy.units.energy() < 1e-12);
    CHECK(toy.driver.counts().residual_evaluations < (tolerance < 1e-9 ? 4600 : 2500));
  }
}

TEST_CASE("event: the woodpecker to 0.2 s takes less than 4000 residuals for an error of 1e-8") {
  woodpecker::Woodpecker toy(5e-10), exact(1e-12), loose(5e-5), cycle(1e-6);
  const Vector3d there = exact.advanced_to(0.2), sizes(0.01, 0.2, 0.2);
  const auto error = [&](woodpecker::Woodpecker& of) {
    return (of.advanced_to(0.2) - there).cwiseQuotient(sizes).cwiseAbs().maxCoeff();
  };
  CHECK(error(toy) < 1e-8);
  CHECK(toy.driver.counts().residual_evaluations < 4000);
  // The curve that Siconos ships, of 10000 steps, is off by 2.5e-2.
  CHECK(error(loose) < 2.5e-2);
  CHECK(loose.driver.counts().residual_evaluations < 1000);
  // Its limit cycle: two impacts of the beak are .14597606 s apart. The periods approach it by a
  // factor of -0.85: Aitken's limit of the last three.
  cycle.advanced_to(0.67);
  std::vector<double> beak;
  for (const auto& each : cycle.driver.events())
    if (each.kind == Kind::impact && cycle.model.contact_name(each.contact) == kBeak)
      beak.push_back(cycle.units.time * each.time);
  REQUIRE(beak.size() == 5);
  const double p = beak[2] - beak[1], q = beak[3] - beak[2], r = beak[4] - beak[3];
  CHECK(std::abs(p - (q - p) * (q - p) / (r - 2 * q + p) - .14597606) < 1e-6);
}

TEST_CASE("event: a box on four corners stands, slides, stops and is pulled loose") {
  const auto box = [](const std::string& velocity, double friction) {
    return kFloor + "[[body]]\nname = \"box\"\nshape = \"box\"\nsize = [1, 0.8, 0.5]\nmass = 2\n" +
           "material = \"body\"\nposition = [0, 0, 0.25]\nvelocity = " + velocity + "\n" +
           pair("friction = " + number(friction));
  };
  const std::string slope = "[4.905, 0, " + number(-9.81 * std::cos(M_PI / 6)) + "]";
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    // On 30 deg it stands from mu = tan(30 deg) on: no split of the forces among the corners
    // decides.
    const auto stands = run(box("[0, 0, 0]", 0.58), tolerance, 2, slope);
    CHECK(stands->events().empty());
    CHECK(stands->bodies()[1].velocity.norm() < tolerance);
    const auto slides = run(box("[0, 0, 0]", 0.5), tolerance, 2, slope);
    const double a = 4.905 - 0.5 * 9.81 * std::cos(M_PI / 6);
    CHECK(std::abs(slides->bodies()[1].position.x() - 2 * a) < 10 * tolerance);
    const auto stops = run(box("[1, 0, 0]", 0.3), tolerance, 1);
    REQUIRE(stops->events().size() == 1);
    CHECK(stops->events()[0].kind == Kind::stop);
    CHECK(std::abs(stops->events()[0].time - 1 / (0.3 * 9.81)) < 10 * tolerance);
    CHECK(std::abs(stops->bodies()[1].position.x() - 0.5 / (0.3 * 9.81)) < 10 * tolerance);
    // A spring of 4 N/m whose end moves at 1 m/s, low enough not to tip it: slip at mu m g / k.
    const auto pulled = run(
        box("[0, 0, 0]", 0.3) +
            "[[body]]\nname = \"hook\"\nmass = 1\ninertia = [1, 1, 1]\nposition = [3, 0, 0.25]\n"
            "velocity = [1, 0, 0]\n[[joint]]\nkind = \"slider\"\nbodies = [\"hook\", \"world\"]\n"
            "axis = [1, 0, 0]\nmotion = { rate = 1 }\n[[spring]]\nbodies = [\"box\", \"hook\"]\n"
            "at = [[0, 0, 0.25], [3, 0, 0.25]]\nstiffness = 4\n",
        tolerance, 1.6);
    REQUIRE(pulled->events().size() == 4);  // a line for each corner
    for (const ContactEvent& each : pulled->events()) {
      CHECK(each.kind == Kind::slip);
      CHECK(std::abs(each.time - 0.3 * 2 * 9.81 / 4) < 10 * tolerance);
    }
  }
}

TEST_CASE("event: where the engine gives up its state is saved, and steps take it over") {
  // Dropped from 1 m, e = 1/2: it gives up at the second impact, heights are closed forms.
  const double e = 0.5, first = std::sqrt(2 / 9.81), speed = 9.81 * first;
  const std::string text =
      kFloor + "[[body]]\nname = \"ball\"\nshape = \"sphere\"\nradius = 0.1\n" +
      "mass = 1\nposition = [0, 0, 1.1]\nmaterial = \"body\"\n" + pair("restitution = 0.5");
  const auto scene = [&](const std::string& engine) {
    return parse_scene("[scene]\nend = 1.05\ngravity = [0, 0, -9.81]\nengine = \"" + engine +
                           "\"\n[output]\nevery = 0.01\n" + text,
                       "test");
  };
  const std::string state = (tether::test::folder("hand_over") / "ball.state").string();
  Scene events = scene("event");
  events.output["state"] = state;
  events.event.emplace().max_events = 1;
  const RunResult given_up = tether::scene::run(events);
  CHECK(!given_up.failure.empty());
  REQUIRE(given_up.remarks.size() == 1);
  CHECK(given_up.remarks[0].find("--restart") != std::string::npos);
  // Saved after the first impact, before the second.
  CHECK(given_up.time > first);
  CHECK(given_up.time < 2 * first + 1e-7);
  Scene steps = scene("stepping");
  steps.stepping.emplace().step = 1e-4;
  double height = 0;
  RunOptions on;
  on.restart = state;
  on.force = true;
  on.record = [&](const Engine& engine) { height = engine.bodies()[1].position.z(); };
  CHECK(tether::scene::run(steps, on).failure.empty());
  const double since = 1.05 - 2 * first, up = e * e * speed;
  CHECK(std::abs(height - 0.1 - (up * since - 4.905 * since * since)) < 5e-3);
}

namespace {

/// A ball dropped from 1 m with a restitution of 1/2, whose events end at the second impact.
Scene handed_over(const std::string& more = "") {
  return parse_scene(
      "[scene]\nend = 1.05\ngravity = [0, 0, -9.81]\n[event]\ntolerance = 1e-8\nmax_events = 1\n"
      "otherwise = \"stepping\"\n[stepping]\nstep = 1e-4\n[output]\nevery = 0.05\n" +
          more + kFloor +
          "[[body]]\nname = \"ball\"\nshape = \"sphere\"\nradius = 0.1\nmass = 1\nposition = [0, "
          "0, "
          "1.1]\nmaterial = \"body\"\n" +
          pair("restitution = 0.5"),
      "test");
}

}  // namespace

TEST_CASE("event: with otherwise = \"stepping\" a run goes on in steps, and says so") {
  const double e = 0.5, first = std::sqrt(2 / 9.81), up = e * e * 9.81 * first;
  const std::filesystem::path folder = tether::test::folder("otherwise");
  Scene scene = handed_over();
  CHECK(write_scene(parse_scene(write_scene(scene), "again")) == write_scene(scene));
  scene.output["csv"] = (folder / "a.csv").string();
  const Plan plan = make_plan(scene);
  CHECK(plan.engine == EngineKind::event);
  CHECK(plan.then_steps == 1e-4);
  std::ostringstream said;
  said << plan;
  CHECK(said.str().find("[stepping] takes over, at steps of 0.0001 s") != std::string::npos);

  double height = 0;
  RunOptions options;
  options.record = [&](const Engine& engine) { height = engine.bodies()[1].position.z(); };
  const RunResult result = tether::scene::run(scene, options);
  CHECK(result.failure.empty());
  CHECK(result.engine == "event");
  REQUIRE(result.hand_overs.size() == 1);
  CHECK(!result.hand_overs[0].back);  // max_events is for the whole run
  CHECK(std::abs(result.hand_overs[0].time - 2 * first) < 1e-7);
  CHECK(result.hand_overs[0].why.find("max_events = 1") != std::string::npos);
  CHECK(result.hand_overs[0].why.find("t = 0.90304728") == 0);
  CHECK(result.hand_overs[0].before.impacts == 1);
  const double since = 1.05 - 2 * first;
  CHECK(std::abs(height - 0.1 - (up * since - 4.905 * since * since)) < 1e-3);
  CHECK(std::abs(static_cast<double>(result.counts.steps) - (1.05 - 2 * first) / 1e-4) <= 2);
  // Table of events and of states.
  const std::string events = tether::test::content(folder / "a.events.csv");
  CHECK(events.find(",hand_over,,,") != std::string::npos);
  std::istringstream table(tether::test::content(folder / "a.csv"));
  std::string line;
  std::getline(table, line);
  CHECK(line.find(",drift,in_steps,") != std::string::npos);
  const auto column = static_cast<int>(
      std::count(line.begin(), line.begin() + static_cast<long>(line.find("in_steps")), ','));
  while (std::getline(table, line)) {
    std::size_t at = 0;
    for (int k = 0; k < column; ++k) at = line.find(',', at) + 1;
    CHECK(line.substr(at, 2) == (std::stod(line) < 2 * first ? "0," : "1,"));
  }
}

TEST_CASE("event: hand-overs at any phase of a step keep the time") {
  // The shorter first step: heights are those of the closed form at every step, to its order.
  const double first = std::sqrt(2 / 9.81), up = 0.25 * 9.81 * first;
  for (const double step : {1e-2, 1.1e-2, 1.27e-2, 1e-3}) {
    Scene scene = handed_over();
    scene.stepping->step = step;
    const auto engine = make_engine(scene);
    engine->advance(0.95);
    REQUIRE(engine->in_steps());
    const double since = engine->time() - 2 * first;
    CAPTURE(step, since);
    CHECK(std::abs(std::remainder(engine->time(), step)) < 1e-12);
    // Steps add g dt t / 2 to the height.
    CHECK(std::abs(engine->bodies()[1].position.z() - 0.1 - (up * since - 4.905 * since * since)) <
          4.905 * step * since + 1e-6);
  }
}

TEST_CASE("event: a run that has been handed over is saved and goes on with its bits") {
  Scene scene = handed_over();
  goes_on_with_its_bits(scene, 0.5, 1.0);
  goes_on_with_its_bits(scene, 0.95, 1.0);
  // For a scene of steps alone, too: its bodies come first.
  const auto engine = make_engine(scene);
  engine->advance(0.95);
  std::stringstream state;
  engine->save(state);
  Scene steps = scene;
  steps.event.reset();
  const auto other = make_engine(steps);
  other->restore(state, Engine::Restore::near);
  CHECK(other->time() == engine->time());
  CHECK(other->bodies()[1].position == engine->bodies()[1].position);
}

TEST_CASE("event: what the event engine does not have is stepped where the scene allows it") {
  const std::string rolls =
      "[[body]]\nname = \"hill\"\nshape = \"mesh\"\npoints = [[0, 0, 0], [9, 0, 0], [0, 9, 0]]\n"
      "triangles = [[0, 1, 2]]\nposition = [5, 0, -5]\nfixed = true\nmaterial = \"rubber\"\n"
      "[[pair]]\nbetween = [\"body\", \"rubber\"]\n";
  const Plan plan = make_plan(handed_over(rolls));
  CHECK(plan.engine == EngineKind::stepping);
  CHECK(plan.why.find("mesh") != std::string::npos);
  Scene refused = handed_over(rolls);
  refused.event->otherwise = Otherwise::stop;
  refused.stepping.reset();
  CHECK_THROWS_AS(make_plan(refused), std::invalid_argument);
  CHECK_THROWS_AS(parse_scene("[event]\n[stepping]\n", "two"), SceneError);
}

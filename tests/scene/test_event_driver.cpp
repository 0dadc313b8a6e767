// The event engine's driver by its memory: what one instant may hold. SPDX-License-Identifier:
// BSD-3-Clause
#include <cstdint>
#include <limits>
#include <stdexcept>

#include "event/driver.hpp"
#include "event/model/model.hpp"
#include "event_runs.hpp"
#include "smooth/units.hpp"

using namespace event_runs;
using tether::scene::event::Bounces;
using tether::scene::event::Driver;
using tether::scene::event::DriverOptions;
using tether::scene::event::Model;

namespace {

/// A slider with clearance (Flores): its corners hit in turns, hundreds of times in one instant.
struct Clearance {
  Scene scene;
  tether::scene::Units units = tether::scene::event::units_of(scene);
  Scene in_units = tether::scene::event::scaled(scene, units);
  Model model{in_units, units.time};
  double end = scene.end / units.time;

  explicit Clearance(double restitution = 0.4) : scene(shipped(restitution)) {}
  static Scene shipped(double restitution) {
    Scene scene = read_scene(TETHER_SHIPPED_SCENES "/clearance.toml");
    scene.pairs[0].restitution = restitution;
    return scene;
  }
  DriverOptions options() const {
    DriverOptions out;
    out.tolerance = scene.event->tolerance;
    return out;
  }
};

bool always() { return true; }

}  // namespace

TEST_CASE("event: of the impacts of one instant a contact remembers the first") {
  Clearance c;
  Driver driver(c.model, c.options(), 0, c.model.start());
  int compared = 0;
  while (driver.time() < c.end) {
    driver.advance(c.end, always);
    for (const Bounces& each : driver.memory().bounces)
      for (int k = 0; k + 1 < each.count; ++k) {
        CHECK(each.time[k] > each.time[k + 1]);
        ++compared;
      }
  }
  CHECK(driver.counts().impacts > 100);
  CHECK(compared > 100);
}

TEST_CASE("event: an instant with events without end is refused by name") {
  Clearance c(0);
  const double end = 2 * c.end;
  DriverOptions options = c.options();
  Driver::Memory before;
  // Two corners lift together; whether in one event or two depends on rounding: with one of these
  // tolerances in two.
  long most = 0;
  const auto comes_upon_several = [&] {
    Driver driver(c.model, options, 0, c.model.start());
    Driver::Memory last = driver.memory();
    most = 0;
    while (driver.time() < end) {
      driver.advance(end, always);
      const Driver::Memory now = driver.memory();
      if (now.at_one_time == 0 && most > 0) return true;
      if (now.at_one_time == 1 && most == 0) before = last;
      most = now.at_one_time;
      last = now;
    }
    return false;
  };
  bool found = comes_upon_several();
  for (int k = 0; k < 40 && !found; ++k) {
    options.tolerance *= 0.9;
    found = comes_upon_several();
  }
  REQUIRE(found);
  // The same events once more, the last as the 301st of its instant.
  before.at_one_time = 301 - most;
  Driver again(c.model, options, before);
  CHECK_THROWS_WITH(again.advance(end), Catch::Contains("more than 300 events at one time"));
  before.at_one_time = 300 - most;
  Driver enough(c.model, options, before);
  CHECK_NOTHROW(enough.advance(end));
}

namespace {

template <class T>
std::string with(std::string state, std::size_t at, T value) {
  return state.replace(at, sizeof value, reinterpret_cast<const char*>(&value), sizeof value);
}

std::string saved(const Engine& engine) {
  std::stringstream out;
  engine.save(out);
  return out.str();
}

// Bodies of a state stand in front, then the letters, sizes and units of the engine.
std::size_t numbers_of(const Engine& engine) {
  return 3 * 8 + engine.bodies().size() * 13 * 8 + 8 + 5 * 8;
}

std::string ball(const std::string& velocity) {
  return "[scene]\nengine = \"event\"\nend = 2\n" + kFloor + pair("friction = 0.3") +
         "[[body]]\nname = \"ball\"\nshape = \"sphere\"\nradius = 0.1\nmass = 1\n"
         "material = \"body\"\nposition = [0, 0, 0.2]\nvelocity = " +
         velocity + "\n";
}

}  // namespace

TEST_CASE("event: a state with any number in any place is refused, or moves on") {
  const Scene scene = parse_scene(ball("[1, 0, -0.5]"), "state.toml");
  const auto engine = make_engine(scene);
  engine->advance(0.1);
  const std::string state = saved(*engine);
  int refused = 0;
  const auto tried = [&](const std::string& changed) {
    std::istringstream in(changed);
    try {
      const auto fresh = make_engine(scene);
      fresh->restore(in);
      fresh->advance(0.3);  // behind the impact
    } catch (const std::runtime_error&) {
      ++refused;
    }
  };
  for (std::size_t at = numbers_of(*engine); at + 8 <= state.size(); at += 4) {
    INFO(at);
    for (const double x : {std::nan(""), HUGE_VAL, 1e300, -1.0}) tried(with(state, at, x));
    for (const std::int32_t x : {1, 2, -1, std::numeric_limits<std::int32_t>::max()})
      tried(with(state, at, x));
  }
  CHECK(refused > 200);
}

TEST_CASE("event: a contact of a state slides in a direction, or the state is refused") {
  const Scene scene = parse_scene(ball("[1, 0, -0.5]"), "state.toml");
  const auto engine = make_engine(scene);
  engine->advance(0.1);  // the contact is open, and has no direction
  const std::string state = saved(*engine);
  const std::size_t contact = state.size() - (2 * 4 + 7 * 8 + 2 * 4 + 1);
  for (const std::int32_t mode : {2, 3, -1}) {
    std::istringstream in(with(state, contact, mode));
    CHECK_THROWS_WITH(make_engine(scene)->restore(in), Catch::Contains("damaged"));
  }
}

TEST_CASE("event: a state that claims a time far ahead is refused after the steps of a phase") {
  for (const char* velocity : {"[1, 0, 0.5]", "[1, 0, -0.5]"}) {  // nothing happens; an impact
    const Scene scene = parse_scene(ball(velocity), "state.toml");
    const auto engine = make_engine(scene);
    engine->advance(0.05);
    const std::size_t reached = numbers_of(*engine) + 8;
    for (const double time : {1.0, 1e9, 1e300}) {
      if (time == 1.0 && velocity[7] != '-') continue;  // it is arrived at, with other bits
      std::istringstream in(with(saved(*engine), reached, time));
      const auto fresh = make_engine(scene);
      CHECK_THROWS_AS(fresh->restore(in), std::runtime_error);
      CHECK(fresh->counts().steps <= 5001);
      CHECK(fresh->counts().events <= 1);
    }
  }
}

// Tangents of a contact keep to an axis until its normal comes near to that: what has been, counts.
TEST_CASE("event: a ball held to a dome goes on with its bits after its normal has turned far") {
  const Scene scene = parse_scene(
      "[scene]\nend = 3\ngravity = [0, 0, -9.81]\nengine = \"event\"\n[event]\ntolerance = 1e-7\n" +
          kFloor + pair("restitution = 0.97\nfriction = 0.01") +
          "[[body]]\nname = \"dome\"\nshape = \"sphere\"\nradius = 2\nfixed = true\n"
          "position = [0, 0, -9]\nmaterial = \"dome\"\n"
          "[[body]]\nname = \"slides\"\nshape = \"sphere\"\nradius = 0.1\nmass = 1\n"
          "position = [0.06, 0.08, -6.9023823036596967]\nvelocity = [3.5, 0.1, 0]\n"
          "material = \"held\"\n"
          "[[body]]\nname = \"bounces\"\nshape = \"sphere\"\nradius = 0.1\nmass = 1\n"
          "position = [5, 0, 0.3]\nmaterial = \"body\"\n"
          "[[spring]]\nbodies = [\"slides\", \"world\"]\nstiffness = 30\n"
          "at = [[0.06, 0.08, -6.9023823036596967], [0, 0, -9]]\n"
          "[[pair]]\nbetween = [\"dome\", \"held\"]\nfriction = 0.01\n"
          "[[pair]]\nbetween = [\"dome\", \"body\"]\ntouch = false\n"
          "[[pair]]\nbetween = [\"floor\", \"held\"]\ntouch = false\n"
          "[[pair]]\nbetween = [\"body\", \"held\"]\ntouch = false\n",
      "dome.toml");
  for (const double cut : {0.7, 1.1, 1.5, 1.9, 2.3, 2.7}) {
    INFO("cut at " << cut);
    const auto first = make_engine(scene), second = make_engine(scene);
    first->advance(cut);
    std::istringstream in(saved(*first));
    second->restore(in);
    for (const auto& each : {first.get(), second.get()}) each->advance(3);
    for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
      CHECK(first->bodies()[b].position == second->bodies()[b].position);
      CHECK(first->bodies()[b].velocity == second->bodies()[b].velocity);
      CHECK(first->bodies()[b].angular_velocity == second->bodies()[b].angular_velocity);
    }
  }
}

TEST_CASE("event: a state of another format is refused by name") {
  const Scene scene = parse_scene(ball("[1, 0, -0.5]"), "state.toml");
  const auto engine = make_engine(scene);
  engine->advance(0.3);
  std::string state = saved(*engine);
  const std::size_t format = state.find("event  6");
  REQUIRE(format != std::string::npos);
  for (const char other : {'5', '7'}) {
    state[format + 7] = other;
    std::istringstream in(state);
    CHECK_THROWS_WITH(engine->restore(in), Catch::Contains("not a state of the event engine"));
  }
}

TEST_CASE("event: a storm of events is bounded by work, and named") {
  const Scene scene = parse_scene(
      "[scene]\ngravity = [0, 0, -9.81]\nengine = \"event\"\n[event]\n" + ball(1, 0.99), "storm");
  DriverOptions options;
  options.end = 1000;
  Model model(scene);
  {
    Driver driver(model, options, 0, model.start());
    driver.advance(90);  // a thousand impacts that come to rest cost far less than the bound
    CHECK(driver.counts().impacts > 1000);
    CHECK(driver.motion().work_done() > 1e8);
    CHECK(driver.motion().work_done() < 0.05 * options.storm);
  }
  options.storm = 1e8;
  Model again(scene);
  Driver driver(again, options, 0, again.start());
  CHECK_THROWS_WITH(driver.advance(90), Catch::Contains("a storm of events: the last"));
  CHECK(driver.counts().events >= 100);
  CHECK(driver.time() < 89.85);  // it rests at 89.853
}

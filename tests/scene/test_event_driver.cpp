// The event engine's driver by its memory: what one instant may hold. SPDX-License-Identifier:
// BSD-3-Clause
#include <tether/linalg/index.hpp>

#include "event/driver.hpp"
#include "event/model/scaled_scene.hpp"
#include "event/model/scene_model.hpp"
#include "event_runs.hpp"

using namespace event_runs;
using tether::scene::event::Bounces;
using tether::scene::event::Driver;
using tether::scene::event::DriverOptions;
using tether::scene::event::SceneModel;

namespace {

/// A slider with clearance (Flores): its corners hit in turns, hundreds of times in one instant.
struct Clearance {
  Scene scene = read_scene(TETHER_SHIPPED_SCENES "/clearance.toml");
  tether::scene::smooth::Units units = tether::scene::event::units_of(scene);
  Scene in_units = tether::scene::event::scaled(scene, units);
  SceneModel model{in_units, units.time};
  double end = scene.end / units.time;

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
  Clearance c;
  Driver driver(c.model, c.options(), 0, c.model.start());
  Driver::Memory before = driver.memory();
  while (driver.time() < c.end) {
    driver.advance(c.end, always);
    const Driver::Memory now = driver.memory();
    if (now.at_one_time > 0) break;
    before = now;
  }
  // The same event once more, as the 301st of its instant.
  REQUIRE(driver.memory().at_one_time == 1);
  before.at_one_time = 300;
  Driver again(c.model, c.options(), before);
  CHECK_THROWS_WITH(again.advance(c.end), Catch::Contains("more than 300 events at one time"));
  before.at_one_time = 299;
  Driver enough(c.model, c.options(), before);
  CHECK_NOTHROW(enough.advance(c.end));
}

// Events, steps where these cannot go on, and events again. SPDX-License-Identifier: BSD-3-Clause
#include <functional>
#include <utility>

#include "event/resumable.hpp"
#include "event_runs.hpp"
#include "record/formats.hpp"
#include "run_files.hpp"

using namespace event_runs;
using tether::scene::event::Begin;
using tether::scene::event::ResumableEngine;
using tether::scene::event::SteppedState;

namespace {

/// The event engine, which gives up when it reaches any of some times.
class GivesUp final : public ResumableEngine {
 public:
  GivesUp(std::unique_ptr<ResumableEngine> engine, std::vector<double> times)
      : engine_(std::move(engine)), times_(std::move(times)) {}

  void advance(double t) override {
    for (const double each : times_)
      if (engine_->time() < each && each <= t) {
        engine_->advance(each);
        throw SimulationError("given up for the test");
      }
    engine_->advance(t);
  }
  std::optional<std::vector<int>> closed_in(const SteppedState& state) override {
    return engine_->closed_in(state);
  }
  void resume(const SteppedState& state, const Counts& so_far) override {
    engine_->resume(state, so_far);
  }
  const char* name() const override { return engine_->name(); }
  double time() const override { return engine_->time(); }
  const std::vector<BodyState>& bodies() const override { return engine_->bodies(); }
  Diagnostics diagnostics() const override { return engine_->diagnostics(); }
  const std::vector<ContactState>& contacts() const override { return engine_->contacts(); }
  Forces forces() const override { return engine_->forces(); }
  const std::vector<ContactEvent>& events() const override { return engine_->events(); }
  Counts counts() const override { return engine_->counts(); }
  std::vector<EffectCost> costs() const override { return engine_->costs(); }
  void save(std::ostream& out) const override { engine_->save(out); }
  void restore(std::istream& in, Restore how) override { engine_->restore(in, how); }

 private:
  std::unique_ptr<ResumableEngine> engine_;
  std::vector<double> times_;
};

/// A box falls flat from 5 cm and bounces to rest by 0.31 s; a ball falls on it from above and
/// rests on it by 1.9 s.
Scene box_and_ball(double step) {
  return parse_scene(
      "[scene]\nend = 3\ngravity = [0, 0, -9.81]\nengine = \"event\"\n[event]\n"
      "tolerance = 1e-8\notherwise = \"stepping\"\n[stepping]\nstep = " +
          number(step) + "\n" + kFloor +
          "[[body]]\nname = \"box\"\nshape = \"box\"\nsize = [1, 0.8, 0.4]\nmass = 5\n"
          "position = [0, 0, 0.25]\nmaterial = \"body\"\n"
          "[[body]]\nname = \"ball\"\nshape = \"sphere\"\nradius = 0.1\nmass = 0.5\n"
          "position = [0, 0, 2.5]\nmaterial = \"body\"\n"
          "[[pair]]\nbetween = [\"body\", \"body\"]\nrestitution = 0.5\n" +
          pair("friction = 0.4\nrestitution = 0.5"),
      "test");
}

std::unique_ptr<Engine> engine_that_gives_up(const Scene& scene, const std::vector<double>& times) {
  return tether::scene::event::make_events_then_steps(
      scene, [times](const Scene& each, Begin begin) -> std::unique_ptr<ResumableEngine> {
        return std::make_unique<GivesUp>(tether::scene::event::make_resumable_engine(each, begin),
                                         times);
      });
}

double energy(const Engine& engine) {
  return engine.diagnostics().kinetic_energy + engine.diagnostics().potential_energy;
}

}  // namespace

TEST_CASE("hand-over: steps take an accumulation to its end, and events go on with what follows") {
  // The ball meets the box, at rest by then, at 2 m below: what steps add to its fall is of
  // order 1.
  const double meets = std::sqrt(2 * 2.0 / 9.81);
  struct Case {
    double step, given_up;
    int bounces;  // before
  };
  // Flights are shorter than twenty steps from there on.
  for (const Case c : {Case{1e-3, 0.28, 4}, Case{1e-4, 0.3015, 8}}) {
    const double step = c.step;
    CAPTURE(step);
    const Scene scene = box_and_ball(step);
    const auto engine = engine_that_gives_up(scene, {c.given_up, 1.0});
    const double start = energy(*engine);
    for (int k = 1; k <= 300; ++k) engine->advance(0.01 * k);
    REQUIRE(engine->hand_overs().size() == 2);
    CHECK(!engine->in_steps());
    const HandOver &first = engine->hand_overs()[0], &second = engine->hand_overs()[1];
    CHECK(first.time == Approx(c.given_up).epsilon(1e-12));
    CHECK(second.time == Approx(1.0).epsilon(1e-12));
    CHECK(first.why == "given up for the test");
    REQUIRE(first.back);
    CHECK(*first.back > c.given_up + 19 * step);
    CHECK(*first.back < 0.4);
    // Rows of the table, in order, and the ledger.
    double sum = energy(*engine) - start, last = 0, hit = 0;
    int handed = 0, resumed = 0;
    for (const ContactEvent& each : engine->events()) {
      sum += each.lost;
      handed += each.kind == Kind::hand_over;
      resumed += each.kind == Kind::resume;
      if (each.kind != Kind::rest) CHECK(each.time >= last);
      if (each.kind != Kind::rest) last = each.time;
      if (hit == 0 && each.time > *first.back && each.kind == Kind::impact) hit = each.time;
    }
    CHECK(handed == 2);
    CHECK(resumed == 2);
    CHECK(std::abs(sum) < 1e-9);
    const double bounces =
        5 * 9.81 * 0.05 * std::pow(0.25, c.bounces);  // J, and of the ball's fall
    CHECK(first.lost > 0.3 * bounces);
    CHECK(first.lost < 2 * bounces);
    CHECK(std::abs(hit - meets) < 2 * step);
    // At rest on each other, as exact as events are.
    CHECK(std::abs(engine->bodies()[1].position.z() - 0.2) < 1e-8);
    CHECK(std::abs(engine->bodies()[2].position.z() - 0.5) < 1e-8);
    CHECK(engine->bodies()[2].velocity.norm() < 1e-8);
    CHECK(engine->counts().events == engine->counts_of_events().events);
  }
}

TEST_CASE("hand-over: contacts that a step has left nearly closed are closed, others as they are") {
  // Far away the engine has an origin of its own.
  const Vector3d place = GENERATE(Vector3d(0, 0, 0), Vector3d(8192, -4096, 16384));
  Scene scene = box_and_ball(1e-3);
  for (Body& each : scene.bodies) each.position += place;
  const auto engine = tether::scene::event::make_resumable_engine(scene, Begin::later);
  std::vector<BodyState> bodies(3);
  bodies[1].position = place + Vector3d(0.3, 0, 0.2 + 1e-6);
  bodies[1].velocity = {1.5, 0, -4e-3};
  bodies[1].angular_velocity = {1e-4, -2e-4, 0};
  bodies[2].position = place + Vector3d(0, 0, 2);
  const SteppedState state{0.7, bodies, 1e-3};
  const auto closed = engine->closed_in(state);
  REQUIRE(closed);
  CHECK(closed->size() == 4);
  Counts so_far;
  so_far.events = 7;
  engine->resume(state, so_far);
  CHECK(engine->time() == Approx(0.7).epsilon(1e-15));
  CHECK(engine->counts().events == 7);
  CHECK(std::abs(engine->bodies()[1].position.z() - place.z() - 0.2) < 1e-11);
  CHECK(std::abs(engine->bodies()[1].velocity.z()) < 1e-13);
  CHECK(engine->bodies()[1].angular_velocity.norm() < 1e-13);
  CHECK(engine->bodies()[1].velocity.x() == Approx(1.5).epsilon(1e-3));  // it slips on
  CHECK(engine->diagnostics().contacts == 4);
  CHECK(engine->bodies()[2].position.z() == place.z() + 2);
  bodies[1].position.z() = place.z() + 0.199;
  CHECK(!engine->closed_in(state));
  bodies[1].position.z() = place.z() + 0.2 - 1e-5;
  bodies[1].velocity.z() = 0.1;
  CHECK(!engine->closed_in(state));
  bodies[1].position.z() = place.z() + 0.21;
  REQUIRE(engine->closed_in(state));
  CHECK(engine->closed_in(state)->empty());
}

TEST_CASE("hand-over: an engine that gives up at once gets its turn ever less often") {
  const Scene scene = box_and_ball(1e-3);
  std::vector<double> times;
  for (int k = 1; k <= 3000; ++k) times.push_back(1e-3 * k + 1e-5);
  const auto engine = engine_that_gives_up(scene, times);
  engine->advance(3);
  // After 20, 40, 80, ... steps.
  CHECK(engine->hand_overs().size() >= 4);
  CHECK(engine->hand_overs().size() <= 9);
  for (std::size_t k = 1; k < engine->hand_overs().size(); ++k)
    CHECK(engine->hand_overs()[k].time > *engine->hand_overs()[k - 1].back);
  CHECK(std::abs(engine->bodies()[1].position.z() - 0.2) < 1e-5);
  CHECK(std::abs(engine->bodies()[2].position.z() - 0.5) < 1e-5);
}

TEST_CASE("hand-over: a run goes on with its bits in events, in steps and in events again") {
  const Scene scene = box_and_ball(1e-3);
  const std::vector<double> times = {0.2, 0.7, 1.0};
  for (const double cut : {0.1, 0.21, 0.3, 0.5, 0.705, 0.9, 1.01, 2.0}) {
    CAPTURE(cut);
    const auto first = engine_that_gives_up(scene, times),
               second = engine_that_gives_up(scene, times);
    first->advance(cut);
    std::stringstream state;
    first->save(state);
    second->restore(state);
    CHECK(second->time() == first->time());
    CHECK(second->in_steps() == first->in_steps());
    CHECK(second->hand_overs().size() == first->hand_overs().size());
    first->advance(2.5);
    second->advance(2.5);
    CHECK(second->hand_overs().size() == first->hand_overs().size());
    for (const std::size_t b : {1, 2}) {
      CHECK(second->bodies()[b].position == first->bodies()[b].position);
      CHECK(second->bodies()[b].velocity == first->bodies()[b].velocity);
      CHECK(second->bodies()[b].orientation.coeffs() == first->bodies()[b].orientation.coeffs());
    }
    for (std::size_t k = 0; k < first->hand_overs().size(); ++k) {
      CHECK(second->hand_overs()[k].back == first->hand_overs()[k].back);
      CHECK(second->hand_overs()[k].lost == first->hand_overs()[k].lost);
    }
  }
}

// Bit patterns of another machine's or an enemy's making: sums over them would overflow.
TEST_CASE("hand-over: a state with times or counts that no run has is refused") {
  const Scene scene = box_and_ball(1e-3);
  const std::vector<double> times = {0.2, 0.7};
  const auto engine = engine_that_gives_up(scene, times);
  engine->advance(0.71);  // steps stand in for the second time
  REQUIRE(engine->hand_overs().size() == 2);
  REQUIRE(engine->in_steps());
  std::ostringstream out;
  engine->save(out);
  const std::string state = out.str();
  const auto place_of = [&state](double x) {
    const std::size_t at =
        state.find(std::string(reinterpret_cast<const char*>(&x), sizeof x), state.find("handed"));
    REQUIRE(at != std::string::npos);
    return at;
  };
  const auto tried = [&](std::size_t at, auto x) {
    std::string changed = state;
    changed.replace(at, sizeof x, reinterpret_cast<const char*>(&x), sizeof x);
    std::istringstream in(changed);
    engine_that_gives_up(scene, times)->restore(in);
  };
  const auto damaged = Catch::Contains("the saved state is damaged");
  const std::size_t first = place_of(engine->hand_overs()[0].time),
                    back = place_of(*engine->hand_overs()[0].back),
                    second = place_of(engine->hand_overs()[1].time);
  CHECK_NOTHROW(tried(first, 0.2));
  for (const double time : {-1.0, 0.65, 1e300}) CHECK_THROWS_WITH(tried(first, time), damaged);
  for (const double time : {-1.0, 0.1, 0.72, 1e300}) CHECK_THROWS_WITH(tried(back, time), damaged);
  for (const double time : {0.201, 0.72, 1e300}) CHECK_THROWS_WITH(tried(second, time), damaged);
  for (std::size_t k = 1; k <= 8; ++k)
    for (const std::int64_t n : {std::int64_t{-1}, std::int64_t{1} << 62}) {
      CHECK_THROWS_WITH(tried(first - 8 * k, n), damaged);
      CHECK_THROWS_WITH(tried(second - 8 * k, n), damaged);
    }
}

TEST_CASE("hand-over: tables say when steps had the run, and when events went on") {
  Scene scene = box_and_ball(1e-3);
  const std::filesystem::path folder = tether::test::folder("hand_over_tables");
  const std::string csv = (folder / "a.csv").string(), events = (folder / "a.events.csv").string();
  const auto engine = engine_that_gives_up(scene, {0.24});
  {
    const Plan plan = make_plan(scene);
    const Resume from_start;
    const Processes alone;
    formats::Recorders recorders;
    formats::all().front()->add_recorders(  // csv
        csv, {scene, plan, from_start, alone, energy(*engine), 0}, recorders);
    for (const double t : {0.1, 0.25, 1.5}) {
      engine->advance(t);
      for (const auto& each : recorders) each->record(*engine, engine->diagnostics());
    }
    std::vector<std::string> written, remarks;
    for (const auto& each : recorders) each->finish(written, remarks);
  }
  const std::string rows = tether::test::content(events);
  CHECK(rows.find(",hand_over,,,") < rows.find(",resume,,,"));
  CHECK(rows.find(",resume,,,") != std::string::npos);
  std::istringstream table(tether::test::content(csv));
  std::string line;
  std::getline(table, line);
  const auto column =
      std::count(line.begin(), line.begin() + static_cast<long>(line.find("in_steps")), ',');
  for (const char* wanted : {"0,", "1,", "0,"}) {
    REQUIRE(std::getline(table, line));
    std::size_t at = 0;
    for (long k = 0; k < column; ++k) at = line.find(',', at) + 1;
    CHECK(line.substr(at, 2) == wanted);
  }
}

// Saved and restored runs of the smooth engine. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>

#include "smooth_runs.hpp"

using namespace tether::scene;
using namespace mechanisms;

TEST_CASE("a saved run with a number that is not finite is refused, or does not move by it",
          "[smooth]") {
  const auto a = make_smooth_engine(pendulum(1e-6));
  a->advance(0.1);
  std::stringstream saved;
  a->save(saved);
  const std::string state = saved.str();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  int refused = 0;
  for (std::size_t at = 0; at + 8 <= state.size(); ++at) {
    INFO(at);
    std::string bad = state;
    bad.replace(at, 8, reinterpret_cast<const char*>(&nan), 8);
    std::istringstream in(bad);
    const auto b = make_smooth_engine(pendulum(1e-6));
    try {
      b->restore(in);
    } catch (const std::runtime_error&) {
      ++refused;
      continue;
    }
    CHECK(std::isfinite(b->time()));
    for (const BodyState& each : b->bodies()) {
      CHECK(each.position.allFinite());
      CHECK(each.velocity.allFinite());
    }
  }
  CHECK(refused > 13);
}

TEST_CASE("a saved smooth state with positions or velocities that are no numbers is damaged",
          "[smooth]") {
  const auto a = make_smooth_engine(pendulum(1e-6));
  a->advance(0.1);
  std::stringstream saved;
  a->save(saved);
  const std::string state = saved.str();
  // The anchor's unknowns and those of the time reached stand behind the head; invariants follow.
  std::uint64_t unknowns = 0;
  std::memcpy(&unknowns, &state[8], sizeof unknowns);
  const std::size_t head = 8 + 2 * 8 + 5 * 8;
  REQUIRE(state.size() > head + 2 * 8 * unknowns);
  for (const double wrong : {std::nan(""), HUGE_VAL, -HUGE_VAL})
    for (std::size_t at = head; at < state.size(); at += 8)
      for (const auto how : {Engine::Restore::exact, Engine::Restore::near}) {
        INFO(wrong << " at " << at);
        std::string bad = state;
        bad.replace(at, 8, reinterpret_cast<const char*>(&wrong), 8);
        std::istringstream in(bad);
        CHECK_THROWS_WITH(make_smooth_engine(pendulum(1e-6))->restore(in, how),
                          Catch::Contains("the saved state is damaged"));
      }
}

// A run has outputs within a step and ends at the end of that step; the steps of a restored one
// are asked for that end alone.
TEST_CASE("a run that ends with the step that it has just looked into is restored with its bits",
          "[smooth]") {
  for (const Formulation form : kForms) {
    Scene s = four_bar(1, 1e-6);
    s.smooth->formulation = form;
    for (int k = 1; k <= 8; ++k) {
      const auto a = make_smooth_engine(s);
      a->advance(0.1 * k);
      a->stop_when([] { return true; });
      a->advance(1);  // to the end of the step
      CHECK(a->time() < 1);
      std::stringstream state;
      a->save(state);
      const auto b = make_smooth_engine(s);
      CHECK_NOTHROW(b->restore(state));
      CHECK(b->time() == a->time());
    }
  }
}

TEST_CASE("a saved run and a restored one go on with the same bits", "[smooth]") {
  for (const Formulation form : kForms) {
    Scene s = four_bar(1, 1e-6);
    s.smooth->formulation = form;
    const auto a = make_smooth_engine(s);
    a->advance(0.613);
    std::stringstream state;
    a->save(state);
    a->advance(2);
    const auto b = make_smooth_engine(s);
    b->advance(0.2);
    b->restore(state);
    CHECK(b->time() == 0.613);
    b->advance(2);
    for (std::size_t k = 0; k < s.bodies.size(); ++k) {
      CHECK(a->bodies()[k].position == b->bodies()[k].position);
      CHECK(a->bodies()[k].orientation.coeffs() == b->bodies()[k].orientation.coeffs());
      CHECK(a->bodies()[k].velocity == b->bodies()[k].velocity);
      CHECK(a->bodies()[k].angular_velocity == b->bodies()[k].angular_velocity);
    }
  }
  std::stringstream state;
  make_smooth_engine(pendulum(1e-6))->save(state);
  CHECK_THROWS_AS(make_smooth_engine(four_bar(1, 1e-6))->restore(state), std::runtime_error);
  std::stringstream nonsense("nonsense");
  CHECK_THROWS_AS(make_smooth_engine(four_bar(1, 1e-6))->restore(nonsense), std::runtime_error);
}

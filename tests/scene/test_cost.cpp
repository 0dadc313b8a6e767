// The cost of accuracy: errors are bounded from above. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <tether/scene/cost.hpp>
#include <tether/scene/files.hpp>

#include "cost/with_setting.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using Eigen::Vector3d;

namespace {

struct Truth {
  Vector3d position;
  Vector3d rotation;  // angle about an axis that does not change
};
using ClosedForm = std::function<Truth(double t)>;

/// The largest error of the last body at all records.
double true_error(const Scene& scene, const ClosedForm& truth) {
  double largest = 0;
  RunOptions options;
  options.record = [&](const Engine& engine) {
    const Truth now = truth(engine.time());
    const BodyState& b = engine.bodies().back();
    largest = std::max(largest, (b.position - now.position).norm());
    const double angle = now.rotation.norm();
    Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
    if (angle > 0) q = Eigen::AngleAxisd(angle, now.rotation / angle);
    largest = std::max(largest, b.orientation.angularDistance(q));
  };
  REQUIRE(run(scene, options).failure == "");
  return largest;
}

double true_error(Scene scene, double step, const ClosedForm& truth) {
  scene.stepping->step = step;
  scene.output.every = step;
  return true_error(scene, truth);
}

/// Whatever method and setting is named for a wanted error keeps it, by the closed form.
void check_wanted(const std::string& text, const ClosedForm& truth, std::size_t least) {
  const Scene scene = parse_scene(text, "cost.toml");
  const CostTable table = cost(scene);
  INFO(scene.name << ": " << table.reference << ", off by " << table.reference_error);
  CHECK(table.no_events == "");
  CHECK(table.rows.size() == 16);
  std::size_t named = 0;
  for (const double wanted : {3e-2, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7}) {
    const CostRow* row = table.cheapest(wanted);
    if (row == nullptr) continue;
    ++named;
    Scene chosen = costs::with_setting(scene, row->method, row->setting);
    chosen.output.every = row->method == CostMethod::steps ? row->setting : scene.end / 1999;
    const double error = true_error(chosen, truth);
    INFO("wanted " << wanted << ": " << name(row->method) << " " << row->setting << ", said "
                   << row->error << ", true " << error);
    CHECK(error <= 1.02 * wanted);
  }
  CHECK(named >= least);
  for (const CostRow& row : table.rows) {
    if (row.method != CostMethod::steps || !row.failure.empty()) continue;
    const double error =
        true_error(scene.stepping ? scene : costs::with_setting(scene, row.method, row.setting),
                   row.setting, truth);
    INFO("step " << row.setting << ": said " << row.error << ", true " << error);
    CHECK(error <= 1.0001 * row.error);  // it was measured where each step ends
  }
}

void check_bounds(const std::string& text, const ClosedForm& truth) {
  const Scene scene = parse_scene(text, "cost.toml");
  CostOptions options;
  options.steps = {8e-3, 4e-3, 2e-3, 1e-3, 7e-4};
  const CostTable table = cost(scene, options);
  for (const CostRow& row : table.rows) {
    const double error = true_error(scene, row.setting, truth);
    INFO(scene.name << ", step " << row.setting << ": reported " << row.error << ", true "
                    << error);
    CHECK(row.error >= 0.999 * error);  // the last step may end behind the end
    CHECK(row.error <= 1.5 * error);
  }
  for (const double wanted : {1.7, 1.2, 1.05, 0.9}) {
    const double aim = wanted * true_error(scene, 2e-3, truth);
    const CostRow* row = table.cheapest(aim);
    if (row != nullptr) CHECK(true_error(scene, row->setting, truth) <= 1.02 * aim);
  }
}

const std::string kHead = "end = 2\ngravity = [0, 0, -9.81]\n[stepping]\nstep = 1e-3\n";
const std::string kFloor =
    "[[body]]\nname = \"floor\"\nshape = \"plane\"\nfixed = true\nmaterial = "
    "\"a\"\n[[pair]]\nbetween "
    "= [\"a\", \"a\"]\nfriction = 0.3\n";

}  // namespace

TEST_CASE("reported errors of steps bound the true ones: a thrown body") {
  check_bounds("[scene]\nname = \"thrown\"\n" + kHead +
                   "[[body]]\nshape = \"sphere\"\nradius = 0.1\nmass = 1\nvelocity = [3, 0, 5]\n",
               [](double t) {
                 return Truth{Vector3d(3 * t, 0, 5 * t - 4.905 * t * t), Vector3d::Zero()};
               });
}

TEST_CASE("reported errors of steps bound the true ones: sliding to rest") {
  const double a = 0.3 * 9.81, stop = 3 / a;
  check_bounds("[scene]\nname = \"sliding\"\n" + kHead + kFloor +
                   "[[body]]\nshape = \"box\"\nsize = [0.4, 0.3, 0.1]\nmass = 2\nposition = [0, 0, "
                   "0.05]\nvelocity = [3, 0, 0]\nmaterial = \"a\"\n",
               [=](double t) {
                 const double s = std::min(t, stop);
                 return Truth{Vector3d(3 * s - 0.5 * a * s * s, 0, 0.05), Vector3d::Zero()};
               });
}

namespace {

const std::string kRolling =
    "[[body]]\nshape = \"sphere\"\nradius = 0.5\nmass = 1\nposition = [0, 0, 0.5]\n"
    "velocity = [7, 0, 0]\nmaterial = \"a\"\n";

/// Slides with the friction 0.3 until it rolls.
Truth rolls(double t) {
  const double a = 0.3 * 9.81, roll = 2 * 7 / (7 * a), radius = 0.5;
  const double s = std::min(t, roll), w = 2.5 * a / radius;
  return {Vector3d(7 * s - 0.5 * a * s * s + 5 * (t - s), 0, radius),
          Vector3d(0, 0.5 * w * s * s + 5 / radius * (t - s), 0)};
}

}  // namespace

TEST_CASE("reported errors of steps bound the true ones: from sliding to rolling") {
  check_bounds("[scene]\nname = \"rolling\"\n" + kHead + kFloor + kRolling, rolls);
}

TEST_CASE("what cost names keeps the wanted error: sliding to rest") {
  const double a = 0.3 * 9.81, stop = 3 / a;
  check_wanted(
      "[scene]\nname = \"sliding\"\n" + kHead + kFloor +
          "[[body]]\nshape = \"box\"\nsize = [0.4, 0.3, 0.1]\nmass = 2\nposition = [0, 0, "
          "0.05]\nvelocity = [3, 0, 0]\nmaterial = \"a\"\n",
      [=](double t) {
        const double s = std::min(t, stop);
        return Truth{Vector3d(3 * s - 0.5 * a * s * s, 0, 0.05), Vector3d::Zero()};
      },
      6);
}

TEST_CASE("what cost names keeps the wanted error: from sliding to rolling, by its events") {
  check_wanted(
      "[scene]\nname = \"rolling\"\nengine = \"event\"\nend = 2\n"
      "gravity = [0, 0, -9.81]\n" +
          kFloor + kRolling,
      rolls, 5);
}

TEST_CASE("what cost names keeps the wanted error: a ball that bounces to rest") {
  const double e = GENERATE(0.3, 0.7);
  check_wanted(
      "[scene]\nname = \"bouncing\"\n" + kHead +
          "[[body]]\nname = \"floor\"\nshape = \"plane\"\nfixed = true\nmaterial = "
          "\"a\"\n[[pair]]\nbetween = [\"a\", \"a\"]\nrestitution = " +
          std::to_string(e) +
          "\n[[body]]\nshape = \"sphere\"\nradius = 0.1\nmass = 1\nposition = [0, 0, "
          "0.6]\nmaterial = \"a\"\n",
      [=](double t) {
        double left = t, speed = 0, height = 0.5;
        for (int k = 0; k < 200; ++k) {
          const double flight = (speed + std::sqrt(speed * speed + 2 * 9.81 * height)) / 9.81;
          if (left < flight)
            return Truth{Vector3d(0, 0, 0.1 + height + speed * left - 4.905 * left * left),
                         Vector3d::Zero()};
          left -= flight;
          speed = -e * (speed - 9.81 * flight);
          height = 0;
        }
        return Truth{Vector3d(0, 0, 0.1), Vector3d::Zero()};
      },
      6);
}

TEST_CASE("cost compares what the scene's law allows, and says why not") {
  CostOptions few;
  few.steps = {4e-3, 2e-3};
  few.tolerances = {1e-6};
  few.samples = 50;
  const std::string ball =
      "[[body]]\nshape = \"sphere\"\nradius = 0.1\nmass = 1\nposition = [0, 0, 0.6]\nmaterial = "
      "\"a\"\n[[body]]\nshape = \"plane\"\nfixed = true\nmaterial = \"a\"\n[[pair]]\nbetween = "
      "[\"a\", "
      "\"a\"]\nrestitution = 0.5\n";
  const CostTable all = cost(parse_scene("[scene]\n" + kHead + ball, "test"), few);
  REQUIRE(all.rows.size() == 3);
  CHECK(all.rows[0].method == CostMethod::events);
  CHECK(all.rows[2].method == CostMethod::steps);
  CHECK(all.reference.find("events") != std::string::npos);
  const CostTable other = cost(
      parse_scene("[scene]\n" + kHead + "restitution_law = \"poisson\"\n" + ball, "test"), few);
  CHECK(other.no_events.find("Newton") != std::string::npos);
  CHECK(other.rows.size() == 2);
}

TEST_CASE("cost goes on where a spring is too stiff for the longest steps") {
  CostOptions few;
  few.steps = {4e-2, 2e-3};
  few.samples = 50;
  const CostTable table = cost(
      parse_scene("[scene]\n" + kHead +
                      "[[body]]\nshape = \"sphere\"\nradius = 0.1\nmass = 1\nposition = [0, 0, "
                      "0.6]\nmaterial = \"a\"\n[[body]]\nshape = \"plane\"\nfixed = true\nmaterial "
                      "= \"a\"\n[[pair]]\nbetween = [\"a\", \"a\"]\n[[spring]]\nbodies = [\"body "
                      "1\", \"world\"]\nat = [[0, 0, 0.6], [0, 0, 1]]\nstiffness = 1e4\nrest = "
                      "0.4\n",
                  "test"),
      few);
  REQUIRE(table.rows.size() == 2);
  CHECK(table.rows[0].failure.find("too long for it to be stable") != std::string::npos);
  CHECK(table.rows[1].failure == "");
  CHECK(table.rows[1].error < 0.1);
}

// What accuracy costs: errors are bounded from above. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <tether/scene/cost.hpp>
#include <tether/scene/files.hpp>

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
double true_error(Scene scene, double step, const ClosedForm& truth) {
  scene.stepping->step = step;
  scene.output.every = step;
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

void check_bounds(const std::string& text, const ClosedForm& truth) {
  const Scene scene = parse_scene(text, "cost.toml");
  CostOptions options;
  options.settings = {8e-3, 4e-3, 2e-3, 1e-3, 7e-4};
  const CostTable table = cost(scene, options);
  for (const CostRow& row : table.rows) {
    const double error = true_error(scene, row.setting, truth);
    INFO(scene.name << ", step " << row.setting << ": reported " << row.error << ", true "
                    << error);
    CHECK(row.error >= 0.98 * error);  // looked at a hundred times, not at every step
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

TEST_CASE("reported errors of steps bound the true ones: from sliding to rolling") {
  const double a = 0.3 * 9.81, roll = 2 * 7 / (7 * a), radius = 0.5;
  check_bounds("[scene]\nname = \"rolling\"\n" + kHead + kFloor +
                   "[[body]]\nshape = \"sphere\"\nradius = 0.5\nmass = 1\nposition = [0, 0, "
                   "0.5]\nvelocity = [7, 0, 0]\nmaterial = \"a\"\n",
               [=](double t) {
                 const double s = std::min(t, roll), w = 2.5 * a / radius;
                 return Truth{Vector3d(7 * s - 0.5 * a * s * s + 5 * (t - s), 0, radius),
                              Vector3d(0, 0.5 * w * s * s + 5 / radius * (t - s), 0)};
               });
}

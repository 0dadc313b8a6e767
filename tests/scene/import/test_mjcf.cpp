// Tests: robots of MJCF files as scenes. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <tether/linalg/pi.hpp>
#include <tether/scene/run.hpp>

#include "import/import.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using import::import_robot;
using import::ImportOptions;
using tether::linalg::kPi;

namespace {

Scene mjcf_scene(const std::string& text, const ImportOptions& options = {}) {
  return parse_scene(import_robot(text, "robot.xml", options).toml, "robot.toml");
}

/// A <mujoco> with this in its world, and this before it.
std::string world(const std::string& bodies, const std::string& before = "") {
  return "<mujoco model='m'>\n" + before + "<worldbody>\n" + bodies + "</worldbody></mujoco>\n";
}

bool said(const std::string& text, const std::string& words) {
  for (const std::string& remark : import_robot(text, "robot.xml", {}).remarks)
    if (remark.find(words) != std::string::npos) return true;
  return false;
}

std::string mjcf_refusal(const std::string& text) {
  try {
    import_robot(text, "robot.xml", {});
  } catch (const std::exception& e) {
    return e.what();
  }
  return "";
}

}  // namespace

TEST_CASE("MJCF: masses and inertias of geoms are those of their solids") {
  const Scene scene = mjcf_scene(world(
      "<body name='b'><joint axis='0 1 0'/>"
      "<geom type='box' size='.1 .2 .3' density='500' pos='1 0 0'/>"
      "<geom type='ellipsoid' size='.1 .2 .3' mass='2' pos='-1 0 0'/></body>\n"
      "<body name='c'><freejoint/><geom type='cylinder' fromto='0 0 1 0 0 3' size='.5'/></body>\n"
      "<body name='d'><freejoint/><inertial mass='2' pos='0 0 1' fullinertia='3 4 5 .1 .2 .3'/>"
      "<geom size='1'/></body>\n"));
  const double box = 500 * 0.2 * 0.4 * 0.6, sum = box + 2;
  REQUIRE(scene.bodies.size() == 3);
  CHECK(scene.bodies[0].mass == Approx(sum).epsilon(1e-14));
  CHECK(scene.bodies[0].position.x() == Approx((box - 2) / sum).epsilon(1e-14));
  const double reduced = box * 2 / sum * 4;  // two masses 2 m apart
  CHECK(scene.bodies[0].inertia(0, 0) ==
        Approx(box / 12 * (0.16 + 0.36) + 2 * (0.04 + 0.09) / 5).epsilon(1e-14));
  CHECK(scene.bodies[0].inertia(2, 2) ==
        Approx(box / 12 * (0.04 + 0.16) + 2 * (0.01 + 0.04) / 5 + reduced).epsilon(1e-14));
  const double cylinder = 1000 * kPi * 0.25 * 2;
  CHECK(scene.bodies[1].mass == Approx(cylinder).epsilon(1e-14));
  CHECK(scene.bodies[1].position.z() == Approx(2).epsilon(1e-14));
  CHECK(scene.bodies[1].inertia(2, 2) == Approx(cylinder * 0.125).epsilon(1e-13));
  CHECK(scene.bodies[1].inertia(0, 0) == Approx(cylinder * (0.0625 + 4.0 / 12)).epsilon(1e-13));
  CHECK(scene.bodies[0].shapes[1].kind == ShapeKind::ellipsoid);
  CHECK(scene.bodies[0].shapes[1].size == Eigen::Vector3d(0.1, 0.2, 0.3));
  CHECK(scene.bodies[1].shapes[0].kind == ShapeKind::cylinder);
  CHECK(scene.bodies[1].shapes[0].length == Approx(2).epsilon(1e-14));
  CHECK(scene.bodies[2].mass == 2);
  CHECK(scene.bodies[2].inertia(1, 2) == 0.3);
}

TEST_CASE("MJCF: angles, classes and total mass are taken as the file says") {
  const std::string before =
      "<compiler angle='radian' settotalmass='5'/><option timestep='0.004' gravity='0 0 -1'/>"
      "<default><joint range='-1 2' damping='1'/><default class='x'><joint axis='1 0 0'/>"
      "<geom type='capsule'/></default></default>";
  const std::string text = world(
      "<body name='b' childclass='x' euler='0 0 1.5707963267948966'><joint name='j' ref='0.5'/>"
      "<geom size='.1 .2'/></body>",
      before);
  ImportOptions options;
  options.positions = {{"j", 1}};
  const Scene scene = mjcf_scene(text, options);
  CHECK(scene.gravity->z() == -1);
  REQUIRE(scene.stepping);
  CHECK(scene.stepping->step == 0.004);
  CHECK(scene.bodies[0].mass == Approx(5));
  CHECK(scene.bodies[0].shapes[0].kind == ShapeKind::capsule);
  CHECK(scene.joints[0].axis.y() == Approx(1));  // x, turned by a quarter
  CHECK(scene.joints[0].limits->lower == Approx(-2));
  CHECK(scene.joints[0].limits->upper == Approx(1));
  const Eigen::Quaterniond turned =
      Eigen::Quaterniond(Eigen::AngleAxisd(kPi / 2, Eigen::Vector3d::UnitZ()) *
                         Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitX()));
  CHECK(scene.bodies[0].orientation.angularDistance(turned) < 1e-12);
  CHECK(said(text, "damping of joints: j"));
  const Scene degrees = mjcf_scene(world("<body><joint range='-90 45'/><geom size='1'/></body>"));
  CHECK(degrees.joints[0].limits->upper == Approx(kPi / 4));
  CHECK(degrees.joints[0].limits->lower == Approx(-kPi / 2));
}

TEST_CASE("MJCF: several joints of a body are one where scenes have it") {
  const auto kind = [](const std::string& joints) {
    const Scene scene =
        mjcf_scene(world("<body>" + joints + "<geom size='.1' pos='.3 0 0'/></body>"));
    REQUIRE(scene.joints.size() == 1);
    return scene.joints[0].kind;
  };
  CHECK(kind("<joint axis='1 0 0'/><joint axis='0 1 0'/>") == JointKind::universal);
  CHECK(kind("<joint axis='1 0 0'/><joint axis='0 1 0'/><joint axis='0 0 1'/>") == JointKind::ball);
  CHECK(kind("<joint type='slide' axis='1 0 0'/><joint type='slide' axis='0 0 1'/>"
             "<joint axis='0 1 0'/>") == JointKind::planar);
  CHECK(kind("<joint type='ball'/>") == JointKind::ball);
  // Two that are parallel have a small body between them.
  const std::string two = world(
      "<body name='b'><joint axis='0 1 0'/><joint axis='0 1 0' pos='1 0 0'/>"
      "<geom size='.1' pos='.3 0 0'/></body>");
  const Scene scene = mjcf_scene(two);
  REQUIRE(scene.bodies.size() == 2);
  CHECK(scene.joints.size() == 2);
  CHECK(scene.bodies[1].mass == Approx(1e-6 * scene.bodies[0].mass));
  CHECK(said(two, "small bodies between joints"));
}

TEST_CASE("MJCF: a ball falls on the floor of its world, with MuJoCo's rule of friction") {
  const std::string text = world(
      "<geom name='floor' type='plane' size='1 1 1' friction='.3'/>"
      "<body name='ball' pos='0 0 .5'><freejoint/><geom name='g' size='.1' condim='1' "
      "friction='.7'/></body>");
  ImportOptions options;
  options.end = 0.6;
  const Scene scene = mjcf_scene(text, options);
  REQUIRE(scene.pairs.size() == 2);
  CHECK(scene.pairs[0].friction == 0.7);  // the larger one, since the floor has condim 3
  const RunResult result = run(scene);
  CHECK(result.failure.empty());
  CHECK(result.summary.contacts == 1);
  CHECK(mjcf_scene(
            world("<geom type='plane' size='1 1 1' contype='2' conaffinity='2'/><body><freejoint/>"
                  "<geom size='.1'/></body>"))
            .pairs[0]
            .touch == false);
}

TEST_CASE("an MJCF that is wrong, or asks for more than is read, is refused with its line") {
  const auto refused = [](const std::string& text, const std::string& words) {
    INFO(text);
    const std::string why = mjcf_refusal(text);
    INFO(why);
    CHECK(why.find(words) != std::string::npos);
    CHECK(why.rfind("robot.xml:", 0) == 0);
  };
  refused("<mujoco/>", "worldbody: is missing");
  refused(world("<body><joint type='screw'/><geom size='1'/></body>"),
          "must be hinge, slide, ball");
  refused(world("<body>\n<joint/><geom size='0'/></body>"),
          "robot.xml:4: worldbody: body: geom: size");
  refused(world("<body><joint/><geom type='mesh' mesh='m'/></body>"), "mass of a mesh");
  refused(world("<body><joint/><geom type='plane'/></body>"), "in the world only");
  refused(world("<body><joint class='none'/><geom size='1'/></body>"), "no <default>");
  refused(world("<body name='a'/><body name='a'/>"), "another body");
  refused(world("<replicate count='9'/>"), "is not read");
  refused(world("<include file='x'/>"), "is not read");
  refused(world("", "<compiler coordinate='global'/>"), "must be local");
  refused(world("<body><joint/><geom size='1' quat='0 0 0 0'/></body>"), "quat");
  for (const char* sequence : {"pyZ", "x", "", "xyzx"})
    refused(world("<body><joint/><geom size='1' euler='1 2 3'/></body>",
                  std::string("<compiler eulerseq='") + sequence + "'/>"),
            "must be three of the letters");
  refused(world("<body><joint/><body><freejoint/><geom size='1'/></body></body>"), "free joint");
}

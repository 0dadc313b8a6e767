// Tests: imported robots have MuJoCo's mass matrix, and move as there: bias forces, springs,
// dampers and actuators. SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <fstream>
#include <tether/scene/plan.hpp>

#include "../run_files.hpp"
#include "against_mujoco.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using namespace tether::scene::testing;

namespace {

std::string write_model(const std::string& name, const std::string& text) {
  const std::filesystem::path folder = tether::test::folder("against_mujoco");
  std::filesystem::create_directories(folder);
  const std::filesystem::path file = folder / name;
  std::ofstream(file) << text;
  return file.string();
}

/// Hinges and slides with what `joint` says of each; `two`: a link has two of them.
std::string robot(const std::string& joint, const std::string& more = "", bool two = false) {
  const auto link = [](const std::string& mass) {
    return "<inertial mass='" + mass +
           "' pos='.1 .2 -.3' fullinertia='.09 .08 .07 .01 -.02 .005'/>\n";
  };
  return "<mujoco><compiler angle='radian' autolimits='true'/><option gravity='.3 -.2 -9'/>\n"
         "<worldbody><body name='a' euler='.1 .2 .3'>" +
         link("2") + "<joint name='j1' axis='1 2 3' pos='.1 0 .2' " + joint + "/>\n" +
         "<body name='b' pos='.3 .1 -.4' euler='.5 0 -.3'>" + link("1.3") +
         "<joint name='j2' type='slide' axis='0 1 .5' " + joint + "/>\n" +
         (two ? "" : "<body name='d'>" + link("0.4")) + "<joint name='j3' axis='1 0 0' " + joint +
         "/>\n" + "<body name='c' pos='0 .1 .5'>" + link("0.8") +
         "<joint name='j4' axis='-1 .3 .2' pos='0 .1 0' " + joint + "/></body></body></body>" +
         (two ? "" : "</body>") + "</worldbody>" + more + "</mujoco>\n";
}

void check(const std::string& joint, const std::string& more = "",
           const import::ImportOptions& options = {}) {
  for (const bool two : {false, true}) {
    const std::string text = robot(joint, more, two), file = write_model("robot.xml", text);
    const std::string toml = import::import_robot(text, file, options).toml;
    const bool small = toml.find("small bodies") != std::string::npos;
    CHECK((small || !two));
    for (unsigned seed = 1; seed < 6; ++seed) {
      const Difference found = against_mujoco(text, file, seed, options);
      INFO(text << ", seed " << seed);
      CHECK(found.joints == 4);
      // Small bodies have a millionth of an inertia; MuJoCo finds the axes of one to 1e-9.
      CHECK(found.masses < (small ? 2e-6 : 1e-9));
      CHECK(found.accelerations < (small ? 1e-4 : 1e-7));
    }
  }
}

}  // namespace

TEST_CASE("MuJoCo: masses and bias forces") { check(""); }

TEST_CASE("MuJoCo: armature of hinges and slides") { check("armature='.37'"); }

TEST_CASE("MuJoCo: springs and dampers of joints with a rest") {
  check("stiffness='7' damping='1.3' springref='.4' ref='.1'");
}

TEST_CASE("MuJoCo: actuators with and without feedback, with gears, bounds and controls") {
  const std::string actuators =
      "<actuator><motor name='m' joint='j1' gear='3'/>\n"
      "<position name='p' joint='j2' kp='40' gear='-2'/>\n"
      "<velocity name='v' joint='j3' kv='4' gear='.5' ctrlrange='-1 1'/>\n"
      "<general name='g' joint='j4' biastype='affine' gainprm='3' biasprm='1 -9 -2' gear='1.5' "
      "forcerange='-1 3'/></actuator>";
  check("ref='.1'", actuators);
  import::ImportOptions options;
  options.controls = {{"m", 2.5}, {"p", 0.3}, {"v", 7}, {"g", -0.2}};
  check("ref='.1'", actuators, options);
  options.controls = {{"g", 5}};
  check("armature='.1'", actuators, options);
}

TEST_CASE("MuJoCo: springs and drives of hinges with rests beyond a turn") {
  const std::string far = "<actuator><position name='p' joint='j4' kp='4' gear='.5'/></actuator>";
  import::ImportOptions options;
  options.controls = {{"p", 20}};
  check("armature='.1' stiffness='3' springref='-9'", far, options);
  check("armature='.1' stiffness='3' springref='-9' range='-.3 9'", far, options);
}

TEST_CASE("MuJoCo: motors pull fixed tendons of several joints") {
  const std::string tendon =
      "<tendon><fixed name='t'><joint joint='j1' coef='.5'/><joint joint='j2' coef='-2'/></fixed>"
      "</tendon><actuator><motor name='m' tendon='t' gear='3'/></actuator>";
  import::ImportOptions options;
  options.controls = {{"m", 1.7}};
  check("", tendon, options);
}

TEST_CASE("MuJoCo: the friction of joints that slide is frictionloss") {
  const std::string text = robot("frictionloss='.7'");
  MujocoModel mujoco(write_model("friction.xml", text));
  for (int k = 0; k < 4; ++k) mujoco.data().qvel[k] = k % 2 == 0 ? 5 : -5;
  mj_forward(&mujoco.model(), &mujoco.data());
  const Scene scene = parse_scene(import::import_robot(text, "robot.xml", {}).toml, "robot.toml");
  for (const CommonJoint& each : common_joints(scene, mujoco))
    CHECK(scene.joints[each.joint].friction ==
          Approx(std::abs(mujoco.data().qfrc_constraint[each.dof])));
}

TEST_CASE("MuJoCo: a robot with armature and actuators moves as there") {
  const std::string text = robot(
      "armature='.2' damping='.3' stiffness='5'",
      "<actuator><position name='p' joint='j4' kp='30'/><motor name='m' joint='j2'/></actuator>");
  MujocoModel mujoco(write_model("moves.xml", text));
  mujoco.model().opt.integrator = mjINT_RK4;
  mujoco.model().opt.timestep = 1e-3;
  import::ImportOptions options;
  options.controls = {{"p", 0.5}, {"m", 4}};
  mujoco.data().ctrl[0] = 0.5;
  mujoco.data().ctrl[1] = 4;
  for (int k = 0; k < 500; ++k) mj_step(&mujoco.model(), &mujoco.data());
  mj_forward(&mujoco.model(), &mujoco.data());

  Scene scene = parse_scene(import::import_robot(text, "robot.xml", options).toml, "robot.toml");
  scene.smooth.emplace().tolerance = 1e-8;
  const auto engine = make_engine(scene);
  engine->advance(0.5);
  for (const char* name : {"a", "b", "c"}) {
    const auto body = std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                   [&](const Body& each) { return each.name == name; });
    const mjtNum* const x = mujoco.data().xipos + 3 * mj_name2id(&mujoco.model(), mjOBJ_BODY, name);
    const Eigen::Vector3d there(x[0], x[1], x[2]);
    INFO(name);
    CHECK((there - body->position).norm() > 0.05);
    CHECK((there - engine->bodies()[static_cast<std::size_t>(body - scene.bodies.begin())].position)
              .norm() < 1e-6);
  }
}

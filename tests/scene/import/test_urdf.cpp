// Tests: robots of URDF files as scenes: their mass matrix against the composite rigid body method,
// their motion, what is left out, and files that are wrong. SPDX-License-Identifier: BSD-3-Clause
#include <map>
#include <random>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>

#include "import/import.hpp"
#include "linalg/thrown.hpp"
#include "robots.hpp"
#include "support/catch.hpp"

using namespace tether::scene;
using namespace tether::scene::testing;
using import::import_robot;
using import::ImportOptions;

namespace {

Scene scene_of(const std::string& text, const ImportOptions& options = {}) {
  return parse_scene(import_robot(text, "robot.urdf", options).toml, "robot.toml");
}

/// M_ij = sum of m v_i . v_j + w_i . J w_j over all bodies, v_i and w_i being their velocities
/// where joint i alone has the rate 1; a free base moves by the axes of the world at its origin.
/// Rows in the order of the table, in which each joint is "to LINK".
Eigen::MatrixXd mass_matrix_of(const Scene& scene, const Robot& robot, bool free_base) {
  std::map<std::string, int> row_of;
  for (const RobotLink& link : robot)
    if (link.parent >= 0 && link.type != "fixed")
      row_of.emplace("to " + link.name, (free_base ? 6 : 0) + static_cast<int>(row_of.size()));
  REQUIRE(row_of.size() == scene.joints.size());
  const int base = free_base ? 6 : 0, bodies = static_cast<int>(scene.bodies.size());
  const int rows = base + static_cast<int>(scene.joints.size());
  Eigen::MatrixXd v = Eigen::MatrixXd::Zero(3 * bodies, rows), w = v;
  for (int b = 0; b < bodies; ++b) {
    const Body& body = scene.bodies[static_cast<std::size_t>(b)];
    if (body.fixed) continue;
    for (int k = 0; k < 3 && free_base; ++k) {
      const Eigen::Vector3d u = Eigen::Vector3d::Unit(k);
      w.block<3, 1>(3 * b, k) = u;
      v.block<3, 1>(3 * b, k) = u.cross(body.position);
      v.block<3, 1>(3 * b, 3 + k) = u;
    }
    for (int at = b; at >= 0;) {  // up to the base
      int next = -1;
      for (std::size_t j = 0; j < scene.joints.size(); ++j) {
        const Joint& joint = scene.joints[j];
        if (joint.first != at) continue;
        const int row = row_of.at(joint.name);
        const Eigen::Vector3d u = joint.axis.normalized();
        if (joint.kind == JointKind::slider) {
          v.block<3, 1>(3 * b, row) = u;
        } else {
          REQUIRE(joint.kind == JointKind::hinge);
          w.block<3, 1>(3 * b, row) = u;
          v.block<3, 1>(3 * b, row) = u.cross(body.position - joint.at);
        }
        next = joint.second;
      }
      at = next;
    }
  }
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(rows, rows);
  for (int b = 0; b < bodies; ++b) {
    const Body& body = scene.bodies[static_cast<std::size_t>(b)];
    if (body.fixed) continue;
    const Eigen::Matrix3d R = body.orientation.toRotationMatrix();
    const Eigen::MatrixXd speeds = v.middleRows(3 * b, 3), rates = w.middleRows(3 * b, 3);
    const Eigen::MatrixXd momenta = body.mass * speeds,
                          spins = R * body.inertia * R.transpose() * rates;
    M += speeds.transpose() * momenta;
    M += rates.transpose() * spins;
  }
  return M;
}

std::vector<double> set_positions(const Robot& robot, std::mt19937& random,
                                  ImportOptions& options) {
  std::vector<double> q;
  for (const RobotLink& link : robot) {
    if (link.parent < 0 || link.type == "fixed") continue;
    q.push_back(static_cast<double>(random() % 4000) / 1000 - 2);
    options.positions.emplace_back("to " + link.name, q.back());
  }
  return q;
}

double error(const Robot& robot, bool free_base) {
  std::mt19937 random(5);
  double worst = 0;
  for (int trial = 0; trial < 6; ++trial) {
    ImportOptions options;
    options.base = free_base ? import::Base::free : import::Base::as_file;
    const std::vector<double> q = set_positions(robot, random, options);
    const Eigen::MatrixXd here = mass_matrix_of(scene_of(urdf(robot), options), robot, free_base);
    const Eigen::MatrixXd there = mass_matrix(robot, q, free_base);
    REQUIRE(here.rows() == there.rows());
    worst = std::max(worst, (here - there).norm() / there.norm());
  }
  return worst;
}

std::string urdf_refusal(const std::string& text, const ImportOptions& options = {}) {
  return tether::test::thrown<std::exception>([&] { import_robot(text, "robot.urdf", options); });
}

/// A link with mass, and a second one on a joint with this type and these parts.
std::string two_links(const std::string& type, const std::string& parts,
                      const std::string& link = "") {
  const std::string inertial =
      "<inertial><mass value='2'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' "
      "izz='1'/></inertial>";
  return "<robot name='r'>\n<link name='a'/>\n<link name='b'>" + inertial + link +
         "</link>\n<joint name='j' type='" + type + "'><parent link='a'/><child link='b'/>\n" +
         parts + "</joint>\n</robot>\n";
}

bool says(const std::vector<std::string>& remarks, const std::string& words) {
  for (const std::string& remark : remarks)
    if (remark.find(words) != std::string::npos) return true;
  return false;
}

}  // namespace

TEST_CASE("mass matrix of an arm with seven axes: that of the composite rigid body method") {
  CHECK(error(arm(), false) < 1e-13);
}

TEST_CASE("mass matrix of a walker on a free base: that of the composite rigid body method") {
  CHECK(error(walker(), true) < 1e-13);
}

TEST_CASE("mass matrix of robots of a millimetre and of a kilometre") {
  for (const double scale : {1e-3, 1e3}) {
    Robot robot = arm();
    for (RobotLink& link : robot) {
      link.xyz *= scale;
      link.centre *= scale;
      link.mass *= scale * scale * scale;
      link.inertia *= std::pow(scale, 5);
      if (link.type == "prismatic") link.type = "revolute";  // one unit for all rows
    }
    CHECK(error(robot, false) < 1e-13);
  }
}

TEST_CASE("an imported arm swings with its energy, on its joints") {
  ImportOptions options;
  options.joint_laws = false;
  options.positions = {{"to upper arm", 0.9}, {"to forearm", -0.4}};
  options.end = 0.5;
  Scene scene = scene_of(urdf(arm()), options);
  CHECK(make_plan(scene).engine == EngineKind::smooth);
  const RunResult result = run(scene);
  CHECK(result.failure.empty());
  CHECK(result.summary.drift < 1e-12);
  CHECK(std::abs(result.summary.end_energy - result.summary.start_energy) < 1e-3);
}

TEST_CASE("an imported walker falls on its feet and stays on the ground") {
  ImportOptions options;
  options.base = import::Base::free;
  options.height = 1;
  options.ground = 0;
  options.friction = 0.8;
  options.end = 0.4;
  Scene scene = scene_of(urdf(walker()), options);
  CHECK(make_plan(scene).engine == EngineKind::stepping);
  REQUIRE(scene.pairs.size() == 2);
  CHECK(scene.pairs[0].friction == 0.8);
  CHECK_FALSE(scene.pairs[1].touch);
  const RunResult result = run(scene);
  CHECK(result.failure.empty());
  CHECK(result.summary.drift < 1e-9);
  CHECK(result.summary.contacts > 0);
  CHECK(result.summary.penetration < 1e-3);
}

TEST_CASE("a joint that mimics another one starts where it follows it, and is coupled to it") {
  const std::string inertial =
      "<inertial><mass value='2'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' "
      "izz='1'/></inertial>";
  const auto link = [&](const std::string& name) {
    return "<link name='" + name + "'>" + inertial + "</link>\n";
  };
  const auto joint = [](const std::string& name, const std::string& child,
                        const std::string& more) {
    return "<joint name='" + name + "' type='prismatic'><parent link='a'/><child link='" + child +
           "'/><axis xyz='1 0 0'/><limit lower='-1' upper='1'/>" + more + "</joint>\n";
  };
  const std::string text = "<robot name='r'>\n" + link("a") + link("b") + link("c") + link("d") +
                           joint("j", "b", "<mimic joint='k' multiplier='-0.5' offset='0.1'/>") +
                           joint("k", "c", "") + joint("l", "d", "<mimic joint='l'/>") +
                           "</robot>\n";
  ImportOptions options;
  options.positions = {{"k", 0.4}};
  const import::Imported made = import_robot(text, "robot.urdf", options);
  const Scene scene = parse_scene(made.toml, "robot.toml");
  REQUIRE(scene.couplings.size() == 1);
  const auto& pair = scene.couplings[0].joints;
  CHECK(scene.joints[static_cast<std::size_t>(pair[0])].name == "j");
  CHECK(scene.joints[static_cast<std::size_t>(pair[1])].name == "k");
  CHECK(scene.couplings[0].polynomial == std::vector<double>{-0.5});
  const int body = scene.joints[static_cast<std::size_t>(pair[0])].first;
  CHECK(scene.bodies[static_cast<std::size_t>(body)].position.x() == Approx(-0.1));
  CHECK(says(made.remarks, "mimic of joints that are none of their own here: l"));
  std::string gone = text;
  gone.replace(gone.find("joint='l'"), 9, "joint='gone'");
  const std::string refused = urdf_refusal(gone);
  CHECK(refused.find("joint \"l\": mimic: joint") != std::string::npos);
  CHECK(refused.find("\"gone\": there is no such joint") != std::string::npos);
}

TEST_CASE("limits and friction follow the start; what scenes do not have is said by name") {
  const std::string text =
      two_links("revolute",
                "<axis xyz='0 0 4'/><limit lower='-1' upper='2' effort='3' velocity='4'/>"
                "<dynamics damping='0.5' friction='0.25'/><mimic joint='j'/><strange/>",
                "<collision><geometry><mesh filename='x.stl'/></geometry></collision><visual/>");
  ImportOptions options;
  options.positions = {{"j", 0.5}};
  const import::Imported made = import_robot(text, "robot.urdf", options);
  const Scene scene = parse_scene(made.toml, "robot.toml");
  REQUIRE(scene.joints.size() == 1);
  const Joint& joint = scene.joints.front();
  CHECK(joint.limits->lower == -1.5);
  CHECK(joint.limits->upper == 1.5);
  CHECK(joint.friction == 0.25);
  REQUIRE(joint.spring);
  CHECK(joint.spring->damping == 0.5);
  CHECK(joint.axis.z() == 1);
  for (const char* words : {"limit effort", "limit velocity", "mimic", "<strange> in <joint>: j",
                            "<mesh>: b", "<visual>"}) {
    INFO(words);
    CHECK(says(made.remarks, words));
    CHECK(made.toml.find(words) != std::string::npos);
  }
  options.joint_laws = false;
  CHECK_FALSE(scene_of(text, options).joints.front().limits);
  options = {};
  options.held = {"j"};
  CHECK(urdf_refusal(text, options).find("--base free") != std::string::npos);
  options.base = import::Base::free;
  CHECK(scene_of(text, options).joints.empty());
}

TEST_CASE("a joint whose zero lies beyond its limits starts at the nearest one") {
  const auto made =
      import_robot(two_links("prismatic", "<limit lower='0.2' upper='0.7'/>"), "robot.urdf", {});
  const Scene scene = parse_scene(made.toml, "robot.toml");
  CHECK(scene.bodies.front().position.x() == 0.2);
  CHECK(scene.joints.front().limits->lower == 0);
  CHECK(scene.joints.front().limits->upper == Approx(0.5));
  CHECK(says(made.remarks, "nearest limit"));
}

TEST_CASE("a joint whose limits are equal is fixed there; 0 and 0 are none, as in MuJoCo") {
  const auto robot = [](const std::string& type, const std::string& limit) {
    std::string text = two_links(type, limit);
    const std::string base = "<link name='a'/>", link = "<link name='b'>";
    const std::size_t mass = text.find(link) + link.size();
    const std::string with_mass =
        "<link name='a'>" + text.substr(mass, text.find("</link>") - mass) + "</link>";
    return text.replace(text.find(base), base.size(), with_mass);
  };
  for (const char* type : {"revolute", "prismatic"}) {
    const std::string fixed = robot(type, "<limit lower='0.5' upper='0.5'/>");
    ImportOptions options;
    options.base = import::Base::free;
    CHECK(scene_of(fixed, options).joints.empty());
    CHECK(scene_of(fixed, options).bodies.size() == 1);
    CHECK(says(import_robot(fixed, "robot.urdf", options).remarks,
               "equal, which are fixed there: j"));
    options.joint_laws = false;
    CHECK(scene_of(fixed, options).joints.size() == 1);
    options.joint_laws = true;
    for (const char* none : {"<limit/>", "<limit lower='0' upper='0'/>"}) {
      const std::string free = robot(type, none);
      REQUIRE(scene_of(free, options).joints.size() == 1);
      CHECK_FALSE(scene_of(free, options).joints.front().limits);
      CHECK(says(import_robot(free, "robot.urdf", options).remarks, "move freely"));
    }
  }
}

TEST_CASE("links without mass: two hinges that cross are a universal joint, three are a ball") {
  const std::string hinge =
      "<joint name='{0}' type='continuous'><parent link='{1}'/><child "
      "link='{2}'/><axis xyz='{3}'/></joint>\n";
  const std::string inertial =
      "<inertial><mass value='2'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' "
      "izz='1'/></inertial>";
  const std::string two = "<robot name='r'><link name='a'/><link name='b'/><link name='c'>" +
                          inertial + "</link>" +
                          fmt::format(fmt::runtime(hinge), "1", "a", "b", "1 0 0") +
                          fmt::format(fmt::runtime(hinge), "2", "b", "c", "0 1 0");
  Scene scene = scene_of(two + "</robot>");
  REQUIRE(scene.joints.size() == 1);
  CHECK(scene.joints.front().kind == JointKind::universal);
  CHECK(scene.joints.front().axis_second.x() == 1);
  scene = scene_of(two + "<link name='d'>" + inertial + "</link>" +
                   fmt::format(fmt::runtime(hinge), "3", "c", "d", "0 0 1") + "</robot>");
  CHECK(scene.joints.size() == 2);
  std::string three = two + "<link name='d'>" + inertial + "</link>" +
                      fmt::format(fmt::runtime(hinge), "3", "c", "d", "0 0 1") + "</robot>";
  three.erase(three.find(inertial), inertial.size());
  scene = scene_of(three);
  REQUIRE(scene.joints.size() == 1);
  CHECK(scene.joints.front().kind == JointKind::ball);
  CHECK(scene.bodies.size() == 1);
}

TEST_CASE("limits beyond a turn of a link without mass are those of what hangs on it") {
  std::string text = two_links("revolute", "<limit lower='-7' upper='7'/>");
  const std::string joint =
      "<joint name='k' type='revolute'><parent link='b'/><child link='c'/>"
      "<axis xyz='0 1 0'/><limit lower='-8' upper='8'/></joint><link name='c'/></robot>";
  text.replace(text.find("</robot>"), 8, joint);
  // The mass of b goes to c.
  const std::size_t from = text.find("<inertial>"), to = text.find("</inertial>") + 11;
  const std::string inertial = text.substr(from, to - from);
  text.erase(from, to - from);
  text.replace(text.find("<link name='c'/>"), 16, "<link name='c'>" + inertial + "</link>");
  const Scene scene = scene_of(text);
  int wide = 0;
  for (const Joint& each : scene.joints)
    if (each.kind == JointKind::slider && each.limits) ++wide;
  CHECK(wide == 2);
  CHECK(scene.couplings.size() == 2);
  for (const Body& body : scene.bodies) CHECK(body.mass > 0);
}

TEST_CASE("a joint without limit moves freely, which is said") {
  const import::Imported made = import_robot(two_links("revolute", ""), "robot.urdf", {});
  CHECK_FALSE(parse_scene(made.toml, "r.toml").joints.front().limits);
  CHECK(made.toml.find("joints without <limit>, which move freely: j") != std::string::npos);
}

TEST_CASE("a URDF that is wrong is refused with the line of the element") {
  const auto refused = [](const std::string& text, const std::string& words) {
    INFO(text);
    INFO(words);
    const std::string why = urdf_refusal(text);
    INFO(why);
    CHECK(why.find(words) != std::string::npos);
    CHECK(why.rfind("robot.urdf:", 0) == 0);
  };
  const std::string limit = "<limit lower='-1' upper='1'/>";
  refused("", "robot.urdf:1: is not XML");
  refused("<robot>", "is not XML");
  refused("<robot name='r'/>", "robot.urdf:1: robot: has no link");
  refused("<model/>", "must be <robot>");
  refused("<!DOCTYPE robot [<!ENTITY a 'b'>]><robot/>", "DOCTYPE");
  refused("<robot name='\xff'/>", "UTF-8");
  refused("<robot name='&#xd800;'/>", "character");
  refused("<robot name='a' name='b'/>", "XML_ERROR_PARSING_ATTRIBUTE");
  std::string deep;
  for (int k = 0; k < 2000; ++k) deep += "<robot>";
  refused(deep, "elements inside each other");
  refused(two_links("hinge", limit), "joint \"j\": type = \"hinge\": must be revolute");
  refused(two_links("revolute", "<limit lower='2' upper='1'/>"),
          "robot.urdf:5: joint \"j\": limit: lower");
  refused(two_links("revolute", limit + "<axis xyz='0 0 0'/>"), "axis: xyz = \"0 0 0\"");
  refused(two_links("revolute", limit + "<axis xyz='0 nan 0'/>"), "must be 3 finite numbers");
  refused(two_links("revolute", limit + "<axis xyz='0 1'/>"), "must be 3 finite numbers");
  refused(two_links("revolute", limit + "<origin xyz='1e999 0 0'/>"), "must be 3 finite numbers");
  refused(two_links("revolute", limit + "<origin xyz='1e300 0 0'/>"), "beyond 1e+09 m");
  refused(two_links("revolute", limit + limit), "joint \"j\": limit: stands twice");
  refused(two_links("revolute", limit,
                    "<collision><geometry><box size='1 1 -1'/></geometry></collision>"),
          "link \"b\": collision: geometry: box: size");
  for (const char* name : {"a,b", "=1+1", "@a", "a\xe2\x80\xae", "a\xc2\x9b", "a\x7f"})
    refused("<robot>\n<link name='" + std::string(name) + "'/></robot>", "robot.urdf:2: link \"");
  refused("<robot>\n<link name='a'/>\n<link name='a'/></robot>",
          "robot.urdf:3: link \"a\": name: another");
  refused("<robot>\n<link name='a'/>\n<link name='b'/></robot>", "one link is the base");
  refused(
      "<robot><link name='a'/><joint name='j' type='fixed'><parent link='a'/><child "
      "link='c'/></joint></robot>",
      "child = \"c\": there is no such link");
  refused("<robot><link name='a'/><joint name='j' type='fixed'><child link='a'/></joint></robot>",
          "parent: is missing");
  const auto fixed = [](const std::string& name, const std::string& from, const std::string& to) {
    return "<joint name='" + name + "' type='fixed'><parent link='" + from + "'/><child link='" +
           to + "'/></joint>";
  };
  refused("<robot><link name='a'/><link name='b'/>" + fixed("j", "a", "b") + fixed("k", "b", "a") +
              "</robot>",
          "loop");
  refused("<robot><link name='a'/><link name='b'/><link name='c'/>" + fixed("j", "a", "c") +
              fixed("k", "b", "c") + "</robot>",
          "is carried by joint \"j\" already");
  refused("<robot><link name='a'/><link name='b'/><link name='c'/>" + fixed("j", "a", "b") +
              fixed("j", "a", "c") + "</robot>",
          "joint \"j\": name: another joint");
  refused("<robot><xacro:macro name='x'/><link name='a'/></robot>", "xacro");
  std::string bad = two_links("revolute", limit);
  bad.replace(bad.find("ixx='1'"), 7, "ixx='3'");
  refused(bad, "link \"b\": inertia = [3, 1, 1, 0, 0, 0]: no body has this");
  ImportOptions mend;
  mend.mend = true;
  const Scene scene = scene_of(bad, mend);
  CHECK(scene.bodies.front().inertia.trace() == Approx(6));
}

TEST_CASE("texts of a robot file stay texts: none ends a comment or a string of the scene") {
  std::string text = two_links("continuous", "<odd name='&#10;[[body]]&#10;mass = 1'/>");
  text.replace(text.find("'r'"), 3, "'&#10;[scene]&#10;end = 7 # \" &#27;[2J'");
  const import::Imported made = import_robot(text, "a\nb.urdf", {});
  const Scene scene = parse_scene(made.toml, "robot.toml");
  CHECK(scene.end == 1);
  CHECK(scene.bodies.size() == 1);
  CHECK(made.toml.find('\x1b') == std::string::npos);
}

TEST_CASE("options of an import that name nothing are refused by name") {
  const std::string text = two_links("prismatic", "<limit lower='-1' upper='1'/>");
  ImportOptions options;
  options.positions = {{"k", 0}};
  CHECK(urdf_refusal(text, options) == "--joint k: no joint that moves has this name; there are j");
  options.positions = {{"j", 3}};
  CHECK(urdf_refusal(text, options) == "--joint j=3: its limits are -1 and 1");
  options.positions.clear();
  options.held = {"none"};
  CHECK(urdf_refusal(text, options).rfind("--hold none: no joint", 0) == 0);
}

// Tests: robots of MJCF files as scenes. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <tether/linalg/pi.hpp>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>

#include "import/import.hpp"
#include "linalg/thrown.hpp"
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
  return tether::test::thrown<std::exception>([&] { import_robot(text, "robot.xml", {}); });
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
  REQUIRE(scene.joints[0].spring);
  CHECK(scene.joints[0].spring->damping == 1);
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
            .pairs.empty());
}

TEST_CASE("MJCF: the outermost class of defaults has any name, and holds without one") {
  const std::string link = "<body name='b'><joint axis='0 1 0'/><geom size='0.05 0.3'/></body>";
  const double capsule = 2000 * kPi * 0.05 * 0.05 * (0.6 + 4.0 / 3 * 0.05);
  for (const std::string name : {"class='robot'", "class='main'", ""}) {
    INFO(name);
    const Scene scene =
        mjcf_scene(world(link, "<default " + name +
                                   "><geom type='capsule' size='0.25 0.4' density='2000'/><joint "
                                   "damping='0' limited='true' range='-10 10'/></default>"));
    CHECK(scene.bodies[0].shapes[0].kind == ShapeKind::capsule);
    CHECK(scene.bodies[0].mass == Approx(capsule).epsilon(1e-13));
    CHECK(scene.joints[0].limits->upper == Approx(kPi / 18).epsilon(1e-14));
  }
  // By its name, by none, and below it.
  const Scene scene = mjcf_scene(
      world("<body name='a'><freejoint/><geom class='robot' size='1'/></body>"
            "<body name='b'><freejoint/><geom size='1'/></body>"
            "<body name='c'><freejoint/><geom class='light' size='1'/></body>",
            "<default class='robot'><geom type='sphere' density='3000'/><default class='light'>"
            "<geom density='300'/></default></default>"));
  const double volume = 4 * kPi / 3;
  CHECK(scene.bodies[0].mass == Approx(3000 * volume));
  CHECK(scene.bodies[1].mass == Approx(3000 * volume));
  CHECK(scene.bodies[2].mass == Approx(300 * volume));
}

TEST_CASE("MJCF: free objects touch each other, by contype and conaffinity") {
  const auto ball = [](const std::string& name, double z, const std::string& more = "") {
    return "<body name='" + name + "' pos='0 0 " + std::to_string(z) +
           "'><freejoint/><geom size='.1' mass='1' " + more + "/></body>";
  };
  const std::string floor = "<geom type='plane' size='5 5 .1'/>";
  ImportOptions options;
  options.end = 0.5;
  const auto height = [&](const std::string& low, const std::string& high) {
    Scene scene =
        mjcf_scene(world(floor + ball("low", 0.1, low) + ball("high", 0.3, high)), options);
    Expect expect;
    expect.time = 0.5;
    expect.quantity = Quantity::position;
    expect.body = 2;
    expect.at_least = 0;
    scene.expect = {expect};
    return run(scene).judgements[0].value[2];
  };
  CHECK(height("", "") == Approx(0.3).margin(1e-4));
  CHECK(height("", "contype='2' conaffinity='1'") == Approx(0.3).margin(1e-4));
  CHECK(height("contype='3'", "contype='4' conaffinity='2'") == Approx(0.3).margin(1e-4));
  // Types that meet each other, and neither the floor: both fall, and nothing holds the upper one.
  CHECK(height("contype='2' conaffinity='2'", "contype='2' conaffinity='2'") < 0);
  CHECK_FALSE(said(world(floor + ball("low", 0.1) + ball("high", 0.3)), "with itself"));
  // Without any floor: two balls meet in the middle.
  const Scene free = mjcf_scene(world(ball("low", 0.1) + ball("high", 0.3)));
  REQUIRE(free.pairs.size() == 1);
  CHECK(free.pairs[0].touch);
  CHECK(free.pairs[0].friction == 1);
}

TEST_CASE("MJCF: neighbours in a tree pass through each other, others touch") {
  const std::string geom = "<geom type='capsule' size='.1' fromto='0 0 0 0 0 1'/>";
  const auto chain = [&](int links, const std::string& joints = "<joint axis='0 1 0'/>") {
    std::string text, ends;
    for (int k = 0; k < links; ++k, ends += "</body>")
      text += "<body name='l" + std::to_string(k) + "' pos='0 0 1'>" + joints + geom;
    return text + ends;
  };
  CHECK(mjcf_scene(world(chain(2))).pairs.empty());
  const Scene three = mjcf_scene(world(chain(3)));
  REQUIRE(three.pairs.size() == 1);
  CHECK(three.pairs[0].touch);
  const auto touches = [](const Scene& scene, const std::string& a, const std::string& b) {
    const auto material = [&](const std::string& name) {
      for (const Body& each : scene.bodies)
        if (each.name == name) return each.material;
      return std::string("none");
    };
    for (const Pair& pair : scene.pairs)
      if (std::minmax(pair.first, pair.second) == std::minmax(material(a), material(b)))
        return pair.touch;
    return false;
  };
  // Two joints in a row: a small body stands between the neighbours.
  const std::string two = "<joint axis='0 1 0'/><joint axis='0 1 0' pos='0 0 .5'/>";
  const Scene small =
      mjcf_scene(world(chain(3, two) + "<body name='ball'><freejoint/>" + geom + "</body>"));
  CHECK_FALSE(touches(small, "l0", "l1"));
  CHECK_FALSE(touches(small, "l1", "l2"));
  CHECK(touches(small, "l0", "l2"));
  CHECK(touches(small, "l1", "ball"));
  // The file itself excludes pairs.
  const std::string excluded = "<contact><exclude body1='l2' body2='l0'/></contact>";
  CHECK(mjcf_scene(world(chain(3), excluded)).pairs.empty());
  const Scene four = mjcf_scene(world(chain(4), excluded));
  CHECK_FALSE(touches(four, "l0", "l2"));
  CHECK(touches(four, "l0", "l3"));
  CHECK(touches(four, "l1", "l3"));
}

TEST_CASE("MJCF: the edges of a box between two points stand as MuJoCo turns them") {
  const Eigen::Vector3d from(0.1, -0.2, 0.3), to(0.4, 0.5, 0.1), axis = (from - to).normalized();
  const Scene scene =
      mjcf_scene(world("<body name='b'><freejoint/><geom type='box' size='.05' "
                       "fromto='0.1 -0.2 0.3 0.4 0.5 0.1'/></body>"));
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ(), across = z.cross(axis);
  const Eigen::Matrix3d wanted(
      Eigen::AngleAxisd(std::atan2(across.norm(), axis.z()), across.normalized()));
  const Body& body = scene.bodies[0];
  const Eigen::Matrix3d found(body.orientation * body.shapes[0].orientation);
  CHECK((found - wanted).norm() < 1e-14);
  CHECK((body.shapes[0].size - Eigen::Vector3d(0.1, 0.1, (from - to).norm())).norm() < 1e-14);
  CHECK((body.position - (from + to) / 2).norm() < 1e-14);
}

TEST_CASE("MJCF: nothing touches where the file disables contacts") {
  const std::string bodies =
      "<geom type='plane' size='1 1 1'/><body name='b' pos='0 0 1'><freejoint/><geom size='.1'/>"
      "</body>";
  CHECK(mjcf_scene(world(bodies)).pairs.size() == 2);
  CHECK(mjcf_scene(world(bodies, "<option><flag contact='disable'/></option>")).pairs.empty());
}

TEST_CASE("MJCF: frames place what is in them, and replicas follow each other") {
  const std::string geom = "<geom type='box' size='.1 .2 .3' pos='.1 0 0' mass='2'/>";
  const std::string inner = "<joint name='j' axis='0 1 0' pos='0 .1 0'/>" + geom;
  const Scene plain =
      mjcf_scene(world("<body name='b' pos='3 2 1' euler='0 0 90'>" + inner + "</body>"));
  // Three turns of 30 degrees about z, each in the axes of the one around it, and the places.
  const Scene framed = mjcf_scene(
      world("<frame pos='3 1 1' euler='0 0 30'><frame euler='0 0 30'><body name='b' pos='"
            "0.8660254037844386 0.5 0' euler='0 0 30'>" +
            inner + "</body></frame></frame>"));
  CHECK((plain.bodies[0].position - framed.bodies[0].position).norm() < 1e-14);
  CHECK((plain.joints[0].axis - framed.joints[0].axis).norm() < 1e-14);
  CHECK((plain.joints[0].at - framed.joints[0].at).norm() < 1e-14);
  // Within a body: geoms and joints.
  const Scene turned = mjcf_scene(
      world("<body name='b' pos='3 2 1'><frame euler='0 0 90'>" + inner + "</frame></body>"));
  const Eigen::Matrix3d R(plain.bodies[0].orientation);
  CHECK((plain.bodies[0].position - turned.bodies[0].position).norm() < 1e-14);
  CHECK((R * plain.bodies[0].inertia * R.transpose() - turned.bodies[0].inertia).norm() < 1e-14);
  CHECK((plain.joints[0].axis - turned.joints[0].axis).norm() < 1e-14);

  const Scene ring =
      mjcf_scene(world("<replicate count='12' offset='1 0 0' euler='0 0 30' sep='-'>"
                       "<body name='b'>" +
                       inner + "</body></replicate>"));
  REQUIRE(ring.bodies.size() == 12);
  CHECK(ring.bodies[0].name == "b-00");
  CHECK(ring.joints[11].name == "j-11");
  // A polygon of twelve sides of 1 m: the offset of each copy is turned as that copy.
  Eigen::Vector3d at = Eigen::Vector3d::Zero();
  for (int k = 0; k < 12; ++k) {
    const Eigen::AngleAxisd turn(k * kPi / 6, Eigen::Vector3d::UnitZ());
    const Body& body = ring.bodies[static_cast<std::size_t>(k)];
    CHECK((body.position - at - turn * Eigen::Vector3d(0.1, 0, 0)).norm() < 1e-13);
    at += turn * Eigen::Vector3d::UnitX();
  }
  CHECK(at.norm() < 1e-13);
}

TEST_CASE("MJCF: balanceinertia replaces the moments that no body has by their mean") {
  const std::string body =
      "<body name='b'><freejoint/><inertial mass='1' pos='0 0 0' diaginertia='1 1 3'/></body>"
      "<body name='c'><freejoint/><inertial mass='1' pos='0 0 0' diaginertia='1 2 3'/></body>";
  CHECK(mjcf_refusal(world(body)).find("no body has this") != std::string::npos);
  const std::string balance = "<compiler balanceinertia='true'/>";
  const Scene scene = mjcf_scene(world(body, balance));
  CHECK((scene.bodies[0].inertia - 5.0 / 3 * Eigen::Matrix3d::Identity()).norm() < 1e-14);
  CHECK(scene.bodies[1].inertia(1, 1) == 2);
  CHECK(said(world(body, balance), "mean (balanceinertia): b"));
}

TEST_CASE("MJCF: loops close by connect and weld, and joints follow each other by equality") {
  // A parallelogram of three bars of 1 kg: a crank on each side turns as the other.
  const std::string arm = "<inertial mass='1' pos='0.5 0 0' diaginertia='0.01 0.08 0.08'/>";
  const std::string loop =
      world("<body name='a'><joint name='ja' axis='0 1 0'/>" + arm +
            "<body name='b' pos='1 0 0' euler='0 90 0'><joint name='jb' axis='0 1 0'/>" + arm +
            "<body name='tip' pos='1 0 0'/></body></body>\n"
            "<body name='c' pos='0 0 -1'><joint name='jc' axis='0 1 0'/>" +
            arm + "</body>\n");
  const auto with = [&](const std::string& equality) {
    return loop.substr(0, loop.size() - std::string("</mujoco>\n").size()) + "<equality>" +
           equality + "</equality></mujoco>\n";
  };
  // body b hangs down from the end of a; its tip is the end of c.
  const Scene scene =
      mjcf_scene(with("<connect name='close' body1='tip' body2='c' anchor='0 0 0'/>"));
  REQUIRE(scene.joints.size() == 4);
  CHECK(scene.joints[3].kind == JointKind::ball);
  CHECK(scene.joints[3].name == "close");
  CHECK((scene.joints[3].at - Eigen::Vector3d(1, 0, -1)).norm() < 1e-12);
  const auto engine = make_engine(scene);
  engine->advance(0.3);
  CHECK(engine->diagnostics().drift < 1e-5);
  // Before they pass the bar, the cranks turn as one, and the bar does not.
  CHECK((engine->bodies()[0].angular_velocity - engine->bodies()[2].angular_velocity).norm() <
        1e-4);
  CHECK(engine->bodies()[1].angular_velocity.norm() < 1e-4);

  const Scene welded = mjcf_scene(with("<weld body1='c' body2='b' anchor='1 0 0'/>"));
  REQUIRE(welded.joints.size() == 4);
  CHECK(welded.joints[3].kind == JointKind::fixed);
  CHECK((welded.joints[3].at - Eigen::Vector3d(1, 0, -1)).norm() < 1e-12);
  const Scene to_world = mjcf_scene(with("<connect body1='c' anchor='1 0 0'/>"));
  CHECK(to_world.joints[3].second == -1);

  const Scene follows = mjcf_scene(with("<joint joint1='jc' joint2='ja' polycoef='0 2 0 0 0'/>"));
  REQUIRE(follows.couplings.size() == 1);
  CHECK(follows.couplings[0].polynomial == std::vector<double>{2});

  CHECK(said(with("<joint joint1='jc' joint2='ja' polycoef='0 1 1 0 0'/>"), "degree 2 to 4"));
  CHECK(said(with("<joint joint1='jc'/>"), "equalities of one joint"));
  CHECK(said(with("<connect name='x' body1='c' body2='c' anchor='0 0 0'/>"),
             "do not move against each other: x"));
  CHECK(said(with("<connect active='false' body1='c' anchor='0 0 0'/>"), "not active"));
  const auto summed = [&](const std::string& tendon) {
    return with(tendon +
                "</equality><tendon><fixed name='t'><joint joint='ja' coef='2'/>"
                "<joint joint='jc' coef='-3'/></fixed><fixed name='u'><joint joint='jb' "
                "coef='1'/></fixed></tendon><equality>");
  };
  const Scene sum = mjcf_scene(summed("<tendon name='s' tendon1='t'/>"));
  REQUIRE(sum.couplings.size() == 1);
  CHECK(sum.couplings[0].joints == std::vector<int>{0, 2});
  CHECK(sum.couplings[0].weights == std::vector<double>{2, -3});
  const Scene two = mjcf_scene(summed("<tendon tendon1='u' tendon2='t' polycoef='0 .5 0 0 0'/>"));
  REQUIRE(two.couplings.size() == 1);
  CHECK(two.couplings[0].weights == std::vector<double>{-1, 1, 1.5});
  CHECK(
      said(summed("<tendon tendon1='s'/></equality><tendon><spatial name='s'/></tendon><equality>"),
           "tendons that are not fixed"));
  CHECK(said(summed("<tendon name='s' tendon1='u'/>"), "tendons with one joint"));
  CHECK(said(summed("<tendon tendon1='t' polycoef='1'/>"), "tendons with a constant"));
  CHECK(mjcf_refusal(with("<connect body1='c'/>")).find("anchor") != std::string::npos);
}

TEST_CASE("MJCF: names of joints, tendons and bodies that are not there are refused") {
  const auto with = [](const std::string& more) {
    const std::string text =
        world("<body name='b'><joint name='h'/><geom size='.1'/></body><geom name='g' size='.1'/>");
    return text.substr(0, text.size() - std::string("</mujoco>\n").size()) + more + "</mujoco>\n";
  };
  const std::string tendon = "<tendon><fixed name='t'><joint joint='h'/></fixed></tendon>";
  CHECK(mjcf_refusal(with(tendon + "<actuator><motor joint='h'/><motor tendon='t'/></actuator>"
                                   "<contact><exclude body1='b' body2='world'/></contact>"))
            .empty());
  const auto refuses = [&](const std::string& more, const std::string& field) {
    INFO(more);
    const std::string said = mjcf_refusal(with(tendon + more));
    CHECK(said.find(field) != std::string::npos);
    CHECK(said.find("there is no such") != std::string::npos);
  };
  for (const char* kind : {"motor", "position", "general", "damper"}) {
    refuses("<actuator><" + std::string(kind) + " name='m' joint='H'/></actuator>", "\"m\": joint");
    refuses("<actuator><" + std::string(kind) + " jointinparent='b'/></actuator>", "jointinparent");
    refuses("<actuator><" + std::string(kind) + " tendon='h'/></actuator>", "tendon");
  }
  refuses("<tendon><fixed name='u'><joint joint='t'/></fixed></tendon>", "joint");
  refuses("<equality><joint joint1='none'/></equality>", "joint1");
  refuses("<equality><joint joint1='h' joint2='none'/></equality>", "joint2");
  refuses("<equality><tendon tendon1='t' tendon2='none'/></equality>", "tendon2");
  refuses("<equality><connect body1='g' anchor='0 0 0'/></equality>", "body1");
  refuses("<equality><weld body1='b' body2='none'/></equality>", "body2");
  refuses("<contact><exclude body1='b' body2='h'/></contact>", "body2");
}

TEST_CASE("MJCF: actuators and armature that scenes lack are named, with what they are of") {
  const std::string body =
      "<body name='a'><joint name='h' axis='0 1 0' armature='.2'/><geom size='.1'/>"
      "<body name='b' pos='1 0 0'><joint name='ball' type='ball' armature='.2'/><geom size='.1'/>"
      "</body></body><body name='c'><joint name='f' type='free' armature='.2' damping='1'/>"
      "<geom size='.1'/></body>";
  const auto with = [&](const std::string& more) {
    const std::string text = world(body);
    return text.substr(0, text.size() - std::string("</mujoco>\n").size()) + more + "</mujoco>\n";
  };
  const auto actuator = [&](const std::string& each) {
    return with(
        "<tendon><fixed name='t'><joint joint='h' coef='1'/><joint joint='ball' coef='1'/>"
        "</fixed></tendon><actuator>" +
        each + "</actuator>");
  };
  CHECK(said(with(""), "armature of what is no hinge or slider here: ball, f"));
  CHECK(said(with(""), "damping of balls, free and planar joints: f"));
  CHECK(said(actuator("<motor name='m' joint='h'/>"), "exert nothing (--control): m"));
  CHECK(said(actuator("<muscle name='m' joint='h'/>"), "kind muscle: m"));
  CHECK(said(actuator("<general name='m' joint='h' gaintype='muscle'/>"), "kind general: m"));
  for (const char* word : {"gaintype", "biastype", "dyntype"})
    CHECK(said(actuator(std::string("<general name='m' joint='h' ") + word + "='Affine'/>"),
               "kind general: m"));
  for (const char* each : {"position", "velocity"})
    CHECK(said(actuator(std::string("<") + each + " name='m' joint='h' gear='0'/>"),
               "exert nothing (--control): m"));
  CHECK(said(actuator("<position name='m' joint='h' gear='1e200'/>"), "beyond all numbers: m"));
  CHECK(said(actuator("<velocity name='m' joint='ball'/>"), "no hinge or slider here: m"));
  CHECK(said(actuator("<position name='m' site='s'/>"), "other things than joints"));
  CHECK(said(actuator("<position name='m' tendon='t'/>"), "no hinge or slider here: m"));
  CHECK(said(actuator("<position name='m' joint='h'/><velocity name='n' joint='h'/>"),
             "further actuators of a joint: n"));
  CHECK(said(actuator("<general name='m' joint='h' biastype='affine' biasprm='0 1 0'/>"),
             "negative stiffness or damping: m"));
  CHECK(said(with("<tendon><fixed name='t' stiffness='3'><joint joint='h' coef='1'/></fixed>"
                  "</tendon>"),
             "tendons with stiffness, damping, friction, armature or limits: t"));
  CHECK(said(actuator("<motor name='m' joint='h'/>"), "without a force of their own: t"));

  import::ImportOptions options;
  options.controls = {{"m", 3}};
  const Scene scene = mjcf_scene(actuator("<motor name='m' joint='h' gear='2'/>"), options);
  REQUIRE(scene.loads.size() == 1);
  CHECK(scene.loads[0].in_body);
  CHECK(scene.loads[0].torque.y() == Approx(6));
  REQUIRE(scene.couplings.size() == 1);
  CHECK(scene.bodies.back().name == "rotor of h");
  CHECK(scene.bodies.back().inertia(0, 0) == 0.2);
  const auto refused = [&](const std::string& each) {
    return tether::test::thrown<std::exception>(
        [&] { import_robot(actuator(each), "robot.xml", options); });
  };
  CHECK(refused("<motor name='n' joint='h'/>").find("--control m: no actuator") == 0);
  CHECK(refused("<general name='m' joint='h' dyntype='filter'/>").find("through a state") !=
        std::string::npos);
  CHECK(refused("<motor name='m' joint='h' ctrlrange='1 -1'/>").find("ctrlrange") !=
        std::string::npos);
  CHECK(refused("<motor name='m' joint='h' ctrllimited='maybe'/>").find("true, false or auto") !=
        std::string::npos);
  CHECK(refused("<motor name='m' joint='h'/><motor name='m' joint='h'/>").find("another one") !=
        std::string::npos);
  CHECK(refused("<motor name='m' joint='h'/></actuator><tendon><spatial name='t'/></tendon>"
                "<actuator>")
            .find("spatial \"t\": name: another one") != std::string::npos);
}

TEST_CASE("MJCF: limits more than a turn apart hold by a body that counts turns") {
  const std::string text = world(
      "<body name='a'><joint name='h' axis='0 1 0' range='-100 430'/><geom size='.1' mass='2'/>"
      "</body>",
      "<option gravity='0 0 0' timestep='1e-3'/>");
  CHECK(said(text, "count turns of hinges, for limits, springs and drives (1e-06 of the inertia"));
  Scene scene = mjcf_scene(text);
  REQUIRE(scene.joints.size() == 2);
  CHECK_FALSE(scene.joints[0].limits);
  const double upper = 430 * kPi / 180;
  CHECK(scene.joints[1].limits->upper == Approx(upper));
  // Both turn on until the limit, beyond a turn, and stop in a step before it.
  scene.bodies[0].angular_velocity.y() = 10;
  scene.bodies[1].velocity = 10 * scene.joints[1].axis;
  scene.end = 1;
  const auto engine = make_engine(scene);
  engine->advance(0.7);
  CHECK(engine->bodies()[0].angular_velocity.y() == Approx(10));
  engine->advance(1);
  CHECK(engine->bodies()[0].angular_velocity.norm() < 1e-6);
  const Eigen::AngleAxisd turned(engine->bodies()[0].orientation);
  CHECK(turned.angle() * turned.axis().y() == Approx(upper - 2 * kPi).margin(0.01));
  ImportOptions free;
  free.joint_laws = false;
  CHECK(mjcf_scene(text, free).joints.size() == 1);
}

TEST_CASE("MJCF: kinds of actuators share the attributes of their class") {
  const std::string text =
      "<mujoco><default><general gear='3' ctrlrange='-2 2'/><motor gear='5'/></default><worldbody>"
      "<body name='a'><joint name='h'/><joint name='s' type='slide'/><geom size='.1'/></body>"
      "</worldbody><actuator><motor name='m' joint='h'/><velocity name='v' joint='s' kv='2'/>"
      "</actuator></mujoco>";
  ImportOptions options;
  options.controls = {{"m", 9}, {"v", 1}};
  const Scene scene = mjcf_scene(text, options);
  REQUIRE(scene.loads.size() == 1);
  CHECK(scene.loads[0].torque.z() == Approx(10));  // at the bound of control
  REQUIRE(scene.joints[1].motor);
  CHECK(scene.joints[1].motor->damping == Approx(18));
  CHECK(scene.joints[1].motor->rate == Approx(1.0 / 3));
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
  CHECK(mjcf_refusal("") == "robot.xml:1: is not XML that can be read: it is empty");
  refused(world("<body><joint type='screw'/><geom size='1'/></body>"),
          "must be hinge, slide, ball");
  refused(world("<body>\n<joint/><geom size='0'/></body>"),
          "robot.xml:4: worldbody: body: geom: size");
  refused(world("<body><joint/><geom type='mesh' mesh='m'/></body>"), "mass of a mesh");
  refused(world("<body><joint/><geom type='plane'/></body>"), "in the world only");
  refused(world("<body><joint class='none'/><geom size='1'/></body>"), "no <default>");
  refused(world("<body name='a'/><body name='a'/>"), "another body");
  refused(world("<composite type='grid'/>"), "is not read");
  refused(world("<geom type='plane' size='1 1 1'/><body><freejoint/><geom size='1' "
                "friction='1e160'/></body>"),
          "has numbers that no scene has: the scene:");
  refused(world("<replicate count='1.5'/>"), "whole number");
  refused(world("<replicate count='2' sep='(' ><body/></replicate>"), "sep = \"(\": must be part");
  refused(world("<replicate count='2' sep='" + std::string(300, 'x') + "'><body/></replicate>"),
          "must be part of a name");
  refused(
      world("<replicate count='90000'><replicate count='90000'><body/></replicate></replicate>"),
      "all copies have at most 100000 bodies and geoms");
  refused(world("<include file='x'/>"), "no such file");
  refused(world("", "<compiler coordinate='global'/>"), "must be local");
  refused(world("<body><joint/><geom size='1' quat='0 0 0 0'/></body>"), "quat");
  for (const char* sequence : {"pyZ", "x", "", "xyzx"})
    refused(world("<body><joint/><geom size='1' euler='1 2 3'/></body>",
                  std::string("<compiler eulerseq='") + sequence + "'/>"),
            "must be three of the letters");
  refused(world("<body><joint/><body><freejoint/><geom size='1'/></body></body>"), "free joint");
}

// Tests: meshes of robots, of URDF as convex parts, of MJCF as hulls. SPDX-License-Identifier:
// BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>

#include "../run_files.hpp"
#include "import/import.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"
#include "support/closed_meshes.hpp"

using namespace tether::scene;
using import::import_robot;

namespace {

// 3 long, 1 wide, 2 high at its end: two boxes of volume 2, with the centre (1.25, 0.5, 0.75).
closed_meshes::Surface angle() {
  return closed_meshes::of_cells({{{0, 1, 3}, {0, 1}, {0, 1, 2}}},
                                 [](int x, int, int z) { return x == 0 || z == 0; });
}

// A folder with the angle as an OBJ, whole and without its last triangle.
struct RobotFolder {
  std::filesystem::path path = tether::test::folder("robot_meshes");
  RobotFolder() {
    std::filesystem::create_directories(path / "parts");
    for (const bool closed : {true, false}) {
      std::ofstream out(path / "parts" / (closed ? "angle.obj" : "open.obj"));
      out.precision(17);
      const closed_meshes::Surface s = angle();
      for (const Eigen::Vector3d& p : s.points)
        out << "v " << p.x() << " " << p.y() << " " << p.z() << "\n";
      for (std::size_t t = 0; t + (closed ? 0 : 1) < s.triangles.size(); ++t)
        out << "f " << s.triangles[t][0] + 1 << " " << s.triangles[t][1] + 1 << " "
            << s.triangles[t][2] + 1 << "\n";
    }
  }
  import::Imported read(const std::string& text, const import::ImportOptions& options = {}) const {
      return import_robot(text, (path / "robot.xml").string(), options);
} void write(const std::string& name, const std::string& bytes) const {
  std::filesystem::create_directories((path / name).parent_path());
  std::ofstream(path / name, std::ios::binary) << bytes;
}
};  // namespace

std::string with_mesh(const std::string& attributes) {
  return "<robot name='r'><link name='base'/><link name='b'><inertial><mass value='2'/>"
         "<inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial><collision>"
         "<origin xyz='0 0 1'/><geometry><mesh " +
         attributes +
         "/></geometry></collision></link><joint name='j' type='revolute'><parent link='base'/>"
         "<child link='b'/><limit lower='-1' upper='1' effort='1' velocity='1'/></joint></robot>";
}

bool told(const import::Imported& made, const std::string& words) {
  return std::any_of(made.remarks.begin(), made.remarks.end(),
                     [&](const std::string& r) { return r.find(words) != std::string::npos; });
}

const Body& moving(const Scene& scene) {
  return *std::find_if(scene.bodies.begin(), scene.bodies.end(),
                       [](const Body& b) { return !b.fixed; });
}

// The corners of all shapes within their box, in axes of the body.
std::pair<Eigen::Vector3d, Eigen::Vector3d> bounds(const Body& body) {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = -low;
  for (const Shape& s : body.shapes)
    for (const Eigen::Vector3d& p : s.points) {
      const Eigen::Vector3d x = s.position + s.orientation * p;
      low = low.cwiseMin(x);
      high = high.cwiseMax(x);
    }
  return {low, high};
}

}  // namespace

TEST_CASE("URDF: a mesh beside the robot touches as its convex parts") {
  const RobotFolder folder;
  const import::Imported made =
      folder.read(with_mesh("filename='package://r/parts/angle.obj' scale='0.1 0.1 -0.1'"));
  CHECK(told(made, "meshes as convex parts, 2 here: b"));
  const Scene scene = parse_scene(made.toml, "robot.toml");
  const Body& b = moving(scene);
  REQUIRE(b.shapes.size() == 2);
  for (const Shape& each : b.shapes) CHECK(each.kind == ShapeKind::convex);
  const auto [low, high] = bounds(b);
  CHECK((low - Eigen::Vector3d(0, 0, 0.8)).norm() < 1e-15);
  CHECK((high - Eigen::Vector3d(0.3, 0.1, 1)).norm() < 1e-15);
}

TEST_CASE(
    "URDF: a mesh that bounds no solid touches as its hull, one that is not there not at all") {
  const RobotFolder folder;
  const import::Imported open = folder.read(with_mesh("filename='parts/open.obj'"));
  CHECK(told(open, "belongs to no other triangle"));
  CHECK(moving(parse_scene(open.toml, "robot.toml")).shapes.size() == 1);
  for (const char* name :
       {"parts/none.obj", "../robot_meshes_2/a.obj", "parts/angle.dae", "/etc/passwd"}) {
    const import::Imported none = folder.read(with_mesh("filename='" + std::string(name) + "'"));
    INFO(name);
    CHECK(told(none, "<mesh>: b"));
    CHECK(moving(parse_scene(none.toml, "robot.toml")).shapes.empty());
  }
  const std::string refusal = tether::test::thrown<std::exception>(
      [&] { folder.read(with_mesh("filename='parts/angle.obj' scale='1 0 1'")); });
  CHECK(refusal.find("scale") != std::string::npos);
}

TEST_CASE("MJCF: a mesh touches as its hull and weighs as its solid") {
  const RobotFolder folder;
  const import::Imported made = folder.read(
      "<mujoco><compiler meshdir='parts'/><asset><mesh file='angle.obj' scale='.1 .1 .1'/></asset>"
      "<worldbody><body name='b'><freejoint/><geom type='mesh' mesh='angle' density='500' "
      "pos='1 0 0'/></body></worldbody></mujoco>");
  CHECK(told(made, "meshes touch as their convex hulls"));
  const Scene scene = parse_scene(made.toml, "robot.toml");
  const Body& b = moving(scene);
  CHECK(b.mass == Approx(500 * 4e-3).epsilon(1e-13));
  CHECK((b.position - Eigen::Vector3d(1.125, 0.05, 0.075)).norm() < 1e-14);
  // Two boxes about their common centre, along y: lengths 0.1 x 0.2 and 0.2 x 0.1.
  const double each = 1, sides = each / 12 * (0.01 + 0.04);
  const double apart = each * ((0.075 * 0.075) + (0.025 * 0.025));
  CHECK(b.inertia(1, 1) == Approx(2 * (sides + apart)).epsilon(1e-12));
  REQUIRE(b.shapes.size() == 1);
  CHECK(b.shapes[0].points.size() == 10);
  const auto [low, high] = bounds(b);
  CHECK((high - low - Eigen::Vector3d(0.3, 0.1, 0.2)).norm() < 1e-14);
}

TEST_CASE("URDF: packages are found above the robot, within the folder of --files only") {
  const RobotFolder folder;
  folder.write("robots/r/urdf/r.urdf", "");
  const std::string text = with_mesh("filename='package://parts/angle.obj'");
  const std::string robot = (folder.path / "robots/r/urdf/r.urdf").string();
  import::ImportOptions options;
  CHECK(told(import_robot(text, robot, options), "no such file beside the scene"));
  options.files = (folder.path / "robots").string();
  CHECK(told(import_robot(text, robot, options), "no such file beside the scene"));
  options.files = folder.path.string();
  CHECK(told(import_robot(text, robot, options), "meshes as convex parts, 2 here: b"));
  options.hulls = true;
  const import::Imported hulls = import_robot(text, robot, options);
  CHECK(told(hulls, "meshes as their hulls: b"));
  CHECK(moving(parse_scene(hulls.toml, "robot.toml")).shapes.size() == 1);
  options.files = (folder.path / "robots").string();
  const std::string beyond = with_mesh("filename='../../../parts/angle.obj'");
  CHECK(told(import_robot(beyond, robot, options), "must lie in the folder of --files"));
}

TEST_CASE("URDF: links without inertial weigh as their shapes where a density is given") {
  const RobotFolder folder;
  std::string text = with_mesh("filename='parts/angle.obj'");
  const std::size_t from = text.find("<inertial>"), to = text.find("</inertial>") + 11;
  text.erase(from, to - from);
  const std::string refusal = tether::test::thrown<std::exception>([&] { folder.read(text); });
  CHECK(refusal.find("--density") != std::string::npos);
  import::ImportOptions options;
  options.density = 250;
  const import::Imported made = folder.read(text, options);
  CHECK(told(made, "whose shapes weigh 250 kg/m^3: b"));
  const Body body = moving(parse_scene(made.toml, "robot.toml"));
  CHECK(body.mass == Approx(1000).epsilon(1e-13));
  CHECK((body.position - Eigen::Vector3d(1.25, 0.5, 1.75)).norm() < 1e-13);
}

TEST_CASE("a hull of many points leaves out what is hardly above it, and says so") {
  // A sphere of radius 1 by 8000 points.
  const int count = 8000;
  std::string sphere;
  for (int k = 0; k < count; ++k) {
    const double z = (2 * k + 1.0) / count - 1, r = std::sqrt(1 - z * z), a = 2.399963229728653 * k;
    sphere += fmt::format("v {} {} {}\n", r * std::cos(a), r * std::sin(a), z);
  }
  const RobotFolder folder;
  folder.write("parts/sphere.obj", sphere + "f 1 2 3\n");
  import::ImportOptions options;
  options.hulls = true;
  const import::Imported made = folder.read(with_mesh("filename='parts/sphere.obj'"), options);
  CHECK(told(made, "hulls of meshes within 0.001 of their extent: b"));
  const std::vector<Shape> shapes = moving(parse_scene(made.toml, "robot.toml")).shapes;
  REQUIRE(shapes.size() == 1);
  CHECK(shapes[0].points.size() < 4096);
  // In any direction a corner is within 0.002 of the sphere.
  for (int k = 0; k < 100; ++k) {
    const Eigen::Vector3d u = Eigen::Vector3d::Random().normalized();
    double most = 0;
    for (const Eigen::Vector3d& p : shapes[0].points)
      most = std::max(most, u.dot(p + shapes[0].position - Eigen::Vector3d(0, 0, 1)));
    CHECK(most > 1 - 2.1e-3);
  }
}

TEST_CASE("MJCF: a mesh may be an MSH, whose numbers give its length") {
  const RobotFolder folder;
  const closed_meshes::Surface s = angle();
  std::string bytes;
  const auto put = [&](auto x) { bytes.append(reinterpret_cast<const char*>(&x), sizeof x); };
  for (const std::size_t n : {s.points.size(), std::size_t{1}, std::size_t{1}, s.triangles.size()})
    put(static_cast<std::int32_t>(n));
  for (const Eigen::Vector3d& p : s.points)
    for (int k = 0; k < 3; ++k) put(static_cast<float>(p[k]));
  for (int k = 0; k < 5; ++k) put(0.0F);  // a normal, a texture coordinate
  const std::string head = bytes;
  for (const auto& t : s.triangles)
    for (const int k : t) put(static_cast<std::int32_t>(k));
  folder.write("parts/a.msh", bytes);
  const std::string text =
      "<mujoco><compiler meshdir='parts'/><asset><mesh file='a.msh'/></asset><worldbody><body>"
      "<freejoint/><geom type='mesh' mesh='a' density='500'/></body></worldbody></mujoco>";
  CHECK(moving(parse_scene(folder.read(text).toml, "robot.toml")).mass == Approx(2000));
  const auto refused = [&](const std::string& wrong, const std::string& why) {
    folder.write("parts/a.msh", wrong);
    // Without the mesh nobody knows the mass.
    const std::string light = std::string(text).replace(text.find("density='500'"), 13, "mass='0'");
    const std::string body = std::string(light).replace(
        light.find("<geom"), 0, "<inertial mass='1' pos='0 0 0' diaginertia='1 1 1'/>");
    INFO(why);
    CHECK(told(folder.read(body), why));
  };
  refused(head, "is no MSH");
  refused(bytes.substr(0, 7), "is no MSH");
  refused("", "is no MSH");
  std::string beyond = bytes;
  beyond[beyond.size() - 1] = 1;
  refused(beyond, "is no point");
}

TEST_CASE("MJCF: an included file stands in its place; none is included twice or from elsewhere") {
  const RobotFolder folder;
  const std::string geom = "<geom size='.1' mass='2'/>";
  folder.write("parts/arm.xml", "<mujocoinclude><body name='arm'><joint name='j'/>" + geom +
                                    "<include file='parts/tip.xml'/></body></mujocoinclude>");
  folder.write("parts/tip.xml",
               "<mujoco><body name='tip'><joint name='k'/>" + geom + "</body></mujoco>");
  folder.write("parts/options.xml", "<mujoco><option gravity='0 0 -2'/></mujoco>");
  const auto with = [](const std::string& name) {
    return "<mujoco><include file='parts/options.xml'/><worldbody><include file='" + name +
           "'/></worldbody></mujoco>";
  };
  const Scene scene = parse_scene(folder.read(with("parts/arm.xml")).toml, "robot.toml");
  CHECK(scene.gravity->z() == -2);
  REQUIRE(scene.bodies.size() == 2);
  CHECK(scene.bodies[1].name == "tip");
  CHECK(scene.joints[1].second == 0);
  const auto refused = [&](const std::string& name, const std::string& why) {
    const std::string told = tether::test::thrown<std::exception>([&] { folder.read(with(name)); });
    INFO(told);
    CHECK(told.find(why) != std::string::npos);
  };
  refused("parts/options.xml", "is included twice");
  refused("parts/none.xml", "no such file");
  refused("../robot_meshes/../robot_meshes_2/a.xml", "no such file");
  folder.write("parts/self.xml", "<mujoco><include file='parts/self.xml'/></mujoco>");
  refused("parts/self.xml", "is included twice");
  folder.write("parts/broken.xml", "<mujoco><body></mujoco>");
  refused("parts/broken.xml", "parts/broken.xml:1: is not XML");
  folder.write("parts/wrong.xml", "<mujoco><body name='b'><joint type='screw'/></body></mujoco>");
  refused("parts/wrong.xml", "hinge, slide, ball or free (in a file that it includes)");
  std::string deep;
  for (int k = 0; k < 60; ++k) deep += "<body>";
  std::string end;
  for (int k = 0; k < 60; ++k) end += "</body>";
  folder.write("parts/deep.xml",
               "<mujoco>" + deep + "<include file='parts/deeper.xml'/>" + end + "</mujoco>");
  folder.write("parts/deeper.xml", "<mujoco>" + deep + end + "</mujoco>");
  refused("parts/deep.xml", "elements are inside each other");
}

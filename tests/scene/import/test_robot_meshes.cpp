// Tests: meshes of robots, of URDF as convex parts, of MJCF as hulls. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
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
  import::Imported read(const std::string& text) const {
      return import_robot(text, (path / "robot.xml").string(), {});
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

// Scenes with contact as users write them, against closed sums: slopes at the angle of friction,
// stacks with mass ratios, free rotation. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <string>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>
#include <vector>

#include "support/catch.hpp"

namespace {

using namespace tether::scene;
using Eigen::Vector3d;

constexpr double kPi = 3.14159265358979323846, kGravity = 9.81;

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", x);
  return text;
}
std::string vector(const Vector3d& v) {
  return "[" + number(v[0]) + ", " + number(v[1]) + ", " + number(v[2]) + "]";
}
std::string head(double end, double step, const std::string& more = "") {
  return "[scene]\nend = " + number(end) +
         "\ngravity = [0, 0, -9.81]\n[stepping]\nstep = " + number(step) + "\n" + more;
}

// A block of 1 m edges (0.5 m high) on a slope that falls 30 degrees towards `azimuth`, turned by
// `yaw` on it.
struct Incline {
  std::string text;
  Vector3d down, aside, normal, start;
};
Incline incline(double mu, double azimuth, double yaw, double step, double end) {
  Incline out;
  const double tilt = 30 * kPi / 180;
  const Eigen::Quaterniond q = Eigen::Quaterniond(Eigen::AngleAxisd(azimuth, Vector3d::UnitZ())) *
                               Eigen::Quaterniond(Eigen::AngleAxisd(tilt, Vector3d::UnitY()));
  const Eigen::Quaterniond turned =
      q * Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Vector3d::UnitZ()));
  out.down = q * Vector3d::UnitX();
  out.aside = q * Vector3d::UnitY();
  out.normal = q * Vector3d::UnitZ();
  out.start = 0.25 * out.normal;
  out.text = head(end, step) + "[[body]]\nshape = \"plane\"\nfixed = true\nmaterial = \"slope\"\n" +
             "normal = " + vector(out.normal) +
             "\n[[body]]\nname = \"block\"\nshape = \"box\"\nsize = [1, 1, 0.5]\nmass = 1\n"
             "material = \"block\"\nposition = " +
             vector(out.start) + "\norientation = { wxyz = [" + number(turned.w()) + ", " +
             number(turned.x()) + ", " + number(turned.y()) + ", " + number(turned.z()) +
             "] }\n[[pair]]\nbetween = [\"slope\", \"block\"]\nfriction = " + number(mu) + "\n";
  return out;
}

// The block's way after the run, and how fast it is.
struct Slid {
  double along, aside, off, speed;
};
Slid slide(const Incline& i) {
  const Scene scene = parse_scene(i.text, "incline.toml");
  const auto engine = make_engine(scene);
  engine->advance(scene.end);
  const Vector3d moved = engine->bodies()[1].position - i.start;
  return {moved.dot(i.down), moved.dot(i.aside), moved.dot(i.normal),
          engine->bodies()[1].velocity.norm()};
}

}  // namespace

TEST_CASE("scene: a block on a slope of 30 degrees sticks and slides at (1 +- 1e-3) tan 30") {
  const double step = GENERATE(1e-3, 1e-2);
  const double azimuth = GENERATE(0.0, 36.87) * kPi / 180;
  const double tangent = std::tan(30 * kPi / 180), T = 10, a = kGravity * 0.5 * 1e-3;
  INFO("step " << step << " azimuth " << azimuth);
  const Slid stuck = slide(incline(tangent * (1 + 1e-3), azimuth, 0, step, T));
  CHECK(std::hypot(stuck.along, stuck.aside, stuck.off) < 1e-9);
  const Slid slid = slide(incline(tangent * (1 - 1e-3), azimuth, 0, step, T));
  CHECK(slid.along == Approx(0.24525 + a * T * step / 2).margin(1e-6));
  CHECK(std::abs(slid.aside) < 1e-9);
  CHECK(std::abs(slid.off) < 1e-9);
  CHECK(slid.speed == Approx(a * T).margin(1e-7));
}

TEST_CASE("scene: at 0.9 tan 30 a block yawed by 45 degrees slides 6.132476 m in 5 s") {
  for (const double yaw : {0.0, 45.0})
    for (const double azimuth : {0.0, 45.0}) {
      const Slid slid = slide(
          incline(0.9 * std::tan(30 * kPi / 180), azimuth * kPi / 180, yaw * kPi / 180, 1e-3, 5));
      INFO("yaw " << yaw << " azimuth " << azimuth);
      CHECK(slid.along == Approx(6.132476).margin(1e-6));
      CHECK(std::abs(slid.aside) < 1e-8);
    }
}

TEST_CASE("scene: ten boxes, the top one up to 1000 times as heavy, stand for 10 s") {
  const double step = GENERATE(1e-3, 1e-2);
  const double top = GENERATE(1.0, 100.0, 1000.0);
  std::string text = head(10, step) +
                     "[[body]]\nshape = \"plane\"\nfixed = true\nmaterial = \"floor\"\n"
                     "[[pair]]\nbetween = [\"box\", \"floor\"]\nfriction = 0.5\n"
                     "[[pair]]\nbetween = [\"box\", \"box\"]\nfriction = 0.5\n";
  for (int k = 0; k < 10; ++k)
    text += "[[body]]\nshape = \"box\"\nsize = [1, 1, 1]\nmaterial = \"box\"\nmass = " +
            number(k == 9 ? top : 1) + "\nposition = " + vector({0, 0, k + 0.5}) + "\n";
  const Scene scene = parse_scene(text, "stack.toml");
  const auto engine = make_engine(scene);
  double lost = 0, drift = 0;
  for (int record = 1; record <= 100; ++record) {
    engine->advance(0.1 * record);
    for (int k = 1; k <= 10; ++k) {
      const Vector3d& p = engine->bodies()[static_cast<std::size_t>(k)].position;
      const double below =
          k == 1 ? -0.5 : engine->bodies()[static_cast<std::size_t>(k - 1)].position.z();
      lost = std::max(lost, std::abs(p.z() - below - 1));
      drift = std::max(drift, p.head<2>().norm());
    }
  }
  INFO("top " << top << " step " << step << " lost " << lost << " drift " << drift);
  CHECK(lost < 1e-9);
  CHECK(drift < 1e-8);
  CHECK(engine->counts().unsolved == 0);
}

TEST_CASE("scene: free rotation keeps energy and momentum for 100 s, turns over in order 2") {
  const double exact[2] = {10.377304882335, 10.377304882335 + 20.7546097646692};
  const auto turns = [&](double step) {
    const Scene scene =
        parse_scene("[scene]\nend = 100\n[stepping]\nstep = " + number(step) +
                        "\n[[body]]\nmass = 1\ninertia = [1, 2, 3]\nangular_velocity = [0.01, 1, "
                        "0]\n",
                    "t_handle.toml");
    const auto engine = make_engine(scene);
    const Diagnostics start = engine->diagnostics();
    double energy = 0, momentum = 0, last = 1, error = 0;
    int found = 0;
    const long n = std::lround(100 / step);
    for (long k = 1; k <= n; ++k) {
      engine->advance(step * static_cast<double>(k));
      const Diagnostics d = engine->diagnostics();
      energy = std::max(energy, std::abs(d.kinetic_energy / start.kinetic_energy - 1));
      momentum = std::max(momentum, (d.angular_momentum - start.angular_momentum).norm() /
                                        start.angular_momentum.norm());
      const BodyState& b = engine->bodies()[0];
      const double now = (b.orientation.conjugate() * b.angular_velocity)[1];
      if ((now < 0) != (last < 0) && found < 2)
        error += std::abs(engine->time() - step * now / (now - last) - exact[found++]);
      last = now;
    }
    INFO("step " << step << " energy " << energy << " momentum " << momentum);
    CHECK(energy < 1e-12);
    CHECK(momentum < 1e-12);
    CHECK(found == 2);
    return error;
  };
  const double coarse = turns(2e-2), middle = turns(1e-2), fine = turns(5e-3);
  INFO("errors " << coarse << " " << middle << " " << fine);
  CHECK(coarse / middle == Approx(4).epsilon(0.15));
  CHECK(middle / fine == Approx(4).epsilon(0.15));
}

namespace {

// A cube at this distance from the axis of a table that turns by 1.5 rad/s, and moves with it.
std::string turntable(const std::string& table, double at) {
  return "[scene]\nend = 10\ngravity = [0, 0, -9.81]\n" + table +
         "[[body]]\nname = \"cube\"\nshape = \"box\"\nsize = [0.05, 0.05, 0.05]\nmass = 0.1\n"
         "position = " +
         vector({at, 0, 0.025}) + "\nvelocity = " + vector({0, 1.5 * at, 0}) +
         "\nangular_velocity = [0, 0, 1.5]\nmaterial = \"cube\"\n"
         "[[pair]]\nbetween = [\"table\", \"cube\"]\nfriction = 0.3\n";
}
const std::string kTable =
    "[[body]]\nname = \"table\"\nshape = \"cylinder\"\nradius = 1\nlength = 0.1\nmass = 10\n"
    "position = [0, 0, -0.05]\nangular_velocity = [0, 0, 1.5]\nmaterial = \"table\"\n";

}  // namespace

TEST_CASE("scene: what a turning table carries keeps its place to 1e-4 of its radius a turn") {
  const std::string hinge =
      "[[joint]]\nkind = \"hinge\"\nbodies = [\"table\", \"world\"]\nat = [0, 0, 0]\n"
      "axis = [0, 0, 1]\nmotion = { rate_rad = 1.5 }\n";
  // On a smooth floor it turns about what it carries, too: a little.
  const std::string free =
      "[[body]]\nname = \"floor\"\nshape = \"plane\"\nfixed = true\nposition = [0, 0, -0.1]\n"
      "material = \"ice\"\n[[pair]]\nbetween = [\"ice\", \"table\"]\nfriction = 0\n"
      "[[pair]]\nbetween = [\"ice\", \"cube\"]\nfriction = 0\n";
  for (const std::string& table : {kTable + hinge, kTable + free}) {
    const Scene scene = parse_scene(turntable(table, 0.4), "turntable.toml");
    const auto engine = make_engine(scene);
    const auto arm = [&] {
      const BodyState &t = engine->bodies()[0], &c = engine->bodies().back();
      return Vector3d(t.orientation.conjugate() * (c.position - t.position));
    };
    const Vector3d before = arm();
    engine->advance(scene.end);
    CHECK((arm() - before).norm() < 1e-4 * 0.4 * (1.5 * scene.end / (2 * kPi)));
  }
}

TEST_CASE("scene: a disc that rolls about its resting centre keeps its energy and its tilt") {
  const Scene scene = parse_scene(
      "[scene]\nend = 2\ngravity = [0, 0, -9.81]\n"
      "[[body]]\nshape = \"plane\"\nfixed = true\nmaterial = \"floor\"\n"
      "[[body]]\nshape = \"cylinder\"\nradius = 0.04\nlength = 0.01\nmass = 0.1\n"
      "position = [0, 0, 0.018379268836956293]\norientation = { axis = [0, 1, 0], deg = 20 }\n"
      "angular_velocity = [16.645939336661293, 0, -8.52733067495695]\nmaterial = \"disc\"\n"
      "[[pair]]\nbetween = [\"floor\", \"disc\"]\nfriction = 0.8\n",
      "disc.toml");
  const auto engine = make_engine(scene);
  const auto energy = [&] {
    const Diagnostics d = engine->diagnostics();
    return d.kinetic_energy + d.potential_energy;
  };
  const double before = energy();
  for (int k = 1; k <= 200; ++k) {
    engine->advance(k * 1e-2);
    CHECK(std::abs(energy() - before) < 1e-2 * before);
    const BodyState& b = engine->bodies()[1];
    CHECK(b.position.head<2>().norm() < 1e-3);
    const double tilt = std::acos(std::abs((b.orientation * Vector3d::UnitZ()).z()));
    CHECK(std::abs(tilt - 20 * kPi / 180) < 0.01);
  }
}

TEST_CASE("scene: the shipped woodpecker comes down in steps as it does in events") {
  // Heights of the sleeve at 0.15 s and 0.3 s by events; tolerances 1e-9 and 1e-10 agree to 1e-10.
  struct Case {
    double step, accuracy, within;
  };
  const auto [step, accuracy, within] =
      GENERATE(Case{1e-4, 0, 4e-4}, Case{2e-5, 0, 8e-5}, Case{5e-4, 1e-4, 2e-4});
  Scene scene = read_scene(TETHER_SHIPPED_SCENES "/woodpecker.toml");
  scene.event.reset();
  scene.engine = EngineKind::stepping;
  scene.stepping.emplace();
  scene.stepping->step = step;
  scene.stepping->accuracy = accuracy;
  const auto engine = make_engine(scene);
  CAPTURE(step, accuracy);
  engine->advance(0.15);
  CHECK(std::abs(engine->bodies()[2].position.z() + 0.0192001972) < within);
  engine->advance(0.3);
  CHECK(std::abs(engine->bodies()[2].position.z() + 0.0342250844) < within);
  CHECK(engine->counts().unsolved == 0);
}

TEST_CASE("scene: the shipped woodpecker comes down in events") {
  // Rows of three bodies in quaternions, which are others in every phase.
  const auto engine = make_engine(read_scene(TETHER_SHIPPED_SCENES "/woodpecker.toml"));
  engine->advance(0.15);
  CHECK(std::abs(engine->bodies()[2].position.z() + 0.0192001972) < 1e-8);
}

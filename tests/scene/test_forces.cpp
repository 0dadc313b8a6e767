// Forces that scenes tell: of joints, contacts and springs. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>

#include "linalg/thrown.hpp"
#include "mechanisms.hpp"
#include "run_files.hpp"
#include "support/catch.hpp"

using namespace mechanisms;
using namespace tether::scene;

namespace {

const Vector3d kDown(0, 0, -kGravity);

// A bob at the angle from the vertical, hinged about y at the origin, or held at a distance.
Scene pendulum_of(JointKind kind, double angle, double length, double mass, double inertia) {
  Scene s;
  s.gravity = kDown;
  const Vector3d at = length * Vector3d(std::sin(angle), 0, -std::cos(angle));
  s.bodies.push_back(ball("bob", at, mass, inertia));
  s.joints.push_back(kind == JointKind::hinge ? hinge(0, kWorld, {0, 0, 0}, {0, 1, 0})
                                              : joint(kind, 0, kWorld, at, {0, 0, 0}));
  return s;
}

// From rest at the angle to the lowest point.
double quarter_period(double angle, double length) {
  return std::sqrt(length / kGravity) * std::comp_ellint_1(std::sin(angle / 2));
}

void step_by(Scene& s, double step) { s.stepping.emplace().step = step; }

// f = m g + m w^2 l, from the energy; a point mass: m g (3 - 2 cos angle).
double force_at_bottom(double angle, double length, double mass, double inertia) {
  const double w2 =
      2 * mass * kGravity * length * (1 - std::cos(angle)) / (mass * length * length + inertia);
  return mass * kGravity + mass * w2 * length;
}

const char* const kSlope = R"(
[scene]
end = 0.4
gravity = [0, 0, -9.81]
[stepping]
step = 1e-3
[output]
forces = true
every = 0.1
[[body]]
name = "slope"
shape = "plane"
normal = [0.5, 0, 0.8660254037844386]
fixed = true
material = "slope"
[[body]]
name = "stays"
shape = "box"
size = [1, 1, 0.5]
mass = 2
position = [0.125, 0, 0.21650635094610965]
orientation = { axis = [0, 1, 0], deg = 30 }
material = "rough"
[[body]]
name = "slides"
shape = "box"
size = [1, 1, 0.5]
mass = 2
position = [0.125, 2, 0.21650635094610965]
orientation = { axis = [0, 1, 0], deg = 30 }
material = "smooth"
[[pair]]
between = ["rough", "slope"]
friction = 0.7
[[pair]]
between = ["smooth", "slope"]
friction = 0.3
[[pair]]
between = ["smooth", "rough"]
)";

}  // namespace

TEST_CASE("a pendulum's pivot pulls with m g (3 - 2 cos angle) at the bottom: every form") {
  for (const JointKind kind : {JointKind::hinge, JointKind::distance})
    for (const double angle : {0.3, 1.5, 2.8})
      for (const double length : {1e-2, 1.0, 1e4}) {
        const double mass = 2, inertia = 1e-3 * mass * length * length;
        const bool hinged = kind == JointKind::hinge;
        Scene s = pendulum_of(kind, angle, length, mass, inertia);
        const double reduced =
            hinged ? (mass * length * length + inertia) / (mass * length) : length;
        const double time = quarter_period(angle, reduced);
        const double expected = force_at_bottom(angle, length, mass, hinged ? inertia : 0);
        for (const Formulation form : {Formulation::index1, Formulation::index0}) {
          s.smooth.emplace().tolerance = 1e-8;
          s.smooth->formulation = form;
          const auto engine = make_engine(s);
          engine->advance(time);
          const Forces f = engine->forces();
          INFO(static_cast<int>(kind) << " " << angle << " " << length);
          CHECK((f.joints[0].force - Vector3d(0, 0, expected)).norm() < 1e-5 * expected);
          CHECK(f.joints[0].moment.norm() < 1e-5 * expected * length);
          // A rod in tension pulls its points together.
          CHECK(std::abs(f.joints[0].drive - (hinged ? 0 : -expected)) < 1e-5 * expected);
        }
      }
}

TEST_CASE("a pendulum's pivot force in steps is of order 1") {
  const double angle = 1.5, mass = 2, inertia = 0.1;
  const double time = quarter_period(angle, (mass + inertia) / mass);
  double last = 0;
  for (const double step : {time / 100, time / 1000, time / 10000}) {
    Scene s = pendulum_of(JointKind::hinge, angle, 1, mass, inertia);
    step_by(s, step);
    const auto engine = make_engine(s);
    engine->advance(time);
    const double expected = force_at_bottom(angle, 1, mass, inertia);
    const double error = (engine->forces().joints[0].force - Vector3d(0, 0, expected)).norm();
    INFO(step << ": " << error);
    CHECK(error < 10 * step / time * expected);
    if (last > 0) CHECK(error < 0.15 * last);
    last = error;
  }
}

TEST_CASE("a beam on two hinges: each carries its part of the weight, in both engines") {
  for (const double right : {0.5, 0.2}) {
    for (const bool steps : {false, true}) {
      Scene s;
      s.gravity = kDown;
      s.bodies.push_back(ball("beam", {0, 0, 0}, 3, 0.25));
      s.joints.push_back(hinge(0, kWorld, {-0.5, 0, 0}, {0, 1, 0}));
      s.joints.push_back(hinge(0, kWorld, {right, 0, 0}, {0, 1, 0}));
      if (steps) step_by(s, 1e-3);
      const auto engine = make_engine(s);
      engine->advance(0.05);
      const Forces f = engine->forces();
      const double weight = 3 * kGravity;
      CHECK(std::abs(f.joints[0].force.z() - weight * right / (right + 0.5)) < 1e-8 * weight);
      CHECK(std::abs(f.joints[1].force.z() - weight * 0.5 / (right + 0.5)) < 1e-8 * weight);
      CHECK(std::abs(f.joints[0].force.x()) < 1e-8 * weight);
    }
  }
}

TEST_CASE("forces and moments of joints are what moves the bodies of a chain in space") {
  Scene s;
  s.gravity = Vector3d(1, -2, -9);
  for (int k = 0; k < 4; ++k) {
    s.bodies.push_back(ball("b" + std::to_string(k), Vector3d(k + 0.5, 0.2 * k, 0.1), 1 + k, 0.1));
    s.bodies.back().inertia = Vector3d(0.1, 0.2 + 0.02 * k, 0.25).asDiagonal();
  }
  s.joints.push_back(joint(JointKind::universal, 0, kWorld, {0, 0, 0}));
  s.joints.back().axis = {0, 0, 1};
  s.joints.back().axis_second = {0, 1, 0};
  s.joints.push_back(joint(JointKind::ball, 1, 0, {1, 0.1, 0}));
  s.joints.push_back(hinge(1, 2, {2, 0.2, 0.3}, {1, 2, 3}));
  s.joints.push_back(joint(JointKind::distance, 3, 2, {3.4, 0.5, 0}, {2.6, 0.3, 0.2}));
  s.smooth.emplace().tolerance = 1e-11;
  const double h = 4e-5, t = 0.7;
  const auto at = [&](double time) {
    auto engine = make_engine(s);
    engine->advance(time);
    return engine;
  };
  const auto before = at(t - h), now = at(t), after = at(t + h);
  const Forces f = now->forces();
  for (std::size_t b = 0; b < s.bodies.size(); ++b) {
    const Body& body = s.bodies[b];
    const auto spin = [&](const Engine& e) {
      const BodyState& state = e.bodies()[b];
      const Eigen::Matrix3d R = state.orientation.toRotationMatrix();
      return Vector3d(R * body.inertia * R.transpose() * state.angular_velocity);
    };
    Vector3d force = body.mass * *s.gravity, moment = Vector3d::Zero();
    for (std::size_t j = 0; j < s.joints.size(); ++j) {
      const int i = static_cast<int>(b);
      if (s.joints[j].first != i && s.joints[j].second != i) continue;
      const double sign = s.joints[j].first == i ? 1 : -1;
      force += sign * f.joints[j].force;
      moment += sign * (f.joints[j].moment +
                        (f.joints[j].at - now->bodies()[b].position).cross(f.joints[j].force));
    }
    const Vector3d rate =
        body.mass * (after->bodies()[b].velocity - before->bodies()[b].velocity) / (2 * h);
    CHECK((force - rate).norm() < 1e-5);
    CHECK((moment - (spin(*after) - spin(*before)) / (2 * h)).norm() < 1e-5);
  }
}

TEST_CASE("what drives a joint: the force of a lift, the moment of a turntable, in both engines") {
  for (const bool steps : {false, true}) {
    Scene s;
    s.gravity = kDown;
    s.bodies.push_back(ball("lift", {0, 0, 0}, 5));
    s.bodies.push_back(ball("table", {3, 0, 0}, 1, 0.4));
    s.joints.push_back(joint(JointKind::slider, 0, kWorld, {0, 0, 0}));
    s.joints[0].motion.emplace().amplitude = 0.3;
    s.joints[0].motion->frequency = 0.8;
    s.joints.push_back(hinge(1, kWorld, {3, 0, 0}, {0, 0, -1}));
    s.joints[1].motion.emplace().amplitude = 0.7;
    s.joints[1].motion->frequency = 0.5;
    const double pi = 3.14159265358979323846, w0 = 1.6 * pi, w1 = pi, t = 0.4;
    s.bodies[0].velocity = Vector3d(0, 0, 0.3 * w0);
    s.bodies[1].angular_velocity = Vector3d(0, 0, -0.7 * w1);
    if (steps) step_by(s, 1e-4);
    if (!steps) s.smooth.emplace().tolerance = 1e-9;
    const auto engine = make_engine(s);
    engine->advance(t);
    const Forces f = engine->forces();
    const double allowed = steps ? 5e-3 : 1e-6;
    const double lift = 5 * (kGravity - 0.3 * w0 * w0 * std::sin(w0 * t));
    const double turn = -0.4 * 0.7 * w1 * w1 * std::sin(w1 * t);
    CHECK(std::abs(f.joints[0].drive - lift) < allowed * 50);
    CHECK(std::abs(f.joints[0].force.z() - lift) < allowed * 50);
    CHECK(std::abs(f.joints[1].drive - turn) < allowed * 3);
    CHECK(std::abs(f.joints[1].moment.z() + turn) < allowed * 3);
  }
}

TEST_CASE("a spring's tension and a damper's, in both engines") {
  for (const bool steps : {false, true}) {
    Scene s;
    s.bodies.push_back(ball("mass", {2, 0, 0}, 1));
    s.bodies.back().velocity = {1, 0, 0};
    Spring spring;
    spring.name = "spring";
    spring.first = 0;
    spring.at = {2, 0, 0};
    spring.stiffness = 100;
    spring.damping = 3;
    spring.rest = 1.5;
    s.springs.push_back(spring);
    if (steps) step_by(s, 1e-4);
    const auto engine = make_engine(s);
    CHECK(std::abs(engine->forces().springs[0].tension - 53) < 1e-12);
    engine->advance(0.1);
    const BodyState& b = engine->bodies()[0];
    const double tension = 100 * (b.position.x() - 1.5) + 3 * b.velocity.x();
    CHECK(std::abs(engine->forces().springs[0].tension - tension) < 1e-10);
  }
}

TEST_CASE("blocks on a slope: what holds one, what slides under the other, and how fast") {
  Scene s = parse_scene(kSlope, "slope.toml");
  const double c = std::sqrt(0.75), N = 2 * 9.81 * c;
  const auto engine = make_engine(s);
  CHECK(total_forces(*engine).contact[1].isZero(0));  // before the first step
  engine->advance(0.4);
  const Forces f = total_forces(*engine);
  const Vector3d normal(0.5, 0, c), up(-c, 0, 0.5);
  CHECK((f.contact[1] - Vector3d(0, 0, 2 * 9.81)).norm() < 1e-7);
  CHECK((f.contact[2] - (N * normal + 0.3 * N * up)).norm() < 1e-7);
  CHECK((f.contact[0] + f.contact[1] + f.contact[2]).norm() < 1e-12);
  CHECK(f.contact_moment[2].norm() < 1e-7);  // it does not turn
  for (const ContactState& each : engine->contacts()) {
    const bool slides = each.first == 2 || each.second == 2;
    CHECK((each.slip - (slides ? engine->bodies()[2].velocity : Vector3d::Zero())).norm() < 1e-9);
    CHECK(each.force.dot(each.normal) >= 0);
  }
}

TEST_CASE("expectations of forces are read, written, judged and refused by name") {
  const std::string of_block = "\n[[expect]]\nquantity = \"contact_force\"\nbody = \"stays\"\n";
  const Scene s = parse_scene(std::string(kSlope) + of_block +
                                  "against = \"slope\"\nvalue = [0, 0, 19.62]\nwithin = 1e-6\n" +
                                  of_block + "against = \"slides\"\nat_most = 0\n" +
                                  "[[expect]]\nquantity = \"contact_slip\"\nbody = \"slides\"\n"
                                  "value = 0.942515\nwithin = 1e-5\n",
                              "slope.toml");
  CHECK(run(s).met());
  const Scene again = parse_scene(write_scene(s), "again.toml");
  CHECK(again.expect[0].against == 0);
  CHECK(write_scene(again) == write_scene(s));
  const auto refused = [&](const std::string& more, const std::string& says) {
    INFO(more);
    CHECK(tether::test::thrown<SceneError>([&] {
            parse_scene(std::string(kSlope) + more, "slope.toml");
          }).find(says) != std::string::npos);
  };
  refused("\n[[expect]]\nquantity = \"joint_force\"\njoint = \"pin\"\nat_most = 1\n",
          "no such joint");
  refused("\n[[expect]]\nquantity = \"spring_force\"\nat_most = 1\n", "the name of a spring");
}

TEST_CASE("tables and films have forces where the scene asks for them, and only there") {
  namespace fs = std::filesystem;
  const fs::path folder = tether::test::folder("forces");
  Scene s = parse_scene(kSlope, "slope.toml");
  s.bodies.push_back(ball("bob", {20, 0, 0}, 1));
  s.joints.push_back(hinge(3, kWorld, {19, 0, 0}, {0, 1, 0}));
  s.joints.back().name = "pin";
  const auto table = [&](const std::string& name, bool forces) {
    s.output.forces = forces;
    s.output["csv"] = (folder / (name + ".csv")).string();
    s.output["vtk"] = (folder / (name + ".pvd")).string();
    run(s);
    return tether::test::content(s.output["csv"]);
  };
  const std::string with = table("with", true), without = table("without", false);
  CHECK(with.find("stays.contact_fz_N") != std::string::npos);
  CHECK(with.find("pin.fx_N,pin.fy_N,pin.fz_N,pin.mx_N_m,pin.my_N_m,pin.mz_N_m,pin.drive_N_m") !=
        std::string::npos);
  CHECK(without.find("_N") == std::string::npos);
  const std::string contacts = tether::test::content(folder / "with.contacts.csv");
  // Four points of each block, at all records but the first.
  CHECK(std::count(contacts.begin(), contacts.end(), '\n') == 1 + 4 * 8);
  CHECK(fs::exists(folder / "with" / "joints_000003.vtp"));
  CHECK(tether::test::content(folder / "with" / "contacts_000003.vtp").find("slip") !=
        std::string::npos);
  CHECK(!fs::exists(folder / "without.contacts.csv"));
  CHECK(!fs::exists(folder / "without" / "joints_000003.vtp"));
  // The last columns of the last row, the states of three bodies, are the same bits.
  const auto states = [](std::string text) {
    for (std::size_t k = 0, end = std::string::npos; k < 39; ++k, --end)
      if (end = text.rfind(',', end); k == 38) return text.substr(end);
    return text;
  };
  CHECK(states(with) == states(without));
}

TEST_CASE("asking for forces leaves the bits of a motion as they are") {
  for (const bool steps : {false, true}) {
    const auto end = [&](bool asks) {
      Scene s = slider_crank(0.4, 3, 9.81, 1e-7, 1.5);
      if (steps) {
        s.invariants.clear();
        s.smooth.reset();
        step_by(s, 1e-3);
      }
      const auto engine = make_engine(s);
      for (int k = 1; k <= 50; ++k) {
        engine->advance(0.02 * k);
        if (asks) engine->forces();
      }
      return engine->bodies()[2].position;
    };
    CHECK(end(true) == end(false));
  }
}

TEST_CASE("the event engine tells the forces of blocks on a slope, and their slips") {
  const double c = std::sqrt(0.75), N = 2 * 9.81 * c, pull = 9.81 * (0.5 - 0.3 * c);
  Scene s = parse_scene(kSlope, "slope.toml");
  s.stepping.reset();
  s.engine = EngineKind::event;
  for (const double tolerance : {1e-4, 1e-7, 1e-10}) {
    CAPTURE(tolerance);
    s.event.emplace().tolerance = tolerance;
    const auto engine = make_engine(s);
    engine->advance(0.4);
    const Forces f = total_forces(*engine);
    const Vector3d normal(0.5, 0, c), up(-c, 0, 0.5);
    const double near = 30 * tolerance + 1e-9;
    CHECK((f.contact[1] - Vector3d(0, 0, 2 * 9.81)).norm() < near);
    CHECK((f.contact[2] - (N * normal + 0.3 * N * up)).norm() < near);
    CHECK((f.contact[0] + f.contact[1] + f.contact[2]).norm() < 1e-12);
    CHECK(f.contact_moment[1].norm() < near);
    CHECK(f.contact_moment[2].norm() < near);
    CHECK(engine->contacts().size() == 8);
    for (const ContactState& each : engine->contacts()) {
      const bool slides = each.first == 2 || each.second == 2;
      const Vector3d slip = slides ? Vector3d(-0.4 * pull * up) : Vector3d::Zero();
      CHECK(((each.first == 0 ? -1 : 1) * each.slip - slip).norm() < near);
      CHECK(each.force.dot(each.normal) >= 0);
      // In the cone, on its border where it slides.
      const double along = each.force.dot(each.normal);
      const double across = (each.force - along * each.normal).norm();
      CHECK(across < (slides ? 0.3 : 0.7) * along + near);
      if (slides) CHECK(across > 0.3 * along - near);
    }
  }
}

TEST_CASE("the event engine tells what pivots pull with, and redundant ones equal parts") {
  const double angle = 1.5, expected = force_at_bottom(angle, 1, 2, 0.1);
  for (const int pins : {1, 2}) {
    Scene s = pendulum_of(JointKind::hinge, angle, 1, 2, 0.1);
    s.joints.resize(static_cast<std::size_t>(pins), s.joints[0]);
    s.engine = EngineKind::event;
    for (const double tolerance : {1e-6, 1e-9}) {
      s.event.emplace().tolerance = tolerance;
      const auto engine = make_engine(s);
      engine->advance(quarter_period(angle, 2.1 / 2));
      const Forces f = engine->forces();
      for (const JointForce& each : f.joints)
        CHECK((pins * each.force - Vector3d(0, 0, expected)).norm() < 30 * tolerance * expected);
    }
  }
}

TEST_CASE("the event engine's forces of contacts and of a joint hold bodies at rest together") {
  // Two hinged boxes on a slope. The shortest forces leave the cone at a corner, and the lawful
  // ones that are told in their place go with other forces of the hinge.
  const std::string text = R"(
[scene]
end = 0.1
gravity = [3, -2, -9.81]
[event]
[output]
forces = true
[[body]]
name = "floor"
shape = "plane"
normal = [0, 0, 1]
fixed = true
material = "floor"
[[body]]
name = "left"
shape = "box"
size = [1, 1, 1]
mass = 1
position = [0, 0, 0.5]
material = "box"
[[body]]
name = "right"
shape = "box"
size = [1, 1, 1]
mass = 9
position = [1.2, 0, 0.5]
material = "box"
[[joint]]
name = "hinge"
kind = "hinge"
bodies = ["left", "right"]
at = [0.6, 0.3, 0.9]
axis = [0, 0, 1]
[[pair]]
between = ["box", "floor"]
friction = 0.5
[[pair]]
between = ["box", "box"]
)";
  for (const Vector3d& axis : {Vector3d(0, 0, 1), Vector3d(0, 1, 0), Vector3d(1, 1, 1)}) {
    for (const int hinges : {1, 2}) {
      CAPTURE(axis.transpose(), hinges);
      Scene s = parse_scene(text, "hinged.toml");
      s.joints[0].axis = axis.normalized();
      s.joints.resize(static_cast<std::size_t>(hinges), s.joints[0]);
      const std::unique_ptr<Engine> engine = make_engine(s);
      engine->advance(0.05);
      const Forces f = total_forces(*engine);
      for (const std::size_t b : {1U, 2U}) {
        Vector3d force = f.contact[b] + s.bodies[b].mass * *s.gravity, moment = f.contact_moment[b];
        for (const JointForce& each : f.joints) {
          const double side = b == 1 ? 1 : -1;
          force += side * each.force;
          moment +=
              side * (each.moment + (each.at - engine->bodies()[b].position).cross(each.force));
        }
        CHECK(force.norm() < 1e-6);
        CHECK(moment.norm() < 1e-6);
      }
    }
  }
}

TEST_CASE("the event engine tells the impulse of an impact") {
  // Slipping all along: the friction's is mu of the normal one, against the slip.
  const double tolerance = 1e-9, speed = std::sqrt(2 * 9.81 * 0.4), mu = 0.2, e = 0.5, mass = 3;
  const Scene s = parse_scene(R"(
[scene]
end = 0.3
gravity = [0, 0, -9.81]
engine = "event"
[event]
tolerance = 1e-9
[[body]]
name = "floor"
shape = "plane"
fixed = true
material = "floor"
[[body]]
name = "ball"
shape = "sphere"
radius = 0.1
mass = 3
position = [0, 0, 0.5]
velocity = [0, 20, 0]
material = "ball"
[[pair]]
between = ["floor", "ball"]
friction = 0.2
restitution = 0.5
)",
                              "ball.toml");
  const auto engine = make_engine(s);
  engine->advance(0.3);
  REQUIRE(engine->events().size() == 1);
  const ContactEvent& hit = engine->events()[0];
  const double sign = hit.first == 1 ? 1 : -1, normal = mass * (1 + e) * speed;
  CHECK((sign * hit.impulse - Vector3d(0, -mu * normal, normal)).norm() < 100 * tolerance);
  CHECK(std::abs(engine->bodies()[1].velocity.y() - 20 + mu * normal / mass) < 100 * tolerance);
}

namespace {

// Floats of an array of a .vtp file.
std::vector<float> array_of(const std::filesystem::path& file, const std::string& name) {
  const std::string text = tether::test::content(file);
  const std::size_t entry = text.find("Name=\"" + name + "\"");
  const std::size_t data = text.find("<AppendedData encoding=\"raw\">\n_");
  REQUIRE(entry != std::string::npos);
  REQUIRE(data != std::string::npos);
  const std::size_t offset = std::stoul(text.substr(text.find("offset=\"", entry) + 8));
  const char* at = text.data() + text.find('_', data) + 1 + offset;
  std::uint64_t length = 0;
  std::memcpy(&length, at, sizeof length);
  std::vector<float> out(length / sizeof(float));
  std::memcpy(out.data(), at + sizeof length, length);
  return out;
}

double sum_of(const std::vector<float>& vectors, std::size_t component) {
  double sum = 0;
  for (std::size_t k = component; k < vectors.size(); k += 3) sum += vectors[k];
  return sum;
}

}  // namespace

TEST_CASE("the event engine's forces are in films, tables and expectations: closed forms") {
  // Blocks on a slope, a bob below its pin, and a mass that hangs at rest from a spring.
  const double c = std::sqrt(0.75), N = 2 * 9.81 * c, pull = 9.81 * (0.5 - 0.3 * c);
  std::string text = kSlope;
  text.replace(text.find("[stepping]\nstep = 1e-3"), 22, "[event]\ntolerance = 1e-9");
  text += R"(
[[body]]
name = "bob"
mass = 3
inertia = [1, 1, 1]
position = [20, 0, -1]
[[joint]]
name = "pin"
kind = "hinge"
bodies = ["bob", "world"]
at = [20, 0, 0]
axis = [0, 1, 0]
[[body]]
name = "weight"
mass = 4
inertia = [1, 1, 1]
position = [30, 0, -2]
[[spring]]
name = "spring"
bodies = ["weight", "world"]
at = [[30, 0, -2], [30, 0, 0]]
stiffness = 100
rest = 1.6076
)";
  const auto expect = [&](const std::string& what, const std::string& value) {
    text += "[[expect]]\nthroughout = true\n" + what + "\nvalue = " + value + "\nwithin = 1e-6\n";
  };
  const auto three = [](const Vector3d& v) {
    std::ostringstream out;
    out.precision(17);
    out << "[" << v.x() << ", " << v.y() << ", " << v.z() << "]";
    return out.str();
  };
  const Vector3d normal(0.5, 0, c), up(-c, 0, 0.5);
  expect("quantity = \"joint_force\"\njoint = \"pin\"", "[0, 0, 29.43]");
  expect("quantity = \"joint_moment\"\njoint = \"pin\"", "[0, 0, 0]");
  expect("quantity = \"spring_force\"\nspring = \"spring\"", "39.24");
  expect("quantity = \"contact_force\"\nbody = \"stays\"", "[0, 0, 19.62]");
  expect("quantity = \"contact_force\"\nbody = \"slides\"", three(N * normal + 0.3 * N * up));
  text += "[[expect]]\nquantity = \"contact_slip\"\nbody = \"slides\"\nvalue = " +
          std::to_string(0.4 * pull) + "\nwithin = 1e-5\n";
  Scene s = parse_scene(text, "forces.toml");
  const std::filesystem::path folder = tether::test::folder("event_forces");
  s.output["csv"] = (folder / "a.csv").string();
  s.output["vtk"] = (folder / "a.pvd").string();
  const RunResult result = run(s);
  CHECK(result.engine == "event");
  CHECK(result.failure.empty());
  for (const Judgement& each : result.judgements) CHECK(each.verdict == Verdict::met);
  // At the start, and at the end.
  for (const char* frame : {"000000", "000004"}) {
    CAPTURE(frame);
    const std::filesystem::path film = folder / "a";
    const std::vector<float> force =
        array_of(film / ("contacts_" + std::string(frame) + ".vtp"), "force");
    const std::vector<float> slip =
        array_of(film / ("contacts_" + std::string(frame) + ".vtp"), "slip");
    REQUIRE(force.size() == 8 * 3);
    REQUIRE(slip.size() == 8 * 3);
    // On the first body of each, the slope: it carries both blocks.
    const Vector3d on_slope = -Vector3d(0, 0, 19.62) - (N * normal + 0.3 * N * up);
    for (int k = 0; k < 3; ++k)
      CHECK(std::abs(std::abs(sum_of(force, static_cast<std::size_t>(k))) - std::abs(on_slope[k])) <
            1e-4);
    double fastest = 0;
    for (std::size_t k = 0; k < slip.size(); k += 3)
      fastest = std::max(fastest, Eigen::Vector3f(slip.data() + k).cast<double>().norm());
    CHECK(std::abs(fastest - (frame[5] == '4' ? 0.4 * pull : 0)) < 1e-5);
    const std::vector<float> pin =
        array_of(film / ("joints_" + std::string(frame) + ".vtp"), "force");
    REQUIRE(pin.size() == 3);
    CHECK(std::abs(pin[2] - 29.43) < 1e-4);
    const std::vector<float> tension =
        array_of(film / ("springs_" + std::string(frame) + ".vtp"), "tension");
    REQUIRE(tension.size() == 1);
    CHECK(std::abs(tension[0] - 39.24) < 1e-4);
  }
  const std::string table = tether::test::content(folder / "a.csv");
  CHECK(table.find("pin.fz_N") != std::string::npos);
  CHECK(table.find("in_steps") == std::string::npos);
  const std::string contacts = tether::test::content(folder / "a.contacts.csv");
  CHECK(std::count(contacts.begin(), contacts.end(), '\n') == 1 + 5 * 8);
}

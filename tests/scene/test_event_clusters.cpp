// Contacts whose impacts accumulate together, in the event engine. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <sstream>

#include "event/phase/friction_solve.hpp"
#include "event_runs.hpp"

using namespace event_runs;

namespace {

using Long = long double;  // times of late impacts are asked for to 1e-9

struct Hit {
  Long time;
  int end;
  Long speed;
};

/// A rod of 1 kg and 1 m that falls on its two ends without friction: its flights in closed form,
/// Newton's law for one end at a time.
struct Rod {
  Long z, tilt, vz, spin, restitution, time = 0;

  Long gap(int end, Long t, Long& rate) const {
    const Long arm = end == 0 ? -0.5L : 0.5L, angle = tilt + spin * t;
    rate = vz - 9.81L * t - arm * spin * std::cos(angle);
    return z + vz * t - 4.905L * t * t - arm * std::sin(angle);
  }
  /// The next zero of the gap: the parabola of the gap, then Newton, find it.
  Long next(int end) const {
    Long rate = 0;
    const Long here = gap(end, 0, rate), arm = end == 0 ? -0.5L : 0.5L;
    const Long back = 9.81L - arm * spin * spin * std::sin(tilt);
    Long t =
        (rate + std::sqrt(std::max(0.0L, rate * rate + 2 * back * std::max(here, 0.0L)))) / back;
    for (int k = 0; k < 60; ++k) {
      const Long value = gap(end, t, rate);
      t -= value / rate;
    }
    return t;
  }
  Hit step() {
    const Long first = next(0), second = next(1);
    const int end = first < second ? 0 : 1;
    const Long t = std::min(first, second), arm = end == 0 ? -0.5L : 0.5L;
    Long rate = 0;
    gap(end, t, rate);
    z += vz * t - 4.905L * t * t;
    vz -= 9.81L * t;
    tilt += spin * t;
    time += t;
    const Long lever = -arm * std::cos(tilt);
    const Long impulse = -(1 + restitution) * rate / (1 + 12 * lever * lever);
    vz += impulse;
    spin += 12 * lever * impulse;
    return {time, end, -rate};
  }
};

std::string rod(double height, double tilt, double restitution) {
  return kFloor + "[[body]]\nname = \"rod\"\nshape = \"points\"\n" +
         "points = [[-0.5, 0, 0], [0.5, 0, 0]]\nmass = 1\ninertia = [0.01, " + number(1.0 / 12) +
         ", " + number(1.0 / 12) + "]\nmaterial = \"body\"\nposition = [0, 0, " + number(height) +
         "]\norientation = { axis = [0, 1, 0], rad = " + number(tilt) + " }\n" +
         pair("restitution = " + number(restitution));
}

struct Tumble {
  double restitution, friction;
  std::string size, spin, velocity;
};

std::string tumbling_box(const Tumble& of) {
  return kFloor + "[[body]]\nname = \"box\"\nshape = \"box\"\nsize = " + of.size +
         "\nmass = 1\nmaterial = \"body\"\nposition = [0, 0, 0.15]\nvelocity = " + of.velocity +
         "\nangular_velocity = " + of.spin + "\n" +
         pair("friction = " + number(of.friction) + "\nrestitution = " + number(of.restitution));
}

/// All numbers of the last body.
Eigen::VectorXd state_of(const Engine& engine) {
  const BodyState& b = engine.bodies().back();
  Eigen::VectorXd out(13);
  const double sign = b.orientation.w() < 0 ? -1 : 1;
  out << b.position, sign * b.orientation.coeffs(), b.velocity, b.angular_velocity;
  return out;
}

}  // namespace

TEST_CASE("event: a rod rattles on its two ends to rest, as its flights in closed form say") {
  const double tilt = GENERATE(0.1, 0.2), e = GENERATE(0.3, 0.6);
  std::vector<Hit> hits;
  Rod exact{0.4, tilt, 0, 0, e};
  while (hits.empty() || hits.back().speed > 1e-10) {
    hits.push_back(exact.step());
    if (hits.size() > 10 && hits.back().time - hits[hits.size() - 8].time < 1e-13) break;
  }
  for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-9, 1e-10}) {
    CAPTURE(tilt, e, tolerance);
    const auto engine = run(rod(0.4, tilt, e), tolerance, 3);
    const auto impacts = of_kind(*engine, Kind::impact);
    std::size_t same = 0;
    // Until the ends are nearer to the floor than the tolerance.
    for (; same < std::min(impacts.size(), hits.size()); ++same) {
      if (hits[same].speed * hits[same].speed < 200 * tolerance) break;
      CHECK(std::abs(impacts[same].time - hits[same].time) < 10 * tolerance);
      CHECK(std::abs(impacts[same].before + hits[same].speed) < 30 * tolerance);
    }
    CHECK(same >= (tolerance < 1e-5 ? 6 : 3));
    // The flights end where one end comes to rest first.
    const auto rests = of_kind(*engine, Kind::rest);
    REQUIRE(!rests.empty());
    CHECK(std::abs(rests.front().time - hits.back().time) < 10 * tolerance);
    CHECK(engine->bodies()[1].velocity.norm() < 1e-9);
    CHECK(std::abs(engine->bodies()[1].position.z()) < 1e-9);
    CHECK(std::abs(ledger(*engine, 0.4 * 9.81)) < 1e-11);
    CHECK(engine->counts().events < 400);
  }
}

TEST_CASE("event: a box that falls on its corners comes to rest at one place at every tolerance") {
  const Tumble of = GENERATE(Tumble{0.3, 0.3, "[0.3, 0.2, 0.1]", "[0.3, 0.2, 0.1]", "[0.2, 0, 0]"},
                             Tumble{0.6, 0.2, "[0.3, 0.2, 0.1]", "[0, 0.5, 1]", "[0.5, 0.3, 0]"},
                             Tumble{0.5, 0.5, "[0.3, 0.2, 0.1]", "[0.05, 0, 0]", "[0, 0, 0]"},
                             Tumble{0, 0.4, "[0.3, 0.2, 0.1]", "[1, 0.5, 0]", "[0.3, 0, 0]"});
  const auto exact = run(tumbling_box(of), 1e-10, 2);
  const Eigen::VectorXd there = state_of(*exact);
  CHECK(there.tail(6).norm() < 1e-9);
  for (const double tolerance : {1e-4, 1e-5, 1e-6, 1e-7, 1e-8}) {
    CAPTURE(of.restitution, of.friction, tolerance);
    const auto engine = run(tumbling_box(of), tolerance, 2);
    CHECK((state_of(*engine) - there).cwiseAbs().maxCoeff() < 10 * tolerance);
    CHECK(engine->counts().events < 400);
  }
}

TEST_CASE("event: corners that other contacts press in by less than a band bounce from there") {
  // Once more than 300 events at one time: a gap of -1e-10 that opens at 1e-8 m/s.
  const std::string text =
      kFloor +
      "[[body]]\nname = \"box\"\nshape = \"box\"\nsize = [0.2, 0.2, 0.4]\nmass = 1\n"
      "material = \"body\"\nposition = [0, 0, 0.6]\nvelocity = [0.3, -0.2, 0]\n"
      "orientation = { wxyz = [0.5, 0.5, 0.5, 0.5] }\nangular_velocity = [1, 2.5, -3]\n";
  for (const double friction : {0.0, 0.3, 0.8})
    for (const double e : {0.2, 0.5, 0.9}) {
      CAPTURE(friction, e);
      const auto engine = run(
          text + pair("friction = " + number(friction) + "\nrestitution = " + number(e)), 1e-8, 5);
      CHECK(engine->counts().events < 1500);
      if (friction > 0 && e < 0.9) CHECK(engine->bodies()[1].velocity.norm() < 1e-7);
    }
}

TEST_CASE("event: corners of a slider with clearance hit in turns until they rest (Flores)") {
  // P. Flores, R. Leine, C. Glocker (2010), by an independent code.
  Scene scene = read_scene(TETHER_SHIPPED_SCENES "/clearance.toml");
  Eigen::VectorXd there;
  for (const double tolerance : {1e-10, 1e-8, 1e-7, 1e-6, 1e-5}) {
    CAPTURE(tolerance);
    scene.event->tolerance = tolerance;
    const auto engine = make_engine(scene);
    engine->advance(scene.end);
    const auto impacts = of_kind(*engine, Kind::impact);
    REQUIRE(impacts.size() > 100);
    CHECK(std::abs(impacts[0].time - .002690903648407578) < 10 * tolerance);
    CHECK(std::abs(impacts[0].before + .84163384) < 10 * tolerance + 1e-8);
    CHECK(std::abs(impacts[1].time - .00269225431092511) < 10 * tolerance);
    CHECK(std::abs(impacts[1].before + 1.99247722) < 10 * tolerance + 1e-8);
    const auto lifts = of_kind(*engine, Kind::lift);
    REQUIRE(!lifts.empty());
    CHECK(std::abs(lifts.back().time - .0150313284599) < 10 * tolerance);
    if (there.size() == 0) there = state_of(*engine);
    CHECK((state_of(*engine) - there).head(3).norm() < 10 * tolerance);
    CHECK(engine->counts().events < 3000);
  }
}

TEST_CASE("event: two corners whose forces vanish at one time lift together") {
  // The slider rests on both until the rod carries its weight. Each one closed again in its turn,
  // at a force of rounding, more than 300 times in 3 of these 24 runs.
  Scene scene = read_scene(TETHER_SHIPPED_SCENES "/clearance.toml");
  scene.pairs[0].restitution = 0;
  for (const double friction : {0.02, 0.04, 0.05, 0.0683, 0.08, 0.1, 0.15, 0.2}) {
    scene.pairs[0].friction = friction;
    Eigen::VectorXd there;
    double lift = 0;
    for (const double tolerance : {1e-9, 1e-7, 1e-5}) {
      CAPTURE(friction, tolerance);
      scene.event->tolerance = tolerance;
      const auto engine = make_engine(scene);
      engine->advance(0.04);
      const auto lifts = of_kind(*engine, Kind::lift);
      REQUIRE(!lifts.empty());
      CHECK(engine->counts().events < 40);
      if (there.size() == 0) {
        lift = lifts.back().time;
        there = state_of(*engine);
      }
      CHECK(std::abs(lifts.back().time - lift) < 10 * tolerance);
      CHECK((state_of(*engine) - there).head(3).norm() < 10 * tolerance);
    }
  }
}

TEST_CASE("event: a hull of ten vertices rocks to rest and gains no energy from what closes") {
  // Closing contacts once moved the body onto its gaps, by less than the tolerance, and its energy
  // with them: it rocked for ever.
  const std::string text =
      kFloor +
      "[[body]]\nname = \"stone\"\nshape = \"convex\"\nmass = 1\ninertia = [0.02, 0.02, 0.02]\n"
      "points = [[0.15, 0.02, -0.12], [-0.14, 0.11, -0.13], [-0.03, -0.16, -0.1], [0.12, -0.15, "
      "0.05], "
      "[-0.18, -0.05, 0.08], [0.05, 0.17, 0.12], [0.1, 0.14, -0.07], [-0.11, -0.13, -0.04], "
      "[0.16, 0.03, 0.14], [-0.02, 0.02, 0.19]]\nmaterial = \"body\"\nposition = [0, 0, 0.5]\n"
      "velocity = [0.2, 0.1, 0]\nangular_velocity = [2, -1.5, 1]\n";
  for (const double e : {0.0, 0.5})
    for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
      CAPTURE(e, tolerance);
      const auto engine = run(text + pair("restitution = " + number(e)), tolerance, 5);
      CHECK(engine->counts().events < 1000);
      CHECK(std::abs(ledger(*engine, 0.5 * 9.81 + 0.025 + 0.01 * (4 + 2.25 + 1))) < 1e-7);
      for (const ContactEvent& each : engine->events()) CHECK(each.lost > -1e-9);
    }
}

TEST_CASE("event: a run that is cut while corners rattle goes on with its bits") {
  const Scene scene = parse_scene(
      "[scene]\nengine = \"event\"\nend = 2\ngravity = [0, 0, -9.81]\n[event]\ntolerance = 1e-8\n" +
          tumbling_box({0.6, 0.2, "[0.3, 0.2, 0.1]", "[0, 0.5, 1]", "[0.5, 0.3, 0]"}),
      "test");
  for (const double cut : {0.3, 0.45, 0.459, 0.46, 0.4600465}) goes_on_with_its_bits(scene, cut, 2);
}

namespace {

std::string dominoes(int count) {
  std::string text = kFloor;
  for (int k = 0; k < count; ++k)
    text += "[[body]]\nname = \"domino " + number(k) +
            "\"\nshape = \"box\"\nsize = [0.1, 0.4, 0.8]\nmass = 1\nmaterial = \"body\"\n" +
            "position = [" + number(0.4 * k) + ", 0, 0.4]\n" +
            (k == 0 ? "angular_velocity = [0, 2.5, 0]\nvelocity = [1, 0, 0]\n" : "");
  return text + pair("friction = 0.5") +
         "[[pair]]\nbetween = [\"body\", \"body\"]\nfriction = 0.2\n";
}

}  // namespace

TEST_CASE("event: twelve dominoes are few enough, thirteen have too many pairs of features") {
  const auto refusal = [](int count) {
    return event_engine_refusal(parse_scene(
        "[scene]\nend = 1\ngravity = [0, 0, -9.81]\nengine = \"event\"\n" + dominoes(count),
        "test"));
  };
  CHECK(refusal(12).empty());
  CHECK(refusal(13).find("more than 16000") != std::string::npos);
}

TEST_CASE("event: dominoes that share their forces fall as symmetric ones do") {
  // Once one of two feet was let go where the other could carry all, and the rest rattled askew:
  // 856 times of events at 1e-7 for four of them, 603 for five at 1e-6, centimetres off.
  struct Case {
    int count;
    double tolerance, end;
    std::vector<double> x;
  };
  const std::vector<Case> cases = {
      {4, 1e-7, 2.5, {0.432047900, 0.841209341, 1.251649203, 1.691644917}},
      {5, 1e-6, 2.5, {0.416687451, 0.828444053, 1.240000296, 1.651292216, 2.103203047}}};
  for (const Case& c : cases) {
    CAPTURE(c.count);
    const auto engine = run(dominoes(c.count), c.tolerance, c.end);
    for (std::size_t k = 0; k < c.x.size(); ++k) {
      const BodyState& domino = engine->bodies()[k + 1];
      CHECK(std::abs(domino.position.x() - c.x[k]) < 10 * c.tolerance + 1e-9);
      CHECK(std::abs(domino.position.y()) < 1e-7);
    }
    CHECK(engine->counts().events < 130);
  }
}

namespace {

/// Contacts in one block after the other, of a normal and two tangents each.
tether::scene::event::FrictionProblem of_contacts(const Eigen::MatrixXd& A,
                                                  const Eigen::VectorXd& b, double mu) {
  tether::scene::event::FrictionProblem out{A, b, {}};
  for (int i = 0; i < b.size(); i += 3) out.parts.push_back({i, 2, i, mu});
  return out;
}

}  // namespace

TEST_CASE("event: corners that contradict each other by an error of the state hold all the same") {
  // A box that falls on its four corners, sideways.
  Eigen::MatrixXd J(12, 6);
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector3d arm((k & 1) != 0 ? 0.5 : -0.5, (k & 2) != 0 ? 0.3 : -0.3, -0.2);
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d axis = Eigen::Vector3d::Unit((i + 2) % 3);
      J.row(3 * k + i) << axis.transpose(), arm.cross(axis).transpose();
    }
  }
  Eigen::VectorXd inverse(6), u(6);
  inverse << 1, 1, 1, 20, 10, 8;
  u << 0.2, -0.1, -1, 0, 0, 0;
  const Eigen::MatrixXd A = J * inverse.asDiagonal() * J.transpose();
  Eigen::VectorXd b = -J * u;
  for (int i = 0; i < 12; ++i) b[i] += 1e-10 * std::sin(3.0 * i);
  const event::FrictionSolution answer = event::solve_impact(of_contacts(A, b, 0.5), 1e-8);
  REQUIRE(answer.solved);
  for (int k = 0; k < 4; ++k)
    CHECK(answer.regimes[static_cast<std::size_t>(k)] == tether::contact::Regime::sticking);
  CHECK(answer.w.cwiseAbs().maxCoeff() < 1e-12);
  CHECK((A * answer.x - b).cwiseAbs().maxCoeff() < 1e-9);
  // Two of the four carry more, by the moment of the friction: each side the same.
  CHECK(std::abs(answer.x[0] - answer.x[3] - answer.x[6] + answer.x[9]) < 1e-8);
  // Across the cone they slide, all in one direction, none of them lifted by another's choice.
  const event::FrictionSolution slides = event::solve_impact(of_contacts(A, b, 0.1), 1e-8);
  REQUIRE(slides.solved);
  for (int k = 0; k < 4; ++k) {
    CHECK(slides.regimes[static_cast<std::size_t>(k)] == tether::contact::Regime::sliding);
    CHECK(std::abs(slides.x[3 * k + 1] / slides.x[3 * k + 2] - slides.x[1] / slides.x[2]) < 0.2);
  }
}

// Round-off is all that moves such a contact: the library would refuse it, or take it for one that
// approaches.
TEST_CASE("event: a contact that the joints lock carries nothing") {
  namespace event = tether::scene::event;
  Eigen::MatrixXd A = Eigen::MatrixXd::Identity(6, 6);
  Eigen::VectorXd b(6);
  b << 1, 0.1, -0.2, 3e-17, 0, 1e-17;
  for (const double left : {0.0, 1e-16}) {
    CAPTURE(left);
    A.bottomRightCorner(3, 3) = left * Eigen::Matrix3d::Identity();
    const event::FrictionSolution answer = event::solve_friction(of_contacts(A, b, 0.5));
    REQUIRE(answer.solved);
    CHECK((answer.x.head(3) - b.head(3)).norm() < 1e-14);
    CHECK(answer.x.tail(3).norm() == 0);
  }
}

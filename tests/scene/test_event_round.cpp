// Ellipsoids and cylinders in the event engine. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <functional>
#include <vector>

#include "event/model/features.hpp"
#include "event_runs.hpp"

using namespace event_runs;

namespace {

std::string round_body(const std::string& shape, const Vector3d& position,
                       const std::string& more) {
  return "[[body]]\nname = \"body\"\nmaterial = \"body\"\n" + shape + "\nposition = [" +
         number(position.x()) + ", " + number(position.y()) + ", " + number(position.z()) + "]\n" +
         more + "\n";
}

std::string other_body(const std::string& shape, const std::string& more) {
  return "[[body]]\nname = \"floor\"\nmaterial = \"floor\"\n" + shape + "\n" + more + "\n";
}

/// Simpson's rule in s, p = from (1 - s^2): of what has a root's singularity at `from`.
template <class F>
double from_rest(const F& f, double from) {
  constexpr int kParts = 20000;
  double sum = 0;
  for (int k = 0; k <= kParts; ++k) {
    const double s = std::max(1e-6, static_cast<double>(k) / kParts);
    const double part = 2 * s * from * f(from * (1 - s * s));
    sum += part * (k == 0 || k == kParts ? 1 : k % 2 == 1 ? 4 : 2);
  }
  return sum / (3 * kParts);
}

}  // namespace

TEST_CASE("event: an ellipsoid rocks on a rough floor with the period of its energy") {
  // Its centre is h over the floor and d from the contact, d^2 = h^2 + h'^2.
  const double a = 0.25, b = 0.1, mass = 2, start = 0.5, inertia = mass / 5 * (a * a + b * b);
  const auto h = [&](double p) { return std::hypot(a * std::sin(p), b * std::cos(p)); };
  const auto speed = [&](double p) {
    const double slope = (a * a - b * b) * std::sin(p) * std::cos(p) / h(p);
    const double around = inertia + mass * (h(p) * h(p) + slope * slope);
    return std::sqrt(2 * mass * 9.81 * (h(start) - h(p)) / around);
  };
  const double quarter = from_rest([&](double p) { return 1 / speed(p); }, start);
  const std::string text =
      kFloor +
      round_body("shape = \"ellipsoid\"\nhalf_axes = [0.25, 0.1, 0.1]", {0, 0, h(start)},
                 "mass = 2\norientation = { axis = [0, 1, 0], rad = 0.5 }") +
      pair("friction = 5");
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(text, tolerance, quarter);
    CHECK(engine->events().empty());
    CHECK(std::abs(engine->bodies()[1].angular_velocity.norm() - speed(0)) < 10 * tolerance);
    CHECK(std::abs(engine->bodies()[1].position.z() - b) < 10 * tolerance);
  }
}

TEST_CASE("event: an ellipsoid that tumbles is struck as its arm and inertia say") {
  // Half axes .3, .1 in the plane of its turn; without friction w_n is turned back at e = .5.
  const double mass = 1, turn = 0.7, spin = 2, fall = 3;
  const double inertia = mass / 5 * (0.09 + 0.01);
  const double reach = std::hypot(0.3 * std::sin(turn), 0.1 * std::cos(turn));
  const double arm = (0.09 - 0.01) * std::sin(turn) * std::cos(turn) / reach;
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const double early = 1e-3;  // before the impact
    const std::string text =
        kFloor +
        round_body("shape = \"ellipsoid\"\nhalf_axes = [0.3, 0.2, 0.1]",
                   {0, 0, reach + (fall + arm * spin) * early},
                   "mass = 1\norientation = { axis = [0, 1, 0], rad = " + number(turn) +
                       " }\nvelocity = [0, 0, " + number(-fall) + "]\nangular_velocity = [0, " +
                       number(spin) + ", 0]") +
        pair("restitution = 0.5");
    const auto engine = run(text, tolerance, 2 * early, "");
    const auto hits = of_kind(*engine, Kind::impact);
    REQUIRE(hits.size() == 1);
    // The turn goes on a little until then: second order in `early`.
    const double approach = -hits[0].before,
                 normal = approach * 1.5 / (1 / mass + arm * arm / inertia);
    CHECK(std::abs(hits[0].impulse.z() - normal) < 0.02 * normal);
    CHECK(std::abs(hits[0].after - 0.5 * approach) < 10 * tolerance);
    CHECK(std::abs(ledger(*engine, 0.5 * mass * fall * fall + 0.5 * inertia * spin * spin)) <
          10 * tolerance);
  }
}

TEST_CASE("event: ellipsoids of equal axes touch as spheres do") {
  const std::string ball = "shape = \"sphere\"\nradius = 0.2";
  const std::string oval = "shape = \"ellipsoid\"\nhalf_axes = [0.2, 0.2, 0.2]";
  const std::string dome = "shape = \"sphere\"\nradius = 1",
                    box = "shape = \"box\"\nsize = [2, 2, 2]";
  const std::string bar = "shape = \"capsule\"\nradius = 0.5\nlength = 2";
  const std::string moving = "mass = 1\nvelocity = [0.4, 0.1, 0]\nangular_velocity = [1, 2, 3]";
  struct Case {
    std::string floor;
    Vector3d at;
  };
  for (const Case& each :
       {Case{dome, {0.1, 0.2, 1.5}}, Case{box, {0.95, 0.1, 1.4}}, Case{box, {1.05, 0.1, 1.4}},
        Case{box, {1.05, 1.06, 1.4}}, Case{bar, {0.1, 0.05, 1.9}}}) {
    CAPTURE(each.floor, each.at.transpose());
    const auto moved = [&](const std::string& shape) {
      return run(other_body(each.floor, "fixed = true") + round_body(shape, each.at, moving) +
                     pair("friction = 0.3\nrestitution = 0.6"),
                 1e-8, 0.9);
    };
    const auto as_ball = moved(ball), as_oval = moved(oval);
    REQUIRE(!as_ball->events().empty());
    REQUIRE(as_oval->events().size() == as_ball->events().size());
    for (std::size_t k = 0; k < as_ball->events().size(); ++k)
      CHECK(std::abs(as_oval->events()[k].time - as_ball->events()[k].time) < 1e-7);
    CHECK((as_oval->bodies()[1].position - as_ball->bodies()[1].position).norm() < 1e-7);
    CHECK((as_oval->bodies()[1].angular_velocity - as_ball->bodies()[1].angular_velocity).norm() <
          1e-6);
  }
}

TEST_CASE("event: discs that nearly touch have their gap, not that of another local maximum") {
  event::RoundOnRound pair;
  pair.first.shape.diagonal().head<2>().setConstant(0.57244141094380863);
  pair.second.shape.diagonal().head<2>().setConstant(3.8760826052101529);
  mechanics::Frame<double> A{}, B{};
  for (mechanics::Frame<double>* f : {&A, &B})
    for (Vector3d* v : {&f->x, &f->v, &f->a, &f->W, &f->alpha}) v->setZero();
  A.R = Eigen::Quaterniond(0.86396770493887998, -0.064217334086719188, 0.46299535657540358,
                           0.18727316576342162)
            .toRotationMatrix();
  B.R = Eigen::Quaterniond(0.63011381465922478, -0.30824920609155698, 0.67386406888064987,
                           0.23204789202046161)
            .toRotationMatrix();
  A.x = Vector3d(0.62036644694359167, -0.6745669080757295, 3.8956402296829782);
  CHECK(std::abs(pair.touch(A, B).gap - 0.00435348675) < 1e-10);
}

TEST_CASE("event: the second derivative of round contacts is that of their gap") {
  using namespace tether::scene::event;
  Frame<double> A, B;
  const Eigen::AngleAxisd turn_a(0.7, Vector3d(1, 2, -1).normalized()),
      turn_b(-0.4, Vector3d(0.3, 1, 2).normalized());
  A.x = {0.3, 0.2, 2.1};
  A.v = {0.1, -0.2, 0.3};
  A.a = {0.5, 0.4, -0.3};
  A.W = {0.6, -0.5, 0.9};
  A.alpha = {-0.2, 0.7, 0.1};
  B.x = {-0.1, 0.05, 0};
  B.v = {-0.2, 0.1, 0.1};
  B.a = {0.1, 0.2, 0.6};
  B.W = {-0.3, 0.8, 0.2};
  B.alpha = {0.4, -0.1, 0.5};
  A.R = turn_a.toRotationMatrix();
  B.R = turn_b.toRotationMatrix();
  // Along the motion, to second order.
  const auto ahead = [](const Frame<double>& f, double t) {
    Frame<double> out = f;
    out.x += t * f.v + 0.5 * t * t * f.a;
    out.v += t * f.a;
    const Vector3d turn = t * f.W + 0.5 * t * t * f.alpha;
    out.R = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix() * f.R;
    out.W += t * f.alpha;
    return out;
  };
  const Round oval{{0.1, 0, 0.05}, Vector3d(0.5, 0.3, 0.4).asDiagonal(), 0, Vector3d::Zero()};
  const Round disc{{0, 0.1, 0}, Vector3d(0.4, 0.4, 0).asDiagonal(), 0, Vector3d::UnitZ()};
  const Round other{{0, 0, 0.1}, Vector3d(0.6, 0.7, 0.2).asDiagonal(), 0.05, Vector3d::Zero()};
  const Segment line{{-1, 0.2, 0}, Vector3d(1, 0.3, 0.2).normalized(), 2, 0.1, {}};
  const Face plane{{0, 0, 0.1}, Vector3d(0.1, 0.2, 1).normalized(), {}};
  const std::vector<std::function<Touch(const Frame<double>&, const Frame<double>&)>> looks = {
      [&](const auto& a, const auto& b) {
        return RoundOnPlane{oval, plane, 0}.touch(a, b);
      },
      [&](const auto& a, const auto& b) {
        return RoundOnPlane{disc, plane, 0}.touch(a, b);
      },
      [&](const auto& a, const auto& b) {
        return RoundOnRound{oval, other}.touch(a, b);
      },
      [&](const auto& a, const auto& b) {
        return RoundOnRound{disc, other}.touch(a, b);
      },
      [&](const auto& a, const auto& b) {
        return RoundOnLine{oval, line}.touch(a, b);
      },
      [&](const auto& a, const auto& b) {
        return RoundOnLine{disc, line}.touch(a, b);
      },
      [&](const auto& a, const auto& b) {
        return PointOnCircle{{{0.1, 0, 0}, 0.2}, {0, 0.1, 0}, Vector3d::UnitZ(), 0.6}.touch(a, b);
      }};
  for (std::size_t k = 0; k < looks.size(); ++k) {
    CAPTURE(k);
    const double t = 1e-4;
    const Touch here = looks[k](A, B), there = looks[k](ahead(A, t), ahead(B, t)),
                back = looks[k](ahead(A, -t), ahead(B, -t));
    CHECK(here.gap > 0.1);
    CHECK(std::abs((there.gap - back.gap) / (2 * t) - here.rate) < 1e-7);
    CHECK(std::abs((there.gap - 2 * here.gap + back.gap) / (t * t) - here.second) < 1e-6);
    CHECK(((there.point - back.point) / (2 * t) - here.point_velocity).norm() < 1e-6);
    CHECK(std::abs(here.normal.norm() - 1) < 1e-14);
  }
}

TEST_CASE("event: a cylinder rolls down a slope on its side, and a disc upright") {
  const double slope = 0.2;
  const std::string gravity =
      "[" + number(9.81 * std::sin(slope)) + ", 0, " + number(-9.81 * std::cos(slope)) + "]";
  for (const double length : {0.4, 0.02})
    for (const double tolerance : kLadder) {
      CAPTURE(length, tolerance);
      const auto engine = run(
          kFloor +
              round_body("shape = \"cylinder\"\nradius = 0.1\nlength = " + number(length),
                         {0, 0, 0.1}, "mass = 2\norientation = { axis = [1, 0, 0], deg = 90 }") +
              pair("friction = 0.5"),
          tolerance, 1, gravity);
      CHECK(engine->events().empty());
      CHECK(std::abs(engine->bodies()[1].position.x() - 9.81 * std::sin(slope) / 3) <
            10 * tolerance);
      CHECK(std::abs(engine->bodies()[1].position.z() - 0.1) < 10 * tolerance);
    }
}

TEST_CASE("event: a ball rolls off the flat end of a cylinder over its rim") {
  // Until the rim it keeps its speed; over it, without friction, as over a sphere of its radius:
  // v^2 = v0^2 + 2 g r (1 - cos), it leaves where cos = 2/3 + v0^2 / (3 g r).
  const double radius = 0.1, speed = 0.3;
  const double cosine = 2.0 / 3 + speed * speed / (3 * 9.81 * radius);
  const double end = std::sqrt(speed * speed + 2 * 9.81 * radius * (1 - cosine));
  const std::string text =
      other_body("shape = \"cylinder\"\nradius = 0.5\nlength = 1", "fixed = true") +
      round_body("shape = \"sphere\"\nradius = 0.1", {0.35, 0, 0.6},
                 "mass = 1\nvelocity = [0.3, 0, 0]") +
      pair("");
  for (const double tolerance : kLadder) {
    CAPTURE(tolerance);
    const auto engine = run(text, tolerance, 0.9);
    const auto lifts = of_kind(*engine, Kind::lift);
    REQUIRE(lifts.size() == 1);
    CHECK(std::abs(engine->bodies()[1].velocity.x() - end * cosine) < 10 * tolerance);
    CHECK(std::abs(ledger(*engine, 0.5 * speed * speed + 9.81 * 0.6)) < 10 * tolerance);
  }
}

TEST_CASE("event: a cylinder that stands on its flat end is told that, and steps take it") {
  const std::string text =
      kFloor +
      round_body("shape = \"cylinder\"\nradius = 0.1\nlength = 0.4", {0, 0, 0.2}, "mass = 2") +
      pair("friction = 0.5");
  CHECK_THROWS_WITH(run(text, 1e-6, 1), Catch::Contains("flat end"));
  const Scene scene = parse_scene(
      "[scene]\nengine = \"event\"\nend = 0.1\ngravity = [0, 0, -9.81]\n[event]\notherwise = "
      "\"stepping\"\n" +
          text,
      "test");
  const auto engine = make_engine(scene);
  engine->advance(0.1);
  CHECK(std::abs(engine->bodies()[1].position.z() - 0.2) < 1e-6);
}

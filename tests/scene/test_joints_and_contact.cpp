// Joints and contact together in steps, against closed forms. SPDX-License-Identifier: BSD-3-Clause
#include "jointed_scenes.hpp"
#include "support/catch.hpp"
#include "turned.hpp"

using namespace jointed_scenes;

TEST_CASE("joints and contact: a cart on four hinged wheels rolls with the closed acceleration") {
  // Rolling: (10 + 4 (1 + 1/2)) a = 14 g sin 10.
  const auto engine = make_engine(cart(0.5, 1e-3));
  engine->advance(1);
  const double a = 1.490552545048513;
  // n steps of dt: a dt^2 n (n + 1) / 2.
  CHECK(engine->bodies()[0].position.x() == Approx(a * 1e-3 * 1001 / 2).epsilon(1e-9));
  CHECK(engine->bodies()[0].velocity.x() == Approx(a).epsilon(1e-9));
  CHECK(engine->diagnostics().drift < 1e-12);
  CHECK(engine->counts().unsolved == 0);
  const auto slips = make_engine(cart(0.0220408725886 / 2, 1e-3));
  slips->advance(0.5);
  const double mu = 0.0220408725886 / 2, slope = radians(10);
  CHECK(slips->bodies()[0].velocity.x() ==
        Approx(0.5 * kGravity * (std::sin(slope) - mu * std::cos(slope))).epsilon(1e-6));
}

// Half of the load may lie on two wheels of a diagonal, the others then need not roll: lawful, and
// a quarter faster in the mean. Nothing but rounding asks for it.
TEST_CASE("joints and contact: a turned cart keeps the load on all wheels at small tolerances") {
  const double a = 1.490552545048513;
  for (const double tolerance : {1e-10, 1e-12})
    for (const double step : {5e-4, 2.5e-4}) {
      Scene s = turned(cart(0.5, step), {1, 2, -3}, 1.1);
      s.stepping->tolerance = tolerance;
      const auto engine = make_engine(s);
      engine->advance(1);
      INFO("tolerance " << tolerance << ", step " << step);
      CHECK(engine->bodies()[0].velocity.norm() == Approx(a).epsilon(1e-9));
    }
}

TEST_CASE("joints and contact: a parallelogram with a redundant crank meets its stop, order 1") {
  // Impacts at .49829 s with 3.38305 rad/s, half of it given back.
  for (const double step : {4e-3, 1e-3, 2.5e-4}) {
    const auto engine = make_engine(parallelogram(step, 0.5, 1));
    double t = 0, came = 0, left = 0;
    while (left == 0 && t < 1) {
      engine->advance(t += step);
      const double w = engine->bodies()[1].angular_velocity.y();
      (came == 0 || came * w > 0 ? came : left) = w;
    }
    INFO("step " << step << ": " << t << " s, " << came << " rad/s, then " << left);
    CHECK(std::abs(t - 0.4982936597222794) < 1.5 * step);
    CHECK(std::abs(std::abs(came) - 3.383045964807454) < 0.2 * step);
    CHECK(std::abs(left / came + 0.5) < 2 * step);
    CHECK(engine->diagnostics().drift < 1e-12);
  }
}

TEST_CASE("joints and contact: ten copies of each joint give the same motion") {
  const auto one = make_engine(parallelogram(2e-3, 0.5, 1));
  const auto ten = make_engine(parallelogram(2e-3, 0.5, 10));
  one->advance(0.7);
  ten->advance(0.7);
  for (std::size_t i = 0; i < one->bodies().size(); ++i) {
    CHECK((one->bodies()[i].position - ten->bodies()[i].position).norm() < 1e-9);
    CHECK((one->bodies()[i].velocity - ten->bodies()[i].velocity).norm() < 1e-8);
  }
  CHECK(ten->diagnostics().drift < 1e-12);
}

TEST_CASE(
    "joints and contact: a step ladder stands at 1.001 of the least friction, slips at .999") {
  for (const double degrees : {45.0, 60.0}) {
    const double least = 1 / (2 * std::tan(radians(degrees)));
    const auto stands = make_engine(ladder(degrees, 1.001 * least, 2e-3));
    stands->advance(1);
    CHECK(stands->bodies()[0].velocity.norm() < 1e-9);
    const auto slips = make_engine(ladder(degrees, 0.999 * least, 2e-3));
    slips->advance(1);
    CHECK(slips->bodies()[0].velocity.norm() > 1e-4);
  }
}

TEST_CASE("joints and contact: a ladder without friction lies flat at the closed time") {
  // .48107 s, 5.04848 rad/s from 60 degrees.
  for (const double step : {2e-3, 5e-4}) {
    const auto engine = make_engine(ladder(60, 0, step));
    double t = 0, last = 0;
    while (engine->bodies()[0].position.z() > 0.01 && t < 1) {
      last = engine->bodies()[0].angular_velocity.norm();
      engine->advance(t += step);
    }
    // A height of .01 m is passed earlier, by .02 / (5.048) to first order.
    const double error = std::abs(t - (0.4810659304040532 - 0.02 / 5.048477754073601));
    INFO("step " << step << ": " << t << " s, " << last);
    CHECK(error < 1.5 * step);
    CHECK(engine->diagnostics().drift < 1e-12);
  }
}

TEST_CASE("joints and contact: a ladder with friction slides flat at the closed time, order 1") {
  // From 45 degrees, mu = 0.3: th'' = -5.37036 at first, flat at .454674 s with -4.29964 rad/s.
  for (const double step : {2e-3, 5e-4}) {
    const auto engine = make_engine(ladder(45, 0.3, step));
    engine->advance(step);
    CHECK(engine->bodies()[0].angular_velocity.norm() / step ==
          Approx(5.370361953630992).epsilon(step));
    double t = step, last = 0;
    while (engine->bodies()[0].position.z() > 0.01 && t < 1) {
      last = engine->bodies()[0].angular_velocity.norm();
      engine->advance(t += step);
    }
    INFO("step " << step << ": " << t << " s, " << last);
    CHECK(std::abs(t - (0.454673968534977 - 0.02 / 4.299638957499818)) < 1.5 * step);
    CHECK(engine->diagnostics().drift < 1e-12);
  }
}

TEST_CASE("joints and contact: a parallelogram strikes its stop again after its swing, order 1") {
  // It leaves with half of 3.38305 rad/s and comes back with that after 2 K(sin(thm / 2)) / omega,
  // 1 - cos(thm) = 1/8, omega^2 = 3.5 g / 3.
  const double omega = std::sqrt(3.5 * kGravity / 3), w = 3.383045964807454 / 2;
  const double second = 0.4982936597222794 + 2 * std::comp_ellint_1(0.25) / omega;
  for (const double step : {2e-3, 5e-4}) {
    const auto engine = make_engine(parallelogram(step, 0.5, 1));
    double t = 0, came = 0, left = 0, now = 0;
    int impacts = 0;
    while (impacts < 2 && t < 2) {
      came = now;
      engine->advance(t += step);
      now = engine->bodies()[1].angular_velocity.y();
      // Turning round at the end of the swing is slow.
      if (came * now < 0 && std::abs(came) > 0.5) {
        left = now;
        ++impacts;
      }
    }
    INFO("step " << step << ": " << t << " s, " << came << " rad/s, then " << left);
    CHECK(std::abs(t - second) < 4 * step);
    CHECK(std::abs(std::abs(came) - w) < 4 * step);
    CHECK(std::abs(left / came + 0.5) < 10 * step);
  }
}

TEST_CASE("joints and contact: a double pendulum loses (1 - e^2) w^2 / (2 J P J') at a stop") {
  // Two rods of 1 m and 1 kg; the tip strikes a wall. In the angles from the vertical the masses
  // are [4/3, cos(d)/2; cos(d)/2, 1/3], and the tip moves along x by cos(a), cos(b) for each.
  for (const double e : {0.0, 0.4, 1.0})
    for (const double a : {0.3, 1.1})
      for (const double b : {-0.4, 0.8}) {
        Scene s = stepping(1e-4, Vector3d::Zero());
        const Vector3d pin(std::sin(a), 0, -std::cos(a));
        const Vector3d tip = pin + Vector3d(std::sin(b), 0, -std::cos(b));
        Body upper = rod("upper", {0, 0, 0}, pin), lower = rod("lower", pin, tip);
        touch(lower, {tip});
        const Eigen::Vector2d rate(0.7, 1.3), along(std::cos(a), std::cos(b));
        // Positive angles turn against y.
        upper.angular_velocity = -rate[0] * kY;
        upper.velocity = upper.angular_velocity.cross(upper.position);
        lower.angular_velocity = -rate[1] * kY;
        lower.velocity = 2 * upper.velocity + lower.angular_velocity.cross(lower.position - pin);
        add(s, upper);
        add(s, lower);
        s.joints.push_back(hinge(0, kWorld, {0, 0, 0}, kY));
        s.joints.push_back(hinge(1, 0, pin, kY));
        add_wall(s, tip, -Vector3d::UnitX(), 0, e);
        const auto engine = make_engine(s);
        const double before = energy(*engine);
        engine->advance(1e-4);
        Eigen::Matrix2d M;
        M << 4.0 / 3, std::cos(a - b) / 2, std::cos(a - b) / 2, 1.0 / 3;
        const double w = along.dot(rate), mass = 1 / along.dot(M.inverse() * along);
        CAPTURE(e, a, b, w);
        REQUIRE(before == Approx(0.5 * rate.dot(M * rate)).epsilon(1e-3));
        CHECK(before - energy(*engine) ==
              Approx((1 - e * e) * mass * w * w / 2).margin(3e-3 * before));
      }
}

TEST_CASE("joints and contact: a pendulum strikes a wall, again and again, order 1") {
  // A point on 1 m from 60 degrees, the wall at the lowest point, e = 0.8.
  const double times[] = {.538218666720128926, 1.58544198624292315, 2.61574618289199347};
  for (const double step : {2e-3, 5e-4}) {
    Scene s = stepping(step, Vector3d(0, 0, -kGravity));
    const double a = radians(60);
    Body bob = ball("bob", {std::sin(a), 0, -std::cos(a)}, 1, 1e-3);
    touch(bob, {bob.position - 0.1 * kY, bob.position + 0.1 * kY});
    add(s, bob);
    s.joints.push_back(joint(JointKind::distance, 0, kWorld, bob.position, {0, 0, 0}));
    add_wall(s, {0, 0, 0}, Vector3d::UnitX(), 0, 0.8);
    const auto engine = make_engine(s);
    double t = 0, came = 0, speed = 3.1320919526731651;
    for (int impact = 0; impact < 3;) {
      engine->advance(t += step);
      REQUIRE(t < 3);
      const double w = engine->bodies()[0].velocity.x();
      if (came < 0 && w > 0) {
        INFO("step " << step << ", impact " << impact << ": " << t << " s, " << came);
        CHECK(std::abs(t - times[impact]) < 3 * step);
        CHECK(std::abs(-came - speed) < 3 * step);
        CHECK(std::abs(w + 0.8 * came) < 10 * step);
        speed *= 0.8;
        ++impact;
      }
      came = w;
    }
    CHECK(engine->diagnostics().drift < 1e-13);
  }
}

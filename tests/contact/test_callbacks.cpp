// Tether: forces and joints of the caller that throw, or whose values are wrong, at their k-th call
// in steps. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <tether/contact/joint_equations.hpp>
#include <tether/linalg/index.hpp>

#include "linalg/thrown.hpp"
#include "stepping_scenes.hpp"
#include "support/catch.hpp"

using namespace stepping_scenes;
using tc::Vector6d;
using tether::linalg::at;
using tether::test::thrown;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Spoils the call `when`; others are right.
struct Spoiler {
  int when = -1, calls = 0;
  bool now() { return ++calls == when; }
};

struct Spoilers {
  Spoiler force, values, rows, laws;
  enum class Fault {
    throws,
    not_a_number,
    other_count,
    other_body,
    far_body
  } fault = Fault::throws;
  bool is(Fault f) const { return fault == f; }
  void raise() const {
    if (is(Fault::throws)) throw std::runtime_error("the table ends here");
  }
};

// A ball joint to the world, with friction about one axis and a stop about it.
class Hung : public tc::JointEquations {
 public:
  Hung(Spoilers& spoil, int body, int other, const Vector3d& arm, const Vector3d& pivot)
      : spoil_(spoil), body_(body), other_(other), arm_(arm), pivot_(pivot) {}
  int rows() const override { return 3; }
  void values(const tc::BodySet& b, double, double* g) override {
    Eigen::Map<Vector3d> out(g);
    out = b.position[at(body_)] + b.orientation[at(body_)] * arm_ - pivot_;
    if (!spoil_.values.now()) return;
    spoil_.raise();
    out[1] = kNan;
  }
  void add_rows(const tc::BodySet& b, double, tc::JointRows& rows) override {
    const bool now = spoil_.rows.now();
    if (now) spoil_.raise();
    const Vector3d arm = b.orientation[at(body_)] * arm_;
    const int count = now && spoil_.is(Spoilers::Fault::other_count) ? 400 : 3;
    for (int k = 0; k < count; ++k) {
      rows.add(0, now && spoil_.is(Spoilers::Fault::not_a_number) ? kNan : 0);
      Vector6d G;
      G << Vector3d::Unit(k % 3), arm.cross(Vector3d::Unit(k % 3));
      rows.on(now && spoil_.is(Spoilers::Fault::other_body) ? other_ : body_, G);
    }
  }
  bool has_laws() const override { return true; }
  void add_laws(const tc::BodySet&, double, tc::JointLaws& laws) override {
    const bool now = spoil_.laws.now();
    if (now) spoil_.raise();
    Vector6d G = Vector6d::Unit(4);
    const int count = now && spoil_.is(Spoilers::Fault::other_count) ? 200 : 1;
    for (int k = 0; k < count; ++k) {
      laws.add_bounded(0, now && spoil_.is(Spoilers::Fault::not_a_number) ? kNan : 0.3, 2);
      laws.on(now && spoil_.is(Spoilers::Fault::other_body) ? other_
              : now && spoil_.is(Spoilers::Fault::far_body) ? 1000000
                                                            : body_,
              G);
    }
  }

 private:
  Spoilers& spoil_;
  int body_, other_;
  Vector3d arm_, pivot_;
};

constexpr int kSteps = 12;

tc::Stepper make(Spoilers& spoil, double accuracy) {
  Scene scene(5e-3);
  scene.friction(0.4);
  scene.ground();
  scene.options.max_halvings = 2;
  scene.options.accuracy = accuracy;
  for (int k = 0; k < 3; ++k) scene.sphere(0.1, 1 + k, {0.05 * k, 0.03 * k, 0.1 + 0.19 * k});
  scene.box({0.2, 0.2, 0.2}, 1, {2, 0, 0.1});
  scene.box({0.2, 0.2, 0.2}, 1, {2.02, 0, 0.301});
  const int rod = scene.box({0.1, 0.2, 0.3}, 1, {5, 0, 1});
  tc::Stepper stepper = scene.stepper();
  const Vector3d arm(0.2, 0, 0.1);
  stepper.add_joints(std::make_unique<Hung>(spoil, rod, 1, arm, Vector3d(Vector3d(5, 0, 1) + arm)));
  stepper.add_force("wind", [&spoil](tc::BodySet& bodies, double, double dt) {
    bodies.motion[1].velocity[0] += 0.1 * dt;
    if (!spoil.force.now()) return;
    spoil.raise();
    bodies.motion[1].velocity[0] = kNan;
  });
  return stepper;
}

bool is_finite(const tc::Stepper& s) {
  for (int i = 0; i < s.bodies().size(); ++i)
    if (!position(s, i).allFinite() || !velocity(s, i).allFinite() ||
        !angular_velocity(s, i).allFinite())
      return false;
  return true;
}

}  // namespace

TEST_CASE("callbacks of steps: an exception at the k-th call comes through, and steps go on") {
  for (const double accuracy : {0.0, 1e-3}) {
    Spoilers counted;
    tc::Stepper whole = make(counted, accuracy);
    for (int k = 0; k < kSteps; ++k) whole.step();
    REQUIRE(whole.succeeded());
    for (Spoiler Spoilers::*which :
         {&Spoilers::force, &Spoilers::values, &Spoilers::rows, &Spoilers::laws}) {
      const int calls = (counted.*which).calls;
      REQUIRE(calls >= kSteps);
      for (int k = 1; k <= calls; k += std::max(1, calls / 20)) {
        INFO("accuracy " << accuracy << ", call " << k << " of " << calls);
        Spoilers spoil;
        (spoil.*which).when = k;
        std::string text;
        int after = 0;
        try {
          tc::Stepper stepper = make(spoil, accuracy);
          for (int n = 0; n < 2 * kSteps; ++n) {
            try {
              stepper.step();
            } catch (const std::runtime_error& e) {
              text += e.what();
            }
            if (!text.empty()) ++after;
          }
          CHECK(after > 0);
          CHECK(is_finite(stepper));
          CHECK(stepper.succeeded());
        } catch (const std::runtime_error& e) {  // already where the joints are added
          text = e.what();
        }
        CHECK(text == "the table ends here");
      }
    }
  }
}

TEST_CASE("callbacks of steps: what is wrong at the k-th call is refused by name") {
  using Fault = Spoilers::Fault;
  struct Case {
    Spoiler Spoilers::*which;
    Fault fault;
    const char* text;
  };
  for (const Case& c :
       {Case{&Spoilers::force, Fault::not_a_number, "velocity(0) = nan"},
        Case{&Spoilers::rows, Fault::not_a_number, "rate = nan"},
        Case{&Spoilers::rows, Fault::other_count, "400 rows instead of 3"},
        Case{&Spoilers::rows, Fault::other_body, "is on other bodies than at first"},
        Case{&Spoilers::laws, Fault::not_a_number, "rate = nan"},
        Case{&Spoilers::laws, Fault::other_count, "200 laws instead of 1"},
        Case{&Spoilers::laws, Fault::other_body, "body 1, which no joint holds"},
        Case{&Spoilers::laws, Fault::far_body, "body 1000000, which no joint"}}) {
    INFO(c.text);
    Spoilers counted;
    tc::Stepper whole = make(counted, 0);
    const int first = (counted.*c.which).calls + 1;
    for (int k = 0; k < kSteps; ++k) whole.step();
    for (int k = std::max(first, 2); k <= (counted.*c.which).calls; k += 3) {
      Spoilers spoil;
      spoil.fault = c.fault;
      (spoil.*c.which).when = k;
      tc::Stepper stepper = make(spoil, 0);
      std::string text;
      for (int n = 0; n < kSteps && text.empty(); ++n) text = thrown([&] { stepper.step(); });
      CHECK(text.find(c.text) != std::string::npos);
    }
  }
}

TEST_CASE("callbacks of steps: values of joints that are no numbers are no success") {
  Spoilers counted;
  tc::Stepper whole = make(counted, 0);
  for (int k = 0; k < kSteps; ++k) whole.step();
  const int calls = counted.values.calls;
  bool any = false;
  for (int k = 3; k <= calls; ++k) {
    INFO("call " << k << " of " << calls);
    Spoilers spoil;
    spoil.fault = Spoilers::Fault::not_a_number;
    spoil.values.when = k;
    tc::Stepper stepper = make(spoil, 0);
    for (int n = 0; n < kSteps && spoil.values.calls < k; ++n) stepper.step();
    // Newton's iteration goes on past one; what a step ends with is told.
    CHECK(stepper.succeeded() == std::isfinite(stepper.joint_drift()));
    any = any || !stepper.succeeded();
    stepper.step();
    CHECK(stepper.succeeded());
    CHECK(stepper.joint_drift() < 1e-10);
  }
  CHECK(any);
}

TEST_CASE("a step that leaves the range of numbers is no success") {
  Scene scene(1e-3);
  scene.sphere(0.1, 1, Vector3d::Zero(), {1.7e308, 0, 0});
  tc::Stepper stepper = scene.stepper();
  stepper.add_force("blast",
                    [](tc::BodySet& bodies, double, double) { bodies.motion[0].velocity *= 1.5; });
  stepper.step();
  CHECK_FALSE(stepper.succeeded());
  CHECK(stepper.status() == tc::Status::unsolved);
}

TEST_CASE("joints that are refused leave a stepper without joints") {
  struct Refused : tc::JointEquations {
    int rows() const override { return 1; }
    void values(const tc::BodySet&, double, double* g) override { g[0] = 0; }
    void add_rows(const tc::BodySet&, double, tc::JointRows& r) override {
      r.add(0);
      r.on(7, Vector6d::Unit(0));
    }
    bool has_laws() const override { return true; }
    void add_laws(const tc::BodySet&, double, tc::JointLaws& laws) override {
      laws.add_limit(0, 0.1, 0.0);
    }
  };
  Scene scene(5e-3);
  scene.friction(0.5, 0.5);
  scene.ground();
  const int ball = scene.sphere(0.1, 1, {0, 0, 0.1}, {0, 0, -1});
  tc::Stepper refused = scene.stepper(), plain = scene.stepper();
  CHECK(thrown([&] { refused.add_joints(std::make_unique<Refused>()); }) ==
        "joint 0: body = 7: must be one of 2");
  for (tc::Stepper* s : {&refused, &plain}) {
    s->start_anew(0, 0);
    for (int k = 0; k < 50; ++k) s->step();
  }
  CHECK(position(refused, ball) == position(plain, ball));
}

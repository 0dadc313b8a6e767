// Tether: the gyroscopic term of the equations of motion. SPDX-License-Identifier: BSD-3-Clause
//
//   torque -w x I w in body axes; none where the inertia is a sphere's
#include "mechanics/effect.hpp"

namespace tether::scene::effects {

namespace {

// A sphere's axis of rotation stays by itself.
bool precesses(const Body& body) {
  const double scale = body.inertia.cwiseAbs().maxCoeff();
  const double mean = body.inertia.trace() / 3;
  return !body.fixed && !(body.inertia - mean * Matrix3d::Identity()).isZero(1e-14 * scale);
}

std::vector<int> precessing(const Scene& scene) {
  std::vector<int> bodies;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b)
    if (precesses(scene.bodies[b])) bodies.push_back(static_cast<int>(b));
  return bodies;
}

struct GyroscopicTorque : Force {
  explicit GyroscopicTorque(std::vector<int> bodies) : bodies_(std::move(bodies)) {}
  const char* name() const override { return "gyroscopic term"; }
  Stepping stepping() const override { return Stepping::by_contact; }

  void add(const Bodies& bodies, std::vector<Load6>& loads) const override {
    for (const int b : bodies_) {
      const Inertia& inertia = bodies.inertia[at(b)];
      const Vector3d& w = bodies.w[at(b)];
      loads[at(inertia.slot)].torque_body -= w.cross(inertia.inertia * w);
    }
  }
  void add_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const int b : bodies_) {
      const Inertia& inertia = bodies.inertia[at(b)];
      const Vector3d& w = bodies.w[at(b)];
      J.add_block(J.motion_row(inertia.slot, 3), kBody * inertia.slot + kSpin,
                  skew(w) * inertia.inertia - skew(inertia.inertia * w));
    }
  }

 private:
  std::vector<int> bodies_;
};

struct GyroscopicEffect : Effect {
  void plan(const Scene& scene, EngineKind engine, Lines& lines) const override {
    const bool steps = engine == EngineKind::stepping;
    const Gyroscopic how = scene.stepping.value_or(SteppingOptions{}).gyroscopic;
    if (precessing(scene).empty() || (steps && how == Gyroscopic::none)) return;
    lines.push_back(
        {"gyroscopic term", steps ? std::string(word(how)) : "in the equations of motion"});
  }
  std::unique_ptr<Force> make_force(const Scene& scene, const Bodies&) const override {
    std::vector<int> bodies = precessing(scene);
    return bodies.empty() ? nullptr : std::make_unique<GyroscopicTorque>(std::move(bodies));
  }
};

}  // namespace

TETHER_EFFECT(gyroscopic, GyroscopicEffect)

}  // namespace tether::scene::effects

// Tether: constant forces and torques. SPDX-License-Identifier: BSD-3-Clause
//
//   force at the centre of mass and torque, both constant in world axes
#include <cmath>

#include "mechanics/effect.hpp"

namespace tether::scene::effects {

using namespace mechanics;

namespace {

class LoadForce : public Force {
 public:
  explicit LoadForce(std::vector<Load> loads) : loads_(std::move(loads)) {}
  const char* name() const override { return "loads"; }

  void add(const Bodies& bodies, std::vector<Load6>& loads) const override {
    for (const Load& each : loads_) {
      Load6& load = loads[at(bodies.inertia[at(each.body)].slot)];
      load.force += each.force;
      load.torque_world += each.torque;
    }
  }
  // d(R^T torque) = [R^T torque]x turn
  void add_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Load& each : loads_) {
      const int slot = bodies.inertia[at(each.body)].slot;
      const Matrix3d& R = bodies.frames[at(each.body)].R;
      J.add_turn(J.motion_row(slot, 3), slot, -skew(R.transpose() * each.torque));
    }
  }
  bool has_power() const override { return true; }
  double power(const Bodies& bodies) const override {
    double sum = 0;
    for (const Load& each : loads_) {
      const Frame<double>& f = bodies.frames[at(each.body)];
      sum += each.force.dot(f.v) + each.torque.dot(f.W);
    }
    return sum;
  }
  void add_power_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Load& each : loads_) {
      const int slot = bodies.inertia[at(each.body)].slot;
      const Vector3d torque = bodies.frames[at(each.body)].R.transpose() * each.torque;
      for (int k = 0; k < 3; ++k) {
        J.add(J.work_row, kBody * slot + kVelocity + k, -each.force[k]);
        J.add(J.work_row, kBody * slot + kSpin + k, -torque[k]);
      }
      const Vector3d turn = bodies.w[at(each.body)].cross(torque);
      const Eigen::RowVector4d q = turn.transpose() * bodies.turns[at(slot)];
      for (int k = 0; k < 4; ++k) J.add(J.work_row, kBody * slot + kQuaternion + k, -q[k]);
    }
  }

 private:
  std::vector<Load> loads_;  // on bodies that move
};

class LoadEffect : public Effect {
 public:
  void read(files::Fields& root, files::Reader& r) const override {
    r.each(root, "load", [&](files::Fields& in) {
      Load load;
      load.place = in.place();
      load.body = r.body(in, "body");
      load.force = in.vector("force", load.force, files::kAny, "N");
      load.torque = in.vector("torque", load.torque, files::kAny, "N m");
      if (!in.has("force") && !in.has("torque"))
        in.missing("force", "give force (N), torque (N m) or both");
      r.scene.loads.push_back(load);
    });
  }
  void write(const Scene& scene, files::Writer& out) const override {
    for (const Load& load : scene.loads) {
      out.item("load");
      out.field("body", scene.bodies[at(load.body)].name);
      out.field("force", load.force, "N");
      out.field("torque", load.torque, "N m");
    }
  }
  void check(const Scene& scene, files::Report& report) const override {
    for (const Load& load : scene.loads)
      if (scene.bodies[at(load.body)].fixed)
        report.add(load.place, "load: body",
                   fmt::format("\"{}\"", scene.bodies[at(load.body)].name), "must be able to move");
  }
  void plan(const Scene& scene, EngineKind, std::vector<PlannedEffect>& lines) const override {
    const std::size_t count = scene.loads.size();
    if (count > 0)
      lines.push_back({"loads", fmt::format("{} load{}", count, count == 1 ? "" : "s")});
  }
  void take_rates(const Scene& scene, double length, double mass, Largest& rate) const override {
    for (const Load& load : scene.loads) {
      rate.take(std::sqrt(load.force.norm() / (mass * length)));
      rate.take(std::sqrt(load.torque.norm() / (mass * length * length)));
    }
  }
  void convert(Scene& scene, const Units& units) const override {
    for (Load& load : scene.loads) {
      load.force /= units.force();
      load.torque /= units.energy();
    }
  }
  void limit_momenta(Momenta& momenta) const override {
    for (const Load& load : momenta.scene.loads) {
      if (!momenta.is_outside(load.body)) momenta.steady_force += load.force;
      momenta.axes.none("a load");
    }
  }
  bool does_work(const Scene& scene) const override { return !scene.loads.empty(); }
  std::unique_ptr<Force> make_force(const Scene& scene, const Bodies& bodies) const override {
    std::vector<Load> loads;
    for (const Load& each : scene.loads)
      if (bodies.moves(each.body)) loads.push_back(each);
    return loads.empty() ? nullptr : std::make_unique<LoadForce>(std::move(loads));
  }
};

}  // namespace

const Effect& loads_effect() {
  static const LoadEffect effect;
  return effect;
}

}  // namespace tether::scene::effects

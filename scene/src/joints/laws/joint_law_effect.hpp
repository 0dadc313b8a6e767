// Tether: an effect that is a law of some joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "joints/joint_type.hpp"
#include "mechanics/effect.hpp"

namespace tether::scene::effects {

class JointLawEffect : public Effect {
 public:
  void plan(const Scene& scene, EngineKind,
            std::vector<mechanics::PlannedEffect>& lines) const override {
    const auto count = count_if(scene.joints, has_);
    if (count > 0) lines.push_back({title_, mechanics::counted(count, "joint")});
  }
  bool has_joint_laws(const Scene& scene) const override { return any_of(scene.joints, has_); }

 protected:
  JointLawEffect(const char* title, bool (*has)(const Joint&)) : title_(title), has_(has) {}

  static void read_gains(files::Fields& in, bool angle, double& stiffness, double& damping) {
    stiffness = in.number("stiffness", 0, files::kNotNegative, angle ? "N m/rad" : "N/m");
    damping = in.number("damping", 0, files::kNotNegative, angle ? "N m s/rad" : "N s/m");
  }

 private:
  const char* title_;
  bool (*has_)(const Joint&);
};

}  // namespace tether::scene::effects

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

  static void stiffness(const files::Form& form, bool angle, double& x) {
    form.number("stiffness", x, files::kNotNegative,
                angle ? Unit{"N m/rad", 1, 2, -2} : kStiffness);
  }
  static void damping(const files::Form& form, bool angle, double& x) {
    form.number("damping", x, files::kNotNegative, angle ? Unit{"N m s/rad", 1, 2, -1} : kDamping);
  }

 private:
  const char* title_;
  bool (*has_)(const Joint&);
};

}  // namespace tether::scene::effects

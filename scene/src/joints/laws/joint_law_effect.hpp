// Tether: an effect that is a law of some joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "joints/joint_type.hpp"
#include "mechanics/effect.hpp"

namespace tether::scene::effects {

/// Rows of a stretch or speed and its force, which begin behind a row of zeros and are joined by
/// straight pieces; behind the last one the force stays.
using ForceTable = std::vector<std::array<double, 2>>;

inline double slope(const std::array<double, 2>& from, const std::array<double, 2>& to) {
  return (to[1] - from[1]) / (to[0] - from[0]);
}

/// f(from, to): the rows at the ends of each piece.
template <class F>
void each_piece(const ForceTable& table, const F& f) {
  std::array<double, 2> from{0, 0};
  for (const std::array<double, 2>& to : table) {
    f(from, to);
    from = to;
  }
}

struct JointLawEffect : Effect {
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    add_count(lines, title_, count_if(scene.joints, has_), "joint");
  }
  bool has_joint_laws(const Scene& scene) const override { return any_of(scene.joints, has_); }

 protected:
  JointLawEffect(const char* title, bool (*has)(const Joint&)) : title_(title), has_(has) {}

  static void stiffness(const Form& form, bool angle, double& x) {
    form.number("stiffness", x, kNotNegative, angle ? Unit{"N m/rad", 1, 2, -2} : kStiffness);
  }
  static void damping(const Form& form, bool angle, double& x) {
    form.number("damping", x, kNotNegative, angle ? Unit{"N m s/rad", 1, 2, -1} : kDamping);
  }

 private:
  const char* title_;
  bool (*has_)(const Joint&);
};

}  // namespace tether::scene::effects

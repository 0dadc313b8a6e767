// Tether: the joints of a scene, as the contact library's steps take them.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "joints/joint_laws.hpp"
#include "joints/joint_rows.hpp"
#include "mechanics/force.hpp"

namespace tether::scene::stepping {

/// The rows that the smooth engine has (joints::JointRows), at the positions of a BodySet with the
/// bodies of the scene.
class SteppedJoints final : public contact::JointEquations {
 public:
  explicit SteppedJoints(const Scene& scene);

  int rows() const override { return rows_.count(); }
  void values(const contact::BodySet& bodies, double t, double* g) override;
  void add_rows(const contact::BodySet& bodies, double t, contact::JointRows& out) override;
  /// Impulses by row, over dt, as forces at these positions.
  std::vector<JointForce> forces(const contact::BodySet& bodies, double t,
                                 const std::vector<double>& impulses,
                                 const std::vector<double>& law_impulses, double dt);
  bool has_laws() const override { return laws_.any(); }
  void add_laws(const contact::BodySet& bodies, double t, contact::JointLaws& out) override;
  std::string name(int joint) const override { return "joint \"" + rows_.name(joint) + "\""; }

 private:
  struct Gradient {
    int joint, first, second;
    double rate;
    mechanics::Wrench<double> on_first, on_second;
  };
  void add_couplings(contact::JointRows& out) const;

  mechanics::SteppedBodies bodies_;
  joints::JointRows rows_;
  joints::Reactions reactions_;
  joints::JointLaws laws_;
  std::vector<Gradient> gradients_;  // by row
};

}  // namespace tether::scene::stepping

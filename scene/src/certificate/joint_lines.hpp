// Tether: the rows of joints as a certificate tells them. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "joints/joint_rows.hpp"

namespace tether::scene::certificate {

/// The equations of all joints of a scene, one by one, then the directions that joints with laws,
/// springs or couplings leave free.
class JointLines {
 public:
  explicit JointLines(const Scene& scene);

  /// The lines `row`.
  void put_rows(const Scene& scene, std::string& out) const;

  /// A row's loads on its bodies for an impulse of 1.
  struct Unit {
    int number, joint;
    std::array<int, 2> body;
    std::array<mechanics::Wrench<double>, 2> on;
  };
  std::vector<Unit> units(const mechanics::Bodies& bodies, double time);
  /// Reactions by the multipliers of the engine's rows.
  std::vector<JointForce> reactions(const mechanics::Bodies& bodies, double time,
                                    const std::vector<double>& multipliers) {
    rows_.set_time(time);
    return reactions_.find(rows_, bodies, multipliers.data());
  }
  /// The lines `pull` of these, joint by joint.
  void put_pulls(const mechanics::Bodies& bodies, double time,
                 const std::vector<JointForce>& forces, std::string& out);

 private:
  struct Free {
    int joint;
    joints::Coordinate along;
    int component;  // of a ball: along an axis of the world; else -1
  };

  joints::JointRows rows_;
  joints::Reactions reactions_;
  std::vector<Free> free_;
};

}  // namespace tether::scene::certificate

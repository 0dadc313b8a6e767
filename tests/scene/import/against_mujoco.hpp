// Tests: the mass matrix and the accelerations of an imported scene, by the joints of its file, and
// MuJoCo's own. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mujoco/mujoco.h>

#include <Eigen/Dense>
#include <algorithm>
#include <map>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <tether/scene/files.hpp>
#include <vector>

#include "import/import.hpp"
#include "joints/coordinate.hpp"
#include "smooth/system.hpp"

namespace tether::scene::testing {

/// MuJoCo's model of a file, with its data. Throws std::runtime_error where MuJoCo reads none.
class MujocoModel {
 public:
  explicit MujocoModel(const std::string& file) {
    char why[1000] = "";
    model_.reset(mj_loadXML(file.c_str(), nullptr, why, sizeof why));
    if (!model_) throw std::runtime_error(why);
    data_.reset(mj_makeData(model_.get()));
  }
  mjModel& model() { return *model_; }
  mjData& data() { return *data_; }
  std::string name(int joint) const {
    const char* const found = mj_id2name(model_.get(), mjOBJ_JOINT, joint);
    return found != nullptr ? found : "";
  }

 private:
  struct Free {
    void operator()(mjModel* m) const { mj_deleteModel(m); }
    void operator()(mjData* d) const { mj_deleteData(d); }
  };
  std::unique_ptr<mjModel, Free> model_;
  std::unique_ptr<mjData, Free> data_;
};

/// A joint of one coordinate in both.
struct CommonJoint {
  std::size_t joint;  // of the scene
  int dof;            // of MuJoCo
};

inline std::vector<CommonJoint> common_joints(const Scene& scene, MujocoModel& mujoco) {
  std::map<std::string, std::size_t> joints;
  for (std::size_t j = 0; j < scene.joints.size(); ++j) joints.emplace(scene.joints[j].name, j);
  std::vector<CommonJoint> out;
  for (int j = 0; j < mujoco.model().njnt; ++j) {
    const int type = mujoco.model().jnt_type[j];
    const auto found = joints.find(mujoco.name(j));
    if ((type == mjJNT_HINGE || type == mjJNT_SLIDE) && found != joints.end())
      out.push_back({found->second, mujoco.model().jnt_dofadr[j]});
  }
  return out;
}

/// Velocities of all bodies by the rates of the joints, 6 rows for each body: linear, angular.
inline Eigen::MatrixXd velocities_by_rates(const Scene& scene,
                                           const std::vector<CommonJoint>& common) {
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6 * static_cast<int>(scene.bodies.size()),
                                            static_cast<int>(common.size()));
  std::map<std::size_t, int> column_of;
  for (std::size_t k = 0; k < common.size(); ++k) column_of[common[k].joint] = static_cast<int>(k);
  // A coupled joint moves as the one that it follows.
  for (const Coupling& each : scene.couplings)
    if (const auto of = column_of.find(static_cast<std::size_t>(each.joints[1]));
        of != column_of.end())
      column_of.emplace(static_cast<std::size_t>(each.joints[0]), of->second);
  std::multimap<int, std::size_t> carried_by;
  for (std::size_t j = 0; j < scene.joints.size(); ++j)
    carried_by.emplace(scene.joints[j].first, j);
  for (int b = 0; b < static_cast<int>(scene.bodies.size()); ++b) {
    const Body& body = scene.bodies[static_cast<std::size_t>(b)];
    for (int at = b; at >= 0;) {
      const auto found = carried_by.find(at);  // closures come after the joints of the tree
      if (found == carried_by.end()) break;
      const Joint& joint = scene.joints[found->second];
      at = joint.second;
      const auto column = column_of.find(found->second);
      if (column == column_of.end()) continue;
      const Eigen::Vector3d u = joint.axis.normalized();
      auto moved = J.block<6, 1>(6 * b, column->second);
      if (joint.kind == JointKind::slider)
        moved.head<3>() = u;
      else
        moved << u.cross(body.position - joint.at), u;
    }
  }
  return J;
}

/// How far the two are apart, relative to MuJoCo's own.
struct Difference {
  std::size_t joints = 0;
  double masses = 0, accelerations = 0;
};

inline double apart(const Eigen::MatrixXd& here, const Eigen::MatrixXd& there) {
  return there.norm() > 0 ? (here - there).norm() / there.norm() : here.norm();
}

/// At random positions within the limits and at random rates, nothing touching; `text`: of `file`.
inline Difference against_mujoco(const std::string& text, const std::string& file, unsigned seed,
                                 import::ImportOptions options = {}) {
  MujocoModel mujoco(file);
  mjModel& m = mujoco.model();
  mjData& d = mujoco.data();
  std::mt19937 random(seed);
  const auto number = [&] { return static_cast<double>(random() % 2000) / 1000 - 1; };
  for (int j = 0; j < m.njnt; ++j) {
    if (m.jnt_type[j] != mjJNT_HINGE && m.jnt_type[j] != mjJNT_SLIDE) continue;
    double q = m.qpos0[m.jnt_qposadr[j]] + (m.jnt_type[j] == mjJNT_HINGE ? 0.5 : 0.1) * number();
    if (m.jnt_limited[j]) q = std::min(std::max(q, m.jnt_range[2 * j]), m.jnt_range[2 * j + 1]);
    d.qpos[m.jnt_qposadr[j]] = q;
    if (!mujoco.name(j).empty()) options.positions.emplace_back(mujoco.name(j), q);
  }
  for (const auto& [name, value] : options.controls)
    d.ctrl[mj_name2id(&m, mjOBJ_ACTUATOR, name.c_str())] = value;
  Scene scene = parse_scene(import::import_robot(text, file, options).toml, "robot.toml");

  const std::vector<CommonJoint> common = common_joints(scene, mujoco);
  for (const CommonJoint& each : common) d.qvel[each.dof] = number();
  mj_forward(&m, &d);
  const Eigen::MatrixXd J = velocities_by_rates(scene, common);
  const int n = static_cast<int>(common.size());
  Eigen::VectorXd rates(n), there(n), here(n);
  Eigen::MatrixXd full(m.nv, m.nv), M(n, n);
  mj_fullM(&m, full.data(), d.qM);
  for (int i = 0; i < n; ++i) {
    rates[i] = d.qvel[common[static_cast<std::size_t>(i)].dof];
    there[i] = d.qacc_smooth[common[static_cast<std::size_t>(i)].dof];
    for (int k = 0; k < n; ++k)
      M(i, k) =
          full(common[static_cast<std::size_t>(i)].dof, common[static_cast<std::size_t>(k)].dof);
  }
  Eigen::MatrixXd masses = Eigen::MatrixXd::Zero(n, n);
  const Eigen::VectorXd motion = J * rates;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    Body& body = scene.bodies[b];
    if (body.fixed) continue;
    const auto rows = J.middleRows<6>(6 * static_cast<int>(b));
    const Eigen::Matrix3d R = body.orientation.toRotationMatrix();
    masses +=
        body.mass * rows.topRows<3>().transpose() * rows.topRows<3>() +
        rows.bottomRows<3>().transpose() * R * body.inertia * R.transpose() * rows.bottomRows<3>();
    body.velocity = motion.segment<3>(6 * static_cast<int>(b));
    body.angular_velocity = motion.segment<3>(6 * static_cast<int>(b) + 3);
  }
  smooth::System system(scene, Units{});
  Eigen::VectorXd y = system.start_state(), yp;
  system.complete(0, y, yp);
  mechanics::Bodies bodies = mechanics::placed_bodies(scene);
  int slot = 0;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    if (scene.bodies[b].fixed) continue;
    mechanics::Frame<double>& f = bodies.frames[b];
    f.v = scene.bodies[b].velocity;
    f.W = scene.bodies[b].angular_velocity;
    f.a = yp.segment<3>(mechanics::kBody * slot + mechanics::kVelocity);
    f.alpha = f.R * yp.segment<3>(mechanics::kBody * slot + mechanics::kSpin);
    ++slot;
  }
  bodies.moving = slot;
  for (int i = 0; i < n; ++i) {
    const joints::Coordinate along(scene.joints[common[static_cast<std::size_t>(i)].joint], bodies);
    double s[3];
    along.derivatives<2>(bodies.frames[static_cast<std::size_t>(along.first())],
                         bodies.frames[static_cast<std::size_t>(along.second())], s);
    here[i] = s[2];
  }
  return {common.size(), apart(masses, M), apart(here, there)};
}

}  // namespace tether::scene::testing

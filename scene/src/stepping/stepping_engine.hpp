// Tether: the engine that steps with impulses. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "effects/list.hpp"
#include "joints/coordinate.hpp"
#include "joints/joint_rows.hpp"
#include "mechanics/force.hpp"

namespace tether::scene::stepping {

/// The rows that the smooth engine has (joints::JointRows), at the positions of a BodySet with the
/// bodies of the scene.
class SteppedJoints final : public contact::JointEquations {
 public:
  explicit SteppedJoints(const Scene& scene)
      : bodies_(scene),
        rows_(scene, bodies_.bodies()),
        reactions_(scene, bodies_.bodies()),
        laws_(scene, bodies_.bodies()) {}

  /// The last ones are of zeros: they join the bodies of a cable that rubs, which has laws only.
  int rows() const override { return rows_.count() + static_cast<int>(laws_.slips().size()); }
  void values(const contact::BodySet& bodies, double t, double* g) override {
    bodies_.copy(bodies);
    rows_.set_time(t);
    rows_.values<0>(bodies_.bodies(), g);
    std::fill_n(g + rows_.count(), laws_.slips().size(), 0.0);
  }
  void add_rows(const contact::BodySet& bodies, double t, contact::JointRows& out) override;
  /// Impulses by row, over dt, as forces at these positions.
  std::vector<JointForce> reactions(const contact::BodySet& bodies, double t,
                                    const std::vector<double>& impulses, double dt) {
    bodies_.copy(bodies);
    rows_.set_time(t);
    std::vector<double> multipliers(mechanics::at(rows_.count()), 0);
    for (std::size_t i = 0; i < multipliers.size() && dt > 0; ++i)
      multipliers[i] = impulses[i] / dt;
    return reactions_.find(rows_, bodies_.bodies(), multipliers.data());
  }
  /// Adds those of the laws there.
  void add_law_forces(const std::vector<double>& impulses, double dt, Forces& out) const {
    laws_.add_forces(bodies_.bodies(), impulses, dt, out);
  }
  bool has_laws() const override { return laws_.any(); }
  void add_laws(const contact::BodySet& bodies, double t, contact::JointLaws& out) override {
    bodies_.set_time(t, 0);
    bodies_.copy(bodies);
    laws_.add(bodies_.bodies(), out);
  }
  bool change_bounds(const std::vector<double>& impulses, double dt,
                     contact::JointLaws& laws) override {
    return laws_.change_bounds(impulses, dt, laws);
  }
  std::string name(int joint) const override {
    return mechanics::at(joint) < rows_.joint_count() ? "joint \"" + rows_.name(joint) + "\""
                                                      : "a cable";
  }

 private:
  /// One row; the first `count` of its bodies are in use.
  struct Gradient {
    int joint = 0;
    double rate = 0;
    std::size_t count = 0;
    std::vector<std::pair<int, contact::Vector6d>> on;
    void add(int body, const mechanics::Wrench<double>& wrench);
  };

  mechanics::SteppedBodies bodies_;
  joints::JointRows rows_;
  joints::Reactions reactions_;
  joints::JointLaws laws_;
  std::vector<Gradient> gradients_;  // by row
};

class EnergyError;
class StepScribe;

class SteppingEngine final : public Engine {
 public:
  explicit SteppingEngine(const Scene& scene, contact::SolverTeam* team = nullptr);
  ~SteppingEngine() override;

  /// Goes on from states of any time, s: to the next boundary at once, where it is not one. Throws
  /// SimulationError.
  void begin_at(double time, const std::vector<BodyState>& states);

  const char* name() const override { return "stepping"; }
  double time() const override { return stepper_.time(); }
  void advance(double t) override;
  const std::vector<BodyState>& bodies() const override { return bodies_; }
  Diagnostics diagnostics() const override;
  const std::vector<ContactState>& contacts() const override;
  Forces forces() const override;
  Counts counts() const override;
  std::vector<EffectCost> costs() const override {
    std::vector<EffectCost> out;
    for (const contact::StageCost& c : stepper_.costs()) out.push_back({c.effect, c.seconds});
    return out;
  }
  void save(std::ostream& out) const override;
  void restore(std::istream& in, Restore how) override;

 private:
  void step();
  void watch_energy(const Scene& scene);
  void take_step() {
    step();
    if (on_failure_ != OnFailure::stop || stepper_.succeeded()) return;
    read_bodies();
    report_failure();
  }
  void report_failure() const;
  void read_bodies();
  void set_bodies(const std::vector<BodyState>& states);
  void take_over(std::istream& in);

  void add_forces(const Scene& scene);
  Eigen::Vector3d surface_velocity(int body, const Eigen::Vector3d& r) const;

  contact::Stepper stepper_;
  mutable mechanics::SteppedBodies stepped_;  // the view of the forces
  std::vector<std::unique_ptr<mechanics::Force>> forces_;
  OnFailure on_failure_;
  SteppedJoints* joints_ = nullptr;  // the stepper's
  std::uint64_t fingerprint_;        // of the scene, in saved states
  std::vector<BodyState> bodies_;
  std::vector<SurfaceSpeed> surface_;  // by body; empty: none moves on its body
  mutable std::vector<ContactState> contacts_;
  mutable long contacts_of_ = -1;              // step that contacts_ belongs to
  std::unique_ptr<StepScribe> scribe_;         // only with Scene::certificate
  std::unique_ptr<EnergyError> energy_error_;  // only where nothing else changes it
};

}  // namespace tether::scene::stepping

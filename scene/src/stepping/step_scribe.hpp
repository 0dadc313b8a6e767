// Tether: writes what steps do to the certificate. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bounds.hpp"
#include "certificate/joint_lines.hpp"
#include "certificate/sheet.hpp"
#include "stepping_engine.hpp"

namespace tether::scene::stepping {

/// Observes the stages of each sub-step. A sub-step that the stepper takes back is known by the
/// next one, which begins where that one began; an impact at which a step is cut, and what an error
/// control has moved, by the next one, too, which begins elsewhere than the last one ended.
class StepScribe final : public certificate::Source {
 public:
  StepScribe(const Scene& scene, contact::Stepper& stepper, certificate::Sheet& sheet);
  ~StepScribe() override;
  StepScribe(const StepScribe&) = delete;
  StepScribe& operator=(const StepScribe&) = delete;

  /// Between steps: writes those so far.
  void flush() override;

 private:
  /// A body's state and since when it has it.
  struct Reached {
    double time = -1;
    BodyState state;
  };
  struct Part {
    double start = 0;
    std::vector<int> bodies;
    std::vector<Reached> before;  // of these
    std::string text;
  };

  void see(const contact::StepStage& stage);
  void begin_part(const contact::StepStage& stage);
  void after_stage(const contact::StepStage& stage);
  void note_push(const char* effect);
  void end_part(const contact::StepStage& stage);
  void explain(double time, const std::vector<int>& bodies);
  bool take_back(double time, const std::vector<int>& bodies);
  bool is_at(double time, const std::vector<int>& bodies) const;
  void put_impact(Part& part);
  bool hold(const std::vector<int>& bodies) const;
  void put_pulls(std::string& out, const std::vector<BodyState>& at, double t,
                 const std::vector<double>& impulses);
  void put_pulls_at_end(double t, const std::vector<double>& impulses, Part& part);
  void put_laws(std::string& out, double t, double dt);
  const mechanics::Bodies& place(const std::vector<BodyState>& states);
  double put_contacts(std::string& out, const contact::StepContacts& contacts,
                      const std::vector<contact::PointContact>& solved,
                      const std::vector<BodyState>& velocities) const;
  void reach(double time, const std::vector<int>& bodies, std::string& out);
  BodyState state(int body) const { return mechanics::state_of(stepper_.bodies(), body); }
  void take_states(std::vector<BodyState>& out) const;

  const Scene scene_;
  contact::Stepper& stepper_;
  certificate::Sheet& sheet_;
  std::unique_ptr<SteppedJoints> joints_;                 // null: none
  std::unique_ptr<certificate::JointLines> joint_lines_;  // as above
  std::vector<int> moving_;
  std::vector<char> held_;      // bodies, by joints
  long step_ = -1;              // that `parts_` belong to
  double began_ = 0;            // s
  std::vector<Reached> chain_;  // by body
  std::vector<Part> parts_;

  // The sub-step that is being taken.
  std::vector<int> now_;                                   // bodies
  std::vector<BodyState> begin_, last_, solved_, placed_;  // by body; solved_: by contacts
  std::string pushes_;
  enum class Phase : std::uint8_t { first, solving, moved } phase_ = Phase::first;
  std::vector<Eigen::Vector3d> first_impulses_;
  contact::StepContacts contacts_;
  std::vector<contact::PointContact> as_solved_;
  contact::JointLaws laws_;
  contact::BodySet places_;             // as joints see them
  mechanics::SteppedBodies at_places_;  // bodies there
};

}  // namespace tether::scene::stepping

// Tether: joints are added to a Stepper. SPDX-License-Identifier: BSD-3-Clause
//
// Apart from stepper.cpp, so that programs without joints link nothing of them.
#include <stdexcept>
#include <utility>

#include "step_joints.hpp"
#include "stepping/stepper.hpp"

namespace tether::contact {

void Stepper::add_joints(std::unique_ptr<JointEquations> joints) {
  detail::SubStepper& s = implementation_->steps;
  if (s.joints || s.has_forces)
    throw std::invalid_argument("Stepper::add_joints: once, and before add_force");
  if (!joints || joints->rows() == 0) return;
  if (joints->has_laws() && s.options.law != Law::coulomb)
    throw std::invalid_argument(
        std::string(
            "Stepper::add_joints: limits, motors and friction of joints need law = coulomb, "
            "not ") +
        name(s.options.law));
  if (joints->has_laws() && s.options.restitution_law != RestitutionLaw::newton)
    throw std::invalid_argument(
        "Stepper::add_joints: limits, motors and friction of joints need restitution_law = newton");
  s.add_joints(
      std::make_unique<detail::StepJoints>(std::move(joints), s.bodies, s.options.gyroscopic));
}

}  // namespace tether::contact

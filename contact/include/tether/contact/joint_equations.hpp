// Tether: joints as a Stepper sees them. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/contact/joint_laws.hpp>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

struct BodySet;

/// Joint constraints g(positions, orientations, t) = 0 between the bodies of a Stepper; implemented
/// by the caller. Number of rows and bodies of each row do not change in time.
class JointEquations {
 public:
  virtual ~JointEquations() = default;
  virtual int rows() const = 0;  ///< number of constraints, the same at all times
  /// g, rows() entries, in m or rad.
  virtual void values(const BodySet& bodies, double t, double* g) = 0;
  /// Adds the rows G v = -dg/dt (t alone; positions held) to `rows`, in the order of values().
  virtual void add_rows(const BodySet& bodies, double t, JointRows& rows) = 0;
  /// Whether add_laws() adds any, ever: limits, motors, friction of joints of three rows or more.
  virtual bool has_laws() const { return false; }
  /// Adds the laws of the step that starts at t with these positions, always as many.
  virtual void add_laws(const BodySet& /*bodies*/, double /*t*/, JointLaws&) {}
  /// Bounds of the laws that were added last may depend on the impulses of others. `impulses`, by
  /// law, over dt: those that a solve has found. True: bounds are others now, so that the problem
  /// is solved again.
  virtual bool change_bounds(const std::vector<double>& /*impulses*/, double /*dt*/, JointLaws&) {
    return false;
  }
  /// Name, for messages, of the joint with that number in add_rows().
  virtual std::string name(int joint) const { return "joint " + std::to_string(joint); }
};

}  // namespace tether::contact
TETHER_EXPORT_END

// Tether: joints as a Stepper sees them. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/contact/joints.hpp>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

struct BodySet;

/// Rows g(positions, orientations, t) = 0 between the bodies of a Stepper, written by who knows the
/// joints. The same rows on the same bodies at all times.
class JointEquations {
 public:
  virtual ~JointEquations() = default;
  virtual int rows() const = 0;
  /// g, rows() entries, in m or rad.
  virtual void values(const BodySet& bodies, double t, double* g) = 0;
  /// Adds the rows G v = -dg/dt (t alone; positions held) to `rows`, in the order of values().
  virtual void add_rows(const BodySet& bodies, double t, JointRows& rows) = 0;
  /// What messages call the joint whose number add_rows() gives.
  virtual std::string name(int joint) const { return "joint " + std::to_string(joint); }
};

}  // namespace tether::contact
TETHER_EXPORT_END

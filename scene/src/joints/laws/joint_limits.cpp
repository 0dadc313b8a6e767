// Tether: limits of joints. SPDX-License-Identifier: BSD-3-Clause
//
// s >= lower, upper >= s, of the angle of a hinge or the way of a slider: impulses that only push
// away from the limit, s'+ = -e s'- where it is struck.
#include <tether/linalg/pi.hpp>

#include "joints/laws/joint_law_effect.hpp"

namespace tether::scene::effects {

namespace {

bool has_limits(const Joint& joint) { return joint.limits.has_value(); }

void read_limits(Fields& in, bool angle, Joint& joint) {
  const bool degrees = angle && in.has("limits_deg");
  const char* const key = degrees ? "limits_deg" : angle ? "limits_rad" : "limits";
  if (degrees && in.has("limits_rad"))
    return in.wrong("limits_deg", "give limits_deg or limits_rad, not both");
  if (!in.has(key)) {
    if (in.has("limit_restitution"))
      in.wrong("limit_restitution", "is of limits, and there are none");
    return;
  }
  const std::vector<double> list = in.numbers(key, {2}, degrees ? "degrees" : angle ? "rad" : "m");
  if (list.size() != 2) return;
  const double unit = degrees ? linalg::kPi / 180 : 1;
  JointLimits& limits = joint.limits.emplace();
  limits.lower = unit * list[0];
  limits.upper = unit * list[1];
  limits.restitution = in.number("limit_restitution", 0, kPart, "");
  if (!(limits.lower <= 0 && limits.upper >= 0 && limits.lower < limits.upper))
    in.wrong(key, "must be [least, largest] with 0, where the joint starts, between them");
  if (angle && !(limits.upper - limits.lower < 2 * linalg::kPi))
    in.wrong(key, "must be less than a full turn apart");
}

struct JointLimitEffect : JointLawEffect {
  JointLimitEffect() : JointLawEffect("joint limits", has_limits) {}
  void joint_fields(const Form& form, bool angle, Joint& joint) const override {
    if (form.in()) return read_limits(*form.in(), angle, joint);
    if (!joint.limits) return;
    if (form.out())
      form.out()->field(angle ? "limits_rad" : "limits",
                        std::vector<double>{joint.limits->lower, joint.limits->upper});
    form.number("limit_restitution", joint.limits->restitution, kPart);
    if (!form.units() || angle) return;
    joint.limits->lower /= form.units()->length;
    joint.limits->upper /= form.units()->length;
  }
  void add_laws(const Joint& joint, int number, double value, JointLawList& out) const override {
    if (!joint.limits) return;
    out.limit(number, value - joint.limits->lower, joint.limits->restitution, 1);
    out.limit(number, joint.limits->upper - value, joint.limits->restitution, -1);
  }
};

}  // namespace

TETHER_EFFECT(joint_limits, JointLimitEffect)

}  // namespace tether::scene::effects

// Tether: the interface of one effect. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/plan.hpp>

#include "force.hpp"
#include "momenta.hpp"
#include "toml/form.hpp"

namespace tether::scene::mechanics {

/// A line of the plan; `Effect` is the effect itself here.
using PlannedEffect = scene::Effect;

/// Laws along the coordinates of joints. `sign`: -1 where the law sees the coordinate backwards.
struct JointLawList {
  contact::JointLaws& laws;
  double time;                          ///< s
  std::function<void(double sign)> on;  ///< puts the law added last on the bodies of the joint
  /// The squares of the turn of a ball with tables since t = 0 and of its speed, rad^2, rad^2/s^2.
  double turn_squared = 0, spin_squared = 0;

  void limit(int joint, double gap, double restitution, double sign) {
    laws.add_limit(joint, gap, restitution);
    on(sign);
  }
  void bounded(int joint, double rate, double bound) {
    laws.add_bounded(joint, rate, bound);
    on(1);
  }
  void sprung(int joint, double stretch, double stiffness, double damping, double rate,
              double bound) {
    laws.add_sprung(joint, stretch, stiffness, damping, rate, bound);
    on(1);
  }
};

/// "1 joint", "2 joints", "2 bodies".
template <class Integer>
std::string counted(Integer count, std::string_view one) {
  const bool ends_in_y = one.back() == 'y' && count != 1;
  return fmt::format("{} {}{}", count, one.substr(0, one.size() - (ends_in_y ? 1 : 0)),
                     ends_in_y    ? "ies"
                     : count == 1 ? ""
                                  : "s");
}
/// A line of the plan where there are some: "title: 2 joints" and `more`.
template <class Integer>
void add_count(std::vector<PlannedEffect>& lines, const char* title, Integer count,
               std::string_view one, std::string_view more = "") {
  if (count > 0) lines.push_back({title, counted(count, one).append(more)});
}

/// From the centre of a moving body to a point, m.
inline void take_arm(const Scene& scene, int body, const Vector3d& point, Largest& length) {
  if (scene.moves(body)) length.take((point - scene.bodies[at(body)].position).norm());
}

/// A column of the table of a run. The forces are empty unless the output of the scene has them.
struct Column {
  std::string name;
  std::function<double(const Diagnostics&, const Forces&)> value;
};

/// Three columns, `name` with x, y, z in the place of "*".
template <class Vector>
void add_columns_of(const std::string& name, const Vector& vector, std::vector<Column>& columns) {
  const std::size_t star = name.find('*');
  for (int k = 0; k < 3; ++k)
    columns.push_back({std::string(name).replace(star, 1, 1, "xyz"[k]),
                       [vector, k](const Diagnostics&, const Forces& f) { return vector(f)[k]; }});
}

/// Gravity, contact, springs, ...: an effect answers here for its fields in scene files, its words
/// in the plan, its units, the momenta that it leaves alone, and its forces. What it does not
/// answer, it has none of. A scene may lack the effect in each of these calls.
class Effect {
 public:
  virtual ~Effect() = default;

  /// Its own tables of the file, and its fields in tables that it shares with others. Where they
  /// are read every key is asked for, and what is wrong leaves a default.
  virtual void fields(const files::Form& /*root*/, Scene&) const {}
  virtual void scene_fields(const files::Form&, Scene&) const {}
  virtual void body_fields(const files::Form&, Body&) const {}
  /// `angle`: the joint turns; else it slides. Of the joints that the effect acts on: those with a
  /// free coordinate, those whose turns are free, or all.
  virtual void joint_fields(const files::Form&, bool /*angle*/, Joint&) const {}
  enum class ActsOn { coordinates, turns, all_joints };
  virtual ActsOn acts_on() const { return ActsOn::coordinates; }
  virtual void pair_fields(const files::Form&, Pair&) const {}
  virtual void cable_fields(const files::Form&, Cable&) const {}
  /// Checks across the fields of a scene.
  virtual void check(const Scene&, files::Report&) const {}
  virtual void check_body(const Body&, files::Report&) const {}

  /// Adds a line where the scene names the effect.
  virtual void plan(const Scene&, EngineKind, std::vector<PlannedEffect>&) const {}
  /// Adds its columns to the table of a run.
  virtual void add_columns(const Scene&, std::vector<Column>&) const {}

  /// A law along a free coordinate of a joint, which is now at `value`: JointLaws of the contact
  /// library, each with its sign: the coordinate grows by +1.
  virtual void add_laws(const Joint&, int /*joint*/, double /*value*/, JointLawList&) const {}
  /// Whether the scene names a law of joints that the smooth engine does not have.
  virtual bool has_joint_laws(const Scene&) const { return false; }

  /// Lengths (m) and rates (1/s) of the scene; `length` and `mass`: its size.
  virtual void take_lengths(const Scene&, Largest&) const {}
  virtual void take_rates(const Scene&, double /*length*/, double /*mass*/, Largest&) const {}

  /// Adds the times at which its forces have kinks or jump, s.
  virtual void add_kinks(const Scene&, std::vector<double>& /*times*/) const {}
  virtual void limit_momenta(Momenta&) const {}
  /// Whether it gives or takes energy that no potential counts.
  virtual bool does_work(const Scene&) const { return false; }
  /// Null where the scene does not name it. `bodies`: at t = 0.
  virtual std::unique_ptr<Force> make_force(const Scene&, const Bodies& /*bodies*/) const {
    return nullptr;
  }
  /// Its part in the contact library's step.
  virtual void configure(const Scene&, contact::SteppingOptions&) const {}
  virtual void configure_pair(const Pair&, contact::Meeting&) const {}
};

}  // namespace tether::scene::mechanics

namespace tether::scene::effects {

using namespace mechanics;
using namespace files;
using mechanics::Effect;
using Lines = std::vector<PlannedEffect>;

/// Defines <name>_effect(), which the list of effects asks for.
#define TETHER_EFFECT(name, Kind) \
  const Effect& name##_effect() { \
    static const Kind effect;     \
    return effect;                \
  }

}  // namespace tether::scene::effects

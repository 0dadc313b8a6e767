// Tether: what moves a scene. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <tether/export.hpp>
#include <tether/scene/scene.hpp>
#include <utility>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::scene {

/// A contact at Engine::time(), world axes; indices as Scene::bodies.
struct ContactState {
  int first = -1, second = -1;  ///< bodies
  /// Place, m; unit, from `second` to `first`.
  Eigen::Vector3d point = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d impulse = Eigen::Vector3d::Zero();  ///< of the last step on `first`, N s
  double gap = 0;                                     ///< m; < 0: penetration
  Eigen::Vector3d force = Eigen::Vector3d::Zero();    ///< on `first`, N; see Forces
  /// Velocity of `first` against `second` at the point, without its normal part, m/s.
  Eigen::Vector3d slip = Eigen::Vector3d::Zero();
  /// Moment of rolling and torsional friction on `first`, in addition to that of the force, N m.
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
};

/// Force and moment of a joint on its first body (on the second the opposite), world axes.
struct JointForce {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();   ///< N
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();  ///< about the joint's point `at`, N m
  /// The part along the joint's own coordinate, positive where it increases it. Hinge, the moment
  /// about the axis, N m; slider, the force along the axis, N; distance, the force that pushes the
  /// points apart, N. Hinges and sliders have it by motions, motors, limits and friction.
  double drive = 0;
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< the point, m
};

/// Force of a spring and its damper.
struct SpringForce {
  double tension = 0;  ///< at its first end; > 0: pulls its ends together, N
  Eigen::Vector3d at = Eigen::Vector3d::Zero(), at_second = Eigen::Vector3d::Zero();  ///< ends, m
  double tension_second = 0;  ///< at its second end, another one where a cable rubs at a ring, N
};

/// Forces at Engine::time(). In stepping they are means over the last step, or over its last
/// sub-step if it had several: impulses over its length, those of impacts included. They are zero
/// before the first step.
struct Forces {
  std::vector<JointForce> joints;    ///< as Scene::joints
  std::vector<SpringForce> springs;  ///< as Scene::springs
  /// Sums over the contacts of each body, as Scene::bodies: N, N m about its centre of mass.
  std::vector<Eigen::Vector3d> contact, contact_moment;
};

/// A change of one contact at an instant of the event engine, or of a joint in any engine. An
/// instant may have several.
struct ContactEvent {
  /// The change.
  enum class Kind : std::uint8_t {
    impact,     ///< a gap closes with speed
    touch,      ///< a gap closes without
    lift,       ///< a normal force vanishes
    slip,       ///< a stuck contact begins to slide
    stop,       ///< a slip vanishes
    rest,       ///< impacts accumulate: `time` is when the last one is over
    jam,        ///< sliding has no forces any more: an impact without collision
    border,     ///< a contact leaves its face
    hand_over,  ///< steps take over from here on; of no contact
    resume,     ///< events go on; `lost` is what the steps took. Of no contact
    roll,       ///< a contact begins to roll or spin against its moment of friction
    roll_stop,  ///< it rolls or spins no longer
    attach,     ///< a joint closes; `lost` is what its impulse takes
    detach,     ///< a joint opens
    snap        ///< a joint breaks
  };
  double time = 0;               ///< s
  Kind kind = Kind::impact;      ///< of the change
  int first = -1, second = -1;   ///< bodies; -1: none
  double before = 0, after = 0;  ///< normal velocities of an impact, m/s
  double lost = 0;               ///< energy of all contacts of the instant, in its first event, J
  Eigen::Vector3d impulse = Eigen::Vector3d::Zero();  ///< on `first`, world axes, N s
  int joint = -1;  ///< that changes, or whose limit, motor or friction it is; -1: none
};
/// The enumerator as text.
const char* name(ContactEvent::Kind kind);
/// Whether a joint attaches, detaches or breaks.
constexpr bool is_of_joint(ContactEvent::Kind kind) { return kind >= ContactEvent::Kind::attach; }

/// Conserved quantities and errors at Engine::time(), SI.
struct Diagnostics {
  double kinetic_energy = 0, potential_energy = 0;  ///< J; potential: gravity and springs
  /// Sums over all bodies, kg m/s; about the origin, kg m^2/s.
  Eigen::Vector3d momentum = Eigen::Vector3d::Zero(), angular_momentum = Eigen::Vector3d::Zero();
  double drift = 0;        ///< largest violation of a joint or an invariant that is kept (SI)
  int contacts = 0;        ///< closed ones; stepping: all points of the last step
  double penetration = 0;  ///< m, deepest
  double residual = 0;     ///< of the last contact problem
  /// Stepping: what steps in which nothing strikes or slips have changed of the energy, where only
  /// weight and joints without laws act, J.
  double energy_error = 0;
};

/// Work of an engine since the start.
struct Counts {
  long steps = 0;  ///< of IDA; stepping: of fixed length
  /// Work of IDA and its projection; 0 in stepping.
  long residual_evaluations = 0, jacobian_evaluations = 0, projections = 0;
  long contact_problems = 0, sweeps = 0;  ///< solved, and sweeps over their contacts
  long unsolved = 0;                      ///< contact problems above what is accepted
  long error_test_failures = 0;           ///< of IDA; stepping with an accuracy: rejected sub-steps
  long accepted = 0;  ///< contact problems above the tolerance, within what is accepted
  long halved = 0;    ///< steps, or sub-steps, taken in two halves
  /// Event engine: times at which something happens, a start with impacts included; contacts that
  /// hit.
  long events = 0, impacts = 0;

  /// Calls f with each number, by reference.
  template <class F>
  void each(const F& f) {
    for (long* n :
         {&steps, &residual_evaluations, &jacobian_evaluations, &projections, &contact_problems,
          &sweeps, &unsolved, &error_test_failures, &accepted, &halved, &events, &impacts})
      f(*n);
  }
  /// Adds each number.
  Counts& operator+=(Counts more);
};

/// A change of a run from events to steps.
struct HandOver {
  double time = 0;             ///< s
  std::string why;             ///< a sentence
  Counts before;               ///< of the event engine, since the start
  std::optional<double> back;  ///< when events went on, s; nothing: steps have it
  double lost = 0;             ///< energy that the steps took, friction's work with it, J
};

/// Wall time spent on one effect since the start, s.
struct EffectCost {
  std::string effect;  ///< "gravity", "contact", ...
  double seconds = 0;  ///< wall time
};

/// A run that cannot go on; what() says what happened, when, and what to try.
class SimulationError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// One run of one scene. Not copied; a state can be saved and restored.
class Engine {
 public:
  virtual ~Engine() = default;
  virtual const char* name() const = 0;  ///< "smooth", "stepping" or "event"
  virtual double time() const = 0;       ///< s
  /// Moves to time t >= time(); stepping ends at the first step boundary not before t (to
  /// round-off). Throws SimulationError.
  virtual void advance(double t) = 0;
  virtual const std::vector<BodyState>& bodies() const = 0;  ///< as Scene::bodies
  virtual Diagnostics diagnostics() const = 0;               ///< at time()
  /// At time(); none in a scene without shapes.
  virtual const std::vector<ContactState>& contacts() const = 0;
  /// Forces::joints and Forces::springs; see total_forces(). Throws SimulationError in an engine
  /// that does not know them.
  virtual Forces forces() const;
  /// Since the start, or the state that was restored.
  virtual const std::vector<ContactEvent>& events() const;
  virtual Counts counts() const = 0;  ///< since the start
  /// Changes to steps (EventOptions::otherwise) and back. If there are any, counts() has the work
  /// of steps and the number of events.
  virtual const std::vector<HandOver>& hand_overs() const;
  /// Work of the event engine, also of one that steps stand in for.
  virtual Counts counts_of_events() const { return counts(); }
  /// Whether steps stand in for events now.
  bool in_steps() const { return !hand_overs().empty() && !hand_overs().back().back; }
  virtual std::vector<EffectCost> costs() const = 0;  ///< of each effect; the event engine has none
  /// Writes the state without changing it. An engine of the same scene that restores it continues
  /// bit by bit.
  virtual void save(std::ostream& out) const = 0;
  /// Whether a state is continued bit by bit, or from its positions and velocities where this build
  /// cannot do so.
  enum class Restore : std::uint8_t { exact, near };
  /// Goes on from a state that save() wrote. Throws std::runtime_error on a state of other bodies
  /// and, with `exact`, on one that this build cannot continue bit by bit.
  virtual void restore(std::istream& in, Restore how = Restore::exact) = 0;

  /// Called after every step; if it returns true, advance() returns at the end of that step.
  void stop_when(std::function<bool()> interrupted) { interrupted_ = std::move(interrupted); }
  /// advance() returns where a function of forces() is above 0: smooth and events at the first such
  /// time to their tolerance, stepping at the end of the step.
  void stop_above(std::function<double(const Forces&)> excess) { excess_ = std::move(excess); }

 protected:
  /// Asks the function of stop_when().
  bool interrupted() const { return interrupted_ && interrupted_(); }
  /// The function of stop_above(); empty: none.
  const std::function<double(const Forces&)>& excess() const { return excess_; }

 private:
  std::function<bool()> interrupted_;
  std::function<double(const Forces&)> excess_;
};

/// All of Forces.
Forces total_forces(const Engine& engine);

// Each throws std::invalid_argument, naming what the scene asks for and the engine does not have.

/// Scenes without contact, by IDA with projection.
std::unique_ptr<Engine> make_smooth_engine(const Scene& scene);
/// Scenes with contact, by steps of impulses.
std::unique_ptr<Engine> make_stepping_engine(const Scene& scene);
/// Scenes with contact whose events are located, by IDA with projection between them.
std::unique_ptr<Engine> make_event_engine(const Scene& scene);
/// Events, and steps where these cannot go on, until what they could not decide is over. In steps
/// its time is that of a boundary of them.
std::unique_ptr<Engine> make_event_engine_with_steps(const Scene& scene);
/// Why the event engine cannot move the scene; empty: it can.
std::string event_engine_refusal(const Scene& scene);

}  // namespace tether::scene
TETHER_EXPORT_END

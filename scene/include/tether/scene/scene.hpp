// Tether: a scene as a value. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <tether/contact/shapes.hpp>
#include <tether/contact/stepping.hpp>
#include <tether/export.hpp>
#include <tether/linalg/eigen.hpp>
#include <tether/linalg/index.hpp>
#include <tether/scene/joint.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::scene {

/// Shapes, friction laws, restitution and steps are those of the contact library.
using contact::Gyroscopic;
using contact::RestitutionLaw;
using contact::Shape;
using contact::ShapeKind;

/// Resistance of a medium at rest.
struct Drag {
  /// Force -(linear + quadratic |v|) v, v against the wind: N s/m, N s^2/m^2.
  double linear = 0, quadratic = 0;
  double rotational = 0;  ///< torque -rotational w: N m s
};

/// How the surface of a body moves against it: m/s, rad/s about the centre of mass, body axes.
struct SurfaceSpeed {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();          ///< m/s
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();  ///< rad/s
};

/// The motion of a body at an instant, world axes.
struct BodyState {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();               ///< of the centre of mass, m
  linalg::Quaternion orientation = linalg::Quaternion::Identity();  ///< unit; body to world
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();               ///< of the centre of mass, m/s
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();       ///< rad/s
  /// Neither NaN nor infinity.
  bool is_finite() const {
    return position.allFinite() && orientation.coeffs().allFinite() && velocity.allFinite() &&
           angular_velocity.allFinite();
  }
};

/// A state that a run begins with.
struct SceneStart {
  double time = 0;                ///< s
  std::vector<BodyState> bodies;  ///< as Scene::bodies
};

/// A rigid body at t = 0.
struct Body {
  std::string name;                                    ///< unique
  std::vector<Shape> shapes;                           ///< in body axes; none: touches nothing
  bool fixed = false;                                  ///< has no mass and does not move
  double mass = 0;                                     ///< kg
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();   ///< about the centre, body axes, kg m^2
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< of the centre of mass, m
  linalg::Quaternion orientation = linalg::Quaternion::Identity();  ///< unit; body to world
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();               ///< m/s, world axes
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();       ///< rad/s, world axes
  std::string material;                                             ///< that Pair refers to
  std::optional<Drag> drag;                                         ///< none: no resistance
  std::optional<SurfaceSpeed> surface;                              ///< none: moves with the body
  std::optional<Eigen::Vector3d> friction_axis;  ///< unit, body axes; see Pair::friction_across
  Place place;                                   ///< in the file
};

/// How two materials meet. A pair that no table names is an error when bodies of it can touch.
/// A zero names no friction, no restitution.
struct Pair {
  std::string first, second;          ///< materials
  double friction = 0;                ///< coefficient, >= 0
  double restitution = 0;             ///< 0 .. 1
  Place place;                        ///< in the file
  bool touch = true;                  ///< false: they pass through each other
  double rolling = 0, torsional = 0;  ///< m: moments over the normal force
  /// Coefficient across the friction_axis of the body of material `first`, along which `friction`
  /// holds; absent: `friction` in all directions.
  std::optional<double> friction_across = {};
  /// Coefficient of contacts that hold, at least `friction`, which is that of those that slip and
  /// of impacts then; absent: `friction`.
  std::optional<double> static_friction = {};

  /// Whether the coefficients differ.
  bool is_elliptic() const { return friction_across && *friction_across != friction; }
};

/// A ring or small pulley on a cable, without friction unless a Capstan names it.
struct Ring {
  int body = -1;                                 ///< index, -1 the world
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< world coordinates at t = 0, m
};

/// Friction of a cable at a ring of its: the tensions before and behind it differ by a factor of at
/// most e^(friction wrap).
struct Capstan {
  int ring = 1;                ///< which of Cable::rings, from 1 on
  double friction = 0;         ///< coefficient
  std::optional<double> wrap;  ///< rad; absent: the angle between the pieces at the ring
  /// For a pulley that turns with the body of the ring, m: the slip is against its rim. 0: a ring.
  double radius = 0;
  /// Unit, world axes at t = 0: turns about it carry the cable towards its second end.
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
};

/// A spring that does not push, through rings.
struct Cable {
  std::vector<Ring> rings;  ///< from the first end to the second
  double winch = 0;         ///< the rest grows by it, m/s; where it rubs, before the first ring
  std::vector<Capstan> capstans = {};  ///< ring by ring; empty: it rubs nowhere
};

/// Force stiffness (|d| - rest) + damping d|d|/dt along d between two points. A cable has the sum
/// of the distances along its rings as |d|, and neither pushes nor damps while it is slack.
struct Spring {
  std::string name;             ///< for messages and expectations
  int first = -1, second = -1;  ///< indices of bodies, -1 the world
  /// Its ends, world coordinates at t = 0, m.
  Eigen::Vector3d at = Eigen::Vector3d::Zero(), at_second = Eigen::Vector3d::Zero();
  double stiffness = 0, damping = 0;  ///< N/m, N s/m
  std::optional<double> rest;         ///< m; default the distance at t = 0
  std::optional<Cable> cable = {};    ///< absent: a spring between its ends
  Place place;                        ///< in the file
};

/// The factor of a load: mean + sin(2 pi frequency t + phase), or of a table.
struct LoadHistory {
  double mean = 0, frequency = 0, phase = 0;  ///< factor, Hz, rad
  /// A point of the table.
  struct Knot {
    double time = 0, factor = 0;  ///< s, and the factor then
  };
  /// Straight lines between them, two of one time are a jump; constant before and behind. Empty:
  /// the sine.
  std::vector<Knot> table;
};

/// A force at the centre and torque on one body; constant without a history.
struct Load {
  int body = 0;                                                                       ///< index
  Eigen::Vector3d force = Eigen::Vector3d::Zero(), torque = Eigen::Vector3d::Zero();  ///< N, N m
  Place place;                              ///< in the file
  std::optional<LoadHistory> history = {};  ///< a factor in time
  bool in_body = false;                     ///< the axes are those of the body, else the world's
};

/// A point at rest that attracts every body: force -GM m r / |r|^3 at the centre of mass, r from
/// the point.
struct CentralGravity {
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< m
  double gravitational_parameter = 0;            ///< GM, m^3/s^2
  Place place;                                   ///< in the file
  bool gradient = false;  ///< with the torque and force of second order in (size / |r|)
};

/// Quantities that a smooth scene may keep, of all bodies together.
enum class InvariantKind : std::uint8_t { energy, momentum, angular_momentum };

/// A quantity that a smooth scene keeps.
struct Invariant {
  InvariantKind kind = InvariantKind::energy;  ///< which one
  bool project = true;                         ///< false: only recorded
  Place place;                                 ///< in the file
};

/// Form of the equations of motion with joints: with their multipliers, or without.
enum class Formulation : std::uint8_t { index1, index0 };
/// Consequence of a contact problem that is neither solved nor accepted: the run ends, or goes on
/// with a warning.
enum class OnFailure : std::uint8_t { stop, warn };

/// Scenes without contact: IDA with projection.
struct SmoothOptions {
  double tolerance = 1e-6;  ///< of the motion (SI); IDA's own are at most a tenth of it
  Formulation formulation = Formulation::index1;  ///< of the equations of motion
  bool projection = true;                         ///< false: plain IDA
  double max_step = 0;                            ///< s; 0: free
  int max_steps = 1000000;  ///< between two stops (records, expectations); then the run is given up
};

/// Scenes with contact: impulse-velocity steps. Gravity is that of the scene.
struct SteppingOptions : contact::SteppingOptions {
  OnFailure on_failure = OnFailure::stop;  ///< where a contact problem stays unsolved

  /// Defaults of scenes, which are more lenient than those of contact::Stepper.
  SteppingOptions() {
    acceptance = 1e5;
    max_halvings = 2;
  }
};

/// Choice for a scene that the event engine cannot move, or cannot move on.
enum class Otherwise : std::uint8_t {
  stop,     ///< the run ends, or is refused
  stepping  ///< the stepping engine takes over there, and says so
};

/// Scenes with contact whose impacts, slips and stops are found to a tolerance: IDA with projection
/// between them.
struct EventOptions {
  double tolerance = 1e-6;                ///< of the motion and of event times (SI)
  double max_step = 0;                    ///< s; 0: free
  int max_events = 1000000;               ///< then the run is given up
  int max_steps = 100000000;              ///< of IDA
  Otherwise otherwise = Otherwise::stop;  ///< where events cannot go on
};

/// The engine that a scene asks for; `automatic` leaves it to the plan.
enum class EngineKind : std::uint8_t { automatic, smooth, stepping, event };

/// Files that a run writes.
struct Output {
  /// Names of files by their formats: csv, vtk, svg, html, certificate, state;
  /// empty: not written.
  std::map<std::string, std::string, std::less<>> files;
  /// Name of the file of a format, which is added where there is none.
  std::string& operator[](std::string_view format) { return files[std::string(format)]; }
  /// The same; empty where there is none.
  const std::string& operator[](std::string_view format) const {
    static const std::string none;
    const auto found = files.find(format);
    return found != files.end() ? found->second : none;
  }
  double every = 0;       ///< s between records; 0: end / 1000
  double checkpoint = 0;  ///< s between saved states; 0: only at the end
  bool forces = false;    ///< in the table, in one of contacts beside it, and in the film
};

/// Subjects of an Expect; see there and docs/scene_fields.md.
enum class Quantity : std::uint8_t {
  position,
  velocity,
  orientation,
  angular_velocity,
  distance_moved,  // of a body
  speed,
  contact_force,
  contact_slip,
  kinetic_energy,
  potential_energy,
  energy,
  energy_change,
  momentum,
  angular_momentum,
  drift,
  contacts,
  penetration,
  residual,
  joint_force,
  joint_moment,
  joint_drive,
  spring_force
};

/// Numbers that a quantity has.
constexpr int components(Quantity q) {
  switch (q) {
    case Quantity::position:
    case Quantity::velocity:
    case Quantity::angular_velocity:
    case Quantity::momentum:
    case Quantity::angular_momentum:
    case Quantity::contact_force:
    case Quantity::joint_force:
    case Quantity::joint_moment:
      return 3;
    case Quantity::orientation:
      return 4;
    default:
      return 1;
  }
}

// Quantities that are of none of these belong to the scene.

/// A quantity of one body.
constexpr bool is_of_body(Quantity q) { return q <= Quantity::contact_slip; }
/// A quantity of one joint.
constexpr bool is_of_joint(Quantity q) {
  return q >= Quantity::joint_force && q <= Quantity::joint_drive;
}
/// A quantity of one spring.
constexpr bool is_of_spring(Quantity q) { return q == Quantity::spring_force; }
/// A quantity of Forces, or of the forces and slips of contacts.
constexpr bool is_force(Quantity q) {
  return is_of_joint(q) || is_of_spring(q) || q == Quantity::contact_force ||
         q == Quantity::contact_slip;
}

/// The scene as its own test: |quantity(time) - value| <= within in every component (orientation:
/// wxyz, of either sign). `at_most` and `at_least` bound the number itself or the norm of a vector.
/// Here distance_moved is |x(time) - x(0)| and energy_change E(time) - E(0). A contact_force is the
/// sum over the contacts of the body, contact_slip the largest |slip| of those with a force. Both
/// are of contacts with the body `against` where one is named. For joint_... and spring_force see
/// Forces.
struct Expect {
  double time = 0;                          ///< s; stepping: the first step boundary not before it
  bool throughout = false;                  ///< holds at every record up to `time`, too
  Quantity quantity = Quantity::position;   ///< what is judged
  int body = -1, against = -1;              ///< of quantities of a body; against -1: all
  std::vector<double> value;                ///< components(quantity) numbers, SI; or none
  double within = 0;                        ///< in the unit of value
  std::optional<double> at_most, at_least;  ///< bounds, in the unit of value
  Place place;                              ///< in the file
  int joint = -1, spring = -1;              ///< of quantities of a joint, of a spring
};

namespace certificate {
class Sheet;
}

/// All that a scene file says, in SI units; see docs/scene_fields.md.
struct Scene {
  std::string name, file;                  ///< title; the file it was read from
  double end = 1;                          ///< s
  std::optional<Eigen::Vector3d> gravity;  ///< m/s^2; absent: none
  std::optional<Eigen::Vector3d> wind;     ///< m/s: drag is that of the speed against it
  std::vector<Body> bodies;                ///< index i everywhere is body i
  std::vector<Pair> pairs;                 ///< none: bodies do not touch
  // Lists of what acts; empty: nothing of the kind.
  std::vector<Joint> joints;                    ///< index i everywhere is joint i
  std::vector<Coupling> couplings;              ///< between joints
  std::vector<Spring> springs;                  ///< index i everywhere is spring i
  std::vector<Load> loads;                      ///< on bodies
  std::vector<CentralGravity> central_gravity;  ///< on all bodies
  std::vector<Invariant> invariants;            ///< kept or recorded, in smooth scenes
  EngineKind engine = EngineKind::automatic;    ///< that the file asks for
  /// Holds for both engines with contacts.
  contact::SimultaneousImpacts simultaneous_impacts = contact::SimultaneousImpacts::together;
  // At most one of the three is given, but steps may be what events go on with
  // (EventOptions::otherwise). None: the plan chooses with defaults.
  std::optional<SmoothOptions> smooth;      ///< settings of the smooth engine
  std::optional<SteppingOptions> stepping;  ///< settings of the stepping engine
  std::optional<EventOptions> event;        ///< settings of the event engine
  Output output;                            ///< files that a run writes
  std::vector<Expect> expect;               ///< what a run must find
  std::vector<std::string> surface_files;   ///< that were read with it; no output replaces them
  /// In place of the bodies at t = 0, to which joints and springs refer all the same. Not of files.
  std::optional<SceneStart> start;
  /// Engines write to it what they do; null: nobody asks. Not of files.
  certificate::Sheet* certificate = nullptr;

  /// Whether a body can; -1, the world, cannot.
  bool moves(int body) const { return body >= 0 && !bodies[linalg::at(body)].fixed; }
  /// The bodies that can.
  std::vector<std::size_t> moving() const {
    std::vector<std::size_t> out;
    for (std::size_t b = 0; b < bodies.size(); ++b)
      if (!bodies[b].fixed) out.push_back(b);
    return out;
  }
};

/// Whether steps take over where events cannot go on.
bool goes_on_in_steps(const Scene& scene);

}  // namespace tether::scene
TETHER_EXPORT_END

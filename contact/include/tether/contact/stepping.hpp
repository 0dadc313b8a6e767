// Tether: rigid bodies in motion, by impulses and velocities. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <tether/contact/body_solver.hpp>
#include <tether/contact/joint_equations.hpp>
#include <tether/contact/shapes.hpp>
#include <tether/export.hpp>
#include <tether/linalg/eigen.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// How the angular velocity of a body without torque changes (method, eq. 29). Spheres skip it.
enum class Gyroscopic : std::uint8_t {
  none,           ///< not at all: keeps energy, never flips
  explicit_step,  ///< w += -dt I^-1 (w x I w)
  implicit_step,  ///< one Newton step of the implicit equation in body axes
  momentum        ///< keeps angular momentum and energy to round-off
};

/// All of them.
inline constexpr std::array<Gyroscopic, 4> kGyroscopics{
    Gyroscopic::none, Gyroscopic::explicit_step, Gyroscopic::implicit_step, Gyroscopic::momentum};

/// The enumerator as text.
const char* name(Gyroscopic gyroscopic);

/// Law of restitution at impacts (method, section 7.2).
enum class RestitutionLaw : std::uint8_t {
  /// Normal velocities: w_n+ + e w_n- >= 0 complementary to x_n, together with friction in one
  /// solve.
  newton,
  /// Impulses: (1 + e) times those without restitution; restores part of the slip, too.
  poisson
};

/// Both.
inline constexpr std::array<RestitutionLaw, 2> kRestitutionLaws{RestitutionLaw::newton,
                                                                RestitutionLaw::poisson};

/// The enumerator as text.
const char* name(RestitutionLaw law);

/// Says what contacts that touch do in an impact of others of their island.
enum class SimultaneousImpacts : std::uint8_t {
  together,  ///< all of them take part: Newton's law for all in one problem
  in_turn    ///< those that approach strike alone, then those that this makes approach, and so on
};

/// Both.
inline constexpr std::array<SimultaneousImpacts, 2> kSimultaneousImpacts{
    SimultaneousImpacts::together, SimultaneousImpacts::in_turn};

/// The enumerator as text.
const char* name(SimultaneousImpacts impacts);

/// Bodies as contiguous data; index i everywhere is body i. World axes but for `inertia`.
struct BodySet {
  std::vector<Eigen::Vector3d> position;        ///< of the centre of mass, m
  std::vector<linalg::Quaternion> orientation;  ///< unit; body to world
  std::vector<RigidBody> motion;  ///< velocities, inverse mass, inverse inertia in world axes
  std::vector<double> mass;       ///< kg; 0: fixed
  std::vector<Eigen::Matrix3d> inertia;          ///< about the centre, body axes, kg m^2
  std::vector<Eigen::Matrix3d> inverse_inertia;  ///< body axes

  /// Number of bodies.
  int size() const { return static_cast<int>(position.size()); }
  /// Adds a body: kg, kg m^2, m, m/s, rad/s, as in the arrays above. Returns its index. Throws
  /// std::invalid_argument unless mass and inertia are positive (definite) and all values finite.
  int add(double body_mass, const Eigen::Matrix3d& body_inertia, const Eigen::Vector3d& at,
          const linalg::Quaternion& turned = linalg::Quaternion::Identity(),
          const Eigen::Vector3d& velocity = Eigen::Vector3d::Zero(),
          const Eigen::Vector3d& angular_velocity = Eigen::Vector3d::Zero());
  /// A body that does not move; returns its index.
  int add_fixed(const Eigen::Vector3d& at,
                const linalg::Quaternion& turned = linalg::Quaternion::Identity());
};

/// A shape on a body, of a material.
struct Surface {
  int body = 0;      ///< index in the BodySet
  Shape shape;       ///< placed on the body
  int material = 0;  ///< number that Meeting refers to
  /// The velocity of the surface against its body, m/s and rad/s about the centre of mass, in body
  /// axes: of a belt, a turntable. Friction acts against it.
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();  ///< see velocity
  /// Unit, body axes: the direction of Meeting::friction where that is elliptic; zero: none.
  Eigen::Vector3d friction_axis = Eigen::Vector3d::Zero();
  /// Whether it moves against its body.
  bool moves_on_body() const { return !velocity.isZero(0) || !angular_velocity.isZero(0); }
};

/// How two materials meet. Materials that no Meeting names pass through each other.
struct Meeting {
  int first = 0, second = 0;  ///< materials, in any order
  double friction = 0;        ///< coefficient, >= 0
  double restitution = 0;     ///< 0 .. 1
  /// Moments that a contact holds, over its normal force: about axes in the surface and about the
  /// normal, m (method, section 8). Only with law = coulomb and restitution_law = newton.
  double rolling = 0, torsional = 0;
  /// Whether contacts of these materials hold moments.
  bool rolls() const { return rolling > 0 || torsional > 0; }
  /// Coefficient across the friction_axis of the surface of material `first`, along which
  /// `friction` holds (method, section 8). Absent: `friction` in all directions.
  std::optional<double> friction_across = {};
  /// Coefficient of contacts that hold, at least `friction`, which is then that of those that slip
  /// and of impacts. A contact holds at the end of a step if this coefficient can hold it there.
  /// With friction_across it is along the axis, and both grow by the same factor. Absent:
  /// `friction`.
  std::optional<double> static_friction = {};
  /// Whether the coefficients differ.
  bool is_elliptic() const { return friction_across && *friction_across != friction; }
  /// The larger coefficient.
  double largest_friction() const { return std::max(friction, friction_across.value_or(0)); }
  /// The larger coefficient of contacts that hold.
  double largest_holding() const {
    if (!static_friction) return largest_friction();
    return is_elliptic() ? *static_friction / friction * largest_friction() : *static_friction;
  }
};

/// Velocities changed by forces during a step of length dt that starts at `time`.
using Force = std::function<void(BodySet& bodies, double time, double dt)>;

/// Settings of Stepper; illegal values throw where it is made.
struct SteppingOptions {
  double step = 1e-3;  ///< dt, s
  /// > 0: each step is taken in sub-steps whose error is at most this; at most 0.1. Positions count
  /// relative to the size of each body (reach of its surfaces, or radius of gyration), rotations in
  /// rad, and smooth velocities by what they move a body in the sub-step. See method, section 7. 0:
  /// in one.
  double accuracy = 0;
  std::optional<Eigen::Vector3d> gravity;  ///< m/s^2; absent: not evaluated
  Law law = Law::coulomb;                  ///< of every contact
  /// BodyOptions::tolerance of the contact problems.
  double tolerance = 1e-9;
  /// A contact problem that ends above the tolerance is used, and counted as `accepted`, if its
  /// residual is at most min(acceptance * tolerance, 1e-2). With an acceptance above 1 a solve ends
  /// at a residual below 1e-6 once 3/4 of max_work are spent. 1: nothing above the tolerance is
  /// accepted.
  double acceptance = 1;
  /// A step whose problem is not accepted is repeated as two halves, each of these as two quarters,
  /// and so on, at most this many times. The shortest sub-steps, and those with an impact (which a
  /// shorter step does not make easier), accept residuals up to 1e-4 at least. They do so after
  /// five times max_work where needed, and if acceptance > 1 up to 1e-3 then. A shortest one above
  /// that is used all the same and counted as `unsolved`. 0: no halving.
  int max_halvings = 0;
  Gyroscopic gyroscopic = Gyroscopic::momentum;  ///< of bodies that are no spheres
  /// A penetration of depth d is reduced at the speed min(error_reduction d / dt,
  /// max_depenetration_speed). This speed changes positions only: it is not part of the bodies'
  /// velocities and adds no energy. 0: penetrations stay.
  double error_reduction = 0.2;
  double max_depenetration_speed = 1;                       ///< m/s
  RestitutionLaw restitution_law = RestitutionLaw::newton;  ///< laws of joints need `newton`
  /// Approaches slower than this times sqrt(g s) do not bounce: g is gravity (none: all bounce), s
  /// the largest distance of a point of the smaller shape from its origin. A drop from height h
  /// bounces if h > threshold^2 s / 2.
  double restitution_threshold = 0.01;
  /// Approaches faster than this times sqrt(g s) that would close within the step get their whole
  /// impulse at the present gap; slower ones close the gap first (bias gap / dt).
  double impact_threshold = 0.01;
  /// Steps are taken up to where a gap closes, the impact, and the rest. Bodies that nothing but
  /// their weight acts upon fall along their parabola. The position error is O(dt); without this it
  /// also depends on where in the step the impact falls (method, section 7). With more than 16
  /// contacts, up to 512, only at impacts in islands of at most 16, for a tenth more problems at
  /// most. Islands in which joints have laws or pairs rolling friction are not cut; an accuracy has
  /// this of its own.
  bool cut_at_impacts = true;
  /// in_turn: only with cut_at_impacts, without an accuracy, and in islands that are cut.
  SimultaneousImpacts simultaneous_impacts = SimultaneousImpacts::together;
  /// > 0: islands of bodies that have been slower than this times sqrt(g s) for 5 sqrt(s / g) fall
  /// asleep. They take part in no problem until something touches them, the forces on them change
  /// or what they lie on moves (method, section 7). Needs gravity; not with an accuracy or rolling
  /// friction. 0: none does.
  double sleep = 0;
  /// Points are contacts if their gap is below this part of the size of the smaller shape plus the
  /// distance that the velocities cover within the step.
  double near_part = 1e-3;
  int min_sweeps = 8;        ///< see BodyOptions; remove slow creep of bodies at rest
  int max_sweeps = 1000;     ///< see BodyOptions
  int max_assembled = 1000;  ///< see BodyOptions
  /// See BodyOptions: bounds the time of a step.
  double max_work = 2e8;
  int threads = 1;  ///< results have the same bits for every number of threads
  /// Processes that take the same steps and share the work of their contact problems; see
  /// BodyOptions. Bits are those of one process.
  SolverTeam* team = nullptr;
};

/// Largest residual of a contact problem that is used: see SteppingOptions::acceptance.
double accepted_residual(const SteppingOptions& options);

/// Contacts of the last step (of its last sub-step, if it had several), side by side.
struct StepContacts {
  std::vector<PointContact> points;       ///< id: see contact_id
  std::vector<double> gaps;               ///< m, at the start of the step
  std::vector<Eigen::Vector3d> impulses;  ///< on `first`, world axes, N s
  /// Moments of impulse on `first` by rolling and torsional friction, world axes, N m s; empty
  /// unless a meeting names either.
  std::vector<Eigen::Vector3d> moments;
};

/// Identity of a contact: its surfaces, of 24 bits each and in one order for each pair, and the
/// feature, of 16 bits.
constexpr std::uint64_t contact_id(int first_surface, int second_surface, int feature) {
  return (static_cast<std::uint64_t>(first_surface) << 40) |
         (static_cast<std::uint64_t>(second_surface) << 16) | static_cast<std::uint64_t>(feature);
}

/// Work since the start.
struct StepCounts {
  /// Sub-steps that were repeated count each time in contact_problems, sweeps and
  /// assembled_islands.
  long steps = 0, contact_problems = 0, sweeps = 0, assembled_islands = 0;
  long bounces = 0;    ///< contacts that got an impulse of restitution
  long accepted = 0;   ///< problems above the tolerance that were accepted
  long halved = 0;     ///< steps and sub-steps that were taken in two halves
  long sub_steps = 0;  ///< with an accuracy: sub-steps that steps were taken in
  long rejected = 0;   ///< and sub-steps that were not accurate enough, or had an impact on the way
  long unsolved = 0;   ///< problems that were used though above what is accepted
};

/// State of a Stepper beside positions and velocities: warm starts, kept momenta, and the contacts
/// of the last step. A Stepper of the same scene that is given the bodies and the memory of another
/// one continues its motion bit by bit.
struct StepperMemory {
  /// Angular momentum of a body without torque, about its centre (kg m^2/s, world axes). It is kept
  /// from step to step as long as the body has this angular velocity (rad/s) and orientation:
  /// rounding of computing it anew is biased and would add up.
  struct Spin {
    Eigen::Vector3d momentum = Eigen::Vector3d::Zero();               ///< kg m^2/s, world axes
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();       ///< rad/s, world axes
    linalg::Quaternion orientation = linalg::Quaternion::Identity();  ///< of the body's axes
  };
  long steps = 0;                            ///< taken since the start
  WarmStart contacts, corrections, bounces;  ///< of the contact problems of a step
  std::vector<Spin> spins;                   ///< of bodies whose angular momentum is kept
  StepContacts last;                         ///< contacts of the last step; then its outcome:
  double penetration = 0, residual = 0;      ///< Stepper::penetration(), residual()
  Status status = Status::solved;            ///< Stepper::status()
  /// State of the step-size controller, with an accuracy.
  struct Control {
    double next = 0;    ///< length of the next sub-step, s; 0: not chosen
    double last = 0;    ///< length of the last one, s
    double error = 0;   ///< its error; 1 is the accuracy
    double length = 0;  ///< s, that the stored impulses are of
  } control;            ///< all 0 without an accuracy
  double drift = 0;     ///< of the joints, m or rad
  /// Fastest vibration of bodies across the forces of their joints (method, section 7.1).
  struct Vibration {
    double frequency = 0;        ///< 1/s; it goes with the root of `acceleration`
    double acceleration = 0;     ///< by joints, in the norm of the kinetic energy, N^(1/2) m^(-1/2)
    std::vector<Vector6d> mode;  ///< velocities of all bodies in it; empty: of no step yet
  } vibration;                   ///< none without joints
  double cuts = 0;  ///< that may still be made where there are many contacts, in problems
  /// State of a body where any may sleep.
  struct Rest {
    double slow = 0;     ///< how long it has been slow, s
    int island = -1;     ///< -1: awake
    bool fresh = false;  ///< it fell asleep in this sub-step
    /// Accelerations by forces, now or when it fell asleep: m/s^2, rad/s^2, world axes.
    Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();
    Eigen::Vector3d angular_acceleration = Eigen::Vector3d::Zero();  ///< see acceleration
  };
  /// A body that a sleeping island lies on, as it was when the island fell asleep.
  struct Neighbour {
    int body = 0, island = 0;                    ///< its index, and the island on it
    Eigen::Vector3d position;                    ///< m
    linalg::Quaternion orientation;              ///< unit; body to world
    Eigen::Vector3d velocity, angular_velocity;  ///< m/s, rad/s, world axes
  };
  /// Who sleeps, and on what.
  struct Sleep {
    std::vector<Rest> bodies;           ///< empty: none may sleep
    StepContacts contacts;              ///< of those asleep, with forces in the place of impulses
    std::vector<Neighbour> neighbours;  ///< of all sleeping islands
  } sleep;                              ///< empty with SteppingOptions::sleep = 0
};

/// Time spent on one effect since the start, s.
struct StageCost {
  const char* effect;  ///< "gravity", "contact", ...
  double seconds;      ///< wall time
};

/// A sub-step as an observer sees it between two of its stages (Stepper::observe).
struct StepStage {
  /// Its place in the sub-step.
  enum class When : std::uint8_t {
    before_all,  ///< no stage has run
    between,     ///< some have
    after_all    ///< it is over
  };
  const char* effect;               ///< of the stage that has run, as StageCost
  When when;                        ///< after_all: bodies() are those of its end
  double start, length;             ///< s
  const std::vector<char>* active;  ///< bodies that take part; null: all
  /// Contacts as the problem had them: bias and slip hold in the middle of the sub-step.
  const std::vector<PointContact>& solved;
  /// The part of joint_impulses() along the rows at the end of the sub-step.
  const std::vector<double>& joint_impulses_at_end;
};
using StepObserver = std::function<void(const StepStage&)>;  ///< see Stepper::observe

/// Advances a set of bodies by steps of fixed length (method, section 7):
///
///     v* = v + dt M^-1 f,   v+ = v* + M^-1 J' x,   x+ = x + dt v+,   q+ = exp(dt w / 2) q
///
/// with impulses x of the contact problem w = J v+ + bias, bias_n = gap / dt for gaps >= 0, and
/// e w_n- (newton) or 0 for impacts.
/// A step runs through a list of stages that holds only the effects that are asked for: gravity,
/// forces, contact, friction, restitution, the gyroscopic term.
///
/// Allocates only while the storage grows and where an island has to be assembled
/// (BodyOptions::max_assembled). Not for use by two threads at once.
class Stepper {
 public:
  /// Throws std::invalid_argument on indices that do not exist, values outside their range, planes
  /// on bodies that move, and pairs of shapes that cannot touch.
  Stepper(BodySet bodies, std::vector<Surface> surfaces, std::vector<Meeting> meetings,
          const SteppingOptions& options);
  ~Stepper();
  Stepper(Stepper&&) noexcept;
  Stepper& operator=(Stepper&&) noexcept;

  /// Forces act in the order in which they were added, after gravity. `effect` must outlive this.
  void add_force(const char* effect, Force force);

  /// Bodies held by joints, before forces are added: once. Bodies that are off their joints, here
  /// or at the start of a step, are put back by the least move; where joints contradict each other,
  /// this and step() throw std::invalid_argument and name them. Bodies that a joint of three rows
  /// or more connects pass through each other.
  void add_joints(std::unique_ptr<JointEquations> joints);

  /// From here on `observer` is called before and after each stage of every sub-step, also of one
  /// that is taken back. It reads bodies(), contacts() and impulses. After forces and joints.
  void observe(StepObserver observer);

  /// One step of SteppingOptions::step; succeeded() then tells how it went. Throws
  /// std::invalid_argument where joints contradict each other.
  void step();

  double time() const;  ///< steps * dt; where a start was late, that until its step is taken
  const BodySet& bodies() const;         ///< at time()
  BodySet& bodies();                     ///< to set positions and velocities between steps
  const StepContacts& contacts() const;  ///< of the last step
  /// Moments of impulse on `first` that rolling and torsional friction add, of contacts(): world
  /// axes, N m s. Empty unless a meeting names either.
  const std::vector<Eigen::Vector3d>& contact_moments() const;
  double penetration() const;  ///< deepest at the start of the last step, m
  double residual() const;     ///< of its contact problems, the largest
  /// The worst status of the last step's contact problems; solved without contacts.
  Status status() const;
  /// True if all contact problems of the last step were solved or accepted, and its end meets the
  /// joints.
  bool succeeded() const;
  /// False: the end of the last step does not meet the joints.
  bool joints_met() const;
  /// Largest |g| of a joint's rows at the end of the last step, m or rad; 0 without joints.
  double joint_drift() const;
  /// Impulses of the joints in the last sub-step, one for each row, N s or N m s.
  /// Dependent rows get those of least norm, each row measured by |G C| with C C' the inverse mass:
  /// equal rows get equal shares.
  const std::vector<double>& joint_impulses() const;
  /// Those of the laws of joints, as JointEquations::add_laws has added them.
  const std::vector<double>& law_impulses() const;
  /// Length, s, of the last sub-step, to which the impulses belong: forces are impulses over
  /// it. 0 before the first step, and after set_memory().
  double last_sub_step() const;
  int asleep() const;                      ///< bodies that sleep
  const StepCounts& counts() const;        ///< since the start
  std::vector<StageCost> costs() const;    ///< since the start, one for each effect
  const SteppingOptions& options() const;  ///< those given at the start

  /// The state beside bodies(), which the caller copies as well.
  StepperMemory memory() const;
  /// Continues the motion of another Stepper bit by bit. Throws std::invalid_argument if the memory
  /// belongs to other bodies.
  void set_memory(const StepperMemory& memory);
  /// Drops all warm starts and sets the number of steps. The next step begins `late` after its
  /// boundary, in 0 <= late < dt, s, and ends at its own: bodies() are those of that time.
  void start_anew(long steps, double late = 0);

 private:
  struct TETHER_HIDDEN Implementation;
  std::unique_ptr<Implementation> implementation_;
};

double kinetic_energy(const BodySet& bodies);             ///< J
Eigen::Vector3d momentum(const BodySet& bodies);          ///< kg m/s, world axes
Eigen::Vector3d angular_momentum(const BodySet& bodies);  ///< about the origin, kg m^2/s

}  // namespace tether::contact
TETHER_EXPORT_END

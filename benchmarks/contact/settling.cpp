// Spheres that settle in a box: time of a step and how exactly it is solved, beside Bullet's
// dynamics where it is installed. SPDX-License-Identifier: BSD-3-Clause
//
//   settling [spheres = 10000] [seconds = 1] [rest = 30] [tolerance ...] [alone]
//   settling SPHERES --close [--rest-tolerance 1e-6] [--still 0.5]
//
// First all solvers over the same `seconds` from the start, judged by the same evaluate(): the
// fixed-point residual of the Coulomb law with exact cones on the contacts, velocities and impulses
// of the solver's own step. Times are of whole steps, collision included, of the processor (one
// thread). --close: only the run to rest, from dense layers with gaps of 1e-3 radii: what a pour of
// so many takes hours for is nearly there. Then one run until everything lies still, for at most
// `rest` seconds (0: left out).
//
// Angular velocities decay by 2/s in all runs: without rolling and spinning resistance, of which
// Coulomb's law knows nothing, a sphere on the floor rolls for ever.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <tether/contact/stepping.hpp>
#include <vector>

#if defined(TETHER_HAVE_BULLET)
#include <btBulletDynamicsCommon.h>

#include <memory>
#include <unordered_map>
#endif

namespace tc = tether::contact;
using Eigen::Vector3d;

namespace {

constexpr double kRadius = 0.5, kMass = 1, kFriction = 0.3, kGravity = 9.81, kStep = 5e-3;
constexpr double kAngularDecay = 2;                // 1/s
constexpr double kStill = 0.1 * kGravity * kStep;  // m/s: a tenth of what a step of gravity adds
// The run to rest.
constexpr double kStillFor = 2;  // s
// A tight tolerance in few sweeps a step. They go on with the next step's: where little moves,
// steps are soon solved to it. A loose tolerance of the whole heap lets single contacts be off for
// good, and spheres drop late; a thousand sweeps a step where stick and slip toggle rearrange the
// forces of a heap at rest until parts of it give way.
constexpr double kRestTolerance = 1e-5;
constexpr int kRestSweeps = 60;

// Processor time: others may use the machine.
double now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

struct Start {
  std::vector<Vector3d> position;
  double width = 0;
};

// A loose jittered lattice in a box as wide as the heap will be high.
Start start_of(int spheres) {
  Start out;
  const int side = std::max(2, static_cast<int>(std::cbrt(static_cast<double>(spheres))));
  const double pitch = 2.15 * kRadius;
  out.width = side * pitch;
  unsigned long long state = 1;
  const auto jitter = [&] {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return 0.07 * kRadius * (static_cast<double>(state >> 33) / 2147483648.0 * 2 - 1);
  };
  for (int k = 0; k < spheres; ++k) {
    const int x = k % side, y = k / side % side, z = k / (side * side);
    out.position.emplace_back((x + 0.5) * pitch + jitter(), (y + 0.5) * pitch + jitter(),
                              (z + 0.5) * pitch + jitter());
  }
  return out;
}

// Square layers, each in the hollows of the one below, slightly apart.
Start close_start_of(int spheres) {
  Start out = start_of(spheres);
  const int side = static_cast<int>(std::cbrt(static_cast<double>(spheres) / std::sqrt(2.0)));
  const double pitch = (2 + 1e-3) * kRadius, height = pitch / std::sqrt(2.0);
  out.width = (side + 0.5) * pitch;
  for (int k = 0; k < spheres; ++k) {
    const int x = k % side, y = k / side % side, z = k / (side * side);
    const double shift = 0.5 + 0.5 * (z % 2);
    out.position[static_cast<std::size_t>(k)] = {(x + shift) * pitch, (y + shift) * pitch,
                                                 0.5 * pitch + z * height};
  }
  return out;
}

struct Row {
  std::string name;
  double ms_per_step = 0, us_per_contact = 0, residual = 0, penetration = 0, speed = 0;
  long contacts = 0;
};

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void print(const Row& r) {
  std::printf("%-28s %9.2f %9.3f %10.1e %9.2f %10.1e %9ld\n", r.name.c_str(), r.ms_per_step,
              r.us_per_contact, r.residual, 100 * r.penetration / kRadius, r.speed, r.contacts);
  std::fflush(stdout);
}

tc::Stepper tether_scene(const Start& start, const tc::SteppingOptions& accuracy) {
  tc::BodySet bodies;
  std::vector<tc::Surface> surfaces;
  const auto wall = [&](const Vector3d& at, const Vector3d& normal) {
    surfaces.push_back({bodies.add_fixed(at), tc::Shape::plane(normal), 1});
  };
  wall(Vector3d::Zero(), Vector3d::UnitZ());
  wall(Vector3d::Zero(), Vector3d::UnitX());
  wall(Vector3d::Zero(), Vector3d::UnitY());
  wall(Vector3d(start.width, 0, 0), -Vector3d::UnitX());
  wall(Vector3d(0, start.width, 0), -Vector3d::UnitY());
  for (const Vector3d& p : start.position)
    surfaces.push_back(
        {bodies.add(kMass, 0.4 * kMass * kRadius * kRadius * Eigen::Matrix3d::Identity(), p),
         tc::Shape::sphere(kRadius), 0});
  tc::SteppingOptions options = accuracy;
  options.step = kStep;
  options.gravity = Vector3d(0, 0, -kGravity);
  tc::Stepper s(std::move(bodies), std::move(surfaces),
                {{0, 0, kFriction, 0}, {0, 1, kFriction, 0}}, options);
  s.add_force("drag", [](tc::BodySet& all, double, double dt) {
    const double keep = std::exp(-kAngularDecay * dt);
    for (tc::RigidBody& b : all.motion) b.angular_velocity *= keep;
  });
  return s;
}

double fastest(const tc::Stepper& s) {
  double most = 0;
  for (const tc::RigidBody& b : s.bodies().motion) most = std::max(most, b.velocity.norm());
  return most;
}

void print_stages(const tc::Stepper& s) {
  for (const tc::StageCost& c : s.costs())
    std::printf("    %-24s %9.2f ms\n", c.effect,
                1e3 * c.seconds / static_cast<double>(s.counts().steps));
  std::printf("    %ld sweeps, %ld assembled islands, %ld steps not to tolerance\n",
              s.counts().sweeps, s.counts().assembled_islands, s.counts().unsolved);
}

void tether_run(const Start& start, double duration, double tolerance) {
  tc::SteppingOptions accuracy;
  accuracy.tolerance = tolerance;
  tc::Stepper s = tether_scene(start, accuracy);
  Row row;
  char name[64];
  std::snprintf(name, sizeof name, "Tether, tolerance %.0e", tolerance);
  row.name = name;
  double seconds = 0;
  std::vector<double> residuals;
  const long steps = std::lround(duration / kStep);
  for (long k = 0; k < steps; ++k) {
    const double begin = now();
    s.step();
    seconds += now() - begin;
    row.contacts += static_cast<long>(s.contacts().points.size());
    row.penetration = std::max(row.penetration, s.penetration());
    if (s.residual() >= 0 && k > steps / 3) residuals.push_back(s.residual());
  }
  row.ms_per_step = 1e3 * seconds / static_cast<double>(steps);
  row.us_per_contact = 1e6 * seconds / static_cast<double>(std::max(1L, row.contacts));
  row.contacts /= steps;
  row.residual = median(residuals);
  row.speed = fastest(s);
  print(row);
  print_stages(s);
}

// Until no sphere has been faster than kStill for so long.
void to_rest(const Start& start, double longest, double tolerance, double still_for) {
  tc::SteppingOptions accuracy;
  accuracy.tolerance = tolerance;
  accuracy.max_sweeps = kRestSweeps;
  tc::Stepper s = tether_scene(start, accuracy);
  std::printf(
      "\nto rest, tolerance %.0e, at most %d sweeps a step: no sphere above %.1e m/s for %g s\n",
      tolerance, kRestSweeps, kStill, still_for);
  std::printf("%9s %12s %12s %12s %12s %9s %9s %10s\n", "t / s", "fastest m/s", "above",
              "energy / J", "depth %R", "contacts", "us/cont.", "residual");
  double seconds = 0, still_since = 0, deepest = 0, contacts = 0;
  const long report = std::lround(0.5 * still_for / kStep), most = std::lround(longest / kStep);
  bool rests = false;
  for (long k = 1; k <= most && !rests; ++k) {
    const double begin = now();
    s.step();
    seconds += now() - begin;
    contacts += static_cast<double>(s.contacts().points.size());
    deepest = std::max(deepest, s.penetration());
    const double fast = fastest(s);
    if (fast > kStill) still_since = s.time();
    rests = s.time() - still_since >= still_for;
    if (k % report == 0 || rests || k == most) {
      const auto above =
          std::count_if(s.bodies().motion.begin(), s.bodies().motion.end(),
                        [](const tc::RigidBody& b) { return b.velocity.norm() > kStill; });
      std::printf("%9.2f %12.1e %12ld %12.1e %12.3f %9zu %9.2f %10.1e\n", s.time(), fast,
                  static_cast<long>(above), tc::kinetic_energy(s.bodies()), 100 * deepest / kRadius,
                  s.contacts().points.size(), 1e6 * seconds / contacts, s.residual());
      std::fflush(stdout);
    }
  }
  if (rests)
    std::printf("    at rest from %.2f s on; deepest penetration %.3f %% of a radius\n",
                still_since, 100 * deepest / kRadius);
  else
    std::printf("    NOT at rest after %g s\n", s.time());
  print_stages(s);
}

#if defined(TETHER_HAVE_BULLET)
btVector3 to_bullet(const Vector3d& v) { return {v[0], v[1], v[2]}; }
Vector3d from_bullet(const btVector3& v) { return {v[0], v[1], v[2]}; }

// The contact problem of the step that Bullet has just made: velocities before it plus gravity.
double bullet_residual(btDispatcher& dispatcher, std::vector<tc::RigidBody>& bodies) {
  std::vector<tc::PointContact> contacts;
  std::vector<Vector3d> impulses;
  for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
    const btPersistentManifold* manifold = dispatcher.getManifoldByIndexInternal(m);
    const int a = manifold->getBody0()->getUserIndex(), b = manifold->getBody1()->getUserIndex();
    for (int k = 0; k < manifold->getNumContacts(); ++k) {
      const btManifoldPoint& p = manifold->getContactPoint(k);
      tc::PointContact c;
      c.first = a;
      c.second = b;
      c.normal = from_bullet(p.m_normalWorldOnB).normalized();
      // Arms along the normal: all are balls or planes.
      c.r1 = -kRadius * c.normal;
      c.r2 = kRadius * c.normal;
      Vector3d impulse = p.m_appliedImpulse * c.normal +
                         p.m_appliedImpulseLateral1 * from_bullet(p.m_lateralFrictionDir1) +
                         p.m_appliedImpulseLateral2 * from_bullet(p.m_lateralFrictionDir2);
      if (a < 0) {
        std::swap(c.first, c.second);
        c.normal = -c.normal;
        c.r1 = -kRadius * c.normal;
        impulse = -impulse;
      }
      c.mu = kFriction;
      c.bias = std::max(0.0, p.getDistance()) / kStep;
      contacts.push_back(c);
      impulses.push_back(impulse);
    }
  }
  if (contacts.empty()) return -1;
  return tc::evaluate(bodies, contacts, tc::Law::coulomb, impulses).fixed_point;
}

void bullet_run(const Start& start, double duration, int iterations, bool two_directions) {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher(&configuration);
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
  world.setGravity(btVector3(0, 0, -kGravity));
  world.getSolverInfo().m_numIterations = iterations;
  // Penetrations by split impulses only, so that the velocity problem is ours.
  world.getSolverInfo().m_splitImpulsePenetrationThreshold = 0;
  if (two_directions) world.getSolverInfo().m_solverMode |= SOLVER_USE_2_FRICTION_DIRECTIONS;

  std::vector<std::unique_ptr<btCollisionShape>> shapes;
  std::vector<std::unique_ptr<btRigidBody>> all;
  const auto add = [&](btCollisionShape* shape, double mass, const Vector3d& at, int index) {
    btVector3 inertia(0, 0, 0);
    if (mass > 0) shape->calculateLocalInertia(mass, inertia);
    btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, shape, inertia);
    info.m_startWorldTransform.setIdentity();
    info.m_startWorldTransform.setOrigin(to_bullet(at));
    info.m_friction = std::sqrt(kFriction);  // Bullet multiplies
    auto body = std::make_unique<btRigidBody>(info);
    body->setUserIndex(index);
    body->setActivationState(DISABLE_DEACTIVATION);
    body->setDamping(0, 1 - std::exp(-kAngularDecay));  // of a second
    world.addRigidBody(body.get());
    all.push_back(std::move(body));
  };
  const auto wall = [&](const Vector3d& normal, double offset) {
    shapes.push_back(std::make_unique<btStaticPlaneShape>(to_bullet(normal), offset));
    add(shapes.back().get(), 0, Vector3d::Zero(), -1);
  };
  wall(Vector3d::UnitZ(), 0);
  wall(Vector3d::UnitX(), 0);
  wall(Vector3d::UnitY(), 0);
  wall(-Vector3d::UnitX(), -start.width);
  wall(-Vector3d::UnitY(), -start.width);
  shapes.push_back(std::make_unique<btSphereShape>(kRadius));
  btCollisionShape* sphere = shapes.back().get();
  for (std::size_t k = 0; k < start.position.size(); ++k)
    add(sphere, kMass, start.position[k], static_cast<int>(k));

  std::vector<tc::RigidBody> before(start.position.size());
  Row row;
  row.name =
      "Bullet, " + std::to_string(iterations) + " iterations" + (two_directions ? ", 2 dir." : "");
  double seconds = 0;
  std::vector<double> residuals;
  const long steps = std::lround(duration / kStep);
  for (long k = 0; k < steps; ++k) {
    const bool sample = k > steps / 3 && k % 10 == 0;
    if (sample)
      for (std::size_t i = 0; i < before.size(); ++i) {
        const btRigidBody& b = *all[i + 5];
        before[i].inverse_mass = 1 / kMass;
        before[i].inverse_inertia = 2.5 / (kMass * kRadius * kRadius) * Eigen::Matrix3d::Identity();
        before[i].velocity = from_bullet(b.getLinearVelocity()) - Vector3d(0, 0, kGravity * kStep);
        before[i].angular_velocity =
            std::exp(-kAngularDecay * kStep) * from_bullet(b.getAngularVelocity());
      }
    const double begin = now();
    world.stepSimulation(kStep, 0);
    seconds += now() - begin;
    for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
      const btPersistentManifold* manifold = dispatcher.getManifoldByIndexInternal(m);
      row.contacts += manifold->getNumContacts();
      for (int j = 0; j < manifold->getNumContacts(); ++j)
        row.penetration = std::max(row.penetration, -manifold->getContactPoint(j).getDistance());
    }
    if (!sample) continue;
    const double residual = bullet_residual(dispatcher, before);
    if (residual >= 0) residuals.push_back(residual);
  }
  row.ms_per_step = 1e3 * seconds / static_cast<double>(steps);
  row.us_per_contact = 1e6 * seconds / static_cast<double>(std::max(1L, row.contacts));
  row.contacts /= steps;
  row.residual = median(residuals);
  for (const auto& b : all) row.speed = std::max(row.speed, b->getLinearVelocity().length());
  print(row);
  for (const auto& b : all) world.removeRigidBody(b.get());
}
#endif

}  // namespace

int main(int argc, char** argv) {
  int spheres = 10000;
  double duration = 1, rest = 30;
  std::vector<std::string> more;
  CLI::App app("Spheres that settle in a box, beside Bullet's dynamics where they are installed");
  app.add_option("spheres", spheres, "Number of spheres")->check(CLI::PositiveNumber);
  app.add_option("seconds", duration, "Time of the comparison")->check(CLI::PositiveNumber);
  app.add_option("rest", rest, "Time in which the heap may come to rest; 0: not tried")
      ->check(CLI::NonNegativeNumber);
  app.add_option("more", more, "Tolerances, and the word alone: without Bullet")
      ->check(CLI::PositiveNumber | CLI::IsMember({"alone"}));
  double rest_tolerance = kRestTolerance, still_for = kStillFor;
  bool close = false;
  app.add_flag("--close", close, "Only the run to rest, from dense layers just above contact");
  app.add_option("--rest-tolerance", rest_tolerance, "Of a step on the way to rest")
      ->check(CLI::PositiveNumber);
  app.add_option("--still", still_for, "Seconds without motion that count as rest")
      ->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  if (close) {
    to_rest(close_start_of(spheres), rest, rest_tolerance, still_for);
    return 0;
  }
  std::vector<double> tolerances;
  for (const std::string& word : more)
    if (word != "alone") tolerances.push_back(std::stod(word));
  const bool alone = tolerances.size() < more.size();
  if (tolerances.empty()) tolerances = {1e-1, 1e-2, 1e-3};
  const Start start = start_of(spheres);
  std::printf("%d spheres, %g s, step %g s, friction %g\n\n", spheres, duration, kStep, kFriction);
  std::printf("%-28s %9s %9s %10s %9s %10s %9s\n", "", "ms/step", "us/cont.", "residual",
              "depth %R", "speed m/s", "contacts");
  for (const double tolerance : tolerances) tether_run(start, duration, tolerance);
#if defined(TETHER_HAVE_BULLET)
  if (!alone) {
    bullet_run(start, duration, 10, false);
    bullet_run(start, duration, 10, true);
    bullet_run(start, duration, 50, true);
  }
#else
  if (!alone) std::printf("Bullet: not installed (libbullet-dev)\n");
#endif
  if (rest > 0) to_rest(start, rest, rest_tolerance, still_for);
  return 0;
}

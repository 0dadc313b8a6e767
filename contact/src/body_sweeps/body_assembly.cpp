// Tether: a stiff island as a Problem. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "body_sweeps/body_parts.hpp"
#include "body_sweeps/wide_velocities.hpp"
#include "problem/contact_side.hpp"

namespace tether::contact {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// The island as a Problem, for the stages of Solver; from the present impulses.
void BodySolver::Implementation::assemble(int k, Worker& worker) {
  const Island& island = graph.islands[at(k)];
  IslandResult& r = results[at(k)];
  r.assembled = true;
  worker.bodies.resize(at(island.body_end - island.body_begin));
  for (int s = island.body_begin; s < island.body_end; ++s) {
    const RigidBody& b = (*bodies)[at(graph.body[at(s)])];
    Body& body = worker.bodies[at(s - island.body_begin)];
    body.inverse_mass.setZero();
    body.inverse_mass.topLeftCorner<3, 3>() = b.inverse_mass * Matrix3d::Identity();
    body.inverse_mass.bottomRightCorner<3, 3>() = b.inverse_inertia;
    body.velocity << b.velocity, b.angular_velocity;
  }
  worker.contacts.clear();
  Eigen::VectorXd x(3 * island.contacts);
  for (int chunk = island.chunk_begin; chunk < island.chunk_end; ++chunk) {
    visit(chunk, [&](int contact, Kind kind_, int place) {
      const PointContact& c = (*contacts)[at(contact)];
      const detail::Side s = detail::side(*bodies, c, turned[at(contact)] != 0);
      const auto local = [&](int b) { return b < 0 ? -1 : graph.slot[at(b)] - island.body_begin; };
      const Matrix3d F = tangent_frame(s.n);
      x.segment<3>(3 * static_cast<Eigen::Index>(worker.contacts.size())) =
          F * impulse(kind_, place);
      worker.contacts.push_back(BodyContact::at_point(
          local(first[at(contact)]), local(second[at(contact)]), s.r1, s.r2, s.n, c.mu));
      worker.contacts.back().bias = F * (c.bias * s.n - s.fixed);
    });
  }
  if (!x.allFinite()) x.setZero();  // sweeps have overflowed
  const Problem problem = delassus(worker.bodies, worker.contacts);
  Options o;
  o.law = options.law;
  o.measure = Measure::fixed_point;
  o.tolerance = 0.9 * options.tolerance;  // the two forms round differently
  o.strict = options.strict;
  o.max_work = options.max_work;
  o.enough = options.enough;
  worker.solver = std::make_unique<Solver>(o);
  worker.solution = worker.solver->solve(problem, x);
  r.status = worker.solution.status;
  r.error = worker.solution.error;

  // Back to the bodies.
  for (int s = island.body_begin; s < island.body_end; ++s) load_body(s);
  int i = 0;
  PassResult residual;
  for (int chunk = island.chunk_begin; chunk < island.chunk_end; ++chunk) {
    visit(chunk, [&](int contact, Kind kind_, int place) {
      const Vector3d n = turned[at(contact)] ? Vector3d(-(*contacts)[at(contact)].normal)
                                             : (*contacts)[at(contact)].normal;
      const Vector3d p =
          tangent_frame(n).transpose() * worker.solution.impulses.segment<3>(3 * i++);
      set_impulse(kind_, place, p);
      apply(contact, p);
    });
  }
  for (int replaced : worker.solution.replaced) {
    worker.replaced.push_back(graph.order[at(island.contact_begin + replaced)]);
  }
  if (!worker.solution.replaced.empty()) return;  // the sweeps do not know the other rule
  const Team one{0, 1, nullptr, &worker};
  for (int c = island.chunk_begin; c < island.chunk_end; ++c) residual.add(test(c, one));
  r.error = r.relative(residual.most);
  if (r.error <= options.tolerance)
    r.status = Status::solved;
  else if (r.status == Status::solved)
    judge_with_long_sums(k);
}

// Solved as a Problem, not by the velocities of the bodies: where impulses between heavy bodies act
// on light ones these are the round-off of their double sums, and found with long ones.
void BodySolver::Implementation::judge_with_long_sums(int k) {
  const Island& island = graph.islands[at(k)];
  IslandResult& r = results[at(k)];
  std::vector<PointContact> here;
  std::vector<Vector3d> impulses;
  detail::WideVelocities velocities(*bodies);
  for (int chunk = island.chunk_begin; chunk < island.chunk_end; ++chunk) {
    visit(chunk, [&](int contact, Kind kind_, int place) {
      here.push_back((*contacts)[at(contact)]);
      const Vector3d p = impulse(kind_, place);
      impulses.push_back(turned[at(contact)] ? Vector3d(-p) : p);
      velocities.push(here.back(), impulses.back());
    });
  }
  r.error = evaluate(*bodies, here, options.law, impulses).fixed_point;
  r.status = r.error <= options.tolerance ? Status::solved : Status::stalled;
  for (int s = island.body_begin; s < island.body_end; ++s) {
    const int body = graph.body[at(s)];
    detail::store(velocities.linear(body), state[at(s)].v);
    detail::store(velocities.angular(body), state[at(s)].w);
  }
}

}  // namespace tether::contact

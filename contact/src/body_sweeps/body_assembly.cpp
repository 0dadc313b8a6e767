// Tether: a stiff island as a Problem. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "body_sweeps/implementation.hpp"
#include "body_sweeps/wide_velocities.hpp"
#include "problem/contact_side.hpp"

namespace tether::contact {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Options detail::assembled_options(const BodyOptions& options) {
  Options o;
  o.law = options.law;
  o.tolerance = options.tolerance;
  o.strict = options.strict;
  o.max_work = options.max_work;
  o.enough = options.enough;
  return o;
}

// The island as a Problem, for the stages of Solver; x: its present impulses.
Problem BodySolver::Implementation::assembled(const Island& island, Worker& worker,
                                              Eigen::VectorXd& x) const {
  worker.bodies.clear();
  for (int s = island.body_begin; s < island.body_end; ++s)
    worker.bodies.push_back(given.bodies()[at(graph.body[at(s)])]);
  worker.contacts.clear();
  x.resize(3 * island.contacts);
  const auto local = [&](int b) { return b < 0 ? -1 : graph.slot[at(b)] - island.body_begin; };
  sweeps.for_contacts(island, [&](int contact, Kind kind, int place) {
    const PointContact& c = given.contact(contact);
    const detail::Side s = given.side(contact);
    const Matrix3d F = tangent_frame(s.n);
    x.segment<3>(3 * static_cast<Eigen::Index>(worker.contacts.size())) =
        F * sweeps.impulse(kind, place);
    worker.contacts.push_back(ContactRows::at_point(local(given.first()[at(contact)]),
                                                    local(given.second()[at(contact)]), s.r1, s.r2,
                                                    s.n, c.mu));
    worker.contacts.back().bias = F * (c.bias * s.n - s.fixed);
  });
  if (!x.allFinite()) x.setZero();  // sweeps have overflowed
  return delassus(worker.bodies, worker.contacts);
}

// The worker's solution, back to the bodies.
void BodySolver::Implementation::take(const Island& island, Worker& worker) {
  Team one{0, 1, nullptr, &worker.scratch};
  sweeps.load(island, one);
  int i = 0;
  sweeps.for_contacts(island, [&](int contact, Kind kind, int place) {
    const Matrix3d F = tangent_frame(given.normal(contact));
    const Vector3d p = F.transpose() * worker.solution.impulses.segment<3>(3 * i++);
    sweeps.add_impulse(contact, kind, place, p);
  });
  for (int replaced : worker.solution.replaced)
    worker.replaced.push_back(graph.order[at(island.contact_begin + replaced)]);
}

void BodySolver::Implementation::assemble(int k, Worker& worker) {
  const Island& island = graph.islands[at(k)];
  IslandResult& r = results[at(k)];
  Eigen::VectorXd x;
  const Problem problem = assembled(island, worker, x);
  Options of_problem = detail::assembled_options(options);
  of_problem.tolerance *= 0.9;  // the two forms round differently
  of_problem.max_work = r.assembly;
  worker.solver = std::make_unique<Solver>(of_problem);
  worker.solution = worker.solver->solve(problem, x);
  r.spent += r.assembly;
  r.status = worker.solution.status;
  r.error = worker.solution.error;
  take(island, worker);
  if (!worker.solution.replaced.empty()) return;  // the sweeps do not know the other rule
  Team one{0, 1, nullptr, &worker.scratch};
  r.error = r.relative(sweeps.test(island, one).most);
  if (r.error <= options.tolerance)
    r.status = Status::solved;
  else if (r.status == Status::solved)
    judge_with_long_sums(k);
}

// If the assembled problem is not solved, sweeps go on from its best point, unless they had ended.
// They cannot: with replaced contacts, whose law they do not have, the problem gets all of the
// work.
void BodySolver::Implementation::assemble_and_sweep_on(int k, Worker& worker) {
  const Island& island = graph.islands[at(k)];
  Team one{0, 1, nullptr, &worker.scratch};
  IslandResult& r = results[at(k)];
  while (r.assembly > 0) {
    assemble(k, worker);
    sweeps.unpack(island, one, *out);
    const bool replaced = !worker.solution.replaced.empty();
    if (r.end != IslandResult::End::none || r.status == Status::solved ||
        r.status == Status::infeasible)
      return;
    if (!replaced) {
      iterate(k, one);
    } else if (r.status == Status::work_limit && r.assembly < options.max_work) {
      r.assembly = options.max_work;
    } else {
      return;
    }
  }
  if (!r.saved()) sweeps.unpack(island, one, *out);
}

// For islands solved as a Problem whose error by the bodies' velocities is above the tolerance.
// With heavy bodies on light ones that may be round-off of double sums; long sums decide.
void BodySolver::Implementation::judge_with_long_sums(int k) {
  const Island& island = graph.islands[at(k)];
  IslandResult& r = results[at(k)];
  std::vector<PointContact> here;
  std::vector<Vector3d> impulses;
  detail::WideVelocities velocities(given.bodies());
  sweeps.for_contacts(island, [&](int contact, Kind kind, int place) {
    here.push_back(given.contact(contact));
    impulses.push_back(given.with_sign(contact, sweeps.impulse(kind, place)));
    velocities.push(here.back(), impulses.back());
  });
  r.error = evaluate(given.bodies(), here, options.law, impulses).fixed_point;
  r.status = r.error <= options.tolerance ? Status::solved : Status::stalled;
  for (int s = island.body_begin; s < island.body_end; ++s) {
    const int body = graph.body[at(s)];
    sweeps.set_velocity(s, velocities.linear(body), velocities.angular(body));
  }
}

}  // namespace tether::contact

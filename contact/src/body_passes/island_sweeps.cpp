// Tether: passes over the contacts of an island. SPDX-License-Identifier: BSD-3-Clause
#include "body_passes/island_sweeps.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "body_passes/body_kernels.hpp"
#include "problem/criterion.hpp"

namespace tether::contact::detail {

using linalg::at;

namespace {

// An impulse on the friction cone of its contact, normal part kept.
Vector3d on_cone(const Vector3d& p, const Vector3d& n, double mu) {
  const double xn = p.dot(n);
  if (!(xn > 0)) return Vector3d::Zero();
  Vector3d t = p - xn * n;
  const double most = mu * xn, length = t.norm();
  if (length > most) t *= most / length;
  return xn * n + t;
}

}  // namespace

void IslandSweeps::start(const GivenProblem& given, const ContactGraph& graph, Law law) {
  given_ = &given;
  graph_ = &graph;
  law_ = law;
  contacts_.resize(graph.chunks.back(), graph.order.size());
  bodies_.resize(graph.body.size());
  for (std::vector<PassResult>& sums : sums_) sums.resize(graph.chunks.size());
}

// The first chunk of part k of `parts` with about the same number of contacts.
int IslandSweeps::cut(int begin, int end, int k, int parts) const {
  if (k == 0) return begin;
  if (k == parts) return end;
  const Chunk* chunks = graph_->chunks.data();
  const long long first_place = chunks[begin].place;
  const long long place = first_place + (chunks[end].place - first_place) * k / parts;
  const Chunk* c = std::partition_point(chunks + begin, chunks + end, [&](const Chunk& chunk) {
    return static_cast<long long>(chunk.place) + (&chunk)[1].place < 2 * place;
  });
  return static_cast<int>(c - chunks);
}

// operation(chunk) for all chunks of the island, colour by colour; what it returns together, in
// an order that no number of threads or processes changes.
template <class Operation>
PassResult IslandSweeps::pass(const Island& island, Team& team, Pass kind,
                              const Operation& operation) {
  std::vector<PassResult>& sums = sums_[++team.passes & 1];
  SweepPartners* partners = kind == Pass::local ? nullptr : team.partners;
  if (partners && kind == Pass::reads_bodies) team.once([&] { partners->share(bodies_); });
  for (int k = island.colour_begin; k < island.colour_end; ++k) {
    const int first = graph_->colours[at(k)], last = graph_->colours[at(k + 1)];
    const int begin = cut(first, last, team.thread, team.threads);
    const int end = cut(first, last, team.thread + 1, team.threads);
    for (int c = begin; c < end; ++c) sums[at(c)] = operation(c);
    team.meet();
    if (partners && kind == Pass::moves_bodies)
      team.once([&] { partners->after_colour(k, bodies_); });
  }
  if (partners) {
    team.once([&] { total_ = partners->total(sums); });
    return total_;
  }
  PassResult sum;
  for (int c = island.chunk_begin; c < island.chunk_end; ++c) sum.add(sums[at(c)]);
  return sum;
}

// operation(bodies, begin, end, theta of these contacts)
template <class Operation>
PassResult IslandSweeps::over_kinds(int chunk, const Team& team, const Operation& operation) {
  const BodyArrays s = bodies_.arrays(given_->fixed(), &team.scratch->nowhere);
  const Chunk &from = graph_->chunks[at(chunk)], &to = graph_->chunks[at(chunk + 1)];
  PassResult sum;
  Coupled coupled = graph_->coupled.data() + from.place;
  contacts_.for_kinds(from, to, [&](auto* begin, auto* end, int width) {
    sum.add(operation(s, begin, end, coupled));
    coupled += width * (end - begin);
  });
  return sum;
}

PassResult IslandSweeps::sweep(const Island& island, Team& team) {
  return pass(island, team, Pass::moves_bodies, [&](int chunk) {
    return over_kinds(chunk, team, [&](const BodyArrays& s, auto* begin, auto* end, Coupled) {
      return detail::pass(s, law_, begin, end, nullptr);
    });
  });
}

PassResult IslandSweeps::test(const Island& island, Team& team) {
  return pass(island, team, Pass::reads_bodies, [&](int chunk) {
    return over_kinds(chunk, team, [&](const BodyArrays& s, auto* begin, auto* end, Coupled c) {
      return detail::pass(s, law_, begin, end, c);
    });
  });
}

void IslandSweeps::load(const Island& island, const Team& team) {
  team.scratch->nowhere = {};
  const int begin = island.body_begin, end = island.body_end;
  for (int s = team.from(begin, end); s < team.to(begin, end); ++s)
    bodies_.load(s, given_->bodies()[at(graph_->body[at(s)])]);
}

// Returns |b|^2, the needed change and the speeds of which b is the difference.
PassResult IslandSweeps::pack_contact(int contact, Kind k, int place, const Vector3d* start) {
  const PointContact& c = given_->contact(contact);
  const Side s = given_->side(contact);
  const int a = graph_->slot[at(given_->first()[at(contact)])];
  const int second = given_->second()[at(contact)];
  const int b = second >= 0 ? graph_->slot[at(second)] : given_->fixed_second(contact);
  const Vector3d before = velocity_before(s, c.bias);
  const double slip = contacts_.pack(k, place, s, c, a, b);
  Vector3d p = Vector3d::Zero();
  if (start) p = on_cone(s.sign * *start, s.n, k == Kind::smooth ? 0 : c.mu);
  if (p.isZero(0))
    contacts_.set_impulse(k, place, p);
  else
    add_impulse(contact, k, place, p);
  const double bn = -before.dot(s.n), bb = before.squaredNorm();
  PassResult result;
  result.sum = bb;
  result.most = needed_change(bn, std::sqrt(std::max(0.0, bb - bn * bn)), c.mu, slip);
  result.speed = speed_before(s, c.bias);
  if (!p.isZero(0)) result.started = speed_by(s, p);
  return result;
}

PassResult IslandSweeps::pack(const Island& island, Team& team,
                              const std::vector<const Vector3d*>& start) {
  return pass(island, team, Pass::moves_bodies, [&](int chunk) {
    PassResult sum;
    in_chunk(chunk, [&](int contact, Kind k, int place) {
      try {
        sum.add(pack_contact(contact, k, place, start.empty() ? nullptr : start[at(contact)]));
      } catch (const std::invalid_argument& e) {
        if (contact >= team.scratch->refused) return;
        team.scratch->refused = contact;
        team.scratch->reason = e.what();
      }
    });
    return sum;
  });
}

void IslandSweeps::add_impulse(int contact, Kind k, int place, const Vector3d& p) {
  contacts_.set_impulse(k, place, p);
  const PointContact& c = given_->contact(contact);
  const Vector3d q = (given_->exchanged(contact) ? c.r2 : c.r1).cross(p);
  bodies_.push(graph_->slot[at(given_->first()[at(contact)])], p, q);
  const int second = given_->second()[at(contact)];
  if (second < 0) return;
  const Vector3d minus = -p;
  bodies_.push(graph_->slot[at(second)], minus, c.r2.cross(minus));
}

// Each thread's own contacts, as it sweeps them: what another thread has swept comes from that
// one's cache, which takes longer than to sweep it.
void IslandSweeps::extrapolate(const Island& island, const Team& team, double beta) {
  for (int k = island.colour_begin; k < island.colour_end; ++k) {
    const int first = graph_->colours[at(k)], last = graph_->colours[at(k + 1)];
    const int begin = cut(first, last, team.thread, team.threads);
    const int end = cut(first, last, team.thread + 1, team.threads);
    contacts_.extrapolate(graph_->chunks[at(begin)], graph_->chunks[at(end)], beta);
  }
  bodies_.extrapolate(team.from(island.body_begin, island.body_end),
                      team.to(island.body_begin, island.body_end), beta);
  team.meet();
}

void IslandSweeps::rest(const Island& island, Team& team) {
  pass(island, team, Pass::local, [&](int chunk) {
    in_chunk(chunk,
             [&](int, Kind k, int place) { contacts_.set_impulse(k, place, Vector3d::Zero()); });
    return PassResult();
  });
  load(island, team);
  team.meet();
}

void IslandSweeps::refresh(const Island& island, Team& team) {
  load(island, team);
  team.meet();
  pass(island, team, Pass::moves_bodies, [&](int chunk) {
    in_chunk(chunk, [&](int contact, Kind k, int place) {
      add_impulse(contact, k, place, impulse(k, place));
    });
    return PassResult();
  });
  extrapolate(island, team, 0);  // what momentum starts from
}

void IslandSweeps::unpack_contact(int contact, Kind k, int place, BodySolution& out) const {
  const Vector3d p = impulse(k, place);
  out.impulses[at(contact)] = given_->with_sign(contact, p);
  const Vector3d n = given_->normal(contact);
  const double xn = p.dot(n), tt = (p - xn * n).squaredNorm();
  const double most = k == Kind::smooth ? 0 : given_->contact(contact).mu * xn;
  out.regimes[at(contact)] = !(xn > 0)                        ? Regime::separating
                             : tt >= most * most * (1 - 1e-9) ? Regime::sliding
                                                              : Regime::sticking;
}

void IslandSweeps::unpack(const Island& island, Team& team, BodySolution& out) {
  pass(island, team, Pass::local, [&](int chunk) {
    in_chunk(chunk,
             [&](int contact, Kind k, int place) { unpack_contact(contact, k, place, out); });
    return PassResult();
  });
  const int begin = island.body_begin, end = island.body_end;
  for (int s = team.from(begin, end); s < team.to(begin, end); ++s) {
    const std::size_t b = at(graph_->body[at(s)]);
    out.velocities[b] = bodies_.velocity(s);
    out.angular_velocities[b] = bodies_.angular_velocity(s);
  }
}

}  // namespace tether::contact::detail

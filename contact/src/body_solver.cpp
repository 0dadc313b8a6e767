// Tether: sweeps on the velocities of bodies. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/body_solver.hpp>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>
#include <stdexcept>
#include <string>

#include "body_kernels.hpp"
#include "contact_graph.hpp"
#include "impulse_memory.hpp"
#include "refuse.hpp"
#include "worker_team.hpp"

namespace tether::contact {
namespace {

using detail::BodyArrays;
using detail::BodyInertia;
using detail::BodyState;
using detail::Chunk;
using detail::GeneralContact;
using detail::GeneralGroup;
using detail::Island;
using detail::Kind;
using detail::SmoothContact;
using detail::SphereContact;
using detail::SphereGroup;
using Eigen::Matrix3d;
using Eigen::Vector3d;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

// Islands from this size on are swept by all threads together, others by one thread each.
constexpr int kTogether = 1500;
// Forecasts of the sweeps that are still needed are made after 5, 10, 20, 40, ... sweeps. More than
// kSlow: momentum is used. More than kPatience for each contact of the island (about what its
// assembly and solution cost, measured on stacks and packings of 8 to 1400 contacts), after one
// sweep for each contact: assembled.
constexpr int kFirstForecast = 5;
constexpr int kFew = 64;  // see BodyOptions::min_sweeps
constexpr double kSlow = 15, kPatience = 7;

bool moves(const RigidBody& b) { return b.inverse_mass > 0 || !b.inverse_inertia.isZero(0); }

Matrix3d skew(const Vector3d& r) {
  Matrix3d X;
  X << 0, -r[2], r[1], r[2], 0, -r[0], -r[1], r[0], 0;
  return X;
}

// A contact from the side of a body that moves: `second` is null if the other one does not.
struct Side {
  const RigidBody* first;
  const RigidBody* second;
  Vector3d r1, r2, n;
  Vector3d fixed;  // velocity of the partner at the contact if it does not move
  double sign;     // of the caller's impulse
};

Side side(const std::vector<RigidBody>& bodies, const PointContact& c, bool turned) {
  Side s{&bodies[at(c.first)], nullptr, c.r1, c.r2, c.normal, Vector3d::Zero(), 1};
  const RigidBody* other = c.second < 0 ? nullptr : &bodies[at(c.second)];
  if (turned) {
    std::swap(s.first, other);
    s.r1.swap(s.r2);
    s.n = -s.n;
    s.sign = -1;
  }
  if (other && moves(*other)) {
    s.second = other;
  } else if (other) {
    s.fixed = other->velocity + other->angular_velocity.cross(s.r2);
  }
  return s;
}

// Velocity of the contact before the impulses, bias included.
Vector3d velocity_before(const Side& s, double bias) {
  Vector3d u = s.first->velocity + s.first->angular_velocity.cross(s.r1) - s.fixed + bias * s.n;
  if (s.second) u -= s.second->velocity + s.second->angular_velocity.cross(s.r2);
  return u;
}

// Diagonal block of A in world axes.
Matrix3d diagonal_block(const Side& s) {
  const Matrix3d X = skew(s.r1);
  Matrix3d D = s.first->inverse_mass * Matrix3d::Identity() - X * s.first->inverse_inertia * X;
  if (s.second) {
    const Matrix3d Y = skew(s.r2);
    D += s.second->inverse_mass * Matrix3d::Identity() - Y * s.second->inverse_inertia * Y;
  }
  return D;
}

void store(const Vector3d& v, double* out) { Eigen::Map<Vector3d>{out} = v; }
Vector3d load(const double* v) { return Eigen::Map<const Vector3d>(v); }

constexpr BodyInertia kNoInertia = {};

// A contact is two ints and doubles, a group four times the same side by side.
template <class Contact, class Group>
void to_lane(const Contact& c, Group& g, int lane) {
  g.first[lane] = c.first;
  g.second[lane] = c.second;
  const char* from = reinterpret_cast<const char*>(&c) + 8;
  char* to = reinterpret_cast<char*>(&g) + 32 + 8 * lane;
  for (std::size_t k = 8; k < sizeof(Contact); k += 8)
    std::memcpy(to + 4 * (k - 8), from + k - 8, 8);
}
template <class Contact, class Group>
Contact from_lane(const Group& g, int lane) {
  Contact c;
  c.first = g.first[lane];
  c.second = g.second[lane];
  const char* from = reinterpret_cast<const char*>(&g) + 32 + 8 * lane;
  char* to = reinterpret_cast<char*>(&c) + 8;
  for (std::size_t k = 8; k < sizeof(Contact); k += 8)
    std::memcpy(to + k - 8, from + 4 * (k - 8), 8);
  return c;
}

// An impulse on the friction cone of its contact, normal part kept.
Vector3d on_cone(const Vector3d& p, const Vector3d& n, double mu) {
  const double xn = p.dot(n);
  if (!(xn > 0)) return Vector3d::Zero();
  Vector3d t = p - xn * n;
  const double most = mu * xn, length = t.norm();
  if (length > most) t *= most / length;
  return xn * n + t;
}

struct IslandResult {
  Status status = Status::unsolved;
  int sweeps = 0;
  double norm = 0, error = 0;
  bool assembled = false;
};

// What each thread has of its own.
struct Worker {
  alignas(64) BodyState nowhere = {};
  std::unique_ptr<Solver> solver;
  Solution solution;
  std::vector<Body> bodies;
  std::vector<BodyContact> contacts;
  std::vector<int> replaced;
  std::exception_ptr failure;
  int bad_contact = std::numeric_limits<int>::max();
  std::string bad_reason;
};

// Who works on an island: all threads, or one.
struct Team {
  int thread, threads;
  detail::Barrier* barrier;
  Worker* worker;
  void meet() const {
    if (threads > 1) barrier->wait();
  }
  int from(int begin, int end) const { return part(begin, end, thread); }
  int to(int begin, int end) const { return part(begin, end, thread + 1); }
  int part(int begin, int end, int k) const {
    return begin + static_cast<int>(static_cast<long long>(end - begin) * k / threads);
  }
};

// The status of all is that of the worst island.
int severity(Status s) {
  switch (s) {
    case Status::solved:
      return 0;
    case Status::work_limit:
      return 1;
    case Status::stalled:
      return 2;
    case Status::cycling:
      return 3;
    default:
      return 4;
  }
}

void check(const BodyOptions& o) {
  using detail::require;
  require(o.tolerance > 0 && std::isfinite(o.tolerance), "tolerance", o.tolerance,
          "must be finite and > 0");
  require(o.max_sweeps >= 1, "max_sweeps", o.max_sweeps, "must be >= 1");
  require(o.min_sweeps >= 0, "min_sweeps", o.min_sweeps, "must be >= 0");
  require(o.threads >= 1 && o.threads <= 256, "threads", o.threads, "must lie in 1 .. 256");
  require(o.max_assembled >= 0, "max_assembled", o.max_assembled, "must be >= 0");
  require(o.max_work > 0, "max_work", o.max_work, "must be > 0");
}

}  // namespace

struct BodySolver::Implementation {
  BodyOptions options;
  detail::WorkerTeam threads_;
  detail::ContactGraph graph;
  detail::ImpulseMemory memory;
  std::vector<std::unique_ptr<Worker>> workers;

  // The present problem; the caller's.
  const std::vector<RigidBody>* bodies = nullptr;
  const std::vector<PointContact>* contacts = nullptr;
  BodySolution* out = nullptr;

  // For each contact.
  std::vector<int> first, second;  // moving bodies; second -1: fixed
  std::vector<Kind> kind;
  std::vector<char> turned;            // first and second of the caller exchanged
  std::vector<const Vector3d*> start;  // impulse of the previous solve
  std::vector<GeneralGroup> general4;
  std::vector<SphereGroup> spheres4;
  std::vector<GeneralContact> general;
  std::vector<SphereContact> spheres;
  std::vector<SmoothContact> smooth;
  // For each body, slot, chunk, island.
  std::vector<char> body_kind;
  std::vector<int> fixed_slot;  // 0: at rest, as the world
  std::vector<BodyState> fixed;
  std::vector<BodyState> state;
  std::vector<BodyInertia> inertia;
  std::vector<double> chunk_sum[2];  // in turns: a thread may still read those of the last pass
  std::vector<IslandResult> results;
  std::vector<double> previous_impulse, previous_velocity;  // for the momentum

  enum class Pass { pack, sweep, test, unpack };

  void solve(const std::vector<RigidBody>& b, const std::vector<PointContact>& c, BodySolution& o);
  void read_bodies();
  void read_contacts();
  void find_starts();
  void finish();

  void together(int k, const Team& team);
  void alone(int k, Worker& worker);
  void unpack(const Island& island, const Team& team);
  bool assemblable(int k) const {
    return results[at(k)].status != Status::solved &&
           graph.islands[at(k)].contacts <= options.max_assembled;
  }
  void iterate(int k, const Team& team);
  void extrapolate(const Island& island, const Team& team, double beta);
  void assemble(int k, Worker& worker);

  int cut(int begin, int end, int k, int parts) const;
  template <class Operation>
  double pass(const Island& island, const Team& team, int& turn, const Operation& operation);
  template <class Operation>
  double over_kinds(int chunk, const Team& team, const Operation& operation);
  double sweep(int chunk, const Team& team);
  double test(int chunk, const Team& team);
  double pack(int chunk, Worker& worker);
  void unpack(int chunk);
  template <class Visit>
  void visit(int chunk, const Visit& visit);
  double pack_contact(int contact, Kind k, int place);
  GeneralContact general_contact(Kind k, int place) const;
  SphereContact sphere_contact(Kind k, int place) const;
  void put(const GeneralContact& c, Kind k, int place);
  void put(const SphereContact& c, Kind k, int place);
  Vector3d impulse(Kind k, int place) const;
  void set_impulse(Kind k, int place, const Vector3d& p);
  void apply(int contact, const Vector3d& p);
  void load_body(int slot);
};

void BodySolver::Implementation::read_bodies() {
  body_kind.resize(bodies->size());
  fixed_slot.assign(bodies->size(), 0);
  fixed.assign(1, {});
  for (std::size_t k = 0; k < bodies->size(); ++k) {
    const RigidBody& b = (*bodies)[k];
    detail::check(k, b);
    const Matrix3d& I = b.inverse_inertia;
    const bool isotropic = I(0, 1) == 0 && I(0, 2) == 0 && I(1, 2) == 0 && I(1, 0) == 0 &&
                           I(2, 0) == 0 && I(2, 1) == 0 && I(0, 0) == I(1, 1) && I(0, 0) == I(2, 2);
    if (!moves(b) && !(b.velocity.isZero(0) && b.angular_velocity.isZero(0))) {
      fixed_slot[k] = static_cast<int>(fixed.size());
      fixed.push_back({});
      store(b.velocity, fixed.back().v);
      store(b.angular_velocity, fixed.back().w);
    }
    body_kind[k] = static_cast<char>((moves(b) ? 1 : 0) + (isotropic ? 2 : 0));
  }
}

void BodySolver::Implementation::read_contacts() {
  const std::size_t n = contacts->size();
  const int m = static_cast<int>(bodies->size());
  first.resize(n);
  second.resize(n);
  kind.resize(n);
  turned.resize(n);
  // The closed form needs arms along the normal.
  const auto round = [&](int b, const Vector3d& r, const Vector3d& normal) {
    if (b < 0 || !(body_kind[at(b)] & 2)) return b < 0;
    const RigidBody& body = (*bodies)[at(b)];
    // A body that cannot turn has no arm to speak of.
    if (body.inverse_inertia(0, 0) == 0 && body.angular_velocity.isZero(0)) return true;
    const double s = normal.dot(r);
    return (r - s * normal).squaredNorm() <= 1e-28 * r.squaredNorm();
  };
  for (std::size_t i = 0; i < n; ++i) {
    const PointContact& c = (*contacts)[i];
    detail::check(i, c, m);
    const bool a = body_kind[at(c.first)] & 1, b = c.second >= 0 && body_kind[at(c.second)] & 1;
    if (!a && !b)
      throw std::invalid_argument("contact " + std::to_string(i) +
                                  " joins fixed bodies: one of the two must be able to move");
    turned[i] = !a;
    first[i] = a ? c.first : c.second;
    second[i] = a && b ? c.second : -1;
    kind[i] = options.law == Law::frictionless || c.mu == 0                       ? Kind::smooth
              : round(c.first, c.r1, c.normal) && round(c.second, c.r2, c.normal) ? Kind::sphere
                                                                                  : Kind::general;
  }
}

void BodySolver::Implementation::find_starts() {
  out->warm_started = 0;
  if (!options.warm_start || memory.empty()) return start.clear();
  start.resize(contacts->size());  // cleared before, it would grow without reserve
  memory.rewind();
  for (std::size_t i = 0; i < contacts->size(); ++i) {
    start[i] = memory.find((*contacts)[i].id);
    out->warm_started += start[i] != nullptr;
  }
}

void BodySolver::Implementation::load_body(int slot) {
  const RigidBody& b = (*bodies)[at(graph.body[at(slot)])];
  const Matrix3d& I = b.inverse_inertia;
  BodyState& s = state[at(slot)];
  store(b.velocity, s.v);
  store(b.angular_velocity, s.w);
  s.m = b.inverse_mass;
  s.i = I(0, 0);
  inertia[at(slot)] = {I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2), I(2, 2), {0, 0}};
}

// visit(contact, kind, place among the contacts of this kind)
template <class Visit>
void BodySolver::Implementation::visit(int chunk, const Visit& visit) {
  const Chunk &c = graph.chunks[at(chunk)], &next = graph.chunks[at(chunk + 1)];
  int place = c.place;
  for (int k = 0; k < detail::kKinds; ++k) {
    for (int i = c.begin[k]; i < next.begin[k]; ++i) {
      visit(graph.order[at(place++)], static_cast<Kind>(k), i);
    }
  }
}

// Returns |b|^2 of the contact.
double BodySolver::Implementation::pack_contact(int contact, Kind k, int place) {
  const PointContact& c = (*contacts)[at(contact)];
  const Side s = side(*bodies, c, turned[at(contact)] != 0);
  const int a = graph.slot[at(first[at(contact)])];
  const int partner = turned[at(contact)] ? c.first : c.second;
  const int b = second[at(contact)] >= 0 ? graph.slot[at(second[at(contact)])]
                : partner < 0            ? -1
                                         : -1 - fixed_slot[at(partner)];
  const Vector3d before = velocity_before(s, c.bias);
  const double mass = s.first->inverse_mass + (s.second ? s.second->inverse_mass : 0);
  switch (k) {
    case Kind::sphere:
    case Kind::sphere4: {
      const double s1 = s.n.dot(s.r1), s2 = s.n.dot(s.r2);
      double t = mass + s1 * s1 * s.first->inverse_inertia(0, 0);
      if (s.second) t += s2 * s2 * s.second->inverse_inertia(0, 0);
      if (!(mass > 0)) throw std::invalid_argument("the bodies cannot move along the normal");
      SphereContact p = {};
      p.first = a;
      p.second = b;
      store(s.n, p.n);
      p.s1 = s1;
      p.s2 = s2;
      p.inv_a = 1 / mass;
      p.inv_t = 1 / t;
      p.mu = c.mu;
      p.bias = c.bias;
      put(p, k, place);
      break;
    }
    case Kind::smooth: {
      SmoothContact& p = smooth[at(place)];
      p.first = a;
      p.second = b;
      const Vector3d q1 = s.r1.cross(s.n), q2 = s.r2.cross(s.n);
      const Vector3d column = diagonal_block(s) * s.n;
      const double D = column.dot(s.n);
      if (!(D > 0)) throw std::invalid_argument("the bodies cannot move along the normal");
      store(s.n, p.n);
      store(q1, p.q1);
      store(q2, p.q2);
      p.inv_a = 1 / D;
      p.weight = column.norm();
      p.bias = c.bias;
      break;
    }
    case Kind::general:
    case Kind::general4: {
      const Matrix3d F = tangent_frame(s.n);
      const LocalBlock L(F * diagonal_block(s) * F.transpose(), c.mu);
      // Tangents turned by V, in which the tangential block is diagonal.
      const Vector3d t = L.cosine * F.row(1) + L.sine * F.row(2);
      GeneralContact p = {};
      p.first = a;
      p.second = b;
      store(s.n, p.n);
      store(t, p.t);
      store(s.r1, p.r1);
      store(s.r2, p.r2);
      p.a = L.a;
      p.inv_a = L.inv_a;
      p.mu = L.mu;
      p.c[0] = L.cosine * L.c[0] + L.sine * L.c[1];
      p.c[1] = L.cosine * L.c[1] - L.sine * L.c[0];
      p.beta[0] = L.beta[0];
      p.beta[1] = L.beta[1];
      p.bias = c.bias;
      p.lambda = -1;
      put(p, k, place);
      break;
    }
  }
  Vector3d p = Vector3d::Zero();
  if (!start.empty() && start[at(contact)]) {
    p = on_cone(s.sign * *start[at(contact)], s.n, k == Kind::smooth ? 0 : c.mu);
  }
  set_impulse(k, place, p);
  if (!p.isZero(0)) apply(contact, p);
  return before.squaredNorm();
}

GeneralContact BodySolver::Implementation::general_contact(Kind k, int place) const {
  if (k == Kind::general) return general[at(place)];
  return from_lane<GeneralContact>(general4[at(place / 4)], place % 4);
}
SphereContact BodySolver::Implementation::sphere_contact(Kind k, int place) const {
  if (k == Kind::sphere) return spheres[at(place)];
  return from_lane<SphereContact>(spheres4[at(place / 4)], place % 4);
}
void BodySolver::Implementation::put(const GeneralContact& c, Kind k, int place) {
  if (k == Kind::general) {
    general[at(place)] = c;
  } else {
    to_lane(c, general4[at(place / 4)], place % 4);
  }
}
void BodySolver::Implementation::put(const SphereContact& c, Kind k, int place) {
  if (k == Kind::sphere) {
    spheres[at(place)] = c;
  } else {
    to_lane(c, spheres4[at(place / 4)], place % 4);
  }
}

// In world axes, on the moving body `first`.
Vector3d BodySolver::Implementation::impulse(Kind k, int place) const {
  if (k == Kind::smooth) return smooth[at(place)].x * load(smooth[at(place)].n);
  if (k == Kind::sphere || k == Kind::sphere4) return load(sphere_contact(k, place).p);
  const GeneralContact c = general_contact(k, place);
  const Vector3d n = load(c.n), t = load(c.t);
  return c.x[0] * n + c.x[1] * t + c.x[2] * n.cross(t);
}

void BodySolver::Implementation::set_impulse(Kind k, int place, const Vector3d& p) {
  if (k == Kind::smooth) {
    smooth[at(place)].x = p.dot(load(smooth[at(place)].n));
  } else if (k == Kind::sphere || k == Kind::sphere4) {
    SphereContact c = sphere_contact(k, place);
    store(p, c.p);
    put(c, k, place);
  } else {
    GeneralContact c = general_contact(k, place);
    const Vector3d n = load(c.n), t = load(c.t);
    store({p.dot(n), p.dot(t), p.dot(n.cross(t))}, c.x);
    put(c, k, place);
  }
}

void BodySolver::Implementation::apply(int contact, const Vector3d& p) {
  const PointContact& c = (*contacts)[at(contact)];
  const bool t = turned[at(contact)] != 0;
  const Vector3d q = (t ? c.r2 : c.r1).cross(p);
  const int a = graph.slot[at(first[at(contact)])];
  detail::push(state[at(a)], inertia[at(a)], p.data(), q.data());
  if (second[at(contact)] < 0) return;
  const int b = graph.slot[at(second[at(contact)])];
  const Vector3d minus = -p, r = c.r2.cross(minus);
  detail::push(state[at(b)], inertia[at(b)], minus.data(), r.data());
}

double BodySolver::Implementation::pack(int chunk, Worker& worker) {
  double sum = 0;
  visit(chunk, [&](int contact, Kind k, int place) {
    // Other threads wait at the next barrier: a failure is reported after the run.
    try {
      sum += pack_contact(contact, k, place);
    } catch (const std::invalid_argument& e) {
      if (contact >= worker.bad_contact) return;
      worker.bad_contact = contact;
      worker.bad_reason = e.what();
    }
  });
  return sum;
}

void BodySolver::Implementation::unpack(int chunk) {
  visit(chunk, [&](int contact, Kind k, int place) {
    const PointContact& c = (*contacts)[at(contact)];
    const Vector3d p = impulse(k, place);
    out->impulses[at(contact)] = turned[at(contact)] ? Vector3d(-p) : p;
    const Vector3d n = turned[at(contact)] ? Vector3d(-c.normal) : c.normal;
    const double xn = p.dot(n), tt = (p - xn * n).squaredNorm();
    const double most = k == Kind::smooth ? 0 : c.mu * xn;
    out->regimes[at(contact)] = !(xn > 0)                        ? Regime::separating
                                : tt >= most * most * (1 - 1e-9) ? Regime::sliding
                                                                 : Regime::sticking;
  });
}

template <class Operation>
double BodySolver::Implementation::over_kinds(int chunk, const Team& team,
                                              const Operation& operation) {
  const BodyArrays s{state.data(), inertia.data(), fixed.data(), &team.worker->nowhere,
                     &kNoInertia};
  const auto &from = graph.chunks[at(chunk)].begin, &to = graph.chunks[at(chunk + 1)].begin;
  double sum = 0;
  const auto kind_range = [&](auto& list, Kind k, int width) {
    const int begin = from[static_cast<int>(k)] / width, end = to[static_cast<int>(k)] / width;
    if (begin < end) sum += operation(s, list.data() + begin, list.data() + end);
  };
  kind_range(general4, Kind::general4, 4);
  kind_range(spheres4, Kind::sphere4, 4);
  kind_range(general, Kind::general, 1);
  kind_range(spheres, Kind::sphere, 1);
  kind_range(smooth, Kind::smooth, 1);
  return sum;
}

double BodySolver::Implementation::sweep(int chunk, const Team& team) {
  return over_kinds(chunk, team, [&](const BodyArrays& s, auto* begin, auto* end) {
    return detail::sweep(s, options.law, begin, end);
  });
}

double BodySolver::Implementation::test(int chunk, const Team& team) {
  return over_kinds(chunk, team, [&](const BodyArrays& s, auto* begin, auto* end) {
    return detail::test(s, options.law, begin, end);
  });
}

// The first chunk of part k of `parts` with about the same number of contacts.
int BodySolver::Implementation::cut(int begin, int end, int k, int parts) const {
  if (k == 0) return begin;
  if (k == parts) return end;
  const Chunk* chunks = graph.chunks.data();
  const long long first_place = chunks[begin].place;
  const long long place = first_place + (chunks[end].place - first_place) * k / parts;
  const Chunk* c = std::partition_point(chunks + begin, chunks + end, [&](const Chunk& chunk) {
    return static_cast<long long>(chunk.place) + (&chunk)[1].place < 2 * place;
  });
  return static_cast<int>(c - chunks);
}

// operation(chunk) for all chunks of the island, colour by colour; the sum of what it returns, in
// an order that no thread count changes.
template <class Operation>
double BodySolver::Implementation::pass(const Island& island, const Team& team, int& turn,
                                        const Operation& operation) {
  turn = 1 - turn;
  std::vector<double>& sums = chunk_sum[turn];
  for (int k = island.colour_begin; k < island.colour_end; ++k) {
    const int begin =
        cut(graph.colours[at(k)], graph.colours[at(k + 1)], team.thread, team.threads);
    const int end =
        cut(graph.colours[at(k)], graph.colours[at(k + 1)], team.thread + 1, team.threads);
    for (int c = begin; c < end; ++c) sums[at(c)] = operation(c);
    team.meet();
  }
  double sum = 0;
  for (int c = island.chunk_begin; c < island.chunk_end; ++c) sum += sums[at(c)];
  return sum;
}

// x <- x + beta (x - previous x) and the same for the velocities, which follow x linearly.
void BodySolver::Implementation::extrapolate(const Island& island, const Team& team, double beta) {
  const auto move = [beta](double& x, double& previous) {
    const double now = x;
    x += beta * (now - previous);
    previous = now;
  };
  const int begin = team.from(island.chunk_begin, island.chunk_end);
  const int end = team.to(island.chunk_begin, island.chunk_end);
  for (int chunk = begin; chunk < end; ++chunk) {
    double* previous = previous_impulse.data() + 3 * at(graph.chunks[at(chunk)].place);
    const auto &from = graph.chunks[at(chunk)].begin, &to = graph.chunks[at(chunk + 1)].begin;
    const auto over = [&](auto& list, Kind k, int width, auto&& impulses) {
      const int last = to[static_cast<int>(k)] / width;
      for (int i = from[static_cast<int>(k)] / width; i < last; ++i) {
        double* x = impulses(list[at(i)]);
        for (int c = 0; c < 3 * width; ++c) move(x[c], *previous++);
      }
    };
    over(general4, Kind::general4, 4, [](GeneralGroup& g) { return &g.x[0][0]; });
    over(spheres4, Kind::sphere4, 4, [](SphereGroup& g) { return &g.p[0][0]; });
    over(general, Kind::general, 1, [](GeneralContact& c) { return c.x; });
    over(spheres, Kind::sphere, 1, [](SphereContact& c) { return c.p; });
    const int last = to[static_cast<int>(Kind::smooth)];
    for (int i = from[static_cast<int>(Kind::smooth)]; i < last; ++i) {
      move(smooth[at(i)].x, *previous++);
    }
  }
  const int bodies_end = team.to(island.body_begin, island.body_end);
  for (int i = team.from(island.body_begin, island.body_end); i < bodies_end; ++i) {
    double* previous = previous_velocity.data() + 6 * at(i);
    for (int c = 0; c < 3; ++c) {
      move(state[at(i)].v[c], previous[c]);
      move(state[at(i)].w[c], previous[3 + c]);
    }
  }
  team.meet();
}

// Nesterov's momentum on the sweeps. A sweep is no gradient step, but the same rule serves: where a
// sweep changes more than the one before, the momentum is dropped and its growth set back by half.
// Where contacts toggle between stick and slip that happens all the time: as long as it does not
// get on, a little more change is allowed in every other window.
class Momentum {
 public:
  void start() { on_ = true; }
  bool on() const { return on_; }
  // beta, given the sum of squares that the last sweep changed.
  double next(double change) {
    best_ = std::min(best_, change);
    if (++count_ == window_end_) look_back();
    const double grown = 0.5 * (1 + std::sqrt(1 + 4 * t_ * t_));
    double beta = (t_ - 1) / grown;
    if (change > allowed_ * last_) {
      t_ = std::max(1.0, 0.5 * t_);
      beta = 0;
    } else {
      t_ = grown;
    }
    last_ = change;
    return beta;
  }

 private:
  static constexpr double kNone = std::numeric_limits<double>::infinity();

  void look_back() {
    if (best_ > 0.25 * best_before_) {  // of squares: not halved
      allowed_ = allowed_ > 1 ? 1 : 1.2;
      t_ = 1;
      last_ = kNone;
    }
    best_before_ = best_;
    window_ += window_ / 2;
    window_end_ = count_ + window_;
  }

  bool on_ = false;
  double t_ = 1, last_ = kNone, allowed_ = 1, best_ = kNone, best_before_ = kNone;
  int count_ = 0, window_ = 100, window_end_ = 100;
};

// Sweeps until the island is solved, max_sweeps are reached, or it should be assembled.
void BodySolver::Implementation::iterate(int k, const Team& team) {
  const Island& island = graph.islands[at(k)];
  const bool small = island.contacts <= options.max_assembled;
  int turn = 0;
  IslandResult r;
  r.norm = std::sqrt(pass(island, team, turn, [&](int c) { return pack(c, *team.worker); }));
  const double norm = r.norm > 0 ? r.norm : 1;
  const double bound = options.tolerance * options.tolerance * norm * norm;
  double earlier = std::numeric_limits<double>::infinity();  // at the last forecast
  int forecast = kFirstForecast, failed_tests = 0;
  int next_test = island.contacts > kFew ? options.min_sweeps : 0;
  Momentum momentum;
  for (;;) {
    const double sum = pass(island, team, turn, [&](int c) { return sweep(c, team); });
    ++r.sweeps;
    const bool last = r.sweeps >= options.max_sweeps;
    // What a sweep changes is close to the residual, which costs another pass.
    if ((sum <= bound && r.sweeps >= next_test) || island.contacts == 1 || last) {
      const double residual = pass(island, team, turn, [&](int c) { return test(c, team); });
      r.error = std::sqrt(residual) / norm;
      if (residual <= bound) {
        r.status = Status::solved;
        break;
      }
      next_test = r.sweeps + ++failed_tests;
    }
    if (last) {
      r.status = sum > 0.998 * earlier ? Status::cycling : Status::work_limit;
      break;
    }
    if (r.sweeps == forecast) {
      // Linear convergence as since half as many sweeps: how many more?
      const double rate = std::log(sum / earlier) / (0.5 * r.sweeps);
      const double more =
          rate < 0 ? std::log(bound / sum) / rate : std::numeric_limits<double>::infinity();
      if (r.sweeps > kFirstForecast) {
        const bool tried = r.sweeps >= island.contacts && momentum.on();
        if (small && tried && more > kPatience * island.contacts) break;
        if (more > kSlow && !momentum.on()) momentum.start();
      }
      earlier = sum;
      forecast *= 2;
    }
    if (momentum.on()) extrapolate(island, team, momentum.next(sum));
  }
  if (team.thread == 0) results[at(k)] = r;
}

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
      const Side s = side(*bodies, c, turned[at(contact)] != 0);
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
  worker.solver = std::make_unique<Solver>(o);
  worker.solution = worker.solver->solve(problem, x);
  r.status = worker.solution.status;
  r.error = worker.solution.error;

  // Back to the bodies.
  for (int s = island.body_begin; s < island.body_end; ++s) load_body(s);
  int i = 0;
  double residual = 0;
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
  for (int c = island.chunk_begin; c < island.chunk_end; ++c) residual += test(c, one);
  r.error = std::sqrt(residual) / (r.norm > 0 ? r.norm : 1);
  if (r.error <= options.tolerance) {
    r.status = Status::solved;
  } else if (r.status == Status::solved) {
    r.status = Status::stalled;
  }
}

void BodySolver::Implementation::unpack(const Island& island, const Team& team) {
  int turn = 0;
  pass(island, team, turn, [&](int chunk) { return unpack(chunk), 0.0; });
  const int begin = island.body_begin, end = island.body_end;
  for (int s = team.from(begin, end); s < team.to(begin, end); ++s) {
    const int b = graph.body[at(s)];
    out->velocities[at(b)] = load(state[at(s)].v);
    out->angular_velocities[at(b)] = load(state[at(s)].w);
  }
}

// A large island by all threads; what has to be assembled is left to alone().
void BodySolver::Implementation::together(int k, const Team& team) {
  const Island& island = graph.islands[at(k)];
  const int begin = island.body_begin, end = island.body_end;
  team.worker->nowhere = {};
  for (int s = team.from(begin, end); s < team.to(begin, end); ++s) load_body(s);
  team.meet();
  iterate(k, team);
  team.meet();
  if (!assemblable(k)) unpack(island, team);
}

void BodySolver::Implementation::alone(int k, Worker& worker) {
  const Island& island = graph.islands[at(k)];
  const Team team{0, 1, nullptr, &worker};
  worker.nowhere = {};
  if (results[at(k)].sweeps == 0) {
    for (int s = island.body_begin; s < island.body_end; ++s) load_body(s);
    iterate(k, team);
  }
  if (assemblable(k)) assemble(k, worker);
  unpack(island, team);
}

void BodySolver::Implementation::solve(const std::vector<RigidBody>& b,
                                       const std::vector<PointContact>& c, BodySolution& o) {
  bodies = &b;
  contacts = &c;
  out = &o;
  read_bodies();
  read_contacts();
  find_starts();
  graph.build(static_cast<int>(b.size()), first, second, kind, detail::groups_are_served());

  const Chunk& end = graph.chunks.back();
  const auto total = [&](Kind k) { return at(end.begin[static_cast<int>(k)]); };
  general4.resize(total(Kind::general4) / 4);
  spheres4.resize(total(Kind::sphere4) / 4);
  general.resize(total(Kind::general));
  spheres.resize(total(Kind::sphere));
  smooth.resize(total(Kind::smooth));
  state.resize(graph.body.size());
  inertia.resize(graph.body.size());
  for (std::vector<double>& sums : chunk_sum) sums.resize(graph.chunks.size());
  results.resize(graph.islands.size());  // assign() would grow without reserve
  std::fill(results.begin(), results.end(), IslandResult{});
  previous_impulse.resize(3 * c.size());
  previous_velocity.resize(6 * graph.body.size());
  o.impulses.resize(c.size());
  o.regimes.resize(c.size());
  o.velocities.resize(b.size());
  o.angular_velocities.resize(b.size());

  // Few contacts are not worth waking a thread; the bits are the same.
  const int threads = c.size() < at(kTogether) ? 1 : options.threads;
  while (static_cast<int>(workers.size()) < threads) workers.push_back(std::make_unique<Worker>());
  for (auto& worker : workers) {
    worker->replaced.clear();
    worker->failure = nullptr;
    worker->bad_contact = std::numeric_limits<int>::max();
  }
  const int islands = static_cast<int>(graph.islands.size());
  const auto large = [&](int k) {
    return threads > 1 && graph.islands[at(k)].contacts >= kTogether;
  };
  std::atomic<int> next{0};
  auto work = [&](int thread) {
    Worker& worker = *workers[at(thread)];
    const Team all{thread, threads, &threads_.barrier, &worker};
    for (int k = 0; k < islands; ++k) {
      if (large(k)) together(k, all);
    }
    all.meet();
    // The others one by one, whoever is free.
    constexpr int kBatch = 16;
    try {
      for (int k = next.fetch_add(kBatch); k < islands; k = next.fetch_add(kBatch)) {
        for (int i = k; i < std::min(k + kBatch, islands); ++i) {
          if (!large(i) || assemblable(i)) alone(i, worker);
        }
      }
    } catch (...) {
      worker.failure = std::current_exception();
    }
  };
  threads_.run(threads, work);
  finish();
}

// Everything that is about more than one island.
void BodySolver::Implementation::finish() {
  int bad = std::numeric_limits<int>::max();
  const Worker* by = nullptr;
  for (const auto& worker : workers) {
    if (worker->bad_contact >= bad) continue;
    bad = worker->bad_contact;
    by = worker.get();
  }
  if (by) throw std::invalid_argument("contact " + std::to_string(bad) + ": " + by->bad_reason);
  for (const auto& worker : workers) {
    if (worker->failure) std::rethrow_exception(worker->failure);
  }

  for (std::size_t k = 0; k < bodies->size(); ++k) {
    if (graph.slot[k] >= 0) continue;
    out->velocities[k] = (*bodies)[k].velocity;
    out->angular_velocities[k] = (*bodies)[k].angular_velocity;
  }
  out->status = Status::solved;
  out->error = 0;
  out->sweeps = out->colours = out->assembled_islands = out->failed_islands = 0;
  out->islands = static_cast<int>(results.size());
  for (std::size_t k = 0; k < results.size(); ++k) {
    const IslandResult& r = results[k];
    out->error = std::max(out->error, r.error);
    out->sweeps = std::max(out->sweeps, r.sweeps);
    out->colours =
        std::max(out->colours, graph.islands[k].colour_end - graph.islands[k].colour_begin);
    out->assembled_islands += r.assembled;
    if (r.status == Status::solved) continue;
    ++out->failed_islands;
    if (severity(r.status) > severity(out->status)) out->status = r.status;
  }
  out->replaced.clear();
  for (const auto& worker : workers) {
    out->replaced.insert(out->replaced.end(), worker->replaced.begin(), worker->replaced.end());
  }
  std::sort(out->replaced.begin(), out->replaced.end());
  out->spheres = general.empty() && general4.empty();

  if (options.warm_start) {
    memory.clear();
    for (std::size_t i = 0; i < contacts->size(); ++i)
      memory.add((*contacts)[i].id, out->impulses[i]);
  }
  const auto bytes = [](const auto&... list) {
    return (... + (list.capacity() * sizeof(list[0])));
  };
  out->bytes = graph.contact_bytes() + memory.bytes() +
               bytes(first, second, kind, turned, start, general4, spheres4, general, spheres,
                     smooth, chunk_sum[0], chunk_sum[1], results, previous_impulse);
  out->body_bytes =
      graph.body_bytes() + bytes(body_kind, state, inertia, fixed_slot, fixed, previous_velocity);
}

BodySolver::BodySolver(const BodyOptions& options) : implementation_(new Implementation) {
  set_options(options);
}
BodySolver::~BodySolver() = default;
BodySolver::BodySolver(BodySolver&&) noexcept = default;
BodySolver& BodySolver::operator=(BodySolver&&) noexcept = default;

const BodyOptions& BodySolver::options() const { return implementation_->options; }
void BodySolver::set_options(const BodyOptions& options) {
  check(options);
  implementation_->options = options;
}
void BodySolver::scale_warm_start(double factor) {
  if (!(factor >= 0) || !std::isfinite(factor)) {
    detail::refuse("factor", factor, "must be finite and >= 0");
  }
  implementation_->memory.scale(factor);
}
void BodySolver::forget() { implementation_->memory.clear(); }

BodySolution BodySolver::solve(const std::vector<RigidBody>& bodies,
                               const std::vector<PointContact>& contacts) {
  BodySolution out;
  solve(bodies, contacts, out);
  return out;
}

void BodySolver::solve(const std::vector<RigidBody>& bodies,
                       const std::vector<PointContact>& contacts, BodySolution& solution) {
  implementation_->solve(bodies, contacts, solution);
}

std::vector<Body> to_bodies(const std::vector<RigidBody>& bodies) {
  std::vector<Body> out(bodies.size());
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    out[k].inverse_mass.topLeftCorner<3, 3>() =
        bodies[k].inverse_mass * Eigen::Matrix3d::Identity();
    out[k].inverse_mass.bottomRightCorner<3, 3>() = bodies[k].inverse_inertia;
    out[k].velocity << bodies[k].velocity, bodies[k].angular_velocity;
  }
  return out;
}

std::vector<BodyContact> to_contacts(const std::vector<PointContact>& contacts) {
  std::vector<BodyContact> out;
  for (const PointContact& c : contacts) {
    out.push_back(BodyContact::at_point(c.first, c.second, c.r1, c.r2, c.normal, c.mu));
    out.back().bias[0] = c.bias;
  }
  return out;
}

}  // namespace tether::contact

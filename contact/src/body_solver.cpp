// Tether: sweeps on the velocities of bodies. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/body_solver.hpp>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <thread>

#include "impulse_memory.hpp"
#include "law_coulomb.hpp"
#include "law_frictionless.hpp"
#include "law_maximum_dissipation.hpp"
#include "system.hpp"

namespace tether::contact {
namespace {

using detail::at;

struct alignas(64) State {  // linear and angular velocity
  double v[3], pad, w[3], pad2;
};
struct alignas(64) Inertia {  // 1/m and the inverse inertia (symmetric)
  double m, xx, xy, xz, yy, yz, zz, pad;
};

// Tangents such that the tangential block is diagonal: no rotation in the sweep.
struct Packed {
  int first, second;
  double n[3], t[3], r1[3], r2[3];
  double a, inv_a, e, mu, c[2], g[2], beta[2];
  double bias, x[3], lambda;
};
static_assert(sizeof(Packed) <= 256, "a contact is promised to take at most 256 bytes");

// Contacts without coupling (spheres): r1 = s1 n, r2 = s2 n; impulse p in world axes.
struct PackedSphere {
  int first, second;
  double n[3], s1, s2, inv_a, inv_t, mu, bias, p[3];
};

constexpr int kChunk = 256;  // contacts summed together; fixes the order of sums

struct Arrays {
  State* state;
  const Inertia* inertia;
};

TETHER_INLINE void push(State& s, const Inertia& I, const double* p, const double* q) {
  // v += p / m, w += I^-1 q
  for (int k = 0; k < 3; ++k) s.v[k] += I.m * p[k];
  s.w[0] += I.xx * q[0] + I.xy * q[1] + I.xz * q[2];
  s.w[1] += I.xy * q[0] + I.yy * q[1] + I.yz * q[2];
  s.w[2] += I.xz * q[0] + I.yz * q[1] + I.zz * q[2];
}

Eigen::Matrix3d skew(const Eigen::Vector3d& r) {
  Eigen::Matrix3d X;
  X << 0, -r[2], r[1], r[2], 0, -r[0], -r[1], r[0], 0;
  return X;
}

// Diagonal block of A in world axes.
Eigen::Matrix3d local_matrix(const RigidBody& A, const RigidBody& B, const Eigen::Vector3d& r1,
                             const Eigen::Vector3d& r2) {
  const Eigen::Matrix3d X1 = skew(r1), X2 = skew(r2);
  return (A.inverse_mass + B.inverse_mass) * Eigen::Matrix3d::Identity() -
         X1 * A.inverse_inertia * X1 - X2 * B.inverse_inertia * X2;
}

TETHER_INLINE void cross(const double* a, const double* b, double* c) {
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

// One pass over contacts [begin, end); returns sum |D dx|^2. Test: nothing is changed.
template <class L0, bool kTest>
TETHER_INLINE double pass(const Arrays& s, Packed* contacts, int begin, int end) {
  double sum = 0;
  int count = 0;
  for (int i = begin; i < end; ++i) {
    Packed& c = contacts[i];
    State& A = s.state[c.first];
    State& B = s.state[c.second];
    double u[3], a1[3], a2[3];
    cross(A.w, c.r1, a1);
    cross(B.w, c.r2, a2);
    for (int k = 0; k < 3; ++k) u[k] = A.v[k] - B.v[k] + a1[k] - a2[k];
    double o[3];
    cross(c.n, c.t, o);
    const double w0 = u[0] * c.n[0] + u[1] * c.n[1] + u[2] * c.n[2] + c.bias;
    const double w1 = u[0] * c.t[0] + u[1] * c.t[1] + u[2] * c.t[2];
    const double w2 = u[0] * o[0] + u[1] * o[1] + u[2] * o[2];
    LocalBlock L;
    L.a = c.a;
    L.inv_a = c.inv_a;
    L.mu = c.mu;
    L.c[0] = c.c[0];
    L.c[1] = c.c[1];
    L.g[0] = c.g[0];
    L.g[1] = c.g[1];
    L.beta[0] = c.beta[0];
    L.beta[1] = c.beta[1];
    L.cosine = 1;
    L.sine = 0;
    L.e = c.e;
    L.unique = false;
    // D x with T = diag(beta) + c c'/a
    const double cx = c.c[0] * c.x[1] + c.c[1] * c.x[2], dn = c.a * c.x[0] + cx, f = dn * L.inv_a;
    double x[3] = {c.x[0], c.x[1], c.x[2]}, lambda = c.lambda;
    L0::solve(L, dn - w0, c.c[0] * f + c.beta[0] * c.x[1] - w1,
              c.c[1] * f + c.beta[1] * c.x[2] - w2, x, lambda, count);
    const double d0 = x[0] - c.x[0], d1 = x[1] - c.x[1], d2 = x[2] - c.x[2];
    const double e0 = c.a * d0 + c.c[0] * d1 + c.c[1] * d2, ef = e0 * L.inv_a;
    const double e1 = c.c[0] * ef + c.beta[0] * d1, e2 = c.c[1] * ef + c.beta[1] * d2;
    sum += e0 * e0 + e1 * e1 + e2 * e2;
    if (!kTest) {
      double p[3], q[3];
      for (int k = 0; k < 3; ++k) p[k] = d0 * c.n[k] + d1 * c.t[k] + d2 * o[k];
      c.x[0] = x[0];
      c.x[1] = x[1];
      c.x[2] = x[2];
      c.lambda = lambda;
      cross(c.r1, p, q);
      push(A, s.inertia[c.first], p, q);
      for (int k = 0; k < 3; ++k) p[k] = -p[k];
      cross(c.r2, p, q);
      push(B, s.inertia[c.second], p, q);
    }
  }
  return sum;
}

template <bool kTest>
TETHER_INLINE double pass_spheres(const Arrays& s, PackedSphere* contacts, int begin, int end, bool friction) {
  double sum = 0;
  for (int i = begin; i < end; ++i) {
    PackedSphere& c = contacts[i];
    State& A = s.state[c.first];
    State& B = s.state[c.second];
    // u = v1 - v2 + (s1 w1 - s2 w2) x n
    double w[3], u[3];
    for (int k = 0; k < 3; ++k) w[k] = c.s1 * A.w[k] - c.s2 * B.w[k];
    cross(w, c.n, u);
    for (int k = 0; k < 3; ++k) u[k] += A.v[k] - B.v[k];
    const double un = u[0] * c.n[0] + u[1] * c.n[1] + u[2] * c.n[2];
    const double pn = c.p[0] * c.n[0] + c.p[1] * c.n[1] + c.p[2] * c.n[2];
    double xn = pn - (un + c.bias) * c.inv_a;
    xn = xn > 0 ? xn : 0;
    double t[3], tt = 0;
    for (int k = 0; k < 3; ++k) {
      t[k] = c.p[k] - pn * c.n[k] - (u[k] - un * c.n[k]) * c.inv_t;
      tt += t[k] * t[k];
    }
    const double most = friction ? c.mu * xn : 0;
    const double scale = tt > most * most ? most / std::sqrt(tt) : 1;
    double p[3], dn = 0, dd = 0;
    for (int k = 0; k < 3; ++k) {
      p[k] = xn * c.n[k] + scale * t[k] - c.p[k];
      dn += p[k] * c.n[k];
      dd += p[k] * p[k];
    }
    sum += dn * dn / (c.inv_a * c.inv_a) + (dd - dn * dn) / (c.inv_t * c.inv_t);
    if (!kTest) {
      double q[3], q1[3], q2[3];
      cross(c.n, p, q);
      for (int k = 0; k < 3; ++k) {
        c.p[k] += p[k];
        q1[k] = c.s1 * q[k];
        q2[k] = -c.s2 * q[k];
      }
      // Isotropic inertia: xx is all of it.
      const Inertia& I = s.inertia[c.first];
      const Inertia& J = s.inertia[c.second];
      for (int k = 0; k < 3; ++k) {
        A.v[k] += I.m * p[k];
        A.w[k] += I.xx * q1[k];
        B.v[k] -= J.m * p[k];
        B.w[k] += J.xx * q2[k];
      }
    }
  }
  return sum;
}

using detail::Coulomb;
using detail::Frictionless;
using detail::MaximumDissipation;

TETHER_CLONES double sweep_dissipation(const Arrays& s, Packed* c, int b, int e) { return pass<MaximumDissipation, false>(s, c, b, e); }
TETHER_CLONES double test_dissipation(const Arrays& s, Packed* c, int b, int e) { return pass<MaximumDissipation, true>(s, c, b, e); }
TETHER_CLONES double sweep_coulomb(const Arrays& s, Packed* c, int b, int e) { return pass<Coulomb, false>(s, c, b, e); }
TETHER_CLONES double test_coulomb(const Arrays& s, Packed* c, int b, int e) { return pass<Coulomb, true>(s, c, b, e); }
TETHER_CLONES double sweep_frictionless(const Arrays& s, Packed* c, int b, int e) { return pass<Frictionless, false>(s, c, b, e); }
TETHER_CLONES double test_frictionless(const Arrays& s, Packed* c, int b, int e) { return pass<Frictionless, true>(s, c, b, e); }
TETHER_CLONES double sweep_spheres(const Arrays& s, PackedSphere* c, int b, int e, bool f) { return pass_spheres<false>(s, c, b, e, f); }
TETHER_CLONES double test_spheres(const Arrays& s, PackedSphere* c, int b, int e, bool f) { return pass_spheres<true>(s, c, b, e, f); }

// All threads meet; the last one to come lets the others go.
class Barrier {
 public:
  explicit Barrier(int threads) : threads_(threads) {}
  void wait() {
    if (threads_ == 1) return;
    const int round = round_.load(std::memory_order_acquire);
    if (come_.fetch_add(1, std::memory_order_acq_rel) + 1 == threads_) {
      come_.store(0, std::memory_order_relaxed);
      round_.store(round + 1, std::memory_order_release);
      return;
    }
    for (int spins = 0; round_.load(std::memory_order_acquire) == round; ++spins) {
      if (spins > 4000) std::this_thread::yield();
    }
  }

 private:
  const int threads_;
  std::atomic<int> come_{0}, round_{0};
};

}  // namespace

struct BodySolver::Implementation {
  BodyOptions options;
  std::vector<State> state;
  std::vector<Inertia> inertia;
  std::vector<Packed> packed;
  std::vector<PackedSphere> spheres;
  std::vector<int> order;        // place in the sweep -> contact
  std::vector<int> colour_end;   // in places
  std::vector<double> chunk_sum;
  std::vector<int> chunk_begin;  // first chunk of each colour
  std::vector<char> isotropic;
  std::vector<std::uint64_t> used;
  std::vector<int> chosen;
  detail::ImpulseMemory memory;
  int warm_started = 0;
  bool all_spheres = false;

  void setup(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts);
  void colour(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts);
  double run_chunk(bool test, int begin, int end);
  double sum() const {
    double s = 0;
    for (double v : chunk_sum) s += v;
    return std::sqrt(s);
  }
};

// Greedy: the smallest colour that neither moving body has. Fixed bodies take no part. A body with
// more than 63 contacts fills the colours; the rest goes to colours of one contact each.
void BodySolver::Implementation::colour(const std::vector<RigidBody>& bodies,
                                        const std::vector<PointContact>& contacts) {
  const int n = static_cast<int>(contacts.size());
  used.assign(bodies.size() + 1, 0);
  chosen.resize(at(n));
  int count[64] = {}, place[64];
  const auto moves = [&](int b) {
    return b >= 0 && (bodies[at(b)].inverse_mass > 0 || !bodies[at(b)].inverse_inertia.isZero(0));
  };
  for (int i = 0; i < n; ++i) {
    const PointContact& c = contacts[at(i)];
    std::uint64_t taken = 0;
    if (moves(c.first)) taken |= used[at(c.first)];
    if (moves(c.second)) taken |= used[at(c.second)];
    int colour = 0;
    while (colour < 63 && (taken >> colour & 1)) ++colour;
    chosen[at(i)] = colour;
    ++count[colour];
    if (colour == 63) continue;
    if (moves(c.first)) used[at(c.first)] |= std::uint64_t{1} << colour;
    if (moves(c.second)) used[at(c.second)] |= std::uint64_t{1} << colour;
  }
  colour_end.clear();
  int total = 0;
  for (int k = 0; k < 64; ++k) {
    place[k] = total;
    total += count[k];
    if (k < 63 && count[k] > 0) colour_end.push_back(total);
  }
  for (int k = 0; k < count[63]; ++k) colour_end.push_back(total - count[63] + k + 1);
  order.resize(at(n));
  for (int i = 0; i < n; ++i) order[at(place[chosen[at(i)]]++)] = i;
  chunk_begin.assign(1, 0);
  int begin = 0;
  for (int end : colour_end) {
    chunk_begin.push_back(chunk_begin.back() + (end - begin + kChunk - 1) / kChunk);
    begin = end;
  }
  chunk_sum.assign(at(chunk_begin.back()), 0);
}

void BodySolver::Implementation::setup(const std::vector<RigidBody>& bodies,
                                       const std::vector<PointContact>& contacts) {
  const int n = static_cast<int>(contacts.size()), m = static_cast<int>(bodies.size());
  state.resize(at(m + 1));
  inertia.resize(at(m + 1));
  isotropic.assign(at(m + 1), 1);
  for (int k = 0; k < m; ++k) {
    const RigidBody& b = bodies[at(k)];
    const Eigen::Matrix3d& I = b.inverse_inertia;
    if (!std::isfinite(b.inverse_mass) || b.inverse_mass < 0 || !I.allFinite() ||
        !b.velocity.allFinite() || !b.angular_velocity.allFinite()) {
      throw std::invalid_argument("body " + std::to_string(k) + " has a value that is not finite or a negative mass");
    }
    for (int r = 0; r < 3; ++r) {
      state[at(k)].v[r] = b.velocity[r];
      state[at(k)].w[r] = b.angular_velocity[r];
    }
    inertia[at(k)] = {b.inverse_mass, I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2), I(2, 2), 0};
    isotropic[at(k)] = (I - I(0, 0) * Eigen::Matrix3d::Identity()).isZero(0);
  }
  state[at(m)] = State();  // the world
  for (int r = 0; r < 3; ++r) state[at(m)].v[r] = state[at(m)].w[r] = 0;
  inertia[at(m)] = Inertia{0, 0, 0, 0, 0, 0, 0, 0};
  all_spheres = true;
  for (int i = 0; i < n; ++i) {
    const PointContact& c = contacts[at(i)];
    if (c.first < 0 || c.first >= m || c.second < -1 || c.second >= m || c.first == c.second) {
      throw std::invalid_argument("contact " + std::to_string(i) + " names bodies that do not exist");
    }
    if (!c.r1.allFinite() || !c.r2.allFinite() || !std::isfinite(c.mu) || c.mu < 0 || !std::isfinite(c.bias) ||
        !(std::abs(c.normal.norm() - 1) < 1e-6)) {
      throw std::invalid_argument("contact " + std::to_string(i) + " has a value that is not finite, mu < 0, or a normal that is not a unit vector");
    }
    const auto along = [&](int b, const Eigen::Vector3d& r) {
      if (b < 0 || bodies[at(b)].inverse_inertia.isZero(0)) return true;
      return isotropic[at(b)] && (r - c.normal * c.normal.dot(r)).norm() <= 1e-14 * r.norm();
    };
    all_spheres = all_spheres && along(c.first, c.r1) && along(c.second, c.r2);
  }
  colour(bodies, contacts);
  memory.rewind();
  warm_started = 0;
  // The impulse of the previous solve, on the cone of the present frame, also applied to the bodies.
  const auto start = [&](const PointContact& c, double mu, const auto& set) {
    const Eigen::Vector3d* found = options.warm_start ? memory.find(c.id) : nullptr;
    if (!found) return;
    ++warm_started;
    const double xn = found->dot(c.normal);
    if (!(xn > 0)) return;
    Eigen::Vector3d t = *found - xn * c.normal;
    const double most = options.law == Law::frictionless ? 0 : mu * xn, length = t.norm();
    if (length > most) t *= most / length;
    const Eigen::Vector3d p = xn * c.normal + t, q = -p;
    const Eigen::Vector3d m1 = c.r1.cross(p), m2 = c.r2.cross(q);
    set(p);
    push(state[at(c.first)], inertia[at(c.first)], p.data(), m1.data());
    if (c.second >= 0) push(state[at(c.second)], inertia[at(c.second)], q.data(), m2.data());
  };
  packed.resize(all_spheres ? 0 : at(n));
  spheres.resize(all_spheres ? at(n) : 0);
  for (int k = 0; k < n; ++k) {
    const PointContact& c = contacts[at(order[at(k)])];
    const int second = c.second < 0 ? m : c.second;
    const RigidBody none;
    const RigidBody& A = bodies[at(c.first)];
    const RigidBody& B = c.second < 0 ? none : bodies[at(c.second)];
    const double inverse = A.inverse_mass + B.inverse_mass;
    if (all_spheres) {
      const double s1 = c.normal.dot(c.r1), s2 = c.normal.dot(c.r2);
      const double t = inverse + s1 * s1 * A.inverse_inertia(0, 0) + s2 * s2 * B.inverse_inertia(0, 0);
      if (!(inverse > 0)) throw std::invalid_argument("contact " + std::to_string(order[at(k)]) + " joins fixed bodies");
      PackedSphere& p = spheres[at(k)];
      p = {c.first, second, {c.normal[0], c.normal[1], c.normal[2]}, s1, s2, 1 / inverse, 1 / t, c.mu, c.bias, {0, 0, 0}};
      start(c, p.mu, [&](const Eigen::Vector3d& x) {
        for (int r = 0; r < 3; ++r) p.p[r] = x[r];
      });
      continue;
    }
    const Eigen::Matrix3d W = local_matrix(A, B, c.r1, c.r2);
    const Eigen::Matrix3d F = tangent_frame(c.normal);
    LocalBlock L;
    try {
      L = LocalBlock(F * W * F.transpose(), c.mu);
    } catch (const std::invalid_argument& e) {
      throw std::invalid_argument("contact " + std::to_string(order[at(k)]) + ": " + e.what());
    }
    // Turn the tangents by V.
    const Eigen::Vector3d t = L.cosine * F.row(1) + L.sine * F.row(2);
    Packed& p = packed[at(k)];
    p.first = c.first;
    p.second = second;
    for (int r = 0; r < 3; ++r) {
      p.n[r] = c.normal[r];
      p.t[r] = t[r];
      p.r1[r] = c.r1[r];
      p.r2[r] = c.second < 0 ? 0 : c.r2[r];
      p.x[r] = 0;
    }
    p.a = L.a;
    p.inv_a = L.inv_a;
    p.e = L.e;
    p.mu = L.mu;
    p.c[0] = L.cosine * L.c[0] + L.sine * L.c[1];
    p.c[1] = L.cosine * L.c[1] - L.sine * L.c[0];
    for (int r = 0; r < 2; ++r) {
      p.g[r] = L.g[r];
      p.beta[r] = L.beta[r];
    }
    p.bias = c.bias;
    p.lambda = -1;
    start(c, p.mu, [&](const Eigen::Vector3d& x) {
      p.x[0] = x.dot(c.normal);
      p.x[1] = x.dot(t);
      p.x[2] = x.dot(c.normal.cross(t));
    });
  }
}

double BodySolver::Implementation::run_chunk(bool test, int begin, int end) {
  const Arrays s{state.data(), inertia.data()};
  if (all_spheres) {
    const bool friction = options.law != Law::frictionless;
    return test ? test_spheres(s, spheres.data(), begin, end, friction) : sweep_spheres(s, spheres.data(), begin, end, friction);
  }
  Packed* c = packed.data();
  switch (options.law) {
    case Law::maximum_dissipation: return test ? test_dissipation(s, c, begin, end) : sweep_dissipation(s, c, begin, end);
    case Law::coulomb: return test ? test_coulomb(s, c, begin, end) : sweep_coulomb(s, c, begin, end);
    case Law::frictionless: return test ? test_frictionless(s, c, begin, end) : sweep_frictionless(s, c, begin, end);
  }
  return 0;
}

namespace {

void check(const BodyOptions& o) {
  if (!(o.tolerance > 0)) throw std::invalid_argument("tolerance must be > 0");
  if (o.max_sweeps < 1) throw std::invalid_argument("max_sweeps must be >= 1");
  if (o.threads < 1 || o.threads > 256) {
    throw std::invalid_argument("threads must lie in 1 .. 256");
  }
}

}  // namespace

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
    throw std::invalid_argument("factor must be finite and >= 0");
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
                       const std::vector<PointContact>& contacts, BodySolution& out) {
  Implementation& s = *implementation_;
  s.setup(bodies, contacts);
  out.warm_started = s.warm_started;
  out.colours = static_cast<int>(s.colour_end.size());
  out.spheres = s.all_spheres;
  out.bytes = s.packed.size() * sizeof(Packed) + s.spheres.size() * sizeof(PackedSphere) + s.order.size() * sizeof(int);

  const int threads = s.options.threads;
  Barrier barrier(threads);
  const auto pass = [&](bool test, int thread) {
    int begin = 0;
    for (std::size_t colour = 0; colour < s.colour_end.size(); ++colour) {
      const int end = s.colour_end[colour];
      const int chunks = s.chunk_begin[colour + 1] - s.chunk_begin[colour];
      // Whole runs of chunks for each thread: bodies stay in one cache.
      const int from = static_cast<int>(static_cast<long>(chunks) * thread / threads);
      const int to = static_cast<int>(static_cast<long>(chunks) * (thread + 1) / threads);
      for (int k = from; k < to; ++k) {
        const int b = begin + k * kChunk, e = std::min(end, b + kChunk);
        s.chunk_sum[at(s.chunk_begin[colour] + k)] = s.run_chunk(test, b, e);
      }
      begin = end;
      barrier.wait();
    }
  };
  // |b|: relative velocities before the impulses.
  double norm = 0;
  const auto relative = [&](const PointContact& c) {
    Eigen::Vector3d u = bodies[at(c.first)].velocity + bodies[at(c.first)].angular_velocity.cross(c.r1);
    if (c.second >= 0) u -= bodies[at(c.second)].velocity + bodies[at(c.second)].angular_velocity.cross(c.r2);
    return Eigen::Vector3d(u + c.bias * c.normal);
  };
  for (const PointContact& c : contacts) norm += relative(c).squaredNorm();
  norm = norm > 0 ? std::sqrt(norm) : 1;

  std::atomic<bool> done{false};
  const auto work = [&](int thread) {
    int next_test = 1;
    for (int sweep = 1;; ++sweep) {
      pass(false, thread);
      if (sweep >= next_test || sweep >= s.options.max_sweeps) {
        pass(true, thread);
        if (thread == 0) {
          out.sweeps = sweep;
          out.error = s.sum() / norm;
          out.status = out.error <= s.options.tolerance ? Status::solved : Status::work_limit;
          done.store(out.status == Status::solved || sweep >= s.options.max_sweeps);
        }
        barrier.wait();
        if (done.load()) return;
        next_test = sweep + 4 + sweep / 4;
      }
    }
  };
  std::vector<std::thread> others;
  for (int t = 1; t < threads; ++t) others.emplace_back(work, t);
  work(0);
  for (std::thread& t : others) t.join();

  out.impulses.resize(contacts.size());
  out.regimes.resize(contacts.size());
  const bool friction = s.options.law != Law::frictionless;
  const auto set = [&](std::size_t k, const Eigen::Vector3d& p, double xn, double tt, double mu) {
    const double most = friction ? mu * xn : 0;
    out.impulses[at(s.order[k])] = p;
    out.regimes[at(s.order[k])] = !(xn > 0)                                  ? Regime::separating
                                  : tt >= most * most * (1 - 1e-9) ? Regime::sliding
                                                                             : Regime::sticking;
  };
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    if (s.all_spheres) {
      const PackedSphere& c = s.spheres[k];
      const Eigen::Vector3d n(c.n[0], c.n[1], c.n[2]), p(c.p[0], c.p[1], c.p[2]);
      const double xn = p.dot(n);
      set(k, p, xn, (p - xn * n).squaredNorm(), c.mu);
    } else {
      const Packed& c = s.packed[k];
      const Eigen::Vector3d n(c.n[0], c.n[1], c.n[2]), t(c.t[0], c.t[1], c.t[2]);
      set(k, c.x[0] * n + c.x[1] * t + c.x[2] * n.cross(t), c.x[0],
          c.x[1] * c.x[1] + c.x[2] * c.x[2], c.mu);
    }
  }
  out.velocities.resize(bodies.size());
  out.angular_velocities.resize(bodies.size());
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    out.velocities[k] << s.state[k].v[0], s.state[k].v[1], s.state[k].v[2];
    out.angular_velocities[k] << s.state[k].w[0], s.state[k].w[1], s.state[k].w[2];
  }
  if (s.options.warm_start) {
    s.memory.begin(contacts.size());
    for (std::size_t k = 0; k < contacts.size(); ++k) s.memory.add(contacts[k].id, out.impulses[k]);
  }
}

Residuals evaluate(const std::vector<RigidBody>& bodies, const std::vector<PointContact>& contacts,
                   Law law, const std::vector<Eigen::Vector3d>& impulses) {
  if (impulses.size() != contacts.size()) {
    throw std::invalid_argument("one impulse for each contact is needed");
  }
  const int m = static_cast<int>(bodies.size());
  std::vector<Eigen::Vector3d> v(bodies.size()), w(bodies.size());
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    v[k] = bodies[k].velocity;
    w[k] = bodies[k].angular_velocity;
  }
  const RigidBody none;
  const auto relative = [&](const PointContact& c) {
    Eigen::Vector3d u = v[at(c.first)] + w[at(c.first)].cross(c.r1) + c.bias * c.normal;
    if (c.second >= 0) u -= v[at(c.second)] + w[at(c.second)].cross(c.r2);
    return u;
  };
  double bb = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const PointContact& c = contacts[i];
    if (c.first < 0 || c.first >= m || c.second < -1 || c.second >= m || c.first == c.second) {
      throw std::invalid_argument("contact " + std::to_string(i) + " names bodies that do not exist");
    }
    bb += relative(c).squaredNorm();
  }
  std::vector<Eigen::Vector3d> before;
  for (const PointContact& c : contacts) before.push_back(relative(c));
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const PointContact& c = contacts[i];
    const Eigen::Vector3d& p = impulses[i];
    v[at(c.first)] += bodies[at(c.first)].inverse_mass * p;
    w[at(c.first)] += bodies[at(c.first)].inverse_inertia * c.r1.cross(p);
    if (c.second < 0) continue;
    v[at(c.second)] -= bodies[at(c.second)].inverse_mass * p;
    w[at(c.second)] -= bodies[at(c.second)].inverse_inertia * c.r2.cross(p);
  }
  Residuals r;
  r.signorini = r.cone = r.alignment = r.dissipation = r.energy_change = 0;
  double fixed = 0, map = 0, xx = 0, ww = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const PointContact& c = contacts[i];
    const RigidBody& A = bodies[at(c.first)];
    const RigidBody& B = c.second < 0 ? none : bodies[at(c.second)];
    const Eigen::Matrix3d F = tangent_frame(c.normal);
    const LocalBlock L(F * local_matrix(A, B, c.r1, c.r2) * F.transpose(), c.mu);
    const Eigen::Vector3d x = F * impulses[i], u = F * relative(c);
    const double mu = law == Law::frictionless ? 0 : c.mu, t = x.tail<2>().norm();
    r.signorini = std::max(r.signorini, std::abs(std::min(L.a * x[0], u[0])));
    r.cone = std::max({r.cone, L.a * (t - mu * x[0]), -L.a * x[0]});
    r.dissipation += x.dot(u);
    r.energy_change += 0.5 * x.dot(u + F * before[i]);
    // Block fixed point.
    const Eigen::Matrix3d D = L.matrix();
    LocalState state;
    for (int k = 0; k < 3; ++k) state.x[k] = x[k];
    solve_local(law, L, D * x - u, state);
    fixed += (D * (x - Eigen::Vector3d(state.x[0], state.x[1], state.x[2]))).squaredNorm();
    // Natural map, and the nearest slip that the law allows.
    double gamma[2] = {0, 0};
    if (law == Law::maximum_dissipation) {
      gamma[0] = mu * L.inv_a * L.c[0];
      gamma[1] = mu * L.inv_a * L.c[1];
    }
    Eigen::Vector3d z = x - u;
    if (law == Law::frictionless) {
      z << std::max(z[0], 0.0), 0, 0;
    } else {
      const double slip = detail::slip(u[1], u[2], gamma[0], gamma[1]);
      z -= slip * Eigen::Vector3d(mu, gamma[0], gamma[1]);
      detail::project_cone(mu, z.data());
    }
    map += (x - z).squaredNorm();
    xx += x.squaredNorm();
    ww += u.squaredNorm();
    if (mu == 0 || !(x[0] > 0)) continue;
    double misfit = u.tail<2>().norm();
    if (t > 0 && t >= mu * x[0] * (1 - 1e-9)) {
      const Eigen::Vector2d d = -(x.tail<2>() / t + Eigen::Vector2d(gamma[0], gamma[1]));
      const double dd = d.squaredNorm();
      const double s = dd > 0 ? std::max(0.0, u.tail<2>().dot(d) / dd) : 0;
      misfit = (u.tail<2>() - s * d).norm();
    }
    r.alignment = std::max(r.alignment, misfit);
  }
  const auto over = [](double p, double q) { return q > 0 ? p / q : p; };
  r.fixed_point = over(std::sqrt(fixed), std::sqrt(bb));
  r.natural_map = over(std::sqrt(map), std::sqrt(std::max({bb, xx, ww})));
  r.natural_map_data = over(std::sqrt(map), std::sqrt(bb));
  return r;
}

std::vector<Body> to_bodies(const std::vector<RigidBody>& bodies) {
  std::vector<Body> out(bodies.size());
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    out[k].inverse_mass.topLeftCorner<3, 3>() = bodies[k].inverse_mass * Eigen::Matrix3d::Identity();
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

// Tether: a falling chain of many links, with sparse factors. SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <limits>
#include <map>
#include <numeric>
#include <problems/link_chain.hpp>
#include <problems/linkage.hpp>
#include <problems/reference.hpp>
#include <problems/rows.hpp>
#include <stdexcept>

namespace tether::problems {

namespace {

constexpr double kLength = 0.1, kMass = 0.1;
constexpr std::size_t kMost = 128;

using Real = long double;
using State = std::array<Real, 2 * kMost>;  // angles from the x axis, then rates

struct Pair {
  Real x, y;
};
struct Block {  // symmetric 2 x 2
  Real xx, xy, yy;
};

Pair solve(const Block& A, const Pair& b) {
  const Real det = A.xx * A.yy - A.xy * A.xy;
  return {(A.yy * b.x - A.xy * b.y) / det, (A.xx * b.y - A.xy * b.x) / det};
}

// With h the half rod, u = h turned by 90 degrees and F_i the force of pin i on rod i, the ends of
// neighbours accelerate alike:
//   (U_(i-1) - 1/m) F_(i-1) + (2/m + U_(i-1) + U_i) F_i + (U_i - 1/m) F_(i+1)
//       = -(w_i^2 h_i + w_(i-1)^2 h_(i-1)),        U_i = u_i u_i^T / I,
// the first with 1/m + U_0 alone and -g on the right; then I th_i'' = -u_i . (F_i + F_(i+1)).
class FallingChain {
 public:
  explicit FallingChain(std::size_t links) : links_(links) {}

  void operator()(const State& y, State& dy) {
    const Real half = kLength / 2.0L, mass = kMass, inertia = mass * kLength * kLength / 12.0L;
    std::array<Pair, kMost + 1> right;
    std::array<Block, kMost> U, diagonal;
    for (std::size_t i = 0; i < links_; ++i) {
      h_[i] = {half * std::cos(y[i]), half * std::sin(y[i])};
      U[i] = {h_[i].y * h_[i].y / inertia, -h_[i].x * h_[i].y / inertia,
              h_[i].x * h_[i].x / inertia};
      const Real w2 = y[links_ + i] * y[links_ + i];
      right[i] = {-w2 * h_[i].x, -w2 * h_[i].y};
      diagonal[i] = {1.0L / mass + U[i].xx, U[i].xy, 1.0L / mass + U[i].yy};
      if (i == 0) {
        right[0].y += kRodGravity;
        continue;
      }
      const Real before = y[links_ + i - 1] * y[links_ + i - 1];
      right[i].x -= before * h_[i - 1].x;
      right[i].y -= before * h_[i - 1].y;
      diagonal[i].xx += 1.0L / mass + U[i - 1].xx;
      diagonal[i].xy += U[i - 1].xy;
      diagonal[i].yy += 1.0L / mass + U[i - 1].yy;
    }
    // Elimination from the first pin to the last.
    for (std::size_t i = 1; i < links_; ++i) {
      const Block B{U[i - 1].xx - 1.0L / mass, U[i - 1].xy, U[i - 1].yy - 1.0L / mass};
      const Pair c1 = solve(diagonal[i - 1], {B.xx, B.xy});
      const Pair c2 = solve(diagonal[i - 1], {B.xy, B.yy});
      const Pair r = solve(diagonal[i - 1], right[i - 1]);
      diagonal[i].xx -= B.xx * c1.x + B.xy * c1.y;
      diagonal[i].xy -= B.xx * c2.x + B.xy * c2.y;
      diagonal[i].yy -= B.xy * c2.x + B.yy * c2.y;
      right[i].x -= B.xx * r.x + B.xy * r.y;
      right[i].y -= B.xy * r.x + B.yy * r.y;
    }
    Pair next{0.0L, 0.0L};
    for (std::size_t i = links_; i-- > 0;) {
      const Block B{U[i].xx - 1.0L / mass, U[i].xy, U[i].yy - 1.0L / mass};
      const Pair F = solve(diagonal[i],
                           {right[i].x - (i + 1 < links_ ? B.xx * next.x + B.xy * next.y : 0.0L),
                            right[i].y - (i + 1 < links_ ? B.xy * next.x + B.yy * next.y : 0.0L)});
      dy[i] = y[links_ + i];
      dy[links_ + i] = -(-h_[i].y * (F.x + next.x) + h_[i].x * (F.y + next.y)) / inertia;
      next = F;
    }
    std::fill(dy.begin() + static_cast<std::ptrdiff_t>(2 * links_), dy.end(), 0.0L);
  }

 private:
  std::size_t links_;
  std::array<Pair, kMost> h_{};
};

// Centres and angles of the rods from angles and rates.
template <class Angles>
void place(std::size_t links, const Angles& state, std::vector<double>* q, std::vector<double>* v) {
  Real x = 0, y = 0, vx = 0, vy = 0;
  for (std::size_t i = 0; i < links; ++i) {
    const Real hx = kLength / 2.0L * std::cos(state[i]), hy = kLength / 2.0L * std::sin(state[i]);
    const Real w = state[links + i];
    for (const Real entry : {x + hx, y + hy, state[i]}) q->push_back(static_cast<double>(entry));
    for (const Real entry : {vx - hy * w, vy + hx * w, w}) v->push_back(static_cast<double>(entry));
    x += 2.0L * hx;
    y += 2.0L * hy;
    vx -= 2.0L * hy * w;
    vy += 2.0L * hx * w;
  }
}

SparseJacobian sparse_jacobian(const LinkagePointer& linkage, const Problem& p) {
  std::map<std::pair<int, int>, int> where;  // (column, row): ordered as compressed columns are
  linkage->derivatives(0.0, 1.0, p.y0.data(), p.yp0.data(), [&](int i, int j, double) {
    where[{j, i}] = 0;
  });
  SparseJacobian sparse;
  sparse.starts.assign(static_cast<std::size_t>(p.size) + 1, 0);
  for (auto& [place, index] : where) {
    index = static_cast<int>(sparse.rows.size());
    sparse.rows.push_back(place.second);
    ++sparse.starts[static_cast<std::size_t>(place.first) + 1];
  }
  for (std::size_t j = 1; j < sparse.starts.size(); ++j) sparse.starts[j] += sparse.starts[j - 1];
  std::vector<int> slots;
  linkage->derivatives(0.0, 1.0, p.y0.data(), p.yp0.data(), [&](int i, int j, double) {
    slots.push_back(where.at({j, i}));
  });
  const std::size_t entries = sparse.rows.size();
  sparse.fill = [linkage, slots, entries](double, double cj, const double* y, const double* yp,
                                          double* values) {
    std::fill(values, values + entries, 0.0);
    const int* slot = slots.data();
    linkage->derivatives(0.0, cj, y, yp, [&](int, int, double entry) { values[*slot++] += entry; });
  };
  return sparse;
}

// Position rows, then velocity rows, of the forms of pinned_rods.hpp as one sparse set.
class PinRows {
 public:
  explicit PinRows(LinkagePointer linkage)
      : linkage_(std::move(linkage)), turned_(linkage_->rods.size()) {}

  void values(const double* y, double* g) {
    const int n = linkage_->n(), m = linkage_->m();
    turn(y);
    linkage_->position_of_ground(g);
    std::fill(g + m, g + 2 * m, 0.0);
    linkage_->each_end([&](int i, int rod, double at, double sign) {
      const auto [c, s] = turned_[static_cast<std::size_t>(rod)];
      const double *q = y + 3 * rod, *v = y + n + 3 * rod;
      g[i] += sign * (q[0] + at * c);
      g[i + 1] += sign * (q[1] + at * s);
      g[m + i] += sign * (v[0] - at * s * v[2]);
      g[m + i + 1] += sign * (v[1] + at * c * v[2]);
    });
  }

  // add(row, column, entry), in an order that does not depend on y; each entry once.
  template <class Add>
  void entries(const double* y, Add add) {
    const int n = linkage_->n(), m = linkage_->m();
    turn(y);
    linkage_->each_end([&](int i, int rod, double at, double sign) {
      const auto [cosine, sine] = turned_[static_cast<std::size_t>(rod)];
      const double s = sign * at * sine, c = sign * at * cosine;
      const int q = 3 * rod, v = n + 3 * rod;
      add(i, q, sign);
      add(i, q + 2, -s);
      add(i + 1, q + 1, sign);
      add(i + 1, q + 2, c);
      add(m + i, q + 2, -c * y[v + 2]);
      add(m + i, v, sign);
      add(m + i, v + 2, -s);
      add(m + i + 1, q + 2, -s * y[v + 2]);
      add(m + i + 1, v + 1, sign);
      add(m + i + 1, v + 2, c);
    });
  }

 private:
  void turn(const double* y) {
    for (std::size_t k = 0; k < turned_.size(); ++k)
      turned_[k] = {std::cos(y[3 * k + 2]), std::sin(y[3 * k + 2])};
  }

  LinkagePointer linkage_;
  std::vector<std::pair<double, double>> turned_;  // cosine and sine of each rod's angle
};

ida_projection::Constraints sparse_rows(const LinkagePointer& linkage, const Problem& p) {
  PinRows rows(linkage);
  std::map<std::pair<int, int>, int> where;  // (row, column)
  rows.entries(p.y0.data(), [&](int i, int j, double) { where[{i, j}] = 0; });
  ida_projection::Constraints set;
  set.count = 2 * linkage->m();
  for (const char* group : {"position", "velocity"})
    for (const std::string& name : p.select({group}).names) set.names.push_back(name);
  set.value = [rows](double, ida_projection::ConstVector y, ida_projection::Vector g) mutable {
    rows.values(y.data(), g.data());
  };
  ida_projection::SparseJacobian sparse;
  sparse.starts.assign(static_cast<std::size_t>(set.count) + 1, 0);
  for (auto& [place, index] : where) {
    index = static_cast<int>(sparse.columns.size());
    sparse.columns.push_back(place.second);
    ++sparse.starts[static_cast<std::size_t>(place.first) + 1];
  }
  std::partial_sum(sparse.starts.begin(), sparse.starts.end(), sparse.starts.begin());
  std::vector<int> slots;
  rows.entries(p.y0.data(), [&](int i, int j, double) { slots.push_back(where.at({i, j})); });
  sparse.fill = [rows, slots](double, ida_projection::ConstVector y,
                              ida_projection::Vector values) mutable {
    const int* slot = slots.data();
    rows.entries(y.data(), [&](int, int, double entry) { values[*slot++] = entry; });
  };
  set.jacobian = std::move(sparse);
  return set;
}

}  // namespace

Problem link_chain(int N, double t_end) {
  if (N < 2 || N > 100000)
    throw std::invalid_argument("link chain: N = " + std::to_string(N) +
                                "; it must be 2 .. 100000");
  const auto links = static_cast<std::size_t>(N);
  auto linkage = std::make_shared<Linkage>();
  linkage->rods.assign(links, Rod{kMass, kLength});
  linkage->pins.push_back({0, -kLength / 2.0, kGround, 0.0, 0.0, 0.0});
  for (int i = 1; i < N; ++i)
    linkage->pins.push_back({i, -kLength / 2.0, i - 1, kLength / 2.0, 0.0, 0.0});
  std::vector<double> q0, v0, q, v;
  place(links, std::vector<Real>(2 * links, 0.0L), &q0, &v0);
  Problem p = build("chain of " + std::to_string(N), linkage, "index 1", 0.0, t_end, q0, v0);
  p.atol_scale.clear();  // no redundant rows
  if (links <= kMost) {
    place(links, reference_solution<2 * kMost>(FallingChain(links), State{}, t_end), &q, &v);
    set_reference(q, v, &p);
  } else {
    set_reference(std::vector<double>(q0.size(), std::numeric_limits<double>::quiet_NaN()),
                  std::vector<double>(v0.size(), std::numeric_limits<double>::quiet_NaN()), &p);
  }
  p.sparse = sparse_jacobian(linkage, p);
  p.sparse_constraints = sparse_rows(linkage, p) + p.select({"energy"});
  return p;
}

}  // namespace tether::problems

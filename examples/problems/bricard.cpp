// Tether: Bricard's six-bar linkage. SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cmath>
#include <problems/bricard.hpp>
#include <problems/mechanism.hpp>
#include <problems/reference.hpp>

namespace tether::problems {

namespace {

constexpr double kGravity = 9.81;
constexpr double kAxisMass = 2.0 * 0.01 / 12.0;  // of each axis: section of both its rods

// Vectors: points P0 .. P5, then axes u0 .. u5; those at the ends stand still.
constexpr int kPoints = 6;
constexpr std::array<std::array<double, 3>, 12> kStart = {{{0, 0, 0},
                                                           {1, 0, 0},
                                                           {1, -1, 0},
                                                           {1, -1, 1},
                                                           {0, -1, 1},
                                                           {0, 0, 1},
                                                           {0, 1, 0},
                                                           {0, 0, 1},
                                                           {1, 0, 0},
                                                           {0, 1, 0},
                                                           {0, 0, 1},
                                                           {1, 0, 0}}};

// First coordinate of a vector; -1: it stands still.
constexpr int coordinate(int vector) {
  const int k = vector % kPoints;
  if (k == 0 || k == 5) return -1;
  return vector < kPoints ? 3 * (k - 1) : 12 + 3 * (k - 1);
}

using Vector3 = Eigen::Vector3d;

/// (a1 - a0) . (b1 - b0) = constant; an index of -1 stands for no vector.
struct Product {
  int a1, a0, b1, b0;
  double constant;
};

constexpr int kRows = 24;
// The row that F does without: its share of the linkage's state of self-stress never vanishes
// (tests/problems).
constexpr int kRedundant = 2;

std::array<Product, kRows> all_products() {
  std::array<Product, kRows> rows{};
  std::size_t k = 0;
  for (int rod = 0; rod < 5; ++rod) {
    const int axis = kPoints + rod;
    rows[k++] = {rod + 1, rod, rod + 1, rod, 1.0};
    rows[k++] = {axis, -1, rod + 1, rod, 0.0};
    rows[k++] = {axis + 1, -1, rod + 1, rod, 0.0};
    rows[k++] = {axis, -1, axis + 1, -1, 0.0};
  }
  for (int axis = kPoints + 1; axis < kPoints + 5; ++axis) rows[k++] = {axis, -1, axis, -1, 1.0};
  return rows;
}

/// Some of the rows, with the mass and weight of the linkage.
template <int Rows>
struct SixBar {
  static constexpr int n = 24, m = Rows;
  static constexpr double sign = 1.0;
  std::array<Product, Rows> products;

  // A vector's values in x; the fixed ones have their start, or nothing when x holds rates.
  static Vector3 at(int vector, const double* x, bool rates) {
    if (vector < 0) return Vector3::Zero();
    const int first = coordinate(vector);
    if (first >= 0) return Eigen::Map<const Vector3>(x + first);
    if (rates) return Vector3::Zero();
    return Eigen::Map<const Vector3>(kStart[static_cast<std::size_t>(vector)].data());
  }
  static Vector3 first(const Product& p, const double* x, bool rates) {
    return at(p.a1, x, rates) - at(p.a0, x, rates);
  }
  static Vector3 second(const Product& p, const double* x, bool rates) {
    return at(p.b1, x, rates) - at(p.b0, x, rates);
  }
  // f(coordinate, sign, belongs to the second factor) for the moving vectors of a row.
  template <class F>
  static void each(const Product& p, F f) {
    const std::array<int, 4> vectors = {p.a1, p.a0, p.b1, p.b0};
    for (std::size_t k = 0; k < 4; ++k)
      if (vectors[k] >= 0 && coordinate(vectors[k]) >= 0)
        f(coordinate(vectors[k]), k % 2 == 0 ? 1.0 : -1.0, k >= 2);
  }
  // Adds d/dx of first . second with the factors taken from x.
  void derive(const double* x, bool rates, double* out) const {
    for (int i = 0; i < m; ++i) {
      const Product& p = products[static_cast<std::size_t>(i)];
      const Vector3 a = first(p, x, rates), b = second(p, x, rates);
      each(p, [&](int j, double s, bool in_second) {
        Eigen::Map<Vector3>(out + i * n + j) += s * (in_second ? a : b);
      });
    }
  }

  void mass(const double*, double* M) const {
    const auto add = [M](int a, int b, double entry) {
      for (int i = 0; i < 3; ++i) M[(a + i) * n + b + i] += entry;
    };
    for (int k = 0; k < 4; ++k) {
      add(3 * k, 3 * k, 2.0 / 3.0);
      add(12 + 3 * k, 12 + 3 * k, kAxisMass);
      if (k == 3) break;
      add(3 * k, 3 * k + 3, 1.0 / 6.0);
      add(3 * k + 3, 3 * k, 1.0 / 6.0);
    }
  }
  void force(double, const double*, const double*, double* f) const {
    std::fill(f, f + n, 0.0);
    for (int k = 0; k < 4; ++k) f[3 * k + 1] = -kGravity;  // half the weight of two rods
  }
  void position(double, const double* q, double* r) const {
    for (int i = 0; i < m; ++i) {
      const Product& p = products[static_cast<std::size_t>(i)];
      r[i] = first(p, q, false).dot(second(p, q, false)) - p.constant;
    }
  }
  void gradient(double, const double* q, double* G) const { derive(q, false, G); }
  void velocity(double, const double* q, const double* v, double* r) const {
    for (int i = 0; i < m; ++i) {
      const Product& p = products[static_cast<std::size_t>(i)];
      r[i] =
          first(p, v, true).dot(second(p, q, false)) + first(p, q, false).dot(second(p, v, true));
    }
  }
  void velocity_gradient(double, const double*, const double* v, double* H) const {
    derive(v, true, H);
  }
  void acceleration(double, const double* q, const double* v, const double* a, double* r) const {
    for (int i = 0; i < m; ++i) {
      const Product& p = products[static_cast<std::size_t>(i)];
      r[i] = first(p, a, true).dot(second(p, q, false)) +
             2.0 * first(p, v, true).dot(second(p, v, true)) +
             first(p, q, false).dot(second(p, a, true));
    }
  }
  void acceleration_gradient(double, const double*, const double*, const double* a,
                             double* K) const {
    derive(a, true, K);
  }
  void dynamics_gradient(double, const double*, const double*, const double*, const double* lam,
                         double* Dq, double*) const {
    for (int i = 0; i < m; ++i) {
      const Product& p = products[static_cast<std::size_t>(i)];
      each(p, [&](int row, double s, bool in_second) {
        each(p, [&](int column, double other, bool other_in_second) {
          if (in_second == other_in_second) return;
          for (int k = 0; k < 3; ++k) Dq[(row + k) * n + column + k] += lam[i] * s * other;
        });
      });
    }
  }
};

using Independent = SixBar<kRows - 1>;
using Follower = SixBar<1>;

// Value, first and second derivative to the turning angle a.
using Real = long double;
struct Jet {
  Real v = 0, d = 0, s = 0;
};
Jet operator+(const Jet& x, const Jet& y) { return {x.v + y.v, x.d + y.d, x.s + y.s}; }
Jet operator*(const Jet& x, const Jet& y) {
  return {x.v * y.v, x.d * y.v + x.v * y.d, x.s * y.v + 2 * x.d * y.d + x.v * y.s};
}
Jet operator*(Real c, const Jet& x) { return {c * x.v, c * x.d, c * x.s}; }
Jet sine(const Jet& x) {
  const Real s = std::sin(x.v), c = std::cos(x.v);
  return {s, c * x.d, c * x.s - s * x.d * x.d};
}
Jet cosine(const Jet& x) {
  const Real s = std::sin(x.v), c = std::cos(x.v);
  return {c, -s * x.d, -s * x.s - c * x.d * x.d};
}
using JetVector = std::array<Jet, 3>;

// Turns x about the coordinate axis k.
JetVector turn(int k, const Jet& angle, const JetVector& x) {
  const auto i = static_cast<std::size_t>((k + 1) % 3), j = static_cast<std::size_t>((k + 2) % 3);
  const Jet c = cosine(angle), s = sine(angle);
  JetVector out = x;
  out[i] = c * x[i] + Real(-1) * (s * x[j]);
  out[j] = s * x[i] + c * x[j];
  return out;
}

// The 24 coordinates from a: the hinges turn by a, b, a, b, a with sin b = -sin a / (1 + sin a),
// about the axes that they have at the start.
std::array<Jet, 24> pose(Real a) {
  const Jet first{a, 1, 0};
  const Real s = std::sin(a), c = std::cos(a), whole = 1 + s;
  const Jet sin_b{-s / whole, -c / (whole * whole),
                  (s * whole + 2 * c * c) / (whole * whole * whole)};
  Jet b;
  b.v = std::asin(sin_b.v);
  b.d = sin_b.d / std::cos(b.v);
  b.s = (sin_b.s + sin_b.v * b.d * b.d) / std::cos(b.v);
  const std::array<int, 6> axis = {1, 2, 0, 1, 2, 0};
  const auto turned = [&](int rod, const std::array<double, 3>& x) {
    JetVector out;
    for (std::size_t i = 0; i < 3; ++i) out[i].v = x[i];
    for (int k = rod; k >= 0; --k)
      out = turn(axis[static_cast<std::size_t>(k)], k % 2 == 0 ? first : b, out);
    return out;
  };
  std::array<Jet, 24> y{};
  JetVector point{};
  for (int k = 1; k <= 4; ++k) {
    const auto at = static_cast<std::size_t>(k);
    std::array<double, 3> rod{};
    for (std::size_t i = 0; i < 3; ++i) rod[i] = kStart[at][i] - kStart[at - 1][i];
    const JetVector along = turned(k - 1, rod), across = turned(k - 1, kStart[kPoints + at]);
    for (std::size_t i = 0; i < 3; ++i) {
      point[i] = point[i] + along[i];
      y[3 * (at - 1) + i] = point[i];
      y[12 + 3 * (at - 1) + i] = across[i];
    }
  }
  return y;
}

struct Reduced {
  Real inertia = 0, half_slope = 0, pull = 0;  // A, A'/2, dV/da
};
Reduced reduced(const std::array<Jet, 24>& y) {
  Reduced out;
  const auto pair = [&](std::size_t i, std::size_t j, Real mass) {
    out.inertia += mass * y[i].d * y[j].d;
    out.half_slope += mass * (y[i].d * y[j].s + y[i].s * y[j].d) / 2;
  };
  for (std::size_t i = 0; i < 12; ++i) {
    pair(i, i, 2.0L / 3.0L);
    if (i >= 3) pair(i, i - 3, 1.0L / 3.0L);
    pair(12 + i, 12 + i, static_cast<Real>(kAxisMass));
    if (i % 3 == 1) out.pull += static_cast<Real>(kGravity) * y[i].d;
  }
  return out;
}

void exact(double t, std::array<Jet, 24>* y, Real* rate) {
  using State = std::array<Real, 2>;
  const State end = reference_solution<2>(
      [](const State& x, State& dx) {
        const Reduced at = reduced(pose(x[0]));
        dx[0] = x[1];
        dx[1] = -(at.half_slope * x[1] * x[1] + at.pull) / at.inertia;
      },
      State{}, t);
  *y = pose(end[0]);
  *rate = end[1];
}

void add_redundant(const Product& product, Problem& p) {
  const int N = p.size;
  const Follower row{{product}};
  p.rows.push_back(make_rows(
      "redundant", {"redundant", "redundant rate"},
      [row](double t, const double* y, double* r) {
        row.position(t, y, r);
        row.velocity(t, y, y + Follower::n, r + 1);
      },
      [row, N](double t, const double* y, double* C) {
        row.gradient(t, y, C);
        row.velocity_gradient(t, y, y + Follower::n, C + N);
        row.gradient(t, y, C + N + Follower::n);
      }));
}

void add_energy(const Independent& linkage, Problem& p) {
  using Matrix = Eigen::Matrix<double, 24, 24, Eigen::RowMajor>;
  Matrix M = Matrix::Zero();
  Eigen::Matrix<double, 24, 1> f;
  linkage.mass(nullptr, M.data());
  linkage.force(0.0, nullptr, nullptr, f.data());
  const auto height = [f](const double* q) {
    return f.dot(Eigen::Map<const Eigen::Matrix<double, 24, 1>>(q));
  };
  const double start = height(p.y0.data());
  p.rows.push_back(make_rows(
      "energy", {"energy"},
      [M, height, start](double, const double* y, double* r) {
        const Eigen::Map<const Eigen::Matrix<double, 24, 1>> v(y + 24);
        r[0] = v.dot(M * v) / 2.0 - (height(y) - start);
      },
      [M, f](double, const double* y, double* C) {
        Eigen::Map<Eigen::Matrix<double, 24, 1>>(C, 24) = -f;
        Eigen::Map<Eigen::Matrix<double, 24, 1>>(C + 24, 24).noalias() =
            M * Eigen::Map<const Eigen::Matrix<double, 24, 1>>(y + 24);
      }));
}

}  // namespace

std::vector<std::string> bricard_forms() { return Mechanism<Independent>::forms(); }

Problem bricard(double t_end, const std::string& form) {
  const auto products = all_products();
  Independent linkage{};
  std::size_t kept = 0;
  std::vector<std::string> names;
  for (int i = 0; i < kRows; ++i) {
    if (i == kRedundant) continue;
    linkage.products[kept++] = products[static_cast<std::size_t>(i)];
    names.push_back(i < 20 ? "rod " + std::to_string(i / 4) + ", row " + std::to_string(i % 4)
                           : "axis " + std::to_string(i - 19));
  }
  std::vector<double> q0, v0(24, 0.0), q, v;
  for (int vector : {1, 2, 3, 4, 7, 8, 9, 10})
    for (const double entry : kStart[static_cast<std::size_t>(vector)]) q0.push_back(entry);
  Problem p = Mechanism<Independent>::make(linkage, "bricard", form, q0, v0, names);
  p.t_end = t_end;
  add_redundant(products[kRedundant], p);
  add_energy(linkage, p);
  p.recommended = {"position", "velocity", "redundant", "energy"};
  // 49 rows are too many for 48 unknowns.
  if (p.index == 0) p.recommended.erase(p.recommended.begin() + 2);
  std::array<Jet, 24> y;
  Real rate;
  exact(t_end, &y, &rate);
  for (const Jet& each : y) {
    q.push_back(static_cast<double>(each.v));
    v.push_back(static_cast<double>(each.d * rate));
  }
  Eigen::Matrix<double, 24, 1> a;
  std::vector<double> lam(Independent::m);
  Mechanism<Independent>::solve_motion(linkage, t_end, q.data(), v.data(), a.data(), lam.data());
  Mechanism<Independent>::set_reference(linkage, q, v, lam, p);
  return p;
}

BricardState bricard_exact(double t) {
  std::array<Jet, 24> y;
  Real rate;
  exact(t, &y, &rate);
  BricardState state;
  for (std::size_t i = 0; i < 3; ++i) state.point[i] = static_cast<double>(y[3 + i].v);
  state.kinetic = static_cast<double>(reduced(y).inertia * rate * rate / 2);
  return state;
}

}  // namespace tether::problems

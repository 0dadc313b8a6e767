// Tether: planar rods joined by pins, with redundant rows. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <problems/pinned_rods.hpp>
#include <problems/reference.hpp>
#include <problems/rows.hpp>

namespace tether::problems {

namespace {

constexpr double kGravity = 9.81;
constexpr int kGround = -1;

struct Rod {
  double mass, length;
  double inertia() const { return mass * length * length / 12.0; }
};

/// A point of rod a, `at_a` metres from its centre along the rod, coincides with a point of rod b,
/// or with (x, y) when b is the ground.
struct Pin {
  int a;
  double at_a;
  int b;
  double at_b;
  double x, y;
};

/// Constants only; shared by the callbacks.
struct Linkage {
  std::vector<Rod> rods;
  std::vector<Pin> pins;

  int n() const { return 3 * static_cast<int>(rods.size()); }
  int m() const { return 2 * static_cast<int>(pins.size()); }

  // Both ends of every pin: f(row of x, rod, signed distance along the rod); b counts negative.
  template <class F>
  void each_end(F f) const {
    int row = 0;
    for (const Pin& pin : pins) {
      f(row, pin.a, pin.at_a, 1.0);
      if (pin.b != kGround) f(row, pin.b, pin.at_b, -1.0);
      row += 2;
    }
  }

  void position(const double* q, double* r) const {
    int row = 0;
    for (const Pin& pin : pins) {
      r[row] = pin.b == kGround ? -pin.x : 0.0;
      r[row + 1] = pin.b == kGround ? -pin.y : 0.0;
      row += 2;
    }
    each_end([&](int i, int rod, double at, double sign) {
      const double* c = q + 3 * rod;
      r[i] += sign * (c[0] + at * std::cos(c[2]));
      r[i + 1] += sign * (c[1] + at * std::sin(c[2]));
    });
  }

  void velocity(const double* q, const double* v, double* r) const {
    std::fill(r, r + m(), 0.0);
    each_end([&](int i, int rod, double at, double sign) {
      const double angle = q[3 * rod + 2], turn = v[3 * rod + 2];
      r[i] += sign * (v[3 * rod] - at * std::sin(angle) * turn);
      r[i + 1] += sign * (v[3 * rod + 1] + at * std::cos(angle) * turn);
    });
  }

  void acceleration(const double* q, const double* v, const double* a, double* r) const {
    std::fill(r, r + m(), 0.0);
    each_end([&](int i, int rod, double at, double sign) {
      const double s = at * std::sin(q[3 * rod + 2]), c = at * std::cos(q[3 * rod + 2]);
      const double turn2 = v[3 * rod + 2] * v[3 * rod + 2], second = a[3 * rod + 2];
      r[i] += sign * (a[3 * rod] - s * second - c * turn2);
      r[i + 1] += sign * (a[3 * rod + 1] + c * second - s * turn2);
    });
  }

  // set(row, column, entry) for the entries of dg/dq.
  template <class Set>
  void gradient(const double* q, Set set) const {
    each_end([&](int i, int rod, double at, double sign) {
      const double angle = q[3 * rod + 2];
      set(i, 3 * rod, sign);
      set(i + 1, 3 * rod + 1, sign);
      set(i, 3 * rod + 2, -sign * at * std::sin(angle));
      set(i + 1, 3 * rod + 2, sign * at * std::cos(angle));
    });
  }

  // The same for the derivative of velocity to q.
  template <class Set>
  void velocity_gradient(const double* q, const double* v, Set set) const {
    each_end([&](int i, int rod, double at, double sign) {
      const double angle = q[3 * rod + 2], turn = v[3 * rod + 2];
      set(i, 3 * rod + 2, -sign * at * std::cos(angle) * turn);
      set(i + 1, 3 * rod + 2, -sign * at * std::sin(angle) * turn);
    });
  }

  double mass(int coordinate) const {
    const Rod& rod = rods[static_cast<std::size_t>(coordinate / 3)];
    return coordinate % 3 == 2 ? rod.inertia() : rod.mass;
  }
  double force(int coordinate) const {
    return coordinate % 3 == 1 ? -mass(coordinate) * kGravity : 0.0;
  }

  // r = M a - f + G^T lam
  void dynamics(const double* q, const double* a, const double* lam, double* r) const {
    for (int i = 0; i < n(); ++i) r[i] = mass(i) * a[i] - force(i);
    each_end([&](int i, int rod, double at, double sign) {
      const double angle = q[3 * rod + 2];
      r[3 * rod] += sign * lam[i];
      r[3 * rod + 1] += sign * lam[i + 1];
      r[3 * rod + 2] += sign * at * (std::cos(angle) * lam[i + 1] - std::sin(angle) * lam[i]);
    });
  }

  double energy(const double* q, const double* v) const {
    double sum = 0.0;
    for (int i = 0; i < n(); ++i) sum += mass(i) * v[i] * v[i] / 2.0 - force(i) * q[i];
    return sum;
  }
};

using LinkagePointer = std::shared_ptr<const Linkage>;

// a of least constraint: with M = D^2, z = D a is nearest to D^-1 f among G D^-1 z = -gamma.
class LeastConstraint {
 public:
  explicit LeastConstraint(const Linkage& linkage)
      : root_(linkage.n()),
        free_(linkage.n()),
        B_(linkage.m(), linkage.n()),
        right_(linkage.m()),
        zero_(Eigen::VectorXd::Zero(linkage.n())),
        solver_(linkage.m(), linkage.n()) {
    for (int i = 0; i < linkage.n(); ++i) {
      root_[i] = std::sqrt(linkage.mass(i));
      free_[i] = linkage.force(i) / root_[i];
    }
    solver_.setThreshold(1e-6);
  }

  void operator()(const Linkage& linkage, const double* q, const double* v, double* a) {
    B_.setZero();
    linkage.gradient(q, [this](int i, int j, double entry) { B_(i, j) = entry / root_[j]; });
    linkage.acceleration(q, v, zero_.data(), right_.data());
    right_ = -right_;
    right_.noalias() -= B_ * free_;
    solver_.compute(B_);
    Eigen::Map<Eigen::VectorXd> out(a, linkage.n());
    out.noalias() = solver_.solve(right_);
    out = (out + free_).cwiseQuotient(root_);
  }

 private:
  Eigen::VectorXd root_, free_;
  Eigen::MatrixXd B_;
  Eigen::VectorXd right_, zero_;
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver_;
};

// Accelerations and multipliers of 0 = M a - f + G^T lam, g'' = epsilon lam.
void solve_motion(const Linkage& linkage, double epsilon, const double* q, const double* v,
                  Eigen::VectorXd* a, Eigen::VectorXd* lam) {
  const int n = linkage.n(), m = linkage.m();
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(m, n);
  linkage.gradient(q, [&G](int i, int j, double entry) { G(i, j) = entry; });
  Eigen::MatrixXd left = G;
  for (int j = 0; j < n; ++j) left.col(j) /= linkage.mass(j);
  Eigen::MatrixXd S = left * G.transpose();
  S.diagonal().array() += epsilon;
  const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factor(S);
  *lam = Eigen::VectorXd::Zero(m);
  a->resize(n);
  Eigen::VectorXd r(n), second(m);
  for (int refinement = 0; refinement < 4; ++refinement) {
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(n);
    linkage.dynamics(q, none.data(), lam->data(), r.data());
    for (int i = 0; i < n; ++i) (*a)[i] = -r[i] / linkage.mass(i);
    linkage.acceleration(q, v, a->data(), second.data());
    if (refinement < 3) *lam += factor.solve(second - epsilon * *lam);
  }
}

void fill_jacobian(const Linkage& linkage, double epsilon, double cj, const double* y,
                   const double* yp, double* J) {
  const int n = linkage.n(), m = linkage.m(), N = 2 * n + m;
  std::fill(J, J + N * N, 0.0);
  const auto at = [J, N](int row, int column) -> double& { return J[row + N * column]; };
  for (int i = 0; i < n; ++i) {
    at(i, i) = cj;
    at(i, n + i) = -1.0;
    at(n + i, n + i) = cj * linkage.mass(i);
  }
  for (int i = 0; i < m; ++i) at(2 * n + i, 2 * n + i) = -epsilon;
  linkage.gradient(y, [&](int i, int j, double entry) {
    at(2 * n + i, n + j) += cj * entry;
    at(n + j, 2 * n + i) += entry;
  });
  linkage.velocity_gradient(
      y, y + n, [&](int i, int j, double entry) { at(2 * n + i, n + j) += 2.0 * entry; });
  linkage.each_end([&](int i, int rod, double distance, double sign) {
    const int angle = 3 * rod + 2;
    const double s = sign * distance * std::sin(y[angle]), c = sign * distance * std::cos(y[angle]);
    const double turn2 = y[n + angle] * y[n + angle], second = yp[n + angle];
    at(2 * n + i, angle) += -c * second + s * turn2;
    at(2 * n + i + 1, angle) += -s * second - c * turn2;
    at(n + angle, angle) -= c * y[2 * n + i] + s * y[2 * n + i + 1];
  });
}

Problem build(const std::string& name, const LinkagePointer& linkage, const std::string& form,
              double epsilon, double t_end, const std::vector<double>& q0,
              const std::vector<double>& v0) {
  const bool index0 = form == "index 0";
  if (!index0 && form != "index 1") unknown_form(name, form, pinned_rods_forms());
  if (!(epsilon >= 0.0)) throw std::invalid_argument(name + ": epsilon must be >= 0");
  const int n = linkage->n(), m = linkage->m();
  Problem p;
  p.name = name;
  p.form = form;
  p.index = index0 ? 0 : 1;
  p.size = index0 ? 2 * n : 2 * n + m;
  p.t_end = t_end;
  p.error_components = n;
  const auto N = static_cast<std::size_t>(p.size);

  p.y0 = q0;
  p.y0.insert(p.y0.end(), v0.begin(), v0.end());
  p.yp0 = v0;
  p.id.assign(static_cast<std::size_t>(2 * n), 1.0);
  p.id.resize(N, 0.0);
  if (index0) {
    LeastConstraint solve(*linkage);
    p.yp0.resize(N);
    solve(*linkage, q0.data(), v0.data(), p.yp0.data() + n);
    p.residual = [linkage, n, solve](double, const double* y, const double* yp, double* r) mutable {
      solve(*linkage, y, y + n, r + n);
      for (int i = 0; i < n; ++i) {
        r[i] = yp[i] - y[n + i];
        r[n + i] = yp[n + i] - r[n + i];
      }
    };
  } else {
    Eigen::VectorXd a, lam;
    solve_motion(*linkage, epsilon, q0.data(), v0.data(), &a, &lam);
    p.y0.insert(p.y0.end(), lam.data(), lam.data() + m);
    p.yp0.insert(p.yp0.end(), a.data(), a.data() + n);
    p.yp0.resize(N, 0.0);
    // Redundant rows determine the multipliers to round-off / epsilon only.
    p.atol_scale.assign(static_cast<std::size_t>(2 * n), 1.0);
    p.atol_scale.resize(N, 1e4);
    p.residual = [linkage, n, m, epsilon](double, const double* y, const double* yp, double* r) {
      for (int i = 0; i < n; ++i) r[i] = yp[i] - y[n + i];
      linkage->dynamics(y, yp + n, y + 2 * n, r + n);
      linkage->acceleration(y, y + n, yp + n, r + 2 * n);
      for (int i = 0; i < m; ++i) r[2 * n + i] -= epsilon * y[2 * n + i];
    };
    p.jacobian = [linkage, epsilon](double, double cj, const double* y, const double* yp,
                                    double* J) { fill_jacobian(*linkage, epsilon, cj, y, yp, J); };
  }

  const int width = p.size;
  std::vector<std::string> names, rates;
  for (std::size_t pin = 0; pin < linkage->pins.size(); ++pin)
    for (const char* axis : {" x", " y"}) {
      names.push_back("pin " + std::to_string(pin) + axis);
      rates.push_back(names.back() + " rate");
    }
  p.rows.push_back(make_rows(
      "position", names, [linkage](double, const double* y, double* r) { linkage->position(y, r); },
      [linkage, width](double, const double* y, double* C) {
        linkage->gradient(y, [C, width](int i, int j, double entry) { C[i * width + j] += entry; });
      }));
  p.rows.push_back(make_rows(
      "velocity", rates,
      [linkage, n](double, const double* y, double* r) { linkage->velocity(y, y + n, r); },
      [linkage, n, width](double, const double* y, double* C) {
        linkage->gradient(y, [=](int i, int j, double entry) { C[i * width + n + j] += entry; });
        linkage->velocity_gradient(
            y, y + n, [C, width](int i, int j, double entry) { C[i * width + j] += entry; });
      }));
  const double E = linkage->energy(q0.data(), v0.data());
  p.rows.push_back(make_rows(
      "energy", {"energy"},
      [linkage, n, E](double, const double* y, double* r) { r[0] = linkage->energy(y, y + n) - E; },
      [linkage, n](double, const double* y, double* C) {
        for (int i = 0; i < n; ++i) {
          C[i] = -linkage->force(i);
          C[n + i] = linkage->mass(i) * y[n + i];
        }
      }));
  p.recommended = {"position", "velocity", "energy"};
  // The plugin takes at most as many rows as unknowns, redundant or not.
  if (2 * m + 1 > p.size) p.recommended.pop_back();
  return p;
}

void set_reference(const std::vector<double>& q, const std::vector<double>& v, Problem* p) {
  p->reference = q;
  p->reference.insert(p->reference.end(), v.begin(), v.end());
  p->reference.resize(static_cast<std::size_t>(p->size), std::numeric_limits<double>::quiet_NaN());
}

// th'' = factor sin th
void rotation(long double factor, long double angle, long double speed, double t, double* th,
              double* rate) {
  using State = std::array<long double, 2>;
  const State end = reference_solution<2>(
      [factor](const State& y, State& dy) {
        dy[0] = y[1];
        dy[1] = factor * std::sin(y[0]);
      },
      State{angle, speed}, t);
  *th = static_cast<double>(end[0]);
  *rate = static_cast<double>(end[1]);
}

// Appends a rod with its centre at (x, y), turning about nothing.
void append(double x, double y, double angle, std::vector<double>* to) {
  to->push_back(x);
  to->push_back(y);
  to->push_back(angle);
}

constexpr double kHalfTurn = 3.14159265358979323846;

void four_bar_state(int N, double th, double rate, std::vector<double>* q, std::vector<double>* v) {
  const double s = std::sin(th), c = std::cos(th);
  for (int i = 0; i <= N; ++i) {
    append(i + s / 2.0, c / 2.0, kHalfTurn / 2.0 - th, q);
    append(c * rate / 2.0, -s * rate / 2.0, -rate, v);
  }
  for (int i = 0; i < N; ++i) {
    append(i + 0.5 + s, c, 0.0, q);
    append(c * rate, -s * rate, 0.0, v);
  }
}

void parallelogram_state(double th, double rate, std::vector<double>* q, std::vector<double>* v) {
  const double s = std::sin(th), c = std::cos(th);
  for (int i = 0; i < 3; ++i) {
    append(i + s / 2.0, -c / 2.0, th - kHalfTurn / 2.0, q);
    append(c * rate / 2.0, s * rate / 2.0, rate, v);
  }
  append(1.0 + s, -c, 0.0, q);
  append(c * rate, s * rate, 0.0, v);
}

// A chain of N like rods in absolute angles th_i from the x axis, first end held at the origin:
// sum_j k_ij (cos(th_i - th_j) th_j'' + sin(th_i - th_j) th_j'^2) + g/l (N - i - 1/2) cos th_i = 0
// with k_ij = N - max(i, j) - 1/2, k_ii = N - i - 2/3 (i from 0). Quite another way to the motion
// than the rods' centres with pins. Returns angles and rates at t_end, released at rest from th =
// 0.
template <int N>
std::array<long double, 2 * N> falling_chain(long double length, double t_end) {
  using State = std::array<long double, 2 * N>;
  return reference_solution<2 * N>(
      [length](const State& y, State& dy) {
        Eigen::Matrix<long double, N, N> K;
        Eigen::Matrix<long double, N, 1> right;
        for (int i = 0; i < N; ++i) {
          right[i] = -static_cast<long double>(kGravity) / length * (N - i - 0.5L) * std::cos(y[i]);
          for (int j = 0; j < N; ++j) {
            const long double k = i == j ? N - i - 2.0L / 3.0L : N - std::max(i, j) - 0.5L;
            K(i, j) = k * std::cos(y[i] - y[j]);
            right[i] -= k * std::sin(y[i] - y[j]) * y[N + j] * y[N + j];
          }
        }
        const Eigen::Matrix<long double, N, 1> second = K.llt().solve(right);
        for (int i = 0; i < N; ++i) {
          dy[i] = y[N + i];
          dy[N + i] = second[i];
        }
      },
      State{}, t_end);
}

// Rods' centres and angles from absolute angles.
void chain_state(double length, const std::vector<double>& th, const std::vector<double>& rate,
                 std::vector<double>* q, std::vector<double>* v) {
  double x = 0, y = 0, vx = 0, vy = 0;
  for (std::size_t i = 0; i < th.size(); ++i) {
    const double hx = length / 2.0 * std::cos(th[i]), hy = length / 2.0 * std::sin(th[i]);
    append(x + hx, y + hy, th[i], q);
    append(vx - hy * rate[i], vy + hx * rate[i], rate[i], v);
    x += 2.0 * hx;
    y += 2.0 * hy;
    vx -= 2.0 * hy * rate[i];
    vy += 2.0 * hx * rate[i];
  }
}

template <int N>
Problem chain(double length, double mass, double t_end, const std::string& form) {
  auto linkage = std::make_shared<Linkage>();
  linkage->rods.assign(N, Rod{mass, length});
  linkage->pins.push_back({0, -length / 2.0, kGround, 0.0, 0.0, 0.0});
  for (int i = 1; i < N; ++i)
    linkage->pins.push_back({i, -length / 2.0, i - 1, length / 2.0, 0.0, 0.0});
  std::vector<double> q0, v0, q, v, th(N, 0.0), rate(N, 0.0);
  chain_state(length, th, rate, &q0, &v0);
  Problem p = build("chain of " + std::to_string(N), linkage, form, 0.0, t_end, q0, v0);
  p.atol_scale.clear();  // no redundant rows
  const auto end = falling_chain<N>(length, t_end);
  for (int i = 0; i < N; ++i) {
    const auto k = static_cast<std::size_t>(i);
    th[k] = static_cast<double>(end[k]);
    rate[k] = static_cast<double>(end[k + N]);
  }
  chain_state(length, th, rate, &q, &v);
  set_reference(q, v, &p);
  return p;
}

}  // namespace

Problem five_link_chain(double t_end, const std::string& form) {
  return chain<5>(1.0, 1.0, t_end, form);
}

Problem ten_link_chain(double t_end, const std::string& form) {
  return chain<10>(0.1, 0.1, t_end, form);
}

std::vector<std::string> pinned_rods_forms() { return {"index 1", "index 0"}; }

void n_four_bar_exact(int N, double t, double* angle, double* speed) {
  const long double factor =
      static_cast<long double>(kGravity) * (3 * N + 1) / 2.0L * 3.0L / (4 * N + 1);
  rotation(factor, 0.0L, 1.0L, t, angle, speed);
}

void parallelogram_exact(double angle0, double speed0, double t, double* angle, double* speed) {
  rotation(-3.5L / 3.0L * static_cast<long double>(kGravity), angle0, speed0, t, angle, speed);
}

Problem n_four_bar(int N, double t_end, const std::string& form, double epsilon) {
  if (N < 1)
    throw std::invalid_argument("n four bar: N = " + std::to_string(N) + "; it must be >= 1");
  auto linkage = std::make_shared<Linkage>();
  linkage->rods.assign(static_cast<std::size_t>(2 * N + 1), Rod{1.0, 1.0});
  for (int i = 0; i <= N; ++i) linkage->pins.push_back({i, -0.5, kGround, 0.0, double(i), 0.0});
  for (int i = 0; i < N; ++i) {
    linkage->pins.push_back({N + 1 + i, -0.5, i, 0.5, 0.0, 0.0});
    linkage->pins.push_back({N + 1 + i, 0.5, i + 1, 0.5, 0.0, 0.0});
  }
  std::vector<double> q0, v0, q, v;
  four_bar_state(N, 0.0, 1.0, &q0, &v0);
  Problem p = build("four bar, N = " + std::to_string(N), linkage, form, epsilon, t_end, q0, v0);
  double angle, speed;
  n_four_bar_exact(N, t_end, &angle, &speed);
  four_bar_state(N, angle, speed, &q, &v);
  set_reference(q, v, &p);
  return p;
}

Problem parallelogram(double angle0, double speed0, double t_end, const std::string& form,
                      double epsilon) {
  auto linkage = std::make_shared<Linkage>();
  linkage->rods = {{1.0, 1.0}, {1.0, 1.0}, {1.0, 1.0}, {2.0, 2.0}};
  for (int i = 0; i < 3; ++i) {
    linkage->pins.push_back({i, -0.5, kGround, 0.0, double(i), 0.0});
    linkage->pins.push_back({i, 0.5, 3, i - 1.0, 0.0, 0.0});
  }
  std::vector<double> q0, v0, q, v;
  parallelogram_state(angle0, speed0, &q0, &v0);
  Problem p = build("parallelogram", linkage, form, epsilon, t_end, q0, v0);
  double angle, speed;
  parallelogram_exact(angle0, speed0, t_end, &angle, &speed);
  parallelogram_state(angle, speed, &q, &v);
  set_reference(q, v, &p);
  return p;
}

}  // namespace tether::problems

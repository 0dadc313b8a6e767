// Tether: planar rods joined by pins, with redundant rows. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <problems/linkage.hpp>
#include <problems/pinned_rods.hpp>
#include <problems/reference.hpp>

namespace tether::problems {

namespace {

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
          right[i] =
              -static_cast<long double>(kRodGravity) / length * (N - i - 0.5L) * std::cos(y[i]);
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
      static_cast<long double>(kRodGravity) * (3 * N + 1) / 2.0L * 3.0L / (4 * N + 1);
  rotation(factor, 0.0L, 1.0L, t, angle, speed);
}

void parallelogram_exact(double angle0, double speed0, double t, double* angle, double* speed) {
  rotation(-3.5L / 3.0L * static_cast<long double>(kRodGravity), angle0, speed0, t, angle, speed);
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

// Tether: slider crank with crank and coupler of equal length. SPDX-License-Identifier:
// BSD-3-Clause
#include <cmath>
#include <problems/mechanism.hpp>
#include <problems/reference.hpp>
#include <problems/slider_crank_equal.hpp>

namespace tether::problems {

namespace {

struct SliderCrankEqual {
  static constexpr int n = 3, m = 2;
  static constexpr double sign = 1.0;
  double gravity;

  void mass(const double* q, double* M) const {
    M[0] = 4.0 / 3.0;
    M[1] = M[3] = 0.5 * std::cos(q[0] - q[1]);
    M[4] = 1.0 / 3.0;
    M[8] = 1.0;
  }

  void force(double, const double* q, const double* v, double* f) const {
    const double S = 0.5 * std::sin(q[0] - q[1]);
    f[0] = -S * v[1] * v[1] - 1.5 * gravity * std::cos(q[0]);
    f[1] = S * v[0] * v[0] - 0.5 * gravity * std::cos(q[1]);
    f[2] = 0.0;
  }

  void position(double, const double* q, double* r) const {
    r[0] = std::cos(q[0]) + std::cos(q[1]) - q[2];
    r[1] = std::sin(q[0]) + std::sin(q[1]);
  }

  void gradient(double, const double* q, double* G) const {
    for (int i = 0; i < 2; ++i) {
      G[i] = -std::sin(q[i]);
      G[3 + i] = std::cos(q[i]);
    }
    G[2] = -1.0;
  }

  void velocity(double, const double* q, const double* v, double* r) const {
    r[0] = -std::sin(q[0]) * v[0] - std::sin(q[1]) * v[1] - v[2];
    r[1] = std::cos(q[0]) * v[0] + std::cos(q[1]) * v[1];
  }

  void velocity_gradient(double, const double* q, const double* v, double* H) const {
    for (int i = 0; i < 2; ++i) {
      H[i] = -std::cos(q[i]) * v[i];
      H[3 + i] = -std::sin(q[i]) * v[i];
    }
  }

  void acceleration(double, const double* q, const double* v, const double* a, double* r) const {
    r[0] = -a[2];
    r[1] = 0.0;
    for (int i = 0; i < 2; ++i) {
      const double s = std::sin(q[i]), c = std::cos(q[i]);
      r[0] -= s * a[i] + c * v[i] * v[i];
      r[1] += c * a[i] - s * v[i] * v[i];
    }
  }

  void acceleration_gradient(double, const double* q, const double* v, const double* a,
                             double* K) const {
    for (int i = 0; i < 2; ++i) {
      const double s = std::sin(q[i]), c = std::cos(q[i]);
      K[i] = -c * a[i] + s * v[i] * v[i];
      K[3 + i] = -s * a[i] - c * v[i] * v[i];
    }
  }

  void dynamics_gradient(double, const double* q, const double* v, const double* a,
                         const double* lam, double* Dq, double* Dv) const {
    const double S = 0.5 * std::sin(q[0] - q[1]), C = 0.5 * std::cos(q[0] - q[1]);
    const double first = -S * a[1] + C * v[1] * v[1], second = -S * a[0] - C * v[0] * v[0];
    Dq[0] = first - 1.5 * gravity * std::sin(q[0]);
    Dq[1] = -first;
    Dq[3] = second;
    Dq[4] = -second - 0.5 * gravity * std::sin(q[1]);
    Dv[1] = 2.0 * S * v[1];
    Dv[3] = -2.0 * S * v[0];
    for (int i = 0; i < 2; ++i) Dq[4 * i] -= lam[0] * std::cos(q[i]) + lam[1] * std::sin(q[i]);
  }
};

using Form = Mechanism<SliderCrankEqual>;

// On the branch th2 = -th1, x = 2 cos th1: A th'' + A' th'^2/2 + g cos th = 0, A = 2/3 + 6 sin^2
// th.
std::array<long double, 2> branch(const SliderCrankMotion& motion, long double t_end) {
  const long double g = motion.gravity;
  return reference_solution<2>(
      [g](const std::array<long double, 2>& y, std::array<long double, 2>& dy) {
        const long double s = std::sin(y[0]), c = std::cos(y[0]);
        dy[0] = y[1];
        dy[1] = -(6.0L * s * c * y[1] * y[1] + g * c) / (2.0L / 3.0L + 6.0L * s * s);
      },
      {motion.angle, motion.speed}, t_end);
}

std::vector<double> positions(long double th) {
  return {static_cast<double>(th), static_cast<double>(-th),
          static_cast<double>(2.0L * std::cos(th))};
}

std::vector<double> velocities(long double th, long double speed) {
  return {static_cast<double>(speed), static_cast<double>(-speed),
          static_cast<double>(-2.0L * std::sin(th) * speed)};
}

}  // namespace

// The others have no unique solution at the singular positions.
std::vector<std::string> slider_crank_equal_forms() { return {"index 1", "index 1 w", "index 2"}; }

Problem slider_crank_equal(const SliderCrankMotion& motion, double t_end, const std::string& form) {
  const SliderCrankEqual system{motion.gravity};
  Problem p = Form::make(system, "slider crank with equal lengths", form, positions(motion.angle),
                         velocities(motion.angle, motion.speed), {"loop x", "loop y"});
  p.t_end = t_end;
  const double g = motion.gravity, s0 = std::sin(motion.angle);
  const double E = (1.0 / 3.0 + 3.0 * s0 * s0) * motion.speed * motion.speed + g * s0;
  p.rows.push_back(make_rows(
      "energy", {"energy"},
      [g, E](double, const double* y, double* r) {
        const double* v = y + 3;
        r[0] = 2.0 / 3.0 * v[0] * v[0] + 0.5 * std::cos(y[0] - y[1]) * v[0] * v[1] +
               v[1] * v[1] / 6.0 + 0.5 * v[2] * v[2] +
               g * (1.5 * std::sin(y[0]) + 0.5 * std::sin(y[1])) - E;
      },
      [g](double, const double* y, double* C) {
        const double* v = y + 3;
        const double c = 0.5 * std::cos(y[0] - y[1]), s = 0.5 * std::sin(y[0] - y[1]) * v[0] * v[1];
        C[0] = -s + 1.5 * g * std::cos(y[0]);
        C[1] = s + 0.5 * g * std::cos(y[1]);
        C[3] = 4.0 / 3.0 * v[0] + c * v[1];
        C[4] = v[1] / 3.0 + c * v[0];
        C[5] = v[2];
      }));
  p.recommended = {"position", "velocity", "energy"};

  const std::array<long double, 2> end = branch(motion, t_end);
  const std::vector<double> q = positions(end[0]), v = velocities(end[0], end[1]);
  double a[3];
  std::vector<double> lam(2);
  Form::solve_motion(system, t_end, q.data(), v.data(), a, lam.data());
  Form::set_reference(system, q, v, lam, p);
  return p;
}

}  // namespace tether::problems

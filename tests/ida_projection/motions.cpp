// Tether: smooth motions with invariants, each in several forms. SPDX-License-Identifier:
// BSD-3-Clause
#include "motions.hpp"

#include <cmath>
#include <problems/mechanism.hpp>
#include <problems/rows.hpp>
#include <vector>

namespace tether::test {

namespace {

using problems::make_rows;
using problems::Problem;

struct PointOnSphere {
  static constexpr int n = 3, m = 1;
  static constexpr double sign = 1.0;

  void mass(const double*, double* M) const { M[0] = M[4] = M[8] = 1.0; }
  void force(double, const double*, const double*, double* f) const {
    f[0] = f[1] = 0.0;
    f[2] = -1.0;
  }
  static double dot(const double* a, const double* b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  }
  void position(double, const double* q, double* r) const { r[0] = (dot(q, q) - 1.0) / 2.0; }
  void gradient(double, const double* q, double* G) const { std::copy(q, q + 3, G); }
  void velocity(double, const double* q, const double* v, double* r) const { r[0] = dot(q, v); }
  void velocity_gradient(double, const double*, const double* v, double* H) const {
    std::copy(v, v + 3, H);
  }
  void acceleration(double, const double* q, const double* v, const double* a, double* r) const {
    r[0] = dot(v, v) + dot(q, a);
  }
  void acceleration_gradient(double, const double*, const double*, const double* a,
                             double* K) const {
    std::copy(a, a + 3, K);
  }
  void dynamics_gradient(double, const double*, const double*, const double*, const double* lam,
                         double* Dq, double*) const {
    Dq[0] = Dq[4] = Dq[8] = lam[0];
  }
};

/// q, v of `count` points; the multipliers, which have a closed form.
class Packing {
 public:
  explicit Packing(int count) : count_(count) {}

  int coordinates() const { return 3 * count_; }
  // The forces; returns the potential.
  double force(const double* q, double* f) const {
    double potential = 0.0;
    std::fill(f, f + 3 * count_, 0.0);
    for (int i = 0; i < count_; ++i)
      for (int j = 0; j < i; ++j) {
        double apart[3], square = 0.0;
        for (int k = 0; k < 3; ++k) {
          apart[k] = q[3 * i + k] - q[3 * j + k];
          square += apart[k] * apart[k];
        }
        const double inverse = 1.0 / std::sqrt(square);
        potential += inverse;
        for (int k = 0; k < 3; ++k) {
          f[3 * i + k] += apart[k] * inverse / square;
          f[3 * j + k] -= apart[k] * inverse / square;
        }
      }
    return potential;
  }
  static double dot(const double* a, const double* b) { return PointOnSphere::dot(a, b); }
  // lam_i q_i^2 = v_i^2 + q_i f_i
  double multiplier(int i, const double* q, const double* v, const double* f) const {
    const int e = 3 * i;
    return (dot(v + e, v + e) + dot(q + e, f + e)) / dot(q + e, q + e);
  }

  void residual(const std::string& form, const double* y, const double* yp, double* r) const {
    const int d = coordinates();
    const double *q = y, *v = y + d, *lam = y + 2 * d, *mu = lam + count_;
    std::vector<double> f(static_cast<std::size_t>(d));
    force(q, f.data());
    for (int i = 0; i < count_; ++i) {
      const double tension = form == "index 0" ? multiplier(i, q, v, f.data()) : lam[i];
      const double slip = form == "GGL" ? mu[i] : 0.0;
      for (int e = 3 * i; e < 3 * i + 3; ++e) {
        r[e] = yp[e] - v[e] + slip * q[e];
        r[d + e] = yp[d + e] - f[static_cast<std::size_t>(e)] + tension * q[e];
      }
      const int e = 3 * i;
      if (form == "index 1")
        r[2 * d + i] = dot(v + e, v + e) + dot(q + e, f.data() + e) - lam[i] * dot(q + e, q + e);
      else if (form != "index 0")
        r[2 * d + i] = dot(q + e, v + e);
      if (form == "GGL") r[2 * d + count_ + i] = (dot(q + e, q + e) - 1.0) / 2.0;
    }
  }

 private:
  int count_;
};

}  // namespace

Problem spherical_pendulum(const std::string& form, double t_end) {
  const std::vector<double> q = {std::sin(1.0), 0.0, -std::cos(1.0)}, v = {0.0, 1.5, 0.0};
  Problem p =
      problems::Mechanism<PointOnSphere>::make({}, "spherical pendulum", form, q, v, {"length"});
  p.t_end = t_end;
  p.atol_scale.clear();
  const double energy = 0.5 * 1.5 * 1.5 + q[2], momentum = q[0] * v[1];
  p.rows.push_back(make_rows(
      "energy", {"energy"},
      [energy](double, const double* y, double* g) {
        g[0] = 0.5 * PointOnSphere::dot(y + 3, y + 3) + y[2] - energy;
      },
      [](double, const double* y, double* C) {
        C[2] = 1.0;
        std::copy(y + 3, y + 6, C + 3);
      }));
  p.rows.push_back(make_rows(
      "momentum", {"momentum"},
      [momentum](double, const double* y, double* g) {
        g[0] = y[0] * y[4] - y[1] * y[3] - momentum;
      },
      [](double, const double* y, double* C) {
        C[0] = y[4];
        C[1] = -y[3];
        C[3] = -y[1];
        C[4] = y[0];
      }));
  p.recommended = {"position", "velocity", "energy", "momentum"};
  return p;
}

Problem points_on_sphere(int count, const std::string& form, double t_end) {
  const Packing packing(count);
  const int d = packing.coordinates();
  std::vector<double> y(static_cast<std::size_t>(2 * d), 0.0), f(static_cast<std::size_t>(d));
  for (int i = 0; i < count; ++i) {  // a spiral from pole to pole, disturbed
    const double z = 1.0 - 2.0 * (i + 0.5) / count, r = std::sqrt(1.0 - z * z);
    const double angle = 2.399963 * i + 0.2 * std::sin(5.0 * i);
    const double x[3] = {r * std::cos(angle), r * std::sin(angle), z};
    std::copy(x, x + 3, y.begin() + 3 * i);
  }
  const double energy = packing.force(y.data(), f.data());
  std::vector<double> yp(y.size(), 0.0), id(y.size(), 1.0), lam;
  for (int i = 0; i < count; ++i) {
    lam.push_back(packing.multiplier(i, y.data(), y.data() + d, f.data()));
    for (int e = 3 * i; e < 3 * i + 3; ++e)
      yp[static_cast<std::size_t>(d + e)] =
          f[static_cast<std::size_t>(e)] - lam.back() * y[static_cast<std::size_t>(e)];
  }
  const int multipliers = form == "index 0" ? 0 : form == "GGL" ? 2 * count : count;
  if (multipliers > 0) y.insert(y.end(), lam.begin(), lam.end());
  y.resize(static_cast<std::size_t>(2 * d + multipliers), 0.0);
  yp.resize(y.size(), 0.0);
  id.resize(y.size(), 0.0);
  const int index = form == "index 0" ? 0 : form == "index 1" ? 1 : 2;
  Problem p = problems::start_problem("points on a sphere", form, index, t_end, y, yp, id);
  p.error_components = d;
  p.residual = [packing, form](double, const double* at, const double* rate, double* r) {
    packing.residual(form, at, rate, r);
  };
  const int n = p.size;
  std::vector<std::string> names;
  for (int i = 0; i < 2 * count; ++i) names.push_back("point " + std::to_string(i % count));
  p.rows = {make_rows(
                "sphere", names,
                [count, d](double, const double* at, double* g) {
                  for (int i = 0; i < count; ++i) {
                    const double* q = at + 3 * i;
                    g[i] = (Packing::dot(q, q) - 1.0) / 2.0;
                    g[count + i] = Packing::dot(q, q + d);
                  }
                },
                [count, d, n](double, const double* at, double* C) {
                  for (int i = 0; i < count; ++i)
                    for (int e = 3 * i; e < 3 * i + 3; ++e) {
                      C[i * n + e] = at[e];
                      C[(count + i) * n + e] = at[d + e];
                      C[(count + i) * n + d + e] = at[e];
                    }
                }),
            make_rows(
                "energy", {"energy"},
                [packing, d, energy](double, const double* at, double* g) {
                  std::vector<double> ignored(static_cast<std::size_t>(d));
                  g[0] = packing.force(at, ignored.data()) - energy;
                  for (int e = 0; e < d; ++e) g[0] += 0.5 * at[d + e] * at[d + e];
                },
                [packing, d](double, const double* at, double* C) {
                  packing.force(at, C);
                  for (int e = 0; e < d; ++e) {
                    C[e] = -C[e];
                    C[d + e] = at[d + e];
                  }
                })};
  p.recommended = {"sphere", "energy"};
  return p;
}

}  // namespace tether::test

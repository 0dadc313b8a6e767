// Tether: bodies in contact whose contact point is an algebraic unknown.
// SPDX-License-Identifier: BSD-3-Clause
#include "contact_points.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <problems/rows.hpp>

namespace tether::test {

namespace {

using problems::Problem;

/// a + b eps, eps^2 = 0: exact derivatives along one direction.
struct Dual {
  double a = 0.0, b = 0.0;
  Dual(double value = 0.0, double slope = 0.0) : a(value), b(slope) {}
};
Dual operator+(Dual x, Dual y) { return {x.a + y.a, x.b + y.b}; }
Dual operator-(Dual x, Dual y) { return {x.a - y.a, x.b - y.b}; }
Dual operator-(Dual x) { return {-x.a, -x.b}; }
Dual operator*(Dual x, Dual y) { return {x.a * y.a, x.a * y.b + x.b * y.a}; }
Dual operator/(Dual x, Dual y) { return {x.a / y.a, (x.b - x.a / y.a * y.b) / y.a}; }
Dual sin(Dual x) { return {std::sin(x.a), std::cos(x.a) * x.b}; }
Dual cos(Dual x) { return {std::cos(x.a), -std::sin(x.a) * x.b}; }
Dual sqrt(Dual x) { return {std::sqrt(x.a), x.b / (2.0 * std::sqrt(x.a))}; }
Dual power(Dual x, double p) { return {std::pow(x.a, p), p * std::pow(x.a, p - 1.0) * x.b}; }
double power(double x, double p) { return std::pow(x, p); }
using std::cos;
using std::sin;
using std::sqrt;

/// q = (x, y, angle), v = q'.
struct Wheel {
  static constexpr int nq = 3, nv = 3, ns = 2;
  double amplitude, scale;
  bool rolling;
  double half_x = 0.5, half_y = 0.3, inertia = 0.25 * (0.25 + 0.09), gravity = 9.81;

  int rates() const { return rolling ? 2 : 1; }
  double mass(int i) const { return i < 2 ? 1.0 : inertia * scale * scale; }

  template <class T>
  struct Contact {
    T reach[2];  // from the centre to the body's point
    T apart[2];  // from the rail's point to the body's
    T along[2];  // unit tangent of the rail
    T along_body[2];
  };
  template <class T>
  Contact<T> contact(const T* q, const T* s) const {
    const T c = cos(q[2]), si = sin(q[2]), cu = cos(s[0]), su = sin(s[0]);
    const T px = scale * half_x * cu, py = scale * half_y * su;
    const T tx = -(half_x * su), ty = half_y * cu;
    const double wave = 2.0 / scale;
    const T slope = -(amplitude * scale * wave * sin(wave * s[1]));
    const T length = sqrt(1.0 + slope * slope);
    Contact<T> at;
    at.reach[0] = c * px - si * py;
    at.reach[1] = si * px + c * py;
    at.apart[0] = q[0] + at.reach[0] - s[1];
    at.apart[1] = q[1] + at.reach[1] - amplitude * scale * cos(wave * s[1]);
    at.along[0] = 1.0 / length;
    at.along[1] = slope / length;
    at.along_body[0] = c * tx - si * ty;
    at.along_body[1] = si * tx + c * ty;
    return at;
  }
  template <class T>
  void kinematics(const T*, const T* v, T* rate) const {
    std::copy(v, v + nv, rate);
  }
  template <class T>
  void tangency(const T* q, const T* s, T* r) const {
    const Contact<T> at = contact(q, s);
    r[0] = at.along[0] * at.apart[0] + at.along[1] * at.apart[1];
    r[1] = at.along[0] * at.along_body[1] - at.along[1] * at.along_body[0];
  }
  int gaps() const { return 1; }
  template <class T>
  void gap(const T* q, const T* s, T* r) const {
    const Contact<T> at = contact(q, s);
    r[0] = at.along[0] * at.apart[1] - at.along[1] * at.apart[0];
  }
  template <class T>
  void rate(const T* q, const T* s, const T* v, T* r) const {
    const Contact<T> at = contact(q, s);
    const T vx = v[0] - v[2] * at.reach[1], vy = v[1] + v[2] * at.reach[0];
    r[0] = at.along[0] * vy - at.along[1] * vx;
    if (rolling) r[1] = at.along[0] * vx + at.along[1] * vy;
  }
  template <class T>
  void force(const T*, const T*, T* f) const {
    f[0] = 0.0;
    f[1] = -gravity;
    f[2] = 0.0;
  }
  template <class T>
  T potential(const T* q) const {
    return gravity * q[1];
  }
};

/// q = (centre, quaternion), v = (velocity, angular velocity in the body), s in the body.
struct Ellipsoid {
  static constexpr int nq = 7, nv = 6, ns = 3;
  bool rolling;
  double half[3] = {0.5, 0.4, 0.3}, gravity = 9.81;

  int rates() const { return rolling ? 3 : 1; }
  double square(int i) const { return half[i] * half[i]; }
  double mass(int i) const {
    return i < 3 ? 1.0 : (square(0) + square(1) + square(2) - square(i - 3)) / 5.0;
  }
  // Rows of the rotation from body to space.
  template <class T>
  static void rotation(const T* p, T R[3][3]) {
    const T w = p[0], x = p[1], y = p[2], z = p[3];
    const T all[3][3] = {
        {w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)},
        {2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)},
        {2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z}};
    for (int i = 0; i < 3; ++i) std::copy(all[i], all[i] + 3, R[i]);
  }
  template <class T>
  void kinematics(const T* q, const T* v, T* rate) const {
    std::copy(v, v + 3, rate);
    const T *p = q + 3, *w = v + 3;
    rate[3] = -0.5 * (p[1] * w[0] + p[2] * w[1] + p[3] * w[2]);
    rate[4] = 0.5 * (p[0] * w[0] + p[2] * w[2] - p[3] * w[1]);
    rate[5] = 0.5 * (p[0] * w[1] + p[3] * w[0] - p[1] * w[2]);
    rate[6] = 0.5 * (p[0] * w[2] + p[1] * w[1] - p[2] * w[0]);
  }
  template <class T>
  void tangency(const T* q, const T* s, T* r) const {
    T R[3][3];
    rotation(q + 3, R);
    T sum = 0.0;
    for (int i = 0; i < 3; ++i) sum = sum + square(i) * R[2][i] * R[2][i];
    const T length = sqrt(sum);
    for (int i = 0; i < 3; ++i) r[i] = s[i] * length + square(i) * R[2][i];
  }
  int gaps() const { return 2; }
  template <class T>
  void gap(const T* q, const T* s, T* r) const {
    T R[3][3];
    rotation(q + 3, R);
    r[0] = q[2] + R[2][0] * s[0] + R[2][1] * s[1] + R[2][2] * s[2];
    r[1] = 0.5 * (q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6] - 1.0);
  }
  template <class T>
  void rate(const T* q, const T* s, const T* v, T* r) const {
    T R[3][3];
    rotation(q + 3, R);
    const T* w = v + 3;
    const T turn[3] = {w[1] * s[2] - w[2] * s[1], w[2] * s[0] - w[0] * s[2],
                       w[0] * s[1] - w[1] * s[0]};
    for (int i = 0; i < rates(); ++i) {
      const int k = (i + 2) % 3;  // z first
      r[i] = v[k] + R[k][0] * turn[0] + R[k][1] * turn[1] + R[k][2] * turn[2];
    }
  }
  template <class T>
  void force(const T*, const T* v, T* f) const {
    f[0] = f[1] = 0.0;
    f[2] = -gravity;
    const T* w = v + 3;
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      f[3 + i] = (mass(3 + j) - mass(3 + k)) * w[j] * w[k];
    }
  }
  template <class T>
  T potential(const T* q) const {
    return gravity * q[2];
  }
};

/// sum over x_i = s_i / half_i of x_i^p + x_i^2 / 2 is 3/2; the fourth unknown scales the normal.
struct Superquadric : Ellipsoid {
  static constexpr int ns = 4;
  double p = 4.0;
  template <class T>
  void tangency(const T* q, const T* s, T* r) const {
    T R[3][3], sum = -1.5;
    rotation(q + 3, R);
    for (int i = 0; i < 3; ++i) {
      const T x = s[i] / half[i], high = power(x * x, 0.5 * p - 1.0);
      sum = sum + x * x * (high + 0.5);
      r[i] = x * (p * high + 1.0) / half[i] + s[3] * R[2][i];
    }
    r[3] = sum;
  }
};

template <class System>
class Rolling {
 public:
  static constexpr int nq = System::nq, nv = System::nv, ns = System::ns, most = 3;

  explicit Rolling(const System& system) : system_(system), m_(system.rates()) {}

  // d along (dq, ds, dv) of W v.
  void rate_along(const double* q, const double* s, const double* v, const double* dq,
                  const double* ds, const double* dv, double* out) const {
    Dual Q[nq], S[ns], V[nv], R[most];
    for (int i = 0; i < nq; ++i) Q[i] = {q[i], dq[i]};
    for (int i = 0; i < ns; ++i) S[i] = {s[i], ds[i]};
    for (int i = 0; i < nv; ++i) V[i] = {v[i], dv[i]};
    system_.rate(Q, S, V, R);
    for (int i = 0; i < m_; ++i) out[i] = R[i].b;
  }
  Eigen::MatrixXd W(const double* q, const double* s) const {
    Eigen::MatrixXd out(m_, nv);
    for (int j = 0; j < nv; ++j) {
      double unit[nv] = {}, r[most] = {};
      unit[j] = 1.0;
      system_.rate(q, s, unit, r);
      for (int i = 0; i < m_; ++i) out(i, j) = r[i];
    }
    return out;
  }
  Eigen::MatrixXd tangency_gradient(const double* q, const double* s) const {
    Eigen::MatrixXd out(ns, nq + ns);
    for (int j = 0; j < nq + ns; ++j) {
      Dual Q[nq], S[ns], R[ns];
      for (int i = 0; i < nq; ++i) Q[i] = {q[i], i == j ? 1.0 : 0.0};
      for (int i = 0; i < ns; ++i) S[i] = {s[i], nq + i == j ? 1.0 : 0.0};
      system_.tangency(Q, S, R);
      for (int i = 0; i < ns; ++i) out(i, j) = R[i].b;
    }
    return out;
  }
  // The part of d(W v)/dt that v' does not make.
  Eigen::VectorXd drive(const double* q, const double* s, const double* v) const {
    double dq[nq], none[nv] = {}, out[most];
    system_.kinematics(q, v, dq);
    const Eigen::MatrixXd T = tangency_gradient(q, s);
    const Eigen::VectorXd ds = -T.rightCols(ns).partialPivLu().solve(
        T.leftCols(nq) * Eigen::Map<const Eigen::VectorXd>(dq, nq));
    rate_along(q, s, v, dq, ds.data(), none, out);
    return Eigen::Map<Eigen::VectorXd>(out, m_);
  }
  void motion(const double* q, const double* s, const double* v, double* a, double* lam) const {
    const Eigen::MatrixXd J = W(q, s);
    double f[nv];
    system_.force(q, v, f);
    Eigen::MatrixXd left = J;
    Eigen::VectorXd free(nv);
    for (int j = 0; j < nv; ++j) {
      left.col(j) /= system_.mass(j);
      free[j] = f[j] / system_.mass(j);
    }
    const Eigen::VectorXd force =
        (left * J.transpose()).partialPivLu().solve(-drive(q, s, v) - J * free);
    const Eigen::VectorXd acceleration = free + left.transpose() * force;
    std::copy(acceleration.data(), acceleration.data() + nv, a);
    std::copy(force.data(), force.data() + m_, lam);
  }
  void find_contact(const double* q, double* s) const {
    for (int k = 0; k < 50; ++k) {
      double r[ns];
      system_.tangency(q, s, r);
      const Eigen::VectorXd step = tangency_gradient(q, s).rightCols(ns).partialPivLu().solve(
          Eigen::Map<Eigen::VectorXd>(r, ns));
      for (int i = 0; i < ns; ++i) s[i] -= step[i];
      if (step.lpNorm<Eigen::Infinity>() < 1e-13) break;
    }
  }
  void equations(const std::string& form, const double* y, const double* yp, double* r) const {
    const double *q = y, *v = y + nq, *s = v + nv, *lam = s + ns, *mu = lam + m_;
    const Eigen::MatrixXd J = W(q, s);
    double shifted[nv], rate[nq], f[nv];
    std::copy(v, v + nv, shifted);
    if (form == "GGL")
      for (int j = 0; j < nv; ++j) shifted[j] += J(0, j) * mu[0];
    system_.kinematics(q, shifted, rate);
    for (int i = 0; i < nq; ++i) r[i] = yp[i] - rate[i];
    system_.force(q, v, f);
    const Eigen::VectorXd push = J.transpose() * Eigen::Map<const Eigen::VectorXd>(lam, m_);
    Eigen::VectorXd a(nv);
    for (int j = 0; j < nv; ++j) {
      r[nq + j] = system_.mass(j) * yp[nq + j] - f[j] - push[j];
      a[j] = form == "index 1 a" ? (f[j] + push[j]) / system_.mass(j) : yp[nq + j];
    }
    system_.tangency(q, s, r + nq + nv);
    double* closing = r + nq + nv + ns;
    if (form == "index 2" || form == "GGL") {
      system_.rate(q, s, v, closing);
      double g[2];
      system_.gap(q, s, g);
      if (form == "GGL") closing[m_] = g[0];
    } else {
      Eigen::Map<Eigen::VectorXd>(closing, m_) = J * a + drive(q, s, v);
    }
  }
  void explicit_equations(const double* guess, const double* y, const double* yp, double* r) const {
    double s[ns], a[nv], lam[most], rate[nq];
    std::copy(guess, guess + ns, s);
    find_contact(y, s);
    system_.kinematics(y, y + nq, rate);
    motion(y, s, y + nq, a, lam);
    for (int i = 0; i < nq; ++i) r[i] = yp[i] - rate[i];
    for (int j = 0; j < nv; ++j) r[nq + j] = yp[nq + j] - a[j];
  }
  template <class T>
  T energy(const T* q, const T* v) const {
    T sum = system_.potential(q);
    for (int j = 0; j < nv; ++j) sum = sum + 0.5 * system_.mass(j) * v[j] * v[j];
    return sum;
  }
  /// values(q, s, v, out) for doubles and duals.
  template <class Values>
  problems::Rows rows(const std::string& name, int count, Values values) const {
    std::vector<std::string> names;
    for (int i = 0; i < count; ++i) names.push_back(name + " " + std::to_string(i));
    return problems::make_rows(
        name, names,
        [values](double, const double* y, double* g) { values(y, y + nq + nv, y + nq, g); },
        [values, count, N = nq + nv + ns + m_, ggl = ggl_](double, const double* y, double* C) {
          constexpr int used = nq + nv + ns;
          for (int j = 0; j < used; ++j) {
            Dual Y[used], out[8];
            for (int i = 0; i < used; ++i) Y[i] = {y[i], i == j ? 1.0 : 0.0};
            values(Y, Y + nq + nv, Y + nq, out);
            for (int i = 0; i < count; ++i) C[i * (N + ggl) + j] = out[i].b;
          }
        });
  }

  Problem make(const std::string& name, const std::string& form, std::vector<double> q,
               std::vector<double> v, std::vector<double> s, double t_end) {
    const bool reduced = form == "explicit";
    ggl_ = form == "GGL" ? 1 : 0;
    find_contact(q.data(), s.data());
    double a[nv], lam[most], rate[nq];
    motion(q.data(), s.data(), v.data(), a, lam);
    system_.kinematics(q.data(), v.data(), rate);
    std::vector<double> y(q), yp(rate, rate + nq);
    y.insert(y.end(), v.begin(), v.end());
    yp.insert(yp.end(), a, a + nv);
    std::vector<double> id(y.size(), 1.0);
    if (!reduced) {
      y.insert(y.end(), s.begin(), s.end());
      y.insert(y.end(), lam, lam + m_);
      y.resize(y.size() + static_cast<std::size_t>(ggl_), 0.0);
      yp.resize(y.size(), 0.0);
      id.resize(y.size(), 0.0);
    }
    const int index = reduced ? 0 : form.rfind("index 1", 0) == 0 ? 1 : 2;
    Problem p = problems::start_problem(name, form, index, t_end, y, yp, id);
    p.error_components = nq;
    const Rolling self = *this;
    if (reduced) {
      p.residual = [self, guess = s](double, const double* y_, const double* yp_,
                                     double* r) mutable {
        self.find_contact(y_, guess.data());
        self.explicit_equations(guess.data(), y_, yp_, r);
      };
      return p;
    }
    p.residual = [self, form](double, const double* y_, const double* yp_, double* r) {
      self.equations(form, y_, yp_, r);
    };
    if (ggl_ != 0) {
      p.atol_scale.assign(y.size(), 1.0);
      p.atol_scale.back() = 1e15;
    }
    const double start = energy(q.data(), v.data());
    const System system = system_;
    p.rows = {rows("gap", system_.gaps(),
                   [system](const auto* q_, const auto* s_, const auto*, auto* r) {
                     system.gap(q_, s_, r);
                   }),
              rows("rate", m_,
                   [system](const auto* q_, const auto* s_, const auto* v_, auto* r) {
                     system.rate(q_, s_, v_, r);
                   }),
              rows("energy", 1,
                   [self, start](const auto* q_, const auto*, const auto* v_, auto* r) {
                     r[0] = self.energy(q_, v_) - start;
                   }),
              rows("tangency", ns, [system](const auto* q_, const auto* s_, const auto*, auto* r) {
                system.tangency(q_, s_, r);
              })};
    p.recommended = {"gap", "rate", "energy"};
    return p;
  }

 private:
  System system_;
  int m_;
  int ggl_ = 0;
};

}  // namespace

std::vector<std::string> contact_forms() { return {"index 1", "index 1 a", "index 2", "GGL"}; }

problems::Problem wheel_on_rail(const std::string& form, bool rolling, double t_end,
                                double amplitude, double scale) {
  const Wheel wheel{amplitude, scale, rolling};
  // Upright on the crest at x = 0, rolling to the right.
  const double height = scale * (amplitude + wheel.half_y), root = std::sqrt(scale);
  const double speed = 1.0 * root, turn = rolling ? -speed / (wheel.half_y * scale) : 0.3 / root;
  Problem p = Rolling<Wheel>(wheel).make(
      std::string("wheel on rail") + (rolling ? ", rolling" : ""), form, {0.0, height, 0.0},
      {speed, 0.0, turn}, {-1.5707963267948966, 0.0}, t_end);
  if (scale != 1.0) {
    std::vector<double> units = {scale, scale, 1.0, root, root, 1.0 / root};
    if (form != "explicit") units.insert(units.end(), {1.0, scale});
    if (p.atol_scale.empty()) p.atol_scale.assign(p.y0.size(), 1.0);
    std::copy(units.begin(), units.end(), p.atol_scale.begin());
  }
  return p;
}

namespace {

template <class Body>
problems::Problem body_on_plane(const std::string& name, const Body& body, const std::string& form,
                                double t_end, std::vector<double> s) {
  const double w[3] = {0.4, 1.5, 0.7}, h = body.half[2];
  // Upright, so that body and space agree; the contact point is (0, 0, -h).
  const std::vector<double> v = {
      body.rolling ? w[1] * h : 0.2, body.rolling ? -w[0] * h : 0.0, 0.0, w[0], w[1], w[2]};
  s[2] = -h;
  return Rolling<Body>(body).make(name + " on plane" + (body.rolling ? ", rolling" : ""), form,
                                  {0.0, 0.0, h, 1.0, 0.0, 0.0, 0.0}, v, s, t_end);
}

}  // namespace

problems::Problem ellipsoid_on_plane(const std::string& form, bool rolling, double t_end) {
  return body_on_plane("ellipsoid", Ellipsoid{rolling}, form, t_end, {0.0, 0.0, 0.0});
}

problems::Problem superquadric_on_plane(const std::string& form, bool rolling, double t_end) {
  return body_on_plane("superquadric", Superquadric{{rolling}}, form, t_end, {0.0, 0.0, 0.0, 1.0});
}

}  // namespace tether::test

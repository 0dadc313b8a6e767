// Tether: Andrews' squeezer mechanism of the test set for IVP solvers. SPDX-License-Identifier:
// BSD-3-Clause
#include <cmath>
#include <problems/andrews.hpp>
#include <problems/mechanism.hpp>

namespace tether::problems {

namespace {

// Parameters of the test set, with its names.
constexpr double m1 = .04325, m2 = .00365, m3 = .02373, m4 = .00706, m5 = .07050, m6 = .00706,
                 m7 = .05498;
constexpr double I1 = 2.194e-6, I2 = 4.410e-7, I3 = 5.255e-6, I4 = 5.667e-7, I5 = 1.169e-5,
                 I6 = 5.667e-7, I7 = 1.912e-5;
constexpr double xa = -.06934, ya = -.00227, xb = -.03635, yb = .03273, xc = .014, yc = .072;
constexpr double c0 = 4530, d = .028, da = .0115, e = .02, ea = .01421, rr = .007, ra = .00092,
                 l0 = .07785;
constexpr double ss = .035, sa = .01874, sb = .01043, sc = .018, sd = .02, ta = .02308, tb = .00916,
                 u = .04, ua = .01228, ub = .00449, zf = .02, zt = .04, fa = .01421, mom = .033;
constexpr double k2 = m2 * da * rr, k4 = m4 * zt * (e - ea), k6 = m6 * u * (zf - fa);
constexpr double kEnergy = 1.437832957532139873;

// Each pair of constraints is a sum of arms P_k = length (cos A_k, sin A_k), or the same turned by
// a right angle, whose angles A_k are sums of unknowns:
//   A = (q0, q0 + q1, q2, q3 + q4, q4, q5 + q6, q6),
//   g = (P0 + P1 + P2 - b, P0 + P1 + P3 + P4 - a, P0 + P1 + P5 + P6 - a).
struct Arms {
  double x[7], y[7];

  explicit Arms(const double* q) {
    double angle[7];
    angles(q, angle);
    along(0, rr, angle[0]);
    along(1, -d, angle[1]);
    across(2, ss, angle[2]);
    across(3, e, angle[3]);
    along(4, -zt, angle[4]);
    along(5, -zf, angle[5]);
    across(6, u, angle[6]);
  }

  static void angles(const double* q, double* angle) {
    angle[0] = q[0];
    angle[1] = q[0] + q[1];
    angle[2] = q[2];
    angle[3] = q[3] + q[4];
    angle[4] = q[4];
    angle[5] = q[5] + q[6];
    angle[6] = q[6];
  }

 private:
  void along(int k, double length, double angle) {
    x[k] = length * std::cos(angle);
    y[k] = length * std::sin(angle);
  }
  void across(int k, double length, double angle) {
    x[k] = -length * std::sin(angle);
    y[k] = length * std::cos(angle);
  }
};

// The three pairs of sums over the arms of vectors (x_k, y_k).
void pair_sums(const double* x, const double* y, double* r) {
  const double px = x[0] + x[1], py = y[0] + y[1];
  r[0] = px + x[2];
  r[1] = py + y[2];
  r[2] = px + x[3] + x[4];
  r[3] = py + y[3] + y[4];
  r[4] = px + x[5] + x[6];
  r[5] = py + y[5] + y[6];
}

// The same with derivatives (x_k, y_k) to A_k: 6 x 7 entries of the derivative to q.
void pair_gradients(const double* x, const double* y, double* G) {
  for (int pair = 0; pair < 3; ++pair) {
    double* gx = G + 14 * pair;
    double* gy = gx + 7;
    gx[0] = x[0] + x[1];
    gy[0] = y[0] + y[1];
    gx[1] = x[1];
    gy[1] = y[1];
  }
  G[2] = x[2];
  G[9] = y[2];
  G[14 + 3] = x[3];
  G[21 + 3] = y[3];
  G[14 + 4] = x[3] + x[4];
  G[21 + 4] = y[3] + y[4];
  G[28 + 5] = x[5];
  G[35 + 5] = y[5];
  G[28 + 6] = x[5] + x[6];
  G[35 + 6] = y[5] + y[6];
}

// Spring between c and a point of the third body: length and its derivatives to q2.
struct Spring {
  double length, slope, curvature;

  explicit Spring(double gamma) {
    const double s = std::sin(gamma), c = std::cos(gamma);
    const double rx = sd * c + sc * s + xb - xc, ry = sd * s - sc * c + yb - yc;
    const double dx = sc * c - sd * s, dy = sd * c + sc * s;
    length = std::sqrt(rx * rx + ry * ry);
    slope = (rx * dx + ry * dy) / length;
    const double second_x = -(sd * c + sc * s), second_y = sc * c - sd * s;
    curvature = (dx * dx + dy * dy + rx * second_x + ry * second_y - slope * slope) / length;
  }
  double energy() const { return c0 * (length - l0) * (length - l0) / 2.0; }
  double force() const { return -c0 * (length - l0) * slope; }
  double force_slope() const { return -c0 * (slope * slope + (length - l0) * curvature); }
};

struct Andrews {
  static constexpr int n = 7, m = 6;
  static constexpr double sign = 1.0;

  void mass(const double* q, double* M) const {
    const double th = k2 * std::cos(q[1]), ph = k4 * std::sin(q[3]), om = k6 * std::sin(q[5]);
    M[0] = m1 * ra * ra + m2 * (rr * rr + da * da) - 2.0 * th + I1 + I2;
    M[1] = M[7] = m2 * da * da - th + I2;
    M[8] = m2 * da * da + I2;
    M[16] = m3 * (sa * sa + sb * sb) + I3;
    M[24] = m4 * (e - ea) * (e - ea) + I4;
    M[25] = M[31] = m4 * (e - ea) * (e - ea) + ph + I4;
    M[32] = m4 * (zt * zt + (e - ea) * (e - ea)) + 2.0 * ph + m5 * (ta * ta + tb * tb) + I4 + I5;
    M[40] = m6 * (zf - fa) * (zf - fa) + I6;
    M[41] = M[47] = m6 * (zf - fa) * (zf - fa) - om + I6;
    M[48] = m6 * ((zf - fa) * (zf - fa) + u * u) - 2.0 * om + m7 * (ua * ua + ub * ub) + I6 + I7;
  }

  void force(double, const double* q, const double* v, double* f) const {
    const double th = k2 * std::sin(q[1]), ph = k4 * std::cos(q[3]), om = k6 * std::cos(q[5]);
    f[0] = mom - th * v[1] * (v[1] + 2.0 * v[0]);
    f[1] = th * v[0] * v[0];
    f[2] = Spring(q[2]).force();
    f[3] = ph * v[4] * v[4];
    f[4] = -ph * v[3] * (v[3] + 2.0 * v[4]);
    f[5] = -om * v[6] * v[6];
    f[6] = om * v[5] * (v[5] + 2.0 * v[6]);
  }

  void position(double, const double* q, double* r) const { position_of(Arms(q), r); }
  void gradient(double, const double* q, double* G) const { gradient_of(Arms(q), G); }
  void velocity(double, const double* q, const double* v, double* r) const {
    velocity_of(Arms(q), v, r);
  }
  void velocity_gradient(double, const double* q, const double* v, double* H) const {
    velocity_gradient_of(Arms(q), v, H);
  }
  void position_with_gradient(double, const double* q, double* r, double* G) const {
    const Arms P(q);
    position_of(P, r);
    gradient_of(P, G);
  }
  void velocity_with_gradients(double, const double* q, const double* v, double* r, double* G,
                               double* H) const {
    const Arms P(q);
    velocity_of(P, v, r);
    gradient_of(P, G);
    velocity_gradient_of(P, v, H);
  }

  static void position_of(const Arms& P, double* r) {
    pair_sums(P.x, P.y, r);
    r[0] -= xb;
    r[1] -= yb;
    r[2] -= xa;
    r[3] -= ya;
    r[4] -= xa;
    r[5] -= ya;
  }

  static void gradient_of(const Arms& P, double* G) {
    double x[7], y[7];
    for (int k = 0; k < 7; ++k) {
      x[k] = -P.y[k];
      y[k] = P.x[k];
    }
    pair_gradients(x, y, G);
  }

  static void velocity_of(const Arms& P, const double* v, double* r) {
    double rate[7], x[7], y[7];
    Arms::angles(v, rate);
    for (int k = 0; k < 7; ++k) {
      x[k] = -P.y[k] * rate[k];
      y[k] = P.x[k] * rate[k];
    }
    pair_sums(x, y, r);
  }

  static void velocity_gradient_of(const Arms& P, const double* v, double* H) {
    double rate[7], x[7], y[7];
    Arms::angles(v, rate);
    for (int k = 0; k < 7; ++k) {
      x[k] = -P.x[k] * rate[k];
      y[k] = -P.y[k] * rate[k];
    }
    pair_gradients(x, y, H);
  }

  void acceleration(double, const double* q, const double* v, const double* a, double* r) const {
    const Arms P(q);
    double rate[7], second[7], x[7], y[7];
    Arms::angles(v, rate);
    Arms::angles(a, second);
    for (int k = 0; k < 7; ++k) {
      x[k] = -P.y[k] * second[k] - P.x[k] * rate[k] * rate[k];
      y[k] = P.x[k] * second[k] - P.y[k] * rate[k] * rate[k];
    }
    pair_sums(x, y, r);
  }

  void acceleration_gradient(double, const double* q, const double* v, const double* a,
                             double* K) const {
    const Arms P(q);
    double rate[7], second[7], x[7], y[7];
    Arms::angles(v, rate);
    Arms::angles(a, second);
    for (int k = 0; k < 7; ++k) {
      x[k] = -P.x[k] * second[k] + P.y[k] * rate[k] * rate[k];
      y[k] = -P.y[k] * second[k] - P.x[k] * rate[k] * rate[k];
    }
    pair_gradients(x, y, K);
  }

  void dynamics_gradient(double, const double* q, const double* v, const double* a,
                         const double* lam, double* Dq, double* Dv) const {
    const double ths = k2 * std::sin(q[1]), thc = k2 * std::cos(q[1]);
    const double phs = k4 * std::sin(q[3]), phc = k4 * std::cos(q[3]);
    const double oms = k6 * std::sin(q[5]), omc = k6 * std::cos(q[5]);
    Dq[1] = ths * (2.0 * a[0] + a[1]) + thc * v[1] * (v[1] + 2.0 * v[0]);
    Dq[8] = ths * a[0] - thc * v[0] * v[0];
    Dq[16] = -Spring(q[2]).force_slope();
    Dq[24] = phc * a[4] + phs * v[4] * v[4];
    Dq[31] = phc * (a[3] + 2.0 * a[4]) - phs * v[3] * (v[3] + 2.0 * v[4]);
    Dq[40] = -omc * a[6] - oms * v[6] * v[6];
    Dq[47] = -omc * (a[5] + 2.0 * a[6]) + oms * v[5] * (v[5] + 2.0 * v[6]);

    Dv[0] = 2.0 * ths * v[1];
    Dv[1] = 2.0 * ths * (v[0] + v[1]);
    Dv[7] = -2.0 * ths * v[0];
    Dv[25] = -2.0 * phc * v[4];
    Dv[31] = 2.0 * phc * (v[3] + v[4]);
    Dv[32] = 2.0 * phc * v[3];
    Dv[41] = 2.0 * omc * v[6];
    Dv[47] = -2.0 * omc * (v[5] + v[6]);
    Dv[48] = -2.0 * omc * v[5];

    // (G^T lam)_q: -P_k . lam on the unknowns of A_k.
    const Arms P(q);
    const double all_x = lam[0] + lam[2] + lam[4], all_y = lam[1] + lam[3] + lam[5];
    const double lx[7] = {all_x, all_x, lam[0], lam[2], lam[2], lam[4], lam[4]};
    const double ly[7] = {all_y, all_y, lam[1], lam[3], lam[3], lam[5], lam[5]};
    double h[7];
    for (int k = 0; k < 7; ++k) h[k] = -(P.x[k] * lx[k] + P.y[k] * ly[k]);
    Dq[0] += h[0] + h[1];
    Dq[1] += h[1];
    Dq[7] += h[1];
    Dq[8] += h[1];
    Dq[16] += h[2];
    Dq[24] += h[3];
    Dq[25] += h[3];
    Dq[31] += h[3];
    Dq[32] += h[3] + h[4];
    Dq[40] += h[5];
    Dq[41] += h[5];
    Dq[47] += h[5];
    Dq[48] += h[5] + h[6];
  }
};

using Form = Mechanism<Andrews>;

double energy(const double* q, const double* v) {
  Form::MatrixN M = Form::MatrixN::Zero();
  Andrews{}.mass(q, M.data());
  const Eigen::Map<const Form::VectorN> rate(v);
  const Form::VectorN momentum = M * rate;
  return momentum.dot(rate) / 2.0 + Spring(q[2]).energy() - mom * q[0];
}

void energy_gradient(const double* q, const double* v, double* C) {
  C[0] = -mom;
  C[1] = k2 * std::sin(q[1]) * v[0] * (v[0] + v[1]);
  C[2] = -Spring(q[2]).force();
  C[3] = k4 * std::cos(q[3]) * v[4] * (v[3] + v[4]);
  C[5] = -k6 * std::cos(q[5]) * v[6] * (v[5] + v[6]);
  Form::MatrixN M = Form::MatrixN::Zero();
  Andrews{}.mass(q, M.data());
  Eigen::Map<Form::VectorN>(C + 7).noalias() = M * Eigen::Map<const Form::VectorN>(v);
}

}  // namespace

std::vector<std::string> andrews_forms() { return Form::forms(); }

Problem andrews(const std::string& form) {
  Problem p = Form::make(Andrews{}, "andrews", form,
                         {-0.0617138900142764496358948458001, 0.0, 0.455279819163070380255912382449,
                          0.222668390165885884674473185609, 0.487364979543842550225598953530,
                          -0.222668390165885884674473185609, 1.23054744454982119249735015568},
                         std::vector<double>(7, 0.0),
                         {"x to b", "y to b", "x to a", "y to a", "x to a 2", "y to a 2"});
  p.t_end = 0.03;
  p.rows.push_back(make_rows(
      "energy", {"energy"},
      [](double, const double* y, double* r) { r[0] = energy(y, y + 7) - kEnergy; },
      [](double, const double* y, double* C) { energy_gradient(y, y + 7, C); }));
  p.recommended = {"position", "velocity", "energy"};

  // Converged angles and beta'; the other velocities follow from G v = 0.
  const std::vector<double> q{15.8107711951537071, -15.7563710584118395, 0.0408222401196458,
                              -0.5347301163420796, 0.5244099658799541,   0.5347301163420796,
                              1.0480807410419379};
  Form::MatrixG G = Form::MatrixG::Zero();
  Andrews{}.gradient(p.t_end, q.data(), G.data());
  std::vector<double> v(7, 1139.920302259106);
  Eigen::Map<Eigen::Matrix<double, 6, 1>>(v.data() + 1) =
      G.rightCols<6>().fullPivLu().solve(-v[0] * G.col(0));
  double a[7];
  std::vector<double> lam(6);
  Form::solve_motion(Andrews{}, p.t_end, q.data(), v.data(), a, lam.data());
  Form::set_reference(Andrews{}, q, v, lam, p);
  return p;
}

}  // namespace tether::problems

// Tether: flyball governor. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <map>
#include <problems/cosine_rows.hpp>
#include <problems/governor.hpp>
#include <problems/mechanism.hpp>
#include <problems/reference.hpp>

namespace tether::problems {

namespace {

constexpr double kGravity = 9.81, kHalfTurn = 3.14159265358979323846;
constexpr double kPivot = 0.05, kStiffness = 8e5, kDamping = 4e4, kRest = 0.5;
constexpr double kRod = 0.3, kBall = 5.0, kArm = kRod + kBall, kSlider = 3.0, kWidth = 0.01;
constexpr double kCentre = (0.5 * kRod + kBall) / kArm;  // of an arm's mass, from the pivot
// Moments of an arm about its centre of mass, along and across; of shaft and slider about z.
constexpr double kAlong = kRod * kWidth * kWidth / 6.0;
constexpr double kAcross = kRod * (1.0 + kWidth * kWidth) / 12.0 +
                           kRod * (kCentre - 0.5) * (kCentre - 0.5) +
                           kBall * (1.0 - kCentre) * (1.0 - kCentre);
constexpr double kShaftMoment = kRod * kWidth * kWidth / 6.0, kSliderMoment = kSlider * 0.01 / 6.0;

enum Coordinate { height = 0, arms = 1, shaft = 3, bodies = 4, slider = 12 };
constexpr int body(int arm) { return bodies + 4 * arm; }  // x, y, z, angle about z
constexpr double side(int arm) { return arm == 0 ? 1.0 : -1.0; }

CosineRows joints() {
  CosineRows g(9, 13);
  g.linear(0, slider, 1.0);
  g.linear(0, shaft, -1.0);
  for (int k = 0; k < 2; ++k) {
    const int at = body(k), turn = at + 3, row = 3 + 3 * k;
    g.linear(1 + k, turn, 1.0);
    g.linear(1 + k, shaft, -1.0);
    for (int i = 0; i < 3; ++i) g.linear(row + i, at + i, 1.0);
    for (int i = 0; i < 2; ++i) {
      g.product(row + i, -side(k) * kCentre, turn, arms + k, i == 1);
      g.cosine(row + i, -side(k) * kPivot, shaft, i == 1);
    }
    g.cosine(row + 2, kCentre, arms + k, true);
    g.constant(row + 2, -1.0);
  }
  return g;
}

// From the slider's point to the centre of an arm's rod.
CosineRows spring(int k) {
  CosineRows w(3, 13);
  const int at = body(k), turn = at + 3;
  for (int i = 0; i < 3; ++i) w.linear(i, at + i, 1.0);
  for (int i = 0; i < 2; ++i) {
    w.product(i, -side(k) * (kCentre - 0.5), turn, arms + k, i == 1);
    w.cosine(i, -side(k) * kPivot, slider, i == 1);
  }
  w.cosine(2, kCentre - 0.5, arms + k, true);
  w.linear(2, height, -1.0);
  return w;
}

/// Moment of an arm about z and its derivatives to the arm's angle.
struct Moment {
  double value, slope, second;
  explicit Moment(double arm)
      : value(kAcross + (kAlong - kAcross) * std::sin(arm) * std::sin(arm)),
        slope((kAlong - kAcross) * std::sin(2.0 * arm)),
        second(2.0 * (kAlong - kAcross) * std::cos(2.0 * arm)) {}
};

struct Governor {
  static constexpr int n = 13, m = 9;
  static constexpr double sign = 1.0;
  using Vector = Eigen::Matrix<double, n, 1>;
  using Matrix3 = Eigen::Matrix<double, 3, n, Eigen::RowMajor>;
  using MatrixN = Eigen::Matrix<double, n, n, Eigen::RowMajor>;

  CosineRows rows = joints();
  std::array<CosineRows, 2> springs = {spring(0), spring(1)};

  void mass(const double* q, double* M) const {
    const auto set = [M](int i, double entry) { M[i * (n + 1)] = entry; };
    set(height, kSlider);
    set(shaft, kShaftMoment);
    set(slider, kSliderMoment);
    for (int k = 0; k < 2; ++k) {
      set(arms + k, kAcross);
      for (int i = 0; i < 3; ++i) set(body(k) + i, kArm);
      set(body(k) + 3, Moment(q[arms + k]).value);
    }
  }

  // The force of a spring on the rod's centre is -pull.
  struct Pull {
    Eigen::Vector3d direction, rate, pull;
    double length, size;
    Matrix3 J = Matrix3::Zero();
    Pull(const CosineRows& rows, const double* q, const double* v) {
      rows.position(q, direction.data());
      rows.velocity(q, v, rate.data());
      rows.gradient(q, J.data());
      length = direction.norm();
      direction /= length;
      size = kStiffness * (length - kRest) + kDamping * direction.dot(rate);
      pull = size * direction;
    }
  };

  void force(double, const double* q, const double* v, double* f) const {
    Eigen::Map<Vector> out(f);
    out.setZero();
    out[height] = -kSlider * kGravity;
    for (int k = 0; k < 2; ++k) {
      const int at = body(k);
      const Moment moment(q[arms + k]);
      const double turn = v[at + 3], swing = v[arms + k];
      out[at + 2] = -kArm * kGravity;
      out[arms + k] += 0.5 * moment.slope * turn * turn;
      out[at + 3] -= moment.slope * swing * turn;
      const Pull pull(springs[static_cast<std::size_t>(k)], q, v);
      out.noalias() -= pull.J.transpose() * pull.pull;
    }
  }

  void position(double, const double* q, double* r) const { rows.position(q, r); }
  void gradient(double, const double* q, double* G) const { rows.gradient(q, G); }
  void velocity(double, const double* q, const double* v, double* r) const {
    rows.velocity(q, v, r);
  }
  void velocity_gradient(double, const double* q, const double* v, double* H) const {
    rows.velocity_gradient(q, v, H);
  }
  void acceleration(double, const double* q, const double* v, const double* a, double* r) const {
    rows.acceleration(q, v, a, r);
  }
  void acceleration_gradient(double, const double* q, const double* v, const double* a,
                             double* K) const {
    rows.acceleration_gradient(q, v, a, K);
  }

  void dynamics_gradient(double, const double* q, const double* v, const double* a,
                         const double* lam, double* Dq, double* Dv) const {
    rows.curvature(q, lam, Dq);
    Eigen::Map<MatrixN> to_q(Dq), to_v(Dv);
    for (int k = 0; k < 2; ++k) {
      const int arm = arms + k, turn = body(k) + 3;
      const Moment moment(q[arm]);
      to_q(turn, arm) += moment.slope * a[turn] + moment.second * v[arm] * v[turn];
      to_v(turn, arm) += moment.slope * v[turn];
      to_v(turn, turn) += moment.slope * v[arm];
      to_q(arm, arm) -= 0.5 * moment.second * v[turn] * v[turn];
      to_v(arm, turn) -= moment.slope * v[turn];
      const CosineRows& spring = springs[static_cast<std::size_t>(k)];
      const Pull p(spring, q, v);
      spring.curvature(q, p.pull.data(), Dq);
      // d pull = along dw + across d(dw/dt)
      const Eigen::Vector3d& u = p.direction;
      const Eigen::Matrix3d turned = (Eigen::Matrix3d::Identity() - u * u.transpose()) / p.length;
      const Eigen::Matrix3d across = kDamping * u * u.transpose();
      const Eigen::Matrix3d along = p.size * turned + kStiffness * u * u.transpose() +
                                    kDamping * u * (p.rate.transpose() * turned);
      Matrix3 H = Matrix3::Zero();
      spring.velocity_gradient(q, v, H.data());
      to_q.noalias() += p.J.transpose() * (along * p.J + across * H);
      to_v.noalias() += p.J.transpose() * (across * p.J);
    }
  }
};

double angular_momentum(const double* q, const double* v) {
  double sum = kShaftMoment * v[shaft] + kSliderMoment * v[slider];
  for (int k = 0; k < 2; ++k) {
    const int at = body(k);
    sum += kArm * (q[at] * v[at + 1] - q[at + 1] * v[at]) + Moment(q[arms + k]).value * v[at + 3];
  }
  return sum;
}

void angular_momentum_gradient(const double* q, const double* v, double* to_q, double* to_v) {
  to_v[shaft] = kShaftMoment;
  to_v[slider] = kSliderMoment;
  for (int k = 0; k < 2; ++k) {
    const int at = body(k);
    const Moment moment(q[arms + k]);
    to_q[at] = kArm * v[at + 1];
    to_q[at + 1] = -kArm * v[at];
    to_v[at] = -kArm * q[at + 1];
    to_v[at + 1] = kArm * q[at];
    to_q[arms + k] = moment.slope * v[at + 3];
    to_v[at + 3] = moment.value;
  }
}

// Both arms alike: height s and its speed, arm angle and its rate, angle of the shaft.
using Real = long double;
using State = std::array<Real, 5>;

struct Symmetric {
  Real momentum;

  static Real moment(Real arm, Real* slope) {
    const Real radius = kPivot + kCentre * std::cos(arm), s = std::sin(arm), c = std::cos(arm);
    *slope = 2 * (-2 * kArm * radius * kCentre * s + 2 * (Real(kAlong) - kAcross) * s * c);
    return 2 * (kArm * radius * radius + kAcross + (Real(kAlong) - kAcross) * s * s) +
           kShaftMoment + kSliderMoment;
  }

  void operator()(const State& y, State& dy) const {
    const Real s = std::sin(y[2]), c = std::cos(y[2]);
    Real slope;
    const Real spin = momentum / moment(y[2], &slope);
    const Real wx = c / 2, wz = 1 - s / 2 - y[0], length = std::sqrt(wx * wx + wz * wz);
    const Real rate = (-wx * s * y[3] / 2 - wz * (c * y[3] / 2 + y[1])) / length;
    const Real tension = 2 * (kStiffness * (length - kRest) + kDamping * rate) / length;
    dy[0] = y[1];
    dy[1] = -Real(kGravity) + tension * wz / kSlider;
    dy[2] = y[3];
    dy[3] = (slope * spin * spin / 2 + 2 * kArm * Real(kGravity) * kCentre * c +
             tension * (wx * s + wz * c) / 2) /
            (2 * (Real(kArm) * kCentre * kCentre + kAcross));
    dy[4] = spin;
  }
};

std::vector<double> coordinates(const GovernorState& s) {
  std::vector<double> q = {s.height, s.arm, s.arm, s.turn};
  for (int k = 0; k < 2; ++k) {
    const double radius = side(k) * (kPivot + kCentre * std::cos(s.arm));
    for (const double entry : {radius * std::cos(s.turn), radius * std::sin(s.turn),
                               1.0 - kCentre * std::sin(s.arm), s.turn})
      q.push_back(entry);
  }
  q.push_back(s.turn);
  return q;
}

std::vector<double> velocities(const GovernorState& s) {
  std::vector<double> v = {s.speed, s.arm_rate, s.arm_rate, s.spin};
  const double cosine = std::cos(s.turn), sine = std::sin(s.turn);
  for (int k = 0; k < 2; ++k) {
    const double radius = side(k) * (kPivot + kCentre * std::cos(s.arm));
    const double outward = -side(k) * kCentre * std::sin(s.arm) * s.arm_rate;
    for (const double entry :
         {outward * cosine - radius * sine * s.spin, outward * sine + radius * cosine * s.spin,
          -kCentre * std::cos(s.arm) * s.arm_rate, s.spin})
      v.push_back(entry);
  }
  v.push_back(s.spin);
  return v;
}

const GovernorState kStart = {0.5, 0.0, kHalfTurn / 6.0, 0.0, 0.0, 2.0 * kHalfTurn};

}  // namespace

std::vector<std::string> governor_forms() { return Mechanism<Governor>::forms(); }

GovernorState governor_exact(double t) {
  static std::map<double, GovernorState> known;  // a tenth of a second each
  if (const auto found = known.find(t); found != known.end()) return found->second;
  Real slope;
  const Symmetric motion{Symmetric::moment(kStart.arm, &slope) * kStart.spin};
  const State end =
      reference_solution<5>(motion, State{kStart.height, 0, kStart.arm, 0, 0}, t, 3e-4L);
  const Real spin = motion.momentum / Symmetric::moment(end[2], &slope);
  const GovernorState state = {static_cast<double>(end[0]), static_cast<double>(end[1]),
                               static_cast<double>(end[2]), static_cast<double>(end[3]),
                               static_cast<double>(end[4]), static_cast<double>(spin)};
  return known[t] = state;
}

Problem governor(double t_end, const std::string& form) {
  const Governor system;
  std::vector<std::string> names = {"slider turns with the shaft", "right arm turns with the shaft",
                                    "left arm turns with the shaft"};
  for (const char* arm : {"right", "left"})
    for (const char* axis : {" x", " y", " z"}) names.push_back(std::string(arm) + " hinge" + axis);
  Problem p = Mechanism<Governor>::make(system, "governor", form, coordinates(kStart),
                                        velocities(kStart), names);
  p.t_end = t_end;
  const double momentum = angular_momentum(p.y0.data(), p.y0.data() + Governor::n);
  p.rows.push_back(make_rows(
      "angular momentum", {"angular momentum about z"},
      [momentum](double, const double* y, double* r) {
        r[0] = angular_momentum(y, y + Governor::n) - momentum;
      },
      [](double, const double* y, double* C) {
        angular_momentum_gradient(y, y + Governor::n, C, C + Governor::n);
      }));
  p.recommended = {"position", "velocity", "angular momentum"};
  const GovernorState end = governor_exact(t_end);
  const std::vector<double> q = coordinates(end), v = velocities(end);
  Eigen::Matrix<double, Governor::n, 1> a;
  std::vector<double> lam(Governor::m);
  Mechanism<Governor>::solve_motion(system, t_end, q.data(), v.data(), a.data(), lam.data());
  Mechanism<Governor>::set_reference(system, q, v, lam, p);
  return p;
}

}  // namespace tether::problems

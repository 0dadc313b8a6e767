// Tether: what the judge of a certificate knows, and the laws that it asks.
// SPDX-License-Identifier: BSD-3-Clause
//
// Bounds are parts of the impulses, forces or speeds of the same body or contact. Records of smooth
// motion are compared by a formula of fourth order, whose error they bound themselves.
#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "judge.hpp"
#include "judged_joint.hpp"
#include "natural_map.hpp"
#include "reader.hpp"

namespace tether::scene::certificate {

using Eigen::Matrix3d;

inline constexpr double kBalance = 1e-6;    // of the impulses or forces on a body
inline constexpr double kLaw = 1e-6;        // of the speeds at contacts
inline constexpr double kUseful = 1e-2;     // residual of a problem whose solution a step may use
inline constexpr double kSlow = 1e-3;       // m/s: what may stop with no contact that pushes
inline constexpr double kHolds = 1e-6;      // of the arms and speeds of a joint
inline constexpr double kTimes = 1e-15;     // of times: their rounding
inline constexpr double kRounding = 1e-9;   // of places, times and frames
inline constexpr double kEquations = 1e-5;  // of the forces at an instant
inline constexpr double kInstant = 1e-4;    // of accelerations and speeds of smooth motion
inline constexpr double kLeads = 1e-5;      // of momenta and places from one instant to the next
inline constexpr std::size_t kTold = 10;    // faults

inline double apart(const Quaterniond& p, const Quaterniond& q) {
  return 2 * std::min((p.coeffs() - q.coeffs()).norm(), (p.coeffs() + q.coeffs()).norm());
}
inline double apart(const Told& a, const Told& b) {
  return (a.x - b.x).norm() + (a.v - b.v).norm() + (a.w - b.w).norm() + apart(a.q, b.q);
}
inline Told told(const std::vector<double>& n, std::size_t k) {
  Told s;
  s.x = vector(n, k), s.q = quaternion(n, k + 3), s.v = vector(n, k + 7), s.w = vector(n, k + 10);
  return s;
}

/// Impulse, or force, and its moment about the centre; the sums of their sizes.
struct Load {
  Vector3d force = Vector3d::Zero(), torque = Vector3d::Zero();
  double forces = 0, torques = 0;
  void add(const Vector3d& f, const Vector3d& m) {
    force += f, torque += m;
    forces += f.norm(), torques += m.norm();
  }
};

struct JudgedBody {
  double mass = 0;
  double material = -1;
  Matrix3d inertia = Matrix3d::Zero();
  std::string name;
  std::optional<Told> state;
  double time = 0;
  Vector3d belt = Vector3d::Zero(), belt_turn = Vector3d::Zero(), axis = Vector3d::Zero();

  bool is_round() const {
    return (inertia - inertia(0, 0) * Matrix3d::Identity()).cwiseAbs().maxCoeff() <=
           1e-13 * inertia(0, 0);
  }
  Vector3d spin(const Quaterniond& q, const Vector3d& w) const {
    return q * (inertia * (q.conjugate() * w));
  }
  Vector3d unspin(const Quaterniond& q, const Vector3d& momentum) const {
    return q * (inertia.inverse() * (q.conjugate() * momentum));
  }
  Told struck(const Load& load) const {
    Told s = *state;
    s.v += load.force / mass, s.w += unspin(s.q, load.torque);
    return s;
  }
  /// Velocity of the surface against the body at a place from its centre.
  Vector3d belt_at(const Vector3d& r) const {
    return state->q * (belt + belt_turn.cross(state->q.conjugate() * r));
  }
};

struct JudgedPair {
  double along = 0, across = 0, restitution = 0, rolling = 0, torsional = 0;
};

struct JudgedContact {
  explicit JudgedContact(const std::vector<double>& m)
      : body{m[0], m[1]},
        on{vector(m, 2), vector(m, 5)},
        n(vector(m, 8)),
        gap(m[11]),
        bias(m[12]),
        slip(vector(m, 13)),
        x(vector(m, 16)),
        moment(vector(m, 19)) {}
  double body[2];
  Vector3d on[2], n;
  double gap, bias;
  Vector3d slip, x, moment;
};

/// A quantity of a body at an instant, its rate, and its size where it is small.
struct Led {
  Vector3d value, rate;
  double tiny;
};

/// Bodies at an instant: momentum, angular momentum, place, turn; orientation.
struct Instant {
  struct One {
    std::array<Led, 4> led;
    Quaterniond q;
  };
  double time = 0, events = 0;
  std::map<double, One> bodies;
};

class Judge {
 public:
  Verdict run(const std::string& file);

 private:
  using States = std::map<double, Told>;
  using Loads = std::map<double, Load>;

  void head(const Record& line);
  void finish();
  void end_of_step(std::optional<double> start);
  void expect(const char* law, double amount, double bound, const std::string& what);
  JudgedBody& body(double number);
  Told state(double number, const States* to = nullptr) const;
  template <class F>
  void each(const char* word, const F& f) {
    for (const Record& line : lines_)
      if (line.word == word) f(line.numbers, line.text);
  }
  States told_states() const;

  void judge_block();
  void part(const States& to);
  void push(double factor, const States& to, Loads& loads);
  void pull(const States& to, Loads& loads, Loads& late);
  void pull_of(const JudgedJoint& joint, const std::vector<double>& n, bool couples,
               const Told (&s)[2]);
  void push_by_contacts(Loads& loads);
  void contacts(double dt, const States& came, const States& free, const States& mid);
  double contact(const JudgedContact& c, double dt, const States& came, const States& free,
                 const States& mid, double& speed);
  std::pair<Friction, JudgedPair> friction(const JudgedContact& c);
  std::string name_of(const JudgedContact& c) {
    return body(c.body[0]).name + " on " + body(c.body[1]).name;
  }
  void law_of_joint(const std::vector<double>& n, double dt, const States& came, const States& mid);
  void moves(const JudgedBody& b, double dt, const Load& load, const Load& late, const Told& placed,
             const Told& end);
  void turns(const JudgedBody& b, double dt, const Load& load, const Load& late, const Told& placed,
             const Told& end);
  void extrapolated(const States& to);
  void hold(const States& to);
  void follows(const States& to);
  void instant(const States& to);
  void accelerates(const JudgedJoint& joint, const States& rates);
  void leads(double number);

  Verdict verdict_;
  std::map<double, JudgedBody> bodies_;
  std::map<std::pair<double, double>, JudgedPair> pairs_;
  std::map<double, JudgedJoint> joints_;
  std::map<double, double> reacts_;  // joints, and behind them those of couplings
  Vector3d gravity_ = Vector3d::Zero();
  bool keeps_momentum_ = true, associated_ = false, frictionless_ = false, moved_ = false;
  double step_ = 0, when_ = 0, claimed_ = 0;
  std::optional<double> until_;
  std::optional<Record> block_;
  std::vector<Record> lines_;
  std::map<double, std::pair<std::optional<Told>, double>> before_trial_;
  std::map<double, Told> trial_;                                     // its end
  std::map<std::pair<double, double>, std::vector<Vector3d>> near_;  // points of two bodies
  std::deque<Instant> past_;
};

}  // namespace tether::scene::certificate

// Tether: what a certificate tells: lines, bodies, joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/LU>
#include <array>
#include <fstream>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <tether/linalg/pi.hpp>
#include <vector>

#include "natural_map.hpp"

namespace tether::scene::certificate {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using Numbers = std::vector<double>;

/// A file that cannot be judged: damaged, cut, or with a part missing.
struct Damaged : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A line as docs/certificate.md explains it.
struct Record {
  std::string word, text;
  Numbers numbers;
};

/// Reads a certificate line by line.
class Reader {
 public:
  /// Throws Damaged, as next() does.
  explicit Reader(const std::string& file);
  /// False behind the last line, which says how many there are.
  bool next(Record& out);

 private:
  [[noreturn]] void refuse(const std::string& what) const;

  std::ifstream in_;
  std::vector<char> buffer_;  // of a line
  long line_ = 1;
  bool ended_ = false;
};

inline Vector3d vector(const Numbers& n, std::size_t k) { return {n[k], n[k + 1], n[k + 2]}; }
inline Quaterniond quaternion(const Numbers& n, std::size_t k) {
  return {n[k], n[k + 1], n[k + 2], n[k + 3]};
}
inline Quaterniond rotation(const Vector3d& v) {
  const double a = v.norm(), s = a > 0 ? std::sin(a / 2) / a : 0.5;
  return {std::cos(a / 2), s * v.x(), s * v.y(), s * v.z()};
}
inline double apart(const Quaterniond& p, const Quaterniond& q) {
  return 2 * std::min((p.coeffs() - q.coeffs()).norm(), (p.coeffs() + q.coeffs()).norm());
}

/// State of a body, world axes.
struct Told {
  Vector3d x = Vector3d::Zero(), v = Vector3d::Zero(), w = Vector3d::Zero();
  Quaterniond q = Quaterniond::Identity();
  /// Velocity of its point at this place from the centre.
  Vector3d velocity(const Vector3d& r) const { return v + w.cross(r); }
};
inline double apart(const Told& a, const Told& b) {
  return (a.x - b.x).norm() + (a.v - b.v).norm() + (a.w - b.w).norm() + apart(a.q, b.q);
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

struct ToldBody {
  double mass = 0, material = -1, time = 0;
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  std::string name;
  std::optional<Told> state;
  Vector3d belt = Vector3d::Zero(), belt_turn = Vector3d::Zero(), axis = Vector3d::Zero();

  bool is_round() const {
    return (inertia - inertia(0, 0) * Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <=
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

struct ToldContact {
  explicit ToldContact(const Numbers& m)
      : body{m[0], m[1]},
        on{vector(m, 2), vector(m, 5)},
        n(vector(m, 8)),
        gap(m[11]),
        bias(m[12]),
        slip(vector(m, 13)),
        x(vector(m, 16)),
        moment(vector(m, 19)) {}
  std::array<double, 2> body;
  Vector3d on[2], n;
  double gap, bias;
  Vector3d slip, x, moment;
};

/// A joint by its points and frames on both bodies alone. It holds directions of the second
/// body's frame in which points, and turns, do not move against each other.
class ToldJoint {
 public:
  explicit ToldJoint(const Record& line);

  /// Its bodies as they are.
  struct Place {
    Vector3d at, d;                     ///< the point on the first; from that on the second to it
    Quaterniond turn;                   ///< of the first frame in the second
    std::vector<Vector3d> held, turns;  ///< directions
    Vector3d z;                         ///< of laws
  };
  Place place(const Told (&s)[2]) const;

  /// Errors of places (m, rad), and of the speeds of points and of turns.
  std::array<Numbers, 3> errors(const Told (&s)[2], double t) const;
  /// How fast the errors of speeds grow, the largest of points and of turns, at these
  /// accelerations: by differences over a short time.
  std::array<double, 2> accelerations(const Told (&s)[2], const std::array<Vector3d, 2> (&rates)[2],
                                      double t) const;

  double arms() const { return point_[0].norm() + point_[1].norm(); }

  std::string kind, name;
  double body[2];  ///< numbers as the file has them; -1: the world
  bool has_laws;

 private:
  bool driven_;
  Vector3d point_[2];
  Quaterniond frame_[2];
  double length_, motion_[4];
  std::string held_, turns_;
};

}  // namespace tether::scene::certificate

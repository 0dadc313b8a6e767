// Tether: what a certificate tells: lines, bodies, rows of joints, contacts.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/LU>
#include <array>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "natural_map.hpp"

namespace tether::scene::certificate {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using Numbers = std::vector<double>;

/// The words of a certificate, which it begins with: the names of their numbers, `name:n` of n,
/// and a text at the end (docs/certificate.md).
extern const char* const kForms;

/// A file that cannot be judged: damaged, cut, or with a part missing.
struct Damaged : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A line.
struct Record {
  std::string word, text;
  Numbers numbers;
  double operator[](std::size_t k) const { return numbers[k]; }
  Vector3d vector(std::size_t k) const { return {numbers[k], numbers[k + 1], numbers[k + 2]}; }
  Quaterniond quaternion(std::size_t k) const {
    return {numbers[k], numbers[k + 1], numbers[k + 2], numbers[k + 3]};
  }
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
  // Valid until the next one; without data at the end of the file.
  std::string_view next_line() {
    ++line_;
    in_.getline(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
    if (in_.gcount() == 0) return {};
    if (!in_ || in_.eof()) refuse("it is cut, or longer than any");
    return {buffer_.data(), static_cast<std::size_t>(in_.gcount()) - 1};
  }

  std::ifstream in_;
  std::vector<char> buffer_;  // of a line
  long line_ = 0;
  bool ended_ = false;
};

/// The turn by |v| rad about v.
inline Quaterniond rotation(const Vector3d& v) {
  const double a = v.norm(), s = a > 0 ? std::sin(a / 2) / a : 0.5;
  return {std::cos(a / 2), s * v.x(), s * v.y(), s * v.z()};
}
/// Angle between two orientations, rad.
inline double apart(const Quaterniond& p, const Quaterniond& q) {
  return 2 * std::min((p.coeffs() - q.coeffs()).norm(), (p.coeffs() + q.coeffs()).norm());
}

/// State of a body, world axes.
struct State {
  Vector3d x = Vector3d::Zero(), v = Vector3d::Zero(), w = Vector3d::Zero();
  Vector3d a = Vector3d::Zero(), alpha = Vector3d::Zero();  ///< accelerations, of an instant
  Quaterniond q = Quaterniond::Identity();
  double time = 0;  ///< s
  State() = default;
  /// Reads a line `to`.
  State(const Record& to, double at)
      : x(to.vector(1)), v(to.vector(8)), w(to.vector(11)), q(to.quaternion(4)), time(at) {}
  /// Its state after a short time.
  State moved(double t) const {
    State s = *this;
    s.x += t * (v + t / 2 * a);
    s.q = rotation(t * (w + t / 2 * alpha)) * q;
    return s;
  }
  /// Velocity of its point at this place, m/s.
  Vector3d velocity(const Vector3d& p) const { return v + w.cross(p - x); }
};
using States = std::map<double, State>;  ///< by the number of the body

/// Impulse, or force, and its moment about the centre; the sums of their sizes.
struct Load {
  Vector3d force = Vector3d::Zero(), moment = Vector3d::Zero();
  double forces = 0, moments = 0;
  void add(const Vector3d& f, const Vector3d& m) {
    force += f, moment += m;
    forces += f.norm(), moments += m.norm();
  }
};

/// A body; mass 0: it is fixed, and nothing moves it.
struct ToldBody {
  explicit ToldBody(const Record& line);
  /// Angular momentum, world axes, and the angular velocity of one.
  Vector3d spin(const Quaterniond& q, const Vector3d& w) const {
    return q * (inertia * (q.conjugate() * w));
  }
  Vector3d unspin(const Quaterniond& q, const Vector3d& momentum) const {
    return q * (inverse * (q.conjugate() * momentum));
  }
  State struck(State s, const Load& load) const {
    s.v += light * load.force, s.w += unspin(s.q, load.moment);
    return s;
  }
  /// Velocity of the surface against the body at a place.
  Vector3d belt(const State& s, const Vector3d& p) const {
    return s.q * (surface + surface_spin.cross(s.q.conjugate() * (p - s.x)));
  }

  double mass, light, material;  ///< light: the inverse mass, 0: fixed
  Eigen::Matrix3d inertia, inverse;
  double radius = 0;  ///< from the trace of the inertia, m
  Vector3d surface, surface_spin, axis;
  std::string name;
};

/// One equation of a joint, or with `turn` and `way` a direction that it leaves free.
class ToldRow {
 public:
  explicit ToldRow(const Record& line);

  /// How far it is off, m or rad, and the impulse, or the moment, on its first body for an impulse
  /// of 1, with the place where it acts.
  struct Value {
    double off;
    Vector3d force, moment, at;
  };
  Value value(const State& a, const State& b, double time) const;
  /// Its motion's frequency, rad/s.
  double frequency() const;
  /// 1 m and the lengths of its arms.
  double reach() const { return 1 + on_.norm() + on_second_.norm(); }

  double first, second;  ///< numbers of bodies; -1: the world
  std::string name;

 private:
  std::string kind_;
  Vector3d on_, on_second_, axis_;
  double length_;
  std::array<double, 4> motion_;
};

/// A contact.
struct ToldContact {
  explicit ToldContact(const Record& m)
      : body{m[0], m[1]},
        on{m.vector(2), m.vector(5)},
        n(m.vector(8)),
        gap(m[11]),
        bias(m[12]),
        slip(m.vector(13)),
        x(m.vector(16)),
        moment(m.vector(19)) {}
  /// Velocity of the first body against the second.
  Vector3d velocity(const States& states) const {
    return states.at(body[0]).velocity(on[0]) - states.at(body[1]).velocity(on[1]);
  }
  std::array<double, 2> body;
  std::array<Vector3d, 2> on;
  Vector3d n;
  double gap, bias;
  Vector3d slip, x, moment;
};

}  // namespace tether::scene::certificate

// Tether: a joint of a certificate. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <tether/linalg/pi.hpp>

#include "reader.hpp"

namespace tether::scene::certificate {

using Eigen::Quaterniond;
using Eigen::Vector3d;

/// A state that a certificate tells, world axes.
struct Told {
  Vector3d x = Vector3d::Zero(), v = Vector3d::Zero(), w = Vector3d::Zero();
  Quaterniond q = Quaterniond::Identity();
};

inline Vector3d vector(const std::vector<double>& n, std::size_t k) {
  return {n[k], n[k + 1], n[k + 2]};
}
inline Quaterniond quaternion(const std::vector<double>& n, std::size_t k) {
  return {n[k], n[k + 1], n[k + 2], n[k + 3]};
}
inline Quaterniond rotation(const Vector3d& v) {
  const double a = v.norm(), s = a > 0 ? std::sin(a / 2) / a : 0.5;
  return {std::cos(a / 2), s * v.x(), s * v.y(), s * v.z()};
}

/// A joint by its points and frames on both bodies alone. It holds directions of the second
/// body's frame in which points, and turns, do not move against each other.
class JudgedJoint {
 public:
  explicit JudgedJoint(const Record& line) : name(line.text) {
    const std::vector<double>& n = line.numbers;
    kind = name.substr(0, name.find(' '));
    name.erase(0, std::min(name.size(), kind.size() + 1));
    body[0] = n[1], body[1] = n[2];
    point_[0] = vector(n, 3), frame_[0] = quaternion(n, 6);
    point_[1] = vector(n, 10), frame_[1] = quaternion(n, 13);
    length_ = n[17], driven = n[18] == 1, has_laws = n[18] == 2;
    std::copy_n(n.begin() + 19, 4, motion_);
    static const std::map<std::string, std::pair<const char*, const char*>> kHeld = {
        {"ball", {"xyz", ""}},     {"hinge", {"xyz", "xy"}}, {"slider", {"xy", "xyz"}},
        {"fixed", {"xyz", "xyz"}}, {"planar", {"z", "xy"}},  {"universal", {"xyz", "u"}},
        {"distance", {"d", ""}}};
    const auto found = kHeld.find(kind);
    if (found == kHeld.end()) throw Damaged("joint of a kind \"" + kind + "\"");
    held_ = found->second.first, turns_ = found->second.second;
    if (driven && kind == "slider") held_ += 'z';
    if (driven && kind == "hinge") turns_ += 'z';
  }

  /// Its bodies as they are.
  struct Place {
    Vector3d at, d;                     ///< the point on the first; from that on the second to it
    Quaterniond turn;                   ///< of the first frame in the second
    std::vector<Vector3d> held, turns;  ///< directions
    Vector3d z;                         ///< of laws
  };
  Place place(const Told (&s)[2]) const {
    const Quaterniond first = s[0].q * frame_[0], second = s[1].q * frame_[1];
    Place p;
    p.at = s[0].x + s[0].q * point_[0];
    p.d = p.at - s[1].x - s[1].q * point_[1];
    p.turn = second.conjugate() * first;
    const auto direction = [&](char c) -> Vector3d {
      if (c == 'd') return p.d / std::max(p.d.norm(), 1e-300);
      if (c == 'u') return (first * Vector3d::UnitZ()).cross(second * Vector3d::UnitX());
      return second * Vector3d::Unit(c - 'x');
    };
    for (const char c : held_) p.held.push_back(direction(c));
    for (const char c : turns_) p.turns.push_back(direction(c));
    p.z = direction('z');
    return p;
  }

  /// Errors of places (m, rad), and of the speeds of points and of turns.
  struct Errors {
    std::vector<double> off, slips, spins;
  };
  Errors errors(const Told (&s)[2], double t) const {
    Place p = place(s);
    const Vector3d u = s[0].v + s[0].w.cross(p.at - s[0].x) - s[1].v - s[1].w.cross(p.at - s[1].x);
    Errors e;
    for (const Vector3d& k : p.held) e.off.push_back(k.dot(p.d)), e.slips.push_back(k.dot(u));
    for (const Vector3d& k : p.turns) e.spins.push_back(k.dot(s[0].w - s[1].w));
    if (kind == "distance") e.off[0] -= length_;
    if (driven) {
      const auto [rate, amplitude, frequency, phase] = motion_;
      const double w = 2 * linalg::kPi * frequency;
      const double way = rate * t + amplitude * (std::sin(w * t + phase) - std::sin(phase));
      const double fast = rate + amplitude * w * std::cos(w * t + phase);
      if (kind == "hinge") {
        p.turn = rotation({0, 0, -way}) * p.turn, e.spins.back() -= fast;
      } else {
        e.off.back() -= way, e.slips.back() -= fast;
      }
    }
    const Vector3d z = p.turn * Vector3d::UnitZ(), twice = 2 * p.turn.vec();
    if (turns_ == "u") e.off.push_back(z.x());
    if (turns_ == "xy") e.off.insert(e.off.end(), {z.x(), z.y()});
    if (turns_ == "xyz") e.off.insert(e.off.end(), {twice.x(), twice.y(), twice.z()});
    return e;
  }

  /// Rates of the errors of speeds, largest of points and of turns: by differences over 2 h.
  std::pair<double, double> accelerations(const Told (&s)[2], const Vector3d (&a)[2],
                                          const Vector3d (&alpha)[2], double t) const {
    const double fast = std::max(s[0].w.norm(), s[1].w.norm());
    const double h = 1e-3 / (1 + fast + 2 * linalg::kPi * std::abs(motion_[2]));
    const auto after = [&](double k) {
      Told moved[2];
      for (int i = 0; i < 2; ++i) {
        moved[i].x = s[i].x + k * s[i].v, moved[i].q = rotation(k * s[i].w) * s[i].q;
        moved[i].v = s[i].v + k * a[i], moved[i].w = s[i].w + k * alpha[i];
      }
      return errors(moved, t + k);
    };
    const Errors ahead = after(h), behind = after(-h);
    const auto rate = [&](const std::vector<double>& x, const std::vector<double>& y) {
      double most = 0;
      for (std::size_t k = 0; k < x.size(); ++k) most = std::max(most, std::abs(x[k] - y[k]));
      return most / (2 * h);
    };
    return {rate(ahead.slips, behind.slips), rate(ahead.spins, behind.spins)};
  }

  double arms() const { return point_[0].norm() + point_[1].norm(); }

  std::string kind, name;
  double body[2];  ///< numbers as the file has them; -1: the world
  bool driven = false, has_laws = false;

 private:
  Vector3d point_[2];
  Quaterniond frame_[2];
  double length_ = 0;
  double motion_[4] = {};
  std::string held_, turns_;
};

}  // namespace tether::scene::certificate

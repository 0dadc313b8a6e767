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

/// A joint by its points and frames on both bodies alone. It holds directions of the second
/// body's frame in which points, and turns, do not move against each other.
class JudgedJoint {
 public:
  explicit JudgedJoint(const Record& line) : name(line.text) {
    const std::vector<double>& n = line.numbers;
    const auto vector = [&](std::size_t k) { return Vector3d(n[k], n[k + 1], n[k + 2]); };
    const auto turn = [&](std::size_t k) {
      return Quaterniond(n[k], n[k + 1], n[k + 2], n[k + 3]);
    };
    kind = name.substr(0, name.find(' '));
    name.erase(0, std::min(name.size(), kind.size() + 1));
    body[0] = n[1], body[1] = n[2];
    point_[0] = vector(3), frame_[0] = turn(6), point_[1] = vector(10), frame_[1] = turn(13);
    length_ = n[17], driven = n[18] == 1, has_laws = n[18] == 2;
    for (int k = 0; k < 4; ++k) motion_[k] = n[19 + static_cast<std::size_t>(k)];
    static const std::map<std::string, std::pair<const char*, const char*>> kHeld = {
        {"ball", {"xyz", ""}},     {"hinge", {"xyz", "xy"}}, {"slider", {"xy", "xyz"}},
        {"fixed", {"xyz", "xyz"}}, {"planar", {"z", "xy"}},  {"universal", {"xyz", "u"}},
        {"distance", {"d", ""}}};
    const auto found = kHeld.find(kind);
    if (found == kHeld.end()) throw Damaged("joint of a kind \"" + kind + "\"");
    held_ = found->second.first, turns_ = found->second.second;
  }

  /// Its bodies as they are: frames, points, arms, and directions.
  struct Place {
    Quaterniond g[2];
    Vector3d at[2], arm[2];
    std::vector<Vector3d> held, turns;
    Vector3d z, d;  ///< the free direction; between the points
  };
  Place place(const Told (&s)[2]) const {
    Place p;
    for (int k = 0; k < 2; ++k) {
      p.arm[k] = s[k].q * point_[k];
      p.at[k] = s[k].x + p.arm[k];
      p.g[k] = s[k].q * frame_[k];
    }
    p.d = p.at[0] - p.at[1];
    const auto direction = [&](char c) -> Vector3d {
      if (c == 'd') return p.d / std::max(p.d.norm(), 1e-300);
      if (c == 'u') return (p.g[0] * Vector3d::UnitZ()).cross(p.g[1] * Vector3d::UnitX());
      return p.g[1] * Vector3d::Unit(c - 'x');
    };
    for (const char c : held_) p.held.push_back(direction(c));
    for (const char c : turns_) p.turns.push_back(direction(c));
    p.z = direction('z');
    return p;
  }

  /// Prescribed way at a time, or its first or second derivative.
  double way(double t, int order) const {
    if (!driven) return 0;
    const auto [rate, amplitude, frequency, phase] = motion_;
    const double w = 2 * linalg::kPi * frequency;
    if (order == 0) return rate * t + amplitude * (std::sin(w * t + phase) - std::sin(phase));
    if (order == 1) return rate + amplitude * w * std::cos(w * t + phase);
    return -amplitude * w * w * std::sin(w * t + phase);
  }

  /// Largest errors: of places (m, rad), and of speeds.
  std::pair<double, double> errors(const Told (&s)[2], double t) const {
    const Place p = place(s);
    double off = 0, fast = 0;
    const auto is_off = [&](double e) { off = std::max(off, std::abs(e)); };
    const auto is_fast = [&](double e) { fast = std::max(fast, std::abs(e)); };
    const Vector3d u =
        s[0].v + s[0].w.cross(p.arm[0]) - s[1].v - s[1].w.cross(p.arm[1]) - s[1].w.cross(p.d);
    const Vector3d w = s[0].w - s[1].w;
    if (kind == "distance")
      return {std::abs(p.d.norm() - length_ - way(t, 0)), std::abs(p.held[0].dot(u) - way(t, 1))};
    for (const Vector3d& k : p.held) is_off(k.dot(p.d)), is_fast(k.dot(u));
    for (const Vector3d& k : p.turns) is_fast(k.dot(w));
    if (kind == "slider" && driven)
      is_off(p.z.dot(p.d) - way(t, 0)), is_fast(p.z.dot(u) - way(t, 1));
    Quaterniond q = p.g[1].conjugate() * p.g[0];
    if (kind == "hinge" && driven) {
      q = Eigen::AngleAxisd(-way(t, 0), Vector3d::UnitZ()) * q;
      is_off(2 * q.z());
      is_fast(p.z.dot(w) - way(t, 1));
    }
    const Vector3d z = q * Vector3d::UnitZ();
    if (kind == "hinge" || kind == "planar") is_off(z.x()), is_off(z.y());
    if (kind == "slider" || kind == "fixed") is_off(2 * q.vec().norm());
    if (kind == "universal") is_off(z.x());
    return {off, fast};
  }

  /// Largest errors of the accelerations (m/s^2, rad/s^2) of places and turns.
  std::pair<double, double> accelerations(const Told (&s)[2], const Vector3d (&a)[2],
                                          const Vector3d (&alpha)[2], double t) const {
    const Place p = place(s);
    const auto grown = [&](int k, const Vector3d& r) -> Vector3d {
      return alpha[k].cross(r) + s[k].w.cross(s[k].w.cross(r));
    };
    const Vector3d d1 = s[0].v + s[0].w.cross(p.arm[0]) - s[1].v - s[1].w.cross(p.arm[1]);
    const Vector3d d2 = a[0] + grown(0, p.arm[0]) - a[1] - grown(1, p.arm[1]);
    if (kind == "distance") {
      const double along = p.held[0].dot(d1);
      return {
          std::abs(p.held[0].dot(d2) +
                   (d1.squaredNorm() - along * along) / std::max(p.d.norm(), 1e-300) - way(t, 2)),
          0};
    }
    const auto second = [&](const Vector3d& k) {
      return k.dot(d2) + 2 * s[1].w.cross(k).dot(d1) + grown(1, k).dot(p.d);
    };
    double off = 0, bad = 0;
    for (const Vector3d& k : p.held) off = std::max(off, std::abs(second(k)));
    if (kind == "slider" && driven) off = std::max(off, std::abs(second(p.z) - way(t, 2)));
    const Vector3d w = s[0].w - s[1].w, more = alpha[0] - alpha[1];
    for (const Vector3d& k : p.turns) {
      Vector3d rate = s[1].w.cross(k);
      if (kind == "universal") {
        const Vector3d z = p.g[0] * Vector3d::UnitZ(), x = p.g[1] * Vector3d::UnitX();
        rate = s[0].w.cross(z).cross(x) + z.cross(s[1].w.cross(x));
      }
      bad = std::max(bad, std::abs(k.dot(more) + rate.dot(w)));
    }
    if (kind == "hinge" && driven)
      bad = std::max(bad, std::abs(p.z.dot(more) + s[1].w.cross(p.z).dot(w) - way(t, 2)));
    return {off, bad};
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

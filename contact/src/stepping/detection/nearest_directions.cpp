// Tether: the direction in which two convex shapes lie farthest apart. SPDX-License-Identifier:
// BSD-3-Clause
//
// detection, section 3. The algorithm of Gilbert, Johnson and Keerthi (1988) gives a first
// direction. It is applied to shapes that are shrunk by a part of their thickness, so that touching
// shapes are apart. Newton's method then maximises s(n) on the sphere; where a line or a face makes
// s not smooth, n is kept on that kink.
#include "stepping/detection/collide.hpp"

#include <algorithm>
#include <cmath>
#include <tether/contact/bodies.hpp>
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using linalg::at;

namespace {

// By which parts of the thickness shapes are shrunk, in turn.
constexpr std::array<double, 4> kLess{0, 1e-3, 3e-2, 0.5};

// Points of the difference a - b, the points of a and of b that they are made of, and weights.
struct Simplex {
  int count = 0;
  std::array<Vector3d, 4> y, a, b;
  std::array<double, 4> weight{};
};

// Point of least norm of the plane through the points `used`. False if one of its weights is not
// positive, or the points do not span a plane.
bool nearest_inside(const Simplex& s, const std::array<int, 4>& used, int count, Vector3d& v,
                    std::array<double, 4>& weight) {
  const Vector3d& p = s.y[at(used[0])];
  weight.fill(0);
  if (count == 1) {
    v = p;
    weight[at(used[0])] = 1;
    return true;
  }
  const Vector3d e = s.y[at(used[1])] - p;
  if (count == 2) {
    const double ee = e.squaredNorm();
    if (!(ee > 0)) return false;
    const double t = -p.dot(e) / ee;
    if (!(t > 0 && t < 1)) return false;
    v = p + t * e;
    weight[at(used[0])] = 1 - t;
    weight[at(used[1])] = t;
    return true;
  }
  const Vector3d f = s.y[at(used[2])] - p, m = e.cross(f);
  const double mm = m.squaredNorm();
  if (!(mm > 1e-24 * e.squaredNorm() * f.squaredNorm())) return false;
  if (count == 3) {
    const double t = m.dot((-p).cross(f)) / mm, u = m.dot(e.cross(-p)) / mm;
    if (!(t > 0 && u > 0 && t + u < 1)) return false;
    v = p.dot(m) / mm * m;
    weight[at(used[0])] = 1 - t - u;
    weight[at(used[1])] = t;
    weight[at(used[2])] = u;
    return true;
  }
  const Vector3d g = s.y[at(used[3])] - p;
  const double volume = m.dot(g);
  if (!(std::abs(volume) > 1e-14 * std::sqrt(mm) * g.norm())) return false;
  const double t = (-p).dot(f.cross(g)) / volume, u = (-p).dot(g.cross(e)) / volume,
               w = (-p).dot(m) / volume;
  if (!(t > 0 && u > 0 && w > 0 && t + u + w < 1)) return false;
  v.setZero();
  weight = {1 - t - u - w, t, u, w};
  return true;
}

// Point of least norm of the hull of the simplex. Points without weight are dropped.
Vector3d reduce(Simplex& s) {
  Vector3d best = s.y[0];
  std::array<double, 4> weights{}, weight{};
  double least = std::numeric_limits<double>::infinity();
  for (int set = 1; set < 1 << s.count; ++set) {
    std::array<int, 4> used{};
    int n = 0;
    for (int k = 0; k < s.count; ++k)
      if ((set >> k & 1) != 0) used[at(n++)] = k;
    Vector3d v;
    if (!nearest_inside(s, used, n, v, weight) || !(v.squaredNorm() < least)) continue;
    least = v.squaredNorm();
    best = v;
    weights = weight;
  }
  Simplex kept;
  for (int k = 0; k < s.count; ++k) {
    if (!(weights[at(k)] > 0)) continue;
    const auto to = at(kept.count++);
    kept.y[to] = s.y[at(k)];
    kept.a[to] = s.a[at(k)];
    kept.b[to] = s.b[at(k)];
    kept.weight[to] = weights[at(k)];
  }
  s = kept;
  return best;
}

// Nearest points of the shapes shrunk by `less`. Returns their distance, 0 if they overlap.
double nearest_points(const ConvexShape& a, const ConvexShape& b, double less, Vector3d v,
                      Separation& out) {
  Simplex s;
  if (!(v.squaredNorm() > 0)) v = Vector3d::UnitZ();
  double before = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 100; ++k) {
    const Vector3d p = a.farthest(-v, less), q = b.farthest(v, less), w = p - q;
    if (k > 0) {
      const bool known = std::any_of(s.y.begin(), s.y.begin() + s.count,
                                     [&](const Vector3d& y) { return (y - w).isZero(0); });
      if (known || v.squaredNorm() - v.dot(w) <= 1e-15 * v.squaredNorm()) break;
    }
    const auto to = at(s.count++);
    s.y[to] = w;
    s.a[to] = p;
    s.b[to] = q;
    const Simplex all = s;
    const Vector3d next = reduce(s);
    if (s.count == 4 || next.isZero(0)) return 0;
    if (!(next.squaredNorm() < before)) {  // no progress beyond rounding
      s = all;
      --s.count;
      break;
    }
    before = next.squaredNorm();
    v = next;
  }
  out.on_first.setZero();
  out.on_second.setZero();
  double sum = 0;
  for (int k = 0; k < s.count; ++k) sum += s.weight[at(k)];
  for (int k = 0; k < s.count; ++k) {
    out.on_first += s.weight[at(k)] / sum * s.a[at(k)];
    out.on_second += s.weight[at(k)] / sum * s.b[at(k)];
  }
  out.normal = v.normalized();
  return v.norm();
}

// For a shape deep inside another one: the best of a fixed set of directions. Its separation bounds
// the depth.
Vector3d way_out(const ConvexShape& a, const ConvexShape& b) {
  Vector3d best = Vector3d::UnitZ();
  double most = -std::numeric_limits<double>::infinity();
  const auto consider = [&](const Vector3d& n) {
    if (!(n.squaredNorm() > 0)) return;
    const double s = separation(a, b, n.normalized());
    if (!(s > most + 1e-12 * std::abs(s))) return;
    most = s;
    best = n.normalized();
  };
  consider(a.centre() - b.centre());
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z) {
        consider(x * a.axis(0) + y * a.axis(1) + z * a.axis(2));
        consider(x * b.axis(0) + y * b.axis(1) + z * b.axis(2));
      }
  return best;
}

// Puts n onto a kink of s within the tolerance: the normal of a face, or a direction at right
// angles to a line of one or both shapes. Returns the number of directions in which n may still
// turn, and writes them to the columns of T.
int hold(const ConvexShape& a, const ConvexShape& b, double tolerance, Vector3d& n,
         Eigen::Matrix<double, 3, 2>& T) {
  Vector3d face_a, face_b;
  const Vector3d u = a.line(-n, tolerance, face_a), v = b.line(n, tolerance, face_b);
  if (!face_b.isZero(0) || !face_a.isZero(0)) {
    n = face_b.isZero(0) ? Vector3d(-face_a) : face_b;
    return 0;
  }
  if (!u.isZero(0) && !v.isZero(0)) {
    const Vector3d across = u.cross(v);
    if (across.norm() > 1e-3) {
      n = across.normalized() * (across.dot(n) < 0 ? -1 : 1);
      return 0;
    }
  }
  const Vector3d along = u.isZero(0) ? v : u;
  if (!along.isZero(0)) {
    n = (n - along.dot(n) * along).normalized();
    T.col(0) = along.cross(n);
    return 1;
  }
  const Matrix3d F = tangent_frame(n);
  T.col(0) = F.row(1).transpose();
  T.col(1) = F.row(2).transpose();
  return 2;
}

// Newton's step towards the maximum of s in the `free` directions T.
Vector3d newton_step(const ConvexShape& a, const ConvexShape& b, const Vector3d& n, int free,
                     const Eigen::Matrix<double, 3, 2>& T, double scale) {
  const Vector3d apart = a.farthest(-n) - b.farthest(n);
  const Matrix3d H = a.curvature(-n) + b.curvature(n);
  if (free == 1) {
    const double h = T.col(0).dot(H * T.col(0)) + n.dot(apart);
    return h > 1e-9 * scale ? Vector3d(T.col(0).dot(apart) / h * T.col(0))
                            : Vector3d(Vector3d::Zero());
  }
  const Eigen::Matrix2d h = T.transpose() * H * T + n.dot(apart) * Eigen::Matrix2d::Identity();
  const Eigen::Vector2d g = T.transpose() * apart;
  const double trace = h.trace(), determinant = h.determinant();
  if (trace > 0 && determinant > 1e-9 * trace * trace) return T * (h.inverse() * g);
  return g.norm() > 0 ? Vector3d(0.1 / g.norm() * (T * g)) : Vector3d(Vector3d::Zero());
}

// Newton's method for the maximum of s; no step decreases it. Where no step increases it n is
// beside a kink, so that kinks at growing distances are tried.
Vector3d improve(const ConvexShape& a, const ConvexShape& b, Vector3d n) {
  double s = separation(a, b, n);
  const double scale = std::max(a.thickness, b.thickness);
  Eigen::Matrix<double, 3, 2> T = Eigen::Matrix<double, 3, 2>::Zero();
  const auto snap = [&](double tolerance, double loss) {
    Vector3d held = n;
    const int free = hold(a, b, tolerance, held, T);
    const double there = separation(a, b, held);
    if (!(there > s - loss)) return -1;
    n = held;
    s = there;
    return free;
  };
  for (int k = 0; k < 60; ++k) {
    int free = snap(kNear, 1e-9 * scale);
    if (free == 0) return n;
    if (free < 0) {
      Vector3d same = n;
      free = hold(a, b, 0, same, T);
      if (free == 0) return n;
    }
    Vector3d step = newton_step(a, b, n, free, T, scale);
    const double length = step.norm();
    if (length > 0.3) step *= 0.3 / length;
    bool gained = false;
    const bool last = length < 1e-9;
    for (double part = 1; length > 1e-15 && part > 1e-3 && !gained; part /= 4) {
      const Vector3d to = (n + part * step).normalized();
      const double then = separation(a, b, to);
      gained = then > s + 1e-15 * scale || (last && then > s - 1e-14 * scale);
      if (!gained) continue;
      n = to;
      s = then;
    }
    if (last && gained) return n;
    for (double tolerance = 1e-5; tolerance < 0.05 && !gained; tolerance *= 10)
      gained = snap(tolerance, -1e-15 * scale) >= 0;
    if (!gained) return n;
  }
  return n;
}

}  // namespace

double separation(const ConvexShape& a, const ConvexShape& b, const Vector3d& n) {
  return n.dot(a.farthest(-n) - b.farthest(n)) - a.round - b.round;
}

bool find_separation(const ConvexShape& a, const ConvexShape& b, double margin, Separation& out) {
  const Vector3d between = a.centre() - b.centre();
  if (between.squaredNorm() > 0 && separation(a, b, between.normalized()) >= margin) return false;
  const double thickness = std::min(a.thickness, b.thickness);
  double distance = 0;
  for (const double less : kLess) {
    distance = nearest_points(a, b, less, between, out);
    if (less == 0 && distance - a.round - b.round >= margin) return false;
    if (distance > 1e-4 * thickness) break;  // shorter ones are rounding
    distance = 0;
  }
  if (!(distance > 0)) {
    out.normal = way_out(a, b);
    out.on_first = a.farthest(-out.normal);
    out.on_second = b.farthest(out.normal);
  }
  out.normal = improve(a, b, out.normal);
  out.gap = separation(a, b, out.normal);
  return out.gap < margin;
}

}  // namespace tether::contact::detail

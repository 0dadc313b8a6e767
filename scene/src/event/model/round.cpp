// Tether: contacts of ellipsoids and of the ends of cylinders. SPDX-License-Identifier:
// BSD-3-Clause
#include "bounds.hpp"
#include "features.hpp"

#include <Eigen/LU>

namespace tether::scene::event {

namespace {

constexpr double kExact = 4e-16;

using Tangents = Eigen::Matrix<double, 3, 2>;
using Eigen::Matrix2d;
using Eigen::Vector2d;

/// At right angles to n. Along a line there is one only: the second column is zero.
Tangents tangents_of(const Vector3d& n, const Vector3d* line) {
  Tangents T = Tangents::Zero();
  if (line != nullptr) {
    T.col(0) = line->cross(n).normalized();
    return T;
  }
  Eigen::Index least = 0;
  n.cwiseAbs().minCoeff(&least);
  T.col(0) = n.cross(Vector3d::Unit(least)).normalized();
  T.col(1) = n.cross(T.col(0));
  return T;
}

/// T' H T + c.
Matrix2d bend_in(const Tangents& T, const Matrix3d& H, double c, const Vector3d* line) {
  Matrix2d M = T.transpose() * H * T;
  M.diagonal().array() += c;
  if (line != nullptr) M(1, 1) = 1;
  return M;
}

/// f(n) = n.d - s(n) - t(n) of two supports, t of a line being its radius.
class Between {
 public:
  Between(const Support& first, const Support* second, double radius)
      : first_(first), second_(second), radius_(radius) {}

  struct At {
    double f = 0, f_t = 0, f_tt = 0;
    Vector3d g, g_t;
    Matrix3d H;
    Support::At first;
  };
  /// `d`: the way between the centres.
  At at(const Vector3d& n, const Jet<double>& d) const {
    At out;
    out.first = first_.at(n);
    Support::At t;
    if (second_ != nullptr) {
      t = second_->at(n);
    } else {
      t.s = radius_;
      t.point = radius_ * n;
      t.bend = radius_ * (Matrix3d::Identity() - n * n.transpose());
    }
    out.f = n.dot(d.x) - out.first.s - t.s;
    out.f_t = n.dot(d.x1) - out.first.s_t - t.s_t;
    out.f_tt = n.dot(d.x2) - out.first.s_tt - t.s_tt;
    out.g = d.x - out.first.point - t.point;
    out.g_t = d.x1 - out.first.point_t - t.point_t;
    out.H = out.first.bend + t.bend;
    return out;
  }

  /// The maximum next to n: Newton's steps where f is concave, and as long as they rise.
  Vector3d climb(Vector3d n, const Jet<double>& d, const Vector3d* line, double size) const {
    for (int k = 0; k < 60; ++k) {
      const At here = at(n, d);
      const Tangents T = tangents_of(n, line);
      const Vector2d g = T.transpose() * here.g;
      if (g.norm() <= kExact * size) break;
      const Matrix2d M = bend_in(T, here.H, here.f, line);
      const bool concave = M.trace() > 0 && M.determinant() > 0;
      Vector2d z = g / size;
      if (concave) z = M.inverse() * g;
      if (z.norm() > 0.5) z *= 0.5 / z.norm();
      Vector3d next = (n + T * z).normalized();
      double rise = at(next, d).f - here.f;
      for (int half = 0; half < 40 && rise < 1e-4 * g.dot(z) - kExact * size; ++half) {
        z *= 0.5;
        next = (n + T * z).normalized();
        rise = at(next, d).f - here.f;
      }
      const bool same = (next - n).norm() <= kExact;
      n = next;
      if (same) break;
    }
    return n;
  }

  /// The normal: from the way between the centres, and from others where the bodies overlap there.
  Vector3d normal(const Jet<double>& d, const Vector3d* line, double size) const {
    const auto into = [&](Vector3d n) {
      if (line != nullptr) n -= line->dot(n) * *line;
      return n;
    };
    Vector3d start = into(d.x);
    if (!(start.norm() > 1e-12 * size)) start = into(Vector3d(0.6, 0.48, 0.64));
    Vector3d best = climb(start.normalized(), d, line, size);
    if (at(best, d).f > 0) return best;
    for (int k = 0; k < 6; ++k) {
      const Vector3d other = into((k < 3 ? 1.0 : -1.0) * Vector3d::Unit(k % 3));
      if (other.norm() < 0.1) continue;
      const Vector3d n = climb(other.normalized(), d, line, size);
      if (at(n, d).f > at(best, d).f) best = n;
    }
    return best;
  }

 private:
  const Support& first_;
  const Support* second_;
  double radius_;
};

/// `turning`: what the line's turning makes of n'.
Touch touch_at(const Between& between, const Vector3d& n, const Jet<double>& d,
               const Vector3d* line, const Vector3d& turning, const Jet<double>& centre) {
  const Between::At here = between.at(n, d);
  const Tangents T = tangents_of(n, line);
  const Matrix2d M = bend_in(T, here.H, here.f, line);
  const Vector2d z = M.inverse() * (T.transpose() * (here.g_t - here.H * turning));
  const Vector3d n1 = turning + T * z;
  Touch t;
  t.normal = n;
  t.normal_rate = n1;
  t.gap = here.f;
  t.rate = here.f_t;
  t.second = here.f_tt + 2 * n1.dot(here.g_t) - n1.dot(here.H * n1) - here.f * n1.squaredNorm();
  t.point = centre.x - here.first.point;
  t.point_velocity = centre.x1 - here.first.point_t - here.first.bend * n1;
  return t;
}

/// How far inside of the contacts of its circle a disc's is: on its face's side, away from the
/// other one. `n` points to the disc's partner.
double margin_of_disc(const Frame<double>& f, const Round& disc, const Vector3d& n) {
  if (!disc.is_disc()) return kInfinity;
  const double size = disc.size();
  return std::min(size * (kFlush + n.dot(f.R * disc.outward)), Support(f, disc).reach(n));
}

struct OnLine {
  Vector3d n;
  double along = 0;
};

OnLine nearest(const RoundOnLine& pair, const Frame<double>& A, const Frame<double>& B) {
  const Support s(A, pair.first);
  const Between between(s, nullptr, pair.line.radius);
  const Vector3d e = times(B.R, pair.line.along);
  Jet<double> d = way(mechanics::point<2>(B, pair.line.at), mechanics::point<2>(A, pair.first.at));
  OnLine out;
  out.n = between.normal(d, &e, pair.first.size() + pair.line.radius + d.x.norm());
  out.along = (d.x - s.at(out.n).point).dot(e);
  return out;
}

}  // namespace

Touch RoundOnPlane::touch(const Frame<double>& A, const Frame<double>& B) const {
  const Jet<double> a = mechanics::point<2>(A, first.at), n = direction<2>(B, plane.normal);
  const Jet<double> d = way(mechanics::point<2>(B, plane.at), a);
  const Support::At s = Support(A, first).at(n.x);
  Touch t;
  t.normal = n.x;
  t.normal_rate = n.x1;
  t.gap = n.x.dot(d.x) - s.s;
  t.rate = n.x1.dot(d.x - s.point) + n.x.dot(d.x1) - s.s_t;
  t.second = n.x2.dot(d.x - s.point) + 2 * n.x1.dot(d.x1 - s.point_t) + n.x.dot(d.x2) - s.s_tt -
             n.x1.dot(s.bend * n.x1);
  t.point = a.x - s.point;
  t.point_velocity = a.x1 - s.point_t - s.bend * n.x1;
  return t;
}

double RoundOnPlane::margin(const Frame<double>& A, const Frame<double>& B) const {
  if (plane.border.empty() && disc == 0) return kInfinity;
  const Vector3d n = times(B.R, plane.normal);
  const Vector3d centre = mechanics::point<0>(A, first.at).x - Support(A, first).at(n).point;
  double least = kInfinity;
  if (disc > 0) {
    const Vector3d d = point_in(B, centre) - plane.at;
    least = disc - (d - plane.normal.dot(d) * plane.normal).norm();
  }
  least = std::min(least, plane.margin(point_in(B, centre)));
  if (first.is_disc())
    least = std::min(least, first.size() * (kFlush - n.dot(A.R * first.outward)));
  return least;
}

Touch RoundOnRound::touch(const Frame<double>& A, const Frame<double>& B) const {
  const Jet<double> a = mechanics::point<2>(A, first.at);
  const Jet<double> d = way(mechanics::point<2>(B, second.at), a);
  const Support s(A, first), t(B, second);
  const Between between(s, &t, 0);
  const Vector3d n = between.normal(d, nullptr, first.size() + second.size() + d.x.norm());
  return touch_at(between, n, d, nullptr, Vector3d::Zero(), a);
}

double RoundOnRound::margin(const Frame<double>& A, const Frame<double>& B) const {
  if (!first.is_disc() && !second.is_disc()) return kInfinity;
  const Vector3d n = touch(A, B).normal;
  return std::min(margin_of_disc(A, first, -n), margin_of_disc(B, second, n));
}

Touch RoundOnLine::touch(const Frame<double>& A, const Frame<double>& B) const {
  const OnLine on = nearest(*this, A, B);
  const Jet<double> a = mechanics::point<2>(A, first.at), e = direction<2>(B, line.along);
  const Jet<double> d = way(mechanics::point<2>(B, line.at + on.along * line.along), a);
  const Support s(A, first);
  const Between between(s, nullptr, line.radius);
  return touch_at(between, on.n, d, &e.x, -e.x1.dot(on.n) * e.x, a);
}

double RoundOnLine::margin(const Frame<double>& A, const Frame<double>& B) const {
  const OnLine on = nearest(*this, A, B);
  double least = std::min({on.along, line.length - on.along, margin_of_disc(A, first, -on.n)});
  for (const Vector3d& inward : line.inward)
    if (line.is_sharp()) least = std::min(least, line.length * (kFlush - on.n.dot(B.R * inward)));
  return least;
}

Touch PointOnCircle::touch(const Frame<double>& A, const Frame<double>& B) const {
  const Jet<double> c = mechanics::point<2>(A, first.at), x = direction<2>(B, axis);
  const Jet<double> b = mechanics::point<2>(B, at), d = way(b, c);
  // q = v / |v|, v = d without its part along the axis.
  const auto [v, v1, v2] = across(d, x);
  const double D = v.norm();
  Touch t;
  if (!(D > 1e-9 * circle)) {  // on the axis, where it touches the face if anything
    t.gap = kNowhere;
    t.point = c.x;
    return t;
  }
  const Vector3d q = v / D;
  const double D1 = q.dot(v1);
  const Vector3d q1 = (v1 - D1 * q) / D;
  const double D2 = q1.dot(v1) + q.dot(v2);
  const Vector3d q2 = (v2 - D2 * q - 2 * D1 * q1) / D;
  t = apart({d.x - circle * q, d.x1 - circle * q1, d.x2 - circle * q2}, first.radius, 0);
  t.point = b.x + circle * q;
  t.point_velocity = b.x1 + circle * q1;
  return t;
}

double PointOnCircle::margin(const Frame<double>& A, const Frame<double>& B) const {
  const Vector3d x = times(B.R, axis);
  const Vector3d d = mechanics::point<0>(A, first.at).x - mechanics::point<0>(B, at).x;
  const double k = d.dot(x);
  return std::min(k, (d - k * x).norm() - circle);
}

}  // namespace tether::scene::event

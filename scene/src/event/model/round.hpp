// Tether: contacts of ellipsoids and of the ends of cylinders. SPDX-License-Identifier:
// BSD-3-Clause
//
// With d the way from the second feature's centre to the first one's, s and t their supports:
//
//   plane        gap = n.d - s(n)                             n that of the plane
//   round        gap = max over |n| = 1 of f(n) = n.d - s(n) - t(n)
//   line         the same with n at right angles to the line, from its nearest point
//
// (supports are even). At the maximum g = df/dn is along n: the way between the nearest points. Its
// length c is the gap, and with H the second derivatives of the supports, T at right angles to n
// (and to the line), w the part of n' that the line's turning prescribes,
//
//   n' = w + T z,   (T' H T + c) z = T' (g_t - H w)
//   gap'  = f_t,    gap'' = f_tt + 2 n'.g_t - n'.H n' - c |n'|^2
#pragma once

#include "touch.hpp"

namespace tether::scene::event {

// With L the shape of a Round in world axes
//
//   s(n) = |L' n| + r |n|      the farthest it reaches along n from its centre
//   ds/dn                      the point that is that far
//
// and L' = W x L, L'' = alpha x L + W x L'.

using scene::Round;

/// Support function of a round body whose frame is known, for unit directions n; `_t`: its
/// derivative by time with n fixed.
class Support {
 public:
  Support(const Frame<double>& f, const Round& of) : L_(f.R * of.shape), radius_(of.radius) {
    flat_ = kFlat * L_.norm();
    for (int k = 0; k < 3; ++k) {
      L1_.col(k) = f.W.cross(L_.col(k));
      L2_.col(k) = f.alpha.cross(L_.col(k)) + f.W.cross(L1_.col(k));
    }
  }

  struct At {
    double s = 0, s_t = 0, s_tt = 0;
    Vector3d point = Vector3d::Zero(), point_t = Vector3d::Zero();  ///< from the centre
    Matrix3d bend = Matrix3d::Zero();                               ///< d point / dn
  };
  At at(const Vector3d& n) const {
    At out;
    const Vector3d u = L_.transpose() * n;
    const double e = u.norm();
    if (e > flat_) {
      const Vector3d u1 = L1_.transpose() * n, u2 = L2_.transpose() * n;
      const Vector3d p = L_ * u / e;
      out.s = e;
      out.s_t = u.dot(u1) / e;
      out.s_tt = (u1.squaredNorm() + u.dot(u2) - out.s_t * out.s_t) / e;
      out.point = p;
      out.point_t = (L1_ * u + L_ * u1 - p * out.s_t) / e;
      out.bend = (L_ * L_.transpose() - p * p.transpose()) / e;
    }
    out.s += radius_;
    out.point += radius_ * n;
    out.bend += radius_ * (Matrix3d::Identity() - n * n.transpose());
    return out;
  }
  /// How far a disc reaches along n, which is nothing along its axis.
  double reach(const Vector3d& n) const { return (L_.transpose() * n).norm(); }

  static constexpr double kFlat = 1e-9;  // sine below which a disc is flush with what it touches

 private:
  Matrix3d L_, L1_, L2_;
  double radius_, flat_ = 0;
};

/// A round feature of the first body on a plane or face of the second one. A face of a cylinder is
/// bordered by a circle.
struct RoundOnPlane {
  Round first;
  PlaneFeature plane;
  double disc = 0;  ///< radius of its border, about plane.at; 0: none

  Touch touch(const Frame<double>& A, const Frame<double>& B, const Vector3d&, double) const;
  double margin(const Frame<double>& A, const Frame<double>& B, const Vector3d&) const;
  /// A disc is flush with the plane: it touches in more points than one.
  bool is_flush(const Frame<double>& A, const Frame<double>& B) const {
    return first.is_disc() &&
           Support(A, first).reach(times(B.R, plane.normal)) < kNearlyFlush * first.size();
  }

 private:
  static constexpr double kNearlyFlush = 1e-6;
};

/// Two round features.
struct RoundOnRound {
  Round first, second;

  Touch touch(const Frame<double>& A, const Frame<double>& B, const Vector3d&, double) const;
  double margin(const Frame<double>& A, const Frame<double>& B, const Vector3d&) const;
};

/// A round feature on a line of the second body, which has a radius.
struct RoundOnLine {
  Round first;
  Segment line;

  Touch touch(const Frame<double>& A, const Frame<double>& B, const Vector3d&, double) const;
  double margin(const Frame<double>& A, const Frame<double>& B, const Vector3d&) const;
};

/// A sphere or point of the first body on the circle of a cylinder's end. (Where it comes over from
/// the face the supports have a kink, the distance has none.)
struct PointOnCircle {
  Vector3d at = Vector3d::Zero(), axis = Vector3d::UnitZ();  ///< out of the body
  double circle = 0;

  Touch touch(const Frame<double>& A, const Frame<double>& B, const Vector3d& centre,
              double radius) const;
  double margin(const Frame<double>& A, const Frame<double>& B, const Vector3d& centre) const;
};

}  // namespace tether::scene::event

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

#include "crossing.hpp"
#include "plane_feature.hpp"
#include "support.hpp"

namespace tether::scene::event {

/// A round feature of the first body on a plane or face of the second one. A face of a cylinder is
/// bordered by a circle.
struct RoundOnPlane {
  Round first;
  PlaneFeature plane;
  double disc = 0;  ///< radius of its border, about plane.at; 0: none

  Touch look(const Frame<double>& A, const Frame<double>& B, const Vector3d&, double) const;
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

  Touch look(const Frame<double>& A, const Frame<double>& B, const Vector3d&, double) const;
  double margin(const Frame<double>& A, const Frame<double>& B, const Vector3d&) const;
};

/// A round feature on a line of the second body, which has a radius.
struct RoundOnLine {
  Round first;
  Segment line;

  Touch look(const Frame<double>& A, const Frame<double>& B, const Vector3d&, double) const;
  double margin(const Frame<double>& A, const Frame<double>& B, const Vector3d&) const;
};

/// A sphere or point of the first body on the circle of a cylinder's end. (Where it comes over from
/// the face the supports have a kink, the distance has none.)
struct PointOnCircle {
  Vector3d at = Vector3d::Zero(), axis = Vector3d::UnitZ();  ///< out of the body
  double circle = 0;

  Touch look(const Frame<double>& A, const Frame<double>& B, const Vector3d& centre,
             double radius) const;
  double margin(const Frame<double>& A, const Frame<double>& B, const Vector3d& centre) const;
};

}  // namespace tether::scene::event

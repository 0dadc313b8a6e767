// Tether: points at which convex shapes lie against each other. SPDX-License-Identifier:
// BSD-3-Clause
#include "stepping/detection/manifold.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>

#include "stepping/detection/clip.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

// A contact this close to the lowest point, relative to the thickness, stands for it.
constexpr double kLow = 1e-6;

// Clips a line or a face to another face, both seen along n. The identity of a cut is made of the
// edge and of the side that cuts it.
void clip_to_face(const Flat& face, const Vector3d& n, Flat& subject) {
  const double turn = face.normal.dot(n) < 0 ? -1 : 1;
  for (int k = 0; k < face.count && subject.count > 0; ++k) {
    const Vector3d& from = face.point[at(k)];
    const Vector3d inward = turn * n.cross(Vector3d(face.point[at((k + 1) % face.count)] - from));
    Flat kept;
    cut_polygon(
        at(subject.count), inward, from,
        [&](std::size_t j) -> const Vector3d& { return subject.point[j]; },
        [&](std::size_t j) { kept.add(subject.point[j], subject.id[j]); },
        [&](std::size_t j, std::size_t, const Vector3d& x, bool) {
          kept.add(x, kCut + (subject.id[j] * 61 + face.id[at(k)]) % 0x7000);
        });
    kept.normal = subject.normal;
    subject = kept;
  }
}

// Contacts of the line or face `subject` with the face of the other shape.
void over_face(const ConvexPair& pair, const Flat& face, Flat& subject, bool subject_is_a) {
  const Vector3d& n = pair.apart.normal;
  clip_to_face(face, n, subject);
  const double along = face.normal.dot(n);
  for (int k = 0; k < subject.count; ++k) {
    const Vector3d& x = subject.point[at(k)];
    const double height = face.normal.dot(x - face.point[0]) / along;
    if (subject_is_a)
      pair.add(x, height, subject.id[at(k)]);
    else
      pair.add(x - height * n, -height, subject.id[at(k)]);
  }
}

// Contacts of two lines: the ends of their common length, or the point where they cross.
void along_lines(const ConvexPair& pair, const Flat& s, const Flat& t) {
  const Vector3d& n = pair.apart.normal;
  const auto flatten = [&](const Vector3d& x) { return Vector3d(x - n.dot(x) * n); };
  const Vector3d u = flatten(s.point[1] - s.point[0]), v = flatten(t.point[1] - t.point[0]);
  const Vector3d w = flatten(t.point[0] - s.point[0]);
  const double uu = u.squaredNorm(), vv = v.squaredNorm(), cross = n.dot(u.cross(v));
  const auto add = [&](double x, double y, int feature) {
    const Vector3d p = s.point[0] + x * (s.point[1] - s.point[0]);
    const Vector3d q = t.point[0] + y * (t.point[1] - t.point[0]);
    pair.add(p, n.dot(p - q), feature);
  };
  if (std::abs(cross) > kFlatAngle * std::sqrt(uu * vv)) {
    const double x = std::clamp(n.dot(w.cross(v)) / cross, 0.0, 1.0);
    const double y = std::clamp(n.dot(w.cross(u)) / cross, 0.0, 1.0);
    return add(x, y, 0x7f00);
  }
  const double end0 = u.dot(w) / uu, end1 = u.dot(w + v) / uu;
  const double from = std::max(0.0, std::min(end0, end1));
  const double to = std::min(1.0, std::max(end0, end1));
  const auto on_other = [&](double x) { return std::clamp(v.dot(x * u - w) / vv, 0.0, 1.0); };
  if (from >= to) {
    const double x = std::clamp(from, 0.0, 1.0);
    return add(x, on_other(x), 0x7f01);
  }
  add(from, on_other(from), 0x7f02);
  add(to, on_other(to), 0x7f03);
}

}  // namespace

double ConvexPair::height() const {
  return std::min(margin - apart.gap, kHigh * std::min(a.thickness, b.thickness));
}

void ConvexPair::add(const Vector3d& on_a, double core_gap, int feature) const {
  const Vector3d& n = apart.normal;
  const double gap = core_gap - a.round - b.round;
  if (!(gap < margin)) return;
  const Vector3d x = origin + on_a - a.round * n;
  out.add(x, x - gap * n, n, gap, feature);
}

void manifold(const ConvexPair& pair, Flat& s, Flat& t) {
  const Vector3d& n = pair.apart.normal;
  const double thickness = std::min(pair.a.thickness, pair.b.thickness);
  const int before = pair.out.count;
  const bool on_s = s.count > 2, on_t = t.count > 2;
  if (s.count > 1 && t.count > 1) {
    if (on_t && (!on_s || t.normal.dot(n) >= -s.normal.dot(n)))
      over_face(pair, t, s, true);
    else if (on_s)
      over_face(pair, s, t, false);
    else
      along_lines(pair, s, t);
  }
  for (int k = before; k < pair.out.count; ++k)
    if (pair.out.point[at(k)].gap < pair.apart.gap + kLow * thickness) return;
  // No contact so far is at the lowest point. It is the point of a round surface, else the point at
  // which the shapes are nearest.
  Vector3d x = pair.apart.on_first;
  if (s.count == 1) x = s.point[0];
  if (s.count != 1 && t.count == 1) x = t.point[0];
  const double low = n.dot(pair.a.farthest(-n));
  x += (low - n.dot(x)) * n;
  pair.add(x, pair.apart.gap + pair.a.round + pair.b.round, 0x7f04);
}

}  // namespace tether::contact::detail

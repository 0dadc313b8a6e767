// Tether: points of a polyhedron over a face of another. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/polyhedra/polyhedra.hpp"

#include <algorithm>
#include <limits>

#include "stepping/detection/clip.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;
using linalg::at;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

// Among the faces that contain a lowest corner along n, the one whose normal is nearest to -n. A
// face with a better normal may end above the lowest corner and would not touch. Returns -1 where
// heights are NaN.
int FaceClipper::lowest_face(const Placed& other, const Vector3d& n, double same) {
  double lowest = kInfinity;
  height_.clear();
  for (const Vector3d& v : other.now.vertices) {
    height_.push_back(n.dot(v));
    lowest = std::min(lowest, height_.back());
  }
  int best = -1;
  double cosine = 0;
  for (int f = 0; f < static_cast<int>(other.now.faces.size()); ++f) {
    const std::vector<int>& loop = other.loop(f);
    if (std::none_of(loop.begin(), loop.end(),
                     [&](int v) { return height_[at(v)] <= lowest + same; }))
      continue;
    const double c = other.face(f).normal.dot(n);
    if (best >= 0 && !(c < cosine - kEqual)) continue;
    best = f;
    cosine = c;
  }
  return best;
}

void FaceClipper::clip(const Placed& reference, int face, const Placed& other, double least,
                       double margin, double size, int mark, NearPoints& out) {
  const Vector3d& n = reference.face(face).normal;
  const double offset = reference.face(face).offset;
  const double same = kInPlane * size;
  const int opposite = lowest_face(other, n, same);
  if (opposite < 0) return;
  int number = 0;  // of the pair of pieces
  for (const Polyhedron::Face::Piece& to : reference.shape->faces[at(face)].open)
    for (const Polyhedron::Face::Piece& subject : other.shape->faces[at(opposite)].open) {
      clip_piece(reference, face, to, other, subject, 8 * number++, same);
      for (const Corner& c : polygon_) {
        const double gap = n.dot(c.point) - offset;
        if (gap > least && gap < margin && !c.seam)
          out.add(c.point, c.point - gap * n, n, gap, mark | c.feature);
      }
    }
}

// Clips a piece of the opposite face to one of the reference face. Edges are numbered from `first`.
void FaceClipper::clip_piece(const Placed& reference, int face, const Polyhedron::Face::Piece& to,
                             const Placed& other, const Polyhedron::Face::Piece& subject, int first,
                             double same) {
  polygon_.clear();
  // Seen from the reference face this loop runs clockwise, which clipping does not mind.
  const std::vector<int>& loop = subject.loop;
  for (std::size_t k = 0; k < loop.size(); ++k) {
    const bool seam = subject.seam[k] != 0, before = subject.seam[k > 0 ? k - 1 : loop.size() - 1];
    polygon_.push_back({other.vertex(loop[k]),
                        loop[k] & 0x7ff,
                        {first + static_cast<int>(k), false, seam},
                        seam && before});
  }
  for (std::size_t k = 0; k < to.loop.size() && !polygon_.empty(); ++k)
    clip_to(reference.inward(face, to.loop, k), reference.vertex(to.loop[k]),
            reference.vertex(to.loop[k + 1 < to.loop.size() ? k + 1 : 0]),
            {first + static_cast<int>(k), true, to.seam[k] != 0}, same);
  merge(same);
}

// A cut within `same` of a corner is that corner. Otherwise the identities of contacts between
// faces of equal size would change with rounding.
void FaceClipper::clip_to(const Vector3d& inward, const Vector3d& from, const Vector3d& to,
                          const Line& plane, double same) {
  const auto is_end = [&](const Vector3d& x) {
    const double s = (x - from).dot(to - from), length2 = (to - from).squaredNorm();
    const double slack = same * std::sqrt(length2);
    return std::abs(s) < slack || std::abs(s - length2) < slack;
  };
  clipped_.clear();
  cut_polygon(
      polygon_.size(), inward, from,
      [&](std::size_t k) -> const Vector3d& { return polygon_[k].point; },
      [&](std::size_t k) { clipped_.push_back(polygon_[k]); },
      [&](std::size_t k, std::size_t next, const Vector3d& x, bool leaves) {
        const Line& edge = polygon_[k].edge;
        const int number = edge.number + (edge.of_reference ? 128 : 0);
        int feature = 2048 + (number * 181 + plane.number) % 30000;
        bool seam =
            edge.of_reference ? edge.seam && plane.seam : plane.seam || (edge.seam && !is_end(x));
        for (const Corner* end : {&polygon_[k], &polygon_[next]})
          if ((x - end->point).squaredNorm() < same * same) {
            feature = end->feature;
            seam = end->seam;
          }
        // After a cut that leaves the half-space the polygon follows the side plane, else the rest
        // of the edge.
        clipped_.push_back({x, feature, leaves ? plane : edge, seam});
      });
  polygon_.swap(clipped_);
}

// Removes corners within `same` of another corner, or of the line between their neighbours. The
// rest spans the same polygon up to `same`; no point is moved.
void FaceClipper::merge(double same) {
  const auto spare = [&](std::size_t k) {
    const std::size_t n = polygon_.size();
    const Vector3d p = polygon_[k == 0 ? n - 1 : k - 1].point - polygon_[k].point;
    const Vector3d q = polygon_[k + 1 == n ? 0 : k + 1].point - polygon_[k].point;
    const double pp = p.squaredNorm(), qq = q.squaredNorm(), s2 = same * same;
    if (pp < s2 || qq < s2) return true;
    return p.dot(q) < 0 && p.cross(q).squaredNorm() < s2 * (p - q).squaredNorm();
  };
  for (std::size_t k = polygon_.size(); k-- > 0 && polygon_.size() > 1;)
    if (spare(k)) polygon_.erase(polygon_.begin() + static_cast<std::ptrdiff_t>(k));
}

}  // namespace tether::contact::detail

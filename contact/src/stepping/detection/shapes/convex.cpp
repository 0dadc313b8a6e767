// Tether: convex hulls. SPDX-License-Identifier: BSD-3-Clause
#include <map>
#include <tether/linalg/convex_hull.hpp>

#include "stepping/detection/polyhedra/polyhedron.hpp"
#include "stepping/detection/shape_form.hpp"

namespace tether::contact {

using Eigen::Vector3d;

Shape Shape::convex(std::vector<Vector3d> vertices) {
  Shape s;
  s.kind = ShapeKind::convex;
  s.points = std::move(vertices);
  return s;
}

namespace detail {
namespace {

class ConvexForm final : public CorneredForm {
 public:
  ConvexForm() : CorneredForm(5) {}
  void check(const Shape& s) const override { check_points(s, 4); }
  double reach(const Shape& s) const override { return reach_of_points(s); }
  void on_plane(const Shape& s, const Pose& pose, const Vector3d& plane, const Vector3d& n,
                double margin, NearPoints& out) const override {
    points_on_plane(s, pose, plane, n, margin, out);
  }
  void make_polyhedron(const Shape& s, Polyhedron& out) const override {
    std::map<std::size_t, int> number;  // of the points that are corners
    for (const std::vector<std::size_t>& corners : linalg::hull_faces(s.points)) {
      Polyhedron::Face face;
      for (const std::size_t k : corners) {
        const auto [place, fresh] = number.emplace(k, static_cast<int>(out.vertices.size()));
        if (fresh) out.vertices.push_back(s.points[k]);
        face.loop.push_back(place->second);
      }
      out.faces.push_back(face);
    }
    if (out.faces.empty()) throw std::invalid_argument("convex: the points lie in a plane");
  }
  void begin(const Shape& s, ConvexShape& out) const override {
    out.points = &s.points;
    for (const Vector3d& p : s.points) out.middle += p / static_cast<double>(s.points.size());
    Eigen::AlignedBox3d box;
    for (const Vector3d& p : s.points) box.extend(p);
    out.half = 0.5 * box.sizes();
    out.thickness = out.half.minCoeff();
  }
  Vector3d farthest(const ConvexShape& s, const Vector3d& m, double less) const override {
    double most = -std::numeric_limits<double>::infinity();
    Vector3d x = Vector3d::Zero();
    for (const Vector3d& p : *s.points)
      if (m.dot(p) > most) {
        most = m.dot(p);
        x = p;
      }
    const double part = 1 - less;
    return s.whole ? x : Vector3d(s.middle + part * (x - s.middle));
  }

 private:
  int corner_count(const ConvexShape& s) const override {
    return static_cast<int>(s.points->size());
  }
  Vector3d corner(const ConvexShape& s, int k) const override {
    return (*s.points)[static_cast<std::size_t>(k)];
  }
};

}  // namespace

TETHER_SHAPE_FORM(convex, ConvexForm)

}  // namespace detail
}  // namespace tether::contact

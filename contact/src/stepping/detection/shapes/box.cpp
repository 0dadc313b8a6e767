// Tether: boxes. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/polyhedra/polyhedron.hpp"
#include "stepping/detection/shape_form.hpp"

namespace tether::contact {

using Eigen::Vector3d;

Shape Shape::box(const Vector3d& size) {
  Shape s;
  s.kind = ShapeKind::box;
  s.size = size;
  return s;
}

namespace detail {
namespace {

class BoxForm final : public CorneredForm {
 public:
  BoxForm() : CorneredForm(2) {}
  void check(const Shape& s) const override { demand_positive(s, s.size.minCoeff(), "size"); }
  double reach(const Shape& s) const override { return 0.5 * s.size.norm(); }
  void on_plane(const Shape& s, const Pose& pose, const Vector3d& plane, const Vector3d& n,
                double margin, NearPoints& out) const override {
    for (int k = 0; k < 8; ++k)
      point_plane(pose.position + pose.rotation * box_corner(k, 0.5 * s.size), plane, n, margin, k,
                  out);
  }
  Nearest nearest(const Shape& s, const Vector3d& p) const override {
    const Vector3d half = 0.5 * s.size;
    const Vector3d inside = p.cwiseMax(-half).cwiseMin(half), d = p - inside;
    const double distance = d.norm();
    if (distance > 0) return {inside, d / distance, distance};
    int axis = 0;
    const double depth = (half - p.cwiseAbs()).minCoeff(&axis);
    const double side = p[axis] < 0 ? -1 : 1;
    Nearest out{p, side * Vector3d::Unit(axis), -depth};
    out.point[axis] = side * half[axis];
    return out;
  }
  bool has_nearest() const override { return true; }
  void make_polyhedron(const Shape& s, Polyhedron& out) const override {
    for (int k = 0; k < 8; ++k) out.vertices.push_back(box_corner(k, 0.5 * s.size));
    const int loops[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                             {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    for (const auto& loop : loops) {
      Polyhedron::Face face;
      face.loop.assign(loop, loop + 4);
      out.faces.push_back(face);
    }
  }
  void begin(const Shape& s, ConvexShape& out) const override {
    out.half = 0.5 * s.size;
    out.thickness = out.half.minCoeff();
  }
  Vector3d farthest(const ConvexShape& s, const Vector3d& m, double less) const override {
    Vector3d x;
    for (int k = 0; k < 3; ++k) x[k] = signed_one(m[k]) * (s.half[k] - less * s.thickness);
    return x;
  }

 private:
  int corner_count(const ConvexShape&) const override { return 8; }
  Vector3d corner(const ConvexShape& s, int k) const override { return box_corner(k, s.half); }
};

}  // namespace

TETHER_SHAPE_FORM(box, BoxForm)

}  // namespace detail
}  // namespace tether::contact

// Tether: a scene as it would be drawn by hand. SPDX-License-Identifier: BSD-3-Clause
#include "scene_drawing.hpp"

#include <cstdlib>
#include <tether/linalg/convex_hull.hpp>

#include "bounds.hpp"
#include "geometry/shape_type.hpp"
#include "joints/joint_type.hpp"

namespace tether::scene::picture {

namespace {

constexpr std::size_t kMostTriangles = 20000;  // of one surface that is drawn
constexpr double kNames = 11;                  // pixels
const Pen kDark{"#404040", 1.2, ""};

/// A colour between white (0) and itself (1), or towards black beyond.
std::string shade(const char* colour, double strength) {
  const long rgb = std::strtol(colour + 1, nullptr, 16);
  std::string out = "#";
  for (int shift = 16; shift >= 0; shift -= 8) {
    const double channel = static_cast<double>((rgb >> shift) & 255);
    const double mixed = strength <= 1 ? 255 + (channel - 255) * strength : channel / strength;
    out += fmt::format("{:02x}", static_cast<int>(std::clamp(mixed, 0.0, 255.0)));
  }
  return out;
}

/// A motion in a plane y = const is seen from the front, as it would be drawn by hand.
bool in_plane(const Scene& scene, const std::vector<const Poses*>& motion) {
  double size = 0, depth = 0;
  for (const Poses* now : motion)
    for (std::size_t b = 0; b < now->size(); ++b) {
      if (scene.bodies[b].fixed) continue;
      const Pose &pose = (*now)[b], &first = (*motion.front())[b];
      const Vector3d moved = pose.position - first.position;
      size = std::max(size, moved.norm());
      depth = std::max(depth, std::abs(moved.y()));
      const Eigen::Quaterniond turn = pose.orientation * first.orientation.conjugate();
      if (std::hypot(turn.x(), turn.z()) > 1e-3) return false;
    }
  return depth <= 1e-6 * size + 1e-12;
}

Matrix3d eye_of(const Scene& scene, const std::vector<const Poses*>& motion) {
  Matrix3d eye;
  if (in_plane(scene, motion)) {
    eye << 1, 0, 0, 0, 0, 1, 0, -1, 0;
    return eye;
  }
  const double azimuth = 0.45, elevation = 0.3;  // rad
  eye.row(0) << std::cos(azimuth), std::sin(azimuth), 0;
  eye.row(2) << std::sin(azimuth) * std::cos(elevation), -std::cos(azimuth) * std::cos(elevation),
      std::sin(elevation);
  eye.row(1) = Vector3d(eye.row(2)).cross(Vector3d(eye.row(0)));
  return eye;
}

/// The point of a body, or of the world (-1), that was there at t = 0.
Vector3d carried(const Scene& scene, const Poses& poses, int body, const Vector3d& point) {
  const auto b = static_cast<std::size_t>(body);
  if (body < 0 || b >= poses.size()) return point;
  const Body& start = scene.bodies[b];
  return poses[b].position +
         poses[b].orientation * (start.orientation.conjugate() * (point - start.position));
}

/// One of the two ends of a joint: on its first or on its second body.
Vector3d joint_end(const Scene& scene, const Poses& poses, const Joint& joint, bool second) {
  return second
             ? carried(scene, poses, joint.second, joints::type(joint.kind).point_on_second(joint))
             : carried(scene, poses, joint.first, joint.at);
}

/// A panel of the picture and the part of the scene that it shows.
class View {
 public:
  /// All that moves is inside, and no more of planes.
  View(const Scene& scene, const std::vector<const Poses*>& motion, const Box& panel)
      : eye_(eye_of(scene, motion)), panel_(panel) {
    constexpr double kBig = std::numeric_limits<double>::max();
    Vector2d low(kBig, kBig), high = -low;
    const auto take = [&](const Vector3d& p, double around) {
      if (!p.allFinite()) return;
      const Vector2d q = (eye_ * p).head<2>();
      low = low.cwiseMin(q - Vector2d::Constant(around));
      high = high.cwiseMax(q + Vector2d::Constant(around));
    };
    for (std::size_t b = 0; b < motion.front()->size(); ++b) {
      const double reach = reach_of(scene.bodies[b]);
      if (std::isinf(reach)) continue;  // a plane
      for (const Poses* now : motion) take((*now)[b].position, reach);
    }
    for (const Joint& joint : scene.joints)
      if (joint.kind != JointKind::slider && joint.kind != JointKind::planar)
        for (const bool second : {false, true})
          if ((second ? joint.second : joint.first) < 0)
            take(joint_end(scene, *motion.front(), joint, second), 0);
    for (const Spring& spring : scene.springs) {
      if (spring.first < 0) take(spring.at, 0);
      if (spring.second < 0) take(spring.at_second, 0);
      if (spring.cable)
        for (const Ring& ring : spring.cable->rings)
          if (ring.body < 0) take(ring.at, 0);
    }
    if (low.x() > high.x()) low = {-1, -1}, high = {1, 1};
    middle_ = (low + high) / 2;
    half_plane_ = std::max((high - low).norm(), 1e-6);
    const Vector2d size = (high - low).cwiseMax(1e-6);
    const double room = 0.86;  // of the panel; names and the scale lie around
    scale_ = room *
             std::min((panel.right - panel.left) / size.x(), (panel.bottom - panel.top) / size.y());
  }

  Vector2d pixel(const Vector3d& point) const {
    const Vector2d q = scale_ * ((eye_ * point).head<2>() - middle_);
    return {(panel_.left + panel_.right) / 2 + q.x(), (panel_.top + panel_.bottom) / 2 - q.y()};
  }

  /// Rows are the picture's right and up, and towards the viewer.
  const Matrix3d& eye() const { return eye_; }
  double pixels_per_metre() const { return scale_; }
  /// m: half the edge of a square that stands for a plane.
  double half_plane() const { return half_plane_; }
  const Box& panel() const { return panel_; }

 private:
  Matrix3d eye_;
  Box panel_;
  Vector2d middle_;
  double scale_ = 1, half_plane_ = 1;
};

class Drawing {
 public:
  Drawing(Canvas& canvas, const Scene& scene, const std::vector<const Poses*>& motion,
          const Box& panel)
      : canvas_(canvas),
        scene_(scene),
        motion_(motion),
        first_(*motion.front()),
        last_(*motion.back()),
        view_(scene, motion, panel) {}

  void draw(double end) {
    const Box& panel = view_.panel();
    canvas_.begin_clip(panel);
    for (const bool planes : {true, false})
      for (std::size_t b = 0; b < first_.size(); ++b)
        if (scene_.bodies[b].fixed) draw_body(b, first_[b], planes, true);
    draw_outlines();
    const std::vector<std::size_t> order = far_ones_first();
    std::size_t paths = 0;
    for (const std::size_t b : order)
      if (paths < 30 && draw_path(b)) ++paths;
    draw_links();
    for (const std::size_t b : order) draw_body(b, last_[b], false, true);
    for (const Spring& spring : scene_.springs) draw_spring(spring);
    draw_joints();
    canvas_.end_clip();
    draw_scale();
    if (end > 0)
      canvas_.text(fmt::format("t = 0 (outline) to {:.4g} s", end),
                   {{Vector2d(panel.right, panel.bottom + 14), Anchor::end}}, canvas_.whole(),
                   {kNames, "#606060"});
    draw_names(order);
  }

 private:
  bool is_drawn(int body) const {
    return body >= 0 && static_cast<std::size_t>(body) < last_.size();
  }
  bool moves(int body) const { return is_drawn(body) && scene_.moves(body); }
  const char* colour_of(std::size_t b) const {
    return scene_.bodies[b].fixed ? "#b0b0b0" : kColours[b % kColours.size()];
  }

  std::vector<Vector2d> pixels(const std::vector<Vector2d>& points,
                               const std::vector<std::size_t>& corners) const {
    std::vector<Vector2d> out;
    for (const std::size_t k : corners) out.push_back(points[k]);
    return out;
  }

  /// Not filled: its outline.
  void draw_body(std::size_t b, const Pose& pose, bool planes, bool filled) {
    const Body& body = scene_.bodies[b];
    const char* const colour = colour_of(b);
    const Matrix3d R = pose.orientation.toRotationMatrix();
    for (const Shape& shape : body.shapes) {
      if ((shape.kind == ShapeKind::plane) != planes) continue;
      if (planes) {
        draw_plane(shape, pose);
        continue;
      }
      const bool round = type_of(shape.kind).is_round();
      const Mesh m = mesh(shape, kAround, view_.half_plane());
      std::vector<Vector2d> points;
      for (const Vector3d& p : m.points) points.push_back(view_.pixel(pose.position + R * p));
      if (shape.kind == ShapeKind::mesh) {
        draw_surface(m, points, R, colour);
        continue;
      }
      const std::vector<Vector2d> outline = pixels(points, linalg::hull_corners(points));
      if (!filled) {
        canvas_.polygon(outline, "", {"#c8c8c8", 0.8, ""});
        continue;
      }
      if (round) canvas_.polygon(outline, shade(colour, 0.6), {colour, 0.8, ""});
      if (m.single.size() > 2)  // feet: the plate that stands on them
        canvas_.polygon(outline, shade(colour, 0.4), {colour, 0.8, ""});
      if (m.single.size() == 2) canvas_.path(points, {colour, 2.5, ""});
      if (!round) draw_faces(m, points, R, colour);
      for (const std::size_t k : m.single) canvas_.circle(points[k], 1.6, colour, {colour, 0, ""});
      if (body.fixed) canvas_.hatch(outline);
      if (names_many_) continue;
      for (std::size_t k = 0; k < outline.size(); ++k)
        canvas_.avoid(outline[k], outline[(k + 1) % outline.size()]);
    }
    if (body.shapes.empty() && filled && !planes)
      canvas_.circle(view_.pixel(pose.position), 2.5, colour, {colour, 0, ""});
  }

  /// Far faces first; those that are seen from their edge are lines.
  void draw_surface(const Mesh& m, const std::vector<Vector2d>& points, const Matrix3d& R,
                    const char* colour) {
    if (m.faces.size() > kMostTriangles)
      return canvas_.polygon(pixels(points, linalg::hull_corners(points)), "", {colour, 0.8, ""});
    std::vector<std::pair<double, std::size_t>> order;
    for (std::size_t f = 0; f < m.faces.size(); ++f) {
      const Vector3d middle =
          (m.points[m.faces[f][0]] + m.points[m.faces[f][1]] + m.points[m.faces[f][2]]) / 3;
      order.emplace_back(view_.eye().row(2).dot(R * middle), f);
    }
    std::sort(order.begin(), order.end());
    for (const auto& [depth, f] : order) draw_face(m, m.faces[f], points, R, -1e-6, colour, 0.4);
  }

  void draw_faces(const Mesh& m, const std::vector<Vector2d>& points, const Matrix3d& R,
                  const char* colour) {
    for (const std::vector<std::size_t>& face : m.faces)
      draw_face(m, face, points, R, 1e-9, colour, 0.8);
  }

  /// Draws a face that faces the eye by more than `least`.
  void draw_face(const Mesh& m, const std::vector<std::size_t>& face,
                 const std::vector<Vector2d>& points, const Matrix3d& R, double least,
                 const char* colour, double width) {
    const Vector3d normal =
        (R * (m.points[face[1]] - m.points[face[0]]).cross(m.points[face[2]] - m.points[face[0]]))
            .normalized();
    const double towards = view_.eye().row(2).dot(normal), up = view_.eye().row(1).dot(normal);
    if (towards > least)
      canvas_.polygon(pixels(points, face), shade(colour, 0.55 + 0.2 * towards - 0.15 * up),
                      {colour, width, ""});
  }

  /// Seen along its surface a plane is a line, hatched where the ground is; from elsewhere a pale
  /// square.
  void draw_plane(const Shape& shape, const Pose& pose) {
    std::vector<Vector3d> points;
    for (const Vector3d& p : mesh(shape, 8, view_.half_plane()).points)
      points.push_back(pose.position + pose.orientation * p);
    const Vector3d normal = (points[1] - points[0]).cross(points[2] - points[0]).normalized();
    const double towards = view_.eye().row(2).dot(normal);
    if (std::abs(towards) > 1e-3) {
      std::vector<Vector2d> square;
      for (const Vector3d& p : points) square.push_back(view_.pixel(p));
      canvas_.polygon(square, "#f4f2ee", {"#b0b0b0", 0.8, ""});
      return;
    }
    const Vector2d out(view_.eye().row(0).dot(normal), -view_.eye().row(1).dot(normal));
    const Vector2d along = 2000 * Vector2d(-out.y(), out.x()).normalized();
    const Vector2d middle = view_.pixel(pose.position + pose.orientation * shape.position);
    // The plane is drawn where the panel is, also if its own point is far from it.
    const Vector2d centre((view_.panel().left + view_.panel().right) / 2,
                          (view_.panel().top + view_.panel().bottom) / 2);
    const Vector2d at = centre + (middle - centre).dot(out) * out;
    canvas_.hatch({at - along, at + along, at + along - 11 * out, at - along - 11 * out});
    canvas_.line(at - along, at + along, kDark);
  }

  // Draws each body where it was on the way; few bodies only, or the picture is a thicket.
  void draw_outlines() {
    const std::size_t frames = first_.size() <= 6 ? 6 : 1;
    for (std::size_t f = 0; f < frames; ++f)
      for (std::size_t b = 0; b < first_.size(); ++b)
        if (!scene_.bodies[b].fixed)
          draw_body(b, (*motion_[f * (motion_.size() - 1) / frames])[b], false, false);
  }

  std::vector<std::size_t> far_ones_first() const {
    std::vector<std::size_t> order;
    for (std::size_t b = 0; b < last_.size(); ++b)
      if (!scene_.bodies[b].fixed) order.push_back(b);
    const auto depth = [&](std::size_t b) {
      return last_[b].position.allFinite() ? view_.eye().row(2).dot(last_[b].position) : 0.0;
    };
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return depth(a) < depth(b); });
    return order;
  }

  /// Draws the path of a body's centre; false: it hardly moved.
  bool draw_path(std::size_t b) {
    std::vector<Vector2d> path;
    double length = 0;
    for (const Poses* now : motion_) {
      const Vector2d p = view_.pixel((*now)[b].position);
      if (!p.allFinite() || p.cwiseAbs().maxCoeff() > 1e5) continue;
      const double step = path.empty() ? kInfinity : (p - path.back()).norm();
      if (step < 1) continue;
      if (!path.empty()) length += step;
      path.push_back(p);
    }
    if (length < 3) return false;
    canvas_.path(path, {colour_of(b), 1, ""});
    return true;
  }

  // From the centre of a body to its joints: the rods that its shapes do not show.
  void draw_links() {
    for (const Joint& joint : scene_.joints) {
      if (joint.kind == JointKind::slider || joint.kind == JointKind::planar) {
        draw_guide(joint);
        continue;
      }
      for (const bool second : {false, true}) {
        const int body = second ? joint.second : joint.first;
        if (!moves(body)) continue;
        const auto b = static_cast<std::size_t>(body);
        const Vector2d from = view_.pixel(last_[b].position),
                       to = view_.pixel(joint_end(scene_, last_, joint, second));
        canvas_.line(from, to, {shade(colour_of(b), 0.8), 2, ""});
        if (!names_many_) canvas_.avoid(from, to);
      }
      if (joint.kind == JointKind::distance)
        canvas_.line(view_.pixel(joint_end(scene_, last_, joint, false)),
                     view_.pixel(joint_end(scene_, last_, joint, true)), {"#404040", 2, ""});
    }
  }

  /// The line along which a slider moves.
  void draw_guide(const Joint& joint) {
    if (joint.kind != JointKind::slider || !is_drawn(joint.first)) return;
    Vector3d axis = joint.axis.normalized();
    if (is_drawn(joint.second)) {
      const auto s = static_cast<std::size_t>(joint.second);
      axis = last_[s].orientation * (scene_.bodies[s].orientation.conjugate() * axis);
    }
    const Vector3d middle = last_[static_cast<std::size_t>(joint.first)].position;
    const double half = 45 / view_.pixels_per_metre();
    canvas_.line(view_.pixel(middle - half * axis), view_.pixel(middle + half * axis),
                 {"#808080", 1, "8 3 2 3"});
  }

  void draw_cable(const Vector2d& from, const Cable& cable, const Vector2d& to) {
    std::vector<Vector2d> points = {from};
    for (const Ring& ring : cable.rings)
      points.push_back(view_.pixel(carried(scene_, last_, ring.body, ring.at)));
    points.push_back(to);
    canvas_.path(points, kDark);
  }

  void draw_spring(const Spring& spring) {
    if ((spring.first >= 0 && !is_drawn(spring.first)) ||
        (spring.second >= 0 && !is_drawn(spring.second)))
      return;
    const Vector2d from = view_.pixel(carried(scene_, last_, spring.first, spring.at)),
                   to = view_.pixel(carried(scene_, last_, spring.second, spring.at_second));
    const double length = (to - from).norm();
    if (spring.cable) return draw_cable(from, *spring.cable, to);
    if (!(length > 1)) return;
    const Vector2d along = (to - from) / length, across(-along.y(), along.x());
    const double straight = std::min(8.0, 0.15 * length);
    constexpr int kTurns = 14;
    std::vector<Vector2d> points = {from, from + straight * along};
    for (int k = 1; k < kTurns; ++k)
      points.emplace_back(from + (straight + (length - 2 * straight) * k / kTurns) * along +
                          (k % 2 == 0 ? -4.0 : 4.0) * across);
    points.emplace_back(to - straight * along);
    points.push_back(to);
    canvas_.path(points, kDark);
    canvas_.avoid(from, to);
    if (spring.first < 0) draw_support(from, false);
    if (spring.second < 0) draw_support(to, false);
  }

  void draw_joints() {
    for (const Joint& joint : scene_.joints) {
      if (joint.kind == JointKind::slider || joint.kind == JointKind::planar) continue;
      for (const bool second : {false, true}) {
        const int body = second ? joint.second : joint.first;
        if (body >= 0 && !is_drawn(body)) continue;
        const Vector2d p = view_.pixel(joint_end(scene_, last_, joint, second));
        const bool held = body < 0 || scene_.bodies[static_cast<std::size_t>(body)].shapes.empty();
        if (!moves(body) && held) draw_support(p, true);
        if (second && joint.kind != JointKind::distance) continue;  // the same point
        if (joint.kind == JointKind::fixed)
          canvas_.polygon(
              {p + Vector2d(-3, -3), p + Vector2d(3, -3), p + Vector2d(3, 3), p + Vector2d(-3, 3)},
              "#404040", kDark);
        else
          canvas_.circle(p, 3.2, "#ffffff", kDark);
        if (!names_many_) canvas_.block({p.x() - 4, p.y() - 4, p.x() + 4, p.y() + 4});
      }
    }
  }

  /// Draws the support of a point that the world holds.
  void draw_support(const Vector2d& p, bool bearing) {
    if (bearing) canvas_.polygon({p, p + Vector2d(-7, 11), p + Vector2d(7, 11)}, "#ffffff", kDark);
    const double y = bearing ? 11 : 0;
    canvas_.hatch({p + Vector2d(-11, y), p + Vector2d(11, y), p + Vector2d(11, y + 6),
                   p + Vector2d(-11, y + 6)});
    canvas_.line(p + Vector2d(-11, y), p + Vector2d(11, y), kDark);
    if (!names_many_) canvas_.block({p.x() - 11, p.y(), p.x() + 11, p.y() + y + 6});
  }

  void draw_scale() {
    const Box& panel = view_.panel();
    const double most = 0.3 * (panel.right - panel.left) / view_.pixels_per_metre();
    const double power = std::pow(10, std::floor(std::log10(most)));
    double length = power;
    for (const double k : {2.0, 5.0})
      if (k * power <= most) length = k * power;
    const Vector2d from(panel.left, panel.bottom + 14),
        to = from + Vector2d(length * view_.pixels_per_metre(), 0);
    canvas_.line(from, to, {"#202020", 1.5, ""});
    for (const Vector2d& p : {from, to})
      canvas_.line(p - Vector2d(0, 3), p + Vector2d(0, 3), {"#202020", 1.5, ""});
    canvas_.text(short_number(length) + " m", {{to + Vector2d(6, 4), Anchor::begin}},
                 canvas_.whole(), {kNames, "#202020"});
  }

  /// Draws the names of the bodies that somebody named.
  void draw_names(const std::vector<std::size_t>& order) {
    if (names_many_) return;
    for (const std::size_t b : order) {
      const std::string& name = scene_.bodies[b].name;
      if (name.empty() || name == fmt::format("body {}", b + 1)) continue;
      const Vector2d p = view_.pixel(last_[b].position);
      std::vector<Spot> spots;
      for (const double d : {9.0, 16.0, 26.0, 38.0, 52.0})
        for (const Vector2d& way :
             {Vector2d(1, 0), Vector2d(-1, 0), Vector2d(1, -0.8), Vector2d(1, 0.8),
              Vector2d(-1, -0.8), Vector2d(-1, 0.8), Vector2d(0, -1), Vector2d(0, 1)})
          spots.push_back({p + d * way + Vector2d(0, (0.35 + 0.45 * way.y()) * kNames),
                           way.x() > 0   ? Anchor::begin
                           : way.x() < 0 ? Anchor::end
                                         : Anchor::middle});
      canvas_.text(fitted(name, kNames, 150), spots, view_.panel(),
                   {kNames, shade(colour_of(b), 1.4)});
    }
  }

  Canvas& canvas_;
  const Scene& scene_;
  const std::vector<const Poses*>& motion_;
  const Poses &first_, &last_;
  View view_;
  bool names_many_ = scene_.moving().size() > 12;
};

}  // namespace

void draw_scene(Canvas& canvas, const Scene& scene, const std::vector<const Poses*>& motion,
                double end, const Box& panel) {
  Drawing(canvas, scene, motion, panel).draw(end);
}

}  // namespace tether::scene::picture

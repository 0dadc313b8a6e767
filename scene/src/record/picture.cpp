// Tether: a run as a picture: the scene at its start and end with the paths between, its energies
// and its errors over time. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <utility>

#include "geometry/hull.hpp"
#include "geometry/mesh.hpp"
#include "gnuplot.hpp"
#include "joints/list.hpp"
#include "output/whole_file.hpp"
#include "recorder.hpp"

namespace tether::scene {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::size_t kMostDrawn = 300;     // drawn; of more, only the first
constexpr std::size_t kMostRecords = 1024;  // kept; then every second one goes
constexpr std::size_t kMostPaths = 30;

/// Okabe and Ito: safe for colour-blind readers.
constexpr std::array<const char*, 7> kColours = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                 "#e69f00", "#56b4e9", "#999999"};

struct Pose {
  Vector3d position;
  Eigen::Quaterniond orientation;
};

struct Instant {
  double time;
  Diagnostics d;
  std::vector<Pose> bodies;
};

/// The eye: rows are the picture's right and up, and towards the viewer.
Matrix3d view(const std::vector<Instant>& instants, const Scene& scene, std::size_t bodies) {
  // A motion in a plane y = const is seen from the front, as it would be drawn by hand.
  double size = 0, depth = 0;
  bool turns_out = false;
  for (const Instant& instant : instants)
    for (std::size_t b = 0; b < bodies; ++b) {
      if (scene.bodies[b].fixed) continue;
      const Vector3d moved = instant.bodies[b].position - instants.front().bodies[b].position;
      size = std::max(size, moved.norm());
      depth = std::max(depth, std::abs(moved.y()));
      const Eigen::Quaterniond turn =
          instant.bodies[b].orientation * instants.front().bodies[b].orientation.conjugate();
      turns_out = turns_out || std::hypot(turn.x(), turn.z()) > 1e-3;
    }
  Matrix3d eye;
  if (depth <= 1e-6 * size + 1e-12 && !turns_out) {
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

Vector2d flat(const Matrix3d& eye, const Vector3d& p) { return (eye * p).head<2>(); }

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

class PictureRecorder : public Recorder {
 public:
  PictureRecorder(const Scene& scene, const std::string& file, double start_energy)
      : scene_(scene), file_(file), start_energy_(start_energy) {
    check_writable(file);
    bodies_ = std::min(scene.bodies.size(), kMostDrawn);
  }

  void record(const Engine& engine, const Diagnostics& d) override {
    if (seen_++ % stride_ != 0) {
      last_ = instant(engine, d);
      last_kept_ = false;
      return;
    }
    instants_.push_back(instant(engine, d));
    last_kept_ = true;
    if (instants_.size() < kMostRecords) return;
    std::vector<Instant> half;
    for (std::size_t i = 0; i < instants_.size(); i += 2) half.push_back(std::move(instants_[i]));
    instants_ = std::move(half);
    stride_ *= 2;
  }

  void finish(std::vector<std::string>& written, std::vector<std::string>& remarks) override {
    if (!last_kept_) instants_.push_back(last_);
    if (instants_.empty()) return;
    const std::string why = gnuplot(script(), file_);
    if (why.empty())
      written.push_back(file_);
    else
      remarks.push_back("no picture: " + why);
  }

 private:
  Instant instant(const Engine& engine, const Diagnostics& d) const {
    Instant now{engine.time(), d, {}};
    now.bodies.reserve(bodies_);
    for (std::size_t b = 0; b < bodies_; ++b)
      now.bodies.push_back({engine.bodies()[b].position, engine.bodies()[b].orientation});
    return now;
  }

  std::string script() {
    eye_ = view(instants_, scene_, bodies_);
    find_frame();
    std::string text = picture_head(860, 400);
    text += "set multiplot\nunset key\n";
    text +=
        "set lmargin at screen 0.02\nset rmargin at screen 0.5\nset tmargin at screen "
        "0.94\nset bmargin at screen 0.06\nunset border\nunset tics\nunset grid\n";
    text += fmt::format("set xrange [{:.6g}:{:.6g}]\nset yrange [{:.6g}:{:.6g}]\n", low_.x(),
                        high_.x(), low_.y(), high_.y());
    text += drawing();
    text +=
        "unset object\nunset label\nset border 3\nset xtics nomirror out\nset ytics nomirror "
        "out\nset grid\nset "
        "autoscale\n";
    text += fmt::format("set xrange [0:{:.6g}]\n", std::max(instants_.back().time, 1e-300));
    text += energies();
    text += errors();
    return text + "unset multiplot\n";
  }

  /// The part of the plane that is shown: all that moves, and no more of planes.
  void find_frame() {
    constexpr double kBig = std::numeric_limits<double>::max();
    low_ = {kBig, kBig};
    high_ = -low_;
    half_plane_ = 0;
    const auto take = [&](const Vector3d& p, double around) {
      const Vector2d q = flat(eye_, p);
      low_ = low_.cwiseMin(q - Vector2d::Constant(around));
      high_ = high_.cwiseMax(q + Vector2d::Constant(around));
    };
    for (const Instant& now : instants_)
      for (std::size_t b = 0; b < bodies_; ++b) {
        double reach = 0;
        bool plane = false;
        for (const Shape& shape : scene_.bodies[b].shapes) {
          plane = plane || shape.kind == ShapeKind::plane;
          if (shape.kind == ShapeKind::plane) continue;
          for (const Vector3d& p : mesh(shape, 8, 0).points) reach = std::max(reach, p.norm());
        }
        if (!plane && now.bodies[b].position.allFinite()) take(now.bodies[b].position, reach);
      }
    for (const Joint& joint : scene_.joints)
      if (joint.first < 0 || joint.second < 0)
        take(joint.second < 0 ? joints::type(joint.kind).point_on_second(joint) : joint.at, 0);
    if (low_.x() > high_.x()) low_ = {-1, -1}, high_ = {1, 1};
    const Vector2d middle = (low_ + high_) / 2;
    half_plane_ = (high_ - low_).norm();
    // Units are equal on both axes: the frame has the shape of the panel, 413 to 352 pixels.
    const double aspect = 413.0 / 352.0;
    double height = 1.1 * std::max({(high_ - low_).y(), (high_ - low_).x() / aspect, 1e-6});
    const Vector2d half = Vector2d(height * aspect, height) / 2;
    low_ = middle - half;
    high_ = middle + half;
  }

  /// Polygons of a body; `strength` 0: only outlines.
  void draw_body(std::size_t b, const Pose& pose, bool filled, std::string& text) const {
    const Body& body = scene_.bodies[b];
    const char* const colour = body.fixed ? "#b0b0b0" : kColours[b % kColours.size()];
    const Matrix3d R = pose.orientation.toRotationMatrix();
    for (const Shape& shape : body.shapes) {
      if (shape.kind == ShapeKind::plane) {
        draw_plane(shape, pose, text);
        continue;
      }
      const bool round = shape.kind == ShapeKind::sphere || shape.kind == ShapeKind::capsule ||
                         shape.kind == ShapeKind::ellipsoid;
      const bool curved = round || shape.kind == ShapeKind::cylinder;
      const Mesh m = mesh(shape, curved ? 20 : 8, half_plane_);
      std::vector<Vector2d> points;
      for (const Vector3d& p : m.points) points.push_back(flat(eye_, pose.position + R * p));
      if (round || !filled) {
        polygon(points, hull_corners(points), filled ? shade(colour, 0.6) : "",
                filled ? colour : "#c8c8c8", text);
        continue;
      }
      for (const std::vector<std::size_t>& face : m.faces) {
        const Vector3d normal =
            (R *
             (m.points[face[1]] - m.points[face[0]]).cross(m.points[face[2]] - m.points[face[0]]))
                .normalized();
        const double towards = eye_.row(2).dot(normal), up = eye_.row(1).dot(normal);
        if (towards > 1e-9)
          polygon(points, face, shade(colour, 0.55 + 0.2 * towards - 0.15 * up), colour, text);
      }
      if (m.single.size() > 2)  // feet: the plate that stands on them
        polygon(points, hull_corners(points), shade(colour, 0.4), colour, text);
      for (const std::size_t k : m.single) dot(points[k], colour, text);
    }
    if (body.shapes.empty()) dot(flat(eye_, pose.position), colour, text);
  }

  /// A plane seen along its surface is a line; from elsewhere a pale square.
  void draw_plane(const Shape& shape, const Pose& pose, std::string& text) const {
    std::vector<Vector2d> points;
    for (const Vector3d& p : mesh(shape, 8, half_plane_).points)
      points.push_back(flat(eye_, pose.position + pose.orientation * p));
    polygon(points, {0, 1, 2, 3}, "#f4f2ee", "#b0b0b0", text);
  }

  void polygon(const std::vector<Vector2d>& points, const std::vector<std::size_t>& corners,
               const std::string& fill, const std::string& edge, std::string& text) const {
    if (corners.size() < 2) return;
    text += "set object polygon from ";
    for (std::size_t i = 0; i <= corners.size(); ++i) {
      const Vector2d& p = points[corners[i % corners.size()]];
      text += fmt::format("{}{:.5g},{:.5g}", i == 0 ? "" : " to ", p.x(), p.y());
    }
    text += fill.empty() ? " fs empty" : fmt::format(" fc rgb '{}' fs solid", fill);
    text += fmt::format(" border lc rgb '{}' lw 0.8 clip\n", edge);
  }

  void dot(const Vector2d& p, const std::string& colour, std::string& text) const {
    text += fmt::format("set label '' at {:.5g},{:.5g} point pt 7 ps 0.4 lc rgb '{}'\n", p.x(),
                        p.y(), colour);
  }

  std::string drawing() const {
    std::string text;
    const Instant &first = instants_.front(), &last = instants_.back();
    const auto fixed = [&](std::size_t b) { return scene_.bodies[b].fixed; };
    for (std::size_t b = 0; b < bodies_; ++b)
      if (fixed(b)) draw_body(b, first.bodies[b], true, text);
    // Where it was on the way, as outlines; few bodies only, or the picture is a thicket.
    const std::size_t frames = bodies_ <= 6 ? 6 : 1;
    for (std::size_t f = 0; f < frames; ++f)
      for (std::size_t b = 0; b < bodies_; ++b)
        if (!fixed(b))
          draw_body(b, instants_[f * (instants_.size() - 1) / frames].bodies[b], false, text);
    // The far ones first.
    std::vector<std::size_t> order;
    for (std::size_t b = 0; b < bodies_; ++b)
      if (!fixed(b)) order.push_back(b);
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return eye_.row(2).dot(last.bodies[a].position) < eye_.row(2).dot(last.bodies[b].position);
    });
    for (const std::size_t b : order) draw_body(b, last.bodies[b], true, text);
    text += fmt::format(
        "set label \"t = 0 (outline) to {:.4g} s\" at graph 0.01,0.02 tc rgb '#606060'\n",
        last.time);

    std::string paths, plots;
    std::size_t drawn = 0;
    for (const std::size_t b : order) {
      if (drawn == kMostPaths) break;
      const std::string path = path_of(b);
      if (path.empty()) continue;
      paths += fmt::format("$path{} << EOD\n{}EOD\n", drawn, path);
      plots += fmt::format("{} $path{} with lines lc rgb '{}' lw 1", plots.empty() ? "plot" : ",",
                           drawn, kColours[b % kColours.size()]);
      ++drawn;
    }
    if (plots.empty()) plots = "plot NaN";
    return paths + text + plots + "\n";
  }

  /// Path of a body's centre, without parts drawn already; empty if it hardly moved.
  std::string path_of(std::size_t b) const {
    const double pixel = (high_ - low_).x() / 400;
    std::map<std::pair<long, long>, std::size_t> visited;  // cells of the picture, and when first
    std::string path;
    Vector2d before = Vector2d::Constant(std::numeric_limits<double>::infinity());
    double length = 0;
    bool broken = false;
    std::size_t count = 0;
    for (const Instant& now : instants_) {
      const Vector2d p = flat(eye_, now.bodies[b].position), cell = (p - low_) / (2 * pixel);
      const double step = (p - before).norm();
      if (!(step >= pixel) || !cell.allFinite() || cell.cwiseAbs().maxCoeff() > 1e6) continue;
      const auto [first, fresh] =
          visited.emplace(std::pair(std::lround(cell.x()), std::lround(cell.y())), count);
      const bool again = !fresh && first->second + 5 < count;
      if (std::isfinite(step)) length += step;
      ++count;
      before = p;
      if (again && broken) continue;
      path += fmt::format("{:.4g} {:.4g}\n{}", p.x(), p.y(), again ? "\n" : "");
      broken = again;
    }
    return length < 3 * pixel ? "" : path;
  }

  template <class Value>
  std::string column(const char* name, Value value, bool peaks = false) const {
    std::string text = fmt::format("${} << EOD\n", name);
    const std::size_t step = 1 + instants_.size() / 200;
    for (std::size_t i = 0; i < instants_.size(); i += step) {
      // Errors: the largest between two points; else the value itself.
      double shown = value(instants_[i].d);
      if (peaks)
        for (std::size_t k = i; k < std::min(i + step, instants_.size()); ++k)
          shown = std::max(shown, value(instants_[k].d));
      text += fmt::format("{:.5g} {:.5g}\n", instants_[i].time, shown);
    }
    return text + "EOD\n";
  }

  std::string energies() const {
    std::string text =
        column("kinetic", [](const Diagnostics& d) { return d.kinetic_energy; }) +
        column("potential", [](const Diagnostics& d) { return d.potential_energy; }) +
        column("total", [](const Diagnostics& d) { return d.kinetic_energy + d.potential_energy; });
    text +=
        "set lmargin at screen 0.6\nset rmargin at screen 0.98\nset tmargin at screen "
        "0.94\nset bmargin at screen 0.58\nset key at graph 1,1.14 horizontal right samplen 1.5 "
        "width -2\n"
        "set ylabel 'energy / J' offset 0.5\nset format x ''\nset ytics autofreq nomirror\n"
        "set offsets 0,0,graph 0.05,graph 0.05\n"
        "plot $kinetic with lines lc rgb '#0072b2' lw 1.5 title 'kinetic', $potential with "
        "lines lc rgb '#e69f00' lw 1.5 title 'potential', $total with lines lc rgb '#202020' lw "
        "1.5 title 'sum'\n";
    return text;
  }

  std::string errors() const {
    struct Curve {
      const char *name, *title, *colour;
      double (*value)(const Diagnostics&);
    };
    const std::array<Curve, 3> curves = {{
        {"drift", "drift", "#d55e00", [](const Diagnostics& d) { return d.drift; }},
        {"penetration", "penetration / m", "#009e73",
         [](const Diagnostics& d) { return d.penetration; }},
        {"residual", "residual", "#cc79a7", [](const Diagnostics& d) { return d.residual; }},
    }};
    std::string text, plots;
    const auto plot = [&](const char* name, const char* title, const char* colour) {
      plots += fmt::format("{} ${} with lines lc rgb '{}' lw 1.5 title '{}'",
                           plots.empty() ? "plot" : ",", name, colour, title);
    };
    double scale = 0, largest = 0;
    for (const Instant& now : instants_)
      scale = std::max({scale, now.d.kinetic_energy, std::abs(now.d.potential_energy)});
    const auto change = [&](const Diagnostics& d) {
      const double c = std::abs(d.kinetic_energy + d.potential_energy - start_energy_);
      largest = std::max(largest, c);
      return std::max(c, 1e-17);
    };
    const std::string energy = column("change", change, true);
    if (largest > 0) {
      text += energy;
      plot("change", "energy change / J", "#202020");
    }
    for (const Curve& curve : curves) {
      double most = 0;
      const std::string data = column(
          curve.name,
          [&](const Diagnostics& d) {
            most = std::max(most, curve.value(d));
            return std::max(curve.value(d), 1e-17);
          },
          true);
      if (!(most > 0)) continue;
      text += data;
      plot(curve.name, curve.title, curve.colour);
    }
    if (plots.empty()) plots = "plot NaN notitle";
    text +=
        "set tmargin at screen 0.46\nset bmargin at screen 0.12\nset logscale y\nset format y "
        "'10^{%T}'\nset format x '%g'\nunset ylabel\nset xlabel 't / s' offset 0,0.4\n"
        "set ytics 1e-16,1e4 nomirror; unset mytics\nset yrange [1e-17:1e-12<*]\nset key at graph "
        "1,1.16 "
        "horizontal right samplen 1.2 width -5 font ',11'\n";
    return text + plots + "\n";
  }

  const Scene& scene_;
  std::string file_;
  double start_energy_;
  std::size_t bodies_ = 0, stride_ = 1, seen_ = 0;
  std::vector<Instant> instants_;
  Instant last_{};
  bool last_kept_ = true;
  Matrix3d eye_ = Matrix3d::Identity();
  Vector2d low_, high_;
  double half_plane_ = 1;
};

}  // namespace

std::unique_ptr<Recorder> make_picture_recorder(const Scene& scene, const std::string& file,
                                                double start_energy) {
  return std::make_unique<PictureRecorder>(scene, file, start_energy);
}

}  // namespace tether::scene

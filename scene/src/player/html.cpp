// Tether: a run as a page that plays it in a browser. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "bounds.hpp"
#include "film.hpp"
#include "geometry/shape_type.hpp"
#include "joints/joint_type.hpp"
#include "output/files.hpp"
#include "page_text.hpp"
#include "record/formats.hpp"

namespace tether::scene {

namespace player {

namespace {

using Eigen::Vector3d;
using Json = nlohmann::json;

Json list(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }
template <class Quaternion>
Json wxyz(const Quaternion& q) {
  return {q.w(), q.x(), q.y(), q.z()};
}

/// Shapes of one form share it: spheres and boxes of every size, others that are equal.
class Forms {
 public:
  Forms(int around, const View& view) : around_(around), view_(view) {}

  /// Adds the number of the form and its scale to a part.
  void add_to(Json& part, const Shape& shape) {
    Shape form = shape;
    form.position.setZero();
    form.orientation.setIdentity();
    const std::optional<Vector3d> size = type_of(shape.kind).make_unit(form);
    const Mesh m = mesh(form, around_, 0);
    Json points = Json::array();
    for (const Vector3d& p : m.points)
      points.push_back(player::list(size ? p : Vector3d(p / view_.length)));
    const Json entry = {
        {"points", points}, {"faces", m.faces}, {"round", type_of(shape.kind).is_round()}};
    const auto [at, fresh] = known_.emplace(entry.dump(), known_.size());
    if (fresh) list_.push_back(entry);
    part["form"] = at->second;
    part["scale"] =
        player::list(size ? Vector3d(*size / view_.length) : Vector3d(Vector3d::Ones()));
  }
  const Json& list() const { return list_; }

 private:
  int around_;
  View view_;
  std::map<std::string, std::size_t> known_;
  Json list_ = Json::array();
};

/// A point, given in world axes at t = 0, in the axes of its body; body -1: the world.
Json anchor(const Scene& scene, int body, const Vector3d& at, const View& view) {
  Vector3d local = at - view.centre;
  if (body >= 0) {
    const Body& b = scene.bodies[static_cast<std::size_t>(body)];
    local = b.orientation.conjugate() * (at - b.position);
  }
  return {{"body", body}, {"at", list(local / view.length)}};
}

Json turned(const Scene& scene, int body, const Vector3d& axis) {
  const Vector3d along = axis.stableNormalized();
  if (body < 0) return list(along);
  return list(scene.bodies[static_cast<std::size_t>(body)].orientation.conjugate() * along);
}

Json joint_entry(const Scene& scene, const Joint& joint, const View& view) {
  std::string_view kind;
  for (const auto& [word, each] : kJointWords)
    if (each == joint.kind) kind = word;
  // A slider has no point: it is shown where its first body is.
  const bool slider = joint.kind == JointKind::slider;
  const int shown = joint.first >= 0 ? joint.first : joint.second;
  const Vector3d at =
      slider && shown >= 0 ? scene.bodies[static_cast<std::size_t>(shown)].position : joint.at;
  const Json first = anchor(scene, slider ? shown : joint.first, at, view);
  const Json second =
      slider ? first
             : anchor(scene, joint.second, joints::type(joint.kind).point_on_second(joint), view);
  return {{"name", joint.name},
          {"kind", kind},
          {"first", first},
          {"second", second},
          {"axis", turned(scene, joint.second, joint.axis)},
          {"axis_body", joint.second}};
}

Json spring_entry(const Scene& scene, const Spring& spring, const View& view) {
  Json out = {{"name", spring.name},
              {"first", anchor(scene, spring.first, spring.at, view)},
              {"second", anchor(scene, spring.second, spring.at_second, view)}};
  if (!spring.cable) return out;
  Json rings = Json::array();
  for (const Ring& ring : spring.cable->rings)
    rings.push_back(anchor(scene, ring.body, ring.at, view));
  out["rings"] = rings;
  return out;
}

Json part_entry(const Shape& shape, const View& view, Forms& forms) {
  Json part = {{"position", list(shape.position / view.length)},
               {"orientation", wxyz(shape.orientation)}};
  if (shape.kind == ShapeKind::plane) {
    part["normal"] = list(shape.normal.stableNormalized());
    return part;
  }
  const Mesh m = mesh(shape, 8, 0);
  // Single points of a shape that are shown.
  for (std::size_t k = 0; k < std::min<std::size_t>(64, m.single.size()); ++k)
    part["dots"].push_back(list(m.points[m.single[k]] / view.length));
  if (m.single.empty()) forms.add_to(part, shape);
  return part;
}

/// Centre and size of the bodies at the start, planes apart.
View view_of(const Scene& scene) {
  Eigen::AlignedBox3d box;
  const auto take = [&](const Vector3d& p) {
    if (p.allFinite()) box.extend(p);
  };
  double largest = 0;
  for (const Body& body : scene.bodies) {
    const double around = reach_of(body);
    if (std::isinf(around)) continue;  // a plane
    largest = std::max(largest, around);
    take(body.position - Vector3d::Constant(around));
    take(body.position + Vector3d::Constant(around));
  }
  for (const Joint& joint : scene.joints) take(joint.at);
  View out;
  if (box.isEmpty()) return out;
  out.centre = box.center();
  out.length = std::max(box.diagonal().norm() / 2, largest);
  if (!(out.length > 0) || !std::isfinite(out.length)) out.length = 1;
  return out;
}

/// The object of the page, without what the film adds. `moving`: as in Film.
Json scene_data(const Scene& scene, const std::vector<std::size_t>& moving, const View& view) {
  Forms forms(scene.bodies.size() > kManyBodies ? 10 : kAround, view);
  std::map<std::size_t, std::size_t> number;  // of a moving body in the film
  for (std::size_t i = 0; i < moving.size(); ++i) number.emplace(moving[i], i);
  Json bodies = Json::array(), joints = Json::array(), springs = Json::array(),
       centres = Json::array();
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const Body& body = scene.bodies[b];
    Json parts = Json::array();
    for (const Shape& shape : body.shapes) parts.push_back(part_entry(shape, view, forms));
    const auto film = number.find(b);
    bodies.push_back({{"name", body.name},
                      {"film", film == number.end() ? Json() : Json(film->second)},
                      {"position", list((body.position - view.centre) / view.length)},
                      {"orientation", wxyz(body.orientation)},
                      {"parts", parts}});
  }
  for (const Joint& joint : scene.joints) joints.push_back(joint_entry(scene, joint, view));
  for (const Spring& spring : scene.springs) springs.push_back(spring_entry(scene, spring, view));
  for (const CentralGravity& each : scene.central_gravity)
    centres.push_back(list((each.at - view.centre) / view.length));
  const Vector3d down = scene.gravity.value_or(Vector3d::Zero());
  const Vector3d up = down.norm() > 0 ? Vector3d(-down.stableNormalized()) : Vector3d::UnitZ();
  return {{"name", scene.name}, {"length", view.length}, {"centre", list(view.centre)},
          {"up", list(up)},     {"bodies", bodies},      {"forms", forms.list()},
          {"joints", joints},   {"springs", springs},    {"centres", centres}};
}

}  // namespace

}  // namespace player

namespace formats {

namespace {

using namespace player;

class PageRecorder : public Recorder {
 public:
  PageRecorder(const std::string& file, const Beginning& run)
      : scene_(run.scene),
        file_(file),
        start_energy_(run.start_energy),
        restarted_(run.resume.time),
        moving_(run.scene.moving()),
        view_(view_of(run.scene)),
        film_(moving_, view_) {
    check_writable(file);
  }

  void record(const Engine& engine, const Diagnostics& d) override {
    engine_ = engine.name();
    film_.record(engine, d);
  }

  void finish(std::vector<std::string>& written, std::vector<std::string>& remarks) override {
    film_.finish();
    if (film_.frames().empty()) return;
    write_whole(file_, page());
    written.push_back(file_);
    if (restarted_) remarks.push_back(file_ + " shows the motion from the restart on");
  }

 private:
  std::string page() const {
    std::string out =
        page_head(scene_.name.empty() ? "Tether" : scene_.name, kStyle) + std::string(kBody);
    nlohmann::json data = scene_data(scene_, moving_, view_);
    data["engine"] = engine_;
    data["start_energy"] = start_energy_;
    for (const Film::Frame& each : film_.frames()) {
      data["times"].push_back(each.time);
      data["kinetic"].push_back(each.d.kinetic_energy);
      data["potential"].push_back(each.d.potential_energy);
      data["drift"].push_back(each.d.drift);
      data["penetration"].push_back(each.d.penetration);
      data["residual"].push_back(each.d.residual);
      data["contacts"].push_back(each.contacts.size() / 9);
    }
    out +=
        "<script id=\"film-data\" type=\"application/json\">" + script_text(data) + "</script>\n";
    const auto add = [&](const char* id, const std::string& base64) {
      out += fmt::format("<script id=\"{}\" type=\"text/plain\">{}</script>\n", id, base64);
    };
    add("film-positions", film_.joined(&Film::Frame::positions));
    add("film-orientations", film_.joined(&Film::Frame::orientations));
    add("film-contacts", film_.joined(&Film::Frame::contacts));
    return out + "<script>\n" + std::string(kScript) + "</script>\n</body>\n</html>\n";
  }

  const Scene& scene_;
  std::string file_, engine_;
  double start_energy_;
  bool restarted_;
  std::vector<std::size_t> moving_;
  View view_;
  Film film_;
};

}  // namespace

TETHER_FORMAT(html, ".html", "Page that plays the run in a browser, on its own",
              add_recorder<PageRecorder>)

}  // namespace formats

}  // namespace tether::scene

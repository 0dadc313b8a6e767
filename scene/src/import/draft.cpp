// Tether: parts of a robot as bodies, joints and contacts of a scene. SPDX-License-Identifier:
// BSD-3-Clause
#include "import/draft.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "toml/report.hpp"

namespace tether::scene::import {

namespace {

using Eigen::Vector3d;

constexpr std::size_t kMostMaterials = 16;

std::string clean_title(const std::string& name) {
  std::string title = files::printable(name);
  for (char& c : title)
    if (c == ',' || c == '"' || c == '\'') c = ' ';
  title.erase(0, title.find_first_not_of("=+-@ "));
  return files::is_plain(title) ? title : "";  // too long
}

class Drafting {
 public:
  Drafting(const Model& model, const std::vector<Part>& parts, const ImportOptions& options,
           Remarks& remarks)
      : model_(model),
        parts_(parts),
        options_(options),
        remarks_(remarks),
        has_ground_(options.ground || std::any_of(parts.begin(), parts.end(), [](const Part& part) {
                      return part.fixed() && part.scenery && part.touch;
                    })) {}
  Draft take() {
    draft_.scene.name = clean_title(model_.name);
    draft_.scene.end = options_.end;
    draft_.scene.gravity = model_.gravity;
    if (model_.step > 0) draft_.step = model_.step;
    add_ground();
    for (const Part& part : parts_) body_of_.push_back(part.gone ? -1 : add_body(part));
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      const Part& part = parts_[k];
      if (part.gone || part.fixed()) continue;
      const int on = part.parent < 0 ? -1 : body_of_[static_cast<std::size_t>(part.parent)];
      add_joints(part, body_of_[k], on, options_, draft_, remarks_);
    }
    add_pairs();
    make_unique();
    const Scene& scene = draft_.scene;
    const bool laws = std::any_of(scene.joints.begin(), scene.joints.end(), [](const Joint& each) {
      return each.limits || each.friction > 0;
    });
    if (model_.step > 0 && (laws || !scene.pairs.empty()))
      draft_.scene.stepping.emplace().step = model_.step;
    return std::move(draft_);
  }

 private:
  void add_ground() {
    if (!options_.ground) return;
    Body body;
    body.name = "ground";
    body.fixed = true;
    body.position.z() = *options_.ground;
    body.shapes.emplace_back().kind = ShapeKind::plane;
    Touch touch;
    touch.type = touch.affinity = std::numeric_limits<unsigned>::max();
    body.material = material(touch, still_, "ground");
    draft_.scene.bodies.push_back(std::move(body));
    draft_.body_comments.emplace_back("--ground");
  }
  /// -1: the world, where a fixed part has nothing to show.
  int add_body(const Part& part) {
    if (part.fixed() && part.shapes.empty()) return -1;
    Body body;
    body.name = part.name;
    if (body.name == "world")
      body.name = part.links.size() > 1 ? part.links[1] : std::string("world link");
    body.fixed = part.fixed();
    body.position = part.pose * part.centre;
    body.orientation = Eigen::Quaterniond(part.pose.linear()).normalized();
    if (!part.fixed()) {
      body.mass = part.mass;
      body.inertia = part.inertia;
    }
    body.shapes = part.shapes;
    for (Shape& shape : body.shapes) {
      shape.position -= part.centre;
      shape.orientation.normalize();
    }
    // The base of a URDF is part of the robot, which does not touch itself.
    const bool touches =
        has_ground_ && part.touch && !part.shapes.empty() && (!part.fixed() || model_.base_is_said);
    if (touches)
      body.material = part.fixed() ? material(*part.touch, still_, "ground")
                                   : material(*part.touch, moving_, "robot");
    std::string comment = fmt::format("line {}", part.line);
    if (part.links.size() > 1) {
      comment += ", with";
      for (std::size_t k = 1; k < part.links.size(); ++k)
        comment += (k > 1 ? ", " : " ") + part.links[k];
    }
    draft_.scene.bodies.push_back(std::move(body));
    draft_.body_comments.push_back(std::move(comment));
    return static_cast<int>(draft_.scene.bodies.size()) - 1;
  }
  using Materials = std::map<Touch, std::string>;
  std::string material(Touch touch, Materials& of, const char* stem) {
    // Materials differ by what is asked of them only.
    if (options_.friction) {
      touch.friction = *options_.friction;
      touch.tangential = true;
    }
    if (of.size() >= kMostMaterials && of.count(touch) == 0) {
      remarks_.add("kinds of contact beyond the first sixteen have the rule of the first");
      return of.begin()->second;
    }
    const std::string next =
        of.empty() ? std::string(stem) : fmt::format("{} {}", stem, of.size() + 1);
    return of.emplace(touch, next).first->second;
  }
  void add_pairs() {
    for (auto a = moving_.begin(); a != moving_.end(); ++a) {
      for (const auto& [ground, name] : still_) {
        Pair pair;
        pair.first = a->second;
        pair.second = name;
        const Touch& robot = a->first;
        pair.touch = (robot.type & ground.affinity) != 0 || (ground.type & robot.affinity) != 0;
        if (pair.touch && (robot.tangential || ground.tangential))
          pair.friction = std::max(robot.friction, ground.friction);
        draft_.scene.pairs.push_back(std::move(pair));
      }
      for (auto b = a; b != moving_.end(); ++b) {
        Pair pair;
        pair.first = a->second;
        pair.second = b->second;
        pair.touch = false;
        draft_.scene.pairs.push_back(std::move(pair));
      }
    }
    if (!moving_.empty())
      remarks_.add("contacts of the robot with itself (touch = false in a [[pair]])");
  }
  /// Names that the file uses for two things, which a scene tells apart.
  void make_unique() {
    const auto each_once = [](auto& all) {
      std::set<std::string> names;
      for (const auto& each : all) names.insert(each.name);
      std::set<std::string> used;
      std::map<std::string, int> last;  // number of each name
      for (auto& each : all) {
        if (used.insert(each.name).second) continue;
        const std::string stem = each.name;
        int& k = last.emplace(stem, 1).first->second;
        do each.name = fmt::format("{} {}", stem, ++k);
        while (names.count(each.name) > 0 || !used.insert(each.name).second);
      }
    };
    each_once(draft_.scene.bodies);
    each_once(draft_.scene.joints);
    each_once(draft_.scene.springs);
  }

  const Model& model_;
  const std::vector<Part>& parts_;
  const ImportOptions& options_;
  Remarks& remarks_;
  bool has_ground_;  // anything that a robot could touch
  Draft draft_;
  std::vector<int> body_of_;  // of each part
  Materials moving_, still_;
};

}  // namespace

Draft make_draft(const Model& model, const std::vector<Part>& parts, const ImportOptions& options,
                 Remarks& remarks) {
  return Drafting(model, parts, options, remarks).take();
}

}  // namespace tether::scene::import

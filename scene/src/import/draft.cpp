// Tether: parts of a robot as bodies, joints and contacts of a scene. SPDX-License-Identifier:
// BSD-3-Clause
#include <fmt/format.h>

#include <cmath>
#include <tether/linalg/pi.hpp>
#include <tether/scene/plan.hpp>

#include "parts.hpp"
#include "toml/report.hpp"
#include <algorithm>

namespace tether::scene::import {

namespace {

using Eigen::Vector3d;

constexpr double kNear = 1e-9;  // m: lines this near to each other meet

using Chain = std::vector<PlacedJoint>;

long count(const Chain& chain, MotionKind kind) {
  return count_if(chain, [&](const PlacedJoint& each) { return each.law.kind == kind; });
}

/// Point in which the axes of two hinges meet.
std::optional<Vector3d> crossing(const PlacedJoint& a, const PlacedJoint& b) {
  const Vector3d across = a.axis.cross(b.axis), d = b.at - a.at;
  const double square = across.squaredNorm();
  if (square < 1e-12) return {};
  const Vector3d on_a = a.at + d.cross(b.axis).dot(across) / square * a.axis;
  const Vector3d on_b = b.at + d.cross(a.axis).dot(across) / square * b.axis;
  if (!((on_a - on_b).norm() <= kNear * (1 + d.norm()))) return {};
  return (on_a + on_b) / 2;
}

bool passes(const PlacedJoint& joint, const Vector3d& point) {
  return (point - joint.at).cross(joint.axis).norm() <= kNear * (1 + (point - joint.at).norm());
}

/// The joints as one; `chain` from the parent outwards.
std::optional<Joint> as_one(const Chain& chain) {
  const long hinges = count(chain, MotionKind::hinge), slides = count(chain, MotionKind::slide);
  if (hinges + slides != static_cast<long>(chain.size())) return {};
  Joint out;
  if (hinges == 2 && slides == 0) {
    const auto point = crossing(chain[0], chain[1]);
    if (!point || std::abs(chain[0].axis.dot(chain[1].axis)) > 1e-9) return {};
    out.kind = JointKind::universal;
    out.at = *point;
    out.axis = chain[1].axis;         // carried by the body itself
    out.axis_second = chain[0].axis;  // by its parent
    return out;
  }
  if (hinges == 3 && slides == 0) {
    const auto point = crossing(chain[0], chain[1]);
    const double volume = std::abs(chain[0].axis.cross(chain[1].axis).dot(chain[2].axis));
    if (!point || !passes(chain[2], *point) || volume < 1e-3) return {};
    out.kind = JointKind::ball;
    out.at = *point;
    return out;
  }
  if (hinges == 1 && slides == 2) {
    std::vector<Vector3d> ways;
    for (const PlacedJoint& each : chain) {
      if (each.law.kind == MotionKind::slide) ways.push_back(each.axis);
      if (each.law.kind != MotionKind::hinge) continue;
      out.axis = each.axis;
      out.at = each.at;
    }
    if (std::abs(ways[0].dot(out.axis)) > 1e-9 || std::abs(ways[1].dot(out.axis)) > 1e-9 ||
        ways[0].cross(ways[1]).norm() < 1e-3)
      return {};
    out.kind = JointKind::planar;
    return out;
  }
  return {};
}

/// Laws of a joint without a coordinate; `sprung`: it has springs and dampers all the same.
void name_lost_laws(const LinkJoint& law, bool sprung, Remarks& remarks) {
  static constexpr const char* kWords[] = {"friction", "damping", "stiffness", "limits"};
  const bool has[] = {law.friction > 0, law.damping > 0 && !sprung, law.stiffness > 0 && !sprung,
                      law.limits.has_value()};
  for (std::size_t k = 0; k < std::size(has); ++k)
    if (has[k])
      remarks.add(fmt::format("{} of balls, free and planar joints", kWords[k]), law.name);
}

/// Whether something acts along the coordinate of a joint, which it needs for that.
bool has_laws(const PlacedJoint& placed, const ImportOptions& options) {
  const LinkJoint& law = placed.law;
  return law.is_summed || law.damping > 0 || law.stiffness > 0 || law.armature > 0 ||
         law.is_driven || law.mimic || (options.joint_laws && (law.limits || law.friction > 0));
}

std::string names(const Chain& chain) {
  std::string out;
  for (const PlacedJoint& each : chain) out += (out.empty() ? "" : " + ") + each.law.name;
  return out;
}

void add_laws(const PlacedJoint& placed, const ImportOptions& options, Joint& joint,
              std::string& comment, Remarks& remarks) {
  const LinkJoint& law = placed.law;
  if (placed.value != 0) comment += fmt::format("; 0 here is {} there", placed.value);
  if (!options.joint_laws) return;
  joint.friction = law.friction;
  if (!law.limits) return;
  const double lower = law.limits->first - placed.value, upper = law.limits->second - placed.value;
  if (!(lower <= 0 && upper >= 0 && lower < upper))
    return remarks.add("limits that the start is beyond", law.name);
  if (!has_wide_limits(law)) joint.limits = JointLimits{lower, upper, 0};
}

void add_single(const PlacedJoint& placed, int first, int second, const ImportOptions& options,
                Draft& draft, Remarks& remarks) {
  static constexpr std::pair<MotionKind, JointKind> kKinds[] = {
      {MotionKind::hinge, JointKind::hinge},
      {MotionKind::slide, JointKind::slider},
      {MotionKind::ball, JointKind::ball},
      {MotionKind::planar, JointKind::planar}};
  Joint joint;
  for (const auto& [from, to] : kKinds)
    if (from == placed.law.kind) joint.kind = to;
  joint.name = placed.law.name;
  joint.first = first;
  joint.second = second;
  joint.at = placed.at;
  joint.axis = placed.axis;
  std::string comment = fmt::format("line {}", placed.law.line);
  const LinkJoint& law = placed.law;
  const bool one_way = law.kind == MotionKind::hinge || law.kind == MotionKind::slide;
  if (one_way)
    add_laws(placed, options, joint, comment, remarks);
  else
    name_lost_laws(law, law.kind == MotionKind::ball, remarks);
  if ((one_way || law.kind == MotionKind::ball) && (law.stiffness > 0 || law.damping > 0))
    joint.spring = JointSpring{law.stiffness, law.damping, one_way ? law.rest - placed.value : 0};
  draft.scene.joints.push_back(std::move(joint));
  draft.joint_comments.push_back(std::move(comment));
}

/// A body that hardly weighs anything, between two joints of `part`.
int add_between(const Part& part, int body, std::size_t number, Draft& draft) {
  const Body& carried = draft.scene.bodies[static_cast<std::size_t>(body)];
  Body small;
  small.name = fmt::format("{} joint {}", carried.name, number);
  small.mass = kSmallBody * carried.mass;
  small.inertia = kSmallBody * inertia_about_joints(part) * Eigen::Matrix3d::Identity();
  small.position = carried.position;
  small.orientation = carried.orientation;
  draft.scene.bodies.push_back(std::move(small));
  draft.body_comments.push_back(
      fmt::format("between two joints of \"{}\"; {:g} of its mass", part.name, kSmallBody));
  return static_cast<int>(draft.scene.bodies.size()) - 1;
}

constexpr std::size_t kMostMaterials = 32;

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
      : model_(model), parts_(parts), options_(options), remarks_(remarks) {}

  Draft take() {
    draft_.scene.name = clean_title(model_.name);
    draft_.scene.end = options_.end;
    draft_.scene.gravity = model_.gravity;
    add_ground();
    for (const Part& part : parts_) body_of_.push_back(part.gone ? -1 : add_body(part));
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      const Part& part = parts_[k];
      if (part.gone || part.fixed()) continue;
      const int on = part.parent < 0 ? -1 : body_of_[static_cast<std::size_t>(part.parent)];
      add_joints(part, body_of_[k], on, options_, draft_, remarks_);
    }
    add_common_laws(model_, parts_, options_, draft_, remarks_);
    add_closures(model_, parts_, body_of_, draft_, remarks_);
    if (model_.touches) add_contacts();
    make_unique();
    const Scene& scene = draft_.scene;
    const bool laws =
        any_of(scene.joints, [](const Joint& each) { return each.limits || each.friction > 0; });
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
  using BodyPair = std::pair<int, int>;  // the smaller one first
  struct Material {
    std::string name;
    bool still;
    std::vector<int> bodies;
  };
  using Materials = std::map<Touch, Material>;

  /// Bodies that pass through each other because a joint connects them.
  std::set<BodyPair> joined() const {
    std::set<BodyPair> out;
    for (const Joint& joint : draft_.scene.joints)
      if (joint_rows(joint) >= 3 && joint.second >= 0)
        out.insert(std::minmax(joint.first, joint.second));
    return out;
  }
  /// Those that the file excludes, and neighbours in its tree, where no joint does so.
  std::set<BodyPair> apart(const std::set<BodyPair>& joined) const {
    std::map<std::string, int> named;
    for (std::size_t k = 0; k < parts_.size(); ++k)
      for (const std::string& link : parts_[k].links)
        if (!parts_[k].scenery) named.emplace(link, body_of_[k]);
    std::set<BodyPair> out;
    const auto add = [&](int a, int b) {
      const BodyPair pair = std::minmax(a, b);
      if (a >= 0 && b >= 0 && a != b && joined.count(pair) == 0) out.insert(pair);
    };
    for (const auto& [first, second] : model_.excluded) {
      const auto a = named.find(first), b = named.find(second);
      if (a != named.end() && b != named.end())
        add(a->second, b->second);
      else
        remarks_.add("<exclude> of the world, or of a body without mass", first + " and " + second);
    }
    for (std::size_t k = 0; k < parts_.size(); ++k)
      if (parts_[k].parent >= 0)
        add(body_of_[k], body_of_[static_cast<std::size_t>(parts_[k].parent)]);
    return out;
  }

  /// Bodies that touch alike have one material; those that pass through single others have their
  /// own.
  void add_contacts() {
    const std::set<BodyPair> joined = this->joined();
    std::set<BodyPair> apart;
    std::set<int> own;
    if (model_.touches_itself) apart = this->apart(joined);
    for (const auto& [a, b] : apart) own.insert({a, b});
    const bool touches_itself = model_.touches_itself && own.size() < kMostMaterials;

    Materials moving, still;
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      const Part& part = parts_[k];
      // The base of a URDF is part of the robot, which does not touch itself.
      if (body_of_[k] < 0 || !part.touch || part.shapes.empty() ||
          (part.fixed() && !model_.base_is_said))
        continue;
      Touch touch = *part.touch;
      if (touches_itself && own.count(body_of_[k]) > 0) touch.own = body_of_[k];
      add_to(part.fixed() ? still : moving, touch, body_of_[k]);
    }
    if (options_.ground) {
      Touch touch;
      touch.type = touch.affinity = std::numeric_limits<unsigned>::max();
      add_to(still, touch, 0);
    }
    // How many pairs of bodies of two materials are not joined.
    std::map<int, const std::string*> material_of;
    for (const Materials* of : {&moving, &still})
      for (const auto& [touch, material] : *of)
        for (const int body : material.bodies) material_of[body] = &material.name;
    std::map<std::pair<std::string, std::string>, long> joints;
    for (const auto& [a, b] : joined)
      if (material_of.count(a) > 0 && material_of.count(b) > 0)
        ++joints[std::minmax(*material_of[a], *material_of[b])];
    const auto add = [&](const Materials::value_type& a, const Materials::value_type& b) {
      const auto first = static_cast<long>(a.second.bodies.size()),
                 second = static_cast<long>(b.second.bodies.size());
      const long all = &a == &b ? first * (first - 1) / 2 : first * second;
      const bool can_meet = all > joints[std::minmax(a.second.name, b.second.name)] &&
                            (b.second.still || touches_itself) &&
                            apart.count(std::minmax(a.first.own, b.first.own)) == 0;
      draft_.scene.pairs.push_back(pair_of(a, b, can_meet));
    };
    for (auto a = moving.begin(); a != moving.end(); ++a) {
      for (const auto& b : still) add(*a, b);
      for (auto b = a; b != moving.end(); ++b) add(*a, *b);
    }
    const std::vector<Pair>& pairs = draft_.scene.pairs;
    if (!any_of(pairs, [](const Pair& pair) { return pair.touch; }))
      return draft_.scene.pairs.clear();
    for (const auto& [body, name] : material_of)
      draft_.scene.bodies[static_cast<std::size_t>(body)].material = *name;
    if (!touches_itself)
      remarks_.add("contacts of the robot with itself (touch = false in a [[pair]])");
  }
  void add_to(Materials& of, Touch touch, int body) {
    // Materials differ by what is asked of them only.
    if (options_.friction) {
      touch.friction = *options_.friction;
      touch.tangential = true;
    }
    const bool still = draft_.scene.bodies[static_cast<std::size_t>(body)].fixed;
    auto found = of.find(touch);
    if (found == of.end() && of.size() >= kMostMaterials) {
      remarks_.add(fmt::format("kinds of contact beyond the first {} have the rule of the first",
                               kMostMaterials));
      found = of.begin();
    }
    if (found == of.end()) {
      const char* const stem = still ? "ground" : "robot";
      const std::string name =
          of.empty() ? std::string(stem) : fmt::format("{} {}", stem, of.size() + 1);
      found = of.emplace(touch, Material{name, still, {}}).first;
    }
    found->second.bodies.push_back(body);
  }
  /// By MuJoCo's rules.
  static Pair pair_of(const Materials::value_type& a, const Materials::value_type& b,
                      bool can_meet) {
    const Touch &first = a.first, &second = b.first;
    Pair pair;
    pair.first = a.second.name;
    pair.second = b.second.name;
    pair.touch =
        can_meet && ((first.type & second.affinity) != 0 || (second.type & first.affinity) != 0);
    if (pair.touch && (first.tangential || second.tangential))
      pair.friction = std::max(first.friction, second.friction);
    return pair;
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
    each_once(draft_.scene.couplings);
  }

  const Model& model_;
  const std::vector<Part>& parts_;
  const ImportOptions& options_;
  Remarks& remarks_;
  Draft draft_;
  std::vector<int> body_of_;  // of each part
};

}  // namespace

void add_joints(const Part& part, int body, int on, const ImportOptions& options, Draft& draft,
                Remarks& remarks) {
  const Chain& chain = part.joints;
  if (count(chain, MotionKind::free) > 0) {
    for (const PlacedJoint& each : chain) name_lost_laws(each.law, false, remarks);
    if (chain.size() > 1)
      remarks.add("joints in a row with a free one, which leaves nothing of them", part.name);
    return;
  }
  if (chain.size() == 1) return add_single(chain[0], body, on, options, draft, remarks);
  const bool plain = !any_of(chain, [&](const PlacedJoint& j) { return has_laws(j, options); });
  if (std::optional<Joint> one = plain ? as_one(chain) : std::nullopt) {
    one->name = names(chain);
    one->first = body;
    one->second = on;
    draft.joint_comments.push_back(
        fmt::format("{} joints from line {} on", chain.size(), chain.front().law.line));
    draft.scene.joints.push_back(std::move(*one));
    return;
  }
  remarks.add(fmt::format("small bodies between joints in a row ({:g} of the mass)", kSmallBody),
              part.name);
  int below = on;
  for (std::size_t k = 0; k < chain.size(); ++k) {
    const int above = k + 1 < chain.size() ? add_between(part, body, k + 1, draft) : body;
    add_single(chain[k], above, below, options, draft, remarks);
    below = above;
  }
}

Draft make_draft(const Model& model, const std::vector<Part>& parts, const ImportOptions& options,
                 Remarks& remarks) {
  return Drafting(model, parts, options, remarks).take();
}

namespace {

struct Side {
  bool found = false;
  int body = -1;  // -1: the world
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
};

Side side_of(const std::string& link, const std::vector<Part>& parts,
             const std::vector<int>& body_of) {
  if (link == "world") return {true};
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const Part& part = parts[k];
    const auto found = std::find(part.links.begin(), part.links.end(), link);
    if (found == part.links.end() || part.gone || part.scenery) continue;
    const auto place = static_cast<std::size_t>(found - part.links.begin());
    return {true, body_of[k], part.pose * part.places[place]};
  }
  return {};
}

}  // namespace

void add_closures(const Model& model, const std::vector<Part>& parts,
                  const std::vector<int>& body_of, Draft& draft, Remarks& remarks) {
  const auto is_held = [&](int body) {
    return body < 0 || draft.scene.bodies[static_cast<std::size_t>(body)].fixed;
  };
  for (const Closure& each : model.closures) {
    const Side first = side_of(each.first, parts, body_of);
    const Side second = side_of(each.second, parts, body_of);
    if (!first.found || !second.found || first.body == second.body ||
        (is_held(first.body) && is_held(second.body))) {
      remarks.add("equalities of bodies that do not move against each other", each.name);
      continue;
    }
    Joint joint;
    joint.kind = each.weld ? JointKind::fixed : JointKind::ball;
    joint.name = each.name;
    joint.first = first.body;
    joint.second = second.body;
    joint.at = first.pose * each.at;
    if (joint.first < 0) std::swap(joint.first, joint.second);
    draft.scene.joints.push_back(std::move(joint));
    draft.joint_comments.push_back(fmt::format("line {}, closes a loop", each.line));
  }
  const auto is_moved = [](const Part& part) {
    return any_of(part.joints, [](const PlacedJoint& joint) {
      return joint.value != joint.law.reference &&
             (joint.law.kind == MotionKind::hinge || joint.law.kind == MotionKind::slide);
    });
  };
  if (!model.closures.empty() && any_of(parts, is_moved))
    remarks.add("loops are closed where the joints start, not where the file has them at zero");
}

}  // namespace tether::scene::import
